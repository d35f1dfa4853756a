"""Stage envelope: fuzzy vibration of a structure, one dataset for each study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from alphacut import frame
from alphacut.case.motion import EnvelopeSection, Study, Tolerance
from alphacut.case.structure import Structure
from alphacut.frame.bounds.remainder import MOST_PARAMETERS
from alphacut.frame.questions.peaks import Peaks, output_of, peaks, tightest
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import FailedError, require
from alphacut.fuzzy.result import Nature
from alphacut.io.files import Document, say
from alphacut.questions.question import PEAK_ERROR
from alphacut.stages.store import Stage, StageContext, StageResult

DEFAULT_TOLERANCE = Tolerance(1e-3, "")
"""Tolerance where none is named: a fraction of each peak."""
FOLLOWERS = ("graph-follower", "improved-graph-follower")
PEAK_BOUNDS = ("lower", "upper", "error", "reached", "least_proved", "least_reached")
"""Bounds of peaks as `Peaks` names them."""


@dataclass(frozen=True)
class EnvelopeTask:
    """One envelope to be computed.

    Args:
        name: Name of the study.
        fuzzy: Fuzzy inputs as the user names them: E, m, m1 …
        duration: Length of the simulation, in s.
        section: Levels, method, step.
        figures: Outputs that are drawn, each with its number in the paper; empty for all.
        limited: Outputs whose peak a question compares with a limit.
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

    def options(self, structure: Structure) -> dict[str, Any]:
        """Options of the method of [envelope]: its tolerance, if it has one."""
        method, tolerance = self.section.method, self.tolerance(structure).value
        # without a tolerance in the case, method auto takes any gap that is proved
        takes_any_gap = method == "auto" and self.section.tolerance is None
        if takes_any_gap or not hasattr(frame.METHODS[method], "tolerance"):
            return {}
        return {"tolerance": tolerance * (self.section.gain if method in FOLLOWERS else 1.0)}

    def compute(self, structure: Structure, context: StageContext) -> StageResult:
        """Computes the envelope as a dataset, and the fuzzy peak of each output as a document."""
        arguments = self.arguments(structure) | _store_and_progress(context)
        result = frame.envelope(**arguments, relative=not self.tolerance(structure).unit)
        signed = [name for name in self.limited if name != output_of(name)]
        peak_bounds = peaks(result, [*map(str, result.outputs), *signed])
        # a second proof of many inputs is hardly tighter: the number of its parts ends it
        has_many_inputs = len(structure.inputs(self.fuzzy)) > MOST_PARAMETERS
        gap = np.inf if has_many_inputs else PEAK_ERROR
        if loose := loose_peaks(peak_bounds, self.limited, gap):
            tighter = replace(self, limited=loose).close_peaks(structure, context)
            peak_bounds = tightest(peak_bounds, tighter)
        return StageResult({"peak": peaks_document(peak_bounds)}, result.to_dataset())

    def compute_peaks(
        self, structure: Structure, context: StageContext, nodes: int = 1
    ) -> StageResult:
        """Computes the peaks of the limited outputs alone, with some nodes in each step."""
        return StageResult({"peak": peaks_document(self.close_peaks(structure, context, nodes))})

    def arguments(self, structure: Structure) -> dict[str, Any]:
        """Arguments of `frame.envelope` and `frame.require_envelope`, by name, from the case."""
        return {
            **self._motion(structure),
            "model": structure.model,
            "method": self.section.method,
            "integrator": self.section.integrator,
            **self.options(structure),
        }

    def close_peaks(self, structure: Structure, context: StageContext, nodes: int = 1) -> Peaks:
        """Peaks of the limited outputs by the method that bounds peaks most closely.

        There are `nodes` nodes in each step of [envelope].
        """
        model = structure.model_with_outputs("limits", outputs_of(self.limited))
        magnitudes = all(name == output_of(name) for name in self.limited)
        method = frame.Auto(PEAK_ERROR, peaks=True, magnitudes=magnitudes)
        arguments = self._motion(structure) | _store_and_progress(context)
        arguments["step"] = self.section.step / nodes
        result = frame.envelope(model, method=method, relative=True, **arguments)
        return peaks(result, self.limited)

    def _motion(self, structure: Structure) -> dict[str, Any]:
        """Fuzzy inputs, duration, step and levels, as arguments of `frame.envelope`."""
        return {
            "inputs": structure.inputs(self.fuzzy),
            "duration": self.duration,
            "step": self.section.step,
            "alpha": self.section.alpha,
        }


def _store_and_progress(context: StageContext) -> dict[str, Any]:
    """Arguments of `frame.envelope` on progress and on the folder of a proof's parts."""
    return {"store": context.parts, "interruptible": False, "progress": context.tick or False}


def outputs_of(peaks: Sequence[str]) -> tuple[str, ...]:
    """Outputs of some peaks, each once."""
    return tuple(dict.fromkeys(map(output_of, peaks)))


def loose_peaks(peaks: Peaks, outputs: Sequence[str], gap: float) -> tuple[str, ...]:
    """Names of those peaks that are not guaranteed to within a gap, or not there at all.

    The gap is that between the proved and the reached peak, relative to the proved one.
    """
    loose = []
    for output in outputs:
        column = peaks.outputs.index(output) if output in peaks.outputs else None
        if column is not None and peaks.natures[column] is Nature.GUARANTEED:
            upper, reached = peaks.upper[:, column], peaks.reached[:, column]
            if (upper - reached <= gap * np.abs(upper)).all():
                continue
        loose.append(output)
    return tuple(loose)


def peaks_document(peaks: Peaks) -> Document:
    """Peaks of each output by its name, each with its bounds on all levels, in SI."""
    return {
        name: {bound: getattr(peaks, bound)[:, column] for bound in PEAK_BOUNDS}
        | {"nature": str(peaks.natures[column])}
        for column, name in enumerate(peaks.outputs)
    }


def peaks_from_document(document: Document, alpha: Sequence[float]) -> Peaks:
    """Peaks from the document of `peaks_document` on levels `alpha`; None is an infinite bound."""
    bounds: dict[str, Array] = {}
    for bound in PEAK_BOUNDS:
        infinite = -np.inf if bound in ("lower", "reached", "least_proved") else np.inf
        levels = [[infinite if x is None else x for x in peak[bound]] for peak in document.values()]
        bounds[bound] = np.array(levels).T
    natures = tuple(Nature(peak["nature"]) for peak in document.values())
    return Peaks(alpha=np.array(alpha), outputs=tuple(document), natures=natures, **bounds)


def tasks(
    section: EnvelopeSection, studies: Sequence[Study], limited: tuple[str, ...] = ()
) -> tuple[EnvelopeTask, ...]:
    """Tasks of the envelopes of a case: one for each study, or the one of [envelope], "all".

    Only tasks with the motion of [envelope] have the outputs `limited` by questions.
    """
    studied = tuple(
        EnvelopeTask(study.name, study.fuzzy, study.duration, section, study.figures)
        for study in studies
    ) or (EnvelopeTask("all", section.fuzzy, section.duration, section),)
    return tuple(
        replace(task, limited=limited) if task.has_motion_of(section) else task for task in studied
    )


def stage(structure: Structure, task: EnvelopeTask) -> Stage:
    """The stage of one study."""
    inputs = [structure.model, structure.numbers, task.fuzzy, task.duration, task.section]
    inputs += [task.limited]
    compute = partial(task.compute, structure)
    return Stage(f"envelope_{task.name}", inputs, ("fuzzy", "frame"), compute)


def document(result: StageResult, fuzzy: Sequence[str]) -> Document:
    """Numbers on an envelope in SI: extremes and errors at the lowest level, peaks, cost."""
    data = result.arrays
    lowest, facts = data.isel(alpha=0), ("trajectories", "seconds", "method", "nature")
    columns = {
        "min": lowest["lower"].min("time"),
        "max": lowest["upper"].max("time"),
        "mean_width": (lowest["upper"] - lowest["lower"]).mean("time"),
        "error": lowest["error"].max("time"),
    }
    names = [*map(str, data["output"].values)]
    return {
        "fuzzy": list(fuzzy),
        **{key: dict(zip(names, map(float, x.values), strict=True)) for key, x in columns.items()},
        "alpha": data["alpha"].values,
        "peak": result.document["peak"],
        **{name: data.attrs[name] for name in facts},
        "motions_tested": int(data.attrs.get("motions_tested", 0)),
        "step": float(data["time"].values[1]),
    }


def require_tolerance(result: StageResult, task: EnvelopeTask, structure: Structure) -> None:
    """Requires the declared errors of an envelope within the tolerance, where the case names one.

    A larger error of a Graph Follower is a warning: it takes the tolerance only as the least gain
    for which it computes a trajectory. Others fail.
    """
    if task.section.tolerance is None:
        return
    allowed, data = task.tolerance(structure), result.arrays
    errors = data["error"].max(("alpha", "time")).values
    for name, error in zip(map(str, data["output"].values), errors, strict=True):
        has_unit = allowed.unit in ("", Output(name).unit)
        if not allowed.unit:
            error = error / max(result.document["peak"][name]["upper"])
        if has_unit and error > allowed.value * (1 + 1e-9):
            what = f"the error of {name} is {error:.2g}; the case allows {allowed.value:.2g}"
            cure = "method auto, or a smaller envelope.step, reaches it"
            if data.attrs["method"] not in FOLLOWERS:
                raise FailedError(what, cure)
            say(f"warning: {what}; {cure}")
