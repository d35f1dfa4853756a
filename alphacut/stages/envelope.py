"""Stage envelope: fuzzy vibration of a structure, one dataset for each study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut import frame
from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError, require
from alphacut.base.progress_bar import Progress, searching, subprogress
from alphacut.case.motion import EnvelopeSection, Study, Tolerance
from alphacut.case.structure import Structure
from alphacut.frame.analyses.limits import thresholds_of
from alphacut.frame.analyses.peaks import (
    PEAK_ERROR,
    Peak,
    close_peaks,
    loose_peaks,
    peaks,
    tightest,
    with_causes,
)
from alphacut.frame.boxes import MAX_PARAMETERS
from alphacut.frame.structures.quantities import Output, output_of
from alphacut.fuzzy.result import Nature
from alphacut.io.files import Document, say
from alphacut.stages.store import Stage, StageContext, StageResult

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, eq=False, kw_only=True)
class EnvelopeResult:
    """An envelope in SI units.

    Args:
        fuzzy: Fuzzy inputs as the case names them.
        min: Smallest value of each output over time at the lowest level.
        max: Largest value, likewise.
        error: Largest error, likewise.
        alpha: Levels, shape (A,).
        peak: Peaks by name, such as "q1" or "max q1".
        seconds: Time that it took.
        method: Method that found it.
        nature: Guarantee of the bounds.
        motions_tested: Number of exact responses that were compared with the bounds.
        step: Distance of the time nodes, in s.
        units: SI units of the outputs.
        drawn: Outputs that are drawn, all if empty.
    """

    fuzzy: tuple[str, ...]
    min: dict[str, float]
    max: dict[str, float]
    error: dict[str, float]
    alpha: Array
    peak: dict[str, Peak]
    seconds: float
    method: str
    nature: Nature
    motions_tested: int
    step: float = 0.0
    units: dict[str, str]
    drawn: tuple[str, ...] = ()

    @property
    def is_over_time(self) -> bool:
        """Whether times are in s: not where the period of the force is uncertain."""
        return "frequency" not in self.fuzzy


@dataclass(frozen=True)
class EnvelopeTask:
    """One envelope to be computed.

    Args:
        name: Name of the study.
        fuzzy: Fuzzy inputs as the case names them, such as E, m or m1.
        duration: Length of the simulation, in s.
        section: What holds for all studies.
        figures: Outputs that are drawn, each with its number in the paper; empty for all.
        limited: Peaks that a question compares with a limit.
        limits: The limits, in SI units.
    """

    name: str
    fuzzy: tuple[str, ...]
    duration: float
    section: EnvelopeSection
    figures: Mapping[str, str] = field(default_factory=dict)
    limited: tuple[str, ...] = ()
    limits: tuple[frame.Limit, ...] = ()

    @property
    def times(self) -> dict[str, float]:
        """Length of the response and distance of its time nodes in s, by the names of arguments."""
        return {"duration": self.duration, "step": self.section.step}

    def tolerance(self, structure: Structure) -> Tolerance:
        """Return the error of the envelope that the case allows, or a thousandth of each peak.

        Args:
            structure: The structure, for the units of its outputs.

        Returns:
            Tolerance: Value in m or N with this unit; or a fraction of each peak with the unit "".

        Raises:
            RefusedError: It is in the unit of no output.
        """
        units = {Output(x).unit for x in structure.outputs}
        # A thousandth of each peak is below what a figure shows and what a limit is judged by.
        tolerance = self.section.tolerance or Tolerance(1e-3, "")
        value = f"{tolerance.value:g} {tolerance.unit}"
        allowed = f"a fraction, or {', '.join(sorted(units))}"
        require(tolerance.unit in {"", *units}, "envelope.tolerance", value=value, allowed=allowed)
        return tolerance

    def has_response_of(self, section: EnvelopeSection) -> bool:
        """Return whether it has the inputs and the duration of [envelope]."""
        # Method, levels and time step are those of [envelope] in each study.
        same_inputs = set(self.fuzzy) == set(section.fuzzy)
        return same_inputs and self.duration == section.duration

    def compute(self, structure: Structure, context: StageContext) -> StageResult[EnvelopeResult]:
        """Compute the envelope of the outputs over time, and the bounds of their peaks.

        Args:
            structure: The structure with its fuzzy parameters.
            context: Its `tick` is called with the completed fraction of the work.

        Returns:
            The numbers of the envelope as `EnvelopeResult`, in SI units, and the dataset with its
            axes alpha, output and time.

        Raises:
            RefusedError: An input, an output or the tolerance does not fit the structure.
            FailedError: A response could not be computed.
        """
        # The peaks that questions limit may take a second analysis, for about the same time.
        end = 1.0
        tick = context.tick
        if self.limited:
            end = 0.5
            tick = searching(tick)
        result = self._envelope(structure, subprogress(tick, 0.0, end))
        peak_bounds = self._peaks(structure, result, subprogress(tick, end, 1.0))
        # α-cuts are nested: the lowest level contains all others, so that its extremes and its
        # largest error are those of the whole envelope.
        data = result.to_dataset().sel(output=list(map(str, structure.outputs)))
        lowest = data.isel(alpha=0)
        names = [str(name) for name in data["output"].values]

        def by_output(values: xarray.DataArray) -> dict[str, float]:
            """Return values over the outputs, shape (outputs,), by the names of these."""
            return dict(zip(names, map(float, values.values), strict=True))

        numbers = EnvelopeResult(
            fuzzy=structure.with_always_fuzzy(self.fuzzy),
            min=by_output(lowest["lower"].min("time")),
            max=by_output(lowest["upper"].max("time")),
            error=by_output(lowest["error"].max("time")),
            alpha=data["alpha"].values,
            peak=peak_bounds,
            seconds=float(data.attrs["seconds"]),
            method=str(data.attrs["method"]),
            nature=Nature(data.attrs["nature"]),
            motions_tested=int(data.attrs.get("motions_tested", 0)),
            step=float(data["time"].values[1]),  # equal steps from time 0 on
            units={x: structure.unit(x) for x in (*names, *outputs_of([*peak_bounds]))},
        )
        return StageResult(numbers, data)

    def _envelope(self, structure: Structure, progress: Progress) -> frame.Envelope:
        """Return the envelope: of the learned set if the inputs are its parameters, else of a box.

        The former has all limited outputs, whose bounds over the box around the set are wider.

        Args:
            structure: The structure with its fuzzy parameters.
            progress: Called with the completed fraction.
        """
        arguments = self.arguments(structure)
        learned = structure.learned
        linear = structure.linear
        is_proof = frame.METHODS[self.section.method].is_exact
        if learned and linear and is_proof and set(arguments["inputs"]) == set(learned.names):
            outputs = dict.fromkeys((*structure.outputs, *outputs_of(self.limited)))
            structure.require_quantities("limits", tuple(outputs))
            return frame.learned_envelope(
                linear.with_outputs(tuple(outputs)),
                learned,
                self.section.method,
                duration=self.duration,
                step=self.section.step,
                progress=progress,
            )
        is_relative = not self.tolerance(structure).unit
        return frame.envelope(**arguments, relative=is_relative, progress=progress)

    def _peaks(
        self, structure: Structure, envelope: frame.Envelope, progress: Progress
    ) -> dict[str, Peak]:
        """Return the bounds of the peaks over time, by name.

        All outputs of the envelope have the peak of their magnitude, such as "q3". Those that
        questions limit may also be "max q3" or "min q3", the largest and the smallest value. A
        limited peak whose guaranteed bound is more than half a per cent from an attained value is
        bounded again by a proof for such peaks alone, and the tighter of both bounds is returned.

        Args:
            structure: The structure with its fuzzy parameters.
            envelope: Its envelope.
            progress: Called with the completed fraction of the second proof; never if there is
                none.

        Raises:
            RefusedError: A limited output is none that the structure can have.
            FailedError: A response could not be computed.
        """
        # Limited outputs that are not observed have no envelope: their peaks come from the second
        # proof. `output_of` is "q3" for "max q3", so that it differs from names of signed peaks.
        outputs = [str(name) for name in envelope.outputs]
        signed = [x for x in self.limited if x != output_of(x) and output_of(x) in outputs]
        found = with_causes(peaks(envelope, [*outputs, *signed]), structure.model, envelope)
        # A second proof of many inputs is hardly tighter, since it ends at the largest number of
        # sub-boxes: an infinite gap lets each guaranteed peak stay as it is.
        gap = PEAK_ERROR
        if len(structure.inputs(self.fuzzy)) > MAX_PARAMETERS:
            gap = np.inf
        # Where the method has searched the peaks themselves, a second search finds no more.
        is_searched = envelope.searched_peaks is not None
        limited = [x for x in self.limited if not is_searched or x not in found]
        # Names of peaks that are missing or not guaranteed within the gap are loose. Both bounds of
        # them hold, so that the tighter ends are taken.
        if loose := loose_peaks(found, limited, gap):
            found = tightest(found, replace(self, limited=loose).close_peaks(structure, progress))
        return found

    def arguments(self, structure: Structure) -> Document:
        """Return the arguments by name with which `frame.envelope` computes the envelope.

        They are also those of `frame.require_envelope`, which refuses what cannot be computed.

        Args:
            structure: The structure with its fuzzy parameters, which must have the inputs of the
                task.

        Returns:
            Model, fuzzy inputs, duration and time step in s, α-levels, method and integrator; and
            the tolerance as a number, if the method takes one.

        Raises:
            RefusedError: An input is unknown or crisp, or the tolerance is in the unit of no
                output.
        """
        section = self.section
        method = section.method
        of_method = frame.METHODS[method]
        arguments = {**self._response(structure), "model": structure.model, "method": method}
        arguments["integrator"] = section.integrator
        # Without a tolerance in the case, method auto takes any guaranteed bounds as they are: a
        # tolerance that nobody asked for would make it search on.
        takes_any_gap = method == "auto" and section.tolerance is None
        if not takes_any_gap and hasattr(of_method, "tolerance"):
            tolerance = self.tolerance(structure).value
            # A follower takes it as the smallest gain for which it computes a trajectory. Gains of
            # several trajectories add up, so that each may be a fraction of the tolerance only.
            if of_method.tolerance_is_gain:
                tolerance *= section.gain
            arguments["tolerance"] = tolerance
        if self.limits and hasattr(of_method, "thresholds"):
            arguments["thresholds"] = thresholds_of(structure.model, self.limits)
        return arguments

    def close_peaks(self, structure: Structure, progress: Progress) -> dict[str, Peak]:
        """Return the peaks of the limited outputs, by the method that bounds them most closely."""
        # The structure is observed at the limited outputs alone: fewer outputs are a faster proof.
        structure.require_quantities("limits", outputs_of(self.limited))
        response = self._response(structure)
        return close_peaks(
            structure.model,
            names=self.limited,
            thresholds=thresholds_of(structure.model, self.limits),
            progress=progress,
            **response,
        )

    def _response(self, structure: Structure) -> dict[str, Any]:
        """Return the arguments that say which response is meant, by name.

        These are the fuzzy parameters as `inputs`, in SI units, `duration` and `step` in s, and the
        levels `alpha`.

        Raises:
            RefusedError: An input is unknown or crisp.
        """
        alpha = self.section.alpha
        return {"inputs": structure.inputs(self.fuzzy), "alpha": alpha, **self.times}


def outputs_of(peaks: Sequence[str]) -> tuple[str, ...]:
    """Return the outputs of some peaks, each once."""
    return tuple(dict.fromkeys(map(output_of, peaks)))


def tasks(
    section: EnvelopeSection,
    studies: Sequence[Study],
    limited: tuple[str, ...] = (),
    limits: tuple[frame.Limit, ...] = (),
) -> tuple[EnvelopeTask, ...]:
    """Return the task of each study of a case; without studies that of [envelope], named "all".

    Args:
        section: What holds for all studies, and the response that questions are asked about.
        studies: Names of the fuzzy inputs, duration and drawn outputs of each study.
        limited: Names of the peaks that questions limit. They go to the tasks with the inputs and
            the duration of [envelope] alone.
        limits: Their limits, in SI units.
    """
    found = [EnvelopeTask(x.name, x.fuzzy, x.duration, section, x.figures) for x in studies]
    if not found:
        found = [EnvelopeTask("all", section.fuzzy, section.duration, section)]
    # Questions are about the response of [envelope]. A study with this response bounds the limited
    # peaks as well, which saves a second computation.
    tasks_of_case = []
    for task in found:
        if task.has_response_of(section):
            task = replace(task, limited=limited, limits=limits)
        tasks_of_case.append(task)
    return tuple(tasks_of_case)


def stage(structure: Structure, task: EnvelopeTask) -> Stage[EnvelopeResult]:
    """Return the stage of one study."""
    # The outputs that are drawn and the name are left out: neither changes a bound.
    inputs = [structure.model, structure.numbers, task.fuzzy, task.duration, task.section]
    inputs += [task.limited, task.limits, structure.learned]
    compute = partial(task.compute, structure)
    return Stage(f"envelope_{task.name}", inputs, ("fuzzy", "frame"), EnvelopeResult, compute)


def require_tolerance(
    result: StageResult[EnvelopeResult], task: EnvelopeTask, structure: Structure
) -> None:
    """Require that the declared errors of an envelope are within the tolerance of the case.

    Without a tolerance there is nothing to require. A tolerance in m or N applies to the outputs in
    this unit; one without a unit is a fraction of the largest peak of each output. For a nonlinear
    system, and for a Graph Follower, a larger error is a warning only: a follower takes the
    tolerance as the smallest gain for which it computes a trajectory, not as a limit of its error.

    Args:
        result: Its `arrays` have the error of each output, over α and time, in SI units, and its
            `numbers` the peaks with theirs.
        task: The tolerance and the method.
        structure: The structure, for the units of its outputs.

    Raises:
        FailedError: An error is larger, of a linear system and another method.
        RefusedError: The tolerance is in the unit of no output.
    """
    if task.section.tolerance is None:
        return
    allowed = task.tolerance(structure)
    data = result.arrays
    errors = data["error"].max(("alpha", "time")).values
    for name, error in zip(map(str, data["output"].values), errors, strict=True):
        peak = result.numbers.peak[name]
        # The error of an estimated peak also contains what lies between the time nodes; the errors
        # of the band are those at the nodes alone.
        if peak.nature is Nature.ESTIMATED:
            error = max(error, float(peak.error.max()))
        # An output that stays at zero, such as a residual drift where nothing yields, has a peak of
        # zero without any error.
        if not allowed.unit and error > 0:
            error = error / peak.upper.max()
        has_unit = allowed.unit in ("", result.numbers.units[name])
        # 1e-9 of the tolerance is left to the rounding of the errors' own computation.
        if not has_unit or error <= allowed.value * (1 + 1e-9):
            continue
        what = f"the error of {name} is {error:.2g}; the case allows {allowed.value:.2g}"
        cure = "method auto, or a smaller envelope.step, reaches it"
        is_gain = frame.METHODS[task.section.method].tolerance_is_gain
        if structure.linear is not None and not is_gain:
            raise FailedError(what, cure)
        say(f"warning: {what}; {cure}")
