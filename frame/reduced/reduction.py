"""Reduction of large linear structures to few shapes that hold for the whole box.

The full structure has thousands of unknowns and matrices that are sums of a few given matrices,
each times a smooth factor of the parameters: K(p) = Σ_i f_i(p) K_i, likewise M and D. Projection
on a common basis V makes it a small structure with n = V's columns, and everything in this package
applies. The basis holds the energy of harmonic responses and of the modes that resonate, at a few
parameter sets (`frame.response_basis`); what it leaves out is measured against trajectories of the
full structure (`frame.checks.step_error`) and counts as error of an envelope.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet
from alphacut.frame.calculus.low_discrepancy import chebyshev_points, corners
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.dynamics.spectral import responses
from alphacut.frame.reduced.response_basis import energy_basis
from alphacut.frame.structures.damping import modal_damping
from alphacut.frame.structures.linear import Accelerogram, Matrices
from alphacut.frame.structures.quantities import Output

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix

Factor = Callable[[Mapping[str, Any]], Any]
BEYOND = 4
"""Modes count up to so many times the end of the ground's band."""
SHARPEST = 0.02
"""Twice the damping ratio below which resonances are not taken for larger: none has the time."""
RESONANT = (100, 300)
"""Modes that may resonate, at most; the second number where the first is not enough."""
FULL, CORNERS, INNER = 2 * 10**9, (5, 40), 24
"""Unknowns cubed over all points at which the error is measured; least and most; those inside."""
MOST_NODES, PERIODS = 1000, 10
"""Nodes, and periods of a structure without ground motion, by which the shapes are judged."""


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
        ratio: Name of the parameter that is the damping ratio of all modes, added to Rayleigh's;
            None for none.
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
    ratio: str | None = None

    def assembled(self, p: Mapping[str, float]) -> tuple[csc_matrix, csc_matrix]:
        """Sparse M and K at one parameter set."""
        M = sum(float(f(p)) * A for f, A in self.mass)
        K = sum(float(f(p)) * A for f, A in self.stiffness)
        return M.tocsc(), K.tocsc()

    def reduced(
        self,
        bounds: Mapping[str, tuple[float, float]],
        *,
        accuracy: float = 5e-4,
        keep: float = 1e-11,
        samples: int = 5,
        frequencies: int = 24,
    ) -> ReducedStructure:
        """Projection on the shapes that carry the energy of harmonic responses in a box.

        Modes that resonate come in only where the motion without them is not accurate enough at
        two of the points. What an envelope declares is measured anew, see `step_error`.

        Args:
            bounds: Lower and upper ends of the uncertain parameters.
            accuracy: Error of the motion, as a share of each peak, that needs no further shapes.
            keep: Share of the strongest shape's strain energy below which a shape is left out.
            samples: Points of the box.
            frequencies: Frequencies of the load at each point.
        """
        band, points = self._band(), _points(self.parameters, bounds, samples)
        judges = _corners(self.parameters, bounds, len(self.excitation))
        loads = np.geomspace(*band, frequencies)
        shapes = [self._response_shapes(point, loads) for point in points]
        made, time = self._projected(shapes, keep, judges), self._watched(band[0])
        top = BEYOND * band[1] if self.ground is not None else np.inf
        truth = [self.trajectories(point, time) for point in judges[:2]]
        for lowest in RESONANT:
            if made.deviation(judges[:2], time, truth) <= accuracy:
                break
            beyond = [self._resonances(point, top, lowest) for point in points]
            made = self._projected([*shapes, *beyond], keep, judges)
        return made

    def _watched(self, slowest: float) -> Array:
        """Nodes of the motion by which the shapes are judged, in s, from half the least ω."""
        if self.ground is None:
            return np.linspace(0.0, PERIODS * np.pi / slowest, 20 * PERIODS + 1)
        count = min(len(self.ground.acceleration), MOST_NODES)
        return np.arange(count) * self.ground.step

    def _projected(
        self, shapes: Sequence[Array], keep: float, judges: Sequence[Mapping[str, float]]
    ) -> ReducedStructure:
        """Projection on the strongest of shapes, each (N, k)."""
        M, K = self.assembled(self.parameters)
        # so that the rigid motion is projected without error
        always = [self.excitation] if self.ground is not None else []
        basis = energy_basis(
            np.hstack(shapes),
            M,
            K,
            keep=keep,
            always=always + [x for x in (self.q0, self.v0) if x is not None and x.any()],
        )
        small = [
            [(f, basis.T @ (A @ basis)) for f, A in terms] for terms in (self.mass, self.stiffness)
        ]
        # V is orthonormal in M: the coordinates of the rigid motion
        push = basis.T @ (M @ self.excitation)
        state = [
            np.zeros(basis.shape[1]) if x is None else basis.T @ (M @ x) for x in (self.q0, self.v0)
        ]
        rows = np.array([row @ basis for row in self.observed.values()])
        return ReducedStructure(
            self, basis, small[0], small[1], push, rows, state[0], state[1], judges
        )

    def _response_shapes(self, p: Mapping[str, float], frequencies: Array) -> Array:
        """Displacements under harmonic ground motion and of a free vibration, (N, k).

        Args:
            p: All parameters, in SI units.
            frequencies: Angular frequencies of the load, in rad/s.
        """
        from scipy.sparse.linalg import splu

        M, K = self.assembled(p)
        D = float(p[self.rayleigh[0]]) * M + float(p[self.rayleigh[1]]) * K
        shapes: list[Array] = []
        # modal damping has no sparse matrix: a loss factor of 2 ζ at resonance
        loss = 2j * float(p[self.ratio]) if self.ratio else 0.0
        for omega in frequencies:
            solve = splu((K * (1 + loss) + 1j * omega * D - omega**2 * M).tocsc()).solve
            loads = [] if self.ground is None else [M @ self.excitation]
            if self.q0 is not None and self.q0.any():
                # Fourier transform of the free vibration
                loads.append(1j * omega * (M @ self.q0) + D @ self.q0)
            if self.v0 is not None and self.v0.any():
                loads.append(M @ self.v0)
            for x in (solve(load.astype(complex)) for load in loads):
                shapes += [x.real, x.imag]
        if not shapes:
            raise ValueError(
                "reduction: nothing moves the structure; give an accelerogram or an initial state"
            )
        return np.column_stack(shapes)

    def _resonances(self, p: Mapping[str, float], top: float, lowest: int) -> Array:
        """Modes up to a frequency (rad/s) in the size that they swing to in resonance, (N, k)."""
        from scipy.sparse.linalg import eigsh

        M, K = self.assembled(p)
        squared, shape = eigsh(K, min(lowest, K.shape[0] - 1), M, sigma=0.0)
        omega, push = np.sqrt(squared), shape.T @ (M @ self.excitation)
        start = [x for x in (self.q0, self.v0) if x is not None]
        share = np.abs(push) / squared * (self.ground is not None)
        share += sum(np.abs(shape.T @ (M @ x)) for x in start)
        damped = self._half_damping(p, squared) / omega
        return np.asarray((shape * share / np.maximum(2 * damped, SHARPEST))[:, omega <= top])

    def _half_damping(self, p: Mapping[str, float], squared: Array) -> Array:
        """ζ ω of modes with squared frequencies ω², by Rayleigh and by the ratio, in 1/s."""
        half = (float(p[self.rayleigh[0]]) + float(p[self.rayleigh[1]]) * squared) / 2
        return np.asarray(half + (float(p[self.ratio]) * np.sqrt(squared) if self.ratio else 0.0))

    def _band(self) -> tuple[float, float]:
        """Angular frequencies from half the fundamental one to the end of the spectrum."""
        from scipy.sparse.linalg import splu

        M, K = self.assembled(self.parameters)
        x = splu(K).solve(M @ self.excitation)
        fundamental = float(np.sqrt((x @ (K @ x)) / (x @ (M @ x))))
        top = 0.0 if self.ground is None else self.ground.band()
        return fundamental / 2, max(top, 20 * fundamental)

    @lru_cache(maxsize=64)  # noqa: B019
    def _modes(self, p: tuple[tuple[str, float], ...]) -> tuple[Array, Array, Array]:
        """ω², rows of the outputs (m, N), and shares of the ground, q0 and v0, (3, N)."""
        from scipy.linalg import eigh

        M, K = self.assembled(dict(p))
        squared, shape = eigh(K.toarray(), M.toarray())
        zero = np.zeros(len(squared))
        moved = [self.excitation, *(zero if x is None else x for x in (self.q0, self.v0))]
        rows = np.array(list(self.observed.values())) @ shape
        return squared, rows, np.array([shape.T @ (M @ x) for x in moved])

    def trajectories(self, p: Mapping[str, float], time: Array) -> Array:
        """Outputs of the full structure by all its modes, shape (T, m), for checking.

        Rayleigh and modal damping keep the undamped modes, each of which answers with two
        exponentials.
        """
        squared, rows, parts = self._modes(tuple(p.items()))
        half = self._half_damping(p, squared)
        root = np.sqrt(half**2 - squared + 0j)
        slow, fast = -half + root, -half - root
        h, out = time[1] - time[0], np.zeros((len(time), len(rows)), complex)
        if self.ground is not None:
            share = -parts[0] / (slow - fast)
            two = responses(np.stack([slow, fast]), self.ground, h, len(time) - 1)[0]
            out += ((two[0] - two[1]) * share) @ rows.T
        for x, (first, second) in zip(parts[1:], ((-fast, slow), (1.0, -1.0)), strict=True):
            if x.any():
                share = x / (slow - fast)
                out += (
                    share
                    * (first * np.exp(np.outer(time, slow)) + second * np.exp(np.outer(time, fast)))
                ) @ rows.T
        return out.real


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
        judges: All parameters at some corners of the box, at which the error is measured.
    """

    full: AffineStructure
    basis: Array
    mass: Sequence[tuple[Factor, Array]]
    stiffness: Sequence[tuple[Factor, Array]]
    push: Array
    rows: Array
    q0: Array
    v0: Array
    judges: Sequence[Mapping[str, float]] = ()

    @property
    def parameters(self) -> Mapping[str, float]:
        """All parameters with their modal values, in SI units."""
        return self.full.parameters

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Names of the observed quantities, with their units."""
        return tuple(map(Output, self.full.observed))

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
        q0, v0 = (
            Jet.constant(np.tile(x[None, :, None], (size, 1, 1)), d) for x in (self.q0, self.v0)
        )
        D = a * M + b * K
        if self.full.ratio:
            D = D + modal_damping(M, K, [p[self.full.ratio]])
        return Matrices(M, D, K, q0, v0, self.push[:, None])

    def observation(self, p: Mapping[str, Jet]) -> Jet:
        """Rows C(p) with output = C(p) [q; v], shape (S, m, 2n)."""
        like = next(iter(p.values()))
        rows = np.hstack([self.rows, np.zeros_like(self.rows)])
        return Jet.constant(np.tile(rows, (like.value.size, 1, 1)), like.directions)

    def deviation(
        self, points: Sequence[Mapping[str, float]], time: Array, truth: Sequence[Array]
    ) -> float:
        """Largest error of the motion at parameter sets, as a share of each peak in `truth`."""
        names = tuple(self.parameters)
        flow = LinearFlow(self, names, float(time[-1]), float(time[1]), Exact())
        found = flow.values(np.array([[point[name] for name in names] for point in points]))
        pairs = zip(found, truth, strict=True)
        return max(float((np.abs(x - y).max(0) / np.abs(y).max(0)).max()) for x, y in pairs)


def _points(
    modal: Mapping[str, float], bounds: Mapping[str, tuple[float, float]], samples: int
) -> list[dict[str, float]]:
    """The middle of the box and a spread of points."""
    low, high = np.array(list(bounds.values())).T
    unit = np.vstack([np.zeros((1, len(low))), chebyshev_points(len(low), samples - 1)])
    return [
        {**modal, **dict(zip(bounds, (low + high) / 2 + (high - low) / 2 * u, strict=True))}
        for u in unit
    ]


def _corners(
    modal: Mapping[str, float], bounds: Mapping[str, tuple[float, float]], unknowns: int
) -> list[dict[str, float]]:
    """Corners of the box in any order, then points inside, as many as the modes allow."""
    low, high = np.array(list(bounds.values())).reshape(-1, 2).T
    count = int(np.clip(FULL // unknowns**3, *CORNERS))
    rng, one = np.random.default_rng(0), np.ones(len(low))
    ends = corners(-one, one) if len(low) <= 4 else rng.choice([-1.0, 1.0], (16, len(low)))
    inner = chebyshev_points(len(low), INNER)
    unit = np.vstack([rng.permutation(np.vstack([ends, 0 * one])), inner])[:count]
    middle, half = (low + high) / 2, (high - low) / 2
    return [{**modal, **dict(zip(bounds, middle + half * u, strict=True))} for u in unit]


def _lifted(factor: Any, size: int, d: int) -> Jet:
    return factor if isinstance(factor, Jet) else Jet.constant(np.full(size, float(factor)), d)
