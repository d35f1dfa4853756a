"""The documentation: its links lead somewhere, its Python runs, its commands exist, its generated
pages are up to date.
"""

import os
import re
import shlex
import subprocess
import sys
from dataclasses import fields
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

from alphacut.commands.parser import split_petsc
from alphacut.docs import library_page
from alphacut.docs.case_format import commands, page
from alphacut.entry import COMMANDS, main, parsers
from alphacut.fuzzy.decisions.limits import Decision
from alphacut.fuzzy.samples.result import FuzzyResult

ROOT = Path(__file__).parents[3]
PAGES = sorted(
    [
        *(ROOT / "docs").rglob("*.md"),
        *(
            ROOT / name
            for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")
            if (ROOT / name).is_file()
        ),
    ]
)
DOORS = {
    "rve solve": "cell",
    "rve image": "image",
    "fuzzy modulus": "modulus",
    "frame envelope": "envelope",
    "stochastic microstructure": "microstructure",
}


def blocks(path, language):
    """Fenced code blocks of one language."""
    return re.findall(
        rf"^ *```{language}\n(.*?)^ *```",
        path.read_text(encoding="utf-8"),
        flags=re.MULTILINE | re.DOTALL,
    )


def name(path):
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_links_lead_somewhere(path):
    text = re.sub(r"```.*?```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if not re.match(r"https?:|#|mailto:", target):
            assert (path.parent / target.partition("#")[0]).exists(), (
                f"{name(path)} links to {target}"
            )


@pytest.mark.parametrize(
    ("path", "block"),
    [(path, block) for path in PAGES for block in blocks(path, "python")],
    ids=lambda x: getattr(x, "stem", ""),
)
def test_python_blocks_run(path, block):
    subprocess.run(
        [sys.executable, "-c", block],
        check=True,
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=120,
    )


@pytest.mark.parametrize(
    ("path", "block"),
    [
        (path, block)
        for path in PAGES
        for block in blocks(path, "toml")
        if block.startswith("schema")
    ],
    ids=lambda x: getattr(x, "stem", ""),
)
def test_whole_cases_run_to_a_report(path, block, tmp_path, capfd):
    """A case that a page shows in full, in a folder of its own beside `cases`, in its quick form."""
    (tmp_path / "cases").symlink_to(ROOT / "cases")
    (tmp_path / "my").mkdir()
    (tmp_path / "my" / "case.toml").write_text(block, encoding="utf-8")
    case, out = str(tmp_path / "my" / "case.toml"), str(tmp_path / "results")
    assert main(["check", case]) == 0, capfd.readouterr().err
    assert capfd.readouterr().err == ""
    assert main(["run", case, "--quick", "--no-figures", "--out", out]) == 0, capfd.readouterr().err
    assert main(["report", out]) == 0


def documented():
    """Every call of this program in a console block."""
    for path in PAGES:
        for block in blocks(path, "(?:console|sh|bash)"):
            for line in block.replace("\\\n", " ").splitlines():
                if match := re.search(
                    r"(?:python -m (alphacut|rve|fuzzy|frame|stochastic)|^\s*alphacut) (.+)",
                    line.partition("#")[0],
                ):
                    yield path, match[1] or "alphacut", match[2]


@pytest.mark.parametrize(
    ("path", "package", "rest"),
    list(documented()),
    ids=lambda x: x if isinstance(x, str) else x.stem,
)
def test_documented_commands_exist(path, package, rest):
    words, _ = split_petsc([word for word in shlex.split(rest) if word != "…"])
    if package != "alphacut":
        words[0] = DOORS[f"{package} {words[0]}"]
    _, made = parsers("alphacut", COMMANDS)
    _, left = made[words[0]].parse_known_args([*words[1:], *(["CASE"] if "…" in rest else [])])
    assert not left


def entered():
    """Programs that the documentation calls through ./enter, with what tells one from another."""
    text = "\n".join(path.read_text(encoding="utf-8") for path in PAGES)
    found = re.findall(r"\./enter ((?:jupyter|python -m) [\w.]+|[a-z][\w.-]*)", text)
    return sorted(set(found))


@pytest.mark.parametrize("command", entered())
def test_programs_behind_enter_exist(command, tmp_path):
    python = tmp_path / "python"
    python.write_text('#!/bin/sh\necho "$@"\n')
    python.chmod(0o755)
    there = {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}", "ALPHACUT_INSIDE": "1"}
    words = command.split()
    if words[0] not in ("jupyter", "alphacut") and len(words) == 1:
        words = ["sh", "-c", f"command -v {words[0]}"]
    called = subprocess.run([ROOT / "enter", *words], capture_output=True, text=True, env=there)
    assert called.returncode == 0, called.stderr
    if command != words[-1] and "-m" in called.stdout.split():
        assert find_spec(called.stdout.split()[1]), called.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    "path", [path for path in PAGES if path.parent.name in ("docs", "howto")], ids=name
)
def test_console_blocks_run(path, tmp_path):
    (tmp_path / "cases").symlink_to(ROOT / "cases")
    for number, block in enumerate(
        block for block in blocks(path, "toml") if block.startswith("schema")
    ):
        (tmp_path / "my").mkdir(exist_ok=True)
        name_of = re.search(r"my/(\w+\.toml)", path.read_text(encoding="utf-8"))
        (tmp_path / "my" / (name_of[1] if name_of else f"{number}.toml")).write_text(
            block, encoding="utf-8"
        )
    for block in blocks(path, "console"):
        lines = [line.replace("./enter ", "") for line in block.splitlines()]
        lines = [
            line
            for line in lines
            if "…" not in line and not re.search(r"run cases/paper|report results/paper$", line)
        ]
        script = "\n".join(lines)
        done = subprocess.run(
            ["bash", "-euc", script],
            capture_output=True,
            text=True,
            cwd=tmp_path,
            timeout=900,
            check=False,
        )
        assert done.returncode == 0, f"{lines}\n{done.stderr[-2000:]}"


def test_the_job_array_runs(tmp_path):
    (tmp_path / "cases").symlink_to(ROOT / "cases")
    script = blocks(ROOT / "docs" / "howto" / "clusters.md", "sh")[0]
    for number in ("0", "3"):
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "SLURM_ARRAY_TASK_ID": number}
        subprocess.run(["bash", "-euc", script], check=True, cwd=tmp_path, env=environment)
    files = sorted(path.name for path in (tmp_path / "results" / "array").glob("*.nc"))
    assert files == ["0.2.nc", "0.35.nc"]


def test_generated_pages_are_up_to_date():
    stored = (ROOT / "docs" / "case-format.md").read_text(encoding="utf-8")
    assert stored == page(), (
        "make it anew: python -m alphacut.docs.case_format > docs/case-format.md"
    )
    text = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    assert text == commands(), (
        "make it anew: python -m alphacut.case_format commands > docs/commands.md"
    )
    text = (ROOT / "docs" / "library.md").read_text(encoding="utf-8")
    assert text == library_page.page(), (
        "make it anew: python -m alphacut.docs.library_page > docs/library.md"
    )
    for kind in (FuzzyResult, Decision):
        rows = text.partition(f"\n## {kind.__name__}\n")[2].partition("\n## ")[0]
        assert {one.name for one in fields(kind)} <= set(re.findall(r"^\| `(\w+)`", rows, re.M))
    names = [
        name
        for package in ("fuzzy", "stochastic", "rve", "frame")
        for name in import_module(package).__all__
        if name.islower()
    ]
    assert len(names) > 10
    assert all(f"| `{name}()` |" in text for name in names)


def test_the_gallery_shows_every_figure_of_the_paper_that_holds_data():
    page = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    shown = re.findall(r"^## Figs?\. (\d+)(?: to (\d+))?: ", page, flags=re.MULTILINE)
    numbers = [n for first, last in shown for n in range(int(first), int(last or first) + 1)]
    assert set(numbers) == set(range(3, 38))
    pictures = re.findall(r"\]\((pictures/gallery/[^)]+)\)", page)
    assert len(pictures) == len(shown)
    assert all((ROOT / "docs" / name).is_file() for name in pictures)
