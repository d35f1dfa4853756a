"""Best points so far of the problems of an envelope: one for each node, output and side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.modal.model import ModalModel

Response = ModalModel
NEAR, DECADES = 8, 8.0
"""One in how many fresh points lies near the faces, and how near: decades of the box's width."""


@dataclass(eq=False)
class Optima:
    """Best points so far of N problems.

    Args:
        node: Time node of each problem, shape (N,).
        output: Its output, shape (N,).
        side: +1 for an upper bound, −1 for a lower, shape (N,).
        point: Unit coordinates, shape (N, d).
        value: side × output there, shape (N,).
        predicted_gain: Gain over it that Newton's method predicted last, shape (N,).
    """

    node: Array
    output: Array
    side: Array
    point: Array
    value: Array
    predicted_gain: Array

    def offer(self, model: Response, points: Array, which: Array) -> Array:
        """Replace best points of problems `which` (W,) by better `points` (W, d); return these."""
        if not len(which):
            return which
        value = self.side[which] * model.value_at(points, self.node[which], self.output[which])
        better = value > self.value[which] + 1e-12
        self.point[which[better]], self.value[which[better]] = points[better], value[better]
        return which[better]


def problems(nodes: Array, outputs: int, d: int) -> Optima:
    """Problems of both sides of all outputs at `nodes`, with no best points yet (value −∞).

    They are ordered by node, then output, then side (−1, +1). `outputs` is the number of outputs.
    """
    node = np.repeat(nodes, 2 * outputs)
    return Optima(
        node=node,
        output=np.tile(np.repeat(np.arange(outputs), 2), len(nodes)),
        side=np.tile([-1.0, 1.0], len(nodes) * outputs),
        point=np.zeros((len(node), d)),
        value=np.full(len(node), -np.inf),
        predicted_gain=np.zeros(len(node)),
    )


def best_of(
    pool: Array,
    values: Array,
    nodes: Array,
    few: int | None = None,
    rng: np.random.Generator | None = None,
) -> Optima:
    """Best points of a pool for each problem: output and side at a node; see `problems`.

    The best of many points has a bias: corners of the box are in the pool, an optimum inside is
    not, so that a basin inside little above a corner is missed. Few points give it a chance.

    Args:
        pool: Points, shape (P, d).
        values: Their trajectories at the nodes, shape (P, len(nodes), m).
        nodes: Time nodes of the problems.
        few: Number of points drawn anew for each problem; all of the pool if None.
        rng: Draws them.
    """
    optima = problems(nodes, values.shape[-1], pool.shape[1])
    columns = values.reshape(len(pool), -1)
    rows = np.arange(len(optima.node))
    if rng is None or few is None:
        best = np.stack([columns.argmin(0), columns.argmax(0)], 1).ravel()
    else:
        drawn = rng.integers(len(pool), size=(few, len(rows)))
        best = drawn[(optima.side * columns[drawn, rows // 2]).argmax(0), rows]
    optima.point[:], optima.value[:] = pool[best], optima.side * columns[best, rows // 2]
    return optima


def fresh_points(rng: np.random.Generator, lower: Array, upper: Array, size: int) -> Array:
    """Random points of a box, shape (size, d), some with coordinates on faces or near them."""
    points = rng.uniform(lower, upper, (size, len(lower)))
    on_face = rng.random(points.shape) < rng.choice([0.0, 0.3, 0.6], (size, 1))
    face = np.where(rng.random(points.shape) < 0.5, lower, upper)
    # an extreme close beside a face would hardly be met otherwise
    near_face = np.arange(size) % NEAR == 0
    distance = 10.0 ** rng.uniform(-DECADES, 0, (int(near_face.sum()), 1))  # as a fraction
    points[near_face] = face[near_face] + distance * (points[near_face] - face[near_face])
    points[on_face] = face[on_face]
    return points


def trajectories(model: ModalModel, points: Array, nodes: Array | None = None) -> Array:
    """Values of the model at points (P, d) and the nodes, all unless named, shape (P, T, m)."""
    rows = slice(None) if nodes is None else nodes
    return np.concatenate(
        [model.values(points[k : k + 64])[:, rows] for k in range(0, len(points), 64)]
    )
