"""Linear structures M(p) q̈ + D(p) q̇ + K(p) q = −M(p) ι a(t) with parameters p (section 6.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet, concatenate, variables
from alphacut.frame.structures.quantities import Parameter
from alphacut.fuzzy.refused import RefusedError, require


@dataclass(frozen=True, eq=False)
class Matrices:
    """The structure at S parameter sets, each entry a jet.

    Args:
        mass: M, shape (S, n, n), in kg.
        damping: D, shape (S, n, n), in N s/m.
        stiffness: K, shape (S, n, n), in N/m.
        q0: Initial displacement, shape (S, n, 1), in m.
        v0: Initial velocity, shape (S, n, 1), in m/s.
        rigid: ι, how the unknowns move rigidly with the ground, shape (n, 1).
    """

    mass: Jet
    damping: Jet
    stiffness: Jet
    q0: Jet
    v0: Jet
    rigid: Array

    @property
    def start(self) -> Jet:
        """Initial state [q; v], shape (S, 2n, 1)."""
        return concatenate([self.q0, self.v0], -2)

    @property
    def kick(self) -> Array:
        """Jump of the state at a unit impulse of the ground's acceleration, shape (2n, 1)."""
        return np.concatenate([np.zeros_like(self.rigid), -self.rigid])


@dataclass(frozen=True, eq=False)
class Accelerogram:
    """Acceleration of the ground, linear between its samples and zero outside them.

    It jumps where it begins or ends on another value than zero.

    Args:
        step: Time between samples, in s; it need not go into the step of the nodes.
        acceleration: Samples from t = 0 on, at least two, shape (n,), in m/s².

    Raises:
        RefusedError: The step is not positive, or there are not two samples, or one is not finite.

    Example:
        >>> import numpy as np
        >>> ground = Accelerogram(0.01, np.array([0.0, 1.5, 0.0]))
        >>> float(ground.acceleration.max())
        1.5
    """

    step: float
    acceleration: Array = field(repr=False)

    def __post_init__(self) -> None:
        allowed = "two or more finite samples, a positive step"
        try:
            samples, step = np.asarray(self.acceleration, float), float(self.step)
        except (TypeError, ValueError):
            what = f"{self.acceleration!r} every {self.step!r} s"
            raise RefusedError("accelerogram", what, allowed) from None
        several = samples.ndim == 1 and samples.size > 1 and bool(np.isfinite(samples).all())
        what = f"{samples.size} samples every {step:g} s"
        require(several and 0 < step < np.inf, "accelerogram", value=what, allowed=allowed)
        object.__setattr__(self, "step", step)
        object.__setattr__(self, "acceleration", samples)

    @property
    def extremes(self) -> tuple[float, float, float]:
        """Largest magnitude (m/s²), slope between samples (m/s³) and jump at the end (m/s²)."""
        size, slope = np.abs(self.acceleration), np.abs(np.diff(self.acceleration))
        return float(size.max()), float(slope.max()) / self.step, float(size[-1])


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
        """All parameters with their modal values, in SI units."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the observed quantities."""

    @property
    def ground(self) -> Accelerogram | None:
        """Base excitation, if any; the displacements are then relative to the ground."""

    def parameter(self, name: str) -> Parameter:
        """A parameter with the unit and the range that are known of it."""

    def matrices(self, p: Mapping[str, Jet]) -> Matrices:
        """M, D, K and the initial state at S parameter sets."""

    def observation(self, p: Mapping[str, Jet]) -> Jet:
        """Rows C(p) with output = C(p) [q; v], shape (S, outputs, 2n)."""


def evaluate(
    system: LinearSystem,
    names: Sequence[str],
    points: Array,
    *,
    derivatives: bool,
    bent: bool = True,
) -> tuple[Matrices, Jet]:
    """Matrices and observation rows at parameter sets; others keep modal values.

    Args:
        system: The structure.
        names: Uncertain parameters.
        points: Their values, shape (S, d).
        derivatives: Whether to differentiate by `names`.
        bent: Whether to differentiate twice.
    """
    fixed = {name: x for name, x in system.parameters.items() if name not in names}
    values = np.hstack([points, np.tile(list(fixed.values()), (len(points), 1))])
    p = variables(values, [*names, *fixed], names if derivatives else (), 1 + bent)
    return system.matrices(p), system.observation(p)


def round_off(largest: float, slowest: float, time: Array) -> Array:
    """Share of a peak by which round-off of the largest ω² (1/s²) moves the slowest ω (rad/s)."""
    late = np.minimum(time**2, time / max(slowest, 1e-300)) / 2
    return np.asarray(np.finfo(float).eps * largest * late)


def frequencies(system: LinearSystem) -> Array:
    """Undamped angular frequencies at the modal parameters, rising, shape (n,), in rad/s."""
    from scipy.linalg import eigh

    matrices, _ = evaluate(system, (), np.zeros((1, 0)), derivatives=False)
    squared = eigh(matrices.stiffness.value[0], matrices.mass.value[0], eigvals_only=True)
    return np.asarray(np.sqrt(np.maximum(squared, 0.0)))


def modal_damping_ratios(system: LinearSystem) -> tuple[Array, Array]:
    """Undamped frequencies in rad/s and φᵀDφ/(2ω) of each mode at the modal parameters, (n,)."""
    from scipy.linalg import eigh

    matrices, _ = evaluate(system, (), np.zeros((1, 0)), derivatives=False)
    squared, shapes = eigh(matrices.stiffness.value[0], matrices.mass.value[0])
    omega = np.sqrt(np.maximum(squared, 0.0))
    damping = np.einsum("ik,ij,jk->k", shapes, matrices.damping.value[0], shapes)
    return omega, damping / np.maximum(2 * omega, 1e-300)
