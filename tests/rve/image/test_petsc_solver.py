"""PETSc on the matrix-free operators."""

import numpy as np
import pytest

from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.fields.side import DISPLACEMENT, STRESS, solve_side
from alphacut.rve.image.fields.solver import ConvergenceError
from alphacut.rve.solver.options import OptionError

pytest.importorskip("petsc4py")


@pytest.fixture
def moduli():
    mask = np.random.default_rng(0).random((1, 12, 10)) < 0.4
    return np.where(mask, 20.0, 3.0), np.where(mask, 11.0, 1.0)


@pytest.mark.parametrize("side", [DISPLACEMENT, STRESS], ids=lambda side: side.name)
@pytest.mark.parametrize("options", [{}, {"ksp_type": "minres", "ksp_norm_type": "preconditioned"}])
def test_petsc_finds_the_same_bounds(moduli, side, options):
    from alphacut.rve.image.petsc_solver import PetscSolver

    own = solve_side(side, *moduli, solver=ConjugateGradient(1e-11))
    found = solve_side(side, *moduli, solver=PetscSolver(1e-11, options), division=1)
    assert np.allclose(found.energy.value, own.energy.value, rtol=1e-8, atol=1e-8)
    assert 2 < found.iterations < 100


def test_petsc_options_count_and_strangers_are_refused(moduli):
    from alphacut.rve.image.petsc_solver import PetscSolver

    with pytest.raises(ConvergenceError, match="stopped after 2 iterations"):
        solve_side(STRESS, *moduli, solver=PetscSolver(options={"ksp_max_it": "2"}))
    with pytest.raises(OptionError, match="no use for -rve_ksp_nonsense"):
        solve_side(STRESS, *moduli, solver=PetscSolver(options={"ksp_nonsense": "2"}))
