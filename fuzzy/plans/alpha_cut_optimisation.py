"""α-cut optimisation: every bound searched by a SciPy optimiser (appendix A, eq. 21)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.campaign.call import SpentError
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.plans.cut import Bound, CutSearch, attained_bounds, cuts_with_width
from alphacut.fuzzy.refused import checked_number
from alphacut.fuzzy.result import Bounds
from alphacut.fuzzy.sets.boxes import Domain

# least distance of two starts, as a share of the width of the cut: they should lie in different
# valleys
_START_DISTANCE = 0.25


@dataclass(frozen=True)
class Optimisation:
    """Search of each bound, from the narrowest cut up; every sample counts for all bounds.

    Corners and spread points are evaluated first, then descents by gradients begin at the best.
    Nothing tells what they miss, so the bounds are attained only; `Automatic` estimates an error.

    Args:
        starts: Descents per bound.
        look: Spread points evaluated first, per level and input.

    Raises:
        RefusedError: A number is not positive.

    Example:
        >>> from alphacut.fuzzy import Interval, propagate
        >>> inputs, method = {"x": Interval(0, 1)}, Optimisation()
        >>> bounds = propagate(lambda x: (x - 0.3) ** 2, inputs, method, alpha=[0])
        >>> bounds.lower.round(6).item(), bounds.upper.round(6).item()
        (0.0, 0.49)
    """

    starts: int = 3
    look: int = 8

    name = "optimisation"

    def __post_init__(self) -> None:
        for key in ("starts", "look"):
            checked_number(key, getattr(self, key), positive=True, whole=True)

    def run(self, campaign: Campaign, domain: Domain) -> Bounds:
        """Return the bounds of all outputs on all levels that the search attains in its budget."""
        outputs = campaign(domain.modal[None]).columns
        try:
            for cut in cuts_with_width(campaign, domain):
                self._search(cut, outputs)
                campaign.report(1 - cut.level / len(domain.alpha))
        except SpentError:
            return attained_bounds(campaign, domain, self.name, ended=True)
        return attained_bounds(campaign, domain, self.name, ended=False)

    def _search(self, cut: CutSearch, outputs: tuple[str, ...]) -> None:
        """Evaluate corners and spread points of a cut, and descend to the bounds of all outputs."""
        points = _spread(len(cut.uncertain_inputs), self.look, cut.level)
        allowed = np.concatenate([cut.corners, points[cut.slack(points) >= 0]])
        if len(allowed):
            cut.campaign(cut.points(allowed))
        for output, sign in product(outputs, (1.0, -1.0)):
            for start in _best_samples(cut, Bound(output, sign), self.starts):
                cut.descend(start, Bound(output, sign))


def _spread(inputs: int, look: int, level: int) -> Array:
    """Return `look` scrambled Halton points per input, shape (look · inputs, inputs), in [0, 1]."""
    from scipy.stats import qmc

    rng = np.random.default_rng([0, level])
    return np.asarray(qmc.Halton(inputs, rng=rng).random(look * inputs))


def _best_samples(cut: CutSearch, bound: Bound, count: int) -> Array:
    """Up to `count` of the best samples in the cut, the starts of descents.

    Any two of them differ by more than a quarter of the cut's width in an input.

    Returns:
        Unit coordinates, best first, shape (≤ count, uncertain inputs).
    """
    samples = cut.campaign.samples
    inside = cut.contains(samples.points)
    unit = cut.unit(samples.points[inside])
    values = bound.sign * samples.values.array[inside, samples.values.column(bound.output)]
    starts: list[Array] = []
    for row in np.argsort(values, kind="stable"):
        is_distant = all(np.abs(unit[row] - start).max() > _START_DISTANCE for start in starts)
        if is_distant and len(starts) < count:
            starts.append(unit[row])
    return np.array(starts)
