"""Stages of the questions of a case: read a section, call the analysis, return its answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pkgutil import resolve_name
from typing import Any, TypedDict

from alphacut.base.errors import RefusedError
from alphacut.base.progress_bar import Progress
from alphacut.case.analyses import ANALYSES, answer_class
from alphacut.case.floors import FloorSpectrumSection
from alphacut.case.generated import GeneratedSection
from alphacut.case.limits import (
    DecisionSection,
    FragilitySection,
    ProbabilitySection,
)
from alphacut.case.structure import Structure
from alphacut.case.types import Section
from alphacut.frame import (
    Decision,
    FloorSpectrum,
    Fragility,
    Probability,
    SuitePeaks,
    decide,
    floor_spectrum,
    probability,
)
from alphacut.frame.analyses.answer import Answer
from alphacut.frame.analyses.fragility import fragility_of, with_nominal
from alphacut.frame.analyses.incremental import Increments
from alphacut.frame.analyses.limits import limits_by_name
from alphacut.frame.analyses.peaks import Peaks
from alphacut.frame.analyses.question import Asked
from alphacut.frame.analyses.suites import ScaledRecord
from alphacut.fuzzy import FuzzyNumber
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.store import Stage, StageContext, StageResult


class Times(TypedDict):
    """Length of a response and distance of its time nodes, in s."""

    duration: float
    step: float


@dataclass(frozen=True)
class Response:
    """What questions are asked about.

    Args:
        structure: The structure.
        task: Its response of section [envelope].
        peaks: Peaks of the outputs; None where no question reads them.
        suite: Peaks under each record, if there is a suite.
        increments: Peaks over the scales of each record by its name, of a frame that yields.
        records: The records of the suite.
    """

    structure: Structure
    task: EnvelopeTask
    peaks: Peaks | None = None
    suite: SuitePeaks | None = None
    increments: Mapping[str, Increments] = field(default_factory=dict)
    records: tuple[ScaledRecord, ...] = ()

    @property
    def inputs(self) -> dict[str, FuzzyNumber]:
        """Fuzzy inputs by parameter."""
        return self.structure.inputs(self.task.fuzzy)

    @property
    def times(self) -> Times:
        """Length of the response and distance of its time nodes, by the names of arguments."""
        return {"duration": self.task.duration, "step": self.task.section.step}


def decision(section: DecisionSection, response: Response, _: Progress) -> Decision:
    """Return the answer to [decision]: possibility and necessity that each limit is exceeded.

    Args:
        section: Its limits.
        response: Its `suite` is judged if there is one, else its `peaks`, which must be there.
        _: Progress, which is not reported: the answer follows from known peaks.

    Raises:
        RefusedError: A limit does not fit the structure.
    """
    structure = response.structure
    found = response.suite or response.peaks
    assert found is not None  # a question that reads peaks has them computed before
    # Of a suite the largest peak over the records is judged, or the mean over them. Units are given
    # as well, since the analysis knows the names of outputs and inputs alone.
    limits = section.limits_of(structure)
    return decide(
        found,
        limits,
        units={limit.output: structure.unit(limit.output) for limit in limits},
        input_units={name: structure.input_unit(name) for name in response.inputs},
    )


def probability_of(section: ProbabilitySection, response: Response, tick: Progress) -> Probability:
    """Return the answer to [probability]: bounds of the probability that limits are exceeded.

    Args:
        section: Its limits, the number of samples, and the names of the inputs that are random. The
            membership function of a random input gives the shape of its density; all other fuzzy
            inputs of the envelope stay fuzzy.
        response: The structure, and the α-levels, duration and time step of its response. Its peaks
            are not used, since samples are computed anew.
        tick: Called with the completed fraction of the work.

    Raises:
        RefusedError: A limit or a random input does not fit the structure.
        FailedError: A response could not be computed.
    """
    structure = response.structure
    # An input is random or fuzzy, not both: random ones are taken from the fuzzy ones.
    random = structure.inputs(section.random, "probability.random")
    return probability(
        structure.model,
        {name: number for name, number in response.inputs.items() if name not in random},
        section.limits_of(structure),
        random,
        **response.times,
        alpha=response.task.section.alpha,
        samples=section.samples,
        progress=tick,
    )


def fragility_answer(section: FragilitySection, response: Response, _: Progress) -> Fragility:
    """Return the answer to [fragility]: the fraction of records that exceed limits, over intensity.

    Args:
        section: Its limits, the intensity measure, and `independent`, whether the records count as
            independent draws, which gives limits of 95 % confidence.
        response: The peaks under each record in `suite` and, of a frame that yields, `increments`.
        _: Progress, which is not reported: all responses but those of the nominal structure, which
            are few, are known.

    Raises:
        RefusedError: The case has no suite of records or no linear structure, or a limit does not
            fit.
    """
    linear = response.structure.linear
    if response.suite is None or linear is None:
        raise RefusedError("fragility", "without records", "a section [records]")
    limits = limits_by_name(section.limits_of(response.structure), ())  # () allows any outputs
    found = fragility_of(
        linear,
        limits,
        intensity=section.measure,
        independent=section.independent,
        alpha=response.task.section.alpha,
        suite=response.suite,
        increments=response.increments,
        states=tuple(section.states),
    )
    step = response.task.section.step
    return with_nominal(
        found, linear, response.inputs, response.records, limits, step=step, most=section.most
    )


def floor_spectra(
    section: FloorSpectrumSection, response: Response, tick: Progress
) -> FloorSpectrum:
    """Return the answer to [floor_spectrum]: bounds of the spectra of floors.

    Args:
        section: Its accelerations, periods and damping ratios.
        response: The structure, and the inputs, α-levels, duration and time step of its response.
            Its peaks are not used. With records the duration is that of the longest response.
        tick: Called with the completed fraction of the work.

    Raises:
        RefusedError: The structure has no such spectra.
        FailedError: A response could not be computed.
    """
    durations = [record.duration for record in response.records]
    return floor_spectrum(
        response.structure.model,
        response.inputs,
        section.outputs,
        section.periods_of(response.structure),
        section.damping,
        duration=max(durations, default=response.task.duration),
        step=response.task.section.step,
        alpha=response.task.section.alpha,
        records=[record.components for record in response.records],
        progress=tick,
    )


def answer_of(section: GeneratedSection, response: Response, tick: Progress) -> Answer:
    """Return the answer to a section that is made from the options of its analysis."""
    asked = Asked(
        response.structure.model,
        response.inputs,
        response.task.section.alpha,
        **response.times,
        peaks=response.peaks,
    )
    return section.question(response.structure).answer(asked, tick)


def stage(key: str, section: Section, response: Response) -> Stage[Answer]:
    """Return the stage of the answer to the question of a section with a key."""
    # Answers are kept in the units and words of this package, so that its source counts as well.
    compute = partial(_computed, key, section, response)
    packages = ("fuzzy", "frame", "alphacut")
    return Stage(key, [section, response], packages, answer_class(key), compute)


def stage_alone(key: str, section: GeneratedSection, structure: Structure) -> Stage[Answer]:
    """Return the stage of an analysis of a structure that takes no response.

    Args:
        key: Key of the answer.
        section: Its options, with the names of the inputs that are `fuzzy`, and `alpha`.
        structure: The structure.
    """

    def compute(context: StageContext) -> StageResult[Answer]:
        """Answer the question, reporting progress to the context."""
        question = section.question(structure)
        inputs = structure.inputs(question.fuzzy, f"{key}.fuzzy")  # type: ignore[attr-defined]
        asked = Asked(structure.model, inputs, question.alpha)  # type: ignore[attr-defined]
        return StageResult(question.answer(asked, context.tick))

    inputs = [section, structure.model, structure.numbers]
    return Stage(key, inputs, ("fuzzy", "frame", "alphacut"), answer_class(key), compute)


def _computed(
    key: str, section: Section, response: Response, context: StageContext
) -> StageResult[Answer]:
    """Answer the question of a section, reporting progress to the context."""
    place = ANALYSES[key].compute
    compute: Callable[[Any, Response, Progress], Answer] = answer_of
    if place:
        compute = resolve_name(place)
    return StageResult(compute(section, response, context.tick))
