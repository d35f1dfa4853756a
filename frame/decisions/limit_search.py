"""Search for motions beyond limits in growing boxes, and the proof that a box has none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product

import numpy as np

from alphacut.frame.boxes import Boxes, UnitFlow
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.low_discrepancy import chebyshev_points
from alphacut.frame.certificate.branch_and_bound import BranchAndBound
from alphacut.frame.checks.admissible import require_admissible
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.methods.modal import Modal, model_with_error
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.search import Optima, problems, refine, trajectories

REFINED = 64
"""Motions of a search that are driven to their local extreme."""

Reach = Callable[[float], tuple[Array, Array]]


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

    def fit(self, size: float) -> None:
        """Model of the motion over the box of a size, in units of the limits."""
        self.size = size
        lower, upper = self.reach(size)
        ends = np.stack([lower, self.nominal]), np.stack([upper, self.nominal])
        boxes = Boxes(self.flow.names, np.array([0.0, 1.0]), *ends, self.nominal)
        require_admissible(self.flow.system, boxes)
        unit = LimitFlow(self.flow, boxes, False, self.limits)
        model, error, self.reason = model_with_error(
            self.flow, unit, Modal(tolerance=self.gap), self.gap
        )
        self.model: ModalModel = model.in_units(self.limits)
        self.error: Array = error / self.limits

    def unit(self, size: float) -> tuple[Array, Array]:
        """Box of a size in the model's coordinates."""
        lower, upper = (self.model.boxes.to_unit(end) for end in self.reach(size))
        return lower, upper

    def share(self, point: Array) -> float:
        """Largest |output| / limit of the true motion at parameters (d,)."""
        return float((np.abs(self.flow.values(point[None])[0]) / self.limits).max())

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
            if self.share(point) > 1:
                return self._pulled(point)
        return None

    def _pulled(self, point: Array) -> Array:
        """The nearest point on the way to the nominal one that still breaks a limit."""
        safe, unsafe = 0.0, 1.0
        for _ in range(12):
            middle = (safe + unsafe) / 2
            beyond = self.share(self.nominal + middle * (point - self.nominal)) > 1
            safe, unsafe = (safe, middle) if beyond else (middle, unsafe)
        pulled: Array = self.nominal + unsafe * (point - self.nominal)
        return pulled

    def refuted(self, precision: float) -> tuple[float, Array | None]:
        """Least size found that is unsafe, and its witness; infinite without one."""
        witness = self.witness(self.size)
        if witness is None:
            return np.inf, None
        low, high = 0.0, self.size_of(witness)
        while high - low > precision * high:
            middle = low + (high - low) * (0.9 if low == 0 else 0.5)
            found = self.witness(middle)
            if found is None:
                low = middle
            else:
                high, witness = min(self.size_of(found), middle), found
        return high, witness


def _worst(model: ModalModel, lower: Array, upper: Array) -> Optima:
    """The largest magnitudes of the model over a box, in units of the limits."""
    d = len(lower)
    corners = np.array(list(product((-1.0, 1.0), repeat=d))) if d <= 8 else np.zeros((0, d))
    points = np.vstack([np.zeros((1, d)), corners, chebyshev_points(d, 256)])
    points = (lower + upper) / 2 + (upper - lower) / 2 * points
    values = trajectories(model, points)
    best = np.stack([values.argmin(0), values.argmax(0)], axis=-1)  # (T, m, 2)
    found = problems(np.arange(len(model.time)), len(model.outputs), d)
    found.point[:] = points[best.ravel()]
    found.value[:] = np.stack([-values.min(0), values.max(0)], axis=-1).ravel()
    top = found.take(np.argsort(-found.value)[:REFINED])
    refine(model, top, np.arange(len(top.value)), lower, upper, 1e-7)
    return top


def unproved(
    search: LimitSearch, size: float, pending: Array, budget: float, workers: int
) -> tuple[Array, Array | None, int]:
    """Problems that stay unproved in a box, a point beyond a limit, and boxes looked at."""
    lower, upper = search.unit(size)
    total, m, gap = len(search.model.time), len(search.model.outputs), 0.1 * search.gap
    allowed = 1 - np.repeat(search.error.reshape(total * m), 2)
    optima = problems(np.arange(total), m, len(lower)).take(pending)
    optima.point[:], optima.value[:] = (lower + upper) / 2, allowed[pending] - gap
    found = BranchAndBound(gap, budget).run(search.model, lower, upper, optima, workers=workers)
    left = pending[found.proved > allowed[pending] + 1e-12]
    point = search.model.boxes.to_physical(found.point[int(found.value.argmax())])
    return left, point if search.share(point) > 1 else None, found.boxes
