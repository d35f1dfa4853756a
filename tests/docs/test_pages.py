"""The pages build without a warning, their table of equations is true, and demos run."""

import ast
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.alphacut.small import replaced

ROOT = Path(__file__).parents[2]
DEAR = ("bone", "mesh_bounds", "own_law_and_outline", "product_space_cell", "rock")  # demos
QUICKER = {
    "data": {"range(1000)": "range(20)"},
    "random_inputs": {"random_base2(8)": "random_base2(4)"},
    "rock": {"SIDE = 20": "SIDE = 10"},
    "tutorial": {
        "inputs, progress=False": "inputs, alpha=(0, 1), progress=False",
        "duration=5.0": "alpha=(0, 1), duration=1.0",
    },
}
"""Texts that replace others in a demo, so that it has less to compute."""
EQUATIONS = (ROOT / "docs/theory/equations.md").read_text(encoding="utf-8")
ROW = re.compile(r"^\| (\d+) \|.*\| `([\w/]+\.py)` \| (?:`([\w.]+)`)? ?\|$", re.MULTILINE)


BIBLIOGRAPHY = (ROOT / "docs/theory/bibliography.md").read_text(encoding="utf-8")
SOURCE = re.compile(r"^\| [^|]+ \| ([^,|]+),[^|]*\((\d{4})\) \| `([\w/]+\.py)` \|$", re.MULTILINE)


def test_sources_are_cited_where_the_bibliography_says():
    rows = [row for row in BIBLIOGRAPHY.splitlines() if row.startswith("| ")][1:]
    sources = SOURCE.findall(BIBLIOGRAPHY)
    assert len(rows) == len(sources) > 20
    for author, year, file in sources:
        text = " ".join((ROOT / file).read_text(encoding="utf-8").split())
        assert re.search(rf"{re.escape(author)}\b.{{0,120}}?{year}", text), (author, file)


def test_the_table_of_equations_has_all_of_the_paper_and_leads_to_the_code():
    rows = ROW.findall(EQUATIONS)
    assert [int(number) for number, _, _ in rows] == list(range(1, 24))
    for number, file, name in rows:
        tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
        assert not name or set(name.split(".")) <= defined(tree), number


def defined(tree):
    """Names that a file defines: functions, classes, their attributes and constants."""
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
    return names


def anchors(page):
    """Ends of links to the headings of a page: words in small letters, joined by hyphens."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_links_within_the_project_lead_somewhere():
    pages = [
        *ROOT.glob("*.md"),
        *(ROOT / "benchmarks").rglob("*.md"),
        *(ROOT / "docs").rglob("*.md"),
    ]
    for page in pages:
        for link in re.findall(r"\]\(([^):]+)\)", page.read_text(encoding="utf-8")):
            file, _, anchor = link.partition("#")
            target = page.parent / file if file else page
            assert target.exists() or target.with_suffix(".py").exists(), (page, link)
            assert not anchor or anchor in anchors(target), (page, link)


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
    monkeypatch.setenv("PICTURES", str(tmp_path))
    display = ["xvfb-run", "-a"] if shutil.which("xvfb-run") else []
    if "pyvista" in text:
        command = [*display, sys.executable, demo]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        assert run.returncode == 0, run.stderr[-2000:]
    else:
        file = tmp_path / demo.name
        file.write_text(replaced(text, QUICKER.get(demo.stem, {})), encoding="utf-8")
        runpy.run_path(str(file), run_name="__main__")
    if "PICTURES" in text and (display or "pyvista" not in text):
        picture = tmp_path / f"{demo.stem}.png"  # an empty scene has a fifth of these bytes
        assert picture.stat().st_size > 10_000


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
