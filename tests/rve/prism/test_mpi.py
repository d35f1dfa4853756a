"""The product-space model on several MPI ranks gives what it gives on one."""

import json
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("dolfinx")

from alphacut.rve.mesh.periodicity import identify
from alphacut.rve.mesh.prism_grid import PrismGrid
from alphacut.rve.mesh.triangulation import triangulate
from alphacut.rve.prism.system import PrismSystem
from alphacut.rve.solver.constraints import LevelNumbering

ROOT = Path(__file__).parents[3]
SOLVE = ["-m", "rve", "solve", "cases/paper.toml", "--mesh-size", "0.3", "--json", "-"]


def run(command):
    made = subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        printed, errors = made.communicate(timeout=300)
    except subprocess.TimeoutExpired:
        made.terminate()  # mpirun, which ends its ranks; killed, it would leave them spinning
        raise
    return made.returncode, printed, errors


def solve(ranks, *options):
    start = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    return run([*start, sys.executable, *SOLVE, *options])


@pytest.mark.skipif(shutil.which("mpirun") is None, reason="no mpirun")
@pytest.mark.parametrize(("ranks", "layers"), [(2, 4), pytest.param(3, 2, marks=pytest.mark.slow)])
def test_any_number_of_ranks_gives_the_same_result(ranks, layers):
    code, alone, _ = solve(1, "--layers", str(layers))
    assert code == 0
    code, together, errors = solve(ranks, "--layers", str(layers))
    assert code == 0, errors
    one, many = json.loads(alone), json.loads(together)  # one object: only one rank prints
    assert many["E_GPa"] == pytest.approx(one["E_GPa"], rel=1e-12)
    assert many["curve"]["s11"] == pytest.approx(one["curve"]["s11"], rel=1e-10)
    assert many["curve"]["s12"] == pytest.approx(one["curve"]["s12"], rel=1e-10)
    assert many["unknowns"] == one["unknowns"]


MODELS = """
import json, sys
import numpy as np
from mpi4py import MPI
from alphacut.rve.cell import LOADS, Phase
from alphacut.rve.mesh.triangulation import reference_radius, triangulate
from alphacut.rve.prism.model import PrismModel, _system
from alphacut.rve.prism.task import PrismTask, Stopwatch
from alphacut.rve.solver.options import SolverOptions
from alphacut.stochastic import HermiteMap

radii, ranks, found = HermiteMap(0.1337, 0.1, 0.8663, 0.1692), MPI.COMM_WORLD, []
for layers, matrix, options in (
    (2, Phase(20e9), {"stiffness": True}),
    (2, Phase(20e9), {"interface": "sign"}),
    (5, Phase(20e9, 0.49), {}),
    (2, Phase(20e9, 0.4999), {"solver": "mumps"}),
):
    model = PrismModel(0.4, layers, parallel=ranks.size > 1, **options)
    curve = model.solve(radii, matrix, [Phase(80e9)])[0].curve
    found.append([*curve.mean, *curve.s11, *curve.s12])
system = _system(triangulate(size=0.4, radius=reference_radius(radii)), 5, ranks.size > 1)
system.move(radii)
solved = PrismTask(system, SolverOptions(), LOADS, Stopwatch()).solve((Phase(20e9), Phase(80e9)))
found.append(ranks.gather(len(solved.total)))
found.append(ranks.gather(system.pattern.getLocalSize()[0]))
if ranks.rank == 0:
    print(json.dumps(found))
"""


@pytest.mark.skipif(shutil.which("mpirun") is None, reason="no mpirun")
def test_more_ranks_than_levels_give_the_same_and_none_has_the_whole():
    """2 layers, whole or cut by the interface, and nearly incompressible ones, on 4 ranks."""
    results = []
    for ranks in (1, 4):
        code, printed, errors = run(["mpirun", "-n", str(ranks), sys.executable, "-c", MODELS])
        assert code == 0, errors
        results.append(json.loads(printed))
    one, four = results
    for k in range(4):
        assert four[k] == pytest.approx(one[k], rel=1e-11)
        assert four[k][:2] == pytest.approx(one[k][:2], rel=1e-12)
    (nodes,), (unknowns,) = one[4:]
    assert sum(four[5]) == unknowns
    assert max(four[4]) < 0.5 * nodes
    assert max(four[5]) < 0.4 * unknowns


ESTIMATE = """
from mpi4py import MPI
from alphacut.rve.cell import Phase
from alphacut.rve.prism.model import PrismModel
from alphacut.stochastic import HermiteMap

radii, ranks = HermiteMap(0.4, 0.1, 0.5, 0.2), MPI.COMM_WORLD
object.__setattr__(radii, "unsendable", lambda: 0)
model = PrismModel(0.5, 2, parallel=ranks.size > 1, estimate=True)
errors = model.solve(radii, Phase(20e9), [Phase(80e9)])[0].errors
if ranks.rank == 0:
    print(*errors["theta"][[0, 2]], *errors["space"][[0, 2]])
"""


@pytest.mark.skipif(shutil.which("mpirun") is None, reason="no mpirun")
def test_two_ranks_declare_the_errors_of_one_for_a_map_that_cannot_be_sent():
    one, two = (run(["mpirun", "-n", n, sys.executable, "-c", ESTIMATE]) for n in "12")
    assert (one[0], two[0]) == (0, 0), two[2]
    assert [*map(float, two[1].split())] == pytest.approx([*map(float, one[1].split())], rel=1e-6)


@pytest.mark.parametrize("layers", [1, 2, 3, 12])
def test_levels_rows_and_loads_are_dealt_out_whatever_the_number_of_ranks(layers):
    grid = PrismGrid(triangulate(size=0.9, radius=0.5), layers)
    numbering = LevelNumbering(grid, identify(grid.plane))
    for ranks in (1, 2, 3, 4, 5, 13, 14, 40):
        owned = numbering.owned(ranks)
        assert [k for rows in owned for k in rows] == list(range(numbering.size))
        worked = [
            (level, load)
            for share in numbering.shares(ranks)
            for level in share.levels
            for load in share.of(range(3))
        ]
        assert sorted(worked) == [(level, load) for level in range(layers + 1) for load in range(3)]


def test_more_ranks_than_wedges_are_refused():
    grid = PrismGrid(triangulate(size=0.9, radius=0.5), 1)
    many = SimpleNamespace(size=10**4, rank=0)
    with pytest.raises(ValueError, match=r"10000 MPI ranks for \d+ wedges; every rank needs a"):
        PrismSystem(grid, many)
