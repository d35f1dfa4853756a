"""Storage of computed graphs with parameters and, while memory lasts, derivatives."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.jet import Array


@dataclass(frozen=True, eq=False)
class Derivatives:
    """First and second derivatives of one graph by the unit coordinates.

    Args:
        first: Shape (T, outputs, d).
        second: Shape (T, outputs, d, d).
    """

    first: Array
    second: Array


@dataclass(eq=False)
class Storage:
    """All graphs computed so far.

    Derivatives are kept for the graphs used last and computed again when an older graph is best
    once more.

    Args:
        flow: Computes graphs.
        memory: Bytes that derivatives may take.
    """

    flow: UnitFlow
    memory: float = 4e8
    recomputed: int = 0
    _points: Array = field(init=False)
    _values: Array = field(init=False)
    _count: int = 0
    _derivatives: OrderedDict[int, Derivatives] = field(default_factory=OrderedDict)

    def __post_init__(self) -> None:
        d, shape = len(self.flow.boxes.names), (len(self.flow.time), len(self.flow.outputs))
        self._points, self._values = np.empty((64, d)), np.empty((*shape, 64))

    def __len__(self) -> int:
        return self._count

    @property
    def points(self) -> Array:
        """Unit coordinates of the graphs, shape (G, d)."""
        return self._points[: self._count]

    @property
    def values(self) -> Array:
        """The graphs, shape (T, outputs, G)."""
        return self._values[..., : self._count]

    def holds(self, point: Array) -> bool:
        """True if the graph of `point` is stored."""
        return bool((np.abs(self.points - point).max(1, initial=0.0) < 1e-9).any())

    def add(self, points: Array) -> None:
        """Computes and stores the graphs at unit coordinates (S, d)."""
        jet = self.flow.taylor(points)
        self._reserve(self._count + len(points))
        for s, point in enumerate(points):
            self._points[self._count], self._values[..., self._count] = point, jet.value[s]
            self._keep(
                self._count,
                Derivatives(
                    np.moveaxis(jet.first[:, s], 0, -1),
                    np.moveaxis(jet.second[:, :, s], (0, 1), (-2, -1)),
                ),
            )
            self._count += 1

    def derivatives(self, graph: int) -> Derivatives:
        """Derivatives of a stored graph."""
        if graph not in self._derivatives:
            self.recomputed += 1
            jet = self.flow.taylor(self.points[graph][None])
            self._keep(
                graph,
                Derivatives(
                    np.moveaxis(jet.first[:, 0], 0, -1),
                    np.moveaxis(jet.second[:, :, 0], (0, 1), (-2, -1)),
                ),
            )
        self._derivatives.move_to_end(graph)
        return self._derivatives[graph]

    def _keep(self, graph: int, derivatives: Derivatives) -> None:
        self._derivatives[graph] = derivatives
        size = derivatives.first.nbytes + derivatives.second.nbytes
        while len(self._derivatives) > max(8, self.memory / size):
            self._derivatives.popitem(last=False)

    def _reserve(self, count: int) -> None:
        if count > len(self._points):
            room = max(count, 2 * len(self._points))
            points = np.empty((room, self._points.shape[1]))
            values = np.empty((*self._values.shape[:2], room))
            points[: self._count], values[..., : self._count] = self.points, self.values
            self._points, self._values = points, values
