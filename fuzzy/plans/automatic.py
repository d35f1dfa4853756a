"""The method that is taken where none is named: corners where they suffice, else single linkage."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from alphacut.fuzzy.arrays import Array, Mask
from alphacut.fuzzy.campaign.call import SpentError
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.plans.cut import cuts_with_width
from alphacut.fuzzy.plans.design import bounds_of_samples
from alphacut.fuzzy.plans.sign_walk import SignWalk
from alphacut.fuzzy.plans.single_linkage import ROUNDING, VALUE_TOLERANCE, SingleLinkage
from alphacut.fuzzy.plans.transformation import Reduced, corners_suffice
from alphacut.fuzzy.refused import checked_number
from alphacut.fuzzy.result import Bounds, Nature
from alphacut.fuzzy.sets.boxes import Domain

_MAX_SEARCHED = 12  # outputs of which each bound is searched; of more each bound is costly


@dataclass(frozen=True)
class Automatic:
    """Corners where they suffice, else multi-level single linkage.

    Corners are guaranteed to suffice where the knowledge about the model says so. They are
    estimated to suffice where the differences of every input keep their sign at 24 points of the
    widest cut (a single input: 17). Other outputs are searched (Rinnooy Kan, Timmer 1987) until the
    share of each cut that is not yet covered is small (Boender, Rinnooy Kan 1987): the bounds are
    then estimated, to 1e-5 of the range. They are attained where the budget ends the search, or
    where a bound lies at a kink or a jump. Of more than 12 outputs none is searched.

    Args:
        uncovered: Share of each cut up to which a search goes on, in (0, 1].
        seed: Seed of all samples.

    Example:
        >>> from alphacut.fuzzy import Interval, propagate
        >>> bounds = propagate(lambda x: x * (1 - x), {"x": Interval(0, 1)}, Automatic(), alpha=[0])
        >>> bounds.upper.round(6).item(), str(bounds.nature)
        (0.25, 'estimated')
    """

    uncovered: float = 0.002
    seed: int = 0

    name = "automatic"

    def __post_init__(self) -> None:
        checked_number("uncovered", self.uncovered, positive=True, most=1)
        checked_number("seed", self.seed, whole=True)

    def run(self, campaign: Campaign, domain: Domain) -> Bounds:
        """Bounds of every output: by corners if the knowledge allows, else by a search."""
        outputs = campaign.output_names(domain)
        stated = campaign.knowledge.monotone_in(domain.names, outputs)
        if corners_suffice(domain, stated).all():
            return replace(Reduced().run(campaign, domain), method=self.name)
        monotone: Mask = np.zeros(len(outputs), bool)
        linkage, ended, notes = None, False, list[str]()
        if cuts := list(cuts_with_width(campaign, domain)):
            try:
                walk = SignWalk(campaign, cuts[-1], self.seed)
                monotone = walk.corners_suffice()
                if monotone.any():
                    which = f"keep their sign at {walk.n_points} points"
                    notes.append(
                        f"corners alone bound {_listed(np.array(outputs)[monotone])}:"
                        f" the differences of each input {which}"
                    )
                if not monotone.all():
                    names = tuple(np.array(outputs)[~monotone])
                    searched = names if len(names) <= _MAX_SEARCHED else ()
                    linkage = SingleLinkage(
                        campaign, domain, searched, uncovered=self.uncovered, seed=self.seed
                    )
                    linkage.run(walk.samples)
            except SpentError:
                ended = True
        if linkage is not None and linkage.outputs:
            notes.append(linkage.summary())
            rough = () if ended else [name for name in linkage.outputs if linkage.is_rough(name)]
            if rough:
                notes.append(f"a bound of {_listed(rough)} lies at a kink or a jump")
        if ended:
            notes.append("the budget ended the search: a larger one may find more")
        found_all = [linkage is not None and linkage.is_estimate(output) for output in outputs]
        bounds = bounds_of_samples(domain, campaign.samples, self.name)
        return replace(_with_errors(bounds, monotone | found_all, domain), notes=tuple(notes))


def _with_errors(bounds: Bounds, is_estimated: Mask, domain: Domain) -> Bounds:
    """Copy of attained bounds in which those of some outputs (outputs,) are estimated."""
    size = np.maximum(np.abs(bounds.lower), np.abs(bounds.upper)).max(axis=0)
    error: Array = VALUE_TOLERANCE * (bounds.upper - bounds.lower)[0] + ROUNDING * size
    lower, upper = domain.boxes
    is_crisp = (lower == upper).all(axis=1)[:, None]
    natures = tuple(Nature.ESTIMATED if x else Nature.ATTAINED for x in is_estimated)
    return replace(
        bounds,
        error=np.where(is_estimated & ~is_crisp, error, 0.0),
        natures=natures,
        nature=Nature.weakest(natures),
    )


def _listed(names: Iterable[str]) -> str:
    """Return a text of the first four names."""
    first = list(names)
    return ", ".join(first[:4]) + (" …" if len(first) > 4 else "")
