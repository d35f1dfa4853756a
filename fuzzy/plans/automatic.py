"""The method that is taken where none is named: corners where they suffice, else single linkage."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from alphacut.fuzzy.arrays import Array, Mask
from alphacut.fuzzy.campaign.call import SpentError
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.plans.cut import attained_bounds, cuts_with_width
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
        uncovered: Share of each cut up to which a search goes on, in (0, 1).
        seed: Seed of all samples.

    Raises:
        RefusedError: A value is out of range.

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
        outputs = campaign(domain.modal[None]).columns
        monotone = campaign.knowledge.monotone_in(domain.names, outputs)
        if not domain.interactions and corners_suffice(domain, monotone).all():
            return replace(Reduced().run(campaign, domain), method=self.name)
        return _Search(campaign, domain, outputs, self).run()


class _Search:
    """Search of a model of which too little is known for a proof.

    Args:
        campaign: The model.
        domain: Inputs and levels.
        outputs: All outputs.
        method: Options.
    """

    def __init__(
        self, campaign: Campaign, domain: Domain, outputs: tuple[str, ...], method: Automatic
    ) -> None:
        self.campaign, self.domain, self.outputs, self.method = campaign, domain, outputs, method
        self.cuts = list(cuts_with_width(campaign, domain))
        self.monotone: Mask = np.zeros(len(outputs), bool)
        self.n_points = 0  # at which each input was changed alone
        self.searched: tuple[str, ...] = ()
        self.linkage: SingleLinkage | None = None
        self.ended = False

    def run(self) -> Bounds:
        """Search within the budget; the bounds of every output, each estimated or attained only."""
        try:
            if self.cuts:
                self._search()
        except SpentError:
            self.ended = True
        bounds = attained_bounds(self.campaign, self.domain, Automatic.name, ended=self.ended)
        return self._with_natures(bounds)

    def _search(self) -> None:
        """Evaluate the corners for outputs whose effects keep their signs, and search the others.

        It sets `monotone`, `searched` and `linkage`.
        """
        widest = self.cuts[-1]
        first: Array = np.empty((0, len(widest.uncertain_inputs)))
        if not self.domain.interactions:
            walk = SignWalk(self.campaign, widest, self.method.seed)
            self.monotone, first = walk.corners_suffice(), walk.samples
            self.n_points = walk.points
        names = tuple(np.array(self.outputs)[~self.monotone])
        if not names:
            return
        self.searched = names if len(names) <= _MAX_SEARCHED else ()
        self.linkage = SingleLinkage(
            self.campaign,
            self.domain,
            self.searched,
            uncovered=self.method.uncovered,
            seed=self.method.seed,
        )
        if self.searched:
            self.linkage.run(first)
        else:
            self.linkage.sample()

    def _with_natures(self, bounds: Bounds) -> Bounds:
        """Copy of attained bounds with the error and nature of each output, and notes.

        Bounds of monotone outputs, and of those whose search met its stopping rule, are estimated.
        """
        is_estimated = self.monotone.copy()
        for column, output in enumerate(self.outputs):
            is_estimated[column] |= self.linkage is not None and self.linkage.is_estimate(output)
        size = np.maximum(np.abs(bounds.lower), np.abs(bounds.upper)).max(axis=0)
        error = VALUE_TOLERANCE * (bounds.upper - bounds.lower)[0] + ROUNDING * size
        lower, upper = self.domain.boxes
        is_crisp = (lower == upper).all(axis=1)[:, None]
        natures = tuple(Nature.ESTIMATED if x else Nature.ATTAINED for x in is_estimated)
        return replace(
            bounds,
            error=np.where(is_estimated & ~is_crisp, error, 0.0),
            natures=natures,
            nature=Nature.weakest(natures),
            notes=(*self._notes(), *bounds.notes),
        )

    def _notes(self) -> list[str]:
        """Return sentences on what the estimates rest on and on bounds at kinks or jumps."""
        notes = []
        if self.monotone.any():
            names = _listed(np.array(self.outputs)[self.monotone])
            which = f"the differences of each input keep their sign at {self.n_points} points"
            notes.append(f"corners alone bound {names}: {which}")
        if self.linkage is not None and self.searched:
            notes.append(self.linkage.summary())
            if not self.ended and (rough := [x for x in self.searched if self.linkage.is_rough(x)]):
                notes.append(f"a bound of {_listed(rough)} lies at a kink or a jump")
        return notes


def _listed(names: Iterable[str]) -> str:
    """Return a text of the first four names."""
    first = list(names)
    return ", ".join(first[:4]) + (" …" if len(first) > 4 else "")
