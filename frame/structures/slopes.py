"""First derivatives alone of a structure's arrays, for many parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet, concatenate
from alphacut.frame.structures.linear import LinearSystem, Matrices


@dataclass(frozen=True, eq=False)
class Slopes:
    """A structure at S parameter sets with derivatives by d parameters.

    Args:
        matrices: Values.
        rows: Observation rows, shape (S, m, 2n).
        mass: Derivatives of M, shape (d, S, n, n).
        damping: Of D.
        stiffness: Of K.
        state: Of the initial state, shape (d, S, 2n).
        observation: Of the rows, shape (d, S, m, 2n).
    """

    matrices: Matrices
    rows: Array
    mass: Array
    damping: Array
    stiffness: Array
    state: Array
    observation: Array

    @classmethod
    def of(
        cls, system: LinearSystem, names: Sequence[str], points: Array, *, observed: bool = True
    ) -> Slopes:
        """Of `system` at `points` (S, d), the values of `names`; others keep modal values.

        A set is taken once for each parameter, since jets carry all pairs of theirs.

        Args:
            system: The structure.
            names: Its uncertain parameters.
            points: Their values, shape (S, d).
            observed: Whether the rows are wanted; else they and their derivatives are empty.
        """
        (total, d), p = points.shape, one_by_one(system, names, points)
        matrices = system.matrices(p)
        n, m = matrices.mass.value.shape[-1], len(system.outputs)
        still = Jet.constant(np.zeros((0, m, 2 * n)), 1)
        rows = system.observation(p) if observed else still
        state = concatenate([matrices.q0, matrices.v0], -2)[..., 0]
        jets = (matrices.mass, matrices.damping, matrices.stiffness, state, rows)
        first = [jet.first[0].reshape(d, -1, *jet.value.shape[1:]) for jet in jets]
        return cls(_values_of(matrices, total), rows.value[:total], *first)

    def moved(self, by: Array) -> Slopes:
        """At points (S, d) away from the one it is of, where M, K and the start are affine."""
        m, n = self.matrices, self.matrices.mass.value.shape[-1]

        def there(value: Array, first: Array) -> Jet:
            flat = by @ first[:, 0].reshape(len(first), -1)
            return Jet.constant(value + flat.reshape(len(by), *value.shape[1:]), 0)

        q0 = there(m.q0.value, self.state[..., :n, None])
        v0 = there(m.v0.value, self.state[..., n:, None])
        mass, stiffness = there(m.mass.value, self.mass), there(m.stiffness.value, self.stiffness)
        still = Jet.constant(np.zeros_like(mass.value), 0)
        return replace(self, matrices=Matrices(mass, still, stiffness, q0, v0, m.pattern))

    def gradient(
        self, own: Array, through: Array, state: Array, back: Array, row: Array, output: Array
    ) -> Array:
        """Gradients (N, d) of r exp(A t) s from what each of its parts does to it.

        Args:
            own: Parameter set of each problem, shape (N,).
            through: Derivative by the entries of A, shape (N, 2n, 2n).
            state: The state exp(A t) s, shape (N, 2n), by which r is multiplied.
            back: r exp(A t), shape (N, 2n), by which s is multiplied.
            row: Factor of the rows, shape (N,).
            output: Row of each problem, shape (N,).
        """
        M, D, K = (getattr(self.matrices, k).value[own] for k in ("mass", "damping", "stiffness"))
        n = M.shape[-1]
        by_K, by_D = np.split(np.linalg.solve(M.swapaxes(1, 2), through[:, n:]), 2, axis=-1)
        light = np.linalg.solve(M, np.concatenate([K, D], -1)).swapaxes(1, 2)
        by_M = by_K @ light[:, :n] + by_D @ light[:, n:]
        found = self.along(own, by_M, -by_K, back, state * row[:, None], output)
        return found - _inner(self.damping, own, by_D)

    def along(
        self, own: Array, by_M: Array, by_K: Array, back: Array, seen: Array, output: Array
    ) -> Array:
        """Gradients (N, d) from derivatives by M, K, the start and the rows.

        Args:
            own: Parameter set of each problem, shape (N,).
            by_M: Derivative by the entries of M, shape (N, n, n).
            by_K: By those of K.
            back: By the initial state, shape (N, 2n).
            seen: By the row, shape (N, 2n).
            output: Row of each problem, shape (N,).
        """
        total = _inner(self.mass, own, by_M) + _inner(self.stiffness, own, by_K)
        if self.state.any():
            place = own if self.state.shape[1] > 1 else np.zeros_like(own)
            total += np.einsum("dns,ns->nd", self.state[:, place], back)
        if self.observation.any():
            total += np.einsum("dns,ns->nd", self.observation[:, own, output], seen)
        return total


def one_by_one(
    system: LinearSystem, names: Sequence[str], points: Array, *, derivatives: bool = True
) -> dict[str, Jet]:
    """All parameters at `points` (S, d), d times: the k-th time with derivatives by the k-th name.

    Without derivatives they are there once.
    """
    total, d = points.shape
    times, one = (d, 1) if derivatives else (1, 0)
    still = np.zeros((one, one, times * total))
    values = {name: np.full(total, float(x)) for name, x in system.parameters.items()}
    values |= dict(zip(names, points.T, strict=True))
    p = {}
    for name, value in values.items():
        first = np.zeros((one, times, total))
        if derivatives and name in names:
            first[:, list(names).index(name)] = 1.0
        p[name] = Jet(np.tile(value, times), first.reshape(one, times * total), still)
    return p


def _inner(derivative: Array, own: Array, by: Array) -> Array:
    """Sum over entries of derivatives (d, S, n, n) times sensitivities (N, n, n), (N, d)."""
    moved = np.flatnonzero(derivative.any((1, 2, 3)))
    out = np.zeros((len(own), len(derivative)))
    for i in moved:
        alike = derivative.shape[1] == 1
        one = derivative[i] if alike else derivative[i][own]
        out[:, i] = (one * by).sum((1, 2)) if not alike else by.reshape(len(by), -1) @ one.ravel()
    return out


def _values_of(matrices: Matrices, total: int) -> Matrices:
    """The first `total` sets without derivatives."""
    m = matrices
    first = [Jet.constant(part.value[:total], 0) for part in (m.mass, m.damping, m.stiffness)]
    start = [Jet.constant(part.value[:total], 0) for part in (m.q0, m.v0)]
    return Matrices(first[0], first[1], first[2], start[0], start[1], m.pattern)
