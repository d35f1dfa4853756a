"""The product-space model on several MPI ranks gives what it gives on one."""

import json
import os
import re
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("alphacut.rve.fenicsx")

from alphacut.rve import Phase, PrismModel
from alphacut.stochastic import HermiteMap

pytestmark = pytest.mark.skipif(shutil.which("mpirun") is None, reason="no mpirun")

ROOT = Path(__file__).parents[3]
FEW, ALL = 2, 5
"""Numbers of the models of prisms that are solved, from the first on, beside one of a level set."""
MODELS = """
import numpy as np
from mpi4py import MPI
from alphacut.rve import Ellipse, LevelSetModel, Phase, PrismModel
from alphacut.stochastic import HermiteMap

radii, small = HermiteMap(0.1337, 0.1, 0.8663, 0.1692), HermiteMap(0.2, 0.1, 0.5, 0.1)
MUMPS = {"ksp_type": "preonly", "pc_type": "cholesky"}
MUMPS["pc_factor_mat_solver_type"] = "mumps"
solved = []
for layers, radius_map, options in (
    (5, radii, {"stiffness": True}),
    (3, small, {"outline": Ellipse(2.0), "petsc": MUMPS, "estimate": False}),
    (3, radii, {"modulus_range": (75e9, 85e9)}),
    (3, radii, {"petsc": {"level_pc_type": "gamg", "ksp_rtol": "1e-12"}}),
    (172, radii, {"estimate": False}),  # PETSc takes the parts of one rank in 2 goes, of the other in 3
)[:count]:
    size = 0.4 if layers > 5 else 0.5
    model = PrismModel(size, layers, parallel=True, **options)
    solved.append(model.solve(radius_map, Phase(20e9), [Phase(78e9), Phase(80e9)])[1])
ignoring = LevelSetModel(lambda x, y, theta: np.hypot(x, y) - radii(theta), 0.4, 4, parallel=True)
phases = {"matrix": Phase(20e9), "inclusion": Phase(80e9)}
results = []
for result in (*solved, ignoring.solve(radii.distribution, phases)[0]):
    values = [*result.curve.mean, *result.curve.s11, *result.curve.s12, *result.checks.values()]
    results.append([values, result.iterations, result.unknowns, result.estimated_error, result.modulus])
"""
ON_ALL_RANKS = f"""
import gc, json, sys
from mpi4py import MPI
sys.modules.update({{"gmsh": None}} if MPI.COMM_WORLD.rank else {{}})
{MODELS}
from petsc4py import PETSc
from alphacut.fuzzy import FailedError
from alphacut.rve import MeshModel

if MPI.COMM_WORLD.rank == 0:
    print(json.dumps(results), flush=True)
for modulus in (70e9, 75e9, 80e9):
    model = PrismModel(0.6, 2, parallel=True, estimate=False)
    model.solve(small, Phase(20e9), [Phase(modulus)])
    gc.collect()
    PETSc.garbage_view(MPI.COMM_WORLD)
try:
    phases = {{"matrix": Phase(20e9), "particle": Phase(80e9)}}
    MeshModel("meshes/unlike-sides.msh", parallel=True).solve(radii.distribution, phases)
except FailedError as error:
    print("refused", flush=True)
"""


def run(ranks, *command):
    started = subprocess.Popen(
        ["mpirun", "-n", str(ranks), sys.executable, *command],
        # a rank of Open MPI that waits for another one leaves it the core
        env=os.environ | {"OMPI_MCA_mpi_yield_when_idle": "1"},
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        printed, errors = started.communicate(timeout=300)
    except subprocess.TimeoutExpired:
        started.terminate()  # mpirun, which ends its ranks; killed, it would leave them spinning
        raise
    assert started.returncode == 0, errors
    return printed


@cache
def alone(count):
    """Results of the models in this process."""
    names = {"count": count}
    exec(MODELS, names)
    return names["results"]


@cache
def several(ranks, count):
    """What a number of ranks prints."""
    return run(ranks, "-c", f"count = {count}\n{ON_ALL_RANKS}")


@pytest.mark.parametrize(
    ("ranks", "count"),
    [(2, FEW), *(pytest.param(ranks, ALL, marks=pytest.mark.slow) for ranks in (2, 3))],
)
def test_any_number_of_ranks_gives_the_same_means_iterations_and_errors(ranks, count):
    """Of models whose cells Gmsh meshes: it can be imported on the first rank alone."""
    found = json.loads(several(ranks, count).splitlines()[0])
    for one, many in zip(alone(count), found, strict=True):
        assert many[0] == pytest.approx(one[0], rel=1e-10, abs=2e-8)
        assert many[1:3] == [list(one[1]), one[2]]
        assert many[3] == pytest.approx(one[3], rel=1e-5, nan_ok=True)
        assert many[4] == pytest.approx(one[4], rel=1e-12)


def test_a_refusal_on_the_first_rank_ends_all():
    assert several(2, FEW).split()[-2:] == ["refused", "refused"]


def test_solvers_of_earlier_samples_are_freed_on_all_ranks():
    """PETSc keeps what Python drops on several ranks until all clean up together."""
    counts = re.findall(r"Rank 0:: Total entries: (\d+)", several(2, FEW))
    assert len(counts) == 3
    assert len(set(counts)) == 1, counts


def test_only_one_rank_prints_and_the_command_shares_a_cell():
    solve = ["-m", "rve", "solve", "cases/paper.toml", "--method", "prism", "--json", "-"]
    two = json.loads(run(2, *solve, "--set", "mesh.size=0.4", "--set", "mesh.layers=4"))
    radius = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)
    one = PrismModel(0.4, 4, estimate=False).solve(radius, Phase(20e9), [Phase(80e9)])[0]
    assert two["E_GPa"] == pytest.approx(one.modulus / 1e9, rel=1e-10)
    assert two["unknowns"] == one.unknowns
    text = run(2, *solve[:-2], "--set", "mesh.size=0.5", "--set", "mesh.layers=2")
    assert text.count("Cell: one UFL form over prisms") == 1


FIELDS = """
import numpy as np
from alphacut.rve import Phase, PrismModel
from alphacut.stochastic import HermiteMap

model = PrismModel(0.5, 2, parallel=parallel)
fields = model.fields(HermiteMap(0.2, 0.1, 0.6, 0.1), Phase(20e9), [Phase(80e9)])
"""


def test_fields_of_a_shared_cell_are_whole_on_each_rank_and_in_one_file(tmp_path):
    meshio = pytest.importorskip("meshio")
    names = {"parallel": False}
    exec(FIELDS, names)
    one = names["fields"]
    path = tmp_path / "fields.vtu"
    expected = one.write(tmp_path / "one.vtu")
    script = f"""
parallel = True
{FIELDS}
from mpi4py import MPI
assert fields.write({str(path)!r}) == {expected}
assert fields.writes == (MPI.COMM_WORLD.rank == 0)
np.savez({str(tmp_path)!r} + f"/{{MPI.COMM_WORLD.rank}}.npz", **vars(fields))
"""
    run(2, "-c", script)
    for rank in range(2):
        with np.load(tmp_path / f"{rank}.npz") as found:
            for name in ("points", "cells", "phase", "node"):
                assert np.array_equal(found[name], getattr(one, name))
            for name in ("displacement", "stress"):
                value = getattr(one, name)
                assert found[name] == pytest.approx(value, rel=1e-6, abs=1e-7 * abs(value).max())
    [cells] = meshio.read(path).cells
    assert len(cells.data) == 3 * len(one.cells)


BOUNDS = """
import json
from mpi4py import MPI
from alphacut.rve import MeshModel, Phase
from alphacut.stochastic import TruncatedNormal

phases = {"matrix": Phase(20e9), "inclusion": Phase(80e9)}
model = MeshModel("meshes/paper-coarse.msh", parallel=True)
found = model.bounds(TruncatedNormal(-3, 3), phases)
bounds = [found.lower.tolist(), found.upper.tolist()]
"""


@pytest.mark.slow
def test_bounds_of_a_mesh_are_the_same_on_ranks_without_prisms_of_some_layers():
    names = {}
    exec(BOUNDS, names)
    printed = run(3, "-c", f"{BOUNDS}\nif MPI.COMM_WORLD.rank == 0:\n    print(json.dumps(bounds))")
    for ours, others in zip(names["bounds"], json.loads(printed), strict=True):
        for row, other in zip(ours, others, strict=True):
            assert other == pytest.approx(row, rel=1e-7, abs=1e-7 * ours[0][0])
