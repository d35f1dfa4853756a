"""Nothing in the caller's home folder or variables changes what runs inside the environment."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
PYTHON = f"python{sys.version_info.major}.{sys.version_info.minor}"
SITE = f".local/lib/{PYTHON}/site-packages"
FALSE = "raise SystemExit('a planted file was run')\n"
IMPORTS = """
import sys
from importlib.util import find_spec
print(*(find_spec(name).origin for name in ("numpy", "pint")), *sys.path)
"""
MATPLOTLIB = """
import matplotlib
print(matplotlib.matplotlib_fname(), matplotlib.rcParams["savefig.dpi"])
"""
KERNEL = """
import os
from IPython.paths import get_ipython_dir
from jupyter_core.paths import jupyter_config_dir, jupyter_data_dir
folders = get_ipython_dir(), jupyter_config_dir(), jupyter_data_dir()
print(*(folder.startswith(os.environ["HOME"]) for folder in folders))
"""
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


ENTER = str(ROOT / "enter")


def environment(home: Path, variables: dict[str, str]) -> dict[str, str]:
    """Variables of a caller with the given home folder, in which some variables point."""
    own = {**os.environ, "HOME": str(home), "ALPHACUT_CACHE": str(home.parent / "cache")}
    return {**own, **{name: str(home / folder) for name, folder in variables.items()}}


def answer(command: tuple[str, ...], variables: dict[str, str]) -> str:
    """Exit status and standard output of a command."""
    run = subprocess.run(command, env=variables, capture_output=True, text=True, check=False)
    return f"{run.returncode} {run.stdout}"


def plant(home: Path, name: str) -> dict[str, str]:
    """Write what one of `PLANTS` has below a home folder; the variables that point to it."""
    files, variables, _ = PLANTS[name]
    for file, text in files.items():
        (home / file).parent.mkdir(parents=True, exist_ok=True)
        (home / file).write_text(text, encoding="utf-8")
    return environment(home, variables)


def test_what_is_planted_changes_nothing(tmp_path):
    """All plants at once, which as many programs ask for, beside an empty home folder."""
    for name in PLANTS:
        plant(tmp_path / "home", name)
    variables = {key: v for _, own, _ in PLANTS.values() for key, v in own.items()}
    planted = environment(tmp_path / "home", variables)
    (tmp_path / "empty").mkdir()
    command = (ENTER, "python", "-c", "".join({program: "" for _, _, program in PLANTS.values()}))
    expected = answer(command, environment(tmp_path / "empty", {}))
    assert expected.startswith("0 ")
    assert expected.endswith("False False False\n")  # no folder of notebooks is in the home folder
    assert answer(command, planted) == expected


def test_options_of_petsc_stay_outside(tmp_path):
    (tmp_path / ".petscrc").write_text("-planted 1\n", encoding="utf-8")
    planted = {**environment(tmp_path, {}), "PETSC_OPTIONS": "-planted 1"}
    program, bare = (
        f"{start}; from petsc4py import PETSc; print(PETSc.Options().hasName('planted'))"
        for start in ("import alphacut.rve.slices.model, alphacut.rve.solver.krylov", "pass")
    )
    assert answer((ENTER, "python", "-c", program), planted) == "0 False\n"
    assert answer((ENTER, "python", "-c", bare), planted) == "0 True\n"  # read without it
