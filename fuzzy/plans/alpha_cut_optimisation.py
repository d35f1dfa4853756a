"""α-cut optimisation: every bound searched by a SciPy optimiser (appendix A, eq. 21)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.campaign.call import SpentError
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.plans.design import of_samples
from alphacut.fuzzy.refused import real
from alphacut.fuzzy.result import Bounds
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.interaction import pulled

_DIFFERENCE = 1e-6  # step of a derivative, as a share of the width of the cut
_STEP = 1e-4  # the same of one that tells whether a place is an optimum
# least distance of two starts, as a share of the width of the cut: they should lie in different
# valleys
_APART = 0.25
_CORNERS = 6  # inputs up to which a look includes all corners


@dataclass(frozen=True)
class Optimisation:
    """Search of each bound, from the narrowest cut up; every sample counts for all bounds.

    Corners and spread points are looked at first, then descents by gradients begin at the best.

    Args:
        starts: Descents per bound.
        look: Spread points of the first look per level and input.

    Raises:
        RefusedError: A number is not positive.
    """

    starts: int = 3
    look: int = 8

    name = "optimisation"

    def __post_init__(self) -> None:
        for key in ("starts", "look"):
            real(key, getattr(self, key), positive=True, whole=True)

    def run(self, campaign: Campaign, domain: Domain) -> Bounds:
        """Search all bounds."""
        spent = self.search(campaign, domain, campaign(domain.modal[None]).columns)
        return attained(campaign, domain, self.name, spent=spent)

    def search(self, campaign: Campaign, domain: Domain, outputs: tuple[str, ...]) -> bool:
        """Search the bounds of some outputs; whether the budget ended that."""
        try:
            for cut in cuts(campaign, domain):
                cut.look(self.look * len(cut.moving), 0)
                for output, sign in product(outputs, (1.0, -1.0)):
                    for start in cut.best(output, sign, self.starts):
                        cut.descend(start, output, sign)
                campaign.report(1 - cut.level / len(domain.alpha))
        except SpentError:
            return True
        return False


def attained(campaign: Campaign, domain: Domain, method: str, *, spent: bool) -> Bounds:
    """Bounds from all samples of a search, with a note where the budget ended it."""
    bounds = of_samples(domain, campaign.samples, method)
    note = "the budget ended the search: a larger one may find more"
    return replace(bounds, notes=(note,)) if spent else bounds


class LevelSearch:
    """One level under search, in unit coordinates of the inputs that have a width."""

    def __init__(self, campaign: Campaign, domain: Domain, level: int) -> None:
        self.campaign, self.domain, self.level = campaign, domain, level
        self.alpha = domain.alpha[level]
        self.lower, self.upper = (ends[level] for ends in domain.boxes)
        self.moving = np.flatnonzero(self.upper > self.lower)

    def points(self, unit: Array) -> Array:
        """Inputs of points (n, moving) of the unit cube, shape (n, inputs)."""
        points = np.repeat(self.lower[None], len(unit), axis=0)
        width = (self.upper - self.lower)[self.moving]
        points[:, self.moving] = self.lower[self.moving] + unit * width
        return np.clip(points, self.lower, self.upper)

    def unit(self, points: Array) -> Array:
        """Points (n, inputs) in unit coordinates, shape (n, moving)."""
        width = (self.upper - self.lower)[self.moving]
        unit: Array = np.clip((points - self.lower)[:, self.moving] / width, 0, 1)
        return unit

    def slack(self, unit: Array) -> Array:
        """Room that the interactions leave at points of the unit cube, shape (n,)."""
        return self.domain.slack(self.points(unit), self.alpha)

    def look(self, count: int, seed: int) -> Array:
        """Run the model at the corners and at spread points.

        Args:
            count: Spread points.
            seed: Where they start from.

        Returns:
            The spread points that the interactions allow, shape (n, moving).
        """
        from scipy.stats import qmc

        inputs = len(self.moving)
        rng = np.random.default_rng([seed, self.level])
        spread: Array = qmc.Halton(inputs, rng=rng).random(count)
        corners = np.array(list(product((0.0, 1.0), repeat=inputs if inputs <= _CORNERS else 1)))
        both = np.concatenate([corners, spread]) if inputs <= _CORNERS else spread
        allowed = both[self.slack(both) >= 0]
        if len(allowed):
            self.campaign(self.points(allowed))
        return spread[self.slack(spread) >= 0]

    def worth(self, unit: Array, output: str, sign: float) -> Array:
        """`sign` times the output at points of the unit cube; inf where not allowed or failed."""
        inside = self.slack(unit) >= 0
        worth: Array = np.full(len(unit), np.inf)
        if inside.any():
            values = self.campaign(self.points(unit[inside]))
            worth[inside] = sign * values.array[:, values.column(output)]
        return np.where(np.isnan(worth), np.inf, worth)

    def best(self, output: str, sign: float, count: int) -> Array:
        """The best few samples in the cut that lie apart, in unit coordinates."""
        samples = self.campaign.samples
        inside = self.domain.inside(samples.points)[self.level]
        unit = self.unit(samples.points[inside])
        values = sign * samples.values.array[inside, samples.values.column(output)]
        chosen: list[Array] = []
        for row in np.argsort(values, kind="stable"):
            apart = all(np.abs(unit[row] - other).max() > _APART for other in chosen)
            if apart and len(chosen) < count:
                chosen.append(unit[row])
        return np.array(chosen)

    def along(self, place: Array, output: str, sign: float, rounds: int) -> Array:
        """End of leaving a place along each input, towards both ends of the cut.

        What is better is joined, and descended from: a hill of many inputs is often left by
        several at once.
        """
        size = len(place)
        lines = np.tile(place, (2, size, 1))
        lines[0, range(size), range(size)], lines[1, range(size), range(size)] = 0.0, 1.0
        here = self.worth(place[None], output, sign)[0]
        there = np.array([self.worth(line, output, sign) for line in lines])
        if not (there < here).any():
            return place
        joined = np.where(there.min(axis=0) < here, there.argmin(axis=0), place)
        both = np.stack([joined, lines.reshape(-1, size)[there.argmin()]])
        start: Array = both[self.worth(both, output, sign).argmin()]
        return self.descend(start, output, sign, rounds)

    def steepest(self, place: Array, output: str) -> float:
        """Largest slope at a place of the unit cube along inputs that are not at an end there.

        Both ways along each input, in units of the output's range: nearly 0 at a smooth optimum,
        not at a kink or a jump, nor where a descent stalled.
        """
        inner = np.flatnonzero((place > _STEP) & (place < 1 - _STEP))
        steps = _STEP * np.eye(len(place))[inner]
        here, *around = self.worth(
            np.concatenate([[place], place + steps, place - steps]), output, 1
        )
        allowed = np.array([value for value in around if np.isfinite(value)])
        slopes = np.abs(allowed - here) / _STEP / self.scale(output)
        return float(slopes.max(initial=0.0))

    def scale(self, output: str) -> float:
        """Unit of an output for optimisers: its range over all samples, or 1."""
        values = self.campaign.samples.values
        own = values.array[:, values.column(output)]
        span = float(np.nanmax(own) - np.nanmin(own))
        return span if span >= np.finfo(float).tiny else 1.0

    def descend(self, start: Array, output: str, sign: float, rounds: int = 50) -> Array:
        """End of a descent by gradients inside the cut; its samples stay in the campaign."""
        from scipy.optimize import minimize

        scale = self.scale(output)

        def objective(unit: Array) -> tuple[float, Array]:
            steps = np.where(unit + _DIFFERENCE > 1, -_DIFFERENCE, _DIFFERENCE)
            points = self.points(np.concatenate([unit[None], unit + np.diag(steps)]))
            values = self.campaign(points)
            worth = np.nan_to_num(sign / scale * values.array[:, values.column(output)], nan=1e6)
            return float(worth[0]), (worth[1:] - worth[0]) / steps

        cube = [(0.0, 1.0)] * len(start)
        settings = {"jac": True, "bounds": cube, "options": {"maxiter": rounds}}
        if not self.domain.interactions:
            return np.asarray(minimize(objective, start, method="L-BFGS-B", **settings).x)
        room = {"type": "ineq", "fun": lambda unit: float(self.slack(unit[None])[0])}
        end = minimize(objective, start, method="SLSQP", constraints=[room], **settings)
        place = pulled(np.clip(end.x, 0, 1), start, self.slack)
        self.campaign(self.points(place[None]))
        return place


def cuts(campaign: Campaign, domain: Domain) -> Iterator[LevelSearch]:
    """Cuts that have a width, from the narrowest on, with the share done reported."""
    for level in reversed(range(len(domain.alpha))):
        cut = LevelSearch(campaign, domain, level)
        if len(cut.moving):
            yield cut
