"""Every console block of README and how-tos runs where its reader stands; so do Python blocks of these.

That is the folder of the project. A block of a case with a title is the file that the commands after it
name. Commands that take long are checked here, and run as they stand by the slow tests.
"""

import itertools
import re
import runpy
import shlex
import subprocess
from pathlib import Path

import pytest

from alphacut import main

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs/howto").glob("*.md"))]
BLOCK = re.compile(r"^```(console|python|toml)\n(.*?)^```", re.MULTILINE | re.DOTALL)
ACCEPTED: set[tuple[tuple[str, ...], str]] = set()
"""Checks of cases that passed, which several commands share."""
FRAGMENTS = ("mpiexec -n 12 python -m mpi4py.futures -m alphacut run cases/suite.toml",)
"""Commands that need a cluster."""


def commands(page):
    """Yields each command of a page's console blocks, with the case that a block before it holds."""
    case = ""
    for kind, block in BLOCK.findall(page.read_text(encoding="utf-8")):
        if kind == "toml" and block.startswith("title ="):
            case = block
        for line in block.replace("\\\n", " ").splitlines() if kind == "console" else ():
            yield shlex.split(line, comments=True), case


COMMANDS = [
    pytest.param(words, case, id=f"{page.stem}-{' '.join(words)}"[:90])
    for page in PAGES
    for words, case in commands(page)
    if words and " ".join(words) not in FRAGMENTS
]
PYTHON = [
    pytest.param(block, id=f"{page.stem}-{number}")
    for page in PAGES[1:]
    for number, (kind, block) in enumerate(BLOCK.findall(page.read_text(encoding="utf-8")))
    if kind == "python"
]


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A folder with what a reader has before him, where nothing is left behind."""
    for name in ("cases", "meshes", "enter", "alphacut", "rve", "frame", "fuzzy", "stochastic"):
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def written(project, words, case):
    """Writes the case of a page as the file that a command names."""
    for word in words:
        if word.endswith(".toml") and "/" not in word:
            assert case, f"no block of the page is {word}"
            (project / word).write_text(case, encoding="utf-8")


@pytest.mark.parametrize(("words", "case"), COMMANDS)
def test_what_a_command_names_is_there_and_is_accepted(words, case, project):
    if words[0] == "make":
        assert re.search(rf"^{words[1]}:", (ROOT / "Makefile").read_text(), re.MULTILINE)
        return
    if words[:2] == ["pip", "install"]:
        extra = re.search(r"\[(\w+)\]", words[2])
        text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
        assert extra is None or re.search(rf"^{extra[1]} = \[", text, re.MULTILINE)
        return
    assert words[0] == "./enter"
    written(project, words, case)
    cases = [word for word in words if word.endswith(".toml")]
    for word in (x for x in words if x.endswith(".py")):
        assert (ROOT / word).is_file()
    if not cases:
        return
    changes = [x for name, x in itertools.pairwise(words) if name == "--set"]
    command = ("check", *cases, *(f"--set={change}" for change in changes), "--quiet")
    if (command, case) not in ACCEPTED:
        assert main(command) == 0
        ACCEPTED.add((command, case))


@pytest.mark.parametrize("block", PYTHON)
def test_a_python_block_runs(block, project, capsys):
    if re.search(r"alphacut\.rve import .*(LevelSet|Mesh|Prism|Slices)", block):
        pytest.importorskip("alphacut.rve.fenicsx")
    if "dask" in block:
        pytest.importorskip("distributed")
    file = project / "block.py"
    quicker = re.sub(r"duration=[\d.]+", "duration=1.0", block).replace(
        "n_workers=2", "n_workers=1"
    )
    file.write_text(quicker, encoding="utf-8")
    runpy.run_path(str(file), run_name="__main__")
    assert capsys.readouterr().out or "savetxt" in block


@pytest.mark.slow
def test_all_commands_run_as_they_stand(project):
    for words, case in (parameters.values for parameters in COMMANDS):
        if words[0] != "./enter":
            continue
        written(project, words, case)
        command = [word for word in words[1:] if word != "--tools"]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        assert run.returncode == 0, (words, run.stderr[-2000:])
