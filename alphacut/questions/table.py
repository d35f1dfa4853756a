"""The questions that a case may put to its motion, each a file beside this one."""

from __future__ import annotations

from importlib import import_module

from alphacut.questions.question import Question

NAMES = ("probability", "decision", "tolerances")
QUESTIONS: tuple[type[Question], ...] = tuple(
    import_module(f"alphacut.questions.{name}").QUESTION for name in NAMES
)
