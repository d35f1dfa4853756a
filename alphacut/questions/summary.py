"""The results of a run, and its summary: all their numbers as one object, kept in summary.json."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Any, Self

import numpy as np
from pydantic import AfterValidator, Field, PlainValidator, ValidationError

from alphacut.base.errors import RefusedError, require
from alphacut.base.number_text import STANDARD_GRAVITY
from alphacut.case.content import Content
from alphacut.case.structure import Structure
from alphacut.frame import LearnedInputs
from alphacut.frame.structures.linear import frequencies
from alphacut.io.files import Document, as_json
from alphacut.io.results import COMPLETE, RUN_AGAIN, ResultsFolder, plain_name
from alphacut.io.typed_json import from_document, to_document
from alphacut.questions.decision import DecisionAnswer, decide
from alphacut.questions.fragility import FragilityAnswer, fragility
from alphacut.questions.probability import ProbabilityAnswer, probability
from alphacut.questions.question import Answer, FuzzyResponse
from alphacut.questions.tolerances import TolerancesAnswer, admissible_tolerances
from alphacut.stages.envelope import EnvelopeResult, EnvelopeTask
from alphacut.stages.image import ImageResult
from alphacut.stages.modulus import ModulusResult
from alphacut.stages.shares import ShareTable
from alphacut.stages.store import Numbers, StageResult, Values
from alphacut.stages.suite import SuiteResult

SUMMARY = "summary.json"
PlainName = Annotated[str, AfterValidator(plain_name)]
"""A name that leads out of no folder, as it becomes part of the name of a file."""


def _learned(value: object) -> LearnedInputs:
    return value if isinstance(value, LearnedInputs) else from_document(LearnedInputs, value)


Learned = Annotated[LearnedInputs, PlainValidator(_learned)]
"""What measured modes teach, from its document."""
ANSWERS: dict[type[Answer], Callable[[Any, FuzzyResponse], Answer]] = {
    ProbabilityAnswer: probability,
    DecisionAnswer: decide,
    TolerancesAnswer: admissible_tolerances,
    FragilityAnswer: fragility,
}
"""Kinds of answers in the order of the report, each with its function of section and response."""


class FrameResult(Numbers):
    """A frame at its nominal inputs, with the height of the storey of each drift."""

    omega_rad_per_s: Values
    period_s: float
    weight_N: float
    heights_m: dict[str, float]


@dataclass
class Results:
    """Results of a run; None or empty where the case has no such stage.

    The structure has its modulus and what was learned; `tasks` are the studies, `envelopes` their
    results by name; answers stand by the keys of their questions.
    """

    content: Content
    microstructure: StageResult[Document] | None = None
    modulus: StageResult[ModulusResult] | None = None
    image: StageResult[ImageResult] | None = None
    structure: Structure | None = None
    tasks: tuple[EnvelopeTask, ...] = ()
    envelopes: dict[str, StageResult[EnvelopeResult]] = field(default_factory=dict)
    learned: LearnedInputs | None = None
    suite: SuiteResult | None = None
    answers: dict[str, Numbers] = field(default_factory=dict)
    shares: StageResult[ShareTable] | None = None

    @property
    def is_paper(self) -> bool:
        """True if figures bear the paper's numbers."""
        return any(task.figures for task in self.tasks)

    @property
    def single(self) -> dict[str, StageResult[object]]:
        """Results of the stages that have one, by name."""
        names = ("microstructure", "modulus", "image", "shares")
        return {x: getattr(self, x) for x in names if getattr(self, x) is not None}

    @property
    def fingerprints(self) -> dict[str, str]:
        """Digest of what each result was made from, by the name of its stage."""
        studies = {f"envelope_{name}": x.fingerprint for name, x in self.envelopes.items()}
        return {name: x.fingerprint for name, x in self.single.items()} | studies

    @property
    def frame_result(self) -> FrameResult | None:
        """Frequencies, first period, weight and heights of a frame; None of another structure."""
        structure = self.structure
        if structure is None or structure.frame is None:
            return None
        omega, drifts = frequencies(structure.frame), set(structure.outputs)
        heights = {x: height.nominal for x, height in structure.heights.items() if x in drifts}
        return FrameResult(
            omega_rad_per_s=omega,
            period_s=float(2 * np.pi / omega[0]),
            weight_N=sum(structure.frame.masses) * STANDARD_GRAVITY,
            heights_m=heights,
        )

    @property
    def damping(self) -> dict[str, tuple[float, float, float]]:
        """Least, nominal and greatest damping ratios that the material gives, by name."""
        if self.structure is None or not self.content.has_material_damping:
            return {}
        return {
            name: (number.support.lower, number.nominal, number.support.upper)
            for name, number in self.structure.numbers.items()
            if name.startswith("zeta")
        }


class Parts(Numbers):
    """Numbers of all results of a run; None or empty where the case has no such stage."""

    microstructure: dict[str, Any] | None = None
    modulus: ModulusResult | None = None
    image: ImageResult | None = None
    structure: FrameResult | None = None
    damping: dict[str, tuple[float, float, float]] = Field(default={})
    envelopes: dict[PlainName, EnvelopeResult] = Field(default={})
    records: SuiteResult | None = None
    update: Learned | None = None
    probability: ProbabilityAnswer | None = None
    decision: DecisionAnswer | None = None
    tolerances: TolerancesAnswer | None = None
    fragility: FragilityAnswer | None = None
    shares: ShareTable = Field(default={})

    @classmethod
    def of(cls, results: Results, **further: object) -> Self:
        """The numbers of results, and further fields of this class."""
        drawn = {task.name: tuple(task.figures) for task in results.tasks}
        parts: dict[str, Any] = {
            **{name: x.numbers for name, x in results.single.items()},
            "structure": results.frame_result,
            "damping": results.damping,
            "envelopes": {
                name: result.numbers.model_copy(update={"drawn": drawn[name]})
                for name, result in results.envelopes.items()
            },
            "records": results.suite,
            "update": results.learned,
        }
        return cls.model_validate({**parts, **results.answers, **further})

    def parts(self) -> Document:
        """All parts by name but those that the run lacks."""
        parts = {name: part for name, part in self if part not in (None, {})}
        if self.update is not None:
            parts["update"] = to_document(self.update)
        return parts

    @property
    def encloses(self) -> str:
        """Name of the set of inputs around which the peaks are those of a box; empty without."""
        peaks = [peak for study in self.envelopes.values() for peak in study.peak.values()]
        peaks += [*self.records.peak.values()] if self.records else []
        return next((peak.encloses for peak in peaks if peak.encloses), "")

    @property
    def answers(self) -> list[Answer]:
        """The answers to all questions of the case, in the order of the report."""
        answers = (getattr(self, kind.key) for kind in ANSWERS)
        return [answer for answer in answers if answer is not None]


class Summary(Parts):
    """Numbers of a run with their origin; `changes` are those of the command line."""

    format_version: int
    case: str
    title: str
    about: str = ""
    case_text: str
    command: str
    versions: dict[str, str]
    changes: tuple[str, ...] = ()
    figures: tuple[PlainName, ...] = ()
    seconds: float
    fingerprints: dict[PlainName, str]

    def to_json(self) -> str:
        """The summary as a JSON object."""
        return as_json(self.parts(), indent=2)

    @classmethod
    def read(cls, folder: ResultsFolder) -> Self:
        """The summary in a folder of results; RefusedError where it is missing or damaged."""
        try:
            return cls.model_validate_json(folder.content(SUMMARY))
        except ValidationError as error:
            keys = ".".join(map(str, error.errors()[0]["loc"])) or "no JSON object"
            what = f"damaged ({SUMMARY}: {keys})"
            raise RefusedError(str(folder.path), what, COMPLETE, RUN_AGAIN) from None

    def require_run_of(self, folder: ResultsFolder) -> None:
        """Refuses a folder with files of another run than that of this summary."""
        changed = [
            name
            for name, source in self.fingerprints.items()
            if f"{name}.json" not in folder.made_from(source)
        ]
        value = f"with {', '.join(changed)} of another run"
        require(not changed, str(folder.path), value=value, allowed="one run's files")
