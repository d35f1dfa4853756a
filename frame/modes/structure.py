"""Structures with classical modes as Taylor models over the unit box: M(u), K(u), rows, damping.

Covered is M q̈ + D q̇ + K q = −M ι a(t) + Σ b f(t) with D = a M + b K + 2 M Φ diag(ζ_k ω_k) Φᵀ M,
whose undamped modes uncouple the motion; what else a structure has is refused with the word why.
A structure of one unknown has one mode, whatever its damping and the factors of its outputs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.frame.calculus.taylor_model import TaylorModel, solve
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.structures.linear import Assembly, LinearSystem, histories, stack


@dataclass(frozen=True, eq=False)
class Classical:
    """A structure with classical modes over a box of d inputs; n unknowns, m outputs."""

    mass: TaylorModel  # M, (n, n)
    stiffness: TaylorModel  # K, (n, n)
    rows: Array  # what outputs take of the displacements, (m, n)
    factor: TaylorModel  # what they are multiplied by, (m,)
    # which derivative of the motion they take it of, (m,); of order 2 with the ground's
    # acceleration added
    order: Ints
    start: TaylorModel  # initial displacements and velocities, (2, n)
    pattern: Array  # ι, how the unknowns move with the ground, (n,)
    rayleigh: TaylorModel  # a and b, (2,)
    ratio: TaylorModel  # ζ_k of the modes by rising frequency, (modes,), none of massless unknowns
    forced: dict[str, TaylorModel]  # M⁻¹ b of each history of forces by its name, (n,)


def classical_structure(system: LinearSystem, parameters: Mapping[str, TaylorModel]) -> Classical:
    """Matrices, rows and damping of a structure, of parameters by name, each a scalar Taylor model.

    Raises:
        UnprovedError: Its modes are not known to be classical.
    """
    assembly = system.assembly(parameters)
    if len(assembly.pattern) == 1:
        assembly = _with_damping_by_mass(_with_unit_rows(assembly))
    _require_classical(assembly)
    q0, v0 = assembly.q0, assembly.v0
    if assembly.static is not None:
        q0 = q0 + solve(assembly.stiffness, assembly.static)[:, 0]
    if assembly.impulse is not None:
        v0 = v0 + _accelerations(assembly, assembly.impulse)[:, 0]
    forced, names = dict[str, TaylorModel](), [x for x in histories(system) if x != "load"]
    if assembly.forces is not None:
        accelerations = _accelerations(assembly, assembly.forces)
        forced = {name: accelerations[:, k] for k, name in enumerate(names)}
    displacements, velocities = _constant_rows(assembly)
    ratios = assembly.ratios or [assembly.rayleigh[0] * 0.0]
    return Classical(
        mass=assembly.mass,
        stiffness=assembly.stiffness,
        rows=displacements + velocities + assembly.accelerated,
        factor=assembly.row_factors,
        order=np.where(assembly.accelerated.any(1), 2, velocities.any(1).astype(int)),
        start=stack([q0, v0]).T,
        pattern=assembly.pattern,
        rayleigh=stack(list(assembly.rayleigh)),
        ratio=stack(ratios * len(assembly.massive) if len(ratios) == 1 else ratios),
        forced=forced,
    )


def _with_damping_by_mass(assembly: Assembly[TaylorModel]) -> Assembly[TaylorModel]:
    """The same structure of one unknown whose dashpots are damping by the mass.

    With D = d + a M + b K_springs and K = K_springs − W it is D = (a + (d + b W)/M) M + b K.
    """
    a, b = assembly.rayleigh
    dashpots = assembly.dashpots
    if assembly.weights is not None:
        dashpots = dashpots + assembly.weights * b
    return replace(
        assembly,
        springs=assembly.stiffness,
        weights=None,
        dashpots=dashpots * 0.0,
        rayleigh=(a + solve(assembly.mass, dashpots)[0, 0], b),
    )


def _with_unit_rows(assembly: Assembly[TaylorModel]) -> Assembly[TaylorModel]:
    """The same structure of one unknown, whose outputs' rows depend on no input.

    An output that takes r(u) of the displacement, or of the velocity, is r(u) times a unit of it.
    """
    if isinstance(assembly.rows, np.ndarray):
        return assembly
    takes_acceleration = (assembly.accelerated[:, 0] != 0).astype(float)
    coefficients = assembly.rows @ np.ones((2, 1))  # one of the two is zero
    return replace(
        assembly,
        rows=(assembly.rows.magnitude() > 0).astype(float),
        row_factors=assembly.row_factors * (coefficients[:, 0] + takes_acceleration),
    )


def _accelerations(assembly: Assembly[TaylorModel], forces: TaylorModel) -> TaylorModel:
    """Accelerations M⁻¹ b by forces b, shape (n, k); zero for unknowns without mass."""
    a, n = assembly.massive, len(assembly.pattern)
    return np.eye(n)[:, a] @ solve(assembly.mass[a[:, None], a], forces[a])


def _require_classical(assembly: Assembly[TaylorModel]) -> None:
    if assembly.dashpots.magnitude().any():
        raise UnprovedError(
            "dashpots couple the modes", "give damping ratios or Rayleigh's factors in their place"
        )
    if assembly.weights is not None and assembly.rayleigh[1].magnitude() > 0:
        raise UnprovedError(
            "Rayleigh's damping by the springs without the weights couples the modes",
            "give a damping ratio, or leave gravity out",
        )


def _constant_rows(assembly: Assembly[TaylorModel]) -> tuple[Array, Array]:
    """What outputs take of displacements and of velocities, not of both, shape (m, n) each."""
    if not isinstance(assembly.rows, np.ndarray):
        cure = "take the method proof with few inputs, or leave the overturning moment out"
        raise UnprovedError("the overturning moment adds storeys by factors of inputs", cure)
    displacements, velocities = np.split(assembly.rows, 2, axis=1)
    if (displacements.any(1) & velocities.any(1)).any():
        raise UnprovedError("an output mixes displacements and velocities", "observe them apart")
    return displacements, velocities
