"""Every run of the product space takes its stiffness from the one UFL form of eq. 7."""

from pathlib import Path

import pytest

pytest.importorskip("alphacut.rve.fenicsx")

import ufl

from alphacut.fuzzy import FailedError
from alphacut.rve import LevelSetModel, MeshModel, Phase, PrismModel
from alphacut.rve.prism import model, own_mesh, slices
from alphacut.rve.solver import form
from alphacut.stochastic import HermiteMap, TruncatedNormal

MESH = Path(__file__).parents[3] / "meshes" / "two-particles.msh"
CONE, SOFT, HARD = HermiteMap(0.2, 0.1, 0.6, 0.1), Phase(20e9), Phase(80e9)
FACTORISED = {"ksp_type": "preonly", "pc_type": "cholesky"}
NAMED = {"matrix": SOFT, "inclusion": HARD}


def solve_cone(**options):
    return PrismModel(0.6, 3, estimate=False, **options).solve(CONE, SOFT, [HARD])


def solve_mesh():
    problem = MeshModel(MESH).cached_problem()
    phases = dict.fromkeys(problem.grid.names, HARD) | {"matrix": SOFT}
    return MeshModel(MESH).solve(TruncatedNormal(), phases)


RUNS = {
    "default": solve_cone,
    "an option of the outer solver": lambda: solve_cone(petsc={"ksp_rtol": "1e-9"}),
    "another solver": lambda: solve_cone(petsc=FACTORISED),
    "a campaign's samples of one map": lambda: solve_cone(modulus_range=(70e9, 90e9)),
    "over MPI": lambda: solve_cone(parallel=True),
    "a mesh from a file": solve_mesh,
    "a level set": lambda: LevelSetModel(lambda x, y, t: x**2 + y**2 - 0.25, 0.6, 3).solve(
        CONE.distribution, NAMED
    ),
}


@pytest.fixture
def stiffness_times():
    """Set a factor of the stiffness in the bilinear form alone, and forget compiled forms."""
    caches = [slices.slice_mesh, model.cached_problem, own_mesh._mesh_problem]
    original = form.virtual_work

    def set_factor(factor):
        def scaled(stiffness, strain_of_u, v, weight):
            is_bilinear = bool(ufl.algorithms.extract_arguments(strain_of_u))
            return (factor if is_bilinear else 1.0) * original(stiffness, strain_of_u, v, weight)

        form.virtual_work = scaled
        for cache in caches:
            cache.cache_clear()

    yield set_factor
    form.virtual_work = original
    for cache in caches:
        cache.cache_clear()


@pytest.mark.parametrize("run", RUNS)
def test_another_stiffness_in_the_form_reaches_every_run(run, stiffness_times):
    """The fluctuation is then a hundredth too small, which violates Hill and Mandel's lemma."""
    stiffness_times(1.0)
    assert RUNS[run]()[0].modulus > 20e9
    stiffness_times(1.01)
    with pytest.raises(FailedError, match="Hill–Mandel"):
        RUNS[run]()
