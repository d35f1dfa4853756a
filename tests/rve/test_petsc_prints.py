"""PETSc's own options reach it from the command line and print to standard error alone."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("alphacut.rve.fenicsx")


ROOT = Path(__file__).parents[2]
COARSE = ["--set", "mesh.size=0.5", "--set", "mesh.layers=4"]
SOLVE = ["-m", "rve", "solve", "cases/paper.toml", *COARSE]


def solve(*options, **environment):
    command, variables = [sys.executable, *SOLVE, *options], {**os.environ, **environment}
    return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=variables)


def test_view_and_monitor_print_to_standard_error():
    prints = ("-rve_ksp_view", "-rve_ksp_monitor", "-rve_ksp_converged_reason")
    done = solve("--method", "prism", "--json", "-", *prints)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["E_GPa"] == pytest.approx(24.8073, rel=1e-4)
    assert "KSP Object: (rve_)" in done.stderr
    assert "KSP Object: (rve_level_)" in done.stderr
    assert "preconditioner along θ, 5 levels and 4 mid-levels" in done.stderr
    assert "0 KSP Residual norm" in done.stderr
    assert "Linear rve_ solve converged" in done.stderr


def test_a_complex_build_ends_in_one_line_before_dolfinx_is_imported(tmp_path):
    fake = tmp_path / "petsc4py"
    fake.mkdir()
    (fake / "__init__.py").write_text("def init(arguments): pass\n")
    (fake / "PETSc.py").write_text("import numpy\n\nScalarType = numpy.complex128\n")
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    done = solve("--method", "prism", PYTHONPATH=path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "PETSc is built for complex numbers" in done.stderr


def test_a_sample_of_the_cell_loads_nothing_of_structures():
    program = """
import sys
from alphacut import main
status = main(["cell", "cases/paper.toml", "--quiet"])
modules = [name for name in sys.modules if name.split(".")[0] == "alphacut"]
print(status, len(modules), any("frame" in name for name in modules), "pint" in sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=ROOT)
    status, count, *unneeded = done.stdout.split()
    assert (status, *unneeded) == ("0", "False", "False"), done.stderr
    assert int(count) <= 126
