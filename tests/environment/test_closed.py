"""Nothing in the caller's home folder or variables changes what runs inside the environment."""

import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PYTHON = f"python{sys.version_info.major}.{sys.version_info.minor}"
SITE = f".local/lib/{PYTHON}/site-packages"
FALSE = "raise SystemExit('a planted file was run')\n"
IMPORTS = "import sys, numpy, pint; print(numpy.__file__, pint.__file__, *sys.path)"
MATPLOTLIB = (
    "import matplotlib; print(matplotlib.matplotlib_fname(), matplotlib.rcParams['savefig.dpi'])"
)
KERNEL = """
import os
from IPython.paths import get_ipython_dir
from jupyter_core.paths import jupyter_config_dir, jupyter_data_dir
folders = get_ipython_dir(), jupyter_config_dir(), jupyter_data_dir()
print(*(folder.startswith(os.environ["HOME"]) for folder in folders))
"""
CLOSING = (
    "PYTHONNOUSERSITE",
    "XDG_CONFIG_HOME",
    "MPLCONFIGDIR",
    "IPYTHONDIR",
    "JUPYTER_CONFIG_DIR",
    "JUPYTER_DATA_DIR",
)
# name: what is planted below the home folder, variables that point to it, what is asked
PLANTS = {
    "user site": ({f"{SITE}/numpy.py": FALSE, f"{SITE}/pint.py": FALSE}, {}, IMPORTS),
    "PYTHONPATH": ({"lib/pint.py": FALSE}, {"PYTHONPATH": "lib"}, IMPORTS),
    "PYTHONHOME": ({"lib/pint.py": FALSE}, {"PYTHONHOME": "lib"}, IMPORTS),
    "PYTHONUSERBASE": ({f"base/{SITE[7:]}/pint.py": FALSE}, {"PYTHONUSERBASE": "base"}, IMPORTS),
    "matplotlibrc": ({".config/matplotlib/matplotlibrc": "savefig.dpi: 7\n"}, {}, MATPLOTLIB),
    "MPLCONFIGDIR": ({"my/matplotlibrc": "savefig.dpi: 7\n"}, {"MPLCONFIGDIR": "my"}, MATPLOTLIB),
    "notebooks": ({".jupyter/x": "", ".ipython/x": ""}, {}, KERNEL),
}


def environment(home: Path, variables: dict[str, str]) -> dict[str, str]:
    """Variables of a caller with the given home folder, in which some variables point."""
    own = {**os.environ, "HOME": str(home), "ALPHACUT_CACHE": str(home.parent / "cache")}
    return {**own, **{name: str(home / folder) for name, folder in variables.items()}}


def answer(command: tuple[str, ...], variables: dict[str, str]) -> tuple[int, str]:
    """Exit status and standard output of a command."""
    run = subprocess.run(command, env=variables, capture_output=True, text=True, check=False)
    return run.returncode, run.stdout


def plant(home: Path, name: str) -> dict[str, str]:
    """Write what one of `PLANTS` has below a home folder; the variables that point to it."""
    files, variables, _ = PLANTS[name]
    for file, text in files.items():
        (home / file).parent.mkdir(parents=True, exist_ok=True)
        (home / file).write_text(text, encoding="utf-8")
    return environment(home, variables)


@pytest.fixture(scope="module")
def unplanted(tmp_path_factory):
    """Answer of a command to a caller with an empty home folder."""
    empty = tmp_path_factory.mktemp("empty")
    return cache(lambda *command: answer(command, environment(empty, {})))


@pytest.mark.parametrize("name", PLANTS)
def test_what_is_planted_changes_nothing(name, unplanted, tmp_path):
    command = (str(ROOT / "enter"), "python", "-c", PLANTS[name][2])
    assert unplanted(*command)[0] == 0
    assert answer(command, plant(tmp_path, name)) == unplanted(*command)


@pytest.mark.parametrize("name", PLANTS)
def test_the_plant_would_change_an_open_environment(name, unplanted, tmp_path):
    command = (sys.executable, "-c", PLANTS[name][2])
    planted, own = plant(tmp_path, name), PLANTS[name][1]
    opened = {key: v for key, v in planted.items() if key in own or key not in CLOSING}
    assert answer(command, opened) != unplanted(str(ROOT / "enter"), *command)


def test_a_command_answers_the_same(unplanted, tmp_path):
    case = str(ROOT / "cases" / "porous.toml")
    command = (str(ROOT / "enter"), "python", "-m", "alphacut", "check", case)
    for name in PLANTS:
        plant(tmp_path, name)
    assert unplanted(*command)[0] == 0
    assert answer(command, environment(tmp_path, {"PYTHONPATH": "lib"})) == unplanted(*command)


def test_options_of_petsc_stay_outside(tmp_path):
    (tmp_path / ".petscrc").write_text("-planted 1\n", encoding="utf-8")
    planted = {**environment(tmp_path, {}), "PETSC_OPTIONS": "-planted 1"}
    program, bare = (
        f"{start}; from petsc4py import PETSc; print(PETSc.Options().hasName('planted'))"
        for start in ("import alphacut.rve.slices.model, alphacut.rve.solver.krylov", "pass")
    )
    enter = str(ROOT / "enter")
    assert answer((enter, "python", "-c", program), planted) == (0, "False\n")
    assert answer((enter, "python", "-c", bare), planted) == (0, "True\n")  # read without it
