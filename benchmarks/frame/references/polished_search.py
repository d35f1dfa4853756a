"""True envelopes by dense sampling and Newton's method from the best points.

No storage of graphs, no modes, no polynomials: what the methods are judged by shares nothing with
them but the quadratic problem that proposes Newton's steps, and every value is that of a
trajectory.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.stats import qmc

from alphacut.frame import Envelope
from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.box_quadratic import gain, local_maximum
from alphacut.frame.calculus.jet import Array, Jet


class Response(Protocol):
    """Numbers over the unit box, Q of them: the outputs at the nodes, node by node."""

    def values(self, unit: Array) -> Array:
        """All numbers at points (S, d), shape (S, Q)."""

    def jets(self, unit: Array, which: Array) -> Jet:
        """Number `which[s]` at point s, with derivatives by the unit coordinates, V = (S,)."""


@dataclass(frozen=True, eq=False)
class FlowResponse:
    """The outputs of any flow.

    Args:
        flow: The trajectories.
    """

    flow: UnitFlow

    def values(self, unit: Array) -> Array:
        """All outputs at all nodes, shape (S, T m)."""
        return self.flow.values(unit).reshape(len(unit), -1)

    def jets(self, unit: Array, which: Array) -> Jet:
        """One output at one node per point."""
        found = []
        for chunk in np.array_split(np.arange(len(unit)), -(-len(unit) // 64)):
            jet, each = self.flow.taylor(unit[chunk]), np.arange(len(chunk))
            node, output = np.divmod(which[chunk], len(self.flow.outputs))
            found.append(jet[each, node, output])
        return Jet(
            *(
                np.concatenate([getattr(jet, part) for jet in found], -1)
                for part in ("value", "first", "second")
            )
        )


@dataclass(eq=False)
class PolishedSearch:
    """Upper bounds of (−number, number) over the unit box: `value` (Q, 2), reached `at` (Q, 2, d).

    Args:
        response: The numbers.
        dimension: Number of parameters d.
        count: Number of numbers Q.
        chunk: Points computed together.
        small: Gain not worth a further step, in units of the numbers.
    """

    response: Response
    dimension: int
    count: int
    chunk: int = 2048
    small: float = 1e-7

    def __post_init__(self) -> None:
        self.value = np.full((self.count, 2), -np.inf)
        self.at = np.zeros((self.count, 2, self.dimension))

    def run(
        self,
        samples: int,
        candidates: int,
        *,
        seed: int = 0,
        neighbour: int = 1,
        promising: float = np.inf,
    ) -> PolishedSearch:
        """Sample the box, polish the best points, pass optima on between neighbours.

        Args:
            samples: Points of the box.
            candidates: Points polished per number and side, a power of 2 and at most 2^d.
            seed: Of the points.
            neighbour: Distance of the same output at the next node, the number of outputs.
            promising: Neighbours' optima that begin further short than this are not polished.
        """
        rivals = self._sampled(samples, candidates, seed)
        for k in range(candidates):
            self.polish(rivals[:, :, k], np.inf)
        for reach in (1, 4, 16, 64, 1, 1):
            for shift in (reach, -reach):
                self.polish(np.roll(self.at, shift * neighbour, axis=0), promising)
        return self

    def _sampled(self, samples: int, candidates: int, seed: int) -> Array:
        """Best point of every orthant of the main parameters, (Q, 2, candidates, d)."""
        points = spread(samples, self.dimension, seed)
        axes = self._important()[: int(np.log2(candidates))]
        orthant = (points[:, axes] > 0) @ (1 << np.arange(len(axes)))
        best = np.full((self.count, 2, candidates), -np.inf)
        rivals = np.zeros((*best.shape, self.dimension))
        for part in range(candidates):
            share = points[orthant == part]
            for chunk in np.array_split(share, -(-len(share) // self.chunk)) if len(share) else ():
                values = self.response.values(chunk)
                for side, sign in ((0, -1.0), (1, 1.0)):
                    pick = (sign * values).argmax(0)
                    top = sign * values[pick, np.arange(self.count)]
                    better = top > best[:, side, part]
                    best[better, side, part], rivals[better, side, part] = (
                        top[better],
                        chunk[pick[better]],
                    )
        return rivals

    def _important(self) -> Array:
        """Parameters by their mean slope in the middle of the box, the steepest first."""
        which = np.arange(self.count)
        slopes = self.response.jets(np.zeros((self.count, self.dimension)), which).first
        order: Array = np.argsort(-np.abs(slopes).mean(1), kind="stable")
        return order

    def polish(self, starts: Array, promising: float = np.inf) -> None:
        """Newton's method from `starts` (Q, 2, d) that are at most `promising` short."""
        number, side = np.repeat(np.arange(self.count), 2), np.tile([0, 1], self.count)
        flat = starts.reshape(-1, self.dimension)
        for which in np.array_split(np.arange(len(flat)), -(-len(flat) // self.chunk)):
            self._newton(flat[which], number[which], side[which], promising)

    def _newton(self, x: Array, number: Array, side: Array, promising: float) -> None:
        """Newton's method with a trust region in the box."""
        value, g, H = self._model(x, number, side)
        keep = value > self.value[number, side] - promising
        x, number, side, value, g, H = (y[keep] for y in (x, number, side, value, g, H))
        radius = np.full(len(x), 0.5)
        for _ in range(25):
            self._offer(x, number, side, value)
            low, high = np.maximum(-1 - x, -radius[:, None]), np.minimum(1 - x, radius[:, None])
            step = local_maximum(g, H, low, high)
            promised = gain(g, H, step)
            keep = promised > self.small
            x, number, side, value, g, H, radius, step, promised = (
                y[keep] for y in (x, number, side, value, g, H, radius, step, promised)
            )
            if not len(x):
                return
            trial = np.clip(x + step, -1, 1)
            new, g2, H2 = self._model(trial, number, side)
            ratio, better = (new - value) / promised, new > value
            x[better], value[better], g[better], H[better] = (
                trial[better],
                new[better],
                g2[better],
                H2[better],
            )
            radius = np.where(
                ratio > 0.75, 2 * radius, np.where(ratio < 0.25, 0.3 * np.abs(step).max(1), radius)
            )
        self._offer(x, number, side, value)

    def _model(self, x: Array, number: Array, side: Array) -> tuple[Array, Array, Array]:
        jet, sign = self.response.jets(x, number), 2.0 * side - 1
        return sign * jet.value, (sign * jet.first).T, np.moveaxis(sign * jet.second, -1, 0)

    def _offer(self, x: Array, number: Array, side: Array, value: Array) -> None:
        better = value > self.value[number, side]
        self.value[number[better], side[better]], self.at[number[better], side[better]] = (
            value[better],
            x[better],
        )


def spread(samples: int, d: int, seed: int) -> Array:
    """Sobol points as corners, Chebyshev and uniform density, (samples, d) in [−1, 1]."""
    share = qmc.Sobol(d, rng=np.random.default_rng(seed)).random(samples)
    kind = (np.arange(samples) % 3)[:, None]
    points: Array = np.select(
        [kind == 0, kind == 1], [np.sign(share - 0.5), -np.cos(np.pi * share)], 2 * share - 1
    )
    return points


def true_envelope(
    flow: UnitFlow,
    *,
    samples: int = 2**14,
    candidates: int = 16,
    seed: int = 1,
    promising: float = np.inf,
) -> TrueEnvelope:
    """Envelope over the widest box at all nodes of `flow`."""
    m = len(flow.outputs)
    search = PolishedSearch(
        FlowResponse(flow), len(flow.boxes.names), len(flow.time) * m, chunk=256
    )
    return TrueEnvelope(
        flow, search.run(samples, candidates, seed=seed, neighbour=m, promising=promising)
    )


@dataclass(frozen=True, eq=False)
class TrueEnvelope:
    """A reference, which also takes up what the methods compared with it find.

    Args:
        flow: The trajectories.
        search: The optima.
    """

    flow: UnitFlow
    search: PolishedSearch

    @property
    def bounds(self) -> Array:
        """Lower and upper bounds, shape (T, m, 2)."""
        return (self.search.value * [-1, 1]).reshape(len(self.flow.time), -1, 2)

    def errors(self, found: Envelope) -> Array:
        """Distance of both bounds at α = 0 from the truth, shape (T, m, 2).

        The nodes of the reference are every n-th of `found`.
        """
        every = (len(found.time) - 1) // (len(self.flow.time) - 1)
        at = np.stack([found.lower_at[0, ::every], found.upper_at[0, ::every]], 2)
        self.search.polish(self.flow.boxes.to_unit(at).reshape(self.search.at.shape))
        wrong: Array = np.abs(
            np.stack([found.lower[0, ::every], found.upper[0, ::every]], -1) - self.bounds
        )
        return wrong
