"""Linear structures M(p) q̈ + D(p) q̇ + K(p) q = −M(p) ι a(t) + Σ b_i(p) f_i(t) (section 6.1).

A structure is written once over both number types. In shapes, … is the S parameter sets of jets,
and nothing for Taylor models over a box.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np

from alphacut.frame.calculus.jet import Jet, concatenate, inverse
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.structures.loads import Force, different
from alphacut.fuzzy.arrays import Array, Rows

Number = TypeVar("Number", Jet, TaylorModel)


@dataclass(frozen=True, eq=False)
class Assembly(Generic[Number]):
    """A structure of n unknowns and m outputs with its parameters as jets or as Taylor models.

    Its damping is D = dashpots + a M + b K_springs + 2 M Φ diag(ζ_k ω_k) Φᵀ M.

    Args:
        mass: M, shape (…, n, n), in kg.
        springs: K of the springs, shape (…, n, n), in N/m.
        weights: What weights take from K (P-Delta), the same shape; None for nothing.
        dashpots: Their part of D, shape (…, n, n), in N s/m.
        rayleigh: a in 1/s and b in s, shape (…) each.
        ratios: ζ, shape (…) each: none, one of all modes, or one of each by rising frequency.
        q0: Initial displacements, shape (…, n), in m.
        v0: Initial velocities, shape (…, n), in m/s.
        row_factors: What the outputs' rows are multiplied by, shape (…, m).
        rows: What outputs take of [q; v], shape (m, 2n).
        accelerated: What they take of absolute accelerations, shape (m, n).
        pattern: ι, how the unknowns move rigidly with the ground, shape (n,).
        massive: Unknowns that have mass, rising.
        loads: Forces on unknowns that have mass.
        columns: Each of them at the amplitude 1 of its history, shape (…, n, F), in N, impulses in
            N s; None where there are none.
    """

    mass: Number
    springs: Number
    weights: Number | None
    dashpots: Number
    rayleigh: tuple[Number, Number]
    ratios: list[Number]
    q0: Number
    v0: Number
    row_factors: Number
    rows: Array
    accelerated: Array
    pattern: Array
    massive: Rows
    loads: Sequence[Force]
    columns: Number | None

    @property
    def stiffness(self) -> Number:
        """K, shape (…, n, n), in N/m."""
        return self.springs if self.weights is None else self.springs - self.weights

    @property
    def forces(self) -> Number | None:
        """Columns b, one a history of forces, shape (…, n, H), in N; None without one."""
        keys = [force.history and force.history.identity for force in self.loads]
        courses = [course.identity for course in different(tuple(self.loads))]
        return self._summed(np.array([[key == x for x in courses] for key in keys], float))

    @property
    def static(self) -> Number | None:
        """Force under which the structure rests at the start besides q0, shape (…, n, 1)."""
        histories = [force.history for force in self.loads]
        first = [x.values(np.zeros(1))[0] if x and x.is_static else 0.0 for x in histories]
        return self._summed(np.array(first, float)[:, None])

    @property
    def impulse(self) -> Number | None:
        """Impulse at t = 0, shape (…, n, 1), in N s; v0 comes before it."""
        return self._summed(np.array([[float(force.history is None)] for force in self.loads]))

    def _summed(self, weight: Array) -> Number | None:
        """Return Σ_F b_F weight_Fk over all forces, shape (…, n, k); None where all are zero."""
        return self.columns @ weight if self.columns is not None and weight.any() else None


def stack(values: Sequence[Number]) -> Number:
    """Joins numbers shape (…) to one of shape (…, e)."""
    return type(values[0]).stack(values)


@dataclass(frozen=True, eq=False)
class Matrices:
    """The structure at S parameter sets, each entry a jet, its massless unknowns condensed.

    Args:
        mass: M, shape (S, n, n), in kg.
        damping: D, shape (S, n, n), in N s/m.
        stiffness: K, shape (S, n, n), in N/m.
        q0: Initial displacement, shape (S, n, 1), in m.
        v0: Initial velocity, shape (S, n, 1), in m/s.
        rigid: ι, how the unknowns move rigidly with the ground, shape (n, 1).
        accelerated: Accelerations that outputs read besides their rows, which a force on the same
            unknown adds to at once, shape (m, n).
        forces: b of each history of forces, shape (S, n, H), in N; None for none.
        static: Force under which the structure rests at the start besides q0, shape (S, n, 1).
        impulse: Impulse at t = 0, shape (S, n, 1), in N s; v0 comes before it.
    """

    mass: Jet
    damping: Jet
    stiffness: Jet
    q0: Jet
    v0: Jet
    rigid: Array
    accelerated: Array
    forces: Jet | None = None
    static: Jet | None = None
    impulse: Jet | None = None

    @cached_property
    def inverse_mass(self) -> Jet:
        """M⁻¹, shape (S, n, n)."""
        return inverse(self.mass)

    @property
    def start(self) -> Jet:
        """Initial state [q; v], shape (S, 2n, 1)."""
        q0, v0 = self.q0, self.v0
        if self.static is not None:
            q0 = q0 + inverse(self.stiffness) @ self.static
        if self.impulse is not None:
            v0 = v0 + self.inverse_mass @ self.impulse
        return concatenate([q0, v0], -2)

    def pushes(self, *, ground: bool) -> Jet:
        """Return accelerations by a unit of each load, the ground's first, shape (S, n, L)."""
        shape = (*self.mass.value.shape[:-1], int(ground))
        parts = [self.mass.like(-np.broadcast_to(self.rigid[:, : int(ground)], shape))]
        if self.forces is not None:
            parts.append(self.inverse_mass @ self.forces)
        return concatenate(parts, -1)

    @property
    def feeds(self) -> Jet | None:
        """What a unit of each force adds to outputs at once, shape (S, m, H); None if nothing."""
        if self.forces is None or not self.accelerated.any():
            return None
        fed: Jet = self.accelerated @ self.pushes(ground=False)
        return fed
