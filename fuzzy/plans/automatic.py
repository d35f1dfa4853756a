"""The plan that is taken where none is named: a search for extremes inside, and a second look."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from alphacut.fuzzy.counted import counted
from alphacut.fuzzy.knowledge.known import Known
from alphacut.fuzzy.plans.alpha_cut_optimisation import LevelSearch
from alphacut.fuzzy.plans.monotonicity import primary
from alphacut.fuzzy.plans.sparse_chebyshev import Chebyshev
from alphacut.fuzzy.plans.sparse_grid import SparseGrid
from alphacut.fuzzy.plans.transformation import Reduced, corners_suffice
from alphacut.fuzzy.samples.design import Design
from alphacut.fuzzy.samples.model import Memo, Model, Values
from alphacut.fuzzy.samples.result import FuzzyResult
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.given import require_fields
from alphacut.fuzzy.sets.numbers import Array

_SEARCHED = 12  # outputs up to which each bound of each is searched and confirmed
_UNKNOWN = 0.5  # error over width from which the answer tells nothing
UNKNOWN = (
    "; the error is as wide as the answer itself: take it as unknown; BranchAndBound(function)"
    " proves bounds of plain NumPy functions"
)
_SURFACE = 400  # samples at which the surface ends where no budget is named


@dataclass(frozen=True)
class Automatic:
    """Interpolates the model, runs it at the surface's extremes, and looks a second time.

    Where the facts known of the model make corners suffice, these alone are run. Elsewhere every
    cut is looked at with fresh points, from the best of which the model itself is descended, until
    such a look finds nothing new. Bounds are attained by samples (inner); their error is what the
    last look found, doubled, or the surface's, whichever is larger. Where most descents from fresh
    points end on hills of their own a better hill is likely: the error is then at least twice the
    step from the best hill to the next. Only a proof sees a spike that is narrower than the
    distance of the samples.

    Args:
        tolerance: Share of an output's range that a look must not find more than.
        budget: Samples altogether, of which the surface takes half. Where none is named, the
            surface takes 400 at most and the looks what they need.
        look: Fresh points per level, input and look.
        looks: Looks at most.
        seed: Where the fresh points start from.
        outputs: Outputs whose bounds matter; all if none is named. The others are printed as the
            samples happen to bound them, without an error.

    Raises:
        ValueError: A number is not positive, or the budget does not carry the first surface.
    """

    tolerance: float = 1e-3
    budget: int | None = None
    look: int = 6
    looks: int = 4
    seed: int = 0
    outputs: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        require_fields(self)
        if not (
            0 < self.tolerance < 1
            and min(self.look, self.looks, 1 if self.budget is None else self.budget) >= 1
        ):
            budget = "" if self.budget is None else f", budget {self.budget}"
            raise ValueError(
                f"tolerance {self.tolerance:g}, look {self.look}, looks {self.looks}{budget}: all"
                " must be positive, and the tolerance, a share of the range, below 1; samples are"
                " bounded by budget="
            )

    stepwise = True  # samples depend on those before

    def run(self, model: Model, domain: Domain) -> FuzzyResult:
        """Bounds of every output, with one line on how they were verified."""
        purse = Purse(model, np.inf if self.budget is None else self.budget)
        memo = Memo(purse)
        columns = memo(domain.modal[None]).columns
        if not domain.interactions and _proved(memo, domain):
            purse.left = np.inf
            return Reduced().run(memo, domain)
        names = self.outputs or primary(columns, model.known)
        few = len(names) <= _SEARCHED
        found = self._surface(memo, purse, domain, names if few else ())
        spent = len(memo)
        looks = Looks(memo, domain, names if few else (), self.tolerance)
        looks.run(self.looks, self.look, self.seed)
        result = Design.from_samples(domain, memo.points).bounds(memo.values, plan="automatic")
        chosen = [result.column(name) for name in names]
        if not few:
            result = _further(result, found)
        aside = np.isin(result.outputs, found.unsearched)
        error = np.maximum(found.error, np.where(aside, 0.0, looks.error))
        return replace(
            result,
            runs=spent,
            verification_runs=len(memo) - spent,
            error=error,
            unsearched=found.unsearched,
            notes=(*found.notes, self._told(result, error[:, chosen], chosen, looks)),
        )

    def _surface(
        self, memo: Memo, purse: Purse, domain: Domain, names: tuple[str, ...]
    ) -> FuzzyResult:
        """Bounds by the surface; a named budget is halved until it carries the last step too."""
        extremes = 2 * len(domain.alpha) * len(names)
        budget = self.budget or 2 * _SURFACE
        first = SparseGrid.first(len(domain.names))
        if budget < first + extremes:
            raise ValueError(
                f"budget is {budget}; {len(names) or 'many'} outputs at {len(domain.alpha)} levels"
                f" take {first + extremes} samples at least: raise it, or take fewer levels"
            )
        purse.left -= extremes
        share = max(budget // 2, first)
        while not self._carried(memo, domain, share):
            share = max(share // 2, first)
        purse.left += extremes
        surface = Chebyshev(self.tolerance, share, confirm=bool(names), outputs=self.outputs)
        return surface.run(memo, domain)

    def _carried(self, memo: Memo, domain: Domain, share: int) -> bool:
        """Whether the budget carries a surface of so many samples, whose last step passes them."""
        try:
            SparseGrid(memo, *(ends[0] for ends in domain.boxes)).refine(self.tolerance, share)
        except SpentError:
            return False
        return True

    def _told(self, result: FuzzyResult, error: Array, chosen: list[int], looks: Looks) -> str:
        """One sentence on what was verified."""
        width = (result.upper - result.lower)[0, chosen]
        share = float((error / np.where(width > 0, width, np.inf)).max(initial=0.0))
        how = " and descents from the best of them" if looks.names else ""
        grade = "" if share <= 10 * self.tolerance else "; take a larger budget or another plan"
        grade = grade if share < _UNKNOWN else UNKNOWN
        many = (
            "; most descents end on hills of their own, so a better one is likely"
            if looks.hills.any()
            else ""
        )
        ended = (
            f"; the budget of {self.budget} samples ended the search"
            + (f" after {counted(looks.done, 'round')}" if looks.done else " in its first round")
            + ", a larger one may find more"
            if looks.spent
            else ""
        )
        return (
            f"searched for extremes inside by fresh points in every cut{how}: the error is"
            f" estimated at {_per_cent(share)} of the width{ended}{many}{grade}; a spike between"
            " samples would not be seen"
        )


def _per_cent(share: float) -> str:
    """A share in per cent, one digit that counts, without powers of ten; 0 below 0.0001 %."""
    return f"{float(f'{100 * share:.1g}'):.4f}".rstrip("0").rstrip(".") + " %"


def _further(samples: FuzzyResult, surface: FuzzyResult) -> FuzzyResult:
    """The wider of two bounds each; estimated where the surface sees further."""
    low, high = surface.lower < samples.lower, surface.upper > samples.upper
    return replace(
        samples,
        lower=np.where(low, surface.lower, samples.lower),
        upper=np.where(high, surface.upper, samples.upper),
        lower_at=np.where(low[..., None], surface.lower_at, samples.lower_at),
        upper_at=np.where(high[..., None], surface.upper_at, samples.upper_at),
        base=surface.base if (low | high).any() else samples.base,
    )


def _proved(memo: Memo, domain: Domain) -> bool:
    """Whether what is known of the model makes the corners of each cut hold its extremes."""
    none = Design.from_levels(domain, [memo.points] * len(domain.alpha)).bounds(
        memo.values, plan=""
    )
    return bool(corners_suffice(none, memo.known).all())


_SAFETY = 2  # what a next look finds may be more than what the last one found
_ROUNDS = 12  # of a descent
_MISSED = 0.5  # share of fresh descents off the best hill from which a better hill is likely


class SpentError(Exception):
    """The next samples would pass the budget."""


@dataclass
class Purse:
    """A model that counts its samples, and refuses those that would pass the budget.

    Args:
        model: The model.
        left: Samples that it may still run.
    """

    model: Model
    left: float

    @property
    def known(self) -> Known:
        """Facts that the caller knows about the model."""
        return self.model.known

    def __call__(self, points: Array) -> Values:
        """Outputs at the points, shape (n, inputs).

        Raises:
            SpentError: They are more than are left; none is run.
        """
        if len(points) > self.left:
            raise SpentError
        self.left -= len(points)
        return self.model(points)

    def report(self, share: float, *, last: bool = False) -> None:
        """Tell the share done, 0 … 1."""
        self.model.report(share, last=last)


class Looks:
    """Fresh points in every cut, and descents from the best old and new ones.

    Args:
        memo: The model with its samples so far, those of a surface for instance.
        domain: Inputs and levels.
        names: Outputs whose bounds are searched.
        tolerance: Share of an output's range that a look must not find more than.

    Attributes:
        gain: What the last look added to any bound, shape (columns,).
        hills: Step from a bound to the next best hill where most fresh descents ended on hills of
            their own, shape (columns,).
        done: Looks that were finished.
        spent: Whether the budget ended them.
    """

    def __init__(
        self, memo: Memo, domain: Domain, names: tuple[str, ...], tolerance: float
    ) -> None:
        self.memo, self.domain, self.names, self.tolerance = memo, domain, names, tolerance
        self.gain, self.hills = np.zeros((2, len(memo.values.columns)))
        self.done, self.spent = 0, False
        self._ends: dict[tuple[str, float, int], list[float]] = {}

    @property
    def error(self) -> Array:
        """What the bounds may lack, shape (columns,)."""
        return _SAFETY * np.maximum(self.gain, self.hills)

    def run(self, looks: int, per_input: int, seed: int) -> None:
        """Look until a look finds nothing new, or the budget ends."""
        before = self._bounds()
        try:
            for turn in range(looks):
                for cut in self._cuts():
                    self._look(cut, per_input, seed + turn + 1, lines=turn == 0)
                self.gain = np.abs(self._bounds() - before).max(axis=(0, 1))
                before, self.done = self._bounds(), turn + 1
                self.hills = self._hills(before)
                if (self.error <= _SAFETY * self.tolerance * self._span()).all():
                    break
        except SpentError:
            self.spent = True
            now = self._bounds()
            self.gain = np.maximum(self.gain, np.abs(now - before).max(axis=(0, 1)))
            self.hills = self._hills(now)

    def _look(self, cut: LevelSearch, per_input: int, seed: int, *, lines: bool) -> None:
        fresh = cut.look(per_input, seed)
        for name in self.names:
            for sign in (1.0, -1.0):
                best = cut.descend(cut.best(name, sign, 1)[0], name, sign, _ROUNDS)
                if lines:
                    cut.along(best, name, sign, _ROUNDS)
                if len(fresh):
                    start = fresh[cut.worth(fresh, name, sign).argmin()]
                    end = self._end(cut, start, name, sign)
                    self._ends.setdefault((name, sign, cut.level), []).append(end)

    def _end(self, cut: LevelSearch, start: Array, name: str, sign: float) -> float:
        """Worth of the hill that a descent ends on; hills at corners lead to one another."""
        end, best = cut.descend(start, name, sign, _ROUNDS), cut.best(name, sign, 1)[0]
        worth, least = cut.worth(np.stack([end, best]), name, sign)
        near = self.tolerance * self._span()[self.memo.values.column(name)]
        if worth > least + near and np.isin(best, (0.0, 1.0)).all():
            worth = cut.worth(cut.along(end, name, sign, _ROUNDS)[None], name, sign)[0]
        return float(worth)

    def _hills(self, bounds: Array) -> Array:
        """Step to the next best hill, where most descents from fresh points missed the best."""
        span, step = self._span(), np.zeros(len(self.hills))
        for name, sign in product(self.names, (1.0, -1.0)):
            column = self.memo.values.column(name)
            off = [
                np.array(ends) - sign * bounds[0 if sign > 0 else 1, level, column]
                for (*own, level), ends in self._ends.items()
                if own == [name, sign]
            ]
            far = [one[one > self.tolerance * span[column]] for one in off]
            if sum(map(len, far)) > _MISSED * sum(map(len, off)):
                steps = (one.min() for one in far if len(one))
                step[column] = max(step[column], *steps)
        return step

    def _bounds(self) -> Array:
        """Least and greatest value of every cut so far, shape (2, levels, columns)."""
        found = Design.from_samples(self.domain, self.memo.points).bounds(self.memo.values, plan="")
        return np.array([found.lower, found.upper])

    def _span(self) -> Array:
        return np.asarray(np.ptp(self.memo.values.array, axis=0))

    def _cuts(self) -> Iterator[LevelSearch]:
        """Cuts that have a width, from the narrowest on."""
        for level in reversed(range(len(self.domain.alpha))):
            cut = LevelSearch(self.memo, self.domain, level)
            if len(cut.moving):
                yield cut
