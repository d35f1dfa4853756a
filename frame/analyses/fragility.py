"""Fragility under a suite of records: of linear structures from proved peaks, of others by motions.

A linear structure that starts at rest and is moved by its record alone scales with it. So the
measure of a record at which a limit L is reached is c(p) = m L / peak(p), m the record's measure as
it is and p the inputs. Over an α-cut it ranges between m L over the greatest and m L over the least
peak, both of which are bounded from outside (proved) and from inside (reached). α is a level of
possibility, no probability, and is never multiplied with one. Of a frame that yields c(p) is a set.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import erf, log, sqrt
from typing import Any

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import require, require_choice
from alphacut.base.number_text import STANDARD_GRAVITY, engineering, range_text
from alphacut.base.progress_bar import Progress, subprogress
from alphacut.frame.analyses.answer import Record, known
from alphacut.frame.analyses.incremental import (
    GRID_RATIO,
    RESOLUTION,
    IncrementalAnalysis,
    Increments,
)
from alphacut.frame.analyses.limits import (
    About,
    Limit,
    LimitsAnswer,
    facts_of,
    limits_by_name,
)
from alphacut.frame.analyses.peaks import Peak
from alphacut.frame.analyses.probability import CONFIDENCE, clopper_pearson
from alphacut.frame.analyses.suites import (
    MEASURES,
    ScaledRecord,
    SuitePeaks,
    nominal_mode,
    over_records,
    scaled_records,
)
from alphacut.frame.boxes import ALPHA, boxes
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.structures.linear import LinearSystem, has_matrices
from alphacut.frame.structures.model import StructureModel
from alphacut.frame.structures.storey import StoreyFrame, yields
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.result import Ends, Nature

POINTS = 60
"""Measures at which bands are drawn and tabulated."""
TITLES = {"first crossing": "low_reached", "last non-exceedance": "high_reached"}
"""Fields of `CriticalMeasures` of frames that yield by their titles."""


@dataclass(frozen=True, eq=False)
class CriticalMeasures:
    """Measures of R records at which a limit is reached, as intervals on A levels.

    Args:
        low: No structure of the cut exceeds the limit below it, shape (A, R).
        low_reached: A structure of the cut is known to exceed it above, shape (A, R).
        high_reached: A structure of the cut is known not to exceed it up to here, shape (A, R).
        high: Every structure of the cut exceeds it above; infinite where no peak is known to be
            larger than zero, shape (A, R).
    """

    low: Array
    low_reached: Array
    high_reached: Array
    high: Array

    def __post_init__(self) -> None:
        """Refuse measures that are not positive, or reached outside their bounds.

        A measure that is not known (nan) lies above all measures.
        """
        for name in ("low", "low_reached", "high_reached", "high"):
            values = getattr(self, name)
            object.__setattr__(self, name, np.where(np.isnan(values), np.inf, values))
        is_valid, rounding = bool((self.low > 0).all()), 1 + 1e-9
        for reached in (self.low_reached, self.high_reached):
            is_inside = (self.low <= reached * rounding) & (reached <= self.high * rounding)
            is_valid &= bool(is_inside.all())
        require(is_valid, "critical measures", value="not rising", allowed="rising ends")

    @classmethod
    def from_peaks(
        cls, peaks: Sequence[Peak], measures: Sequence[float], limit: float
    ) -> CriticalMeasures:
        """Return the critical measures of R records at a limit, in its SI unit and outwards.

        `peaks` of the limited output, on A levels, and `measures` are of each record as it is.
        """
        ends = [(*x.greatest_bounds[::-1], *x.least_bounds[::-1]) for x in peaks]
        falling = np.stack([np.stack(np.broadcast_arrays(*x)) for x in ends], axis=-1)  # (4, A, R)
        with np.errstate(divide="ignore"):
            measure_ends = np.asarray(measures) * limit / np.maximum(falling, 0.0)
        low, low_reached, high_reached, high = measure_ends
        low_reached = np.minimum(low_reached, high)  # no greatest peak is below the least one
        # the structure that reaches the greatest peak known is one of the cut
        return cls(low, low_reached, np.maximum(high_reached, low_reached), high)

    @classmethod
    def from_demands(cls, records: Sequence[Tried]) -> CriticalMeasures:
        """Return the critical measures of R records by the measures tried.

        At the first measure all structures keep the limit. The first crossing lies between `low`
        and `low_reached`, the last non-exceedance between `high_reached` and `high`; those that lie
        beyond the largest measure are infinite.
        """
        ends = []
        for record in records:
            tried, (by_some, by_all) = record.measure, record.exceeded
            or_infinite, last = np.append(tried, np.inf), len(tried) - 1
            crossing = np.where(by_some.any(1), by_some.argmax(1), len(tried))
            after = len(tried) - (~by_all)[:, ::-1].argmax(1)
            high_reached = np.where(after > last, np.inf, tried[after - 1])
            bounds = [tried[crossing - 1], or_infinite[crossing]]
            ends.append([*bounds, high_reached, or_infinite[after]])
        low, low_reached, high_reached, high = np.moveaxis(np.array(ends), 0, -1)
        return cls(low, low_reached, high_reached, high)

    def counts(self, measure: Array) -> Ends:
        """Return numbers (A, X) of records that exceed for all structures of a cut and for some."""
        grid = np.asarray(measure)
        return Ends(*((x[:, :, None] < grid).sum(axis=1) for x in (self.high, self.low)))

    @property
    def median(self) -> Ends:
        """Bounds of the median of the records' critical measures, shape (A,) each.

        The median of the sample rises with each of its values.
        """
        return Ends(np.median(self.low, axis=1), np.median(self.high, axis=1))

    @property
    def lognormal_median(self) -> Ends:
        """Bounds of the median of the lognormal fit, exp of the mean logarithm, shape (A,) each."""
        return Ends(*(np.exp(np.log(end).mean(axis=1)) for end in (self.low, self.high)))

    @property
    def dispersion(self) -> Ends:
        """Bounds of the standard deviation of the logarithms, shape (A,) each.

        Raises:
            RefusedError: There is one record.
        """
        # it is within ‖h‖ / √(R − 1) of that of the middles of the intervals, h their half widths:
        # subtracting the mean does not lengthen a vector
        n_records = self.low.shape[1]
        require(n_records > 1, "records", value=n_records, allowed="two records or more")
        low, high = np.log(self.low), np.log(self.high)
        finite = np.isfinite(high).all(axis=1, keepdims=True)
        middle = np.where(finite, (low + high) / 2, low)
        reach = np.linalg.norm((high - low) / 2, axis=1) / np.sqrt(n_records - 1)
        deviation, is_finite = middle.std(axis=1, ddof=1), finite[:, 0]
        return Ends(np.where(is_finite, np.maximum(deviation - reach, 0), 0.0), deviation + reach)


@dataclass(frozen=True, eq=False)
class Tried:
    """Measures (X,) of a record at which structures were moved, rising, and what they showed.

    `exceeded` says whether some structure, and all structures found, exceed the limit, shape
    (2, A, X).
    """

    measure: Array
    exceeded: Mask

    @classmethod
    def of(cls, increments: Increments, name: str) -> Tried:
        """Return what the demands of a limit show; a collapse (nan) exceeds every limit."""
        return cls(increments.measure, ~(increments.demands[name] <= 1))


def counts_between(records: Sequence[Tried], measure: Array) -> Ends:
    """Return numbers (A, X) of records that exceed for all structures found and for some.

    Between two measures tried all do if all do at both, and some do if some do at either.
    """
    shape = (records[0].exceeded.shape[1], len(measure))
    count_all, count_some = np.zeros(shape), np.zeros(shape)
    for record in records:
        by_some, by_all = record.exceeded
        after = np.searchsorted(record.measure, measure)
        before = np.maximum(after - 1, 0)
        after = np.minimum(after, len(record.measure) - 1)
        count_all += by_all[:, before] & by_all[:, after]
        count_some += by_some[:, before] | by_some[:, after]
    return Ends(count_all, count_some)


def any_exceeded(limits: Sequence[CriticalMeasures]) -> CriticalMeasures:
    """Return the critical measures of the event that any of several limits is exceeded."""
    # high measures of single limits may belong to different structures: none is known to be reached
    ends = ("low", "low_reached", "high")
    low, reached, high = (np.min([getattr(x, end) for x in limits], axis=0) for end in ends)
    return CriticalMeasures(low, reached, reached, np.maximum(high, reached))


@dataclass(frozen=True, eq=False, kw_only=True)
class LimitFragility(About):
    """Critical measures of the records for a limit, and the fraction of records by measure.

    Args:
        nature: Guarantee of the critical measures.
        critical: Measures of each record at which the limit is reached.
        measure: Measures at which the fraction is given, rising, shape (X,).
        band: Bounds of the fraction of the records under which a structure exceeds the limit; they
            hold for every structure within the α-cut, shape (A, X) each.
        median: Bounds of the median of the sample of critical measures, shape (A,) each.
        lognormal_median: Bounds of the median of the lognormal fit, their geometric mean.
        dispersion: Bounds of the standard deviation of their logarithms; None of one record.
        confidence: 95 % limits of the fraction if records are independent draws (Clopper, Pearson
            1934), shape (A, X) each; None where they need not be.
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
        """Return the lognormal distributions (X,) that fit the ends of the critical measures.

        There is one where the ends agree; none of one record or of measures without an end.
        """
        curves: dict[bytes, Array] = {}
        for end in (self.critical.low[level], self.critical.high[level]):
            logarithms = np.log(end)
            if len(end) < 2 or not np.isfinite(logarithms).all() or np.ptp(logarithms) == 0:
                continue
            middle, deviation = float(logarithms.mean()), float(logarithms.std(ddof=1))
            reduced = [(log(x) - middle) / (deviation * sqrt(2)) for x in self.measure]
            curve = np.array([(1 + erf(x)) / 2 for x in reduced])
            curves[curve.tobytes()] = curve
        return [*curves.values()]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Fragility(LimitsAnswer[LimitFragility]):
    """Fraction of the suite's records under which limits are exceeded, over their measure.

    Args:
        alpha: Levels, shape (A,).
        measure: Name of the measure of records.
        unit: Its SI unit.
        period_s: T1 at the nominal values.
        damping_ratio: Damping ratio of that mode.
        limits: The fragility of each limit, then of each event of several limits.
        increments: Demands over the measure of each record, of a frame that yields.
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

    @property
    def parts(self) -> dict[str, LimitFragility]:
        """The fragilities by the names of limits and events."""
        return self.limits

    def texts_of(self, part: LimitFragility) -> dict[str, str]:
        """Return the median of the critical measures, and their lognormal fit."""
        fit = f"median {_range_text(level_of(part.lognormal_median, 0), self.unit)}"
        if part.dispersion is not None:
            fit += f", dispersion {_range_text(level_of(part.dispersion, 0), '')}"
        lowest = self._median_text(level_of(part.median, 0))
        return {
            "limit": part.words,
            "median at the lowest α": lowest + self._ends_text(part),
            "nature": self.nature_text(part.nature),
            "lognormal fit at the lowest α": fit,
            "median at the highest α": self._median_text(level_of(part.median, -1)),
        }

    def _median_text(self, ends: tuple[float, float]) -> str:
        """Return the range of a median with its measure; of accelerations in g, too."""
        text = f"median {self.measure} {_range_text(ends, self.unit)}"
        if self.unit != "m/s^2":
            return text
        low, high = (end / STANDARD_GRAVITY for end in ends)
        return f"{text} ({_range_text((low, high), 'g')})"

    def _ends_text(self, part: LimitFragility) -> str:
        """Return ranges over records of first crossing and last non-exceedance, if it yields."""
        if not self.increments:
            return ""
        ends = {title: getattr(part.critical, name)[0] for title, name in TITLES.items()}
        texts = (f"{x} {_range_text((y.min(), y.max()), self.unit)}" for x, y in ends.items())
        return f"; over the records {', '.join(texts)}"

    def crossings(self) -> list[Record]:
        """Return a row for each limit, record and level of a frame that yields."""
        unit, rows = f" [{self.unit}]" if self.unit else "", list[Record]()
        for name, part in self.limits.items():
            for column, (record, increment) in enumerate(self.increments.items()):
                for level, alpha in enumerate(self.alpha):
                    some, all_found = increment.demands[name][:, level]
                    sets = {"exceeded by some": some, "exceeded by all found": all_found}
                    rows.append({"limit": part.words, "record": record, "α": float(alpha)})
                    for title, end in TITLES.items():
                        crossing = getattr(part.critical, end)[level, column]
                        rows[-1][f"{title}{unit}"] = None if np.isinf(crossing) else crossing
                    for title, demands in sets.items():
                        rows[-1][f"{title}{unit}"] = _set_text(increment.measure, demands)
        return rows

    @property
    def limits_by_demand(self) -> dict[str, list[str]]:
        """Names of the limits of each peak of a frame that yields, by the name of the peak."""
        found: dict[str, list[str]] = {}
        for name, part in self.limits.items():
            if not part.is_event:
                found.setdefault(part.peak_name, []).append(name)
        return found

    def demand_curve(self, name: str, record: str) -> Array:
        """Return the greatest and the least peak found under a record, over its `measure`.

        Args:
            name: Name of a limit of the peak.
            record: Name of the record.

        Returns:
            In the SI unit of the limit, shape (2, A, X); nan where structures collapse.
        """
        return self.limits[name].limit * self.increments[record].demands[name]

    def curves(self) -> list[Record]:
        """Return a row for each peak, record, level and measure of a frame that yields."""
        measure, rows = f"{self.measure} [{self.unit}]" if self.unit else "scale", list[Record]()
        for peak, (first, *_) in self.limits_by_demand.items():
            unit = self.limits[first].unit
            for record, increment in self.increments.items():
                greatest, least = self.demand_curve(first, record)
                for level, alpha in enumerate(self.alpha):
                    ends = zip(increment.measure, least[level], greatest[level], strict=True)
                    for value, low, high in ends:
                        row: Record = {"peak": peak, "unit": unit, "record": record}
                        row |= {"α": float(alpha), measure: float(value)}
                        rows.append(row | {"least": known(low), "greatest": known(high)})
        return rows

    def numbers_of(self, part: LimitFragility) -> Iterator[Record]:
        """Yield a record for each level."""
        measure = f"{self.measure} [{self.unit}]" if self.unit else "scale"
        for k, alpha in enumerate(self.alpha):
            numbers: Record = {"α": float(alpha)}
            columns = {f"median {measure}": part.median, "dispersion": part.dispersion}
            columns[f"lognormal median {measure}"] = part.lognormal_median
            for title, ends in columns.items():
                low, high = (None, None) if ends is None else level_of(ends, k)
                numbers |= {f"least {title}": low, f"greatest {title}": high}
            yield {**numbers, "nature": self.nature_text(part.nature)}

    def words(self) -> str:
        """Return sentences on the measure, and on how to read the bands."""
        spectral = ", a pseudo-acceleration with the structure's own damping"
        text = (
            f"Measure: {self.measure}{spectral if self.measure == 'Sa(T1)' else ''}"
            f" (T1 = {self.period_s:.4g} s, ζ = {self.damping_ratio:.3g}, at the most"
            " plausible inputs). α is a level of possibility, no probability."
            " The median is that of the sample of records; a lognormal fit has the geometric mean"
            " of their measures, and is drawn dotted."
        )
        if self.increments:
            text += (
                f" Motions at measures {GRID_RATIO - 1:.0%} apart, and {RESOLUTION:.0%} where the"
                " answer changes: an exceedance between them may be missed. Upper ends of bands"
                " count the records under which a structure is known to exceed the limit, lower"
                " ends those under which all structures found do. Medians reach from those of"
                " first crossings to those of last non-exceedances. Sets end with the largest"
                " measure tried; fragility.most tries more."
            )
            tried = self.increments.items()
            collapses = [x for x, y in tried if not np.isfinite([*y.demands.values()]).all()]
            if collapses:
                text += f" A collapse exceeds every limit: under {', '.join(collapses)}."
        else:
            text += (
                " No structure within the α-cut exceeds the limit for a share of this suite's"
                " records outside the band."
                " This is damage limitation of a linear structure, not collapse."
            )
        if any(limit.confidence for limit in self.limits.values()):
            text += " Dashed: pointwise 95 % limits if the records were independent draws."
        return text


def level_of(ends: Ends, level: int) -> tuple[float, float]:
    """Return both ends on a level."""
    return float(ends.lower[level]), float(ends.upper[level])


def _range_text(ends: tuple[float, float], unit: str) -> str:
    """Return the text of a range; its ends may be infinite."""
    if not np.isfinite(ends[0]):
        return "beyond all measures tried"
    if not np.isfinite(ends[1]):
        return f"{engineering(ends[0], unit)} … no end"
    return f"{range_text(*ends, Nature.GUARANTEED, 3)} {unit}".strip()


def _set_text(measures: Array, demands: Array) -> str:
    """Return the measures with a demand above 1 as intervals; demands of a collapse are nan."""
    exceeds = np.concatenate([[False], ~(demands <= 1), [False]])
    starts, stops = np.flatnonzero(np.diff(exceeds.astype(int))).reshape(-1, 2).T
    ends = zip(measures[starts], measures[stops - 1], strict=True)
    return ", ".join(f"{low:.4g} … {high:.4g}" for low, high in ends)


def fragility(
    model: LinearSystem,
    inputs: Mapping[str, FuzzyNumber],
    suite: Sequence[Accelerogram],
    limits: Limit | Sequence[Limit],
    *,
    duration: float,
    step: float,
    alpha: Sequence[float] = ALPHA,
    intensity: str = "Sa(T1)",
    independent: bool = False,
    most: float = 2.0,
    progress: Progress | None = None,
) -> Fragility:
    """Return under which fraction of a suite's records limits are exceeded, over their intensity.

    Args:
        model: A linear structure or a frame that yields, at rest and without forces. Each record
            takes the place of its own.
        inputs: Fuzzy parameters by name, in SI units.
        suite: Records, as of `read_suite`.
        limits: Limits of outputs, in SI units. Limits that share an `event` are answered together
            as well: any of them is exceeded.
        duration: Longest motion, in s; a motion ends five natural periods after its record.
        step: Distance of the nodes, in s.
        alpha: Levels.
        intensity: Measure of a record: "Sa(T1)", "PGA", or "scale".
        independent: Whether records count as independent draws, for 95 % limits.
        most: Of a frame that yields: largest measure tried, over the one at which the nominal
            structure would reach all limits under all records if it were elastic.
        progress: Called with the completed fraction.

    Raises:
        RefusedError: The structure does not start at rest or has forces, or a limit does not fit.
    """
    named = limits_by_name(limits, ())
    require_fragile(model, [*named.values()])
    require_choice("intensity", intensity, MEASURES)
    if not yields(model):
        names = [*dict.fromkeys(limit.peak for limit in named.values())]
        peaks = over_records(
            model, inputs, suite, duration=duration, step=step, alpha=alpha, names=names,
            progress=progress,
        )  # fmt: skip
        return fragility_of(
            model, named, intensity=intensity, independent=independent, alpha=alpha, suite=peaks
        )
    records = scaled_records(model, suite, duration=duration, step=step)
    analyses = incremental_analyses(
        model, inputs, records, named, intensity=intensity, most=most, step=step, alpha=alpha
    )
    increments: dict[str, Increments] = {}
    for k, (name, analysis) in enumerate(analyses.items()):
        ends = k / len(analyses), (k + 1) / len(analyses)
        tick = subprogress(progress, *ends) if progress else None
        increments[name] = increments_of(analysis, named, tick)
    return fragility_of(
        model, named, intensity=intensity, independent=independent, alpha=alpha,
        increments=increments,
    )  # fmt: skip


def require_fragile(model: StructureModel, limits: Sequence[Limit]) -> None:
    """Refuse structures with forces or a start beside the record, and limits that do not fit."""
    moves_by_record = has_matrices(model) and not model.loads and model.is_at_rest
    allowed = "linear structures and frames that yield, at rest and without forces"
    require(moves_by_record, "fragility", value="of another motion", allowed=allowed)
    for limit in limits:
        fits = limit.outwards > 0 and not limit.mean
        allowed = "limits of each record that the structure at rest keeps"
        if yields(model):
            fits, allowed = limit.side == "", "limits of magnitudes, of columns that yield"
        require(fits, "limits", value=limit.text, allowed=allowed)


def events_of(limits: Mapping[str, Limit]) -> dict[str, list[str]]:
    """Return the names of the limits of each event of several, by the event's name."""
    events: dict[str, list[str]] = {}
    for name, limit in limits.items():
        if limit.event:
            events.setdefault(limit.event, []).append(name)
    return {event: names for event, names in events.items() if len(names) > 1}


def incremental_analyses(
    model: StoreyFrame,
    inputs: Mapping[str, FuzzyNumber],
    records: Sequence[ScaledRecord],
    limits: Mapping[str, Limit],
    *,
    intensity: str,
    most: float,
    step: float,
    alpha: Sequence[float],
) -> dict[str, IncrementalAnalysis]:
    """Return the analyses of a frame that yields by the record's name, over its intensity."""
    names, pairs = [*limits], [(limit.output, limit.number) for limit in limits.values()]
    events = [[names.index(name) for name in event] for event in events_of(limits).values()]
    cuts, found = boxes(inputs, alpha), dict[str, IncrementalAnalysis]()
    for record in records:
        unit_samples = np.asarray(record.ground.samples / record.measures[intensity])
        frame = replace(model, ground=Accelerogram(record.ground.step, unit_samples))
        found[record.name] = IncrementalAnalysis(
            frame, cuts, pairs, record.duration, step, events=events
        )
    elastic = max(x.elastic_scales(cuts.nominal[None])[0, 1:].max() for x in found.values())
    greatest = most * float(elastic)
    return {name: replace(x, greatest_scale=greatest) for name, x in found.items()}


def increments_of(
    analysis: IncrementalAnalysis, limits: Mapping[str, Limit], progress: Progress | None = None
) -> Increments:
    """Return the demands of limits and events by their names, over the measure of a record."""
    measure, demands = analysis.run(progress)  # (2, A, E, X)
    names = [*limits, *events_of(limits)]
    return Increments(measure, {x: demands[:, :, k] for k, x in enumerate(names)})


def fragility_of(
    model: LinearSystem,
    limits: Mapping[str, Limit],
    *,
    intensity: str,
    independent: bool,
    alpha: Sequence[float],
    suite: SuitePeaks | None = None,
    increments: Mapping[str, Increments] | None = None,
) -> Fragility:
    """Return the fragility from peaks over a suite or, of a frame that yields, from increments."""
    mode, parts = nominal_mode(model), dict[str, LimitFragility]()
    tried = {
        name: [Tried.of(x, name) for x in (increments or {}).values()]
        for name in [*limits, *events_of(limits)]
    }
    critical: dict[str, CriticalMeasures] = {}
    natures: dict[str, Nature] = {}
    for name, limit in limits.items():
        if suite is None or increments:
            natures[name] = Nature.ESTIMATED
            critical[name] = CriticalMeasures.from_demands(tried[name])
            continue
        peaks = [record.peak[limit.peak] for record in suite.by_record.values()]
        natures[name] = Nature.weakest(peak.nature for peak in peaks)
        measures = [record.measures[intensity] for record in suite.by_record.values()]
        critical[name] = CriticalMeasures.from_peaks(peaks, measures, limit.outwards)
    for name, members in events_of(limits).items():
        natures[name] = Nature.weakest(natures[member] for member in members)
        if suite is None or increments:
            critical[name] = CriticalMeasures.from_demands(tried[name])
        else:
            critical[name] = any_exceeded([critical[member] for member in members])
    event_by_limit = {x: event for event, names in events_of(limits).items() for x in names}
    for name, ends in critical.items():
        grid = _grid(ends, tried[name])
        counts = counts_between(tried[name], grid) if tried[name] else ends.counts(grid)
        n_records, miss = ends.low.shape[1], (1 - CONFIDENCE) / 2
        about: dict[str, Any] = {"output": event_words(name), "is_event": True}
        if name in limits:
            about = {**facts_of(limits[name], model.unit_of(limits[name].output))}
            about["event_name"] = event_by_limit.get(name, "")
        parts[name] = LimitFragility(
            **about,
            nature=natures[name],
            critical=ends,
            measure=grid,
            band=Ends(*(count / n_records for count in counts)),
            median=ends.median,
            lognormal_median=ends.lognormal_median,
            dispersion=ends.dispersion if n_records > 1 else None,
            confidence=clopper_pearson(*counts, n_records, miss) if independent else None,
        )
    first = next(iter(suite.by_record.values())).peak if suite else {}
    return Fragility(
        encloses=next((peak.encloses for peak in first.values()), ""),
        alpha=np.array(alpha, float),
        measure=intensity,
        unit=MEASURES[intensity],
        period_s=mode.period,
        damping_ratio=mode.ratio,
        limits=parts,
        increments=dict(increments or {}),
    )


def event_words(event: str) -> str:
    """Return the limit of all storeys or floors in words: "drift ≤ 1 % everywhere"."""
    return f"{event.replace('<=', '≤').replace('>=', '≥')} everywhere"


def _grid(ends: CriticalMeasures, tried: Sequence[Tried]) -> Array:
    """Return measures from below the least critical one to above the greatest that is finite."""
    finite = ends.high[np.isfinite(ends.high)]
    largest = 1.1 * float(finite.max() if finite.size else ends.low_reached.max())
    if tried:
        most = float(tried[0].measure[-1])  # of all records
        largest = min(largest, most) if np.isfinite(ends.high).all() else most
    return np.linspace(0.8 * float(ends.low.min()), largest, POINTS, dtype=float)
