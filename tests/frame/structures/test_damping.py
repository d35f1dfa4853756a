"""Damping by a ratio: every mode decays at it, and derivatives follow the modes."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import StoreyFrame
from alphacut.frame.structures.linear import evaluate, frequencies
from tests.frame.differences import require_derivatives

FRAME = StoreyFrame(
    (2e4, 1e4, 5e3), (2.5, 2.7, 2.7), 25e9, 1e-6, q0=(0.01, 0.03, 0.08), v0=(0, -0.5, -0.5)
)
RATIO = 0.05
NAMES = ("E", "m2", "l1")


NOMINAL = np.zeros((1, 0))


def matrices(model, names=(), points=NOMINAL, *, derivatives=False):
    return evaluate(model, names, points, derivatives=derivatives)[0]


def decay(model):
    """Damping ratios of the complex modes by rising frequency, found from the state matrix alone."""
    found = matrices(model)
    M, D, K = (x.value[0] for x in (found.mass, found.damping, found.stiffness))
    n = len(M)
    state = np.block(
        [[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, K), -np.linalg.solve(M, D)]]
    )
    values = sorted((x for x in np.linalg.eigvals(state) if x.imag > 0), key=abs)
    return np.array([-x.real / abs(x) for x in values]), np.abs(values)


def test_every_mode_decays_at_the_ratio_and_keeps_its_frequency():
    ratios, omega = decay(replace(FRAME, damping_ratio=RATIO))
    assert np.abs(ratios - RATIO).max() < 1e-12
    assert np.abs(omega / frequencies(FRAME) - 1).max() < 1e-12


def test_rayleigh_damping_has_the_ratios_of_its_factors():
    a, b = 0.08, 0.03
    ratios, omega = decay(replace(FRAME, rayleigh=(a, b)))
    assert ratios == pytest.approx(a / (2 * omega) + b * omega / 2, rel=1e-9)


def test_derivatives_are_those_of_the_modes_at_the_changed_parameters():
    model = replace(FRAME, damping_ratio=RATIO)
    names = (*NAMES, *model.ratios)
    point = np.array([model.parameters[name] for name in names])

    def damping(points):
        return matrices(model, names, points, derivatives=True).damping

    require_derivatives(damping, point, np.full(len(names), 1e-3), within=(1e-8, 1e-8))
