"""State of the improved Graph Follower: best bounds, and what models of graphs propose."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.box_quadratic import gain, global_maximum, local_maximum
from alphacut.frame.calculus.jet import Jet
from alphacut.frame.methods.held_models import HeldModels, models_at
from alphacut.fuzzy.arrays import Array

TRIES = 40
"""Proposals looked at per window of time."""
SPACING = 0.02
"""Distance in unit coordinates between graphs of one batch."""


@dataclass(eq=False)
class Pursuit:
    """State of the search: best bounds, and what the models of stored graphs propose.

    Arrays over problems have shape (T, m, 2); sides are (−output, output), both to be maximised.

    Args:
        flow: Computes graphs.
        points: Unit coordinates of all graphs so far, shape (G, d).
        value: Attained bounds of the present level.
        at: Unit coordinates that attain them, shape (T, m, 2, d).
        promise: Bound promised by the model of the best graph.
        target: Unit coordinates it promises it at, shape (T, m, 2, d).
        bounds: Attained bounds per finished level, shape (A, T, m, 2).
        where: Their unit coordinates.
        correction: What the final models still promise, at most the tolerance.
        open_gain: What they promise above the tolerance when the budget ends the search.
        held: Models of the graphs that attain the bounds.
        steepest: Largest slope of any graph along a coordinate, shape (m,).
    """

    flow: UnitFlow
    points: Array
    value: Array
    at: Array
    promise: Array
    target: Array
    bounds: Array
    where: Array
    correction: Array
    open_gain: Array
    held: HeldModels
    steepest: Array = field(default_factory=lambda: np.zeros(1))
    lower: Array = field(default_factory=lambda: np.zeros(0))
    upper: Array = field(default_factory=lambda: np.zeros(0))
    tolerance: float = 0.0
    reach: float = 0.6

    @classmethod
    def empty(cls, flow: UnitFlow, tolerance: float, reach: float) -> Pursuit:
        """Nothing known yet."""
        d, shape = len(flow.boxes.names), (len(flow.time), len(flow.outputs), 2)
        levels = len(flow.boxes.alpha)
        low, at = np.full(shape, -np.inf), np.zeros((*shape, d))
        many, where = np.zeros((levels, *shape)), np.zeros((levels, *shape, d))
        grids = (low, at, low.copy(), at.copy(), many, where, many.copy(), many.copy())
        held = HeldModels.empty(shape, d)
        made = cls(flow, np.zeros((0, d)), *grids, held)
        made.tolerance, made.reach = tolerance, reach
        return made

    def enter(self, lower: Array, upper: Array) -> None:
        """Start a level; attained values stay, models are asked anew in the wider box."""
        self.lower, self.upper = lower, upper
        self.promise[:] = self.value
        if len(self.points) and (upper > lower).any():
            places = np.nonzero(np.isfinite(self.value))
            optima = self._optima(self.at[places], self.held.models(places), places[-1])
            self.promise[places], self.target[places] = optima

    def leave(self, level: int) -> None:
        """Post-processing of a level."""
        promised = np.maximum(self.promise - self.value, 0.0)
        small = promised <= self.tolerance * self.flow.scale[:, None]
        self.bounds[level], self.where[level] = self.value, self.at
        self.correction[level] = np.where(small, promised, 0.0)
        self.open_gain[level] = np.where(small, 0.0, promised)

    def take(self, points: Array) -> None:
        """Computes graphs, updates the bounds at all nodes and asks their models."""
        jet = self.flow.taylor(points)
        self.points = np.vstack([self.points, points])
        self.steepest = np.maximum(self.steepest, np.abs(jet.first).max((0, 1, 2)))
        self._ask(points, jet)

    def _ask(self, points: Array, jet: Jet) -> None:
        """Takes in what is better, and asks the models that hold a bound now about more."""
        holder = np.full(self.value.shape, -1)
        for s, point in enumerate(points):
            signed = np.stack([-jet.value[s], jet.value[s]], -1)
            better = signed > self.value
            self.value[better], self.at[better], holder[better] = signed[better], point, s
        self.held.keep(jet, holder)
        places = np.nonzero(holder >= 0)
        if len(places[0]) and (self.upper > self.lower).any():
            models = models_at(jet, (holder[places], *places[:2]))
            optima = self._optima(self.at[places], models, places[2])
            self.promise[places], self.target[places] = optima

    def _optima(
        self, points: Array, models: tuple[Array, Array, Array], side: Array
    ) -> tuple[Array, Array]:
        """Promises of models about K points, shape (K,), and where they are, shape (K, d)."""
        sign = 2.0 * side - 1
        value, g, H = models[0] * sign, models[1] * sign[:, None], models[2] * sign[:, None, None]
        reach = self.reach * np.maximum((self.upper - self.lower) / 2, 1e-300)
        low = np.maximum(self.lower - points, -reach)
        high = np.minimum(self.upper - points, reach)
        maximise = global_maximum if points.shape[1] <= 4 else local_maximum
        x = maximise(g, H, low, high)
        return value + gain(g, H, x), points + x

    def proposals(self, count: int) -> Array:
        """Most promising points of every window of time, apart from others, (≤ count, d)."""
        chosen: list[Array] = []
        for window in np.array_split(
            np.arange(len(self.value)), max(1, min(count, len(self.value)))
        ):
            gains = (self.promise - self.value)[window] / self.flow.scale[:, None]
            for k in np.argsort(-gains, axis=None)[:TRIES]:
                t, o, side = np.unravel_index(k, gains.shape)
                place = (window[t], o, side)
                if gains[t, o, side] <= self.tolerance:
                    break
                point = np.clip(self.target[place], self.lower, self.upper)
                if (np.abs(self.points - point).max(1) < 1e-7).any():
                    # tried already: the model promised too much
                    self.promise[place] = self.value[place]
                elif all(np.abs(point - other).max() > SPACING for other in chosen):
                    chosen.append(point)
                    break
        return np.array(chosen)[:count].reshape(-1, len(self.lower))
