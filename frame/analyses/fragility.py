"""Fragility under a suite of records: of linear structures from proved peaks, of others by motions.

A linear structure that starts at rest and is moved by its record alone scales with it. So the
measure of a record at which a limit L is reached is c(p) = m L / peak(p), m the record's measure as
it is and p the inputs. Over an α-cut it ranges between m L over the greatest and m L over the least
peak, both of which are bounded from outside (proved) and from inside (reached). α is a level of
possibility, no probability, and is never multiplied with one. Of a frame that yields c(p) is a set.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import require
from alphacut.frame.analyses.peaks import Peak
from alphacut.frame.analyses.probability import CONFIDENCE, clopper_pearson
from alphacut.fuzzy.result import Ends


@dataclass(frozen=True, eq=False)
class CriticalMeasures:
    """Measures of R records at which a limit is reached, as intervals on A levels.

    Args:
        low: No structure of the cut exceeds the limit below it, shape (R, A).
        low_reached: A structure of the cut is known to exceed it above, shape (R, A).
        high_reached: A structure of the cut is known not to exceed it up to here, shape (R, A).
        high: Every structure of the cut exceeds it above; infinite where no peak is known to be
            larger than zero, shape (R, A).
        sets: Of motions, the measures (X,) under each record, rising, and whether some structure,
            and all structures found, exceed the limit there, shape (2, A, X).
    """

    low: Array
    low_reached: Array
    high_reached: Array
    high: Array
    sets: Sequence[tuple[Array, Mask]] = ()

    def __post_init__(self) -> None:
        """Refuse measures that are not positive, or reached outside their bounds."""
        is_valid, rounding = bool((self.low > 0).all()), 1 + 1e-9
        for reached in (self.low_reached, self.high_reached):
            is_inside = (self.low <= reached * rounding) & (reached <= self.high * rounding)
            is_valid &= bool(is_inside.all())
        require(is_valid, "critical measures", value="not rising", allowed="rising ends")

    @classmethod
    def from_peaks(
        cls, peaks: Sequence[Peak], measures: Sequence[float], limit: float
    ) -> CriticalMeasures:
        """Return the critical measures of R records at a limit of a magnitude, in its SI unit.

        `peaks` of the limited output, on A levels, and `measures` are of each record as it is.
        """
        ends = [(*x.greatest_bounds[::-1], *x.least_bounds[::-1]) for x in peaks]
        falling = np.maximum(np.swapaxes([np.broadcast_arrays(*x) for x in ends], 0, 1), 0.0)
        with np.errstate(divide="ignore"):
            measure_ends = np.asarray(measures)[:, None] * limit / falling  # (4, R, A)
        low, low_reached, high_reached, high = measure_ends
        low_reached = np.minimum(low_reached, high)  # no greatest peak is below the least one
        # the structure that reaches the greatest peak known is one of the cut
        return cls(low, low_reached, np.maximum(high_reached, low_reached), high)

    @classmethod
    def from_demands(cls, records: Sequence[tuple[Array, Array]]) -> CriticalMeasures:
        """Return the critical measures of R records by measures tried (X,) and demands (2, A, X).

        These are the greatest and the least peak over limit of the structures found, nan where they
        collapse; at the first measure all keep the limit. The first crossing lies between `low` and
        `low_reached`, the last non-exceedance between `high_reached` and `high`; those that lie
        beyond the largest measure are infinite.
        """
        sets = [(tried, ~(demands <= 1)) for tried, demands in records]
        ends = []
        for tried, (by_some, by_all) in sets:
            or_infinite, last = np.append(tried, np.inf), len(tried) - 1
            crossing = np.where(by_some.any(1), by_some.argmax(1), len(tried))
            after = len(tried) - (~by_all)[:, ::-1].argmax(1)
            high_reached = np.where(after > last, np.inf, tried[after - 1])
            ends.append(
                [tried[crossing - 1], or_infinite[crossing], high_reached, or_infinite[after]]
            )
        low, low_reached, high_reached, high = np.moveaxis(np.array(ends), 1, 0)
        return cls(low, low_reached, high_reached, high, sets)

    def band(self, measure: Array) -> Ends:
        """Return bounds of the fraction of the records under which a structure exceeds the limit.

        They hold for every structure within the α-cut, shape (A, X) each, for measures (X,).
        """
        return Ends(*(count / len(self.low) for count in self.counts(measure)))

    def confidence_band(self, measure: Array) -> Ends:
        """Return 95 % limits of the probability of exceedance if records are independent draws.

        They are of shape (A, X) each, for measures (X,) (Clopper, Pearson 1934).
        """
        return clopper_pearson(*self.counts(measure), len(self.low), (1 - CONFIDENCE) / 2)

    def counts(self, measure: Array) -> Ends:
        """Return numbers (A, X) of records that exceed for all structures of a cut and for some.

        Between two measures tried all do if all do at both, and some do if some do at either.
        """
        if not self.sets:
            return Ends(
                *((x[:, :, None] < np.asarray(measure)).sum(0) for x in (self.high, self.low))
            )
        count_all, count_some = np.zeros((2, len(self.low[0]), len(measure)))
        for tried, (by_some, by_all) in self.sets:
            after = np.searchsorted(tried, measure)
            before, after = np.maximum(after - 1, 0), np.minimum(after, len(tried) - 1)
            count_all += by_all[:, before] & by_all[:, after]
            count_some += by_some[:, before] | by_some[:, after]
        return Ends(count_all, count_some)

    @property
    def median(self) -> Ends:
        """Bounds of the median of the lognormal fit, exp of the mean logarithm, shape (A,) each."""
        return Ends(*(np.exp(np.log(end).mean(0)) for end in (self.low, self.high)))

    @property
    def dispersion(self) -> Ends:
        """Bounds of the standard deviation of the logarithms, shape (A,) each.

        Raises:
            RefusedError: There is one record.
        """
        # it is within ‖h‖ / √(R − 1) of that of the middles of the intervals, h their half widths:
        # subtracting the mean does not lengthen a vector
        require(len(self.low) > 1, "records", value=len(self.low), allowed="two records or more")
        low, high = np.log(self.low), np.log(self.high)
        finite = np.isfinite(high).all(0)
        middle = np.where(finite, (low + high) / 2, low)
        reach = np.linalg.norm((high - low) / 2, axis=0) / np.sqrt(len(low) - 1)
        spread = middle.std(0, ddof=1)
        return Ends(np.where(finite, np.maximum(spread - reach, 0.0), 0.0), spread + reach)


def of_any_limit(limits: Sequence[CriticalMeasures]) -> CriticalMeasures:
    """Return the critical measures of the event that any of several limits is exceeded."""
    # high measures of single limits may belong to different structures: none is known to be reached
    ends = ("low", "low_reached", "high")
    low, reached, high = (np.min([getattr(x, end) for x in limits], axis=0) for end in ends)
    return CriticalMeasures(low, reached, reached, np.maximum(high, reached))
