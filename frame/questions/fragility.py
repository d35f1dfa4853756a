"""Fragility of a linear structure under a suite of records, with intervals from proved peaks.

A linear structure that starts at rest and is moved by its record alone scales with it. So the
measure of a record at which a limit L is reached is c(p) = m L / peak(p), m the record's measure as
it is and p the inputs. Over an α-cut it ranges between m L over the greatest and m L over the least
peak, both of which are bounded from outside (proved) and from inside (reached). α is a level of
possibility, no probability, and is never multiplied with one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from alphacut.frame.questions.peaks import Peak
from alphacut.frame.questions.probability import CONFIDENCE, clopper_pearson
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import require
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

    """

    low: Array
    low_reached: Array
    high_reached: Array
    high: Array

    def __post_init__(self) -> None:
        """Refuse measures that are not positive or not in rising order."""
        ends = pairwise((self.low, self.low_reached, self.high_reached, self.high))
        is_valid = (self.low > 0).all() and all((a <= b * (1 + 1e-9)).all() for a, b in ends)
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
        # the structure that reaches the greatest peak known is one of the cut
        return cls(low, low_reached, np.maximum(high_reached, low_reached), high)

    def band(self, measure: Array) -> Ends:
        """Return bounds of the fraction of the records under which a structure exceeds the limit.

        They hold for every structure within the α-cut, shape (A, X) each, for measures (X,).
        """
        return Ends(*(_counts(end, measure) / len(self.low) for end in (self.high, self.low)))

    def confidence_band(self, measure: Array) -> Ends:
        """Return 95 % limits of the probability of exceedance if records are independent draws.

        They are of shape (A, X) each, for measures (X,) (Clopper, Pearson 1934).
        """
        # numbers of records that exceed for all structures of the cut, and for some
        counts = _counts(self.high, measure), _counts(self.low, measure)
        return clopper_pearson(*counts, len(self.low), (1 - CONFIDENCE) / 2)

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


def _counts(critical: Array, measure: Array) -> Array:
    """Return numbers (A, X) of records with critical measures (R, A) below measures (X,)."""
    return np.asarray((critical[:, :, None] < np.asarray(measure)).sum(0))
