"""Structures with classical modes as Taylor models over the unit box: M(u), K(u), rows, damping.

Covered is M q̈ + D q̇ + K q = −M ι a(t) + Σ b f(t) with D = a M + b K + 2 M Φ diag(ζ_k ω_k) Φᵀ M,
whose undamped modes uncouple the equations of motion. Other structures are refused, with the
reason. A structure of one unknown has one mode, whatever its damping and the factors of its
outputs.
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
class ClassicalStructure:
    """A structure with classical modes over a box of d inputs; n unknowns, m outputs."""

    mass: TaylorModel  # M, (n, n)
    stiffness: TaylorModel  # K, (n, n)
    output_rows: Array  # rows of the outputs on the displacements or a derivative, (m, n)
    output_factors: TaylorModel  # what the outputs are multiplied by, (m,)
    # derivative of the displacements that each output takes, (m,): 0, 1, or 2 for the absolute
    # acceleration
    derivative_orders: Ints
    initial_state: TaylorModel  # initial displacements, then velocities, (2, n)
    ground_pattern: Array  # ι, how the unknowns move with the ground, (n,)
    rayleigh: TaylorModel  # a and b, (2,)
    damping_ratios: TaylorModel  # ζ_k of the modes with mass by rising frequency, (modes,)
    # accelerations M⁻¹ b by each history of forces, by its name, (n,)
    force_accelerations: dict[str, TaylorModel]

    @property
    def unknowns(self) -> int:
        """Number n of unknowns."""
        return len(self.ground_pattern)

    @property
    def distinct_orders(self) -> list[int]:
        """Derivatives of the displacements that some output takes, rising."""
        return [int(order) for order in np.unique(self.derivative_orders)]


def classical_structure(
    system: LinearSystem, parameters: Mapping[str, TaylorModel]
) -> ClassicalStructure:
    """Return the structure whose parameters are scalar Taylor models, by name.

    Raises:
        UnprovedError: Its modes are not known to be classical, or an output takes displacements by
            coefficients that depend on the inputs.
    """
    assembly = system.assembly(parameters)
    if len(assembly.pattern) == 1:
        assembly = _with_damping_by_mass(_with_unit_rows(assembly))
    _require_classical(assembly)
    displacements = assembly.q0
    velocities = assembly.v0
    if assembly.static is not None:
        displacements = displacements + solve(assembly.stiffness, assembly.static)[:, 0]
    if assembly.impulse is not None:
        velocities = velocities + _accelerations(assembly, assembly.impulse)[:, 0]
    force_accelerations = {}
    if assembly.forces is not None:
        accelerations = _accelerations(assembly, assembly.forces)
        names = [name for name in histories(system) if name != "load"]
        force_accelerations = {name: accelerations[:, k] for k, name in enumerate(names)}
    displacement_rows, velocity_rows = _constant_rows(assembly)
    takes_velocity = velocity_rows.any(axis=1)
    takes_acceleration = assembly.accelerated.any(axis=1)
    ratios = assembly.ratios or [assembly.rayleigh[0] * 0.0]
    if len(ratios) == 1:
        ratios = ratios * len(assembly.massive)
    return ClassicalStructure(
        mass=assembly.mass,
        stiffness=assembly.stiffness,
        output_rows=displacement_rows + velocity_rows + assembly.accelerated,
        output_factors=assembly.row_factors,
        derivative_orders=np.where(takes_acceleration, 2, takes_velocity.astype(int)),
        initial_state=stack([displacements, velocities]).T,
        ground_pattern=assembly.pattern,
        rayleigh=stack(list(assembly.rayleigh)),
        damping_ratios=stack(ratios),
        force_accelerations=force_accelerations,
    )


def _with_damping_by_mass(assembly: Assembly[TaylorModel]) -> Assembly[TaylorModel]:
    """Return the same structure of one unknown with its dashpots as damping by the mass.

    With the dashpots d and the weights W, D = d + a M + b K_springs, and K = K_springs − W. Hence
    D = (a + (d + b W)/M) M + b K.
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
    """Return the same structure of one unknown with output rows that depend on no input.

    An output that takes r(u) of the displacement, or of the velocity, is r(u) times a unit of it;
    r(u) becomes a part of its factor.
    """
    if isinstance(assembly.rows, np.ndarray):
        return assembly
    takes_acceleration = (assembly.accelerated[:, 0] != 0).astype(float)
    # The sum of the coefficients of displacement and velocity, one of which is zero.
    coefficients = (assembly.rows @ np.ones((2, 1)))[:, 0]
    return replace(
        assembly,
        rows=(assembly.rows.magnitude() > 0).astype(float),
        row_factors=assembly.row_factors * (coefficients + takes_acceleration),
    )


def _accelerations(assembly: Assembly[TaylorModel], forces: TaylorModel) -> TaylorModel:
    """Return accelerations M⁻¹ b by forces b, shape (n, k); zero for unknowns without mass."""
    massive = assembly.massive
    mass = assembly.mass[massive[:, np.newaxis], massive]
    selection = np.eye(len(assembly.pattern))[:, massive]
    return selection @ solve(mass, forces[massive])


def _require_classical(assembly: Assembly[TaylorModel]) -> None:
    """Raise UnprovedError where dashpots, or damping by the springs alone, couple the modes."""
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
    """Return the rows of the outputs on displacements and on velocities, shape (m, n) each.

    Raises:
        UnprovedError: Rows depend on inputs, or an output takes displacements and velocities.
    """
    if not isinstance(assembly.rows, np.ndarray):
        cure = "take the method proof with few inputs, or leave the overturning moment out"
        raise UnprovedError("the overturning moment adds storeys by factors of inputs", cure)
    displacements, velocities = np.split(assembly.rows, 2, axis=1)
    if (displacements.any(axis=1) & velocities.any(axis=1)).any():
        raise UnprovedError("an output mixes displacements and velocities", "observe them apart")
    return displacements, velocities
