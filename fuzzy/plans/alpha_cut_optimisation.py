"""α-cut optimisation: every bound searched by a SciPy optimiser (appendix A, eq. 21)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.campaign.values import SpentError
from alphacut.fuzzy.plans.design import of_samples
from alphacut.fuzzy.plans.level_search import cuts
from alphacut.fuzzy.refused import chosen, real
from alphacut.fuzzy.result import Bounds
from alphacut.fuzzy.sets.boxes import Domain


@dataclass(frozen=True)
class Optimisation:
    """Search of each bound, from the narrowest cut up; every sample counts for all bounds.

    Corners and spread points are looked at first, then descents by gradients begin at the best.

    Args:
        starts: Descents per bound.
        look: Spread points of the first look per level and input.
        seed: Where random searches start from.
        outputs: Outputs whose bounds are searched; all if none is named. The others are as the
            samples happen to bound them.

    Raises:
        RefusedError: A number is not positive.
    """

    starts: int = 3
    look: int = 8
    seed: int = 0
    outputs: tuple[str, ...] = ()

    name = "optimisation"

    def __post_init__(self) -> None:
        for key in ("starts", "look"):
            real(key, getattr(self, key), positive=True, whole=True)
        real("seed", self.seed, whole=True)

    def run(self, campaign: Campaign, domain: Domain) -> Bounds:
        """Search all bounds."""
        spent = self.search(campaign, domain, searched(campaign, domain, self.outputs))
        return attained(campaign, domain, self.name, spent=spent)

    def search(self, campaign: Campaign, domain: Domain, outputs: tuple[str, ...]) -> bool:
        """Search the bounds of some outputs; whether the budget ended that."""
        try:
            for cut in cuts(campaign, domain):
                cut.look(self.look * len(cut.moving), self.seed)
                for output, sign in product(outputs, (1.0, -1.0)):
                    for start in cut.best(output, sign, self.starts):
                        cut.descend(start, output, sign)
                campaign.report(1 - cut.level / len(domain.alpha))
        except SpentError:
            return True
        return False


def searched(campaign: Campaign, domain: Domain, outputs: tuple[str, ...]) -> tuple[str, ...]:
    """The outputs that are to be searched, after a first sample that names them all."""
    columns = campaign(domain.modal[None]).columns
    for name in outputs:
        chosen("output", name, columns)
    return outputs or columns


def attained(campaign: Campaign, domain: Domain, method: str, *, spent: bool) -> Bounds:
    """Bounds from all samples of a search, with a note where the budget ended it."""
    bounds = of_samples(domain, campaign.samples, method)
    note = "the budget ended the search: a larger one may find more"
    return replace(bounds, notes=(note,)) if spent else bounds
