"""When solvers of an image's fields stop: the energy that is left, and the bound of it."""

import numpy as np
import pytest

from alphacut.rve.image.fields.clamped import (
    ClampedOperator,
    ClampedPreconditioner,
    free_unknowns,
)
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.fields.element import airy_element, displacement_element
from alphacut.rve.image.fields.operator import Operator
from alphacut.rve.image.fields.preconditioner import FourierPreconditioner
from alphacut.rve.image.fields.reference import Reference
from alphacut.rve.image.fields.side import (
    DISPLACEMENT,
    SOLVED_LOADS,
    STRESS,
    least_energy,
    solve_side,
)
from alphacut.rve.image.fields.solver import ConvergenceError
from alphacut.rve.image.fields.system import System, inner
from alphacut.rve.image.solve import solve_image

ELEMENTS = [displacement_element(0.7), airy_element(0.7)]


def random_moduli(rng, shape, span=1e3):
    """Two phases whose moduli differ by up to `span`, each on a random share of the pixels."""
    phases = np.exp(rng.uniform(0, np.log(span), (2, 2)))
    mask = rng.random(shape) < rng.uniform(0.1, 0.9)
    mask.flat[:2] = True, False
    return tuple(np.where(mask, *pair) for pair in phases)


def excess(found, solved):
    """Most by which a bound is off the one of solved fields in any strain, relative."""
    pairs = ((found.upper, solved.upper), (solved.lower, found.lower))
    return max(np.linalg.eigvals(np.linalg.solve(b, a)).real.max() - 1 for a, b in pairs)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("accuracy", [1e-2, 1e-5])
def test_bounds_are_as_close_to_those_of_solved_fields_as_asked(seed, accuracy):
    rng = np.random.default_rng([seed, 1])
    moduli = random_moduli(rng, rng.integers(2, 24, 2))
    solved = solve_image(*moduli, solver=ConjugateGradient(1e-12)).bounds
    found = solve_image(*moduli, solver=ConjugateGradient(accuracy)).bounds
    assert excess(found, solved) < 3 * accuracy + 1e-9


@pytest.mark.parametrize("element", ELEMENTS, ids=["displacement", "stress"])
@pytest.mark.parametrize("seed", range(4))
def test_no_system_lacks_more_energy_than_its_accuracy(element, seed):
    """With bulk moduli nearly equal the first steps gain nearly nothing: a pause, not the end."""
    rng = np.random.default_rng([seed, 517])
    mask = np.kron(rng.random((5, 5)) < 0.2, np.ones((4, 4))) > 0
    mask[:4, :4] = True
    moduli = np.where(mask, 1.4785, 1.4780)[None], np.where(mask, 92.2, 1.78)[None]
    exact = system_of(element, *moduli)
    solved = ConjugateGradient(1e-14).solve(exact).fields
    shares = []
    for accuracy in 10.0 ** np.arange(-8, 0):
        system = system_of(element, *moduli)
        wrong = ConjugateGradient(accuracy).solve(system).fields - solved
        energy = inner(wrong, system.operator.apply(wrong))
        shares.append((energy / system.scale / accuracy).max())
    assert max(shares) <= 1 + 1e-5
    assert max(shares) > 0.02  # so no work is wasted


def system_of(element, trace, deviator):
    """The system of three loads on periodic fields."""
    constant = Reference.between(trace, deviator, exchange=element.order == 2)
    inverse = FourierPreconditioner.of(element, constant.trace, constant.deviator, trace.shape[1:])
    operator, modes = Operator(element, trace, deviator), element.mean_modes(SOLVED_LOADS)
    scale = least_energy(element, trace, deviator, modes)
    least = constant.least(trace, deviator)
    return System(operator, inverse, operator.load(modes), scale, least)


@pytest.mark.parametrize("clamped", [False, True])
@pytest.mark.parametrize("element", ELEMENTS, ids=["displacement", "stress"])
@pytest.mark.parametrize("seed", range(3))
def test_no_field_has_less_energy_than_the_constant_material_says(element, clamped, seed):
    """All ratios of a small image, as eigenvalues; uniform fields have none."""
    rng = np.random.default_rng(seed)
    shape = (5, 6)
    trace, deviator = (m[None] for m in random_moduli(rng, shape, span=100))
    reference = Reference.between(trace, deviator, exchange=element.order == 2)
    kind = ClampedPreconditioner if clamped else FourierPreconditioner
    inverse = kind.of(element, reference.trace, reference.deviator, shape)
    free = free_unknowns(element, shape) if clamped else np.ones((element.types, *shape))
    units = np.eye(free.size)[free.ravel() == 1].reshape(1, -1, element.types, *shape)
    operator = Operator(element, trace, deviator)
    if clamped:
        operator = ClampedOperator(operator, free)
    energies = operator.apply(units)
    ratios = np.linalg.eigvals(
        inverse.apply(units).reshape(-1, free.size) @ energies.reshape(-1, free.size).T
    ).real
    least = reference.least(trace, deviator)[0]
    ratios = ratios[np.abs(ratios) > 1e-6 * least]
    assert least <= ratios.min() < 3 * least


@pytest.mark.parametrize("side", [DISPLACEMENT, STRESS], ids=lambda side: side.name)
def test_petsc_stops_by_the_same_bound_unless_a_tolerance_is_named(side):
    pytest.importorskip("petsc4py")
    from alphacut.rve.image.petsc_solver import PetscSolver

    moduli = [m[None] for m in random_moduli(np.random.default_rng(4), (12, 10), span=300)]
    solved = solve_side(side, *moduli, solver=ConjugateGradient(1e-12)).energy.value[0]

    def lacking(solver):
        value = solve_side(side, *moduli, solver=solver).energy.value[0]
        return np.linalg.eigvals(np.linalg.solve(solved, value)).real.max() - 1

    for options in ({}, {"ksp_type": "minres", "pc_type": "none"}, {"ksp_max_it": "500"}):
        assert lacking(PetscSolver(1e-6, options)) < 3e-6
    assert lacking(PetscSolver(1e-6, {"ksp_rtol": "0.5"})) > 1e-3


def test_petsc_methods_that_never_arrive_are_refused():
    pytest.importorskip("petsc4py")
    from alphacut.rve.image.petsc_solver import PetscSolver

    moduli = [m[None] for m in random_moduli(np.random.default_rng(5), (8, 8), span=300)]
    with pytest.raises(ConvergenceError, match=r"not converged in 20 calls .* take another"):
        solve_side(STRESS, *moduli, solver=PetscSolver(1e-9, {"ksp_type": "preonly"}))


def test_the_energy_left_is_bounded_by_the_residual():
    rng = np.random.default_rng(6)
    element = displacement_element()
    moduli = [m[None] for m in random_moduli(rng, (6, 6), span=30)]
    system = system_of(element, *moduli)
    wrong = rng.normal(size=system.load.shape)
    residual = system.operator.apply(wrong)
    assert (inner(wrong, residual) <= system.lacking(residual)).all()


def test_what_a_watch_raises_ends_both_sides_at_once():
    """Ctrl-C does not wait for a solution; the share done is told while it is under way."""
    calls = []

    def watch():
        calls.append(1)
        if len(calls) == 6:
            raise KeyboardInterrupt

    shear = np.random.default_rng(1).uniform(1, 100, (24, 24))
    with pytest.raises((KeyboardInterrupt, InterruptedError)):
        solve_image(3 * shear, shear, solver=ConjugateGradient(1e-12, watch=watch))
    assert 6 <= len(calls) < 20
    calls.clear()
    solve_image(3 * shear, shear, solver=ConjugateGradient(1e-3, watch=lambda: calls.append(1)))
    assert len(calls) > 6
