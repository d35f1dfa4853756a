"""α-cut optimisation: every bound searched by a SciPy optimiser (appendix A, eq. 21)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from alphacut.fuzzy.plans.monotonicity import primary
from alphacut.fuzzy.samples.design import Design
from alphacut.fuzzy.samples.model import Memo, Model
from alphacut.fuzzy.samples.result import FuzzyResult
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.given import require_fields
from alphacut.fuzzy.sets.interaction import pulled
from alphacut.fuzzy.sets.numbers import Array
from alphacut.fuzzy.surrogates.chebyshev_polynomial import corners, dividing

Bound = tuple[float, float]
Method = Literal["multistart", "differential_evolution", "shgo", "direct", "dual_annealing"]
_DIFFERENCE = 1e-6  # step of a derivative, as a share of the width of the cut
# least distance of two starts, as a share of the width of the cut: they should lie in different
# valleys
_APART = 0.25
_CORNERS = 6  # inputs up to which the first look includes all corners


@dataclass(frozen=True)
class Optimisation:
    """Search of each bound, from the narrowest cut up; every sample counts for all bounds.

    Args:
        method: "multistart" looks at corners and spread points first and descends from the best by
            gradients; the others are SciPy's global optimisers of that name, which know nothing of
            interactions.
        starts: Descents per bound.
        look: Spread points of the first look per level and input.
        budget: Samples per bound that a global optimiser may take.
        seed: Where random searches start from.
        outputs: Outputs whose bounds matter; all if none is named. The others are printed as the
            samples happen to bound them, without an error.

    Raises:
        ValueError: There is no such method, or a number is not positive.
    """

    method: Method = "multistart"
    starts: int = 3
    look: int = 8
    budget: int = 2000
    seed: int = 0
    outputs: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        require_fields(self)
        if self.method not in get_args(Method):
            raise ValueError(
                f"the optimiser is {self.method!r}; it must be one of {', '.join(get_args(Method))}"
            )
        if min(self.starts, self.look, self.budget) < 1:
            raise ValueError(
                f"starts, look and budget are {self.starts}, {self.look}, {self.budget}; each must"
                " be 1 or more"
            )

    stepwise = True  # samples depend on those before

    def run(self, model: Model, domain: Domain) -> FuzzyResult:
        """Search all bounds."""
        if self.method != "multistart":
            domain.require_free(self.method)
        memo = Memo(model)
        modal = domain.modal[None]
        columns = memo(modal).columns
        names = self.outputs or primary(columns, model.known)
        for level in reversed(range(len(domain.alpha))):
            cut = LevelSearch(memo, domain, level)
            if not (cut.upper > cut.lower).any():
                continue
            if self.method == "multistart":
                cut.look(self.look, self.seed)
            for name in names:
                for sign in (1.0, -1.0):
                    self._search(cut, name, sign)
            model.report(1 - level / len(domain.alpha))
        design, plan = Design.from_samples(domain, memo.points), f"optimisation by {self.method}"
        result = design.bounds(memo.values, plan=plan)
        return result.searched([result.column(name) for name in names], self.outputs)

    def _search(self, cut: LevelSearch, output: str, sign: float) -> None:
        if self.method == "multistart":
            for start in cut.best(output, sign, self.starts):
                cut.descend(start, output, sign)
            return
        import scipy.optimize

        factor = sign / cut.scale(output)

        def objective(unit: Array) -> object:
            if unit.ndim > 1:  # many points, one in each column
                return factor * cut.values(unit.T, output)
            return factor * float(cut.values(unit[None], output)[0])

        bounds = [(0.0, 1.0)] * len(cut.moving)
        if self.method == "differential_evolution":
            rounds = max(1, self.budget // (15 * len(bounds)) - 1)
            options = {"maxiter": rounds, "rng": self.seed, "tol": 1e-8, "polish": False}
            scipy.optimize.differential_evolution(
                objective, bounds, **options, vectorized=True, updating="deferred"
            )
        elif self.method == "direct":
            _direct(objective, bounds, self.budget)
        elif self.method == "shgo":
            scipy.optimize.shgo(objective, bounds, options={"maxfev": self.budget})
        else:
            scipy.optimize.dual_annealing(objective, bounds, maxfun=self.budget, rng=self.seed)


def _direct(objective: Callable[[Array], object], bounds: list[Bound], budget: int) -> None:
    """SciPy's `direct`, with the first exception of the objective raised: its C code loses them.

    It cannot be stopped; what it asks for after the exception gets 0 without being evaluated. Of
    the other optimisers none calls back from C.
    """
    import scipy.optimize

    raised: list[BaseException] = []

    def kept(unit: Array) -> object:
        try:
            return 0.0 if raised else objective(unit)
        except BaseException as error:
            raised.append(error)
            return 0.0

    try:
        scipy.optimize.direct(kept, bounds, maxfun=budget)
    except SystemError as error:  # of an interrupt between two evaluations
        raised.append(error.__cause__ or error)
    if raised:
        raise raised[0]


class LevelSearch:
    """One level under search, in unit coordinates of the inputs that have a width."""

    def __init__(self, memo: Memo, domain: Domain, level: int) -> None:
        self.memo, self.domain, self.level = memo, domain, level
        self.lower, self.upper = (ends[level] for ends in domain.boxes)
        self.moving = np.flatnonzero(self.upper > self.lower)

    def points(self, unit: Array) -> Array:
        """Inputs of points (n, moving) of the unit cube, shape (n, inputs)."""
        points = np.repeat(self.lower[None], len(unit), axis=0)
        points[:, self.moving] = (
            self.lower[self.moving] + unit * (self.upper - self.lower)[self.moving]
        )
        return np.clip(points, self.lower, self.upper)

    def values(self, unit: Array, output: str) -> Array:
        """One output at points of the unit cube, shape (n,)."""
        return self.memo(self.points(unit)).select([output])[:, 0]

    def scale(self, output: str) -> float:
        """Unit of an output for optimisers: its range over all samples, or its size."""
        seen = self.memo.values.select([output])
        return dividing(np.ptp(seen), np.abs(seen).max())

    def look(self, per_input: int, seed: int) -> Array:
        """Run the model at the corners and at spread points; the latter that are in the cut."""
        from scipy.stats import qmc

        inputs = len(self.moving)
        spread: Array = qmc.Halton(inputs, rng=np.random.default_rng([seed, self.level])).random(
            per_input * inputs
        )
        fresh = self.allowed(spread)
        corner = self.allowed(corners(inputs)) if inputs <= _CORNERS else fresh[:0]
        if len(fresh) + len(corner):
            self.memo(self.points(np.concatenate([corner, fresh])))
        elif not self.domain.inside(self.memo.points)[self.level].any():
            alpha = self.domain.alpha[self.level]
            raise ValueError(
                f"no point of the cut at α = {alpha:g} fulfils its interactions: they leave too"
                " little room, or none"
            )
        return fresh

    def allowed(self, unit: Array) -> Array:
        """Those of the points (n, moving) of the unit cube that fulfil the interactions."""
        slack = self.domain.slack(self.points(unit), self.domain.alpha[self.level])
        return unit[slack >= 0]

    def along(self, place: Array, output: str, sign: float, rounds: int) -> Array:
        """Where it leads to leave a place along each input, to both ends of the cut.

        What is better is joined, and descended from: a hill of many inputs is often left by
        several at once.
        """
        each = np.arange(len(place))
        lines = np.repeat(place[None, None], 2, axis=0).repeat(len(place), axis=1)
        lines[:, each, each] = np.array([[0.0], [1.0]])
        here = self.worth(place[None], output, sign)[0]
        found = np.array([self.worth(line, output, sign) for line in lines])
        if not (found < here).any():
            return place
        joined = np.where(found.min(axis=0) < here, found.argmin(axis=0), place)
        one = lines.reshape(-1, len(place))[found.argmin()]
        both = np.stack([joined, one])
        start: Array = both[self.worth(both, output, sign).argmin()]
        return self.descend(start, output, sign, rounds)

    def worth(self, unit: Array, output: str, sign: float) -> Array:
        """`sign` times the output at points of the unit cube; inf outside the interactions."""
        inside = self.domain.slack(self.points(unit), self.domain.alpha[self.level]) >= 0
        worth: Array = np.full(len(unit), np.inf)
        if inside.any():
            worth[inside] = sign * self.values(unit[inside], output)
        return worth

    def best(self, output: str, sign: float, count: int) -> Array:
        """The best few samples in the cut that lie apart, in unit coordinates."""
        points = self.memo.points
        points = points[self.domain.inside(points)[self.level]]
        unit: Array = np.clip(
            (points - self.lower)[:, self.moving] / (self.upper - self.lower)[self.moving], 0, 1
        )
        chosen: list[Array] = []
        for row in np.argsort(sign * self.memo(points).select([output])[:, 0], kind="stable"):
            if len(chosen) < count and all(
                np.abs(unit[row] - other).max() > _APART for other in chosen
            ):
                chosen.append(unit[row])
        return np.array(chosen)

    def descend(self, start: Array, output: str, sign: float, rounds: int = 50) -> Array:
        """End of a descent by gradients inside the cut; its samples stay in the memo."""
        from scipy.optimize import minimize

        scale = self.scale(output)

        def objective(unit: Array) -> tuple[float, Array]:
            steps = np.where(unit + _DIFFERENCE > 1, -_DIFFERENCE, _DIFFERENCE)
            values = (
                sign
                / scale
                * self.values(np.concatenate([unit[None], unit + np.diag(steps)]), output)
            )
            return float(values[0]), (values[1:] - values[0]) / steps

        bounds = [(0.0, 1.0)] * len(start)
        if self.domain.interactions:
            alpha = self.domain.alpha[self.level]
            room = {
                "type": "ineq",
                "fun": lambda unit: float(self.domain.slack(self.points(unit[None]), alpha)[0]),
            }
            found = minimize(
                objective, start, jac=True, bounds=bounds, constraints=[room], method="SLSQP"
            )
            place, anchor = self.points(np.clip([found.x, start], 0, 1))
            end = pulled(place, anchor, lambda points: self.domain.slack(points, alpha))
            self.memo(end[None])
            width = (self.upper - self.lower)[self.moving]
            return np.asarray((end - self.lower)[self.moving] / width)
        options = {"maxiter": rounds}
        found = minimize(
            objective, start, jac=True, bounds=bounds, method="L-BFGS-B", options=options
        )
        return np.asarray(found.x)
