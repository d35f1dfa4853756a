"""General Lagrangian systems: derivatives of the scheme, agreement with linear ones."""

from __future__ import annotations

import pickle

import numpy as np

from alphacut.frame import (
    LagrangianFlow,
    LagrangianSystem,
    LinearFlow,
    Midpoint,
    StoreyFrame,
    pendulum,
)
from tests.frame.differences import require_derivatives

SWING = pendulum(phi0=1.5, damping=0.1)
POINT = np.array([[1.0, 1.0, 1.5]])
NAMES = ("m", "l", "phi_0")


def test_derivatives_are_those_of_the_scheme():
    f = LagrangianFlow(SWING, NAMES, 4.0, 0.05)
    require_derivatives(f.taylor, POINT[0], np.full(3, 2e-3), within=(1e-7, 1e-6))
    assert np.abs(f.values(POINT) - f.taylor(POINT).value).max() < 1e-12


def test_two_coupled_masses_agree_with_the_linear_integrator():
    motion = ((0.3, 0.2), "ground", (0.1, 0.2), (0.0, -1.0))
    linear = StoreyFrame((2.0, 1.0), (1.0, 1.0), 1.0, 1.0, *motion)

    def lagrangian(q, v, p):
        strains = q[0] ** 2 + (q[1] - q[0]) ** 2
        return (p["m1"] * v[0] ** 2 + v[1] ** 2) / 2 - 24 * p["E"] * strains / 2

    general = LagrangianSystem(
        coordinates=2,
        parameters={"E": 1.0, "m1": 2.0},
        lagrangian=lagrangian,
        initial=lambda p: ([0.1, 0.2], [0.0, -1.0]),
        observed={"q1": lambda q, v, p: q[0], "q2": lambda q, v, p: q[1]},
        force=lambda q, v, p: [-0.3 * v[0], -0.2 * v[1]],
    )
    point = np.array([[1.0, 2.0]])
    a = LinearFlow(linear, ("E", "m1"), 5, 0.05, Midpoint()).taylor(point)
    b = LagrangianFlow(general, ("E", "m1"), 5, 0.05).taylor(point)
    assert np.abs(a.value - b.value).max() < 1e-10
    assert np.abs(a.first - b.first).max() < 1e-9
    assert np.abs(a.second - b.second).max() < 1e-7


def test_the_pendulum_can_be_sent_to_other_processes():
    system, point = pendulum(phi0=0.3), np.array([[0.3]])
    values = LagrangianFlow(system, ("phi_0",), 0.1, 0.01).values(point)
    sent = pickle.loads(pickle.dumps(system))
    assert (LagrangianFlow(sent, ("phi_0",), 0.1, 0.01).values(point) == values).all()
