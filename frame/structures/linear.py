"""Linear structures at parameter sets: matrices, rows of the outputs, loads, frequencies."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Protocol

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet, concatenate, inverse, variables
from alphacut.frame.structures.assembly import Assembly, Matrices, Number
from alphacut.frame.structures.loads import Accelerogram, Force, History, different
from alphacut.frame.structures.modes import modal_damping
from alphacut.frame.structures.quantities import Parameter
from alphacut.fuzzy.refused import require


def require_ground(ground: object) -> None:
    """Refuse a base excitation that is neither an `Accelerogram` nor None.

    Raises:
        RefusedError: It is neither.
    """
    is_record = ground is None or isinstance(ground, Accelerogram)
    require(is_record, "ground", value=type(ground).__name__, allowed="an Accelerogram, or None")


class LinearSystem(Protocol):
    """A linear structure whose matrices are smooth functions of named parameters."""

    @property
    def parameters(self) -> Mapping[str, float]:
        """All parameters with their nominal values, in SI units."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the observed quantities."""

    @property
    def ground(self) -> Accelerogram | None:
        """Base excitation, if any; the displacements are then relative to the ground."""

    @property
    def loads(self) -> Sequence[Force]:
        """Forces on it."""

    def parameter(self, name: str) -> Parameter:
        """A parameter with the unit and the range that are known of it."""

    @property
    def ratios(self) -> Collection[str | float]:
        """Damping ratios, numbers or names of parameters: none, one, or one a mode."""

    def assembly(self, p: Mapping[str, Number]) -> Assembly[Number]:
        """The structure with its parameters as jets or as Taylor models."""


def histories(system: LinearSystem) -> dict[str, History]:
    """Histories of all loads by name, in the order of `Matrices.pushes`: load, force1, …."""
    of_ground = {} if system.ground is None else {"load": system.ground}
    of_forces = enumerate(different(tuple(system.loads)), start=1)
    return {**of_ground, **{f"force{number}": history for number, history in of_forces}}


def courses_of_forces(system: LinearSystem) -> list[History]:
    """Histories of the forces alone, in the order of `Matrices.feeds`."""
    return [history for name, history in histories(system).items() if name != "load"]


def evaluate(
    system: LinearSystem,
    names: Sequence[str],
    points: Array,
    *,
    derivatives: bool,
    bent: bool = True,
    by_ratios: bool = True,
) -> tuple[Matrices, Jet]:
    """Return a structure's matrices and observation rows at S sets of some parameters.

    Args:
        system: The structure.
        names: These d parameters; others keep their nominal values.
        points: Values, shape (S, d), in SI units.
        derivatives: Whether to differentiate by `names`.
        bent: Whether to compute second derivatives, too.
        by_ratios: Whether the damping matrix includes the part that is given by ratios of the
            modes, which needs all modes.

    Returns:
        The matrices, and C with output = C [q; v], shape (S, m, 2n).
    """
    fixed = {name: x for name, x in system.parameters.items() if name not in names}
    values = np.hstack([points, np.tile(list(fixed.values()), (len(points), 1))])
    order = 1 + bent  # of the highest derivative
    p = variables(values, [*names, *fixed], names if derivatives else (), order)
    return _condensed(system.assembly(p), by_ratios=by_ratios)


def _condensed(full: Assembly[Jet], *, by_ratios: bool) -> tuple[Matrices, Jet]:
    """Return the matrices on unknowns with mass and the rows of the outputs, shape (S, m, 2n).

    Unknowns b without mass are condensed, q_b = −K_bb⁻¹ K_ba q_a (Guyan 1965).
    """
    n, a = len(full.pattern), full.massive
    mass, stiffness, damping = full.mass, full.stiffness, _viscous_damping(full)
    rows: Jet | Array = full.rows
    if len(a) < n:
        b, inner = np.setdiff1d(np.arange(n), a), (slice(None), a[:, None], a)
        follow = -(inverse(stiffness[:, b[:, None], b]) @ stiffness[:, b[:, None], a])
        mass, damping = mass[inner], damping[inner]
        stiffness = stiffness[inner] + stiffness[:, a[:, None], b] @ follow
        # columns of displacements, then of velocities
        columns = [full.rows[:, a + k] + full.rows[:, b + k] @ follow for k in (0, n)]
        rows = concatenate(columns, -1)
    if full.ratios and by_ratios:
        damping = damping + modal_damping(mass, stiffness, full.ratios)
    forces, static, impulse = (x and x[:, a] for x in (full.forces, full.static, full.impulse))
    matrices = Matrices(
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        q0=full.q0[:, a, None],
        v0=full.v0[:, a, None],
        rigid=full.pattern[a, None],
        accelerated=full.accelerated[:, a],
        forces=forces,
        static=static,
        impulse=impulse,
    )
    if full.accelerated.any():  # q̈ + ι a = −M⁻¹ (K q + D v) + M⁻¹ b f
        reading = matrices.accelerated @ matrices.inverse_mass
        rows = rows - reading @ concatenate([stiffness, damping], -1)
    return matrices, full.row_factors[..., None] * rows


def _viscous_damping(full: Assembly[Jet]) -> Jet:
    """Return the damping by dashpots and Rayleigh's factors, shape (S, n, n), in N s/m."""
    damping = full.dashpots
    for factor, matrix in zip(full.rayleigh, (full.mass, full.springs), strict=True):
        if factor.value.any() or factor.first.any():
            damping = damping + factor[:, None, None] * matrix
    return damping


def round_off(largest: float, slowest: float, time: Array) -> Array:
    """Return the error of a motion by rounding of its frequencies, over its peak, at times (T,).

    Rounding of the `largest` ω² (1/s²) changes that of the `slowest` mode (ω in rad/s) by as much.
    """
    phase_per_change = np.minimum(time**2, time / max(slowest, 1e-300)) / 2
    return np.asarray(np.finfo(float).eps * largest * phase_per_change)


def frequencies(system: LinearSystem) -> Array:
    """Undamped angular frequencies at the nominal parameters, rising, shape (n,), in rad/s."""
    from scipy.linalg import eigh

    matrices, _ = evaluate(system, (), np.zeros((1, 0)), derivatives=False)
    squared = eigh(matrices.stiffness.value[0], matrices.mass.value[0], eigvals_only=True)
    return np.asarray(np.sqrt(np.maximum(squared, 0.0)))


def modal_damping_ratios(system: LinearSystem) -> tuple[Array, Array]:
    """Return undamped ω in rad/s and ratios φᵀDφ/(2ω) of all modes at nominal values, (n,) each."""
    from scipy.linalg import eigh

    matrices, _ = evaluate(system, (), np.zeros((1, 0)), derivatives=False)
    squared, shapes = eigh(matrices.stiffness.value[0], matrices.mass.value[0])
    omega = np.sqrt(np.maximum(squared, 0.0))
    damping = np.einsum("ik,ij,jk->k", shapes, matrices.damping.value[0], shapes)
    return omega, damping / np.maximum(2 * omega, 1e-300)
