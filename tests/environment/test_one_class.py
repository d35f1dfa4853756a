"""No class exists twice, though each package can be reached by two paths in a checkout."""

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOUBLED = """
import inspect, json, os, sys
seen = {{}}
try:
    {program}
except SystemExit:
    pass
for module in list(sys.modules.values()):
    for name, kind in inspect.getmembers(module, inspect.isclass):
        if kind.__module__ == module.__name__ and (getattr(module, "__file__", None) or "").startswith({root!r}):
            seen.setdefault((os.path.realpath(module.__file__), name), set()).add(id(kind))
print(json.dumps([len(seen), [key[1] for key, kinds in seen.items() if len(kinds) > 1]]))
"""
RUN = (
    "import alphacut.rve, runpy; sys.argv[:] = ['-m', 'solve', '--help'];"
    " runpy.run_module('rve', run_name='__main__', alter_sys=True)"
)


def doubled(program: str) -> tuple[int, list[str]]:
    """Number of this project's classes after a program has run, and those that exist twice."""
    code = DOUBLED.format(program=program, root=str(ROOT))
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    count, names = json.loads(run.stdout.splitlines()[-1])
    return count, names


def test_running_a_package_makes_no_second_class():
    count, names = doubled(RUN)
    assert count > 20
    assert names == []


def test_a_second_class_would_be_seen():
    assert "Cell" in doubled("import alphacut.rve.cell.cell, rve.cell.cell")[1]
