"""A cached kernel is compiled again where a helper or constant of another file has changed."""

import ast
import importlib
import inspect
import os
import shutil
import subprocess
import sys
from pathlib import Path

from alphacut.frame.calculus import kernels

FILES = {
    "__init__.py": "",
    "frame/units.py": "FACTOR = 2.0\n",
    "frame/helper.py": """
from alphacut.frame.calculus.kernels import compiled
from alphacut.frame.units import FACTOR

@compiled
def scaled(x):
    return FACTOR * x
""",
    "frame/caller.py": """
from alphacut.frame.calculus.kernels import compiled
from alphacut.frame.helper import scaled

@compiled
def shifted(x):
    return scaled(x) + 1.0
""",
}
CALL = """
from alphacut.frame.caller import shifted
print(shifted(3.0), sum(shifted.stats.cache_hits.values()))
"""


def test_a_changed_helper_or_constant_changes_the_result(tmp_path: Path) -> None:
    """Times and sizes of the changed files are as before."""
    package = tmp_path / "alphacut"
    (package / "frame/calculus").mkdir(parents=True)
    shutil.copy(inspect.getfile(kernels), package / "frame/calculus/kernels.py")

    def result(**changed: str) -> list[float]:
        for name, text in FILES.items():
            file = package / name
            file.write_text(changed.get(file.stem, text))
            os.utime(file, (1e9, 1e9))
        told = subprocess.run(
            [sys.executable, "-Bc", CALL], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert not told.stderr
        return [float(x) for x in told.stdout.split()]

    assert result() == [7.0, 0]
    assert result() == [7.0, 1]  # from the cache
    assert result(helper=FILES["frame/helper.py"].replace("*", "-")) == [0.0, 0]
    assert result(units="FACTOR = 5.0\n") == [16.0, 0]
    assert result() == [7.0, 0]


def test_what_kernels_read_from_other_files_is_in_their_digests() -> None:
    """A constant that a kernel imports stands in the file that it is imported from."""
    importlib.import_module("alphacut.frame")
    found = 0
    for module in map(sys.modules.get, kernels.with_kernels):
        assert module is not None
        read = {
            name
            for x in vars(module).values()
            if hasattr(x, "py_func") and x.__module__ == module.__name__
            for name in x.py_func.__code__.co_names
        }
        tree = ast.parse(inspect.getsource(module))
        for line in (x for x in ast.walk(tree) if isinstance(x, ast.ImportFrom)):
            for name in read & {x.name for x in line.names}:
                if line.module.startswith("alphacut"):
                    source = inspect.getsource(importlib.import_module(line.module))
                    assert f"\n{name} = " in source or f"\ndef {name}(" in source, name
                    found += 1
    assert found
