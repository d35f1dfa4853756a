"""The summary of a run: the numbers of all results as one typed object, kept in summary.json."""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import AfterValidator, Field, ValidationError

from alphacut.fuzzy.refused import RefusedError, require
from alphacut.io.files import Document, as_json
from alphacut.io.results import COMPLETE, RUN_AGAIN, ResultsFolder, plain_name
from alphacut.questions.decision import DecisionAnswer
from alphacut.questions.fragility import FragilityAnswer
from alphacut.questions.probability import ProbabilityAnswer
from alphacut.questions.question import Answer
from alphacut.questions.tolerances import TolerancesAnswer
from alphacut.stages.envelope import EnvelopeResult
from alphacut.stages.identify import LearnedResult
from alphacut.stages.image import ImageResult
from alphacut.stages.modulus import ModulusResult
from alphacut.stages.results import FrameResult, Results
from alphacut.stages.shares import ShareTable
from alphacut.stages.store import Numbers
from alphacut.stages.suite import SuiteResult

SUMMARY = "summary.json"
PlainName = Annotated[str, AfterValidator(plain_name)]
"""A name that leads out of no folder, as it becomes part of the name of a file."""
ANSWERS: tuple[type[Answer], ...] = (
    ProbabilityAnswer,
    DecisionAnswer,
    TolerancesAnswer,
    FragilityAnswer,
)
"""Kinds of answers in the order of the report."""


class Parts(Numbers):
    """Numbers of all results of a run; None or empty where the case has no such stage."""

    microstructure: dict[str, Any] | None = None
    modulus: ModulusResult | None = None
    image: ImageResult | None = None
    structure: FrameResult | None = None
    damping: dict[str, tuple[float, float, float]] = Field(default={})
    envelopes: dict[PlainName, EnvelopeResult] = Field(default={})
    records: SuiteResult | None = None
    update: LearnedResult | None = None
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
        return {name: part for name, part in self if part not in (None, {})}

    @property
    def answers(self) -> list[Answer]:
        """The answers to all questions of the case, in the order of the report."""
        answers = (self.probability, self.decision, self.tolerances, self.fragility)
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
        if not (folder.path / SUMMARY).exists():
            raise damaged(folder, f"without {SUMMARY}")
        try:
            return cls.model_validate_json(folder.content(SUMMARY))
        except RefusedError as error:
            raise damaged(folder, f"damaged ({SUMMARY} {error.value})") from None
        except ValidationError as error:
            keys = ".".join(map(str, error.errors()[0]["loc"])) or "no JSON object"
            raise damaged(folder, f"damaged ({SUMMARY}: {keys})") from None

    def require_run_of(self, folder: ResultsFolder) -> None:
        """Refuses a folder with files of another run than that of this summary."""
        changed = [
            name
            for name, source in self.fingerprints.items()
            if f"{name}.json" not in folder.made_from(source)
        ]
        value = f"with {', '.join(changed)} of another run"
        require(not changed, str(folder.path), value=value, allowed="one run's files")


def damaged(folder: ResultsFolder, what: str) -> RefusedError:
    """The error of results that cannot be used."""
    return RefusedError(str(folder.path), what, COMPLETE, RUN_AGAIN)
