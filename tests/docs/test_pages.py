"""The pages build without a warning, their table of equations is true, and demos run."""

import ast
import os
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DEAR = ("own_law_and_outline", "product_space_cell")  # demos
EQUATIONS = (ROOT / "docs/theory/equations.md").read_text(encoding="utf-8")
ROW = re.compile(r"^\| (\d+) \|.*\| `([\w/]+\.py)` \| (?:`([\w.]+)`)? ?\|$", re.MULTILINE)


BIBLIOGRAPHY = (ROOT / "docs/theory/bibliography.md").read_text(encoding="utf-8")
SOURCE = re.compile(r"^\| [^|]+ \| ([^,|]+),[^|]*\((\d{4})\) \| `([\w/]+\.py)` \|$", re.MULTILINE)


@pytest.mark.parametrize(("author", "year", "file"), SOURCE.findall(BIBLIOGRAPHY))
def test_a_source_is_cited_where_the_bibliography_says(author, year, file):
    text = " ".join((ROOT / file).read_text(encoding="utf-8").split())
    assert re.search(rf"{re.escape(author)}\b.{{0,120}}?{year}", text)


def test_every_row_of_the_bibliography_is_a_source():
    rows = [row for row in BIBLIOGRAPHY.splitlines() if row.startswith("| ")][1:]
    assert len(rows) == len(SOURCE.findall(BIBLIOGRAPHY)) > 20


def test_every_equation_of_the_paper_has_a_row():
    assert [int(number) for number, _, _ in ROW.findall(EQUATIONS)] == list(range(1, 24))


@pytest.mark.parametrize(("number", "file", "name"), ROW.findall(EQUATIONS))
def test_the_table_of_equations_leads_to_the_code(number, file, name):
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    assert not name or set(name.split(".")) <= defined(tree)


def defined(tree):
    """Names that a file defines: functions, classes, their attributes and constants."""
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
    return names


@pytest.mark.parametrize(
    "page", [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))], ids=str
)
def test_links_to_files_lead_somewhere(page):
    for link in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
        assert (page.parent / link).exists() or (page.parent / link).with_suffix(".py").exists(), (
            link
        )


@pytest.mark.parametrize(
    "demo",
    [
        pytest.param(path, marks=[pytest.mark.slow] * (path.stem in DEAR))
        for path in sorted((ROOT / "demos").glob("*.py"))
    ],
    ids=lambda path: path.stem,
)
def test_a_demo_runs_and_draws(demo, tmp_path, monkeypatch):
    text = demo.read_text(encoding="utf-8")
    monkeypatch.chdir(ROOT)
    if "dolfinx" in text:
        pytest.importorskip("alphacut.rve.fenicsx")
    if "PICTURES" not in text:
        runpy.run_path(str(demo), run_name="__main__")
        return
    display = ["xvfb-run", "-a"] if shutil.which("xvfb-run") else []
    variables = {**os.environ, "PICTURES": str(tmp_path)}
    run = subprocess.run(
        [*display, sys.executable, demo], env=variables, capture_output=True, text=True, check=False
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
