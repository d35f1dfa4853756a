"""Search for motions beyond limits in growing boxes, and the proof that a box has none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from alphacut.frame.boxes import Boxes, UnitFlow
from alphacut.frame.calculus.jet import Array
from alphacut.frame.certificate.branch_and_bound import BranchAndBound
from alphacut.frame.checks.admissible import require_admissible
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.methods.proof import model_with_error
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.newton import refine
from alphacut.frame.modal.optima import Optima, best_of_pool, problems
from alphacut.frame.modal.starting_points import spread_points, trajectories
from alphacut.frame.structures.polynomial_dependence import UnprovedError

REFINED = 64
"""Motions of a search that are driven to their local extreme."""

TIE = 1e-12
"""Share of a limit by which rounding may lift a motion beyond one that it only reaches."""

LEAST = 1e-9
"""Share of the largest size below which a witness lies in the core that all boxes hold."""

Reach = Callable[[float], tuple[Array, Array]]

Unproved = list[tuple[float, float, str]]
"""Sizes and gaps whose model no proof covers, and why: more of either has none, too."""


@dataclass(frozen=True, eq=False)
class LimitFlow(UnitFlow):
    """Trajectories whose tolerances are shares of the limits."""

    limits: Array = field(default_factory=lambda: np.ones(0))

    @cached_property
    def scale(self) -> Array:
        """The limits, shape (m,)."""
        return self.limits


@dataclass(eq=False)
class LimitSearch:
    """Boxes of all scales, the true motion, and a model of it over the largest box."""

    flow: LinearFlow
    reach: Reach
    limits: Array
    nominal: Array
    gap: float
    failed: Unproved = field(default_factory=list)
    size: float = field(default=0.0, init=False)

    def fit(self, size: float) -> None:
        """Model of the motion over the box of a size, in units of the limits."""
        self.size = size
        lower, upper = self.reach(size)
        ends = np.stack([lower, self.nominal]), np.stack([upper, self.nominal])
        boxes = Boxes(self.flow.names, np.array([0.0, 1.0]), *ends, self.nominal)
        require_admissible(self.flow.system, boxes)
        unit = LimitFlow(self.flow, boxes, limits=self.limits)
        before = self.hopeless(size)
        try:
            fitted = model_with_error(self.flow, unit, self.gap, unproved=before)
        except UnprovedError as error:
            fitted = model_with_error(self.flow, unit, self.gap, unproved=str(error))
        model, error, self.reason = fitted
        if self.reason and not before:
            self.failed.append((size, self.gap, self.reason))
        self.model: ModalModel = model.in_units(self.limits)
        self.error: Array = error / self.limits

    def hopeless(self, size: float) -> str:
        """Why nothing is proved over the box of a size, where that is known from before."""
        known = (why for least, gap, why in self.failed if least <= size and gap >= self.gap)
        return next(known, "")

    def unit(self, size: float) -> tuple[Array, Array]:
        """Box of a size in the model's coordinates."""
        lower, upper = (self.model.boxes.to_unit(end) for end in self.reach(size))
        return lower, upper

    def share(self, point: Array) -> float:
        """Largest |output| / limit of the true motion at parameters (d,)."""
        return float((np.abs(self.flow.values(point[None])[0]) / self.limits).max())

    def exceeded(self, point: Array) -> bool:
        """Whether the true motion at parameters (d,) breaks a limit: to reach it is no break."""
        return self.share(point) > 1 + TIE

    def size_of(self, point: Array) -> float:
        """Least size up to the model's whose box holds a point."""
        low, high = 0.0, self.size
        for _ in range(40):
            middle = (low + high) / 2
            lower, upper = self.reach(middle)
            inside = bool(((lower <= point) & (point <= upper)).all())
            low, high = (low, middle) if inside else (middle, high)
        return high

    def witness(self, size: float) -> Array | None:
        """Parameters in the box whose true motion breaks a limit, pulled to the nominal ones."""
        found = _worst(self.model, *self.unit(size))
        for row in np.argsort(-found.value)[:4]:
            point = self.model.boxes.to_physical(found.point[row])
            if self.exceeded(point):
                return self.pulled(point, beyond=True)
        return None

    def pulled(self, point: Array, *, beyond: bool) -> Array:
        """The nearest point found on the way to the nominal one that also breaks or keeps limits.

        Args:
            point: Parameters, shape (d,), that break a limit, or keep all.
            beyond: Which of both.
        """
        other, same = 0.0, 1.0
        for _ in range(12):
            middle = (other + same) / 2
            held = self.exceeded(self.nominal + middle * (point - self.nominal)) == beyond
            other, same = (other, middle) if held else (middle, same)
        pulled: Array = self.nominal + same * (point - self.nominal)
        return pulled

    def refuted(self, precision: float) -> tuple[float, Array | None]:
        """Least size found that is unsafe, and its witness; infinite without one."""
        witness = self.witness(self.size)
        if witness is None:
            return np.inf, None
        low, high = 0.0, self.size_of(witness)
        while high - low > precision * high and high > LEAST * self.size:
            middle = low + (high - low) * (0.9 if low == 0 else 0.5)
            found = self.witness(middle)
            if found is None:
                low = middle
            else:
                high, witness = min(self.size_of(found), middle), found
        return high, witness


def _worst(model: ModalModel, lower: Array, upper: Array) -> Optima:
    """The largest magnitudes of the model over a box, in units of the limits."""
    points, nodes = spread_points(lower, upper, 256), np.arange(len(model.time))
    found = best_of_pool(points, trajectories(model, points), nodes, 1)[0]
    top = found.take(np.argsort(-found.value)[:REFINED])
    refine(model, top, np.arange(len(top.value)), lower, upper, 1e-7)
    return top


def unproved(
    search: LimitSearch, size: float, pending: Array, budget: float, workers: int
) -> tuple[Array, Array | None, int]:
    """Problems that stay unproved in a box, a point beyond a limit, and boxes looked at."""
    lower, upper = search.unit(size)
    allowed = (1 - np.repeat(search.error.ravel(), 2))[pending]
    left, at, boxes = enclosed(search, lower, upper, pending, allowed, budget, workers)
    return left, at if search.exceeded(at) else None, boxes


def enclosed(
    search: LimitSearch,
    lower: Array,
    upper: Array,
    pending: Array,
    allowed: Array,
    budget: float,
    workers: int = 1,
) -> tuple[Array, Array, int]:
    """Problems whose side × output is not proved to stay at most at what is allowed.

    Args:
        search: The motion with its model.
        lower: Lower ends of a box in the model's coordinates, shape (d,).
        upper: Upper ends.
        pending: Numbers of N problems, (node · m + output) · 2 + (1 for upper bounds).
        allowed: What each may reach, shape (N,), in units of the limits.
        budget: Most boxes per problem on average.
        workers: Threads.

    Returns:
        Those problems, the parameters of the greatest value found, and boxes looked at.
    """
    model, gap = search.model, 0.1 * search.gap
    nodes = np.arange(len(model.time))
    optima = problems(nodes, len(model.outputs), len(lower)).take(pending)
    optima.point[:], optima.value[:] = (lower + upper) / 2, allowed - gap
    found = BranchAndBound(gap, budget).run(model, lower, upper, optima, workers=workers)
    at = model.boxes.to_physical(found.point[int(found.value.argmax())])
    return pending[found.proved > allowed + 1e-12], at, found.boxes
