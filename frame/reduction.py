"""Large linear structures by a small basis of displacement shapes that holds for the whole box of parameters.

The full structure has thousands of unknowns and matrices that are sums of a few given matrices, each times a smooth factor of the
parameters: K(p) = Σ_i f_i(p) K_i, likewise M and D. Projection on a common basis V makes it a small structure with n = V's columns,
and everything in this package applies. The basis gathers Krylov vectors of the load at a few parameter sets;
the error is measured against trajectories of the full structure at other parameter sets.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from frame.halton import chebyshev_points
from frame.jet import Array, Jet
from frame.linear import Accelerogram, Matrices

Factor = Callable[[Mapping[str, Any]], Any]


@dataclass(frozen=True, eq=False)
class AffineStructure:
    """A large structure as sums of sparse matrices with factors.

    Args:
        parameters: All parameters with their modal values, in SI units.
        mass: Pairs (factor of the parameters, sparse matrix (N, N)), in kg.
        stiffness: Pairs, in N/m.
        rayleigh: Names of the parameters that multiply M and K in the damping matrix.
        excitation: How the ground moves the unknowns rigidly, shape (N,); dimensionless.
        observed: Rows by output name, each (N,), acting on displacements.
        ground: Base excitation, or None.
        q0: Initial displacements, shape (N,).
        v0: Initial velocities, shape (N,).
    """

    parameters: Mapping[str, float]
    mass: Sequence[tuple[Factor, Any]]
    stiffness: Sequence[tuple[Factor, Any]]
    rayleigh: tuple[str, str]
    excitation: Array
    observed: Mapping[str, Array]
    ground: Accelerogram | None = None
    q0: Array | None = None
    v0: Array | None = None

    def assembled(self, p: Mapping[str, float]) -> tuple[Any, Any]:
        """Sparse M and K at one parameter set."""
        M = sum(float(f(p)) * A for f, A in self.mass)
        K = sum(float(f(p)) * A for f, A in self.stiffness)
        return M.tocsc(), K.tocsc()

    def reduced(
        self, bounds: Mapping[str, tuple[float, float]], *, order: int = 16, samples: int = 8, keep: float = 1e-10
    ) -> ReducedStructure:
        """Projection on Krylov spaces of the load and the initial state at several points of a box.

        Args:
            bounds: Lower and upper ends of the uncertain parameters.
            order: Krylov vectors taken at each point.
            samples: Points of the box.
            keep: Share of the strongest direction of the shapes under which a direction is left out.
        """
        shapes = [self._shapes(point, order) for point in _points(self.parameters, bounds, samples)]
        M, _ = self.assembled(self.parameters)
        basis = _orthonormal(np.hstack(shapes), M, keep)
        small = [[(f, basis.T @ (A @ basis)) for f, A in terms] for terms in (self.mass, self.stiffness)]
        push = basis.T @ (M @ self.excitation)  # V is orthonormal in M: the coordinates of the rigid motion
        state = [np.zeros(basis.shape[1]) if x is None else basis.T @ (M @ x) for x in (self.q0, self.v0)]
        rows = np.array([row @ basis for row in self.observed.values()])
        return ReducedStructure(self, basis, small[0], small[1], push, rows, state[0], state[1])

    def _shapes(self, p: Mapping[str, float], order: int) -> Array:
        """Krylov vectors of the load: the static response x to M ι, then to M x, and so on, made M-orthonormal."""
        from scipy.sparse.linalg import splu

        M, K = self.assembled(p)
        lu = splu(K)
        starts = [M @ self.excitation, *(M @ x for x in (self.q0, self.v0) if x is not None and x.any())]
        vectors: list[Array] = []
        for start in starts:
            x = lu.solve(start)
            for _ in range(order):
                for _ in range(2):  # twice is enough to stay orthogonal
                    for other in vectors:
                        x = x - other * (other @ (M @ x))
                vectors.append(x / np.sqrt(x @ (M @ x)))
                x = lu.solve(M @ vectors[-1])
        return np.column_stack(vectors)

    def trajectories(self, p: Mapping[str, float], time: Array, *, split: int = 8) -> Array:
        """Outputs of the full structure by Newmark's method with `split` steps between nodes, shape (T, m); for checking."""
        from scipy.sparse.linalg import splu

        M, K = self.assembled(p)
        D = float(p[self.rayleigh[0]]) * M + float(p[self.rayleigh[1]]) * K
        h = (time[1] - time[0]) / split
        lu = splu((M / h + D / 2 + K * (h / 4)).tocsc())
        back = (M / h + D / 2 - K * (h / 4)).tocsr()
        load = M @ self.excitation
        q = np.zeros(M.shape[0]) if self.q0 is None else self.q0
        v = np.zeros(M.shape[0]) if self.v0 is None else self.v0
        rows = np.array(list(self.observed.values()))
        fine = np.arange((len(time) - 1) * split + 1) * h
        ground = np.zeros(len(fine)) if self.ground is None else self.ground.at(fine)
        out = [rows @ q]
        for k in range(len(fine) - 1):
            new = lu.solve(back @ q + M @ v - load * (h / 4 * (ground[k] + ground[k + 1])))
            q, v = new, 2 * (new - q) / h - v
            if (k + 1) % split == 0:
                out.append(rows @ q)
        return np.array(out)


@dataclass(frozen=True, eq=False)
class ReducedStructure:
    """A small structure that stands for a large one; a `LinearSystem`.

    Args:
        full: The large structure.
        basis: Shapes, orthonormal in M at the modal parameters, shape (N, n).
        mass: Projected pairs (factor, matrix (n, n)).
        stiffness: Projected pairs.
        push: Coordinates of the rigid motion with the ground, shape (n,).
        rows: Observation rows, shape (m, n).
        q0: Initial coordinates, shape (n,).
        v0: Initial velocities of the coordinates, shape (n,).
    """

    full: AffineStructure
    basis: Array
    mass: Sequence[tuple[Factor, Array]]
    stiffness: Sequence[tuple[Factor, Array]]
    push: Array
    rows: Array
    q0: Array
    v0: Array

    @property
    def parameters(self) -> Mapping[str, float]:
        """All parameters with their modal values, in SI units."""
        return self.full.parameters

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the observed quantities."""
        return tuple(self.full.observed)

    @property
    def ground(self) -> Accelerogram | None:
        """Base excitation, if any."""
        return self.full.ground

    def matrices(self, p: Mapping[str, Jet]) -> Matrices:
        """M, D, K and the initial state at S parameter sets."""
        like = next(iter(p.values()))
        size, d = like.value.size, like.directions

        def total(terms: Sequence[tuple[Factor, Array]]) -> Jet:
            parts = [_lifted(f(p), size, d)[:, None, None] * A for f, A in terms]
            return parts[0] if len(parts) == 1 else sum(parts[1:], parts[0])

        M, K = total(self.mass), total(self.stiffness)
        a, b = (p[name][:, None, None] for name in self.full.rayleigh)
        q0, v0 = (Jet.constant(np.tile(x[None, :, None], (size, 1, 1)), d) for x in (self.q0, self.v0))
        return Matrices(M, a * M + b * K, K, q0, v0, self.push[:, None])

    def observation(self, p: Mapping[str, Jet]) -> Jet:
        """Rows C(p) with output = C(p) [q; v], shape (S, m, 2n)."""
        like = next(iter(p.values()))
        rows = np.hstack([self.rows, np.zeros_like(self.rows)])
        return Jet.constant(np.tile(rows, (like.value.size, 1, 1)), like.directions)

    def error(self, points: Sequence[Mapping[str, float]], time: Array, values: Array) -> float:
        """Largest deviation of `values` (S, T, m) from trajectories of the full structure, relative to the peak of each output."""
        worst = 0.0
        for point, mine in zip(points, values, strict=True):
            truth = self.full.trajectories({**self.parameters, **point}, time)
            worst = max(worst, float((np.abs(mine - truth).max(0) / np.abs(truth).max(0)).max()))
        return worst


def _points(modal: Mapping[str, float], bounds: Mapping[str, tuple[float, float]], samples: int) -> list[dict[str, float]]:
    """The middle of the box and a spread of points."""
    low, high = np.array(list(bounds.values())).T
    unit = np.vstack([np.zeros((1, len(low))), chebyshev_points(len(low), samples - 1)])
    return [{**modal, **dict(zip(bounds, (low + high) / 2 + (high - low) / 2 * u, strict=True))} for u in unit]


def _orthonormal(shapes: Array, M: Any, share: float) -> Array:
    """M-orthonormal basis of the shapes, directions under `share` of the largest left out."""
    shapes = shapes / np.sqrt(np.einsum("ij,ij->j", shapes, M @ shapes))
    values, vectors = np.linalg.eigh(shapes.T @ (M @ shapes))
    keep = values > share * values.max()
    basis: Array = shapes @ (vectors[:, keep] / np.sqrt(values[keep]))
    return basis


def _lifted(factor: Any, size: int, directions: int) -> Jet:
    return factor if isinstance(factor, Jet) else Jet.constant(np.full(size, float(factor)), directions)
