"""Damping by a ratio: every mode decays at it, and derivatives follow the modes."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import StoreyFrame
from alphacut.frame.structures.linear import evaluate, frequencies

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
    modal = np.array([[model.parameters[name] for name in names]])
    found = matrices(model, names, modal, derivatives=True).damping
    h = 1e-4 * modal[0]

    def at(*moved):
        point = modal + np.sum([sign * h[k] * np.eye(len(names))[k] for k, sign in moved], axis=0)
        return matrices(model, names, point).damping.value

    for i in range(len(names)):
        difference = (at((i, 1)) - at((i, -1))) / (2 * h[i])
        size = max(np.abs(difference).max(), 1e-9)
        assert np.abs(found.first[i] - difference).max() < 1e-6 * size
        for j in range(len(names)):
            four = [at((i, a), (j, b)) * a * b for a in (1, -1) for b in (1, -1)]
            difference = sum(four) / (4 * h[i] * h[j])
            scale = np.abs(found.value).max() / (modal[0, i] * modal[0, j])
            assert np.abs(found.second[i, j] - difference).max() < 2e-5 * scale
