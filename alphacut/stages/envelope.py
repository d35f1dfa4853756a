"""Stage envelope: fuzzy vibration of a structure, one dataset for each study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from alphacut import frame
from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError, require
from alphacut.base.progress_bar import Progress, subprogress
from alphacut.case.motion import EnvelopeSection, Study, Tolerance
from alphacut.case.structure import Structure
from alphacut.frame.analyses.peaks import PEAK_BOUNDS, Peak, Peaks, peaks, tightest
from alphacut.frame.bounds.model_error import MAX_PARAMETERS
from alphacut.frame.structures.quantities import Output, output_of
from alphacut.fuzzy.result import Nature
from alphacut.io.files import Document, say
from alphacut.stages.store import Numbers, Stage, StageContext, StageResult, Values

if TYPE_CHECKING:
    import xarray

DEFAULT_TOLERANCE = Tolerance(1e-3, "")
"""Tolerance where none is named: a fraction of each peak."""
FOLLOWERS = ("graph-follower", "improved-graph-follower")
WIDENING = 0.01
"""Fraction of a peak from which on it is said that a smaller step would narrow its bound."""
PEAK_ERROR = 5e-3
"""Error of the peaks of limited outputs that is aimed at, as a share of each."""


class PeakResult(Numbers):
    """Bounds of the peak of an output on each level, in SI, as `Peak` has them; nan if unknown.

    The peak is the largest magnitude, or the greatest ("max q3") or least ("min q3") value, which
    has its own sign here, so that `lower` and `upper` change places. No motion passes `proved`;
    `reached_at` has the inputs of one that reaches the peak on the lowest level, if known. Motions
    may add `between_nodes` to its bound there within the steps. `encloses` is that of `Peak`.
    """

    lower: Values
    upper: Values
    error: Values
    reached: Values
    least_lower: Values
    least_upper: Values
    proved: Values
    nature: Nature
    between_nodes: float = 0.0
    is_least: bool = False
    reached_at: dict[str, float] = Field(default={})
    encloses: str = ""

    @property
    def far_end(self) -> Array:
        """Bound on each level of the peaks farthest out: the upper one, or that of least values."""
        return self.lower if self.is_least else self.upper

    @property
    def is_widened_by_step(self) -> bool:
        """Whether what motions add between nodes is most of the gap or error, and much."""
        bound, reached = float(self.far_end[0]), float(self.reached[0])
        is_proved = self.nature is Nature.GUARANTEED and np.isfinite(reached)
        width = abs(bound - reached) if is_proved else float(self.error[0])
        return self.between_nodes > max(width / 2, WIDENING * abs(bound))

    def gap(self, level: int) -> float:
        """Relative gap between that bound and what a motion reaches, on a level; nan if unknown."""
        bound, reached = float(self.far_end[level]), float(self.reached[level])
        return abs((bound - reached) / bound) if bound else 0.0


PeakResults = dict[str, PeakResult]
"""Peaks by their names, such as q3 and max q3."""


class EnvelopeResult(Numbers):
    """An envelope in SI: extremes and errors by output at the lowest level, peaks, and cost.

    `drawn` are the outputs that are drawn, all if empty.
    """

    fuzzy: tuple[str, ...]
    min: dict[str, float]
    max: dict[str, float]
    error: dict[str, float]
    alpha: Values
    peak: PeakResults
    seconds: float
    method: str
    nature: Nature
    motions_tested: int
    step: float = 0.0
    units: dict[str, str]
    drawn: tuple[str, ...] = ()


@dataclass(frozen=True)
class EnvelopeTask:
    """One envelope to be computed; `fuzzy` inputs are named as in the case, such as E, m or m1.

    `figures` are the outputs that are drawn, each with its number in the paper, or empty for all;
    `limited` those peaks that a question compares with a limit.
    """

    name: str
    fuzzy: tuple[str, ...]
    duration: float
    section: EnvelopeSection
    figures: Mapping[str, str] = field(default_factory=dict)
    limited: tuple[str, ...] = ()

    def tolerance(self, structure: Structure) -> Tolerance:
        """Error of the envelope that the case allows, in the unit of some output or relative."""
        units = {Output(x).unit for x in structure.outputs}
        tolerance = self.section.tolerance or DEFAULT_TOLERANCE
        value = f"{tolerance.value:g} {tolerance.unit}"
        allowed = f"a fraction, or {', '.join(sorted(units))}"
        require(tolerance.unit in {"", *units}, "envelope.tolerance", value=value, allowed=allowed)
        return tolerance

    def has_motion_of(self, section: EnvelopeSection) -> bool:
        """True if it has the inputs and the duration of [envelope]."""
        same_inputs = set(self.fuzzy) == set(section.fuzzy)
        return same_inputs and self.duration == section.duration

    def compute(self, structure: Structure, context: StageContext) -> StageResult[EnvelopeResult]:
        """Computes the envelope as a dataset; its extremes and the peaks of its outputs."""
        half = 0.5 if self.limited else 1.0  # a second analysis is that of limited peaks
        first, second = (subprogress(context.tick, *x) for x in ((0.0, half), (half, 1.0)))
        arguments = self.arguments(structure) | {"progress": first}
        result = frame.envelope(**arguments, relative=not self.tolerance(structure).unit)
        outputs = [*map(str, result.outputs)]  # of others `close_peaks` has the peaks
        signed = [x for x in self.limited if x != output_of(x) and output_of(x) in outputs]
        peak_bounds = peaks(result, [*outputs, *signed])
        # a second proof of many inputs is hardly tighter: the number of its parts ends it
        has_many_inputs = len(structure.inputs(self.fuzzy)) > MAX_PARAMETERS
        gap = np.inf if has_many_inputs else PEAK_ERROR
        is_searched = result.searched_peaks is not None  # a second search finds no more
        limited = [x for x in self.limited if not is_searched or x not in peak_bounds]
        if loose := loose_peaks(peak_bounds, limited, gap):
            tighter = replace(self, limited=loose).close_peaks(structure, second)
            peak_bounds = tightest(peak_bounds, tighter)
        data = result.to_dataset()
        lowest, names = data.isel(alpha=0), [*map(str, data["output"].values)]

        def by_output(values: xarray.DataArray) -> dict[str, float]:
            return dict(zip(names, map(float, values.values), strict=True))

        numbers = EnvelopeResult(
            fuzzy=self.fuzzy,
            min=by_output(lowest["lower"].min("time")),
            max=by_output(lowest["upper"].max("time")),
            error=by_output(lowest["error"].max("time")),
            alpha=data["alpha"].values,
            peak=peak_results(peak_bounds),
            seconds=float(data.attrs["seconds"]),
            method=str(data.attrs["method"]),
            nature=Nature(data.attrs["nature"]),
            motions_tested=int(data.attrs.get("motions_tested", 0)),
            step=float(data["time"].values[1]),
            units={x: structure.unit(x) for x in (*names, *outputs_of([*peak_bounds]))},
        )
        return StageResult(numbers, data)

    def compute_peaks(
        self, structure: Structure, context: StageContext, nodes: int = 1
    ) -> StageResult[PeakResults]:
        """Computes the peaks of the limited outputs alone, with some nodes in each step."""
        return StageResult(peak_results(self.close_peaks(structure, context.tick, nodes)))

    def arguments(self, structure: Structure) -> Document:
        """Arguments of `frame.envelope` and `frame.require_envelope`, by name, from the case."""
        section, method = self.section, self.section.method
        arguments = {**self._motion(structure), "model": structure.model, "method": method}
        arguments["integrator"] = section.integrator
        tolerance = self.tolerance(structure).value
        # without a tolerance in the case, method auto takes any gap that is proved
        takes_any_gap = method == "auto" and section.tolerance is None
        if not takes_any_gap and hasattr(frame.METHODS[method], "tolerance"):
            arguments["tolerance"] = tolerance * (section.gain if method in FOLLOWERS else 1.0)
        return arguments

    def close_peaks(self, structure: Structure, progress: Progress, nodes: int = 1) -> Peaks:
        """Peaks of the limited outputs by the method that bounds peaks most closely.

        There are `nodes` nodes in each step of [envelope].
        """
        model = structure.model_with_outputs("limits", outputs_of(self.limited))
        magnitudes = all(name == output_of(name) for name in self.limited)
        method = frame.Auto(PEAK_ERROR, peaks=True, magnitudes=magnitudes)
        motion = self._motion(structure) | {"step": self.section.step / nodes}
        result = frame.envelope(model, method=method, relative=True, progress=progress, **motion)
        return peaks(result, self.limited)

    def _motion(self, structure: Structure) -> dict[str, Any]:
        return {
            "inputs": structure.inputs(self.fuzzy),
            "duration": self.duration,
            "step": self.section.step,
            "alpha": self.section.alpha,
        }


def outputs_of(peaks: Sequence[str]) -> tuple[str, ...]:
    """Outputs of some peaks, each once."""
    return tuple(dict.fromkeys(map(output_of, peaks)))


def loose_peaks(peaks: Peaks, outputs: Sequence[str], gap: float) -> tuple[str, ...]:
    """Names of those peaks that are not guaranteed to within a gap, or not there at all.

    The gap is that between the proved and the reached peak, relative to the proved one. Where the
    inputs enclose a set, no peak is known to be reached and any guaranteed one is taken.
    """

    def is_close(peak: Peak) -> bool:
        is_near = (peak.upper - peak.reached <= gap * np.abs(peak.upper)).all()
        return peak.nature is Nature.GUARANTEED and bool(is_near or peak.encloses)

    return tuple(name for name in outputs if name not in peaks or not is_close(peaks[name]))


def peak_results(peaks: Peaks) -> PeakResults:
    """Peaks as results by name; a least value has its own sign."""
    results: PeakResults = {}
    for name, peak in peaks.items():
        bounds = {bound: getattr(peak, bound) for bound in PEAK_BOUNDS}
        bounds["proved"] = peak.greatest_bounds.upper
        is_least = name.startswith("min ")  # which `Peak` has as the greatest value of −q
        bounds = _negative(bounds) if is_least else bounds
        kind = {"nature": peak.nature, "is_least": is_least, "reached_at": peak.reached_at}
        kind["encloses"] = peak.encloses
        kind["between_nodes"] = peak.between_nodes
        results[name] = PeakResult.model_validate(bounds | kind)
    return results


def peaks_of(results: PeakResults, alpha: Sequence[float]) -> dict[str, Peak]:
    """Peaks from their results on levels `alpha`."""
    peaks = {}
    for name, peak in results.items():
        bounds = {bound: getattr(peak, bound) for bound in PEAK_BOUNDS}
        bounds = _negative(bounds) if peak.is_least else bounds
        for bound, values in bounds.items():
            unknown = np.inf if bound in ("upper", "least_upper") else -np.inf
            bounds[bound] = np.where(np.isnan(values), unknown, values)
        is_signed = name.startswith(("max ", "min "))
        kind: dict[str, Any] = {"is_signed": is_signed, "reached_at": peak.reached_at}
        kind |= {"between_nodes": peak.between_nodes, "encloses": peak.encloses}
        peaks[name] = Peak(np.array(alpha), **bounds, nature=peak.nature, **kind)
    return peaks


def _negative(bounds: Mapping[str, Array]) -> dict[str, Array]:
    """Bounds of the negative of a peak, whose error is the same."""
    negative = {name: 0.0 - values for name, values in bounds.items()}
    ends = {"lower": negative["upper"], "upper": negative["lower"]}
    return negative | ends | {"error": bounds["error"]}


def tasks(
    section: EnvelopeSection, studies: Sequence[Study], limited: tuple[str, ...] = ()
) -> tuple[EnvelopeTask, ...]:
    """Tasks of the envelopes of a case: one for each study, or the one of [envelope], "all".

    Only tasks with the motion of [envelope] have the outputs `limited` by questions.
    """
    tasks = [EnvelopeTask(x.name, x.fuzzy, x.duration, section, x.figures) for x in studies]
    tasks = tasks or [EnvelopeTask("all", section.fuzzy, section.duration, section)]
    return tuple(replace(x, limited=limited if x.has_motion_of(section) else ()) for x in tasks)


def stage(structure: Structure, task: EnvelopeTask) -> Stage[EnvelopeResult]:
    """The stage of one study."""
    inputs = [structure.model, structure.numbers, task.fuzzy, task.duration, task.section]
    inputs += [task.limited]
    compute = partial(task.compute, structure)
    return Stage(f"envelope_{task.name}", inputs, ("fuzzy", "frame"), EnvelopeResult, compute)


def require_tolerance(
    result: StageResult[EnvelopeResult], task: EnvelopeTask, structure: Structure
) -> None:
    """Requires the declared errors of an envelope within the tolerance, where the case names one.

    A larger error of a Graph Follower is a warning: it takes the tolerance only as the least gain
    for which it computes a trajectory. Others fail.
    """
    if task.section.tolerance is None:
        return
    allowed, data = task.tolerance(structure), result.arrays
    errors = data["error"].max(("alpha", "time")).values
    for name, error in zip(map(str, data["output"].values), errors, strict=True):
        has_unit = allowed.unit in ("", result.numbers.units[name])
        peak = result.numbers.peak[name]
        if peak.nature is Nature.ESTIMATED:  # of a band of motions that were made alone
            error = max(error, float(peak.error.max()))
        if not allowed.unit:
            error = error / peak.upper.max()
        if has_unit and error > allowed.value * (1 + 1e-9):
            what = f"the error of {name} is {error:.2g}; the case allows {allowed.value:.2g}"
            cure = "method auto, or a smaller envelope.step, reaches it"
            is_general = isinstance(structure.model, frame.LagrangianSystem)
            if not is_general and task.section.method not in FOLLOWERS:
                raise FailedError(what, cure)
            say(f"warning: {what}; {cure}")
