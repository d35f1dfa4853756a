"""Second looks at every cut, which judge the bounds that a surface or earlier looks found."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from alphacut.fuzzy.knowledge.known import Known
from alphacut.fuzzy.plans.alpha_cut_optimisation import LevelSearch
from alphacut.fuzzy.samples.design import Design
from alphacut.fuzzy.samples.model import Memo, Model, Values
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.numbers import Array

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
