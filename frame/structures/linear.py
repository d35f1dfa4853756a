"""Linear structures M(p) q̈ + D(p) q̇ + K(p) q = −M(p) ι a(t) + Σ b_i(p) f_i(t) (section 6.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet, concatenate, inverse, variables
from alphacut.frame.structures.loads import Accelerogram, Force, History, different
from alphacut.frame.structures.quantities import Parameter
from alphacut.fuzzy.refused import require


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
        forces: b of each history of forces, shape (S, n, H), in N; None for none.
        static: Force under which the structure rests at the start besides q0, shape (S, n, 1).
        impulse: Impulse at t = 0, shape (S, n, 1), in N s; v0 comes before it.
        accelerated: Accelerations that outputs read besides their rows, which a force on the same
            unknown adds to at once, shape (m, n).
    """

    mass: Jet
    damping: Jet
    stiffness: Jet
    q0: Jet
    v0: Jet
    rigid: Array
    forces: Jet | None = None
    static: Jet | None = None
    impulse: Jet | None = None
    accelerated: Array | None = None

    @property
    def start(self) -> Jet:
        """Initial state [q; v], shape (S, 2n, 1)."""
        q0, v0 = self.q0, self.v0
        if self.static is not None:
            q0 = q0 + inverse(self.stiffness) @ self.static
        if self.impulse is not None:
            v0 = v0 + inverse(self.mass) @ self.impulse
        return concatenate([q0, v0], -2)

    def pushes(self, *, ground: bool) -> Jet:
        """Accelerations by a unit of each load, V = (S, n, L): of the ground first, if it moves."""
        shape = (*self.mass.value.shape[:-1], int(ground))
        parts = [self.mass.like(-np.broadcast_to(self.rigid[:, : int(ground)], shape))]
        if self.forces is not None:
            parts.append(inverse(self.mass) @ self.forces)
        return concatenate(parts, -1)

    @property
    def feeds(self) -> Jet | None:
        """What a unit of each force adds to the outputs at once, V = (S, m, H); None if nothing."""
        if self.forces is None or self.accelerated is None or not self.accelerated.any():
            return None
        fed: Jet = self.accelerated @ self.pushes(ground=False)
        return fed


def with_forces(matrices: Matrices, columns: Jet, forces: Sequence[Force]) -> Matrices:
    """Matrices of a structure with `forces`, `static` and `impulse` of some forces.

    Args:
        matrices: Without forces.
        columns: Each force at the amplitude 1 of its history, V = (S, n, number of forces).
        forces: The forces.
    """
    courses = different(tuple(forces))
    keys = [None if force.history is None else force.history.identity for force in forces]
    member = np.array([[key == course.identity for course in courses] for key in keys], float)
    first = [float(course.is_static) * float(course.values(np.zeros(1))[0]) for course in courses]
    still, struck = member @ np.array(first), np.array([key is None for key in keys], float)
    return replace(
        matrices,
        forces=columns @ member if courses else None,
        static=columns @ still[:, None] if still.any() else None,
        impulse=columns @ struck[:, None] if struck.any() else None,
    )


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

    @property
    def loads(self) -> Sequence[Force]:
        """Forces on it."""

    def parameter(self, name: str) -> Parameter:
        """A parameter with the unit and the range that are known of it."""

    def matrices(self, p: Mapping[str, Jet]) -> Matrices:
        """M, D, K and the initial state at S parameter sets."""

    def observation(self, p: Mapping[str, Jet]) -> Jet:
        """Rows C(p) with output = C(p) [q; v], shape (S, outputs, 2n)."""


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
