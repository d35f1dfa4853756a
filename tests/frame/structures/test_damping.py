"""Damping by a ratio: every mode decays at it, and derivatives follow the modes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from alphacut.frame import Exact, LinearFlow, StoreyFrame
from tests.frame.differences import require_derivatives

SPRINGS, MASSES = np.array([8e6, 6e6, 3e6]), np.array([2e4, 1e4, 5e3])
FRAME = StoreyFrame(
    MASSES,
    stiffness=SPRINGS,
    q0=(0.01, 0.03, 0.08),
    v0=(0, -0.5, -0.5),
    outputs=("q1", "q2", "q3"),
)
BELOW = np.eye(3) - np.eye(3, k=-1)
SQUARED, SHAPES = eigh(BELOW.T @ np.diag(SPRINGS) @ BELOW, np.diag(MASSES))


def require_decay(frame, ratios):
    """Requires that each mode alone goes on in its shape, as exp(−ζ ω t) cos(ω √(1 − ζ²) t)."""
    for omega, shape, ratio in zip(np.sqrt(SQUARED), SHAPES.T, ratios, strict=True):
        released = replace(frame, q0=shape, v0=-ratio * omega * shape)
        flow = LinearFlow(released, (), 1.0, 0.05, Exact())
        wave = np.exp(-ratio * omega * flow.time)
        wave *= np.cos(omega * np.sqrt(1 - ratio**2) * flow.time)
        exact = wave[:, None] * shape
        found = flow.values(np.zeros((1, 0)))[0]
        assert found == pytest.approx(exact, abs=1e-11 * np.abs(shape).max())


def test_every_mode_decays_at_the_ratio_and_keeps_its_frequency():
    require_decay(replace(FRAME, damping_ratio=0.05), [0.05] * 3)


def test_rayleigh_damping_has_the_ratios_of_its_factors():
    a, b = 0.08, 0.003
    omega = np.sqrt(SQUARED)
    require_decay(replace(FRAME, rayleigh=(a, b)), a / (2 * omega) + b * omega / 2)


def test_derivatives_are_those_of_the_modes_at_the_changed_parameters():
    model = replace(FRAME, damping_ratio=0.05)
    names = ("k1", "m2", "k3", *model.ratios)
    point = np.array([model.parameters[name] for name in names])
    flow = LinearFlow(model, names, 1.0, 0.1, Exact())
    require_derivatives(flow.taylor, point, np.full(len(names), 1e-3), within=(1e-6, 1e-6))
