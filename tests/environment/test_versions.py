"""Debian's packages and one wheel that holds several: their versions, and HDF5 beside theirs."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("alphacut.rve.fenicsx")

from alphacut import main
from tests.alphacut.small import CELL, written


def test_results_and_xdmf_are_written_after_dolfinx_was_imported(tmp_path):
    program = """
import alphacut.rve.fenicsx
import h5py, xarray
xarray.Dataset({"x": ("x", [1.0, 2.0])}).to_netcdf("a.nc")
assert xarray.load_dataset("a.nc")["x"][1] == 2
with h5py.File("a.h5", "w") as file:
    file["x"] = [1.0, 2.0]
"""
    command = [sys.executable, "-W", "error:h5py is running", "-c", program]
    folder = {"PYTHONPATH": str(Path(__file__).parents[2])}
    subprocess.run(command, check=True, cwd=tmp_path, env=os.environ | folder)


def test_dolfinx_and_petsc4py_are_named_however_they_were_installed(tmp_path, capfd):
    import dolfinx
    import petsc4py

    assert main(["cell", str(written(tmp_path, CELL)), "--quiet", "--json", "-"]) == 0
    versions = json.loads(capfd.readouterr().out)["versions"]
    assert versions["fenics-dolfinx"].removesuffix(".0") in dolfinx.__version__
    assert versions["petsc4py"] == petsc4py.__version__
