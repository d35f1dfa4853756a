"""The plan that is taken where none is named: a search for extremes inside, and a second look."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from alphacut.fuzzy.plans.alpha_cut_optimisation import LevelSearch
from alphacut.fuzzy.plans.monotonicity import primary
from alphacut.fuzzy.plans.sparse_chebyshev import Chebyshev
from alphacut.fuzzy.plans.transformation import Reduced, corners_suffice
from alphacut.fuzzy.samples.design import Design
from alphacut.fuzzy.samples.model import Memo, Model
from alphacut.fuzzy.samples.result import FuzzyResult
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.numbers import Array

_SEARCHED = 12  # outputs up to which each bound of each is searched and confirmed
_SAFETY = 2  # what a next look finds may be more than what the last one found


@dataclass(frozen=True)
class Automatic:
    """Interpolates the model, runs it at the surface's extremes, and looks a second time.

    Where the facts known of the model make corners suffice, these alone are run. Elsewhere every
    cut is looked at with fresh points, from the best of which the model itself is descended, until
    such a look finds nothing new. Bounds are attained by samples (inner); their error is what the
    last look found, doubled, or the surface's, whichever is larger. Only a proof sees a spike that
    is narrower than the distance of the samples.

    Args:
        tolerance: Share of an output's range that a look must not find more than.
        budget: Samples at which the surface ends at the latest.
        look: Fresh points per level, input and look.
        looks: Looks at most.
        seed: Where the fresh points start from.
        outputs: Outputs whose bounds matter; all if none is named.

    Raises:
        ValueError: A number is not positive.
    """

    tolerance: float = 1e-3
    budget: int = 400
    look: int = 6
    looks: int = 4
    seed: int = 0
    outputs: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not (self.tolerance > 0 and min(self.budget, self.look, self.looks) >= 1):
            raise ValueError(
                f"tolerance, budget, look and looks are {self.tolerance:g}, {self.budget},"
                f" {self.look} and {self.looks}; all must be positive"
            )

    @property
    def stepwise(self) -> bool:
        """Samples depend on those before."""
        return True

    def run(self, model: Model, domain: Domain) -> FuzzyResult:
        """Bounds of every output, with one line on how they were verified."""
        memo = Memo(model)
        columns = memo(domain.modal[None]).columns
        if not domain.interactions and _proved(memo, domain):
            return Reduced().run(memo, domain)
        names = self.outputs or primary(columns, model.known)
        few = len(names) <= _SEARCHED
        surface = Chebyshev(self.tolerance, self.budget, confirm=few, outputs=names)
        found = surface.run(memo, domain)
        spent = len(memo)
        left = self._looked(memo, domain, names if few else ())
        result = Design.from_samples(domain, memo.points).bounds(memo.values, plan="automatic")
        chosen = [result.column(name) for name in names]
        if not few:
            result = _further(result, found)
        error = np.maximum(found.error, _SAFETY * left)
        return replace(
            result,
            runs=spent,
            verification_runs=len(memo) - spent,
            error=error,
            notes=(*found.notes, self._told(result, error, chosen, searched=few)),
        )

    def _looked(self, memo: Memo, domain: Domain, names: tuple[str, ...]) -> Array:
        """Gain of the last look at all cuts, which finds nothing new, shape (levels, columns)."""
        before = _bounds(memo, domain)
        gain: Array = np.zeros(before.shape[1:])
        for turn in range(self.looks):
            for level in reversed(range(len(domain.alpha))):
                cut = LevelSearch(memo, domain, level)
                if not len(cut.moving):
                    continue
                cut.look(self.look, self.seed + turn + 1)
                for name in names:
                    for sign in (1.0, -1.0):
                        for start in cut.best(name, sign, 2):
                            cut.descend(start, name, sign, rounds=12)
            after = _bounds(memo, domain)
            gain = np.abs(after - before).max(axis=0)
            before = after
            if (gain <= self.tolerance * np.ptp(memo.values.array, axis=0)).all():
                break
        return gain

    def _told(self, result: FuzzyResult, error: Array, chosen: list[int], *, searched: bool) -> str:
        """One sentence on what was verified."""
        width = (result.upper - result.lower)[0, chosen]
        share = float((error[:, chosen] / np.where(width > 0, width, np.inf)).max(initial=0.0))
        how = "and descents from the best of them " if searched else ""
        grade = "" if share <= 10 * self.tolerance else "; take a larger budget or another plan"
        return (
            f"searched for extremes inside: fresh points in every cut {how}leave an error of"
            f" {share:.1g} of the width{grade}; a spike between samples would not be seen"
        )


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


def _bounds(memo: Memo, domain: Domain) -> Array:
    """Least and greatest value of every cut so far, shape (2, levels, columns)."""
    found = Design.from_samples(domain, memo.points).bounds(memo.values, plan="")
    return np.array([found.lower, found.upper])


def _proved(memo: Memo, domain: Domain) -> bool:
    """Whether what is known of the model makes the corners of each cut hold its extremes."""
    none = Design.from_levels(domain, [memo.points] * len(domain.alpha)).bounds(
        memo.values, plan=""
    )
    return bool(corners_suffice(none, memo.known).all())
