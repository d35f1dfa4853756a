"""A case of one undamped floor, whose motion is known in closed form."""

from __future__ import annotations

import numpy as np

RIGIDITY = 24 * 2.5e10 * 1e-6 / 27
"""Stiffness 24 E I / l³ of the storey, in N/m."""
OMEGA = float(np.sqrt(RIGIDITY / 1e3))
"""Natural frequency with a mass of 1 t, in rad/s."""


def one_floor(
    *,
    fuzzy: str,
    duration: float,
    step: float,
    outputs: str = '["q1", "v1"]',
    mass: str = "1000 kg",
    moved: str = "0 m",
    pushed: str = "0 m/s",
) -> str:
    """Text of the case: q = q0 cos ωt + v0 / ω sin ωt.

    Args:
        fuzzy: Fuzzy inputs, as a TOML list.
        duration: Of the motion, in s.
        step: Between nodes, in s.
        outputs: As a TOML list.
        mass: With its unit.
        moved: Displacement at the start, with its unit.
        pushed: Velocity at the start, with its unit.
    """
    return f"""
schema = 1
title = "One floor"
about = "A mass that is moved and pushed"
stages = ["envelope"]
[frame]
masses = ["{mass}"]
lengths = ["3 m"]
modulus = "25 GPa"
second_moment = "1e-6 m^4"
rayleigh_mass = "0 1/s"
displacements = ["{moved}"]
velocities = ["{pushed}"]
outputs = {outputs}
[envelope]
fuzzy = {fuzzy}
duration = "{duration} s"
step = "{step} s"
"""
