"""The product-space model on several MPI ranks gives what it gives on one."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("dolfinx")
ROOT = Path(__file__).parents[3]
SOLVE = [
    "-m",
    "rve",
    "solve",
    "cases/paper.toml",
    "--mesh-size",
    "0.3",
    "--layers",
    "4",
    "--json",
    "-",
]


def run(command, **environment):
    done = subprocess.run(
        command,
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    return done.returncode, done.stdout, done.stderr


def solve(ranks, *options):
    start = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    return run([*start, sys.executable, *SOLVE, *options])


@pytest.mark.skipif(shutil.which("mpirun") is None, reason="no mpirun")
@pytest.mark.parametrize("ranks", [2, 3])
def test_any_number_of_ranks_gives_the_same_result(ranks):
    code, alone, _ = solve(1)
    assert code == 0
    code, together, errors = solve(ranks)
    assert code == 0, errors
    one, many = json.loads(alone), json.loads(together)  # one object: only one rank prints
    assert many["E_GPa"] == pytest.approx(one["E_GPa"], rel=1e-12)
    assert many["curve"]["s11"] == pytest.approx(one["curve"]["s11"], rel=1e-10)
    assert many["curve"]["s12"] == pytest.approx(one["curve"]["s12"], rel=1e-10)
    assert many["unknowns"] == one["unknowns"]


@pytest.mark.skipif(shutil.which("mpirun") is None, reason="no mpirun")
def test_more_ranks_than_layers_are_refused():
    code, printed, errors = solve(5)
    assert code != 0
    assert printed == ""
    assert "5 MPI ranks for 4 layers" in errors
