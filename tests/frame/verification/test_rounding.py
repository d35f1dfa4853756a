"""Rounding of models, tables and boxes without width stays far below the margin that covers it."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from alphacut.frame import Accelerogram, DualProof, StoreyFrame, envelope
from alphacut.frame.bounds.box_proof import ROUNDING_MARGIN
from alphacut.frame.boxes import boxes
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.modes.modal_model import ModalModel
from alphacut.frame.response.tables import Oscillators, Source, grid_over
from alphacut.frame.verification.self_test import structures_at
from alphacut.fuzzy import Crisp, Interval

pytestmark = pytest.mark.slow
DURATION, STEP = 3.0, 0.02


def frame(rng, **values):
    """Two to six storeys on a shaken ground, and the peak that rounding is compared with."""
    n = int(rng.integers(2, 7))
    ground = Accelerogram(STEP, rng.normal(size=round(DURATION / STEP) + 1))
    stiffness, masses = 10 ** rng.uniform(6, 8, n), 10 ** rng.uniform(3, 5, n)
    given = {"damping_ratio": 0.03, "outputs": (f"q{n}", "drift1"), "ground": ground, **values}
    return StoreyFrame(masses, stiffness=stiffness, **given)


def extended_responses(sigma, samples):
    """ρ = ∫ exp(σ τ) f(t − τ) dτ at samples of f, by the recurrence in NumPy's long doubles."""
    sigma, f = sigma.astype(np.clongdouble), samples.astype(np.longdouble)
    h, z = np.longdouble(STEP), sigma * np.longdouble(STEP)
    turn = np.exp(z)
    first = (turn - 1) / z
    second = (turn - first) / z
    rho = [0 * sigma]
    for before, after in pairwise(f):
        rho.append(turn * rho[-1] + h * (after * first - (after - before) * second))
    return np.array(rho)


def test_a_table_rounds_by_less_than_a_tenth_of_the_margin(rng):
    time = STEP * np.arange(round(DURATION / STEP) + 1)
    samples = rng.normal(size=len(time))
    source = Source.named("load", Accelerogram(STEP, samples))
    for omega in 10 ** rng.uniform(0.5, 2.5, 8):
        grid = grid_over((omega, 1.1 * omega), (0.01, 0.05), (9, 4))
        found = Oscillators(grid, time, (0,)).responses(source, 0).value
        sigma = grid.sigma.astype(np.clongdouble)
        exact = source.read(sigma, extended_responses(sigma.ravel(), samples).reshape(found.shape))
        assert np.abs(found - exact).max() <= 0.1 * ROUNDING_MARGIN * np.abs(found).max()


def test_a_model_rounds_by_less_than_a_tenth_of_the_margin(rng):
    """Polynomials of eigenvalues and coefficients, and the waves of these."""
    system = frame(rng)
    names = ("k1", "m2")
    inputs = {x: Interval(0.97 * system.parameters[x], 1.03 * system.parameters[x]) for x in names}
    flow = LinearFlow(system, names, DURATION, STEP, Exact())
    model = ModalModel.of_degree(flow, boxes(inputs, (0,)), 8)
    (load,) = model.loads
    for unit in rng.uniform(-1, 1, (8, 2)):
        powers = np.prod(unit.astype(np.longdouble) ** model.eigenvalue.exponents, axis=1)
        rate = np.tensordot(powers, model.eigenvalue.coefficients.astype(np.clongdouble), 1)
        share = np.tensordot(powers, load.share.coefficients.astype(np.clongdouble), 1)
        exact = 2 * (extended_responses(rate, system.ground.samples) @ share).real
        off = np.abs(model.values(unit[None])[0] - exact).max(0)
        assert (off <= 0.1 * ROUNDING_MARGIN * np.abs(exact).max(0)).all()


@pytest.mark.parametrize("damping", ["ratio", "dashpots"])
def test_boxes_without_width_are_their_exact_motion_within_the_margin(damping, rng):
    for _ in range(20):
        system = frame(rng)
        if damping == "dashpots":
            dampers = rng.uniform(0.01, 0.1) * np.sqrt(system.masses * system.stiffness)
            system = replace(system, damping_ratio=None, dampers=tuple(dampers))
        point = {"k1": system.parameters["k1"], "m1": system.parameters["m1"]}
        crisp = {name: Crisp(x) for name, x in point.items()}
        given = {"duration": DURATION, "step": STEP, "alpha": (0,), "progress": False}
        found = envelope(system, crisp, DualProof(), **given)
        (motion,) = structures_at(system, tuple(point), np.array([list(point.values())]))
        exact = motion.outputs(found.time)
        assert (np.abs(found.upper[0] - exact.values) <= found.error[0] + exact.rounding).all()
        assert (np.abs(found.lower[0] - exact.values) <= found.error[0] + exact.rounding).all()
        assert (found.error[0].max(0) <= 1e-7 * np.abs(exact.values).max(0)).all()
