"""Storage of computed graphs: parameters, and the best at every place with its Taylor model."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.box_quadratic import gain
from alphacut.frame.calculus.jet import Array

Index = np.ndarray[tuple[int, ...], np.dtype[np.int64]]
Places = tuple[Array, ...]
"""Indices of nodes, outputs and sides, one of each for a place."""


class Storage:
    """All graphs (trajectories) computed so far, and the best of them at each place.

    Arrays over places have shape (T, m, 2): node, output, and side (−output, output).

    Attributes:
        flow: Computes graphs.
        points: Their unit coordinates, shape (G, d).
        top: The best value at each place.
        best: Which graph has it, the first where several do.
        first: First derivatives of that graph's output, shape (T, m, 2, d).
        second: Second ones, shape (T, m, 2, d, d).
        steepest: Largest slope of any graph along a coordinate, shape (m,).
    """

    def __init__(self, flow: UnitFlow) -> None:
        d, shape = len(flow.boxes.names), (len(flow.time), len(flow.outputs), 2)
        self.flow, self.points, self.steepest = flow, np.empty((0, d)), np.zeros(shape[1])
        self.top, self.best = np.full(shape, -np.inf), np.zeros(shape, np.int64)
        self.first, self.second = np.zeros((*shape, d)), np.zeros((*shape, d, d))

    def __len__(self) -> int:
        return len(self.points)

    def holds(self, point: Array, near: float = 1e-9) -> bool:
        """Return whether a graph at `point` (d,) is stored, up to the distance `near`."""
        return bool((np.abs(self.points - point).max(1, initial=0.0) < near).any())

    def add(self, points: Array) -> Places:
        """Compute and store the graphs (trajectories) at unit coordinates (S, d).

        Returns:
            Node, output and side of each place where one of them is now the best.
        """
        jet, top = self.flow.taylor(points), self.top.reshape(-1)
        self.steepest = np.maximum(self.steepest, np.abs(jet.first).max((0, 1, 2)))
        best_new = np.full(top.shape, -1)  # which of them is the best; −1 for none
        for s, value in enumerate(jet.value):
            signed = np.stack([-value, value], -1).ravel()
            better = np.flatnonzero(signed > top)
            top[better], best_new[better] = signed[better], s
        improved = np.flatnonzero(best_new >= 0)
        places = np.unravel_index(improved, self.top.shape)
        entries = best_new[improved], *places[:2]  # graph, node and output
        self.best[places] = len(self) + best_new[improved]
        self.first[places] = np.moveaxis(jet.first, 0, -1)[entries]
        self.second[places] = np.moveaxis(jet.second, (0, 1), (-2, -1))[entries]
        self.points = np.vstack([self.points, points])
        return places

    def predicted(
        self,
        places: Places,
        box: tuple[Array, Array],
        maximise: Callable[..., Array],
        *,
        bend: float = 1.0,
        reach: Array | float = np.inf,
    ) -> tuple[Array, Array]:
        """Return the maxima of the best graphs' Taylor models over a box at K places (eq. 22).

        Args:
            places: Node, output and side of each place.
            box: Lower and upper ends of the unit coordinates, each (d,).
            maximise: Maximum of g·x + x·H·x/2 over boxes, from g, H and their ends.
            bend: Factor on second derivatives; 0 for linear models.
            reach: Distance from each graph's parameters up to which its model is trusted.

        Returns:
            Predicted values, shape (K,), and their unit coordinates, shape (K, d).
        """
        side, at = 2.0 * places[2] - 1, self.points[self.best[places]]
        g, H = side[:, None] * self.first[places], bend * side[:, None, None] * self.second[places]
        x = maximise(g, H, np.maximum(box[0] - at, -reach), np.minimum(box[1] - at, reach))
        return self.top[places] + gain(g, H, x), at + x
