"""Multi-level single linkage over all α-cuts (Rinnooy Kan and Timmer, 1987, part II).

Each cut has N uniform samples, shared by all bounds. A descent starts from a sample only if none
within the critical distance r of it is better, with

    r = (σ Γ(1 + d/2) ln N / N)^(1/d) / √π

for d inputs. The search of a bound ends by the rule of Boender and Rinnooy Kan (1987): with W
different optima, the basins not yet seen cover W (W + 1) / (N (N − 1)) of the cut, as Bayes' rule
tells from a uniform prior.

The rule takes a sample's basin as seen although its descent was left out. A ball of radius r holds
σ ln N samples, with σ = 4 and N = 100 a fifth of all, and may hide a basin as large beside a better
one. Therefore σ is 4 only while at most one optimum is no corner of the cut; then it is 2, the
limit down to which the share of samples that start descents tends to zero with growing N. For the
same reason a descent should end in the basin of its start. One that does not fall all along the
straight line from its start to its end is made again with a short first step.

Samples of a cut that lie in a narrower one are uniform there too and count for it. Optima of other
cuts, and descents from corners, raise W and the bound, but not N.

Where kinks are expected descents stall along them. A sample or a stall from which the output falls
all along the straight line to a better optimum is in the basin of that, and is no optimum itself.

Samples of one value lie on a plateau, from which no descent finds its way. It counts as one
optimum, and its samples do not count as explored: its share of the cut stays uncovered. Further
samples lie far apart, so that few humps stay between them. With a thousand on plateaus the search
of a bound ends, and the bound is attained only. Where kinks are expected a plateau is where an
input acts on nothing, and its samples count from a thousand on: what uniform ones do not meet is
then 0.1 % of the cut, as Bayes' rule tells, and less of those far apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from math import ceil, gamma, inf, log, pi, sqrt

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.plans.cut import Bound, CutSearch, Optimum, cuts_with_width
from alphacut.fuzzy.sets.boxes import Domain

SEED = 0  # seed of all samples
MAX_UNCOVERED = 0.002
"""Share of each cut, not yet covered by basins that were seen, up to which a search goes on."""
MIN_SAMPLES = 100
"""Samples N from which the rule of Boender and Rinnooy Kan decides: with fewer its prior does."""
SIGMA_ONE_HUMP = 4.0  # σ while at most one optimum is no corner: descents of one hump stay few
SIGMA_SEVERAL_HUMPS = 2.0
"""σ from the second such optimum on: a smaller one starts more descents and hides fewer basins."""
FIRST_STEP = 0.1
"""First step of a careful descent, of the width of the cut: a longer one passes over humps."""
VALUE_TOLERANCE = 1e-5
"""Of an output's range in the widest cut: values that differ by less count as one."""
ROUNDING = 1e-9  # the same of an output's size
MAX_ON_PLATEAUS = 1000
"""Samples on plateaus with which the search of a bound ends: 95 % of uniform ones find a cone
of 0.3 % of them."""
CANDIDATES = 10  # a point that fills holes: more candidates cost time and crowd the cube's faces
EQUAL = 1e-13  # of an output's size: two samples that differ by less lie on a plateau
_SAME_PLACE = 0.01  # of the width: optima of one value are the same there without a look between
_BETWEEN = np.array([0.25, 0.5, 0.75])  # points of a line on which a hump is looked for
_FALLING = np.array([0.0, 0.02, 0.1, 0.25, 0.5, 0.75])  # of a line from a stall: near it most
_BESIDE = np.append(0.0, np.geomspace(1e-4, 0.2, 12))
"""Distances from an optimum at which waves are looked for, of the width. The last is a critical
distance: 100 samples of one to three inputs have 0.1 to 0.35. Tuned: 15 of 400 trends with waves
beside them are estimated wrongly without this look, and 1 with it."""
_MIN_NEW = 15  # samples that a round adds


def critical_distance(samples: int, inputs: int, sigma: float = SIGMA_ONE_HUMP) -> float:
    """Critical distance r = (σ Γ(1 + d/2) ln N / N)^(1/d) / √π of N samples in the unit cube.

    A ball of radius r contains σ ln N of them on average (Rinnooy Kan and Timmer, 1987).
    """
    ball = sigma * gamma(1 + inputs / 2) * log(samples) / samples
    return float(ball ** (1 / inputs) / sqrt(pi))


def rows_without_better_neighbour(unit: Array, values: Array, distance: float) -> Ints:
    """Rows of the samples (n, d), in unit coordinates, without a better one within a distance.

    Descents start there; infinite values (n,) start none.
    """
    from scipy.spatial import cKDTree

    pairs = cKDTree(unit).query_pairs(distance, output_type="ndarray")
    first, second = values[pairs[:, 0]], values[pairs[:, 1]]
    worse = np.concatenate([pairs[first > second, 0], pairs[second > first, 1]])
    return np.setdiff1d(np.flatnonzero(np.isfinite(values)), worse)


def with_farthest_points(unit: Array, known: Array, rng: np.random.Generator) -> Array:
    """Uniform points (n, d) of the unit cube of which 1,000, or all, were drawn again far apart.

    Each of these is, of random candidates, the one farthest from the known points (m, d) and those
    before it (Mitchell 1991). Of holes with 0.3 % of a cube they leave 75 times fewer than uniform
    points in three dimensions, and half as many in six.
    """
    from scipy.spatial import cKDTree

    count = min(len(unit), MAX_ON_PLATEAUS)
    spread, uniform = unit[:count].copy(), unit[count:]
    candidates = rng.random((CANDIDATES * count, unit.shape[1]))
    distance, _ = cKDTree(np.concatenate([known, uniform])).query(candidates)
    distance_squared = distance**2
    for row in range(count):
        spread[row] = candidates[distance_squared.argmax()]
        step = candidates - spread[row]
        np.minimum(distance_squared, np.einsum("nd,nd->n", step, step), out=distance_squared)
    return np.concatenate([uniform, spread])


def samples_on_plateaus(values: Array) -> Mask:
    """Mask of the samples whose value (n,) another sample has as well, to rounding."""
    order = np.argsort(values)
    ordered = values[order]
    with np.errstate(invalid="ignore"):  # ∞ − ∞ of failed samples
        is_equal = np.diff(ordered) <= EQUAL * np.abs(values[np.isfinite(values)]).max(initial=0)
    is_tied = np.zeros(len(values), bool)
    is_tied[order] = np.append(is_equal, False) | np.append(False, is_equal)
    return is_tied


@dataclass
class BoundSearch:
    """State of the search of one bound in one cut.

    Args:
        started: Rows of the samples from which a descent has started; negative for corners.
        samples: N, samples off plateaus all of whose descents are done.
        plateau_samples: Samples on plateaus.
        plateaus: Values of plateaus from which a descent has started.
        optima: W different results of descents, in any cut, that are optima of this cut.
        has_kinks: Whether kinks are expected, and the best optimum counts though it lies at one.
    """

    started: set[int] = field(default_factory=set)
    samples: int = 0
    plateau_samples: int = 0
    plateaus: list[float] = field(default_factory=list)
    optima: list[Optimum] = field(default_factory=list)
    has_kinks: bool = False

    @property
    def best(self) -> Optimum:
        """The best optimum; some must have been found."""
        return min(self.optima, key=lambda optimum: optimum.value)

    @property
    def explored(self) -> int:
        """Samples in basins of optima and, with kinks, on plateaus that are known well enough."""
        are_known = self.has_kinks and self.plateau_samples >= MAX_ON_PLATEAUS
        return self.samples + self.plateau_samples * are_known

    @property
    def uncovered(self) -> float:
        """Expected fraction of the cut that is not yet covered by basins and known plateaus."""
        N, W = self.explored, len(self.optima)
        if N < 2 or not W:
            return inf
        total = self.samples + self.plateau_samples
        return (total - N) / total + W * (W + 1) / (N * (N - 1))  # Boender, Rinnooy Kan 1987

    @property
    def is_smooth(self) -> bool:
        """Whether the output is smooth at the best optimum, so that the descent did not stall."""
        return bool(self.optima) and (self.has_kinks or self.best.is_smooth)

    def n_optima_off_corners(self, cut: CutSearch) -> int:
        """Return the number of optima that are no corner of the cut."""
        lower, upper = cut.lower + cut.near, cut.upper - cut.near
        at_ends = [(x.point <= lower) | (x.point >= upper) for x in self.optima]
        return sum(not ends.all() for ends in at_ends)

    @property
    def is_estimate(self) -> bool:
        """Whether the stopping rule is met and the output is smooth at the best optimum."""
        return self.explored >= MIN_SAMPLES and self.uncovered < MAX_UNCOVERED and self.is_smooth

    @property
    def is_open(self) -> bool:
        """Whether the search goes on; kinks and jumps at the best optimum end it, too."""
        if self.plateau_samples >= MAX_ON_PLATEAUS:
            return False
        if self.samples < MIN_SAMPLES or not self.optima:
            return True
        return self.uncovered >= MAX_UNCOVERED and self.is_smooth

    def next_samples(self) -> int:
        """Samples with which W (W + 1) / (N (N − 1)) falls to `MAX_UNCOVERED` if W stays.

        With plateaus so many that `MAX_ON_PLATEAUS` lie on them; at most twice the present number.
        """
        W, present = len(self.optima), self.samples + self.plateau_samples
        needed = ceil(0.5 + sqrt(0.25 + W * (W + 1) / MAX_UNCOVERED)) + 1
        if self.plateau_samples:
            needed = ceil(1.01 * MAX_ON_PLATEAUS * present / self.plateau_samples)
        return max(MIN_SAMPLES, min(max(needed, present + _MIN_NEW), 2 * present))


class SingleLinkage:
    """Search of some outputs' bounds in all cuts of a domain; they may be expected to have kinks.

    Attributes:
        cuts: Cuts that have a width, from the widest on.
        bounds: Bounds that are searched.
        states: State of each bound by the level of its cut.
    """

    def __init__(
        self, campaign: Campaign, domain: Domain, outputs: tuple[str, ...], has_kinks: bool = False
    ) -> None:
        self.campaign, self.outputs, self.has_kinks = campaign, outputs, has_kinks
        self.cuts = list(cuts_with_width(campaign, domain))[::-1]
        self.bounds = [Bound(output, sign) for output, sign in product(outputs, (1.0, -1.0))]
        self.states = {
            (cut.level, bound): BoundSearch(has_kinks=has_kinks)
            for cut, bound in product(self.cuts, self.bounds)
        }
        # uniform samples of all cuts, and the level of the cut in which each was drawn
        self._points: Array = np.empty((0, len(domain.names)))
        self._values: dict[Bound, Array] = {bound: np.empty(0) for bound in self.bounds}
        self._levels: Ints = np.empty(0, int)

    def run(self, first: Array) -> None:
        """Sample and descend, cut by cut in rounds, until every bound meets the stopping rule.

        `first` are uniform samples of the widest cut in unit coordinates. Without outputs to search
        each cut gets `MIN_SAMPLES` samples and no descents.

        Raises:
            SpentError: The budget ended the search.
        """
        if not self.outputs:
            for cut in self.cuts:
                self._sample_up_to(cut, MIN_SAMPLES, 0)
            return
        self._add_samples(self.cuts[0], first)
        self.search()

    def search(self) -> None:
        """Go on until every bound meets the stopping rule, as after optima found elsewhere.

        Raises:
            SpentError: The budget ended the search.
        """
        rounds = 0
        while visits := [(cut, bounds) for cut in self.cuts if (bounds := self._open_bounds(cut))]:
            rounds += 1
            for number, (cut, bounds) in enumerate(visits, start=1):
                states = [self.states[cut.level, bound] for bound in bounds]
                count = max(state.next_samples() for state in states)
                self._sample_up_to(cut, count, rounds, bounds)
                for bound in bounds:
                    self._descend(cut, bound)
                self.campaign.report(1 - (1 - 0.8 * number / len(visits)) / rounds)

    def is_estimate(self, output: str) -> bool:
        """Return whether both bounds of an output meet the stopping rule in all cuts."""
        states = [state for (_, bound), state in self.states.items() if bound.output == output]
        return bool(states) and all(state.is_estimate for state in states)

    def is_rough(self, output: str) -> bool:
        """Return whether the best optimum of a bound of the output is at a kink or jump."""
        states = [state for (_, bound), state in self.states.items() if bound.output == output]
        return any(state.optima and not state.is_smooth for state in states)

    def passes_over_waves(self, output: str) -> bool:
        """Return whether descents to the best optima of some cut pass over jumps or waves.

        An estimated output is evaluated along each input, to both sides of the best optimum of each
        bound. Where it improves again, away from the optimum, a descent should find a smooth
        optimum of its own. The search has started none there, as the best optimum is nearby. And
        waves exceed the optimum only nearby: farther away the trend has changed the output by more
        than they do.

        Raises:
            SpentError: The budget does not carry the evaluations.
        """
        for cut, bound, side in product(self.cuts, self.bounds, (-1.0, 1.0)):
            if bound.output != output or not self.is_estimate(output):
                continue
            best = cut.unit(self.states[cut.level, bound].best.point[None])[0]
            for column in range(len(best)):
                line = np.repeat(best[None], len(_BESIDE), axis=0)
                line[:, column] += side * _BESIDE
                line = line[(line[:, column] >= 0) & (line[:, column] <= 1)]
                changes = np.diff(cut.values(line, bound))
                improved = np.flatnonzero(changes < -self._tolerance(bound))
                if not len(improved):
                    continue
                start = line[improved[0] + 1]
                optimum = cut.descend(start, bound, np.abs(start - best).max() / 2)
                self._record(optimum)
                distance = np.abs(cut.unit(optimum.point[None])[0] - best).max()
                if distance < _BESIDE[1] or not optimum.is_smooth:
                    return True
        return False

    def summary(self) -> str:
        """Return a sentence on the bound with the largest uncovered fraction of its cut."""
        worst = max(self.states.values(), key=lambda state: state.uncovered)
        note = f"W = {len(worst.optima)} optima found from N = {worst.samples} samples"
        if worst.plateau_samples:
            note += f" beside {worst.plateau_samples} on plateaus"
        return f"{note}: of each cut {min(worst.uncovered, 1):.3%} or less is not yet covered"

    def _open_bounds(self, cut: CutSearch) -> list[Bound]:
        """Bounds of a cut whose search goes on, after descents from samples better than optima."""
        for bound in self.bounds:
            state, samples = self.states[cut.level, bound], self.campaign.samples
            if not state.optima:
                continue
            inside = cut.contains(samples.points)
            values = bound.sign * samples.values.array[inside, samples.values.column(bound.output)]
            best = int(np.nanargmin(values))
            if values[best] < state.best.value - self._tolerance(bound):
                self._descend_from(cut, bound, cut.unit(samples.points[inside][best][None])[0])
        states = [(bound, self.states[cut.level, bound]) for bound in self.bounds]
        return [bound for bound, state in states if state.is_open]

    def _descend(self, cut: CutSearch, bound: Bound) -> None:
        """Descend from the samples and corners of a cut that have no better one nearby.

        Nearby is the critical distance with σ = 4; from two optima that are no corners on, also the
        smaller one with σ = 2. Descents that have been made before are not repeated.
        """
        state, rows = self.states[cut.level, bound], self._rows(cut)
        unit = np.concatenate([cut.unit(self._points[rows]), cut.corners])
        keys = [*map(int, rows), *range(-len(cut.corners), 0)]  # N does not count corners
        sampled = self._values[bound][rows]
        values = np.append(sampled, cut.values(cut.corners, bound))
        is_tied = np.append(samples_on_plateaus(sampled), np.zeros(len(cut.corners), bool))
        tolerance = EQUAL * np.abs(values[np.isfinite(values)]).max(initial=0)
        for sigma in (SIGMA_ONE_HUMP, SIGMA_SEVERAL_HUMPS):
            if sigma == SIGMA_SEVERAL_HUMPS and state.n_optima_off_corners(cut) < 2:
                continue
            distance = critical_distance(len(rows), len(cut.uncertain_inputs), sigma)
            for start in rows_without_better_neighbour(unit, values, distance):
                if is_tied[start]:
                    value = float(values[start])
                    if any(abs(value - plateau) <= tolerance for plateau in state.plateaus):
                        continue
                    state.plateaus.append(value)
                if keys[start] not in state.started:
                    state.started.add(keys[start])
                    self._descend_from(cut, bound, unit[start])
        state.plateau_samples = int(is_tied.sum())
        state.samples = len(rows) - state.plateau_samples

    def _descend_from(self, cut: CutSearch, bound: Bound, start: Array) -> None:
        """Descend and record the optimum; with a short step again if it left the basin."""
        if self.has_kinks and self._falls(cut, start, self.states[cut.level, bound].optima):
            return
        optimum = cut.descend(start, bound)
        self._record(optimum)
        step = cut.unit(optimum.point[None])[0] - start
        if np.abs(step).max() > FIRST_STEP:
            line = start + np.array([0.0, *_BETWEEN])[:, None] * step
            values = [*cut.values(line, bound), optimum.value]
            if (np.diff(values) > self._tolerance(bound)).any():
                self._record(cut.descend(start, bound, FIRST_STEP))

    def _record(self, optimum: Optimum) -> None:
        """Add an optimum to every cut of which it is one; the better of two equal ones stays."""
        for cut in self.cuts:
            if not optimum.is_optimum_of(cut):
                continue
            optima = self.states[cut.level, optimum.bound].optima
            index = self._index_of_equal(cut, optimum)
            if index == len(optima):
                optima.append(optimum)
            elif optimum.value < optima[index].value:
                optima[index] = optimum
            if self.has_kinks:
                units = cut.unit(np.stack([x.point for x in optima]))
                better = [[y for y in optima if y.value < x.value] for x in optima]
                stalls = [self._falls(cut, units[k], to) for k, to in enumerate(better)]
                optima[:] = [x for x, is_stall in zip(optima, stalls, strict=True) if not is_stall]

    def _falls(self, cut: CutSearch, start: Array, optima: list[Optimum]) -> bool:
        """Return whether the output falls all along a line from a point (d,) to an optimum."""
        if not optima:
            return False
        steps = cut.unit(np.stack([x.point for x in optima])) - start
        points = (start + _FALLING[:, None, None] * steps).reshape(-1, len(start))
        values = cut.values(points, optima[0].bound).reshape(len(_FALLING), -1)
        changes = np.diff(np.vstack([values, [x.value for x in optima]]), axis=0)
        return bool((changes <= 0).all(0).any())

    def _index_of_equal(self, cut: CutSearch, optimum: Optimum) -> int:
        """Index of an equal optimum in the list of a cut; its length if there is none."""
        # Optima of nearly one value are equal if they are close, or if no value between them is
        # larger: a valley is where many descents end, and symmetric hills are several
        optima = self.states[cut.level, optimum.bound].optima
        tolerance = self._tolerance(optimum.bound)
        alike = [k for k, x in enumerate(optima) if abs(x.value - optimum.value) <= tolerance]
        unit = cut.unit(np.stack([optimum.point, *(optima[k].point for k in alike)]))
        steps = unit[1:] - unit[0]
        for index, step in zip(alike, steps, strict=True):
            if np.abs(step).max() <= _SAME_PLACE:
                return index
        for index, step in zip(alike, steps, strict=True):
            between = cut.values(unit[0] + _BETWEEN[:, None] * step, optimum.bound)
            if (between <= max(optimum.value, optima[index].value) + tolerance).all():
                return index
        return len(optima)

    def _tolerance(self, bound: Bound) -> float:
        values = self._values[bound][np.isfinite(self._values[bound])]
        return float(VALUE_TOLERANCE * np.ptp(values) + ROUNDING * np.abs(values).max())

    def _rows(self, cut: CutSearch) -> Ints:
        """Return the rows of the samples that are uniform in a cut: its own and of wider cuts."""
        return np.flatnonzero((self._levels <= cut.level) & cut.contains(self._points))

    def _sample_up_to(
        self, cut: CutSearch, count: int, rounds: int, bounds: Sequence[Bound] = ()
    ) -> None:
        rows = self._rows(cut)
        missing = count - len(rows)
        if missing > 0:
            rng = np.random.default_rng([SEED, 1 + cut.level, rounds])
            unit = rng.random((missing, len(cut.uncertain_inputs)))
            states = [self.states[cut.level, bound] for bound in bounds]
            # the stopping rule is of uniform samples, but never met where plateaus are large
            if states and all(state.plateau_samples for state in states):
                unit = with_farthest_points(unit, cut.unit(self._points[rows]), rng)
            self._add_samples(cut, unit)

    def _add_samples(self, cut: CutSearch, unit: Array) -> None:
        """Evaluate uniform samples (n, uncertain inputs) of a cut and append them."""
        points = cut.points(unit)
        rows = self.campaign(points)
        for bound, values in self._values.items():
            added = bound.sign * rows.array[:, rows.column(bound.output)]
            added[np.isnan(added)] = inf
            self._values[bound] = np.concatenate([values, added])
        self._points = np.concatenate([self._points, points])
        self._levels = np.concatenate([self._levels, np.full(len(points), cut.level)])
