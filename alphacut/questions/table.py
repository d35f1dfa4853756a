"""The questions that a case may put to its motion; one line each."""

from __future__ import annotations

from alphacut.questions import decision, probability, tolerances
from alphacut.questions.question import Question

QUESTIONS: tuple[Question, ...] = (
    probability.QUESTION,
    decision.QUESTION,
    tolerances.QUESTION,
)
