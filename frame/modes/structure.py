"""Structures with classical modes as Taylor models over the unit box: M(u), K(u), rows, damping.

Covered is M q̈ + D q̇ + K q = −M ι a(t) + Σ b f(t) with D = a M + b K + 2 M Φ diag(ζ_k ω_k) Φᵀ M,
whose undamped modes uncouple the equations of motion. Other structures are refused, with the
reason. A structure of one unknown has one mode, whatever its damping.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.frame.calculus.taylor_model import ORDER, TaylorModel, solve
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.structures.linear import Assembly, LinearSystem, histories, stack


class CoupledModesError(UnprovedError):
    """Undamped modes do not uncouple a structure or its outputs, and damped ones may do."""


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


def parameter_models(
    system: LinearSystem,
    names: Sequence[str],
    midpoint: Array,
    radius: Array,
    order: int = ORDER,
    *,
    fixed: Mapping[str, float] | None = None,
) -> dict[str, TaylorModel]:
    """Return all parameters of a structure by name, as scalar Taylor models of d inputs.

    Args:
        system: The structure.
        names: Names of the inputs, d of them.
        midpoint: Midpoints of their ranges, shape (d,), in SI units.
        radius: Half-widths of their ranges, shape (d,).
        order: Order of the models.
        fixed: Values of other parameters by name, where they are not nominal.
    """
    inputs = TaylorModel.variables(midpoint, radius, order)
    values = {**system.parameters, **(fixed or {})}
    parameters = {name: inputs.like(value) for name, value in values.items()}
    return parameters | {name: inputs[i] for i, name in enumerate(names)}


def classical_structure(
    system: LinearSystem, parameters: Mapping[str, TaylorModel]
) -> ClassicalStructure:
    """Return a structure whose parameters are Taylor models, if undamped modes uncouple it.

    Initial displacements contain those under static forces, and initial velocities those by
    impulses at t = 0.

    Args:
        system: The structure.
        parameters: Value of each of its parameters, by name, as a scalar Taylor model of the
            inputs.

    Raises:
        UnprovedError: Dashpots, or damping by springs without the weights, couple the modes; an
            output row depends on the inputs or takes displacements and velocities; or mass or
            stiffness may be singular in the box.
    """
    assembly = system.assembly(parameters)
    assembly = with_classical_damping(assembly)
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


def with_classical_damping(assembly: Assembly[TaylorModel]) -> Assembly[TaylorModel]:
    """Return the structure if undamped modes uncouple it; that of one unknown without dashpots.

    Raises:
        UnprovedError: Dashpots, or damping by springs without the weights, couple the modes.
    """
    if len(assembly.pattern) == 1:
        assembly = _with_damping_by_mass(assembly)
    _require_classical(assembly)
    return assembly


def _with_damping_by_mass(assembly: Assembly[TaylorModel]) -> Assembly[TaylorModel]:
    """Return the same structure of one unknown with its dashpots as damping by the mass.

    With the dashpots d and the weights W, D = d + a M + b K_springs, and K = K_springs − W. Hence D
    = (a + (d + b W)/M) M + b K. The new structure has no dashpots and no weights, K as its springs,
    and the factor of M as Rayleigh's a.

    Args:
        assembly: Mass, springs, weights (None for none) and dashpots as Taylor models of shape (1,
            1), and Rayleigh's factors a in 1/s and b in s. Not changed.

    Raises:
        UnprovedError: The mass may be zero in the box.
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


def _accelerations(assembly: Assembly[TaylorModel], forces: TaylorModel) -> TaylorModel:
    """Return accelerations M⁻¹ b by forces b, shape (n, k); zero for unknowns without mass."""
    massive = assembly.massive
    mass = assembly.mass[massive[:, np.newaxis], massive]
    selection = np.eye(len(assembly.pattern))[:, massive]
    return selection @ solve(mass, forces[massive])


def _require_classical(assembly: Assembly[TaylorModel]) -> None:
    """Check that damping does not couple the undamped modes of a structure.

    Args:
        assembly: The structure; its dashpots must be zero, and Rayleigh's factor of the springs,
            too, where weights reduce its stiffness (P-Delta).

    Raises:
        UnprovedError: The dashpots or this factor may differ from zero in the box.
    """
    if assembly.dashpots.magnitude().any():
        raise CoupledModesError(
            "dashpots couple the modes", "give damping ratios or Rayleigh's factors in their place"
        )
    if assembly.weights is not None and assembly.rayleigh[1].magnitude() > 0:
        raise CoupledModesError(
            "Rayleigh's damping by the springs without the weights couples the modes",
            "give a damping ratio, or leave gravity out",
        )


def _constant_rows(assembly: Assembly[TaylorModel]) -> tuple[Array, Array]:
    """Return the rows of m outputs on n displacements and on their velocities, shape (m, n) each.

    Args:
        assembly: `rows` holds the coefficients on displacements and then velocities, (m, 2n):
            numbers, or a Taylor model where they depend on inputs.

    Raises:
        UnprovedError: Rows depend on inputs, as only those of a frame's overturning moment do, or
            an output takes two of displacements, velocities and accelerations.
    """
    if not isinstance(assembly.rows, np.ndarray):
        cure = "take the method proof with few inputs, or leave the overturning moment out"
        raise CoupledModesError("the overturning moment adds storeys by factors of inputs", cure)
    displacements, velocities = np.split(assembly.rows, 2, axis=1)
    derivatives = [displacements, velocities, assembly.accelerated]
    taken = np.count_nonzero([rows.any(axis=1) for rows in derivatives], axis=0)
    if (taken > 1).any():
        what = "an output mixes displacements, velocities or accelerations"
        raise CoupledModesError(what, "observe them apart")
    return displacements, velocities
