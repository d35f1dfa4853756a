"""The method that is taken where none is named: a search, and a pass that is independent of it.

The search descends in every cut from the best of spread points (α-cut optimisation). The pass then
looks at fresh points and descends from the best of these alone. Where most of its descents end on
the bound that the search had, the bounds are estimated: their error is twice what the pass improved
and what its ends lack. Where they end elsewhere, or where a bound lies at a kink or a jump, nothing
is known of the error, and the bounds are attained only. A spike that is narrower than the distance
of the samples is seen by neither.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.campaign.call import SpentError
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.plans.alpha_cut_optimisation import LevelSearch, Optimisation, attained, cuts
from alphacut.fuzzy.plans.transformation import Reduced, corners_suffice
from alphacut.fuzzy.refused import real
from alphacut.fuzzy.result import Bounds, Nature
from alphacut.fuzzy.sets.boxes import Domain

_STARTS = 2  # descents per bound of the search
_LOOK = 6  # fresh points of a look per level and input
_TOLERANCE = 1e-3  # of an output's range: how near descents agree; less found by a pass is nothing
_MOST = 12  # outputs of which each bound is searched
_SAFETY = 2  # the next pass may find more than the last one
_ROUNDS = 12  # of a descent
_AGREEING = 0.5  # least share of fresh descents that must end on the bound
_SLOPE = 0.01  # of an output's range over the width of a cut: less is that of a smooth optimum
_ROUNDING = 1e-9  # of an output's size


@dataclass(frozen=True)
class Automatic:
    """Corners where what is known of the model makes them suffice; a search elsewhere.

    Of more than 12 outputs none is searched: their bounds are as the samples happen to be.

    Args:
        passes: Passes at most; the last that finds nothing new ends them.

    Raises:
        RefusedError: There is no pass.
    """

    passes: int = 4

    name = "automatic"

    def __post_init__(self) -> None:
        real("passes", self.passes, positive=True, whole=True)

    def run(self, campaign: Campaign, domain: Domain) -> Bounds:
        """Bounds of every output."""
        outputs = campaign(domain.modal[None]).columns
        monotone = campaign.known.monotone_in(domain.names, outputs)
        if not domain.interactions and corners_suffice(domain, monotone).all():
            return replace(Reduced().run(campaign, domain), method=self.name)
        outputs = outputs if len(outputs) <= _MOST else ()
        spent = Optimisation(_STARTS, _LOOK).search(campaign, domain, outputs)
        check = _Passes(campaign, domain, outputs)
        spent = spent or check.run(self.passes)
        return check.judged(spent=spent)


@dataclass
class _Passes:
    """Passes that are independent of the search.

    Args:
        campaign: The model with the samples of the search.
        domain: Inputs and levels.
        outputs: Outputs whose bounds were searched.

    Attributes:
        gain: What the last pass improved, shape (levels, columns).
        ends: Where fresh descents ended: level and value by output and sign of the bound.
    """

    campaign: Campaign
    domain: Domain
    outputs: tuple[str, ...]
    gain: Array = field(default_factory=lambda: np.zeros(()))
    ends: dict[tuple[str, float], list[tuple[int, float]]] = field(default_factory=dict)

    def run(self, passes: int) -> bool:
        """Pass until one finds nothing new; whether the budget ended that."""
        before = self._bounds()
        for turn in range(passes):
            spent = self._pass(turn + 1)
            after = self._bounds()
            self.gain = np.maximum(before.lower - after.lower, after.upper - before.upper)
            before = after
            if spent or (self.gain <= _TOLERANCE * self._span()).all():
                return spent
        return False

    def _pass(self, seed: int) -> bool:
        """Look and descend in every cut; whether the budget ended that."""
        try:
            for cut in cuts(self.campaign, self.domain):
                fresh = cut.look(_LOOK * len(cut.moving), seed)
                for output, sign in product(self.outputs if len(fresh) else (), (1.0, -1.0)):
                    end = self._end(cut, fresh, output, sign)
                    self.ends.setdefault((output, sign), []).append((cut.level, end))
        except SpentError:
            return True
        return False

    def _end(self, cut: LevelSearch, fresh: Array, output: str, sign: float) -> float:
        """Value where a descent from the best of fresh points ends.

        Hills at corners lead to one another along the edges.
        """
        start = fresh[cut.worth(fresh, output, sign).argmin()]
        end = cut.along(cut.descend(start, output, sign, _ROUNDS), output, sign, _ROUNDS)
        return float(sign * cut.worth(end[None], output, sign)[0])

    def judged(self, *, spent: bool) -> Bounds:
        """Bounds with their error where most fresh descents agree with them, else attained."""
        bounds, near = self._bounds(), _TOLERANCE * self._span()
        missed = [self._missed(bounds, column, near[column]) for column in range(len(near))]
        agrees = np.array([own is not None for own in missed]) & (self.gain <= near).all(axis=0)
        agrees[agrees] = [self._smooth(bounds, column) for column in np.flatnonzero(agrees)]
        sure = agrees & ~spent
        size = np.maximum(np.abs(bounds.lower), np.abs(bounds.upper)).max(axis=0)
        ends = np.stack([np.zeros(len(self.domain.alpha)) if x is None else x for x in missed], 1)
        error = _SAFETY * np.maximum(self.gain, ends) + _ROUNDING * size
        lower, upper = self.domain.boxes
        crisp = (lower == upper).all(axis=1)[:, None]
        natures = tuple(Nature.ESTIMATED if own else Nature.ATTAINED for own in sure)
        unsure = [name for name in self.outputs if not agrees[bounds.column(name)]]
        note = f"a better bound of {', '.join(unsure[:4])} is likely: an independent search ended"
        note += " elsewhere, or the bound lies at a kink or a jump"
        last = attained(self.campaign, self.domain, Automatic.name, spent=spent)
        return replace(
            last,  # the judgement took samples, too
            error=np.where(sure & ~crisp, error, 0.0),
            natures=natures,
            nature=Nature.weakest(natures),
            notes=(*last.notes, note) if unsure and not spent else last.notes,
        )

    def _missed(self, bounds: Bounds, column: int, near: float) -> Array | None:
        """Distance of agreeing fresh descents to the bounds, (levels,); None where few agree."""
        missed, agreeing, count = np.zeros(len(self.domain.alpha)), 0, 0
        for sign, bound in ((1.0, bounds.lower), (-1.0, bounds.upper)):
            for level, end in self.ends.get((bounds.outputs[column], sign), []):
                lack = sign * (end - bound[level, column])
                count += 1
                agreeing += bool(lack <= near)
                missed[level] = max(missed[level], lack if lack <= near else 0.0)
        return missed if count and agreeing >= _AGREEING * count else None

    def _smooth(self, bounds: Bounds, column: int) -> bool:
        """True if an output has nearly no slope where its bounds are attained inside a cut."""
        try:
            return all(
                cut.steepest(cut.unit(places[cut.level, column][None])[0], bounds.outputs[column])
                <= _SLOPE
                for cut in cuts(self.campaign, self.domain)
                for places in (bounds.lower_at, bounds.upper_at)
            )
        except SpentError:
            return False

    def _bounds(self) -> Bounds:
        """Bounds so far."""
        return attained(self.campaign, self.domain, Automatic.name, spent=False)

    def _span(self) -> Array:
        """Range of each output over all samples, shape (columns,)."""
        values = self.campaign.samples.values.array
        return np.asarray(np.nanmax(values, axis=0) - np.nanmin(values, axis=0))
