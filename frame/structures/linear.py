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
    """Refuses a base excitation that is no record.

    Raises:
        RefusedError: It is none.
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
    """Matrices and observation rows at parameter sets; others keep nominal values.

    Args:
        system: The structure.
        names: Uncertain parameters.
        points: Their values, shape (S, d).
        derivatives: Whether to differentiate by `names`.
        bent: Whether to differentiate twice.
        by_ratios: Whether the damping holds that by ratios, which takes all modes to compute.

    Returns:
        The matrices, and C with output = C [q; v], V = (S, m, 2n).
    """
    fixed = {name: x for name, x in system.parameters.items() if name not in names}
    values = np.hstack([points, np.tile(list(fixed.values()), (len(points), 1))])
    p = variables(values, [*names, *fixed], names if derivatives else (), 1 + bent)
    return _condensed(system.assembly(p), by_ratios=by_ratios)


def _condensed(made: Assembly[Jet], *, by_ratios: bool) -> tuple[Matrices, Jet]:
    """Matrices and rows on the unknowns a that have mass; others are q_b = −K_bb⁻¹ K_ba q_a."""
    n, a = len(made.pattern), made.massive
    mass, stiffness, damping = made.mass, made.stiffness, _viscous_damping(made)
    rows: Jet | Array = made.rows
    if len(a) < n:
        b, inner = np.setdiff1d(np.arange(n), a), (slice(None), a[:, None], a)
        light = stiffness[:, b[:, None], b]
        follow = -(inverse(light) @ stiffness[:, b[:, None], a])
        mass, damping = mass[inner], damping[inner]
        stiffness = stiffness[inner] + stiffness[:, a[:, None], b] @ follow
        of_state = (made.rows[:, a + k] + made.rows[:, b + k] @ follow for k in (0, n))
        rows = concatenate(list(of_state), -1)
    if made.ratios and by_ratios:
        damping = damping + modal_damping(mass, stiffness, made.ratios)
    forces, static, impulse = (x and x[:, a] for x in (made.forces, made.static, made.impulse))
    matrices = Matrices(
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        q0=made.q0[:, a, None],
        v0=made.v0[:, a, None],
        rigid=made.pattern[a, None],
        accelerated=made.accelerated[:, a],
        forces=forces,
        static=static,
        impulse=impulse,
    )
    if made.accelerated.any():  # q̈ + ι a = −M⁻¹ (K q + D v) + M⁻¹ b f
        reading = matrices.accelerated @ matrices.inverse_mass
        rows = rows - reading @ concatenate([stiffness, damping], -1)
    return matrices, made.row_factors[..., None] * rows


def _viscous_damping(made: Assembly[Jet]) -> Jet:
    """Damping by dashpots and Rayleigh's factors, V = (S, n, n), in N s/m."""
    damping = made.dashpots
    for factor, matrix in zip(made.rayleigh, (made.mass, made.springs), strict=True):
        if factor.value.any() or factor.first.any():
            damping = damping + factor[:, None, None] * matrix
    return damping


def round_off(largest: float, slowest: float, time: Array) -> Array:
    """Share of a peak by which round-off of the largest ω² (1/s²) moves the slowest ω (rad/s)."""
    late = np.minimum(time**2, time / max(slowest, 1e-300)) / 2
    return np.asarray(np.finfo(float).eps * largest * late)


def frequencies(system: LinearSystem) -> Array:
    """Undamped angular frequencies at the nominal parameters, rising, shape (n,), in rad/s."""
    from scipy.linalg import eigh

    matrices, _ = evaluate(system, (), np.zeros((1, 0)), derivatives=False)
    squared = eigh(matrices.stiffness.value[0], matrices.mass.value[0], eigvals_only=True)
    return np.asarray(np.sqrt(np.maximum(squared, 0.0)))


def modal_damping_ratios(system: LinearSystem) -> tuple[Array, Array]:
    """Undamped ω in rad/s and damping ratios φᵀDφ/(2ω) at the nominal parameters, (n,) each."""
    from scipy.linalg import eigh

    matrices, _ = evaluate(system, (), np.zeros((1, 0)), derivatives=False)
    squared, shapes = eigh(matrices.stiffness.value[0], matrices.mass.value[0])
    omega = np.sqrt(np.maximum(squared, 0.0))
    damping = np.einsum("ik,ij,jk->k", shapes, matrices.damping.value[0], shapes)
    return omega, damping / np.maximum(2 * omega, 1e-300)
