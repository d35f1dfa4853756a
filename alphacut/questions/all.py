"""The questions that a case may put to its motion."""

from collections.abc import Mapping

from alphacut.case.limits import QuestionSection
from alphacut.questions.decision import DecisionQuestion
from alphacut.questions.fragility import FragilityQuestion
from alphacut.questions.probability import ProbabilityQuestion
from alphacut.questions.question import Question
from alphacut.questions.tolerances import TolerancesQuestion

QUESTIONS: tuple[type[Question], ...] = (
    ProbabilityQuestion,
    DecisionQuestion,
    TolerancesQuestion,
    FragilityQuestion,
)
"""In the order of the report."""


def questions_of(sections: Mapping[str, QuestionSection]) -> list[Question]:
    """Questions that the sections of a case put, in the order of the report."""
    return [kind(sections[kind.key]) for kind in QUESTIONS if kind.key in sections]
