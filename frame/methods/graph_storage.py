"""Storage of computed graphs: parameters, and the best at every place with its derivatives."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.jet import Array
from alphacut.frame.methods.held_models import HeldModels

Index = np.ndarray[tuple[int, ...], np.dtype[np.int64]]
Places = tuple[Array, ...]
"""Indices of nodes, outputs and sides, one of each for a place."""


@dataclass(eq=False)
class Storage:
    """All graphs computed so far; arrays over places have shape (T, m, 2), (−output, output) last.

    Args:
        flow: Computes graphs.
        record: Whether to keep the graphs themselves.
        points: Their unit coordinates, shape (G, d).
        graphs: They, each of shape (T, m), where they are kept.
        top: The best value at each place.
        best: Which graph has it, the first where several do.
        held: Derivatives of that graph.
        steepest: Largest slope of any graph along a coordinate, shape (m,).
    """

    flow: UnitFlow
    record: bool = False
    points: Array = field(init=False)
    graphs: list[Array] = field(default_factory=list)
    top: Array = field(init=False)
    best: Index = field(init=False)
    held: HeldModels = field(init=False)
    steepest: Array = field(init=False)

    def __post_init__(self) -> None:
        d, shape = len(self.flow.boxes.names), (len(self.flow.time), len(self.flow.outputs), 2)
        self.points, self.top = np.empty((0, d)), np.full(shape, -np.inf)
        self.steepest = np.zeros(shape[1])
        self.best, self.held = np.zeros(shape, np.int64), HeldModels.empty(shape, d)

    def __len__(self) -> int:
        return len(self.points)

    def holds(self, point: Array) -> bool:
        """True if the graph of `point` is stored."""
        return bool((np.abs(self.points - point).max(1, initial=0.0) < 1e-9).any())

    def add(self, points: Array) -> Places:
        """Computes and stores the graphs at unit coordinates (S, d); places where one is best."""
        jet, top = self.flow.taylor(points), self.top.reshape(-1)
        self.steepest = np.maximum(self.steepest, np.abs(jet.first).max((0, 1, 2)))
        holder = np.full(top.shape, -1)
        for s, value in enumerate(jet.value):
            signed = np.stack([-value, value], -1).ravel()
            better = np.flatnonzero(signed > top)
            top[better], holder[better] = signed[better], s
        won = np.flatnonzero(holder >= 0)
        self.best.reshape(-1)[won] = len(self) + holder[won]
        self.held.keep(jet, holder.reshape(self.top.shape))
        self.points = np.vstack([self.points, points])
        if self.record:
            self.graphs += list(jet.value)
        return np.unravel_index(won, self.top.shape)
