"""The analyses that a case asks for, each registered in one entry.

`Content` has a section for each entry, `check` judges it, a run computes its answer as a stage, and
summary, tables, figures and page have it. A new analysis is a class of options with its answer in
`frame/analyses`, a function that draws it, and an entry here.
"""

from __future__ import annotations

from collections.abc import Mapping
from pkgutil import resolve_name
from typing import Any, NamedTuple


class Picture(NamedTuple):
    """A figure of an answer.

    Args:
        draw: Place "module:function" of the function, which takes the answer, and returns the
            figure; None where the answer has none.
        caption: Its caption on the page.
    """

    draw: str
    caption: str


class Analysis(NamedTuple):
    """An analysis; its classes and functions are "module:name", imported at first use.

    Args:
        answer: Class of the answer.
        pictures: Figures of the answer by their names. They stand on the page in the section of the
            answer, in this order.
        section: Frozen dataclass of options, a `Question` of `alphacut.frame.analyses.question`,
            from which the section of the case is made. Empty for what follows from another answer.
        stage: Name of the stage, which a case lists in `stages`, that computes the answer.
    """

    answer: str
    pictures: Mapping[str, Picture]
    section: str = ""
    stage: str = "envelope"


ANALYSES: dict[str, Analysis] = {
    "probability": Analysis(
        "alphacut.frame:Probability",
        {
            "probability": Picture(
                "alphacut.figures.answers:draw_probability",
                "Fuzzy probability of exceeding a limit, over the limit",
            )
        },
        "alphacut.frame.analyses.probability:ProbabilityQuestion",
    ),
    "decision": Analysis(
        "alphacut.frame:Decision",
        {
            "decision": Picture(
                "alphacut.figures.answers:draw_decision",
                "Fuzzy peak of each limited output over its limit",
            )
        },
        "alphacut.frame.analyses.decision:DecisionQuestion",
    ),
    "tolerances": Analysis(
        "alphacut.frame:Tolerances",
        {
            "tolerances": Picture(
                "alphacut.figures.answers:draw_tolerances",
                "Supports of the inputs in the case, and at the scale that exceeds no limit",
            )
        },
        "alphacut.frame.analyses.tolerances:ToleranceQuestion",
    ),
    "fragility": Analysis(
        "alphacut.frame:Fragility",
        {
            "fragility": Picture(
                "alphacut.figures.answers:draw_fragility",
                "Share of the records under which each limit is exceeded, over their measure: bands"
                " by α, α = 1 as a line, dotted the lognormal fit",
            ),
            "fragility-curves": Picture(
                "alphacut.figures.answers:draw_incremental",
                "Incremental dynamic analysis: least and greatest peak found over the measure, a"
                " band for each record",
            ),
            "damage-states": Picture(
                "alphacut.figures.answers:draw_states",
                "Damage states: lognormal fits (lines) to the measures at which each record brings"
                " the state (points), and bands of the tolerances",
            ),
        },
        "alphacut.frame.analyses.fragility:FragilityQuestion",
    ),
    "floor_spectrum": Analysis(
        "alphacut.frame:FloorSpectrum",
        {
            "floor_spectrum": Picture(
                "alphacut.figures.answers:draw_floor_spectrum",
                "Floor spectra: proved bounds by α, attained values as dots, and the curve of the"
                " nominal structure",
            )
        },
        "alphacut.frame.analyses.floor_spectrum:FloorQuestion",
    ),
    "response_spectrum": Analysis(
        "alphacut.frame:SpectrumResponse",
        {
            "response_spectrum": Picture(
                "alphacut.figures.answers:draw_response_spectrum",
                "The response spectrum, and the modes of the most plausible structure on it",
            )
        },
        "alphacut.frame.analyses.spectrum_question:SpectrumQuestion",
        stage="response_spectrum",
    ),
    "spectrum_checks": Analysis(
        "alphacut.frame:SpectrumChecks",
        {
            "spectrum_checks": Picture(
                "alphacut.figures.answers:draw_decision",
                "Combined peak of each limited output over its limit",
            )
        },
        stage="response_spectrum",
    ),
    "spectrum_accuracy": Analysis(
        "alphacut.frame:SpectrumAccuracy",
        {
            "spectrum_accuracy": Picture(
                "alphacut.figures.answers:draw_accuracy",
                "Error of the response-spectrum method under each record",
            )
        },
        stage="response_spectrum",
    ),
    "static": Analysis(
        "alphacut.frame:StaticBounds",
        {
            "static": Picture(
                "alphacut.figures.answers:draw_static",
                "Outputs at rest: guaranteed bounds by α, the nominal value, attained values as"
                " dots",
            )
        },
        "alphacut.frame.analyses.static_bounds:Static",
        stage="static",
    ),
}
"""Analyses by the keys of their answers, in the order of the page."""


def answer_class(key: str) -> type[Any]:
    """Return the class of the answer with a key."""
    found: type[Any] = resolve_name(ANALYSES[key].answer)
    return found
