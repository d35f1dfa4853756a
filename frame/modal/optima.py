"""Best points so far of the problems of an envelope: one for each node, output and side."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from alphacut.frame.calculus.jet import Array
from alphacut.frame.modal.exact_response import ExactResponse
from alphacut.frame.modal.model import ModalModel

Response = ModalModel | ExactResponse
FEW = (1, 4, 32)
"""Points out of which the best are starts of an independent pass, beside the best of all."""


@dataclass(eq=False)
class Optima:
    """Best points so far of N problems.

    Args:
        node: Time node of each problem, shape (N,).
        output: Its output, shape (N,).
        side: +1 for an upper bound, −1 for a lower, shape (N,).
        point: Unit coordinates, shape (N, d).
        value: side × output there, shape (N,).
        left: What Newton's method last promised beyond it, shape (N,).
    """

    node: Array
    output: Array
    side: Array
    point: Array
    value: Array
    left: Array

    def take(self, which: Array) -> Optima:
        """A copy of the problems `which`."""
        return Optima(*(getattr(self, part.name)[which].copy() for part in fields(self)))

    def offer(self, model: Response, points: Array, which: Array) -> Array:
        """Try `points` (W, d) on problems `which` (W,), keep and return the better ones."""
        if not len(which):
            return which
        value = self.side[which] * model.value_at(points, self.node[which], self.output[which])
        better = value > self.value[which] + 1e-12
        self.point[which[better]], self.value[which[better]] = points[better], value[better]
        return which[better]


def problems(nodes: Array, outputs: int, d: int) -> Optima:
    """All outputs and sides at `nodes`, node by node; the sides of an output are (−1, +1)."""
    count = 2 * outputs
    node = np.repeat(nodes, count)
    output = np.tile(np.repeat(np.arange(outputs), 2), len(nodes))
    side = np.tile([-1.0, 1.0], len(nodes) * outputs)
    return Optima(
        node,
        output,
        side,
        np.zeros((len(node), d)),
        np.full(len(node), -np.inf),
        np.zeros(len(node)),
    )


def best_of_pool(pool: Array, values: Array, nodes: Array, starts: int) -> list[Optima]:
    """Best points of the pool (P, d) for every problem, and rivals elsewhere."""
    m = values.shape[-1]
    chosen = (values if len(nodes) == values.shape[1] else values[:, nodes]).reshape(len(pool), -1)
    # points this near the best are taken out together with it
    reach = 0.25 * np.ptp(pool, axis=0).max()
    out = [problems(nodes, m, pool.shape[1]) for _ in range(starts)]
    for column, sign in enumerate((-1.0, 1.0)):
        left: Array = chosen
        for optima in out:
            best = _first_extreme(left, sign)
            optima.point[column::2], optima.value[column::2] = (
                pool[best],
                sign * chosen[best, np.arange(len(best))],
            )
            if optima is not out[-1]:
                unique, index = np.unique(best, return_inverse=True)
                near = np.stack([np.abs(pool - pool[k]).max(1) < reach for k in unique], 1)
                left = np.where(near[:, index], -sign * np.inf, left)
    return out


def _first_extreme(values: Array, sign: float) -> NDArray[np.intp]:
    """The row with the least or greatest value of each column; few columns at a time, in cache."""
    parts = (values[:, first : first + 64] for first in range(0, values.shape[1], 64))
    return np.concatenate([x.argmin(0) if sign < 0 else x.argmax(0) for x in parts])


def best_of_few(
    pool: Array, values: Array, nodes: Array, few: int, rng: np.random.Generator
) -> Optima:
    """Best of a few points of the pool (P, d), drawn anew for every problem.

    The best of many points has a bias: corners are met exactly, an optimum inside is not, so one
    that lies little above a corner is never begun from. Few points give each basin a chance.

    Args:
        pool: Points, shape (P, d).
        values: Their trajectories, shape (P, T, m), or at `nodes` alone.
        nodes: Time nodes of the problems.
        few: Points drawn for a problem.
        rng: Draws them.
    """
    optima = problems(nodes, values.shape[-1], pool.shape[1])
    chosen = (values if len(nodes) == values.shape[1] else values[:, nodes]).reshape(len(pool), -1)
    every = np.arange(len(optima.node))
    drawn = rng.integers(len(pool), size=(few, len(every)))
    found = optima.side * chosen[drawn, every // 2]
    best = found.argmax(0)
    optima.point[:], optima.value[:] = pool[drawn[best, every]], found[best, every]
    return optima
