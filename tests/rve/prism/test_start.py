"""What a single cell loads, and what tells the versions that its tables depend on."""

import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp

from alphacut.rve.cell import Phase
from alphacut.rve.mesh.periodicity import identify
from alphacut.rve.mesh.triangulation import triangulate
from alphacut.rve.planar.system import Cholesky
from alphacut.rve.prism import model as prism_model
from alphacut.rve.prism.model import PrismModel
from alphacut.rve.prism.task import Stopwatch
from alphacut.rve.solver.integrals import MADE_BY, version_of
from alphacut.rve.solver.level_stiffness import LevelPattern
from alphacut.rve.solver.theta_preconditioner import ThetaPreconditioner
from alphacut.stochastic import HermiteMap
from tests.rve.test_ranks import on_ranks, with_mpirun

CELL = """
import sys
from alphacut.rve.cell import Phase
from alphacut.rve.prism.model import PrismModel
from alphacut.stochastic import HermiteMap
from tests.rve.test_ranks import on_ranks, with_mpirun

paper = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)
(found,) = PrismModel(0.4, 4, estimate=True).solve(paper, Phase(20e9), [Phase(80e9)])
assert found.modulus > 20e9
print(*(name for name in ("scipy", "dolfinx", "ufl", "pandas", "matplotlib") if name in sys.modules))
"""


def test_a_cell_and_its_error_are_found_without_libraries_that_are_slow_to_load():
    folder = Path(__file__).parents[3]
    for _ in range(2):  # the first compiles what a new machine has not
        done = subprocess.run(
            [sys.executable, "-c", CELL], cwd=folder, capture_output=True, text=True
        )
    assert (done.stdout.split(), done.returncode) == ([], 0), done.stdout + done.stderr


def test_versions_are_those_of_the_packages():
    for package in (*MADE_BY, "numpy", "petsc4py"):
        assert version(package) in version_of(package)
        assert version_of(package).startswith(package.replace("-", "_"))
    assert version_of("no-such-package") == "none"


@pytest.mark.parametrize(
    ("size", "companion"), [(0.04, 0.16), (0.1, 0.4), (0.15, 0.4), (0.25, 0.5), (0.7, 1.0)]
)
def test_companions_are_coarser_but_not_too_coarse(size, companion):
    assert PrismModel(size)._rough == pytest.approx(companion)


def test_linear_functions_reach_all_nodes_and_the_transposed_brings_loads_back():
    plane, rng = triangulate(size=0.3, radius=0.6), np.random.default_rng()
    period = identify(plane)
    one = object.__new__(ThetaPreconditioner)
    one.ends = period.ends(plane)
    slopes = rng.standard_normal((3, period.vertices, 2, 2))  # of fields that are not periodic too
    nodes = np.zeros((3, 2 * period.count, 2))
    one._inject(nodes, slopes.reshape(3, -1, 2), 0)
    of_vertex = np.concatenate([slopes, np.zeros((3, 1, 2, 2))], axis=1)  # the corner last
    for vertex, unknown in enumerate(period.unknown[: plane.vertices]):
        if unknown >= 0:
            assert (nodes[:, 2 * unknown : 2 * unknown + 2] == of_vertex[:, unknown]).all(), vertex
    for ends, unknown in zip(plane.ends, period.unknown[plane.vertices :], strict=True):
        middle = of_vertex[:, period.unknown[ends]].mean(axis=1)
        assert nodes[:, 2 * unknown : 2 * unknown + 2] == pytest.approx(middle, rel=1e-14)
    loads, back = rng.standard_normal(nodes.shape), np.zeros((3, 2 * period.vertices, 2))
    one._inject(loads, back, 1)
    work = (nodes * loads).sum(), (slopes.reshape(back.shape) * back).sum()
    assert work[0] == pytest.approx(work[1], rel=1e-12)


def test_a_symmetric_matrix_times_vectors_is_that_of_its_lower_triangle():
    rng = np.random.default_rng()
    unknowns = rng.integers(-1, 12, (20, 5))
    pattern = LevelPattern(unknowns)
    rows, columns = pattern.rows_columns
    factor, values = Cholesky(pattern), rng.standard_normal(len(rows))
    lower = sp.csr_matrix((values, (rows, columns)), shape=(pattern.size,) * 2)
    whole = lower + sp.tril(lower, -1).T
    vectors = rng.standard_normal((3, pattern.size)).T  # not contiguous
    assert factor.product(values, vectors) == pytest.approx(whole @ vectors, abs=1e-12)


@pytest.mark.parametrize(("interface", "mixed"), [("conforming", [0]), ("sign", [])])
def test_only_meshes_that_follow_the_interface_have_mixed_elements(interface, mixed):
    model, radii = PrismModel(0.5, 2, interface=interface), HermiteMap(0.1337, 0.1, 0.8663, 0.1692)
    system = model._moved(radii, Stopwatch())
    system.set_poisson((Phase(20e9, 0.4999), Phase(80e9, 0.3)))
    assert list(system.mixed.phases if system.mixed else ()) == mixed


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("size", "expected"), [(0.06, 0.018), (0.1, 0.03), (0.2, 0.06), (1.0, 0.02 * 1.3)]
)
def test_errors_of_first_order_are_foretold_as_they_are(monkeypatch, size, expected):
    """Made-up moduli 1 + 0.3 h, as of a mesh that ignores the interface."""
    model, told = PrismModel(size, interface="sign"), []
    monkeypatch.setattr(prism_model, "mean_moduli", lambda curve: np.full(4, 1 + 0.3 * size))
    monkeypatch.setattr(prism_model, "judged", lambda *_, expected, **__: told.append(expected))
    coarse = np.full(4, 1 + 0.3 * model._rough)
    model._with_errors(SimpleNamespace(curve=None), None, (), np.stack([coarse, coarse]))
    assert told == [pytest.approx(expected / (1 + 0.3 * size), rel=1e-12)]


RANKS = """
import sys
from mpi4py import MPI
from alphacut.rve.cell import Phase
from alphacut.rve.prism import model
from alphacut.stochastic import HermiteMap
from tests.rve.test_ranks import on_ranks, with_mpirun

paper, given, rank = HermiteMap(0.1337, 0.1, 0.8663, 0.1692), [], MPI.COMM_WORLD.rank
model.give_back = lambda: given.append(1)
phases = paper, Phase(20e9), [Phase(80e9)]
model.PrismModel(0.5, 2, parallel=True).solve(*phases)
assert ("gmsh" in sys.modules) == (rank == 0), "one mesh is one rank's work"
asked = model.PrismModel(0.6, 2, parallel=True, estimate=True)
asked._moved(paper, model.Stopwatch())
assert "gmsh" in sys.modules, "of two ranks the second waits idly"
asked.solve(*phases)
assert len(given) == (rank > 0), given
print("done", flush=True)
"""


@with_mpirun
def test_of_two_ranks_the_second_loads_gmsh_early_and_gives_memory_back():
    done = on_ranks(2, RANKS)
    assert done.stdout.split() == 2 * ["done"], done.stderr
