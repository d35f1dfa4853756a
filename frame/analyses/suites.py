"""Peaks over a suite of records of the ground, each of which moves the structure by itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product
from math import ceil, pi
from typing import Any, NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require, require_choice
from alphacut.base.number_text import Table, engineering, percent_text, range_text
from alphacut.base.progress_bar import Progress, subprogress
from alphacut.frame.analyses.answer import Answer, Record, known
from alphacut.frame.analyses.peaks import Peak, Peaks, close_peaks, mirrored
from alphacut.frame.analyses.spectral import spectral_acceleration
from alphacut.frame.boxes import ALPHA, boxes
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.records.recording import arias_fractions
from alphacut.frame.structures.linear import LinearSystem, has_matrices, modal_damping_ratios
from alphacut.frame.structures.model import StructureModel
from alphacut.frame.structures.quantities import output_of
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.result import Nature

FREE_PERIODS = 5
"""Natural periods of free motion after a record: by then 5 % damping leaves a fifth."""
MAX_PERIOD = 1000.0
"""Longest first natural period, in s; towers have 10 s, and a longer one is a mistake in a unit."""
MAX_CORNERS = 64
"""Corners of each cut whose means over records are computed; more take time, none is a bound."""
NODES = 2
"""Nodes in a step at which peaks are bounded; the error between nodes falls with its square."""
MAX_OFFSET = 0.01
"""Mean of a record over its peak that is said."""
QUANTILES = {"median": 0.5, "84 %": 0.84}
"""Of a suite's peaks; 84 % is one standard deviation of a normal law above the mean."""
MEASURES = {"PGA": "m/s^2", "Sa(T1)": "m/s^2", "scale": ""}
"""SI units of the intensity measures of a record, by their names."""


class NominalMode(NamedTuple):
    """First mode at the nominal inputs: its period T1 in s, and damping ratio."""

    period: float
    ratio: float


def nominal_mode(model: StructureModel) -> NominalMode:
    """Return the first mode of a linear structure; RefusedError of another one."""
    if not has_matrices(model):
        what = "with a system that is not linear"
        raise RefusedError("records", what, "linear structures")
    omega, ratios = modal_damping_ratios(model)
    return NominalMode(2 * pi / float(omega[0]), float(ratios[0]))


@dataclass(frozen=True, eq=False)
class RecordPeaks:
    """Peaks under a record.

    Args:
        duration_s: Length of the motion.
        cut_share: Fraction of the record's Arias intensity that lies after the motion's end.
        measures: Intensity measures of the record: "PGA" and "Sa(T1)" in m/s², the latter the
            pseudo-acceleration with the structure's own damping; and "scale", 1.
        peak: Peaks by name; empty before they are computed.
    """

    duration_s: float
    cut_share: float
    measures: dict[str, float]
    peak: dict[str, Peak]


@dataclass(frozen=True, eq=False)
class ScaledRecord:
    """A record as it moves the structure: scaled, with the facts about its motion.

    `warnings` are sentences on what is unusual in it.
    """

    name: str
    ground: Accelerogram
    facts: RecordPeaks
    warnings: tuple[str, ...]

    @property
    def duration(self) -> float:
        """Length of the motion, in s."""
        return self.facts.duration_s

    @property
    def measures(self) -> Mapping[str, float]:
        """Intensity measures by name."""
        return self.facts.measures


def scaled_records(
    model: StructureModel,
    suite: Sequence[Accelerogram],
    *,
    duration: float,
    step: float,
    scale: float = 1.0,
    measure: str = "",
) -> tuple[ScaledRecord, ...]:
    """Return the records of a suite as they move a structure.

    Args:
        model: The structure, whose first mode at its nominal values gives the measure "Sa(T1)".
        suite: Records, corrected already.
        duration: Longest motion, in s; a motion ends five natural periods after its record.
        step: Distance of the nodes, in s.
        scale: Factor of every record; with `measure` the value that its measure gets, in m/s².
        measure: "PGA" or "Sa(T1)"; empty for a factor.

    Raises:
        RefusedError: A record is zero throughout, or the structure is not linear.
    """
    require_choice("measure", measure, ["", "PGA", "Sa(T1)"])
    mode, scaled = nominal_mode(model), list[ScaledRecord]()
    what = f"a first natural period of {mode.period:.4g} s"
    cure = "are the units of mass and stiffness right, as t and MN/m?"
    allowed = f"periods up to {MAX_PERIOD:g} s"
    require(mode.period <= MAX_PERIOD, "structure", what, allowed, cure)
    for number, record in enumerate(suite, start=1):
        name = record.name or f"record {number}"
        response = spectral_acceleration(record, mode.period, min(mode.ratio, 0.999))
        sizes = {"PGA": record.extremes[0], "Sa(T1)": response}
        is_moving, allowed = min(sizes.values()) > 0, "a record that moves something"
        require(is_moving, f"record {name}", value="zero throughout", allowed=allowed)
        factor = scale / sizes.get(measure, 1.0)
        length = (len(record.samples) - 1) * record.step
        longest = min(duration, length + FREE_PERIODS * mode.period)
        end_time = max(1, ceil(longest / step - 1e-9)) * step
        intensity = arias_fractions(record.samples, record.step)
        end = min(int(longest / record.step + 1e-9), len(intensity) - 1)
        cut_share = 0.0 if longest >= length else float(1 - intensity[end])
        offset = float(record.samples.mean()) / record.extremes[0]
        warnings = [f"of record {name} {remark}" for remark in record.remarks]
        if abs(offset) > MAX_OFFSET:
            what = f"the mean of record {name} is {percent_text(offset)} of its peak"
            warnings.append(f'{what}; records.baseline = "mean" subtracts it')
        if cut_share > 0:
            what = f"{cut_share:.1%} of the Arias intensity of record {name}"
            warnings.append(f"{what} lies after the end of its motion, {end_time:g} s")
        measures = {x: factor * size for x, size in sizes.items()} | {"scale": 1.0}
        ground = Accelerogram(record.step, factor * record.samples, name=name)
        facts = RecordPeaks(end_time, cut_share, measures, {})
        scaled.append(ScaledRecord(name, ground, facts, tuple(warnings)))
    return tuple(scaled)


def record_peaks(
    model: LinearSystem,
    inputs: Mapping[str, FuzzyNumber],
    record: ScaledRecord,
    names: Sequence[str],
    *,
    step: float,
    alpha: Sequence[float],
    progress: Progress | bool | None = None,
) -> dict[str, Peak]:
    """Return the peaks of a structure under a record, by the names of the peaks."""
    times: dict[str, Any] = {"duration": record.duration, "step": step / NODES, "alpha": alpha}
    return close_peaks(model.moved_by(record.ground), inputs, names, **times, progress=progress)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SuitePeaks(Answer):
    """Peaks over a suite of records.

    Args:
        period_s: T1 at the nominal values.
        damping_ratio: Damping ratio of that mode.
        alpha: Levels, shape (A,).
        by_record: Measures and peaks of each record, by its name.
        statistics: Mean and quantiles over the records of the bounds farthest out of their peaks,
            by peak and statistic, shape (A,) each.
        units: SI units of the outputs.
        peak: Bounds of the largest peak over the records, by name; and "mean q3" …, of the mean of
            one structure's peaks.
        farthest_record: Record under which each of the largest peaks is reached.
    """

    key = "records"
    title = "How far does it move under each record?"
    period_s: float
    damping_ratio: float
    alpha: Array
    by_record: dict[str, RecordPeaks]
    statistics: dict[str, dict[str, Array]]
    units: dict[str, str]
    peak: dict[str, Peak]
    farthest_record: dict[str, str]

    def table(self) -> Table:
        """Return a row for each of the largest peaks over the records, then for each mean."""
        head = ("peak of", f"at α = {self.alpha[0]:g}", "nature", "reached", "record")
        rows: list[tuple[str, ...]] = []
        for name, peak in self.peak.items():
            unit = self.units[output_of(name)]
            low, high = float(peak.lower[0]), float(peak.upper[0])
            range_words = f"{range_text(low, high, peak.nature)} {unit}".strip()
            reached = "not known"
            if np.isfinite(peak.reached[0]):
                reached = engineering(float(peak.reached[0]), unit)
            record = self.farthest_record.get(name, "")
            rows.append((name, range_words, self.nature_text(peak.nature), reached, record))
        return Table(head, rows)

    def records(self) -> list[Record]:
        """Return measures of each record and its peaks farthest out, then their statistics.

        All are those of the lowest level.
        """
        rows: list[Record] = []
        for name, record in self.by_record.items():
            sizes = {f"{x} [m/s^2]": record.measures[x] for x in ("PGA", "Sa(T1)")}
            for peak_name, peak in record.peak.items():
                about: Record = {"output": peak_name, "unit": self.units[output_of(peak_name)]}
                far: Record = {"farthest peak": known(peak.far_end[0])}
                far |= {"peak reached": known(peak.reached[0])}
                far["nature"] = self.nature_text(peak.nature)
                rows.append({"record": name, **sizes, **about, **far})
        for peak_name, statistics in self.statistics.items():
            for name, bound in statistics.items():  # mean, median …
                row = dict.fromkeys(rows[0])
                row |= {"record": f"{name} of all", "output": peak_name}
                row |= {"unit": self.units[output_of(peak_name)], "farthest peak": known(bound[0])}
                rows.append(row)
        return rows

    def words(self) -> str:
        """Return what the peaks are of."""
        return (
            f"Peaks under {len(self.by_record)} records (T1 = {self.period_s:.4g} s,"
            f" ζ = {self.damping_ratio:.3g}, at the most plausible inputs). A mean is that of one"
            " structure's peaks; its bounds are means of the records' bounds."
        )


def over_records(
    model: LinearSystem,
    inputs: Mapping[str, FuzzyNumber],
    suite: Sequence[Accelerogram],
    *,
    duration: float,
    step: float,
    alpha: Sequence[float] = ALPHA,
    names: Sequence[str] = (),
    scale: float = 1.0,
    measure: str = "",
    progress: Progress | None = None,
) -> SuitePeaks:
    """Return the peaks of a structure over a suite of records: of each, the worst and the mean.

    Args:
        model: A linear structure, or a frame that yields; each record moves it in place of its own.
        inputs: Fuzzy parameters by name, in SI units.
        suite: Records, as of `read_suite`.
        duration: Longest motion, in s; a motion ends five natural periods after its record.
        step: Distance of the nodes, in s; peaks are bounded at `NODES` nodes in each.
        alpha: Levels.
        names: Peaks, such as "drift1" or "max q3"; the magnitudes of all outputs unless given.
        scale: Factor of every record; with `measure` the value that its measure gets, in m/s².
        measure: "PGA" or "Sa(T1)"; empty for a factor.
        progress: Called with the completed fraction.

    Raises:
        RefusedError: A record is zero throughout, or the structure is not linear.
    """
    times: dict[str, Any] = {"duration": duration, "step": step}
    records = scaled_records(model, suite, **times, scale=scale, measure=measure)
    names = tuple(names) or tuple(map(str, model.outputs))
    found: dict[str, dict[str, Peak]] = {}
    for k, record in enumerate(records):
        tick = subprogress(progress, k / len(records), (k + 1) / len(records)) if progress else None
        found[record.name] = record_peaks(
            model, inputs, record, names, step=step, alpha=alpha, progress=tick or False
        )
    return summarised(model, inputs, records, found, step=step, alpha=alpha)


def summarised(
    model: LinearSystem,
    inputs: Mapping[str, FuzzyNumber],
    records: Sequence[ScaledRecord],
    peaks: Mapping[str, Mapping[str, Peak]],
    *,
    step: float,
    alpha: Sequence[float],
) -> SuitePeaks:
    """Return worst, mean and statistics over the records, from the peaks under each by its name."""
    mode, worst = nominal_mode(model), worst_peaks(peaks)
    encloses = next(iter(worst.values())).encloses
    farthest: dict[str, str] = {}
    for name in () if encloses else worst:
        reached = {record: float(x[name].outwards.reached[0]) for record, x in peaks.items()}
        farthest[name] = max(reached, key=reached.__getitem__)
    statistics = {}
    for name, peak in worst.items():
        sign = -1.0 if peak.is_least else 1.0  # quantiles of least values are counted from above
        bounds = np.stack([found[name].proved for found in peaks.values()])  # (records, levels)
        statistics[name] = {"mean": bounds.mean(axis=0)}
        for quantile, fraction in QUANTILES.items():
            statistics[name][quantile] = sign * np.quantile(sign * bounds, fraction, axis=0)
    means = mean_peaks(model, inputs, records, peaks, step=step, alpha=alpha)
    return SuitePeaks(
        encloses=encloses,
        period_s=mode.period,
        damping_ratio=mode.ratio,
        alpha=np.array(alpha, float),
        by_record={x.name: replace(x.facts, peak=dict(peaks[x.name])) for x in records},
        statistics=statistics,
        units={output_of(name): model.unit_of(output_of(name)) for name in worst},
        peak={**worst, **means},
        farthest_record=farthest,
    )


def worst_peaks(peaks: Mapping[str, Peaks]) -> dict[str, Peak]:
    """Return bounds of the largest of a structure's peaks over all records, by the peak's name.

    The largest peak rises with the peak under each record, so that its bounds are the largest ones.
    """
    worst: dict[str, Peak] = {}
    bounds = ("lower", "upper", "error", "reached", "least_lower", "least_upper")
    for name, first in next(iter(peaks.values())).items():
        of_records = [found[name].outwards for found in peaks.values()]
        nature = Nature.weakest(peak.nature for peak in of_records)
        largest = {x: np.max([getattr(peak, x) for peak in of_records], axis=0) for x in bounds}
        farthest = max(of_records, key=lambda peak: float(peak.reached[0]))
        found = replace(farthest, nature=nature, **largest)
        worst[name] = mirrored(found) if first.is_least else found
    return worst


def mean_peaks(
    model: LinearSystem,
    inputs: Mapping[str, FuzzyNumber],
    records: Sequence[ScaledRecord],
    peaks: Mapping[str, Peaks],
    *,
    step: float,
    alpha: Sequence[float],
) -> dict[str, Peak]:
    """Return bounds of the mean over the records of a structure's peaks: "mean q3" ….

    The mean of each structure lies between the means of the least and of the greatest peaks. No
    structure may reach the latter, as each record has its own worst one. What is reached is the
    greatest mean of those tried: of the nominal structure and those at corners of each cut. Their
    peaks are read at time nodes, so that the structure's own mean is no smaller.
    """
    first = peaks[records[0].name]
    magnitudes = tuple(name for name in first if name == output_of(name))
    cuts, points = boxes(inputs, alpha), [*_corners(inputs, alpha)]
    points_tried = np.unique(points, axis=0)
    inside = (points_tried >= cuts.lower[:, None]) & (points_tried <= cuts.upper[:, None])
    is_in_cut = inside.all(axis=-1)  # (levels, points)
    tried_means: Array = np.zeros((len(points_tried), len(magnitudes)))
    for record in records:
        moved = model.moved_by(record.ground).with_outputs(magnitudes)
        flow = make_flow(moved, cuts.names, record.duration, step / NODES, "exact")
        columns = [[*map(str, flow.outputs)].index(output) for output in magnitudes]
        tried_means += np.abs(flow.values(points_tried)).max(axis=1)[:, columns] / len(records)
    found: dict[str, Peak] = {}
    for name, tried in zip(magnitudes, tried_means.T, strict=True):
        of_records = [x[name] for x in peaks.values()]
        means: dict[str, Any] = {
            bound: np.mean([getattr(x, bound) for x in of_records], axis=0)
            for bound in ("lower", "upper", "error", "least_lower")
        }
        in_cuts = np.where(is_in_cut, tried, -np.inf)
        mean_minima = np.maximum(means["lower"] - means["error"], means["least_lower"])
        # a structure of any higher cut has at least the mean of that cut's least peaks
        minima_of_higher_cuts = np.maximum.accumulate(mean_minima[::-1])[::-1]
        means["reached"] = np.maximum(minima_of_higher_cuts, in_cuts.max(axis=1))
        means["least_upper"] = np.full_like(mean_minima, np.inf)  # nothing bounds one structure's
        farthest_point = points_tried[in_cuts[0].argmax()].tolist()
        reached_at = dict(zip(cuts.names, farthest_point, strict=True))
        if of_records[0].encloses:  # no point of the box is known to belong to the enclosed set
            means["reached"], reached_at = np.full_like(mean_minima, -np.inf), {}
        nature = Nature.weakest(x.nature for x in of_records)
        found[f"mean {name}"] = replace(
            of_records[0], nature=nature, reached_at=reached_at, **means
        )
    return found


def _corners(inputs: Mapping[str, FuzzyNumber], alpha: Sequence[float]) -> Iterator[Array]:
    """Yield the nominal inputs (d,), and `MAX_CORNERS` corners of each cut at most."""
    cuts = boxes(inputs, alpha)
    yield cuts.nominal
    for low, high in zip(cuts.lower, cuts.upper, strict=True):
        ends = zip(low, high, strict=True)
        yield from map(np.array, islice(product(*ends), MAX_CORNERS))
