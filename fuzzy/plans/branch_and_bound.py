"""Guaranteed bounds by branch and bound on enclosures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from alphacut.fuzzy.knowledge.enclosure import Enclosed
from alphacut.fuzzy.knowledge.interval_arithmetic import Pair, negative
from alphacut.fuzzy.samples.model import Model, Values
from alphacut.fuzzy.samples.nature import Nature
from alphacut.fuzzy.samples.result import FuzzyResult
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.given import require_end, require_fields
from alphacut.fuzzy.sets.numbers import Array, Rows

_ROUND_OFF = 1 + 1e-12  # more than the round-off of the mean-value form
_AGREES = 1e-9  # of the values: by so much the model may differ from the function
_TOGETHER = 256  # boxes that are split at once


class _Boxes(NamedTuple):
    """Boxes (n, inputs) with the proved lower bound (n,) and its slopes (n, inputs)."""

    lower: Array
    upper: Array
    bound: Array
    effect: Array


@dataclass(frozen=True)
class BranchAndBound:
    """Proves bounds of a function that can be enclosed, from outside, to a stated gap.

    Args:
        function: The function itself, written in arithmetic and numpy's functions.
        tolerance: Gap between proved and attained bound at which the search ends, as a share of the
            range seen.
        budget: Boxes per bound at which it ends at the latest; the bound is proved all the same,
            but wider.

    Raises:
        ValueError: A number is not positive, or a sample of the model is not what the function
            says.
    """

    function: Callable[..., object]
    tolerance: float = 1e-4
    budget: int = 50_000

    def __post_init__(self) -> None:
        require_fields(self)
        require_end(self.tolerance, self.budget)

    stepwise = True  # samples depend on those before

    def run(self, model: Model, domain: Domain) -> FuzzyResult:
        """Prove both bounds of every output and level; the error is the gap to samples."""
        domain.require_free("BranchAndBound")
        tried = _tried(domain)
        first = model(tried)
        columns = first.columns
        function = Enclosed(self.function, domain.names)
        _require_the_model(function, domain, tried, first)
        proved, attained = (np.empty((len(domain.alpha), len(columns), 2)) for _ in range(2))
        places, runs = np.empty((*proved.shape, len(domain.names))), len(tried)
        ended = 0.0
        for level in reversed(range(len(domain.alpha))):
            for (column, name), (side, sign) in product(enumerate(columns), enumerate((1.0, -1.0))):
                search = _Search(
                    self, model, domain, function=function, level=level, output=name, sign=sign
                )
                search.run()
                here = level, column, side
                proved[here], attained[here] = sign * search.proved, sign * search.best
                places[here] = search.place
                runs += search.runs
                ended = max(ended, search.open)
            model.report(1 - level / len(domain.alpha))
        return FuzzyResult(
            domain=domain,
            outputs=columns,
            # what is proved of a cut holds in all cuts inside
            lower=np.maximum.accumulate(proved[..., 0]),
            upper=np.minimum.accumulate(proved[..., 1]),
            lower_at=places[:, :, 0],
            upper_at=places[:, :, 1],
            base=Nature.GUARANTEED,
            plan="branch and bound",
            runs=runs,
            error=np.abs(proved - attained).max(axis=2),
            proved=np.ones(proved.shape[:2], bool),
            enforced=np.zeros(proved.shape[:2], bool),
            given=(f"the enclosed function is the model, as at all {runs:,} samples",),
            notes=(self._ended(ended),) if ended > 0 else (),
        )

    def _ended(self, gap: float) -> str:
        """One sentence on bounds whose budget ended with a gap, a share of the range."""
        left = f"is {100 * gap:.3g} %" if np.isfinite(gap) else "is not finite"
        instead = f"instead of {100 * self.tolerance:.3g} % of the range"
        return f"ended at its budget of {self.budget} boxes: the gap {left} {instead}"


def _require_the_model(function: Enclosed, domain: Domain, tried: Array, first: Values) -> None:
    """Refuse a function that is not the model at the points tried.

    Raises:
        ValueError: An output is missing, or differs.
    """
    found = function(tried, tried)
    for name in first.columns:
        if name not in found:
            raise ValueError(
                f"the function of BranchAndBound has no output {name}, as the model has: give"
                " it the model itself"
            )
        values = first.select([name])[:, 0]
        require_agreement(found[name].value, values, name, domain.names, tried)


def _tried(domain: Domain) -> Array:
    """Samples that compare function and model first: modal, corners, middle, (4, inputs)."""
    lower, upper = (ends[0] for ends in domain.boxes)
    modal = domain.modal
    return np.stack([modal, lower, upper, (lower + upper) / 2])


def require_agreement(
    enclosed: Pair, values: Array, output: str, names: Sequence[str], points: Array
) -> None:
    """Refuse model values (n,) outside the function's enclosures at points (n, inputs).

    Raises:
        ValueError: One does not: what is proved of the function says nothing of the model.
    """
    slack = _AGREES * np.maximum(np.abs(values), np.abs(values).max())
    apart = np.flatnonzero((values < enclosed[0] - slack) | (values > enclosed[1] + slack))
    if len(apart):
        row = apart[0]
        place = ", ".join(f"{name} = {x:.6g}" for name, x in zip(names, points[row], strict=True))
        low, high = enclosed[0][row], enclosed[1][row]
        said = f"{low:.6g}" if high - low <= 2 * slack[row] else f"{low:.6g} … {high:.6g}"
        got = (
            f"the function of BranchAndBound gives output {output} = {said} where the model gives"
            f" {values[row]:.6g}, at {place}"
        )
        raise ValueError(f"{got}: it must be the model itself")


class _Search:
    """The least value of sign · output over one cut."""

    def __init__(
        self,
        plan: BranchAndBound,
        model: Model,
        domain: Domain,
        *,
        function: Enclosed,
        level: int,
        output: str,
        sign: float,
    ) -> None:
        self.plan, self.model, self.names, self.function = plan, model, domain.names, function
        self.output, self.sign, self.count = output, sign, 1
        self.best, self.worst, self.runs = np.inf, -np.inf, 0
        lower, upper = (ends[level : level + 1] for ends in domain.boxes)
        self.place: Array = lower[0]
        self.boxes = self._examined(lower, upper)

    @property
    def proved(self) -> float:
        """A proved lower bound of the least value."""
        return float(min(self.boxes.bound.min(initial=np.inf), self.best))

    @property
    def open(self) -> float:
        """Gap that the budget left, as a share of the range seen; 0 where it did not end it."""
        gap = (self.best - self.proved) / self._scale()
        return gap if gap > self.plan.tolerance and self.count >= self.plan.budget else 0.0

    def run(self) -> None:
        """Split the boxes of the lowest bounds until the gap is small enough."""
        while (
            self.best - self.proved > self.plan.tolerance * self._scale()
            and self.count < self.plan.budget
        ):
            order = np.argsort(self.boxes.bound)
            chosen, rest = order[:_TOGETHER], order[_TOGETHER:]
            children = self._examined(*self._halves(chosen))
            kept = rest[self.boxes.bound[rest] <= self.best]
            fresh = children.bound <= self.best
            if not (self.boxes.upper[chosen] > self.boxes.lower[chosen]).any():
                break
            parts = [
                np.concatenate([old[kept], new[fresh]])
                for old, new in zip(self.boxes, children, strict=True)
            ]
            self.boxes = _Boxes(*parts)
            self.count += len(children.bound)

    def _scale(self) -> float:
        """Range of the values seen; a share of the least one where there is none."""
        with np.errstate(over="ignore"):
            seen = np.subtract(self.worst, self.best)
        return float(max(seen, abs(self.best) * 1e-9, np.finfo(float).tiny))

    def _halves(self, chosen: Rows) -> tuple[Array, Array]:
        """Chosen boxes cut in two across the input that matters most."""
        lower, upper = self.boxes.lower[chosen], self.boxes.upper[chosen]
        across = self.boxes.effect[chosen].argmax(axis=1)[:, None]
        middle = np.take_along_axis((lower + upper) / 2, across, axis=1)
        left, right = upper.copy(), lower.copy()
        np.put_along_axis(left, across, middle, axis=1)
        np.put_along_axis(right, across, middle, axis=1)
        return np.concatenate([lower, right]), np.concatenate([left, upper])

    def _examined(self, lower: Array, upper: Array) -> _Boxes:
        """Boxes with bounds from the enclosure and the mean-value form; the model is run there."""
        middle, half = (lower + upper) / 2, (upper - lower).T / 2
        value, slope = self._enclosed(lower, upper)
        about = self._enclosed(middle, middle)[0][0]
        steep = np.maximum(np.abs(slope[0]), np.abs(slope[1]))
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows bounds nothing
            reach = (np.nan_to_num(steep * half, nan=np.inf) * _ROUND_OFF).sum(axis=0) * _ROUND_OFF
            effect = np.where(half > 0, np.minimum(steep, 1e300) * half + half * 1e-300, -1.0)
            mean_value = np.nextafter(about - reach, -np.inf)
        # monotone inputs go to their end
        low_end = np.where(slope[0].T >= 0, lower, np.where(slope[1].T <= 0, upper, middle))
        self._attain(low_end, value)
        return _Boxes(
            lower,
            upper,
            np.maximum(np.nan_to_num(value[0], nan=-np.inf, neginf=-np.inf), mean_value),
            effect.T,
        )

    def _enclosed(self, lower: Array, upper: Array) -> tuple[Pair, Pair]:
        """Values (n,) and slopes (inputs, n) of sign · output over boxes."""
        found = self.function(lower, upper)[self.output]
        return found if self.sign > 0 else (negative(found.value), negative(found.slope))

    def _attain(self, points: Array, enclosed: Pair) -> None:
        """Run the model, compare it with the enclosure, and remember the least value."""
        values = self.sign * self.model(points).select([self.output])[:, 0]
        seen = enclosed if self.sign > 0 else (-enclosed[1], -enclosed[0])
        require_agreement(seen, self.sign * values, self.output, self.names, points)
        self.runs += len(points)
        least = int(values.argmin())
        if values[least] < self.best:
            self.best, self.place = float(values[least]), points[least]
        self.worst = max(self.worst, float(values.max()))
