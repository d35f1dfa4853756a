"""A question to the motion of a case: a section, an answer, a figure, rows of the report.

Each question is one file beside this one, and one line of `alphacut.questions.table`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from pydantic import Field

from alphacut.case.structure import Structure
from alphacut.case.types import Section
from alphacut.frame import StoreyFrame
from alphacut.frame.structures.lagrangian import LagrangianSystem
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.progress_bar import Progress
from alphacut.io.files import Document
from alphacut.questions.limits import Limits, in_si

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Limited(Section):
    """Section of a question about limits of outputs."""

    limits: Limits = Field(description="limits of outputs, 'drift1 <= 0.5 %', 'a3 <= 2 m/s^2'")

    def require(self, structure: Structure, key: str) -> None:
        """Refuses what the structure does not have.

        Raises:
            RefusedError: It has no such output or input.
        """
        in_si(self.limits, structure, f"{key}.limits")


@dataclass(frozen=True)
class Motion:
    """The motion of [envelope], to which a question is put.

    Args:
        structure: The structure.
        fuzzy: Names of the fuzzy inputs.
        alpha: Levels.
        duration: Length, in s.
        step: Distance of nodes, in s.
        progress: Takes the share done.
    """

    structure: Structure
    fuzzy: tuple[str, ...]
    alpha: tuple[float, ...]
    duration: float
    step: float
    progress: Progress | None = None

    @property
    def inputs(self) -> dict[str, FuzzyNumber]:
        """Fuzzy inputs by parameter."""
        return self.structure.inputs(self.fuzzy)

    def observed(self, outputs: tuple[str, ...]) -> StoreyFrame | LagrangianSystem:
        """The model, of a storey frame with these outputs alone."""
        frame = self.structure.frame
        return self.structure.model if frame is None else replace(frame, outputs=outputs)


Row = tuple[str, ...]


@dataclass(frozen=True)
class Question:
    """One question.

    Args:
        key: Name of its section, its file of results and its figure.
        section: The section.
        title: Heading in the report.
        caption: Of the figure.
        answer: Numbers of the answer, in SI, as JSON holds them.
        figure: Draws an answer.
        head: Titles of the columns of `rows`.
        rows: The answer as a table: what, answer, nature first.
        words: Sentence on how to read it.
    """

    key: str
    section: type[Section]
    title: str
    caption: str
    answer: Callable[[Any, Motion], Document]
    figure: Callable[[Document], Figure]
    head: Row
    rows: Callable[[Document], list[Row]]
    words: Callable[[Document], str]
