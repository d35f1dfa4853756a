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
limit down to which the fraction of samples that start descents tends to zero with growing N. For
the same reason a descent should end in the basin of its start. A descent whose output does not fall
all along the straight line from its start to its end is made again with a short first step.

Samples of a cut that lie in a narrower one are uniform there too and count for it. Optima of other
cuts, and descents from corners, raise W and improve the bound, but do not raise N.

Where kinks are expected, descents stall along them. A sample or a stall from which the output falls
all along the straight line to a better optimum is in the basin of that optimum, and is no optimum
itself.

Samples of one value lie on a plateau, from which no descent finds its way. The plateau counts as
one optimum, and its samples do not count as explored: its fraction of the cut stays uncovered.
Further samples lie far apart, so that few humps stay between them. With a thousand samples on
plateaus the search of a bound ends, and the bound is attained only. Where kinks are expected, a
plateau is where an input acts on nothing, and its samples count from a thousand on: what uniform
samples do not meet is then 0.1 % of the cut, as Bayes' rule tells, and less with samples far apart.
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
from alphacut.fuzzy.plans.settings import SEARCH, value_tolerance
from alphacut.fuzzy.sets.boxes import Domain

SEED = 0
"""Seed of all samples."""
MIN_SAMPLES = 100
"""Samples N of a cut from which the rule of Boender and Rinnooy Kan decides: with fewer samples the
uniform prior does. Twice as many double the cost of smooth outputs."""


def critical_distance(samples: int, inputs: int, sigma: float) -> float:
    """Return the critical distance r = (σ Γ(1 + d/2) ln N / N)^(1/d) / √π in the unit cube.

    A ball of radius r contains σ ln N of the samples on average (Rinnooy Kan and Timmer, 1987).

    Args:
        samples: N.
        inputs: Dimension d of the cube.
        sigma: σ.
    """
    ball = sigma * gamma(1 + inputs / 2) * log(samples) / samples
    return float(ball ** (1 / inputs) / sqrt(pi))


def rows_without_better_neighbour(unit: Array, values: Array, distance: float) -> Ints:
    """Return the rows of the samples that have no better sample within a distance.

    Args:
        unit: Samples in unit coordinates, shape (n, inputs).
        values: Their values, shape (n,); the smaller of two is the better.
        distance: The distance in unit coordinates.
    """
    from scipy.spatial import cKDTree

    # Of two neighbours the worse one is left out. Of equal ones both stay.
    pairs = cKDTree(unit).query_pairs(distance, output_type="ndarray")
    first_rows = pairs[:, 0]
    second_rows = pairs[:, 1]
    worse_rows = np.concatenate(
        [
            first_rows[values[first_rows] > values[second_rows]],
            second_rows[values[second_rows] > values[first_rows]],
        ]
    )
    return np.setdiff1d(np.arange(len(values)), worse_rows)


def with_farthest_points(unit: Array, known: Array, rng: np.random.Generator) -> Array:
    """Draw up to 1,000 of some points of the unit cube anew, so that they lie far apart.

    Each new point is, of random candidates, the one farthest from the known points and the points
    before it (Mitchell 1991). Of holes that take 0.3 % of a cube these points leave 75 times fewer
    than uniform points in three dimensions, and half as many in six.

    Args:
        unit: Uniform points, shape (n, inputs).
        known: Points that exist already, shape (m, inputs).
        rng: Source of the candidates.

    Returns:
        Points of shape (n, inputs), the drawn ones last.
    """
    from scipy.spatial import cKDTree

    # With more candidates for a point the time grows, and points crowd the faces of the cube.
    candidates_per_point = 10
    count = min(len(unit), SEARCH.max_on_plateaus)
    farthest = unit[:count].copy()
    uniform = unit[count:]
    candidates = rng.random((candidates_per_point * count, unit.shape[1]))
    distance, _ = cKDTree(np.concatenate([known, uniform])).query(candidates)
    distance_squared = distance**2
    for row in range(count):
        farthest[row] = candidates[distance_squared.argmax()]
        offset = candidates - farthest[row]
        new_distance_squared = np.einsum("nd,nd->n", offset, offset)
        np.minimum(distance_squared, new_distance_squared, out=distance_squared)
    return np.concatenate([uniform, farthest])


def samples_on_plateaus(values: Array) -> Mask:
    """Return which samples have the value of another sample, to rounding, shape (n,)."""
    order = np.argsort(values)
    is_equal_to_next = np.diff(values[order]) <= _tie_tolerance(values)
    is_tied = np.zeros(len(values), bool)
    is_tied[order] = np.append(is_equal_to_next, False) | np.append(False, is_equal_to_next)
    return is_tied


def _tie_tolerance(values: Array) -> float:
    """Return the difference below which two of the values count as equal."""
    return float(SEARCH.tie * np.abs(values).max(initial=0.0))


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
        if self.has_kinks and self.plateau_samples >= SEARCH.max_on_plateaus:
            return self.samples + self.plateau_samples
        return self.samples

    @property
    def uncovered(self) -> float:
        """Expected fraction of the cut that is not yet covered by basins and known plateaus.

        It is infinite without an optimum, or with fewer than two samples.
        """
        explored = self.explored
        n_optima = len(self.optima)
        if explored < 2 or n_optima == 0:
            return inf
        total = self.samples + self.plateau_samples
        unknown_plateaus = (total - explored) / total
        # Boender and Rinnooy Kan (1987)
        unseen_basins = n_optima * (n_optima + 1) / (explored * (explored - 1))
        return unknown_plateaus + unseen_basins

    @property
    def is_smooth(self) -> bool:
        """Whether the output is smooth at the best optimum, so that the descent did not stall."""
        return bool(self.optima) and (self.has_kinks or self.best.is_smooth)

    def n_optima_off_corners(self, cut: CutSearch) -> int:
        """Return the number of optima that are no corner of the cut."""
        lower = cut.lower + cut.near
        upper = cut.upper - cut.near
        at_ends = [(x.point <= lower) | (x.point >= upper) for x in self.optima]
        return sum(not ends.all() for ends in at_ends)

    @property
    def is_estimate(self) -> bool:
        """Whether the stopping rule is met and the output is smooth at the best optimum."""
        is_covered = self.uncovered < SEARCH.max_uncovered
        return self.explored >= MIN_SAMPLES and is_covered and self.is_smooth

    @property
    def is_open(self) -> bool:
        """Whether the search goes on; kinks and jumps at the best optimum end it, too."""
        if self.plateau_samples >= SEARCH.max_on_plateaus:
            return False
        if self.samples < MIN_SAMPLES or not self.optima:
            return True
        return self.uncovered >= SEARCH.max_uncovered and self.is_smooth

    def next_samples(self) -> int:
        """Return the number of samples, in all, with which the search may end if W stays.

        These are the samples with which W (W + 1) / (N (N − 1)) falls to `max_uncovered`, or with
        plateaus so many that `max_on_plateaus` of them lie there. The number is at most twice the
        present one, and at least 15 more, so that rounds do not become small.
        """
        n_optima = len(self.optima)
        present = self.samples + self.plateau_samples
        if self.plateau_samples:
            # With the present fraction of samples on plateaus, and 1 % more so that they suffice
            needed = ceil(1.01 * SEARCH.max_on_plateaus * present / self.plateau_samples)
        else:  # the positive root N of N (N − 1) = W (W + 1) / fraction
            product_needed = n_optima * (n_optima + 1) / SEARCH.max_uncovered
            needed = ceil(0.5 + sqrt(0.25 + product_needed)) + 1
        return max(MIN_SAMPLES, min(max(needed, present + 15), 2 * present))


class SingleLinkage:
    """Search of the bounds of some outputs in all cuts of a domain.

    Args:
        campaign: Evaluates the model.
        domain: Inputs and levels.
        outputs: Names of the outputs that are searched.
        has_kinks: Whether the outputs are expected to have kinks.

    Attributes:
        cuts: Cuts that have a width, from the widest on.
        bounds: Bounds that are searched.
        states: State of each bound by the level of its cut.
    """

    def __init__(
        self, campaign: Campaign, domain: Domain, outputs: tuple[str, ...], has_kinks: bool = False
    ) -> None:
        self.campaign = campaign
        self.outputs = outputs
        self.has_kinks = has_kinks
        self.cuts = list(cuts_with_width(campaign, domain))[::-1]
        self.bounds = [Bound(output, sign) for output, sign in product(outputs, (1.0, -1.0))]
        self.states = {
            (cut.level, bound): BoundSearch(has_kinks=has_kinks)
            for cut, bound in product(self.cuts, self.bounds)
        }
        # Uniform samples of all cuts, their values, and the level in whose cut each was drawn
        self._points: Array = np.empty((0, len(domain.names)))
        self._values: dict[Bound, Array] = {bound: np.empty(0) for bound in self.bounds}
        self._levels: Ints = np.empty(0, int)

    def run(self, first: Array) -> None:
        """Sample and descend, cut by cut in rounds, until every bound meets the stopping rule.

        Without outputs to search each cut gets `MIN_SAMPLES` samples and no descents.

        Args:
            first: Uniform samples of the widest cut in unit coordinates, shape (n, uncertain
                inputs).

        Raises:
            SpentError: The budget ended the search.
        """
        if not self.outputs:
            for cut in self.cuts:
                self._sample_up_to(cut, MIN_SAMPLES, seed=0, bounds=())
            return
        self._add_samples(self.cuts[0], first)
        self.search()

    def search(self) -> None:
        """Go on until every bound meets the stopping rule, as after optima found elsewhere.

        Raises:
            SpentError: The budget ended the search.
        """
        rounds = 0
        while True:
            open_bounds = [(cut, self._open_bounds(cut)) for cut in self.cuts]
            visits = [(cut, bounds) for cut, bounds in open_bounds if bounds]
            if not visits:
                return
            rounds += 1
            for number, (cut, bounds) in enumerate(visits, start=1):
                states = [self.states[cut.level, bound] for bound in bounds]
                count = max(state.next_samples() for state in states)
                self._sample_up_to(cut, count, seed=rounds, bounds=bounds)
                for bound in bounds:
                    self._descend(cut, bound)
                # How many rounds follow is not known: the first counts for four fifths of the work.
                self.campaign.report(1 - (1 - 0.8 * number / len(visits)) / rounds)

    def _states_of(self, output: str) -> list[BoundSearch]:
        """Return the states of both bounds of an output in all cuts."""
        return [state for (_, bound), state in self.states.items() if bound.output == output]

    def is_estimate(self, output: str) -> bool:
        """Return whether both bounds of an output meet the stopping rule in all cuts."""
        states = self._states_of(output)
        return bool(states) and all(state.is_estimate for state in states)

    def is_rough(self, output: str) -> bool:
        """Return whether the best optimum of a bound of the output is at a kink or jump."""
        return any(state.optima and not state.is_smooth for state in self._states_of(output))

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
                if self._has_wave_beside(cut, bound, best, column=column, side=side):
                    return True
        return False

    def _has_wave_beside(
        self, cut: CutSearch, bound: Bound, best: Array, *, column: int, side: float
    ) -> bool:
        """Return whether the output improves beside an optimum where no smooth optimum is found.

        Optima that are found are recorded.

        Args:
            cut: The cut.
            bound: Output and sign.
            best: Best optimum of the bound, in unit coordinates, shape (uncertain inputs,).
            column: Column of the unit coordinate that is changed.
            side: Whether it grows (1) or falls (−1).
        """
        # Distances at which waves are looked for. The largest is a critical distance, of which 100
        # samples of one to three inputs have 0.1 to 0.35. Tuned: 15 of 400 trends with waves beside
        # them are estimated wrongly without this look, and 1 with it.
        distances = np.append(0.0, np.geomspace(1e-4, 0.2, 12))
        line = np.repeat(best[None], len(distances), axis=0)
        line[:, column] += side * distances
        line = line[(line[:, column] >= 0) & (line[:, column] <= 1)]
        changes = np.diff(cut.values(line, bound))
        improved = np.flatnonzero(changes < -self._tolerance(bound))
        if not len(improved):
            return False
        start = line[improved[0] + 1]
        first_step = np.abs(start - best).max() / 2
        optimum = cut.descend(start, bound, first_step)
        self._record(optimum)
        distance = np.abs(cut.unit(optimum.point[None])[0] - best).max()
        return bool(distance < distances[1]) or not optimum.is_smooth

    def summary(self) -> str:
        """Return a sentence on the bound with the largest uncovered fraction of its cut."""
        worst = max(self.states.values(), key=lambda state: state.uncovered)
        note = f"W = {len(worst.optima)} optima found from N = {worst.samples} samples"
        if worst.plateau_samples:
            note += f" beside {worst.plateau_samples} on plateaus"
        return f"{note}: of each cut {min(worst.uncovered, 1):.3%} or less is not yet covered"

    def _open_bounds(self, cut: CutSearch) -> list[Bound]:
        """Return the bounds of a cut whose search goes on.

        Before, a descent starts from the best sample of the cut, of whatever origin, wherever it is
        better than the best optimum.
        """
        for bound in self.bounds:
            state = self.states[cut.level, bound]
            if not state.optima:
                continue
            samples = self.campaign.samples
            inside = cut.contains(samples.points)
            values = bound.sign * samples.values.array[inside, samples.values.column(bound.output)]
            best = int(values.argmin())
            if values[best] < state.best.value - self._tolerance(bound):
                start = cut.unit(samples.points[inside][best][None])[0]
                self._descend_from(cut, bound, start)
        return [bound for bound in self.bounds if self.states[cut.level, bound].is_open]

    def _descend(self, cut: CutSearch, bound: Bound) -> None:
        """Descend from the samples and corners of a cut that have no better one nearby.

        Nearby is the critical distance with σ = 4; from two optima that are no corners on, also the
        smaller one with σ = 2, which starts more descents and hides fewer basins. Descents that
        have been made before are not repeated. The counts of the bound's state are updated.
        """
        state = self.states[cut.level, bound]
        rows = self._rows(cut)
        unit = np.concatenate([cut.unit(self._points[rows]), cut.corners])
        # Descents are remembered by the rows of the samples, and of corners by negative numbers.
        keys = [int(row) for row in np.append(rows, np.arange(-len(cut.corners), 0))]
        sample_values = self._values[bound][rows]
        values = np.append(sample_values, cut.values(cut.corners, bound))
        no_corner = np.zeros(len(cut.corners), bool)
        is_tied = np.append(samples_on_plateaus(sample_values), no_corner)
        tolerance = _tie_tolerance(values)
        for sigma in (4.0, 2.0):
            if sigma == 2.0 and state.n_optima_off_corners(cut) < 2:
                continue
            distance = critical_distance(len(rows), len(cut.uncertain_inputs), sigma)
            for start in rows_without_better_neighbour(unit, values, distance):
                # One descent for each plateau: it goes nowhere, but counts as the optimum of its
                # value.
                if is_tied[start]:
                    value = float(values[start])
                    if any(abs(value - plateau) <= tolerance for plateau in state.plateaus):
                        continue
                    state.plateaus.append(value)
                if keys[start] not in state.started:
                    state.started.add(keys[start])
                    self._descend_from(cut, bound, unit[start])
        state.plateau_samples = int(is_tied.sum())
        state.samples = len(rows) - state.plateau_samples  # corners do not count

    def _descend_from(self, cut: CutSearch, bound: Bound, start: Array) -> None:
        """Descend from a point and record the optimum.

        A descent that may have left the basin of its start is followed by one with a short first
        step. Where kinks are expected, none starts in the basin of an optimum that is known.

        Args:
            cut: The cut.
            bound: Output and sign.
            start: Unit coordinates, shape (uncertain inputs,).
        """
        if self.has_kinks and self._falls(cut, start, self.states[cut.level, bound].optima):
            return
        optimum = cut.descend(start, bound)
        self._record(optimum)
        # A hump on the straight line says that the descent has passed from one basin to another.
        step = cut.unit(optimum.point[None])[0] - start
        if np.abs(step).max() <= SEARCH.careful_first_step:
            return
        line = start + np.array([0.0, 0.25, 0.5, 0.75])[:, None] * step
        values = np.append(cut.values(line, bound), optimum.value)
        if (np.diff(values) > self._tolerance(bound)).any():
            self._record(cut.descend(start, bound, SEARCH.careful_first_step))

    def _record(self, optimum: Optimum) -> None:
        """Add an optimum to every cut of which it is one; the better of two equal ones stays."""
        for cut in self.cuts:
            if not optimum.is_optimum_of(cut):
                continue
            optima = self.states[cut.level, optimum.bound].optima
            index = self._index_of_equal(cut, optimum)
            if index is None:
                optima.append(optimum)
            elif optimum.value < optima[index].value:
                optima[index] = optimum
            if self.has_kinks:
                # A new optimum may show that an earlier one was a stall.
                optima[:] = [x for x in optima if not self._is_stall(cut, x, optima)]

    def _is_stall(self, cut: CutSearch, optimum: Optimum, optima: Sequence[Optimum]) -> bool:
        """Return whether the output falls along a line to an optimum of smaller value."""
        better = [x for x in optima if x.value < optimum.value]
        return self._falls(cut, cut.unit(optimum.point[None])[0], better)

    def _falls(self, cut: CutSearch, start: Array, optima: Sequence[Optimum]) -> bool:
        """Return whether the output falls all along a line to one of some optima of one bound.

        Args:
            cut: The cut.
            start: Unit coordinates where the lines begin, shape (uncertain inputs,).
            optima: The optima; without any the answer is False.
        """
        if not optima:
            return False
        # Kinks where a descent stalls are near its end, and so are most of the points.
        fractions = np.array([0.0, 0.02, 0.1, 0.25, 0.5, 0.75])
        steps = cut.unit(np.stack([x.point for x in optima])) - start
        points = (start + fractions[:, None, None] * steps).reshape(-1, len(start))
        values = cut.values(points, optima[0].bound).reshape(len(fractions), -1)
        end_values = [x.value for x in optima]
        changes = np.diff(np.vstack([values, end_values]), axis=0)
        return bool((changes <= 0).all(axis=0).any())

    def _index_of_equal(self, cut: CutSearch, optimum: Optimum) -> int | None:
        """Return the index of an equal optimum in the list of a cut; None if there is none.

        Optima of nearly one value are equal if they are within 1 % of the width of the cut, or if
        no value between them is larger: a valley is where many descents end, and symmetric hills
        are several optima.
        """
        optima = self.states[cut.level, optimum.bound].optima
        tolerance = self._tolerance(optimum.bound)
        alike = [k for k, x in enumerate(optima) if abs(x.value - optimum.value) <= tolerance]
        unit = cut.unit(optimum.point[None])[0]
        steps = {k: cut.unit(optima[k].point[None])[0] - unit for k in alike}
        for index, step in steps.items():
            if np.abs(step).max() <= 0.01:
                return index
        for index, step in steps.items():
            line = unit + np.array([0.25, 0.5, 0.75])[:, None] * step
            larger = max(optimum.value, optima[index].value)
            if (cut.values(line, optimum.bound) <= larger + tolerance).all():
                return index
        return None

    def _tolerance(self, bound: Bound) -> float:
        """Return the difference below which two values of the output count as one."""
        values = self._values[bound]
        return value_tolerance(float(np.ptp(values)), float(np.abs(values).max()))

    def _rows(self, cut: CutSearch) -> Ints:
        """Return the rows of the samples that are uniform in a cut: its own and of wider cuts."""
        return np.flatnonzero((self._levels <= cut.level) & cut.contains(self._points))

    def _sample_up_to(
        self, cut: CutSearch, count: int, *, seed: int, bounds: Sequence[Bound]
    ) -> None:
        """Evaluate samples of a cut until there are `count`; the seed differs from call to call.

        Where all bounds have plateaus, further samples lie far apart. The stopping rule is for
        uniform samples, but it is never met where plateaus are large.
        """
        rows = self._rows(cut)
        missing = count - len(rows)
        if missing <= 0:
            return
        # The seed of each cut and round is its own, so that samples do not depend on the other
        # cuts.
        rng = np.random.default_rng([SEED, 1 + cut.level, seed])
        unit = rng.random((missing, len(cut.uncertain_inputs)))
        states = [self.states[cut.level, bound] for bound in bounds]
        if states and all(state.plateau_samples for state in states):
            unit = with_farthest_points(unit, cut.unit(self._points[rows]), rng)
        self._add_samples(cut, unit)

    def _add_samples(self, cut: CutSearch, unit: Array) -> None:
        """Evaluate uniform samples of a cut, shape (n, uncertain inputs), and append them."""
        points = cut.points(unit)
        outputs = self.campaign(points)
        for bound, values in self._values.items():
            added = bound.sign * outputs.array[:, outputs.column(bound.output)]
            self._values[bound] = np.concatenate([values, added])
        self._points = np.concatenate([self._points, points])
        self._levels = np.concatenate([self._levels, np.full(len(points), cut.level)])
