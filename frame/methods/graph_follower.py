"""Graph Follower (section 5.3): envelopes from few graphs and their Taylor models.

This differs from the paper in: 1. One storage serves all outputs, both sides and all levels: levels
are treated from the narrowest box to the widest, so that every stored graph is admissible and
α-cuts are nested by construction. 2. A new graph is computed only where the Taylor model promises
more than an explicit tolerance. 3. Further sweeps, the exact quadratic problem, models of several
graphs and the Taylor-corrected value are there, each on its own switch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.box_quadratic import (
    gain,
    global_maximum,
    linear_maximum,
    local_maximum,
)
from alphacut.frame.calculus.jet import Array
from alphacut.frame.methods.graph_storage import Storage

Index = np.ndarray[tuple[int, ...], np.dtype[np.int64]]
APART = 0.5
"""Distance in unit coordinates from which graphs count as distinct."""


class FollowerStep(NamedTuple):
    """Record of one node for one bound (Figs. 21 to 23).

    Args:
        level: Index of the α-cut.
        node: Index of the time node.
        output: Index of the output.
        side: +1 upper bound, −1 lower bound.
        guess: Index of the best stored graph, the initial guess.
        found: Index of the new graph, or −1 when the guess stays.
        predicted: The bound that the Taylor model promises.
    """

    level: int
    node: int
    output: int
    side: int
    guess: int
    found: int
    predicted: float


@dataclass(eq=False)
class Followed:
    """Outcome of the Graph Follower.

    Args:
        bounds: Upper bounds of ±output after post-processing, shape (A, T, m, 2), the sides last:
            (−output, output).
        best: Index of the graph that attains each, shape (A, T, m, 2).
        correction: Gain that the Taylor model of that graph still promises, shape (A, T, m, 2);
            zero unless asked for.
        storage: All graphs.
        steps: The record, where it was asked for.
        exhausted: Whether the budget ended the search.
    """

    bounds: Array
    best: Index
    correction: Array
    storage: Storage
    steps: list[FollowerStep] = field(default_factory=list)
    exhausted: bool = False


@dataclass(frozen=True)
class GraphFollower:
    """The method and its switches.

    Args:
        order: Degree κ of the Taylor model, 1 or 2.
        tolerance: Predicted gain above which a new graph is computed, in units of the (first)
            output.
        sweeps: Passes over time, alternately forward and backward.
        exact: Solve the quadratic problem globally over the faces of the box instead of uphill from
            the guess.
        models: Number of distinct graphs whose models are asked at each node.
        corrected: Report the bound that the Taylor model promises instead of the one attained.
        budget: Most graphs to compute; None for no limit.
        record: Keep every step.

    Raises:
        ValueError: A switch is out of its range.
    """

    order: int = 2
    tolerance: float = 1e-4
    sweeps: int = 1
    exact: bool = False
    models: int = 1
    corrected: bool = False
    budget: int | None = None
    record: bool = False

    def __post_init__(self) -> None:
        if self.order not in (1, 2):
            raise ValueError(
                f"order: {self.order} is not allowed; the Taylor model has degree 1 or 2"
            )
        if not (self.tolerance > 0 and np.isfinite(self.tolerance)):
            raise ValueError(f"tolerance: {self.tolerance:g} is not allowed; it must be positive")
        if self.sweeps < 1 or self.models < 1 or (self.budget is not None and self.budget < 1):
            raise ValueError(
                f"sweeps {self.sweeps}, models {self.models}, budget {self.budget}: each must be at"
                " least 1"
            )

    def run(self, flow: UnitFlow, *, progress: Callable[[float], None] | None = None) -> Followed:
        """Follows the graphs on all levels of `flow.boxes`."""
        storage = Storage(flow)
        storage.add(flow.boxes.to_unit(flow.boxes.modal)[None])
        shape = (len(flow.boxes.alpha), len(flow.time), len(flow.outputs), 2)
        out = Followed(np.empty(shape), np.empty(shape, np.int64), np.zeros(shape), storage)
        levels = len(flow.boxes.alpha)
        for done, level in enumerate(reversed(range(levels))):
            for sweep in range(self.sweeps):
                order = range(shape[1])[:: 1 if sweep % 2 == 0 else -1]
                before = len(storage)
                self._sweep(
                    out,
                    level,
                    order,
                    progress,
                    (done + sweep / self.sweeps) / levels,
                    1 / (levels * self.sweeps),
                )
                if sweep and len(storage) == before:
                    break
            signed = _signed(storage.values)
            # post-processing: the best of all graphs at every node (Fig. 24)
            out.best[level] = signed.argmax(-1)
            out.bounds[level] = np.take_along_axis(signed, out.best[level][..., None], -1)[..., 0]
            if self.corrected:
                self._correct(out, level)
        return out

    def _sweep(
        self,
        out: Followed,
        level: int,
        nodes: Iterable[int],
        progress: Callable[[float], None] | None,
        start: float,
        share: float,
    ) -> None:
        lower, upper = out.storage.flow.boxes.unit(level)
        if not (upper > lower).any():
            return
        total = len(out.storage.flow.time)
        for count, node in enumerate(nodes):
            if progress and count % 100 == 0:
                progress(start + share * count / total)
            if self.budget is not None and len(out.storage) >= self.budget:
                out.exhausted = True
                return
            self._node(out, level, node, (lower, upper))

    def _node(self, out: Followed, level: int, node: int, box: tuple[Array, Array]) -> None:
        storage = out.storage
        signed = _signed(storage.values[node])  # (m, 2, G)
        attained = signed.max(-1).ravel()
        guesses = self._guesses(signed.reshape(-1, signed.shape[-1]), storage.points)
        new: list[Array] = []
        tried: list[tuple[int, int, int, float]] = []
        for guess in guesses.T:
            base, x, promised = self._optima(storage, node, guess, box)
            value = base + promised
            for k in np.flatnonzero(
                value > attained + self.tolerance * np.repeat(storage.flow.scale, 2)
            ):
                point = np.clip(storage.points[guess[k]] + x[k], *box)
                fresh = not storage.holds(point) and all(
                    np.abs(point - other).max() > 1e-9 for other in new
                )
                tried.append(
                    (
                        int(k),
                        int(guess[k]),
                        len(storage) + len(new) if fresh else -1,
                        float(value[k]),
                    )
                )
                if fresh:
                    new.append(point)
        if new:
            storage.add(np.array(new))
        if self.record:
            self._note(out, level, node, guesses[:, 0], tried)

    def _guesses(self, signed: Array, points: Array) -> Index:
        """Indices of the best, distinct stored graphs per bound, shape (2m, models)."""
        left = signed
        out: list[Index] = []
        for _ in range(min(self.models, signed.shape[1])):
            best = left.argmax(1)
            out.append(best)
            if len(out) < self.models:
                near = np.abs(points[best][:, None] - points[None]).max(-1) < APART
                left = np.where(near, -np.inf, left)
        return np.stack(out, 1)

    def _optima(
        self, storage: Storage, node: int, guess: Index, box: tuple[Array, Array]
    ) -> tuple[Array, Array, Array]:
        """Values, steps to the optima of the Taylor models (eq. 22), and promised gains."""
        m = len(guess) // 2
        side = np.tile([-1.0, 1.0], m)
        g, H = (np.empty((2 * m, *shape)) for shape in ((len(box[0]),), (len(box[0]),) * 2))
        for k, graph in enumerate(guess):
            model = storage.derivatives(int(graph))
            g[k], H[k] = side[k] * model.first[node, k // 2], side[k] * model.second[node, k // 2]
        base = side * storage.values[node, np.arange(2 * m) // 2, guess]
        lower, upper = box[0] - storage.points[guess], box[1] - storage.points[guess]
        x = self._maximise(g, H, lower, upper)
        return base, x, gain(g, H if self.order == 2 else 0 * H, x)

    def _maximise(self, g: Array, H: Array, lower: Array, upper: Array) -> Array:
        if self.order == 1:
            return linear_maximum(g, lower, upper)
        return (
            global_maximum(g, H, lower, upper) if self.exact else local_maximum(g, H, lower, upper)
        )

    def _correct(self, out: Followed, level: int) -> None:
        """Gain that the Taylor model of the best graph still promises."""
        box = out.storage.flow.boxes.unit(level)
        limit = self.tolerance * np.repeat(out.storage.flow.scale, 2)
        for node in range(out.bounds.shape[1]):
            _, _, promised = self._optima(out.storage, node, out.best[level, node].ravel(), box)
            out.correction[level, node] = np.where(promised <= limit, promised, 0.0).reshape(
                out.correction.shape[2:]
            )

    def _note(
        self,
        out: Followed,
        level: int,
        node: int,
        guesses: Index,
        tried: list[tuple[int, int, int, float]],
    ) -> None:
        found = {k: (guess, graph, value) for k, guess, graph, value in reversed(tried)}
        for k, best in enumerate(guesses):
            side = 2 * (k % 2) - 1
            guess, graph, value = found.get(k, (int(best), -1, float("nan")))
            out.steps.append(FollowerStep(level, node, k // 2, side, guess, graph, side * value))


def _signed(values: Array) -> Array:
    """(−values, values) on a new axis before the last, (…, G) to (…, 2, G)."""
    return np.stack([-values, values], -2)
