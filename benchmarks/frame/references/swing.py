"""Pendulum written out once more, for an independent reference.

With γ = g/l and δ = d/(m l²) the motion depends on (γ, δ, φ0, ω0) only: a step needs four first and
sixteen second derivatives, and thousands of trajectories advance together in a second.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet
from benchmarks.frame.references.polished_search import PolishedSearch

PARAMETERS = ("m", "l", "d", "g", "phi_0", "omega_0")
CHUNK = 2000
"""Trajectories that are extrapolated together."""


@dataclass(frozen=True)
class Swing:
    """The midpoint variational integrator of the pendulum over a box of its parameters.

    Args:
        lower: Lower ends of `PARAMETERS`, shape (6,).
        upper: Upper ends.
        step: Step h, in s.
        count: Number of nodes.
    """

    lower: Array
    upper: Array
    step: float
    count: int

    def values(self, unit: Array) -> Array:
        """The force at all nodes for unit coordinates (S, 6), shape (S, T), in N."""
        return self.forces(self._physical(unit))

    def jets(self, unit: Array, which: Array) -> Jet:
        """Force of every point at its own node, with unit derivatives, V = (S,)."""
        order, half = np.argsort(which, kind="stable"), (self.upper - self.lower) / 2
        back = np.argsort(order)
        jet = self.force_at(self._physical(unit)[order], which[order])[back]
        return Jet(
            jet.value, jet.first * half[:, None], jet.second * np.outer(half, half)[..., None]
        )

    def _physical(self, unit: Array) -> Array:
        return np.clip(
            (self.lower + self.upper) / 2 + (self.upper - self.lower) / 2 * unit,
            self.lower,
            self.upper,
        )

    def forces(self, points: Array) -> Array:
        """Bar force at all nodes, shape (S, T), in N, for points (S, 6)."""
        m, length, d, g, angle, rate = points.T
        weight, damping = g / length, d / (m * length**2)
        out = np.empty((self.count, len(points)))
        for k in range(self.count):
            out[k] = m * length * rate**2 + m * g * np.cos(angle)
            angle, rate, _ = self._advance(angle, rate, weight, damping)
        return out.T

    def force_at(self, points: Array, nodes: Array) -> Jet:
        """Force of every point at its own node with six derivatives, V = (S,).

        Args:
            points: Shape (S, 6).
            nodes: Rising node indices, shape (S,).
        """
        p = np.asarray(points)
        own = Jet.constant(p.T, 6)
        own.first[np.arange(6), np.arange(6)] = 1.0
        m, length, d, g, phi, omega = (own[i] for i in range(6))
        inner = [g / length, d / (m * length**2), phi, omega]
        angle, rate = (
            _composed(x, inner) for x in self._state_at(*(x.value for x in inner), nodes)
        )
        cosine = angle.chain(np.cos(angle.value), -np.sin(angle.value), -np.cos(angle.value))
        return m * length * rate**2 + m * g * cosine

    def _advance(
        self, angle: Array, rate: Array, weight: Array, damping: Array
    ) -> tuple[Array, Array, Array]:
        """Step (1 + hδ/2) v̄ + h/2 γ sin φ̄ = ω[k], ω[k+1] = 2 v̄ − ω[k]."""
        h, c = self.step, (2 + self.step * damping) / self.step
        middle = angle + rate / c
        for _ in range(20):
            residual = c * (middle - angle) + h / 2 * weight * np.sin(middle) - rate
            change = residual / (c + h / 2 * weight * np.cos(middle))
            middle = middle - change
            if np.abs(change).max() < 1e-9:  # quadratic: the next change would be below 1e-16
                break
        return 2 * middle - angle, 4 * (middle - angle) / h - rate, middle

    def _state_at(
        self, weight: Array, damping: Array, angle: Array, rate: Array, nodes: Array
    ) -> tuple[Jet, Jet]:
        """Angle and rate of every trajectory at its node, with derivatives."""
        a, w = Jet.constant(angle, 4), Jet.constant(rate, 4)
        a.first[2], w.first[3] = 1.0, 1.0
        found = [Jet.constant(np.zeros(len(angle)), 4) for _ in range(2)]
        begin = 0
        for k in range(self.count):
            end = int(np.searchsorted(nodes, k, side="right"))
            for jet, out in zip((a, w), found, strict=True):
                for whole, part in (
                    (out.value, jet.value),
                    (out.first, jet.first),
                    (out.second, jet.second),
                ):
                    whole[..., begin:end] = part[..., : end - begin]
            if end == len(nodes):
                break
            a, w = self._differentiated(
                a[end - begin :], w[end - begin :], weight[end:], damping[end:]
            )
            begin = end
        return found[0], found[1]

    def _differentiated(self, a: Jet, w: Jet, weight: Array, damping: Array) -> tuple[Jet, Jet]:
        """A step with the derivatives of its defining equation F(φ̄; φ, ω, γ, δ) = 0."""
        h, c = self.step, (2 + self.step * damping) / self.step
        angle, rate, middle = self._advance(a.value, w.value, weight, damping)
        sine, cosine = h / 2 * np.sin(middle), h / 2 * np.cos(middle)
        slope = c + weight * cosine
        right = w.first + c * a.first
        right[0] -= sine
        right[1] -= middle - a.value
        first = right / slope
        bent = w.second + c * a.second + weight * sine * first[:, None] * first[None]
        for axis, term in ((0, cosine * first), (1, first - a.first)):
            bent[axis] -= term
            bent[:, axis] -= term
        second = bent / slope
        return (
            Jet(angle, 2 * first - a.first, 2 * second - a.second),
            Jet(rate, 4 * (first - a.first) / h - w.first, 4 * (second - a.second) / h - w.second),
        )


def _composed(outer: Jet, inner: list[Jet]) -> Jet:
    """The jet of outer(inner(p)): `outer` has derivatives by the inner variables, these by p."""
    slopes, bends = np.stack([x.first for x in inner]), np.stack([x.second for x in inner])
    first = np.einsum("is,ips->ps", outer.first, slopes)
    second = np.einsum("ijs,ips,jqs->pqs", outer.second, slopes, slopes, optimize=True) + np.einsum(
        "is,ipqs->pqs", outer.first, bends
    )
    return Jet(outer.value, first, second)


def exact_bounds(
    lower: Array,
    upper: Array,
    duration: float,
    step: float,
    *,
    samples: int,
    seed: int,
    finer: int = 4,
) -> Array:
    """Attained upper bounds of (−force, force) of the exact motion, shape (T, 2), in N.

    Trajectories at polished points, extrapolated from the midpoint rule at steps `finer` and twice
    `finer` times as short.

    Args:
        lower: Lower ends of `PARAMETERS`, shape (6,).
        upper: Upper ends.
        duration: In s.
        step: Of the nodes, in s.
        samples: Points of the box that find the basins.
        seed: Of these.
        finer: Steps of the rougher of both between two nodes.
    """
    count = round(duration / step) + 1
    guide = PolishedSearch(Swing(lower, upper, step, count), len(PARAMETERS), count)
    guide.run(samples, 8, seed=seed, promising=1.0)
    points = np.unique(np.round(guide.at.reshape(-1, len(PARAMETERS)), 6), axis=0)
    inner = np.full((count, 2), -np.inf)
    for piece in np.array_split(points, -(-len(points) // CHUNK)):
        rough, fine = (
            Swing(lower, upper, step / n, n * (count - 1) + 1).values(piece)[:, ::n]
            for n in (finer, 2 * finer)
        )
        truth = (4 * fine - rough) / 3
        inner = np.maximum(inner, np.stack([(-truth).max(0), truth.max(0)], -1))
    return inner
