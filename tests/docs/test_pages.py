"""The pages build without a warning, their table of equations is true, and demos run."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EQUATIONS = (ROOT / "docs/theory/equations.md").read_text(encoding="utf-8")
ROW = re.compile(r"^\| (\d+) \|.*\| `([\w/]+\.py)` \| (?:`([\w.]+)`)? ?\|$", re.MULTILINE)
LINES = {"README.md": 130, "CHANGELOG.md": 220, "case-format.md": 200}


def test_every_equation_of_the_paper_has_a_row():
    assert [int(number) for number, _, _ in ROW.findall(EQUATIONS)] == list(range(1, 24))


@pytest.mark.parametrize(("number", "file", "name"), ROW.findall(EQUATIONS))
def test_the_table_of_equations_leads_to_the_code(number, file, name):
    text = (ROOT / file).read_text(encoding="utf-8")
    assert re.search(rf"\b{re.escape(name.split('.')[-1])}\b", text)


def test_no_page_is_too_long():
    pages = [ROOT / "README.md", ROOT / "CHANGELOG.md", *(ROOT / "docs").rglob("*.md")]
    counts = {page: page.read_text(encoding="utf-8").count("\n") for page in pages}
    assert all(count <= LINES.get(page.name, 150) for page, count in counts.items())
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert max(map(len, readme.splitlines())) <= 100


@pytest.mark.parametrize(
    "page", [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))], ids=str
)
def test_links_to_files_lead_somewhere(page):
    for link in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
        assert (page.parent / link).exists() or (page.parent / link).with_suffix(".py").exists(), (
            link
        )


@pytest.mark.parametrize("demo", sorted((ROOT / "demos").glob("*.py")), ids=lambda path: path.stem)
def test_a_demo_runs_and_draws(demo, tmp_path):
    text = demo.read_text(encoding="utf-8")
    drawing = "PICTURES" in text
    if drawing or "dolfinx" in text:
        pytest.importorskip("dolfinx")
    display = ["xvfb-run", "-a"] if drawing and shutil.which("xvfb-run") else []
    run = subprocess.run(
        [*display, sys.executable, demo],
        cwd=ROOT,
        env={**os.environ, "MPLBACKEND": "Agg", "PICTURES": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert run.returncode == 0, run.stderr[-2000:]
    if display:  # an empty scene has a tenth of these bytes
        assert (tmp_path / f"{demo.stem}.png").stat().st_size > 20_000


@pytest.mark.parametrize(
    "block",
    re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL),
)
def test_the_examples_of_the_readme_run(block, capsys):
    exec(compile(block, "README.md", "exec"), {"__name__": "readme"})
    assert "α = 0" in capsys.readouterr().out


@pytest.mark.slow
def test_the_pages_build(tmp_path):
    pytest.importorskip("sphinx")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "-D", "nb_execution_mode=off"]
    run = subprocess.run(
        [*command, ROOT / "docs", tmp_path], capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr[-3000:]
