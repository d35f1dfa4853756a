"""What is known of modes by sums alone, and what couples those of a block, over the whole box."""

from types import SimpleNamespace

import numpy as np
import pytest

from alphacut.frame import UnprovedError
from alphacut.frame.calculus.taylor_model import TaylorModel, concatenate
from alphacut.frame.modes.blocks import Block
from alphacut.frame.modes.intervening import BlockParticipation, Excitation
from alphacut.frame.modes.truncated_modes import (
    _coupling_factors,
    _largest_within_steps,
    coupling_bounds,
    inverse_form,
)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_remainder_of_an_inverse_form_is_that_of_a_geometric_series(order, rng):
    """Of a (1 + ρ u) the inverse is a geometric series, whose remainder all bounds attain.

    At u = −1 the terms beyond the order N add ρ^(N + 1) / (1 − ρ) of the value in the middle.
    """
    variation, value = rng.uniform(0.2, 0.6), rng.uniform(0.5, 5)
    parts = np.full((1, 1, 1), value), np.full((1, 1, 1), value * variation)
    matrix = TaylorModel(parts, np.zeros((1, 1)), inputs=1, order=order)
    left, right = (matrix.like(rng.uniform(-3, 3, (count, 1))) for count in (2, 3))
    found = inverse_form(matrix, left, right, min_eigenvalue=1 - variation)
    middle = left.value @ right.value.T / value
    for u in (-1.0, 1.0):
        exact = middle / (1 + variation * u)
        off = np.abs(found.at(np.array([[u]]))[0] - exact)
        assert (off <= found.remainder + 1e-12 * np.abs(middle)).all()
    of_series = np.abs(middle) * variation ** (order + 1) / (1 - variation)
    np.testing.assert_allclose(found.remainder, of_series, rtol=1e-9)


def test_coupling_within_a_block_attains_its_bounds_at_nodes_and_between(rng):
    """Of two alike oscillators, of which one is moved and the other read, in closed form.

    With L = λ + ε off the diagonal, N = 1 + ν u and cos(√λ t) as response, the coupling adds
    a (cos(√(λ + ε) t) − cos(√(λ − ε) t))/2. Nodes are a period apart, where late motions are at
    their extremes, so that they stray from lines by twice as much within the steps.
    """
    omega, variation = rng.uniform(5, 20), rng.uniform(0.35, 0.5)
    squared = omega**2
    time = (2 * np.pi * np.arange(30) + np.pi / 2) / omega
    off = 0.05 * omega / time[-1]  # ε, whose phase ε t/(2 ω) stays small

    def polynomial(*coefficients):
        parts = tuple(np.full((1, 1), x) for x in coefficients)
        return TaylorModel(parts, np.zeros(1), inputs=1, order=10)

    mass = polynomial(1.0, variation)
    read = polynomial(1.0, variation / 2)  # a, so that a²/N is about 1
    nothing, zero = mass * 0.0, polynomial(0.0)
    constant = zero.like(np.ones(1))

    def matrix(rows):
        return concatenate([concatenate(row, -1)[None] for row in rows], -2)

    rate = matrix([[constant * squared, constant * off], [constant * off, constant * squared]])
    norm = matrix([[mass, nothing], [nothing, mass]])
    block = Block(np.arange(2), rate, rate, rate, norm)
    of_block = BlockParticipation(
        block,
        output_modes=matrix([[nothing], [read]]),
        modal_forces=matrix([[mass], [nothing]]),
        source_participation=matrix([[constant], [nothing]]),
    )
    structure = SimpleNamespace(
        derivative_orders=np.zeros(1, int),
        distinct_orders=[0],
        output_factors=constant,
        rayleigh=zero.like(np.zeros(2)),
        damping_ratios=zero.like(np.zeros(2)),
    )
    found = SimpleNamespace(
        eigenvalue_low=np.full(2, squared - off), eigenvalue_high=np.full(2, squared + off)
    )
    excitation = Excitation({}, time, ("start",))
    added, deviation, _ = coupling_bounds(structure, of_block, found, excitation)
    largest_read = 1 + variation / 2

    def coupled(t):
        fast, slow = np.cos(np.sqrt(squared + off) * t), np.cos(np.sqrt(squared - off) * t)
        return largest_read * (fast - slow) / 2

    at_nodes = np.abs(coupled(time))
    assert (at_nodes <= added[:, 0] + 1e-12).all()
    assert (at_nodes[-10:] >= 0.9 * added[-10:, 0]).all()
    middles = (time[1:] + time[:-1]) / 2
    between = np.abs(coupled(middles) - (coupled(time[1:]) + coupled(time[:-1])) / 2)
    assert (between <= deviation[1:, 0] + 1e-12).all()
    assert (between[-10:] >= 0.8 * deviation[-10:, 0]).all()


def block_with_modal_masses(masses, outputs, sources):
    """A block of two modes with L = 1 and N = `masses`, read by a and set in motion by β.

    N is 1 at the midpoint of the box, and as given at u = 1.
    """
    unit = TaylorModel.constant(np.eye(2), inputs=1)
    modal_mass = TaylorModel((unit.parts[0], (masses - np.eye(2))[None]), np.zeros((2, 2)), 1)
    block = Block(np.arange(2), unit, unit, unit, modal_mass)
    participation = unit.like(sources[:, np.newaxis])
    return BlockParticipation(
        block,
        output_modes=unit.like(outputs[:, np.newaxis]),
        modal_forces=modal_mass @ participation,
        source_participation=participation,
    )


@pytest.mark.parametrize("delta", [0.0, 0.1, 0.5, 0.8, 0.95])
def test_products_of_shapes_and_sources_are_bounded_by_their_sums(delta):
    """Σ |a_j β_j| reaches √((1 + δ)/(1 − δ)) times √(a N⁻¹ aᵀ β·N β) with δ = ‖N − 1‖₂.

    a belongs to the largest eigenvalue of N, 1 + δ, and β to the smallest one, 1 − δ.
    """
    masses = np.array([[1.0, delta], [delta, 1.0]])
    outputs = np.sqrt((1 + delta) / 2) * np.array([1.0, 1.0])
    sources = np.array([1.0, -1.0]) / np.sqrt(2 * (1 - delta))
    assert outputs @ np.linalg.solve(masses, outputs) == pytest.approx(1)
    assert sources @ masses @ sources == pytest.approx(1)
    of_block = block_with_modal_masses(masses, outputs, sources)
    of_sums = SimpleNamespace(  # the sums at u = 1, and not bounds over the box
        block=of_block.block,
        source_participation=of_block.source_participation,
        output_sums=TaylorModel.constant(np.ones(1), 1),
        source_sums=TaylorModel.constant(np.ones(1), 1),
    )
    structure = SimpleNamespace(output_factors=TaylorModel.constant(np.ones(1), 1))
    of_products = np.abs(outputs * sources).sum()
    by_range = _coupling_factors(structure, of_sums).by_range[0, 0]
    assert of_products <= by_range <= (1 + 1e-12) * of_products
    # Σ |a_j β_j| is bounded with the sums of the whole box, too.
    assert _coupling_factors(structure, of_block).by_range[0, 0] >= of_products


def test_a_block_whose_modal_masses_may_be_singular_is_refused():
    masses = np.array([[1.0, 1.0], [1.0, 1.0]])
    of_block = block_with_modal_masses(masses, np.ones(2), np.ones(2))
    structure = SimpleNamespace(output_factors=TaylorModel.constant(np.ones(1), 1))
    with pytest.raises(UnprovedError, match="singular"):
        _coupling_factors(structure, of_block)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_the_slope_of_a_slow_mode_within_a_step_is_bounded(order, rng):
    """d/dσ of σ^order ∫ exp(σ s) ds from 0 to h, at σ = iω."""
    for omega in 10 ** rng.uniform(-3, 1, 10):
        h = rng.uniform(0.1, 1.0)
        time = np.array([0.0, h])
        _, slopes = _largest_within_steps(
            np.zeros((2, 2)), time, max_force=1.0, max_sigma=omega, order=order
        )
        s = np.linspace(0, h, 4001)
        waves = np.exp(1j * omega * s)
        power = (1j * omega) ** order
        exact = power * np.trapezoid(s * waves, s)
        if order:
            exact += order * (1j * omega) ** (order - 1) * np.trapezoid(waves, s)
        assert slopes[1] >= abs(exact) * (1 - 1e-6)


@pytest.mark.parametrize("order", [3, 4])
def test_forms_of_inverses_stay_within_their_rests(order):
    rng, d, n, shares = np.random.default_rng(order), 3, 4, []
    matrices = rng.normal(size=(d, n, n))
    A = TaylorModel(
        (np.diag([1.0, 2, 3, 5])[None], 0.03 * (matrices + matrices.swapaxes(1, 2))),
        np.zeros((n, n)),
        d,
        order,
    )
    left, right = (
        TaylorModel(
            (rng.normal(size=(1, m, n)), 0.1 * rng.normal(size=(d, m, n))),
            np.zeros((m, n)),
            d,
            order,
        )
        for m in (2, 3)
    )
    found = inverse_form(A, left, right, 0.5)
    for u in rng.uniform(-1, 1, (300, d)):
        (a,), (x,), (y,) = (model.at(u[None]) for model in (A, left, right))
        off = np.abs(x @ np.linalg.inv(a) @ y.T - found.at(u[None])[0])
        shares.append((off / found.remainder).max())
    assert 3e-3 <= max(shares) <= 1
