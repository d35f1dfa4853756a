"""Fragility: under which fraction of a suite of records a limit is exceeded, over their intensity.

Let m be the intensity measure of a record as it is. The response of a linear structure that starts
at rest and is moved by the record alone is proportional to the record. A structure with the inputs
p therefore reaches the limit L at the critical measure c(p) = m L / peak(p). Over an α-cut of the
inputs, c lies between m L over the largest peak and m L over the smallest peak of the cut, and both
peaks have guaranteed bounds and attained values. The peak of a frame that yields is not
proportional to the record; the limit is then exceeded on a set of measures, which is found by
incremental dynamic analysis (`incremental`). α is a level of possibility, not a probability, and is
never multiplied by one.

A case reaches `FragilityQuestion` as follows. `alphacut/case/generated.py` makes its section.
`alphacut/stages/suite.py` computes the peaks under each record (`record_peaks` of
`frame/analyses/suites.py`, `close_peaks` of `frame/analyses/peaks.py`),
`alphacut/stages/answers.py` passes them on, and `alphacut/report/results.py` prints three columns
of `Fragility.table`: limit, median of the sample, guarantee. Tables in files, with the lognormal
fit, are written by `alphacut/report/tables.py`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal, cast

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import checked_number, require, require_choice
from alphacut.base.number_text import STANDARD_GRAVITY, ShownUnit, engineering, range_text
from alphacut.base.progress_bar import Progress, nth_subprogress
from alphacut.base.quantity import Quantity
from alphacut.frame.analyses.answer import Answer, Record, Row, records_csv
from alphacut.frame.analyses.damage_states import (
    LognormalFit,
    fits_between,
    limits_of_states,
    lognormal_fit,
    pelicun_rows,
)
from alphacut.frame.analyses.incremental import (
    GRID_RATIO,
    RESOLUTION,
    IncrementalAnalysis,
    Increments,
    curve_rows,
)
from alphacut.frame.analyses.limits import (
    Limit,
    LimitResult,
    about_limit,
    limits_by_name,
    require_fragile,
    stated_units,
)
from alphacut.frame.analyses.peaks import Peak
from alphacut.frame.analyses.probability import CONFIDENCE, clopper_pearson
from alphacut.frame.analyses.question import Asked, Question
from alphacut.frame.analyses.suites import (
    MEASURES,
    nominal_mode,
    peaks_under,
    scaled_records,
)
from alphacut.frame.boxes import ALPHA, boxes
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.structures.linear import LinearSystem
from alphacut.frame.structures.model import StructureModel
from alphacut.frame.structures.storey import StoreyFrame, yields
from alphacut.fuzzy import Crisp, FuzzyNumber
from alphacut.fuzzy.result import Ends, Nature


@dataclass(frozen=True, eq=False)
class CriticalMeasures:
    """Intensity measures of records at which a limit is reached, as intervals on each level.

    All arrays have the shape (levels, records). A measure that is not known may be given as NaN,
    which becomes infinite.

    Args:
        low: No structure of the cut exceeds the limit below this measure.
        low_reached: A structure of the cut is known to exceed the limit above this measure.
        high_reached: A structure of the cut is known not to exceed the limit up to this measure.
        high: Every structure of the cut exceeds the limit above this measure; infinite if the
            smallest peak may be zero.
        crossed: Every structure of the cut has exceeded the limit at this measure or below;
            `high` if it is not given. The range from `low` to it is that of the first crossings.
        largest: Largest measure that was tried; infinite for a linear structure.

    Raises:
        RefusedError: A measure is not positive, or an attained value lies outside its bounds.
    """

    low: Array
    low_reached: Array
    high_reached: Array
    high: Array
    crossed: Array | None = None
    largest: float = np.inf

    def __post_init__(self) -> None:
        """Make unknown measures infinite, and check that `low` ≤ reached ≤ `high` and `low` > 0.

        All have the shape (levels, records). No structure of a cut exceeds the limit below `low`,
        and all do above `high`. A structure is known to exceed it above `low_reached`, and one is
        known not to exceed it up to `high_reached`; either of these may be the larger one. NaN
        stands for an unknown measure.

        Raises:
            RefusedError: A measure is not positive, or an attained one lies outside its bounds by
                more than a relative rounding of 1e-9.
        """
        if self.crossed is None:
            object.__setattr__(self, "crossed", self.high)
        for end in ("low", "low_reached", "high_reached", "high", "crossed"):
            values = getattr(self, end)
            object.__setattr__(self, end, np.where(np.isnan(values), np.inf, values))
        if np.isnan(self.largest):
            object.__setattr__(self, "largest", np.inf)
        # Ends that agree but for rounding are accepted. They are checked because results are read
        # back from files, too.
        reached = np.stack([self.low_reached, self.high_reached])
        reached_with_rounding = reached * (1 + 1e-9)
        is_rising = (self.low <= reached_with_rounding) & (reached <= self.high * (1 + 1e-9))
        is_valid = bool((self.low > 0).all() and is_rising.all())
        require(is_valid, "critical measures", value="not rising", allowed="rising ends")

    @classmethod
    def from_peaks(
        cls, peaks: Sequence[Peak], measures: Sequence[float], limit: float
    ) -> CriticalMeasures:
        """Return the critical measures c = m L / peak of a linear structure.

        The response to a record of the measure m is proportional to the record, so that its peak
        reaches the limit L if the record is scaled to the measure c. Over an α-cut c lies between
        its values for the largest and for the smallest peak. A peak that may be 0, or a largest
        value that may be negative, never reaches the limit: its critical measure is infinite.

        Args:
            peaks: Bounds of the limited peak under each record, at least one.
            measures: Intensity measure m of each record, positive and scaled as the record was for
                its peak.
            limit: Limit L > 0 in SI units. If the peak is the smallest value of an output, it is
                the limit of the largest value of the output with its sign changed.

        Returns:
            Measures of shape (levels, records) each.

        Raises:
            RefusedError: The bounds of a peak contradict each other.
        """
        max_peaks = [peak.max_peak_bounds for peak in peaks]
        min_peaks = [peak.min_peak_bounds for peak in peaks]

        def critical(peak_bounds: list[Array]) -> Array:
            # Bounds on each level, one array for each record, give (levels, records).
            # A bound of a largest value may be negative: such a peak reaches no positive limit,
            # whatever the scale, and its critical measure is infinite.
            positive_peaks = np.maximum(np.stack(peak_bounds, axis=-1), 0.0)  # (levels, records)
            with np.errstate(divide="ignore"):
                return np.asarray(np.asarray(measures) * limit / positive_peaks)

        # A lower bound of a peak is an upper bound of its critical measure.
        high = critical([bounds.lower for bounds in min_peaks])
        # The largest peak of a cut is no smaller than its smallest peak.
        low_reached = np.minimum(critical([bounds.lower for bounds in max_peaks]), high)
        return cls(
            low=critical([bounds.upper for bounds in max_peaks]),
            low_reached=low_reached,
            high_reached=critical([bounds.upper for bounds in min_peaks]),
            high=high,
        )

    @classmethod
    def from_demands(cls, records: Sequence[Increments], name: str) -> CriticalMeasures:
        """Return the critical measures of a frame that yields, from the measures that were tried.

        The first crossing is the smallest measure at which some structure of the cut exceeds the
        limit. It lies between `low_reached`, the smallest one at which this was seen, and `low`,
        the measure tried before it. The last non-exceedance is the largest measure at which some
        structure keeps the limit. It lies between `high_reached`, the largest one at which this was
        seen, and `high`, the measure tried after it. A range without end is infinite.

        Args:
            records: Demands (peak over limit) under each record at rising measures, at least one.
                No structure exceeds the limit at the first measure.
            name: Name of the limit, or of the event that any of several limits is exceeded.

        Returns:
            Measures of shape (levels, records) each.

        Raises:
            KeyError: A record has no such limit or event.
        """
        of_records = []
        for record in records:
            by_some, by_all = record.is_exceeded(name)
            count = len(record.measure)
            measure_or_infinite = np.append(record.measure, np.inf)
            # `crossing` is the index of the first measure at which some structure exceeds the
            # limit, `count` if there is none. `after_last` is the index behind the last measure at
            # which some structure keeps it. argmax gives the first true entry of a mask.
            crossing = np.where(by_some.any(axis=1), by_some.argmax(axis=1), count)
            after_last = count - (~by_all)[:, ::-1].argmax(axis=1)
            # At the first measure at which all structures exceed it, each has its first crossing.
            crossed = np.where(by_all.any(axis=1), by_all.argmax(axis=1), count)
            ends = (
                record.measure[crossing - 1],
                measure_or_infinite[crossing],
                np.where(after_last == count, np.inf, record.measure[after_last - 1]),
                measure_or_infinite[after_last],
                measure_or_infinite[crossed],
            )
            of_records.append(ends)
        # All records are tried up to the same measure.
        ends_of_records = np.moveaxis(np.array(of_records), 0, -1)  # (ends, levels, records)
        low, low_reached, high_reached, high, crossed = ends_of_records
        largest = float(records[0].measure[-1])
        return cls(low, low_reached, high_reached, high, crossed, largest=largest)

    @classmethod
    def of_any(cls, limits: Sequence[CriticalMeasures]) -> CriticalMeasures:
        """Return the critical measures of the event that any of several limits is exceeded.

        The event is reached with the first limit, so that bounds are the smallest ones of all
        limits. `high_reached` is `low`: different structures may keep the limits up to more.

        Args:
            limits: Critical measures of each limit, for the same levels and records.
        """
        low = np.min([limit.low for limit in limits], axis=0)
        reached = np.min([limit.low_reached for limit in limits], axis=0)
        high = np.min([limit.high for limit in limits], axis=0)
        # Rounding may leave an attained measure above `high`, which is raised to it.
        return cls(low, reached, low, np.maximum(high, reached))

    def counts(self, measure: Array) -> Ends:
        """Return the number of records under which all, and under which some structures exceed.

        Args:
            measure: Intensity measures to which all records are scaled, shape (measures,).

        Returns:
            `lower`: number of records under which every structure of the cut exceeds the limit for
            certain; `upper`: number under which some structure may exceed it; shape (levels,
            measures) each.
        """
        # Comparisons of all records with all measures, shape (levels, records, measures).
        for_all = self.high[:, :, np.newaxis] < measure
        for_some = self.low[:, :, np.newaxis] < measure
        return Ends(for_all.sum(axis=1), for_some.sum(axis=1))

    @property
    def median(self) -> Ends:
        """Bounds of the sample median of the critical measures of a structure, (levels,) each.

        The median rises with each value of the sample.
        """
        return Ends(np.median(self.low, axis=1), np.median(self.high, axis=1))

    @property
    def first_crossings(self) -> Ends:
        """Bounds of the smallest measure at which a structure exceeds the limit, (levels, records).

        They are infinite where no structure, or not every structure, is known to exceed it up to
        the largest measure that was tried.
        """
        assert self.crossed is not None  # set at the start
        return Ends(np.where(self.low < self.largest, self.low, np.inf), self.crossed)

    def lognormal_range(self) -> tuple[Ends, Ends | None]:
        """Return ranges of median and dispersion of lognormal fits to the first crossings.

        On a level on which each structure is known to exceed the limit under all records, or of a
        linear structure, they are bounds for each structure of the cut, with the guarantee of the
        crossings. On other levels they are estimates, see `fits_between`.

        Returns:
            Ranges of the median and of the dispersion, shape (levels,) each; no dispersion of a
            single record.
        """
        low, high = self.first_crossings
        if low.shape[1] == 1:
            return Ends(low[:, 0], high[:, 0]), None
        median = Ends(np.exp(np.log(low).mean(axis=1)), np.exp(np.log(high).mean(axis=1)))
        dispersion = self._dispersion(low, high)
        is_censored = np.isinf(high).any(axis=1)
        if np.isfinite(self.largest) and is_censored.any():
            estimates = fits_between(low, high, self.largest)
            for ends, estimated in zip((median, dispersion), estimates, strict=True):
                ends.lower[is_censored] = estimated.lower[is_censored]
                ends.upper[is_censored] = estimated.upper[is_censored]
        return median, dispersion

    def fits(self, level: int) -> tuple[LognormalFit, LognormalFit]:
        """Return lognormal fits to the lower and to the upper ends of the first crossings."""
        low, high = self.first_crossings
        return lognormal_fit(low[level], self.largest), lognormal_fit(high[level], self.largest)

    @staticmethod
    def _dispersion(low: Array, high: Array) -> Ends:
        """Bounds of the standard deviation of the logarithms of measures over the records.

        They hold for each structure of the α-cut, shape (levels,) each. On a level with an
        infinite measure they are 0 and +∞.

        Args:
            low: Lower ends of the measures, shape (levels, records), two records or more.
            high: Upper ends.
        """
        n_records = low.shape[1]
        low = np.log(low)
        high = np.log(high)
        # Let x be the logarithms, z the midpoints of their intervals and r the radii. The standard
        # deviation is the norm of x minus its mean over √(n - 1). Subtracting the mean is a
        # projection, which lengthens no vector, so that the standard deviations of x and z differ
        # by at most |x - z| / √(n - 1) ≤ |r| / √(n - 1). Without a finite end nothing is known.
        with np.errstate(invalid="ignore"):
            deviation = ((low + high) / 2).std(axis=1, ddof=1)
            distance = np.linalg.norm((high - low) / 2, axis=1) / np.sqrt(n_records - 1)
        is_known = np.isfinite(distance)
        lower = np.where(is_known, np.maximum(deviation - distance, 0.0), 0.0)
        return Ends(lower, np.where(is_known, deviation + distance, np.inf))


def counts_between(records: Sequence[Increments], name: str, measure: Array) -> Ends:
    """Return the number of records under which all, and under which some structures exceed.

    Structures were moved at some measures of each record. At a measure between two of these, all
    structures count as exceeding the limit if they do so at both neighbours, and some structure
    counts if one does so at either. Outside their range the nearest measure counts.

    Args:
        records: Demands (peak over limit) at the rising measures of each record, at least one
            record.
        name: Name of the limit, or of the event that any of several limits is exceeded.
        measure: Measures at which the records are counted, in any order, shape (measures,).

    Returns:
        `lower`: number of records under which all structures of the cut exceed the limit; `upper`:
        number under which some do; floats of shape (levels, measures) each.

    Raises:
        KeyError: A record has no such limit or event.
    """
    # Demands have the shape (largest and smallest, levels, measures).
    n_levels = records[0].demands[name].shape[1]
    shape = (n_levels, len(measure))
    count_all = np.zeros(shape)
    count_some = np.zeros(shape)
    for record in records:
        by_some, by_all = record.is_exceeded(name)
        after = np.searchsorted(record.measure, measure)
        # Outside the measures that were tried, the first or the last one counts.
        before = np.maximum(after - 1, 0)
        after = np.minimum(after, len(record.measure) - 1)
        # A structure that exceeds at both measures may keep the limit between them; this is not
        # seen and said in `Fragility.words`.
        count_all += by_all[:, before] & by_all[:, after]
        count_some += by_some[:, before] | by_some[:, after]
    return Ends(count_all, count_some)


@dataclass(frozen=True, eq=False, kw_only=True)
class LimitFragility(LimitResult):
    """Fraction of the records under which one limit is exceeded, over their intensity measure.

    Args:
        nature: Guarantee of the critical measures.
        critical: Measures of each record at which the limit is reached.
        measure: Measures at which the fraction is given, rising, shape (measures,).
        band: Lower and upper bound of the fraction of the records under which a structure exceeds
            the limit, shape (levels, measures) each. They hold for each structure of the α-cut.
        median: Bounds of the sample median of the critical measures, shape (levels,) each.
        lognormal_median: Range of the median of the lognormal fit, shape (levels,) each.
        dispersion: Range of the dispersion of the lognormal fit, shape (levels,) each; None for a
            single record. Both are bounds or estimates, see `CriticalMeasures.lognormal_range`.
        confidence: Limits of the fraction with a confidence of 95 % if the records are independent
            draws (Clopper and Pearson 1934), shape (levels, measures) each; None if they are not.
    """

    nature: Nature
    critical: CriticalMeasures
    measure: Array
    band: Ends
    median: Ends
    lognormal_median: Ends
    dispersion: Ends | None
    confidence: Ends | None

    def lognormal_fit(self, level: int) -> list[Array]:
        """Return the lognormal distribution functions fitted to both ends of the first crossings.

        See `alphacut.frame.analyses.damage_states.lognormal_fit`.

        Args:
            level: Index of the level.

        Returns:
            Values at the intensity measures `self.measure`, shape (measures,), for the lower ends
            and then for the upper ends; once if the fits agree. Ends that are all equal or mostly
            infinite have no fit and are left out, so that the list may be empty.
        """
        from scipy.special import ndtr

        # The ends agree on a level where the inputs are crisp; one curve is drawn then.
        curves = []
        for fit in dict.fromkeys(self.critical.fits(level)):
            if np.isfinite(fit).all() and fit.dispersion > 0:
                curves.append(ndtr(np.log(self.measure / fit.median) / fit.dispersion))
        return curves


@dataclass(frozen=True)
class FragilityQuestion(Question):
    """Fraction of the records under which limits are exceeded, over a measure of records.

    Args:
        limits: limits of outputs, as of [decision]; or states
        states: in place of limits: those of damage states by name, from the slightest on, as
            'slight = ["drift <= 0.5 %"]'; a state begins with the first of its limits in any storey
        measure: measure of a record; Sa(T1) is the pseudo-acceleration `ω² max |u|` at the nominal
            structure's first period, with its own damping ratio (not 5 %); of two components
            RotD50(T1) is its median over all directions, and RotD100(T1) the largest one
        independent: whether records count as independent draws: 95 % limits
        most: of columns that yield: largest measure tried, as a multiple of the one at which the
            nominal structure would reach all limits under all records if it were elastic
    """

    reads_peaks = True
    records = "needed"
    of_yielding = ("most",)
    limits: tuple[Limit, ...] = ()
    states: dict[str, tuple[Limit, ...]] = field(default_factory=dict)
    measure: Literal["Sa(T1)", "PGA", "scale", "RotD50(T1)", "RotD100(T1)"] = "Sa(T1)"
    independent: bool = False
    most: Annotated[float, Quantity(above=0, maximum=100)] = 2.0

    def __post_init__(self) -> None:
        """Refuse limits beside states, and neither of them."""
        value = "beside states" if self.limits else None
        is_one = bool(self.limits) != bool(self.states)
        require(is_one, "limits", value, "limits, or the limits of states")
        checked_number("most", self.most, positive=True)

    @property
    def named_limits(self) -> dict[str, Limit]:
        """The limits, or those of the states with their states as events, by name."""
        return limits_by_name(limits_of_states(self.states) if self.states else self.limits, ())

    def require(self, model: StructureModel, components: int) -> None:
        """Refuse a structure, limits and a measure of which no fragility can be computed."""
        require_fragile(model, list(self.named_limits.values()))
        is_measured = components > 1 or not self.measure.startswith("RotD")
        require(is_measured, "measure", self.measure, "beside records of two components")

    def analyses(self, asked: Asked) -> dict[str, IncrementalAnalysis]:
        """Prepare an incremental dynamic analysis of a frame that yields for each record, by name.

        Nothing is moved along the scales yet. Each record is divided by its intensity, so that the
        scale of an analysis is the intensity measure. The largest one is the same for all.

        Raises:
            RefusedError: Levels or inputs are not allowed, or a response does not exist.
            StepError: A response has too many events in a step, or its energy is not in balance.
        """
        limits = self.named_limits
        names = list(limits)
        pairs = [(limit.output, limit.number) for limit in limits.values()]
        events = [[names.index(name) for name in members] for members in events_of(limits).values()]
        cuts = boxes(asked.inputs, asked.alpha)
        analyses = {}
        for record in asked.records:
            # A record divided by its intensity has the intensity 1.
            unit_samples = np.asarray(record.ground.samples / record.measures[self.measure])
            # A scaled record has no name and no remarks of its own.
            ground = Accelerogram(record.ground.step, unit_samples)
            frame = replace(cast("StoreyFrame", asked.model), ground=ground)
            analyses[record.name] = IncrementalAnalysis(
                frame, cuts, pairs, record.duration, asked.step, events=events
            )
        # All records are scaled up to the same measure. The first column of `elastic_scales` is the
        # scale at which the frame yields; the others belong to the limits.
        nominal = cuts.nominal[np.newaxis]
        elastic = max(x.elastic_scales(nominal)[0, 1:].max() for x in analyses.values())
        greatest = self.most * float(elastic)
        return {name: replace(x, greatest_scale=greatest) for name, x in analyses.items()}

    def moved(self, asked: Asked, progress: Progress | None = None) -> Asked:
        """Return what is asked about with the peaks under each record, or over its scales.

        Peaks of linear structures are proportional to the record, so that one scale suffices;
        frames that yield are moved at many scales.
        """
        limits = self.named_limits
        if yields(asked.model):
            increments = {}
            for k, (name, analysis) in enumerate(self.analyses(asked).items()):
                tick = nth_subprogress(progress, k, len(asked.records))
                increments[name] = increments_of(analysis, limits, tick)
            return replace(asked, increments=increments)
        peaks = peaks_under(
            cast("LinearSystem", asked.model),
            asked.inputs,
            asked.records,
            list(dict.fromkeys(limit.peak for limit in limits.values())),
            step=asked.step,
            alpha=asked.alpha,
            progress=progress,
        )
        return replace(asked, suite=peaks)

    def answer(self, asked: Asked, progress: Progress) -> Fragility:
        """Return the fragility, for which all but the nominal responses are known."""
        found = self._known(asked)
        cuts = boxes(asked.inputs, asked.alpha)
        if not self.states or (cuts.lower[-1] == cuts.upper[-1]).all():
            return found
        # The ends of measures over a cut belong to different structures under different records, so
        # that their scatter is that of none: the nominal structure is moved besides.
        inputs = {name: Crisp(value) for name, value in zip(cuts.names, cuts.nominal, strict=True)}
        alone = replace(asked, inputs=inputs, alpha=(1.0,), suite=None, increments={})
        nominal = self._known(self.moved(alone))
        critical = {state: nominal.limits[state].critical for state in self.states}
        return replace(found, nominal=critical)

    def _known(self, asked: Asked) -> Fragility:
        """Return the fragility from the peaks over a suite, or over the scales of its records."""
        limits = self.named_limits
        suite = asked.suite
        events = events_of(limits)
        demands = list(asked.increments.values())
        critical: dict[str, CriticalMeasures] = {}
        natures: dict[str, Nature] = {}
        if demands:
            for name in (*limits, *events):
                critical[name] = CriticalMeasures.from_demands(demands, name)
                natures[name] = Nature.ESTIMATED
        elif suite is not None:
            records = suite.by_record.values()
            measures = [record.measures[self.measure] for record in records]
            for name, limit in limits.items():
                peaks = [record.peak[limit.peak] for record in records]
                critical[name] = CriticalMeasures.from_peaks(peaks, measures, limit.outwards)
                natures[name] = Nature.weakest(peak.nature for peak in peaks)
            for event, members in events.items():
                # Critical measures of linear structures are intervals of numbers; the event is
                # reached with the first of its limits.
                critical[event] = CriticalMeasures.of_any([critical[member] for member in members])
                natures[event] = Nature.weakest(natures[member] for member in members)

        about: dict[str, LimitResult] = {}
        for name, limit in limits.items():
            about[name] = about_limit(limit, asked.model.unit_of(limit.output))
        for event, members in events.items():
            for name in members:
                about[name] = replace(about[name], event_name=event)
            about[event] = LimitResult(output=event_words(event), is_event=True)
        parts = {}
        for name in about:
            measure = _grid(critical[name], demands)
            counts = critical[name].counts(measure)
            if demands:
                # The sets of measures of a yielding frame need not be intervals, so that they are
                # counted one by one.
                counts = counts_between(demands, name, measure)
            parts[name] = _limit_fragility(
                about[name],
                natures[name],
                critical[name],
                measure,
                counts,
                independent=self.independent,
            )
        mode = nominal_mode(asked.model)
        return Fragility(
            encloses=suite.encloses if suite is not None else "",
            alpha=np.array(asked.alpha, float),
            measure=self.measure,
            unit=MEASURES[self.measure],
            period_s=mode.period,
            damping_ratio=mode.ratio,
            limits=parts,
            increments=dict(asked.increments),
            states=tuple(self.states),
        )


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Fragility(Answer):
    """Fraction of the records of a suite under which limits are exceeded, over their intensity.

    Args:
        alpha: Levels, shape (levels,).
        measure: Name of the intensity measure of the records.
        unit: Its SI unit.
        period_s: First natural period T1 at the nominal inputs, in s.
        damping_ratio: Damping ratio of the first mode.
        limits: Fragility of each limit by its name, then of each event of several limits.
        increments: Demands over the measure of each record by its name, for a frame that yields.
        states: Names of the damage states, from the slightest on; each is an event in `limits`.
        nominal: Critical measures of each state for the structure with the nominal inputs, on one
            level; empty where the cuts of the highest level contain no other structure.
    """

    key = "fragility"
    title = "Under how many records are limits exceeded?"
    alpha: Array
    measure: str
    unit: str
    period_s: float
    damping_ratio: float
    limits: dict[str, LimitFragility]
    increments: dict[str, Increments] = field(default_factory=dict)
    states: tuple[str, ...] = ()
    nominal: dict[str, CriticalMeasures] = field(default_factory=dict)

    def nominal_crossings(self, state: str) -> Array:
        """Return the measures at which the nominal structure comes into a state, (records,).

        Each is the geometric mean of its bounds, which are close for one structure; infinite where
        it does not come into the state.
        """
        low, high = self.nominal.get(state, self.limits[state].critical).first_crossings
        return np.asarray(np.sqrt(low[-1] * high[-1]))

    def nominal_fit(self, state: str) -> LognormalFit:
        """Return the lognormal fit to `nominal_crossings`."""
        return lognormal_fit(self.nominal_crossings(state), self.limits[state].critical.largest)

    @property
    def stated_units(self) -> dict[str, ShownUnit]:
        """Units in which the limits are stated, by output."""
        return stated_units(self.limits.values())

    def further_records(self) -> dict[str, list[Record]]:
        """Return sets and curves of a frame that yields, and Pelicun's table of damage states."""
        found: dict[str, list[Record]] = {}
        if self.increments:
            rows = {"fragility_sets": self.crossings(), "fragility_curves": self.curves()}
            found = {name: self.known_records(x) for name, x in rows.items()}
        if self.has_pelicun_table:
            found["pelicun"] = self.pelicun()
        return found

    def text_rows(self) -> Iterator[Row]:
        """Yield a row for each limit and for each event of several limits.

        The columns are the limit; the median of the critical measures at the lowest level, for a
        frame that yields with the ranges over the records; the guarantee; median and dispersion of
        the lognormal fit at the lowest level; and the median at the highest level. Of damage states
        there are rows of the states alone, with the fit beside the median and at both levels.
        """
        for part in self.limits.values():
            if self.states and part.event_name:
                continue
            median = self._median_text(part, 0)
            if self.states:
                median += f"; lognormal {self._fit_text(part, 0)}"
            elif self.increments:
                median += f"; over the records {self._crossings_text(part)}"
            row: dict[str, str | Nature] = {
                "limit": part.words,
                "median at the lowest α": median,
                "nature": part.nature,
                "lognormal fit at the lowest α": self._fit_text(part, 0),
                "median at the highest α": self._median_text(part, -1),
            }
            if self.states:
                row["lognormal fit at the highest α"] = self._fit_text(part, -1)
            yield row

    def _median_text(self, part: LimitFragility, level: int) -> str:
        """Return the bounds of the median measure as text; accelerations are given in g, too.

        An example is "median Sa(T1) 2.31 … 2.75 m/s^2 (0.235 … 0.281 g)".

        Args:
            part: Fragility of a limit or event.
            level: Index of the level; -1 for the highest.
        """
        text = f"median {self.measure} {_level_text(part.median, level, self.unit)}"
        if self.unit != "m/s^2":
            return text
        # Engineers state accelerations in g.
        in_g = _level_text(part.median, level, "g", unit_size=STANDARD_GRAVITY)
        return f"{text} ({in_g})"

    def _fit_text(self, part: LimitFragility, level: int) -> str:
        """Return the ranges of median and dispersion of the lognormal fit on a level as text."""
        text = f"median {_level_text(part.lognormal_median, level, self.unit)}"
        if part.dispersion is not None:
            low = float(part.dispersion.lower[level])
            high = float(part.dispersion.upper[level])
            if low > 0:
                text += f", dispersion {_range_text(low, high, '')}"
            elif np.isfinite(high):  # each record may have its own structure of the cut
                text += f", dispersion up to {engineering(high, '')}"
        return text

    def _crossings_text(self, part: LimitFragility) -> str:
        """Return the ranges over the records of first crossing and last non-exceedance as text.

        The former is the smallest measure tried at which some structure exceeds the limit, the
        latter the largest one at which some structure keeps it, both on the lowest level.

        Args:
            part: Fragility of a limit or event of a frame that yields.
        """
        first = part.critical.low_reached[0]
        last = part.critical.high_reached[0]
        return (
            f"first crossing {_range_text(first.min(), first.max(), self.unit)},"
            f" last non-exceedance {_range_text(last.min(), last.max(), self.unit)}"
        )

    def records(self) -> list[Record]:
        """Return the rows of `number_rows`, in which unknown bounds stay infinite."""
        return [dict(self._stated(row)) for row in self.number_rows()]

    def number_rows(self) -> Iterator[Row]:
        """Yield a row of numbers for each limit or event and each level.

        The columns are name, unit and value of the limit, α, the lower ("least") and the upper
        ("greatest") bound of the median, of the dispersion and of the median of the lognormal fit
        over all structures of the cut, and the guarantee. The dispersion of a single record is
        None; unknown bounds are infinite.
        """
        for name, part in self.limits.items():
            numbers = {
                f"median {self._measure_title}": part.median,
                "dispersion": part.dispersion,
                f"lognormal median {self._measure_title}": part.lognormal_median,
            }
            for level, alpha in enumerate(self.alpha):
                row: dict[str, str | float | Nature | None] = {**part.columns(name), "α": alpha}
                for title, ends in numbers.items():
                    row |= {f"least {title}": None, f"greatest {title}": None}
                    if ends is not None:
                        row[f"least {title}"] = float(ends.lower[level])
                        row[f"greatest {title}"] = float(ends.upper[level])
                yield row | {"nature": part.nature}

    @property
    def _measure_title(self) -> str:
        """Title of a column of intensity measures; "scale" has no unit."""
        return f"{self.measure}{self._unit_title}"

    @property
    def _unit_title(self) -> str:
        """Unit of the measure in the title of a column."""
        return f" [{self.unit}]" if self.unit else ""

    def crossings(self) -> Iterator[Row]:
        """Yield a row for each limit or event, record and level of a frame that yields.

        "first crossing" is the smallest measure tried at which some structure exceeds the limit,
        and "last non-exceedance" the largest one at which some structure keeps it; infinite if it
        lies beyond the largest measure tried. The measures at which some structure and at which
        all structures that were moved exceed the limit follow as texts of intervals. A linear
        structure has no rows.
        """
        unit = self._unit_title
        for name, part in self.limits.items():
            for column, (record, increments) in enumerate(self.increments.items()):
                measure = increments.measure
                greatest, least = increments.demands[name]  # (levels, measures) each
                for level, alpha in enumerate(self.alpha):
                    yield {
                        "limit": part.words,
                        "record": record,
                        "α": alpha,
                        f"first crossing{unit}": part.critical.low_reached[level, column],
                        f"last non-exceedance{unit}": part.critical.high_reached[level, column],
                        f"exceeded by some{unit}": _set_text(measure, greatest[level]),
                        f"exceeded by all found{unit}": _set_text(measure, least[level]),
                    }

    @property
    def limits_by_demand(self) -> dict[str, list[str]]:
        """Names of the limits of each peak, by the name of the peak; without events."""
        found: dict[str, list[str]] = {}
        for name, part in self.limits.items():
            if not part.is_event:
                found.setdefault(part.peak_name, []).append(name)
        return found

    def demand_curve(self, name: str, record: str) -> Array:
        """Return the largest and the smallest peak found under a record, over its `measure`.

        Args:
            name: Name of a limit of the peak; of no event.
            record: Name of the record.

        Returns:
            Peaks in the SI unit of the limit, shape (2, levels, measures), first the largest and
            then the smallest of the structures of each cut; infinite or NaN for collapses.

        Raises:
            KeyError: There is no such limit or record, as for all records of a linear structure.
        """
        return self.limits[name].limit * self.increments[record].demands[name]

    def curves(self) -> Iterator[Row]:
        """Yield a row for each limited peak, record, level and measure of a frame that yields.

        The columns are the name and the SI unit of the peak, the record, α, the intensity measure,
        and the smallest ("least") and the largest ("greatest") peak of the structures that were
        moved, infinite for a collapse. Several limits of one peak give its rows once. A linear
        structure has no rows.
        """
        for peak, names in self.limits_by_demand.items():
            for record, increments in self.increments.items():
                head: Row = {"peak": peak, "unit": self.limits[names[0]].unit, "record": record}
                # All limits of a peak have the same curve.
                demands = self.demand_curve(names[0], record)
                measure = {self._measure_title: increments.measure}
                yield from curve_rows(head, self.alpha, measure=measure, demands=demands)

    @property
    def has_pelicun_table(self) -> bool:
        """Whether there are damage states over a measure that Pelicun has as a demand."""
        return bool(self.states) and self.measure != "scale"

    def pelicun(self, component: str = "structure") -> list[Record]:
        """Return the damage states as rows of a table of damage models of Pelicun 3.10.

        There are three components: one with the fits of the nominal structure, and the weakest and
        the strongest one on the lowest level, with fits to all lower and to all upper ends. Medians
        are in g. A component of which a state has no fit is marked as incomplete.

        Args:
            component: Name of the first component.

        Raises:
            RefusedError: There are no damage states, the measure is the scale of the records, or
                the name has a hyphen.
        """
        # Pelicun splits names at hyphens into levels of an index.
        is_name = "-" not in component
        require(is_name, "component", value=component, allowed="a name without hyphens")
        require(bool(self.states), "Pelicun's table", value="without states", allowed="states")
        components: dict[str, dict[str, LognormalFit]] = {}
        for state in self.states:
            critical = self.limits[state].critical
            weakest, strongest = critical.fits(0)
            components.setdefault(component, {})[state] = self.nominal_fit(state)
            components.setdefault(f"{component}.weakest", {})[state] = weakest
            components.setdefault(f"{component}.strongest", {})[state] = strongest
        return pelicun_rows(components, self.measure, self.period_s)

    def to_pelicun(self, path: str | Path, component: str = "structure") -> None:
        """Write the rows of `pelicun` to a CSV file."""
        Path(path).write_text(records_csv(self.pelicun(component)), encoding="utf-8")

    def words(self) -> str:
        """Return sentences that explain the result to its reader.

        They say what the intensity measure is, what the median and the dotted fit are, for a frame
        that yields how the measures were searched and which records made it collapse, for a linear
        structure what the band means, and what the dashed limits are if there are any.
        """
        measure = self.measure
        if measure == "Sa(T1)":
            measure += ", a pseudo-acceleration with the structure's own damping"
        text = (
            f"Measure: {measure} (T1 = {self.period_s:.4g} s, ζ = {self.damping_ratio:.3g}, at"
            " the most plausible inputs). α is a level of possibility, no probability."
            " The median is that of the sample of records; the median of the lognormal fit, which"
            " is drawn dotted, is the geometric mean of their measures."
        )
        if self.increments:
            text += (
                f" Structures were moved at measures {GRID_RATIO - 1:.0%} apart, and"
                f" {RESOLUTION:.0%} where the result changes; an exceedance between these measures"
                " may be missed. The upper end of a band counts the records under which a structure"
                " is known to exceed the limit, the lower end those under which all structures"
                " found do. Medians range from that of the first crossings to that of the last"
                " non-exceedances. Sets end with the largest measure that was tried;"
                " fragility.most tries more."
            )
            collapses = [
                record
                for record, increments in self.increments.items()
                if not all(np.isfinite(x).all() for x in increments.demands.values())
            ]
            if collapses:
                text += f" A collapse exceeds every limit: under {', '.join(collapses)}."
        else:
            text += (
                " For each structure within the α-cut, the fraction of this suite's records under"
                " which it exceeds the limit lies in the band."
                " This is damage limitation of a linear structure, not collapse."
            )
        if self.states:
            text += (
                f" A damage state ({', '.join(self.states)}) begins with the first of its limits,"
                " under each record at its first crossing; α is that of the inputs' tolerances."
            )
        # Where a record does not bring a limit, its crossing is censored.
        censored = [
            f"{part.words}: {np.isinf(part.critical.first_crossings.upper[0]).sum()}"
            for part in self.limits.values()
            if np.isinf(part.critical.first_crossings.upper[0]).any() and not part.event_name
        ]
        if censored and self.increments:
            text += (
                " Under some records not every structure exceeds a limit at any measure tried"
                f" ({'; '.join(censored)} of {len(self.increments)} records); they count as"
                " censored, and the fit has the largest likelihood (Baker 2015)."
            )
        if any(part.confidence for part in self.limits.values()):
            text += " Dashed: pointwise 95 % limits, if the records are independent draws."
        return text


def _level_text(ends: Ends, level: int, unit: str, *, unit_size: float = 1.0) -> str:
    """Return the range of a quantity on a level as text, in a unit of a size in SI units."""
    low = float(ends.lower[level])
    high = float(ends.upper[level])
    return _range_text(low / unit_size, high / unit_size, unit)


def _range_text(low: float, high: float, unit: str) -> str:
    """Return a range of measures as text; its ends may be infinite."""
    if not np.isfinite(low):
        return "beyond all measures tried"
    if not np.isfinite(high):
        return f"{engineering(low, unit)} … no end"
    return f"{range_text(low, high, Nature.GUARANTEED, 3)} {unit}".strip()


def _set_text(measures: Array, demands: Array) -> str:
    """Return the intervals of measures at which the demand exceeds 1, such as "1.2 … 1.5, 2 … 3".

    The ends of an interval are its first and its last measure, which may be the same; without any
    the text is empty.

    Args:
        measures: Rising measures, shape (measures,).
        demands: Peak over limit at these measures, same shape; infinite or NaN for a collapse.
    """
    # The mask is padded, so that each interval has a change at its start and one behind its end. A
    # comparison with NaN is false, which makes a collapse exceed the limit.
    exceeds = np.concatenate([[False], ~(demands <= 1), [False]])
    changes = np.flatnonzero(np.diff(exceeds.astype(int))).reshape(-1, 2)
    texts = [f"{measures[start]:.4g} … {measures[stop - 1]:.4g}" for start, stop in changes]
    return ", ".join(texts)


def fragility(
    model: LinearSystem,
    inputs: Mapping[str, FuzzyNumber],
    suite: Sequence[Accelerogram],
    limits: Limit | Sequence[Limit] = (),
    *,
    duration: float,
    step: float,
    alpha: Sequence[float] = ALPHA,
    states: Mapping[str, Limit | Sequence[Limit]] | None = None,
    intensity: str = "Sa(T1)",
    independent: bool = False,
    most: float = 2.0,
    progress: Progress | None = None,
) -> Fragility:
    """Return the fraction of the records of a suite under which limits are exceeded.

    Args:
        model: A linear structure or a frame that yields, at rest and without forces. Each record
            replaces its own record.
        inputs: Fuzzy parameters by name, in SI units.
        suite: Records, see `read_suite`.
        limits: Limits of outputs, in SI units. Limits with the same `event` are also analysed
            together, for the event that any of them is exceeded.
        duration: Longest response, in s; a response ends five natural periods after its record.
        step: Distance of the time nodes, in s.
        alpha: Levels.
        states: Limits of damage states by name, from the slightest state on, in place of `limits`.
            A state begins with the first of its limits.
        intensity: Intensity measure of a record: "Sa(T1)", "PGA" or "scale".
        independent: Whether the records are independent draws, for 95 % limits.
        most: For a frame that yields: largest measure that is tried, as a multiple of the measure
            at which the nominal structure, if it were elastic, would reach all limits under all
            records.
        progress: Called with the completed fraction.

    Returns:
        Fragility: the curves of each limit and event by name in `limits`, over the intensity
        `measure`, and the `states`.

    Raises:
        RefusedError: The structure does not start at rest or has forces, a limit does not fit, or
            an argument is out of range.
        FailedError: No bounds are found for a record, or a time step did not converge.

    Example:
        >>> from alphacut.frame import Accelerogram, Limit, StoreyFrame
        >>> from alphacut.fuzzy import Interval
        >>> frame = StoreyFrame(masses=[1e3], stiffness=[4e4], damping_ratio=0.05, outputs=("q1",))
        >>> suite = [Accelerogram(0.02, np.sin(np.arange(50) / k)) for k in (6, 8)]
        >>> k1 = {"k1": Interval(38e3, 42e3)}
        >>> found = fragility(frame, k1, suite, Limit("q1", 0.02), duration=2.0, step=0.05)
        >>> list(found.limits), found.measure
        (['q1'], 'Sa(T1)')
    """
    question = FragilityQuestion(
        (limits,) if isinstance(limits, Limit) else tuple(limits),
        cast("Any", states or {}),
        cast("Any", intensity),
        independent,
        most,
    )
    question.require(model, components=1)
    require_choice("intensity", intensity, MEASURES)
    records = scaled_records(model, suite, duration=duration, step=step)
    asked = Asked(model, inputs, tuple(alpha), duration, step, records=records)
    asked = question.moved(asked, progress)
    return question.answer(asked, lambda done: None)


def events_of(limits: Mapping[str, Limit]) -> dict[str, list[str]]:
    """Return the names of the limits of each event by its name, such as a damage state."""
    events: dict[str, list[str]] = {}
    for name, limit in limits.items():
        if limit.event:
            events.setdefault(limit.event, []).append(name)
    return events


def increments_of(
    analysis: IncrementalAnalysis, limits: Mapping[str, Limit], progress: Progress | None = None
) -> Increments:
    """Run the incremental dynamic analysis of a record, and return the demands by name.

    Args:
        analysis: The analysis of the record, with the same limits and events in the same order.
        limits: Limits by name. Limits that share an event make up the event of this name.
        progress: Called with the completed fraction.

    Returns:
        Peak over limit at the measures that were tried, by the names of the limits and then of
        their events.

    Raises:
        RefusedError: A response does not exist.
        StepError: A response has too many events in a step, or its energy is not in balance.
    """
    measure, demands = analysis.run(progress)  # (2, levels, limits and events, measures)
    names = [*limits, *events_of(limits)]
    return Increments(measure, {name: demands[:, :, k] for k, name in enumerate(names)})


def _limit_fragility(
    about: LimitResult,
    nature: Nature,
    critical: CriticalMeasures,
    measure: Array,
    counts: Ends,
    *,
    independent: bool,
) -> LimitFragility:
    """Return the fragility of one limit or event: bands, medians, dispersion and confidence limits.

    Bands and confidence limits have the shape (levels, measures), medians and dispersion (levels,).

    Args:
        about: Side, output, unit and value of the limit, or the name of the event.
        nature: Guarantee of the critical measures.
        critical: Measures at which the limit is reached, for each level and record.
        measure: Measures at which the fraction of the records is given, shape (measures,).
        counts: Bounds of the number of records under which a structure exceeds the limit at these
            measures, shape (levels, measures) each.
        independent: Whether the records are independent draws. If not, the confidence limits of
            the fraction are None. The dispersion is None if there is a single record.
    """
    n_records = critical.low.shape[1]
    confidence = None
    if independent:
        # The probability of a miss is divided between both limits.
        tail = (1 - CONFIDENCE) / 2
        confidence = clopper_pearson(counts.lower, counts.upper, n_records, tail)
    lognormal_median, dispersion = critical.lognormal_range()
    return LimitFragility(
        **vars(about),
        nature=nature,
        critical=critical,
        measure=measure,
        band=Ends(counts.lower / n_records, counts.upper / n_records),
        median=critical.median,
        lognormal_median=lognormal_median,
        dispersion=dispersion,
        confidence=confidence,
    )


def event_words(event: str) -> str:
    """Return the text of an event of the limits of all storeys: "drift ≤ 1 % everywhere".

    A damage state is its own text.
    """
    if "=" not in event:
        return event
    return f"{event.replace('<=', '≤').replace('>=', '≥')} everywhere"


def _grid(critical: CriticalMeasures, demands: Sequence[Increments]) -> Array:
    """Return 60 equidistant measures that cover all finite critical ones, for bands and tables.

    They are rising and positive, shape (60,).

    Args:
        critical: Measures at which the limit is reached, for each level and record. Those below
            which no structure exceeds it must be finite.
        demands: Demands at the measures that were tried with a yielding frame, by record; empty for
            a linear structure. The largest measure that was tried must be the same for all records.
            The grid does not exceed it, and ends with it if a critical measure lies beyond it.
    """
    # The grid begins a fifth below the smallest critical measure and ends a tenth above the
    # largest, so that bands begin at 0 and end at 1.
    is_finite = np.isfinite(critical.high)
    largest = 1.1 * float(critical.high.max(initial=0.0, where=is_finite))
    if not is_finite.any():
        # Attained measures are not known either if the inputs only enclose a set.
        reached = np.where(np.isfinite(critical.low_reached), critical.low_reached, critical.low)
        largest = 1.1 * float(reached.max())
    if demands:
        largest_tried = float(demands[0].measure[-1])  # the same for all records
        if not is_finite.all() or largest > largest_tried:
            largest = largest_tried
    return np.linspace(0.8 * float(critical.low.min()), largest, 60, dtype=float)
