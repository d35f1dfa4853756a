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


def critical_distance(samples: int, inputs: int, sigma: float) -> float:
    """Return the distance r = (σ Γ(1 + d/2) ln N / N)^(1/d) / √π in the unit cube.

    Of N uniform samples a ball of radius r inside the cube contains σ ln N on average. In
    multi-level single linkage it is the critical distance: a descent starts from a sample only if
    no better one lies within it (Rinnooy Kan and Timmer, 1987).

    Args:
        samples: Number of samples N, 1 or more; for one sample r is 0.
        inputs: Dimension d of the cube, 1 or more.
        sigma: The factor σ.
    """
    # The ball's volume is π^(d/2) r^d / Γ(1 + d/2). It shall be σ ln N / N; the cube's volume is 1.
    ball = sigma * gamma(1 + inputs / 2) * log(samples) / samples
    return float(ball ** (1 / inputs) / sqrt(pi))


def rows_without_better_neighbour(unit: Array, values: Array, distance: float) -> Ints:
    """Return the rows, rising, of the samples that have no better sample within a distance.

    Args:
        unit: Samples in unit coordinates, shape (n, inputs), n ≥ 1.
        values: Their values, shape (n,); the smaller of two is the better. Equal ones both stay.
        distance: The Euclidean distance in unit coordinates, up to which samples are neighbours.
    """
    from scipy.spatial import cKDTree

    # Of two neighbours the worse one is left out.
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

    Each new point is, of random candidates, the one farthest from all other points: the known ones,
    those that stay, and the new ones before it (Mitchell 1991). Such points miss fewer regions that
    take 0.3 % of the cube than uniform points do: 75 times fewer in three dimensions, half as many
    in six.

    Args:
        unit: Uniform points of [0, 1)^d, shape (n, d), n ≥ 1; not changed. The first 1,000, or all
            of fewer, are drawn anew.
        known: Points that exist already, shape (m, d).
        rng: Source of the candidates, ten for each new point.

    Returns:
        Points of shape (n, d): those that stay, in their order, and then the drawn ones.
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
        """Expected fraction of the cut that lies in basins of optima that were not seen yet.

        With W different local optima, found by descents from N uniform samples, it is
        W (W + 1) / (N (N − 1)) (Boender and Rinnooy Kan, 1987). N is the number of `explored`
        samples: those off plateaus (many samples of one value, from which descents find no way),
        and where kinks are expected also those on plateaus if they are 1,000 or more. The fraction
        of all samples that are not explored is added. The result is infinite without an optimum, or
        with fewer than two explored samples.
        """
        explored = self.explored
        n_optima = len(self.optima)
        if explored < 2 or n_optima == 0:
            return inf
        total = self.samples + self.plateau_samples
        unknown_plateaus = (total - explored) / total
        # The expectation of the a-posteriori distribution, from a uniform prior of the number of
        # basins and of their sizes.
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
        return self.explored >= SEARCH.min_samples and is_covered and self.is_smooth

    @property
    def is_open(self) -> bool:
        """Whether the search goes on; kinks and jumps at the best optimum end it, too."""
        if self.plateau_samples >= SEARCH.max_on_plateaus:
            return False
        if self.samples < SEARCH.min_samples or not self.optima:
            return True
        return self.uncovered >= SEARCH.max_uncovered and self.is_smooth

    def next_samples(self) -> int:
        """Return the number of samples of the cut, in all, with which its search may end.

        It may end when the expected fraction of the cut in unseen basins, W (W + 1) / (N (N − 1))
        for W different local optima and N samples, has fallen to 0.002. So N is computed for the
        present W. If some samples lie on plateaus (have the value of another sample), it may end
        when 1,000 do, and N follows from the present fraction of such samples. The result is at
        least 15 more than the present number and at most twice that number, but never below 100.
        """
        n_optima = len(self.optima)
        present = self.samples + self.plateau_samples
        if self.plateau_samples:
            # With the present fraction of samples on plateaus, and 1 % more so that they suffice
            # although a further sample meets plateaus by chance.
            needed = ceil(1.01 * SEARCH.max_on_plateaus * present / self.plateau_samples)
        else:  # the positive root N of N (N − 1) = W (W + 1) / fraction
            product_needed = n_optima * (n_optima + 1) / SEARCH.max_uncovered
            needed = ceil(0.5 + sqrt(0.25 + product_needed)) + 1
        return max(SEARCH.min_samples, min(max(needed, present + 15), 2 * present))


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
        """Search the minimum and the maximum of all outputs in all cuts, from some first samples.

        Each cut is sampled, and descents start from the best samples, in rounds. The search of a
        bound ends when the expected fraction of the cut in basins that were not seen is below 0.002
        (Boender and Rinnooy Kan, 1987). It is given up if the best optimum lies at a kink or jump
        (unless kinks are expected, `has_kinks`), or if 1,000 samples lie on plateaus, with the
        value of another sample. If `outputs` is empty, each cut gets 100 samples and no descents.
        Results are in `states`, and all samples in the campaign.

        Args:
            first: Uniform samples of the widest cut in unit coordinates (0 at the lower, 1 at the
                upper end of an input's cut), shape (n, inputs with a width).

        Raises:
            SpentError: The budget ended the search; what was found so far is kept.
            CampaignError: The model failed at some samples.
        """
        if not self.outputs:
            for cut in self.cuts:
                self._sample_up_to(cut, SEARCH.min_samples, seed=0, bounds=())
            return
        self._add_samples(self.cuts[0], first)
        self.search()

    def search(self) -> None:
        """Sample and descend until no bound of an output is open in any cut.

        With 100 samples and an optimum a bound is closed in a cut if the expected fraction of the
        cut in basins that were not seen is below 0.002, or if the best optimum lies at a kink or
        jump (unless kinks are expected, `has_kinks`). With 1,000 samples on plateaus it is closed,
        too. Each round visits the cuts with open bounds from the widest on, adds samples, and
        descends. The search may be called again after optima have been recorded by other means.
        Progress is reported to the campaign.

        Raises:
            SpentError: The budget ended the search; what was found so far is kept in `states`.
            CampaignError: The model failed at some samples.
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
        """Return whether descents to the best optima of an output pass over jumps or waves.

        An output whose search is complete is evaluated along each input, to both sides of the best
        optimum of its minimum and its maximum, in each cut. Where it improves again, away from the
        optimum, a descent should find a smooth optimum of its own; if it does not, the result is
        True. First of all, `_leave_stalls` goes on from optima at kinks, where descents may have
        stalled. Optima that are found are recorded, so that the search may have to go on. For an
        output whose search is not complete, nothing is evaluated and the result is False.

        Args:
            output: Name of an output.

        Raises:
            SpentError: The budget does not carry the evaluations.
            CampaignError: The model failed at some points.
        """
        for cut, bound in product(self.cuts, self.bounds):
            if bound.output == output and self.is_estimate(output):
                self._leave_stalls(cut, bound)
        # The search has started no descent there, since the best optimum is nearby. Only nearby can
        # a wave lead to a better value: farther away the trend changes the output by more than the
        # wave does.
        for cut, bound, side in product(self.cuts, self.bounds, (-1.0, 1.0)):
            # A recorded optimum may open the search again, hence the question in the loop.
            if bound.output != output or not self.is_estimate(output):
                continue
            best = cut.unit(self.states[cut.level, bound].best.point[None])[0]
            for column in range(len(best)):
                if self._has_wave_beside(cut, bound, best, column=column, side=side):
                    return True
        return False

    def _leave_stalls(self, cut: CutSearch, bound: Bound) -> None:
        """Go on from optima at kinks and jumps, by one input after another.

        Along a kink of one input a descent stalls although another input still lowers the value,
        perhaps to below the best optimum, which is smooth. Each input in turn is set to the best of
        nine places in its cut. If the value has then improved by more than the tolerance, a descent
        starts, and its end is recorded.

        Args:
            cut: The α-cut.
            bound: Name of the output, and the sign (1 for its minimum, −1 for its maximum).

        Raises:
            SpentError: The budget does not carry the evaluations.
            CampaignError: The model failed at some points.
        """
        places = np.linspace(0.0, 1.0, 9)
        for optimum in tuple(self.states[cut.level, bound].optima):
            if optimum.is_smooth:
                continue
            start = cut.unit(optimum.point[None])[0]
            value = optimum.value
            for column in range(len(start)):
                line = np.repeat(start[None], len(places), axis=0)
                line[:, column] = places
                values = cut.values(line, bound)
                best = int(values.argmin())
                if values[best] < value:
                    start = line[best]
                    value = float(values[best])
            if value < optimum.value - self._tolerance(bound):
                self._record(cut.descend(start, bound, SEARCH.careful_first_step))

    def _has_wave_beside(
        self, cut: CutSearch, bound: Bound, best: Array, *, column: int, side: float
    ) -> bool:
        """Return whether an output improves beside an optimum where no smooth optimum is found.

        Sign · output is evaluated at growing distances from the optimum along one input, up to 0.2
        of its cut. Where it falls from one distance to the next, a descent starts; its optimum is
        recorded. There is a wave if the descent falls back to the old optimum, or ends at a kink or
        jump.

        Args:
            cut: The α-cut.
            bound: Name of the output, and the sign (1 for its minimum, −1 for its maximum).
            best: Best optimum of the bound, in unit coordinates, shape (inputs with a width,).
            column: Column of the unit coordinate that is changed.
            side: Whether it grows (1) or falls (−1).

        Raises:
            SpentError: The budget does not carry the evaluations.
            CampaignError: The model failed at some points.
        """
        # Distances at which waves are looked for. The largest is about the critical distance of
        # single linkage: 0.1 to 0.35 for 100 samples of one to three inputs. They are tuned: 15 of
        # 400 trends with waves beside them are estimated wrongly without this look, and 1 with it.
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
        """Return the bounds (output, and sign of minimum or maximum) whose search in a cut goes on.

        First the best sample of the campaign in the cut is compared with the best optimum of each
        bound. If it is better by more than the tolerance of values, a descent starts from it, and
        its optimum is recorded. A search goes on until its stopping rule holds (100 samples, and an
        expected fraction of unseen basins below 0.002), or it is given up at a kink, a jump or on
        plateaus. Where kinks are expected (`has_kinks`), they do not end it.

        Raises:
            SpentError: The budget does not carry the evaluations.
            CampaignError: The model failed at some points.
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

        Nearby means within the critical distance of single linkage: a ball of this radius has
        σ ln N of N samples on average, with σ = 4. If two or more optima are no corners of the cut,
        σ = 2 follows, which starts more descents and hides fewer basins. A plateau consists of
        samples of one value, of which only one starts a descent.

        The state of the bound in the cut is changed: the optima found, the starts and plateaus from
        which a descent was made (none is repeated), and the numbers of samples on plateaus and off
        them.

        Args:
            cut: The α-cut, of which samples have been evaluated.
            bound: Name of the output, and the sign (1 for its minimum, −1 for its maximum).

        Raises:
            SpentError: The budget does not carry the evaluations.
            CampaignError: The model failed at some points.
        """
        state = self.states[cut.level, bound]
        rows = self._uniform_rows(cut)
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
        """Descend from a point and record the optimum in all cuts of which it is one.

        If the output does not fall all along the straight line from the start to the optimum, the
        descent may have left the basin of its start; then a second one follows with a first step of
        at most 0.1. Where kinks are expected (`has_kinks`), no descent starts from a point from
        which the output falls all along the line to a known optimum.

        Args:
            cut: The α-cut.
            bound: Name of the output, and the sign by which it is multiplied before it is minimised
                (1 for its minimum, −1 for its maximum).
            start: Unit coordinates, shape (inputs with a width,).

        Raises:
            SpentError: The budget does not carry the evaluations.
            CampaignError: The model failed at some points.
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
        """Add an optimum to the list of its bound in every cut in which it is a local optimum.

        Of two optima of a list that count as one (nearly equal values, and near to each other or
        with no hump between them), the better one stays. Where kinks are expected (`has_kinks`),
        optima from which the output falls all along the straight line to a better one leave the
        list: descents have stalled there.

        Args:
            optimum: End of a descent; it knows its cut, and the output and sign that were
                minimised.

        Raises:
            SpentError: The budget does not carry the evaluations between two optima.
            CampaignError: The model failed at some points.
        """
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
        """Return whether sign · output never rises along a straight line to one of some optima.

        One such line is enough. Each is evaluated at six points, from its start to 0.75 of its
        length.

        Args:
            cut: The α-cut.
            start: Unit coordinates where the lines begin, shape (inputs with a width,).
            optima: Optima of one output and sign; without any the answer is False.

        Raises:
            SpentError: The budget does not carry the evaluations.
            CampaignError: The model failed at some points.
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

        The values of equal optima differ by no more than the tolerance (1e-5 of the range of the
        output plus 1e-9 of its magnitude). Besides, their inputs differ by up to 1 % of the width
        of the cut, or no larger value is found at three points between them. So all ends of
        descents in one flat valley count as one optimum, and the bottoms of two valleys as two.

        Args:
            cut: The α-cut whose list is searched.
            optimum: An optimum of the output and sign of that list, perhaps found in another cut.

        Raises:
            SpentError: The budget does not carry the evaluations.
            CampaignError: The model failed at some points.
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

    def _uniform_rows(self, cut: CutSearch) -> Ints:
        """Return the rows of the samples that are uniform in a cut: its own and of wider cuts."""
        return np.flatnonzero((self._levels <= cut.level) & cut.contains(self._points))

    def _sample_up_to(
        self, cut: CutSearch, count: int, *, seed: int, bounds: Sequence[Bound]
    ) -> None:
        """Evaluate uniform random samples of a cut until there are `count` of them.

        Samples of wider cuts that lie in the cut count, since they are uniform there, too. If all
        of the bounds have samples on plateaus (several of one value), up to 1,000 of the new ones
        are placed far apart instead, to find narrow hills between them.

        Args:
            cut: The α-cut.
            count: Number of samples; nothing is done if there are as many.
            seed: Number of the round, which must differ from call to call for a cut; otherwise the
                same points are drawn.
            bounds: Bounds (output, and sign of minimum or maximum) that are searched further.

        Raises:
            SpentError: The budget does not carry the evaluations; then none is made.
            CampaignError: The model failed at some points.
        """
        # The stopping rule of the search is for uniform samples. That further ones lie far apart
        # does no harm, since the rule is never met where plateaus are large.
        rows = self._uniform_rows(cut)
        missing = count - len(rows)
        if missing <= 0:
            return
        # The seed of each cut and round is its own, so that samples do not depend on the other
        # cuts.
        rng = np.random.default_rng([SEARCH.seed, 1 + cut.level, seed])
        unit = rng.random((missing, len(cut.uncertain_inputs)))
        states = [self.states[cut.level, bound] for bound in bounds]
        if states and all(state.plateau_samples for state in states):
            unit = with_farthest_points(unit, cut.unit(self._points[rows]), rng)
        self._add_samples(cut, unit)

    def _add_samples(self, cut: CutSearch, unit: Array) -> None:
        """Evaluate new samples of a cut, and append them to those of the search.

        Appended are the inputs to `_points`, shape (samples, inputs), the index of the cut's level
        to `_levels`, shape (samples,), and sign · output to `_values` for each bound (output, and
        sign of minimum or maximum), shape (samples,).

        Args:
            cut: The α-cut in which the samples were drawn uniformly.
            unit: Their unit coordinates, shape (n, inputs with a width).

        Raises:
            SpentError: The budget does not carry the evaluations; then nothing is appended.
            CampaignError: The model failed at some samples; nothing is appended either.
        """
        points = cut.points(unit)
        outputs = self.campaign(points)
        for bound, values in self._values.items():
            added = bound.sign * outputs.array[:, outputs.column(bound.output)]
            self._values[bound] = np.concatenate([values, added])
        self._points = np.concatenate([self._points, points])
        self._levels = np.concatenate([self._levels, np.full(len(points), cut.level)])
