"""Wheel and source archive: what pip installs in a Python of its own, and that it shares no name.

Nothing of alphacut is imported here: ``python -m pytest -m slow tests/environment/test_wheel.py`` runs
with any Python that has pytest.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path
from zipfile import ZipFile

import pytest

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]
NESTED = ("frame", "fuzzy", "rve", "stochastic")
OTHERS = ("frame", "stochastic")  # names of this project's folders that PyPI has as well
BUILD = "from setuptools import build_meta; print(build_meta.build_sdist('dist'))"
ONCE = """
import sys
from alphacut.entry import main
for name in ("fuzzy", "frame", "rve", "stochastic"):
    __import__(f"alphacut.{name}")
print(sorted(name for name in sys.modules if name.partition(".")[0] in ("fuzzy", "frame", "rve", "stochastic")))
"""


class Venv:
    """A virtual environment without anything of the surrounding one."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        closed = ("PYTHON", "ALPHACUT")
        self.variables = {k: v for k, v in os.environ.items() if not k.startswith(closed)}
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)

    def run(self, program: str, *words: object, cwd: Path | None = None, status: int = 0) -> str:
        """Standard output of one of its programs; standard error where it is to fail."""
        command = [str(self.folder / "bin" / program), *map(str, words)]
        done = subprocess.run(
            command,
            cwd=cwd or self.folder,
            env=self.variables,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == status, f"{command}: {done.stdout}\n{done.stderr}"
        return done.stderr if status else done.stdout


def copied(folder: Path) -> Path:
    """The checkout, links as links, without what programs left in it."""
    left = shutil.ignore_patterns("__pycache__", ".*_cache", "*.egg-info", ".hypothesis")

    def ignored(path: str, names: list[str]) -> set[str]:
        top = {".git", "build", "results"} if Path(path) == ROOT else set()
        return top | set(left(path, names))

    shutil.copytree(ROOT, folder, symlinks=True, ignore=ignored)
    return folder


@pytest.fixture(scope="module")
def venv(tmp_path_factory):
    """A virtual environment."""
    return Venv(tmp_path_factory.mktemp("venv"))


@pytest.fixture(scope="module")
def archive(venv, tmp_path_factory):
    """The source archive."""
    source = copied(tmp_path_factory.mktemp("source") / "alphacut")
    venv.run("pip", "install", "--quiet", "setuptools>=77")
    name = venv.run("python", "-c", BUILD, cwd=source).split()[-1]
    return source / "dist" / name


@pytest.fixture(scope="module")
def wheel(venv, archive):
    """The wheel, built from the unpacked source archive."""
    shutil.unpack_archive(archive, archive.parent)
    source = archive.parent / archive.name.removesuffix(".tar.gz")
    venv.run("pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", archive.parent, source)
    (file,) = archive.parent.glob("*.whl")
    return file


@pytest.fixture(scope="module")
def installed(venv, wheel):
    """The virtual environment with the wheel in it, and what cases need."""
    venv.run("pip", "install", "--quiet", f"{wheel}[cases]")
    return venv


def sources() -> set[str]:
    """Files that a wheel must hold, by their names in it."""
    folders = {"alphacut": "", **{name: "alphacut/" for name in NESTED}}
    return {
        prefix + path.relative_to(ROOT).as_posix()
        for name, prefix in folders.items()
        for path in (ROOT / name).rglob("*")
        if path.suffix in {".py", ".html", ".css", ".js", ".toml", ".mplstyle"}
        or path.name == "py.typed"
    }


def test_the_wheel_owns_one_name_and_holds_every_file(wheel):
    names = set(ZipFile(wheel).namelist())
    assert {name.partition("/")[0].partition("-")[0] for name in names} == {"alphacut"}
    assert {name for name in names if ".dist-info/" not in name} == sources()


def test_the_archive_holds_what_tests_need(archive):
    with tarfile.open(archive) as content:
        files = {name.partition("/")[2] for name in content.getnames()}
    for folder in ("tests", "benchmarks", "cases", "demos", "docs", "findings", "meshes"):
        here = {path.relative_to(ROOT).as_posix() for path in (ROOT / folder).rglob("*")}
        assert {file for file in here if "__pycache__" not in file} <= files
    for folder in NESTED:  # once, where they are imported from
        here = {path.relative_to(ROOT).as_posix() for path in (ROOT / folder).rglob("*.py")}
        assert {f"alphacut/{file}" for file in here} <= files
        assert not here & files
    for name in (
        "enter",
        "Makefile",
        ".ci/run",
        ".ci/slow",
        "README.md",
        "CONTRIBUTING.md",
        "CHANGELOG.md",
    ):
        assert name in files


def program_of(page: str) -> str:
    """The one Python program of a page."""
    text = (ROOT / page).read_text(encoding="utf-8")
    (program,) = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    return program


def test_without_an_extra_frames_and_functions_work_and_other_doors_name_theirs(wheel, tmp_path):
    venv = Venv(tmp_path / "bare")
    venv.run("pip", "install", "--quiet", wheel)
    listed = json.loads(venv.run("pip", "list", "--format=json"))
    names = {package["name"].lower() for package in listed} - {"pip", "alphacut"}
    assert {"numpy", "scipy", "numba", "joblib", "threadpoolctl"} <= names
    assert not {"sympy", "xarray", "pandas", "pydantic", "matplotlib", "pillow"} & names
    assert len(names) <= 10
    function = program_of("docs/howto/installation.md")
    assert venv.run("python", "-c", program_of("README.md")).startswith("bounds guaranteed")
    assert venv.run("python", "-c", function).startswith("bounds estimated")
    message = venv.run(
        "python", "-c", f"{function}\npropagate(deflection, inputs).to_dataset()", status=1
    )
    assert message.endswith("xarray is missing; pip install 'alphacut[cases]'\n")
    message = venv.run("alphacut", "check", ROOT / "cases/paper.toml", status=1)
    assert len(message.splitlines()) == 1
    assert "pip install 'alphacut[cases]'" in message


def works(venv: Venv, folder: Path) -> None:
    """README's ten lines, a series cell, an envelope, a report; no class exists twice."""
    shutil.copytree(ROOT / "cases", folder / "cases")
    envelope = venv.run("python", "-c", program_of("README.md"), cwd=folder)
    assert envelope.startswith("bounds guaranteed")
    case = "cases/paper.toml"
    cell = venv.run("alphacut", "cell", case, "--method=series", "--json=-", cwd=folder)
    assert 22 < json.loads(cell)["E_GPa"] < 26
    words = ("cases/pendulum.toml", "--no-figures", "--out=envelope")
    venv.run("alphacut", "run", *words, cwd=folder)
    assert (folder / "envelope/envelope_all.nc").stat().st_size > 1000
    venv.run("alphacut", "run", "cases/porous.toml", "--no-figures", "--out=results", cwd=folder)
    venv.run("alphacut", "report", "results", cwd=folder)
    assert "</html>" in (folder / "results" / "report.html").read_text(encoding="utf-8")
    assert venv.run("python", "-c", ONCE, cwd=folder).strip() == "[]"


def owner(venv: Venv, name: str) -> str:
    """File from which the virtual environment imports a name."""
    program = f"import importlib.util as u; print(u.find_spec({name!r}).origin)"
    return venv.run("python", "-c", program).strip()


def test_it_works_alone_beside_others_of_the_same_names_and_after_them(installed, tmp_path):
    works(installed, tmp_path / "alone")
    installed.run("pip", "check")
    # alone: stochastic 0.6 would take NumPy back to 1.26, below what pandas and contourpy need
    installed.run("pip", "install", "--quiet", "--no-deps", *OTHERS)
    works(installed, tmp_path / "beside")
    for name in OTHERS:
        assert "alphacut" not in owner(installed, name)
    installed.run("pip", "uninstall", "--quiet", "--yes", *OTHERS)
    works(installed, tmp_path / "after")


def test_one_line_says_what_is_missing(installed, tmp_path):
    shutil.copytree(ROOT / "cases", tmp_path / "cases")
    words = ("cell", "cases/paper.toml", "--method=prism")
    message = installed.run("alphacut", *words, cwd=tmp_path, status=2)
    assert len(message.splitlines()) == 1
    assert "pip install 'alphacut[cell]'" in message
