"""Decision: how possible and how necessary it is that limits are exceeded, and their margins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.case.limits import DecisionSection
from alphacut.frame.questions.peaks import ANY, Passing, Peaks, passing, verdict_words
from alphacut.io.files import Document
from alphacut.io.quantity import engineering
from alphacut.questions.question import (
    FuzzyResponse,
    NumberRow,
    Question,
    Row,
    limit_words,
    peak_document,
)


def _limit_document(name: str, answer: Passing, limit: float, peaks: Peaks) -> Document:
    """Numbers on a limit in SI; the event that any limit is exceeded has no peak."""
    peak = {} if name == ANY else peak_document(peaks, name) | {"proved": peaks.most(name).upper}
    return {
        "peak": peak,
        "limit": limit,
        "possibility": answer.possibility,
        "necessity": answer.necessity,
        "margin": {"lower": answer.margin[:, 0], "upper": answer.margin[:, 1]},
        "verdict": answer.outcome,
        "from_level": answer.lowest,
        "nature": str(answer.nature),
    }


def degree_text(ends: Row) -> str:
    """Bounds of a degree, or one number."""
    return " … ".join(dict.fromkeys(f"{float(end):.4g}" for end in ends))


def _margin_text(limit: Document) -> str:
    """Least that is left of a limit at the lowest level."""
    margin = limit["margin"]["lower"][0]
    if margin is None or not np.isfinite(margin):
        return "not known"
    return engineering(margin, limit["unit"]) if limit["unit"] else f"{margin:.1%}"


def _peak_texts(limit: Document) -> Row:
    """Texts of the greatest peak at the lowest level: proved bound, reached, relative gap."""
    if not limit.get("peak"):
        return ("", "", "")
    proved, reached = limit["peak"]["proved"][0], limit["peak"]["reached"][0]
    if proved is None or not np.isfinite(proved):
        return ("not known", engineering(reached, limit["unit"]), "")
    gap = f"{(proved - reached) / abs(proved):.1%}" if proved else ""
    return (*(engineering(peak, limit["unit"]) for peak in (proved, reached)), gap)


@dataclass(frozen=True)
class DecisionQuestion(Question):
    """Possibility and necessity that limits are exceeded."""

    section: DecisionSection
    key = "decision"
    title = "Can or must limits be exceeded?"
    caption = "Fuzzy peak of each limited output over its limit"
    head = (
        *("limit", "verdict", "nature", "possibility", "necessity", "least margin"),
        *("peak at most", "peak reached", "gap"),
    )

    def answer(self, response: FuzzyResponse) -> Document:
        """Possibility, necessity and margins of exceeding each limit, from the response's peaks."""
        assert response.peaks is not None
        limits = self.section.in_si(response.structure)
        peaks = response.peaks.named(
            {name: x.peak for name, x in self.section.limits_by_name.items()}
        )
        answers = passing(peaks, limits)
        documents = {
            name: _limit_document(name, answer, limits.get(name, 1.0), peaks)
            | self.section.peak_and_unit(name, response.structure)
            for name, answer in answers.items()
        }
        return {"alpha": response.alpha, "step": response.step, "limits": documents}

    @staticmethod
    def rows(document: Document) -> list[Row]:
        """Table of the report, with the columns of `head`: a row for each limit."""
        return [
            (
                limit_words(limit["output"], limit["limit"], limit["unit"]),
                verdict_words(limit["verdict"], limit["from_level"]),
                limit["nature"],
                degree_text(limit["possibility"]),
                degree_text(limit["necessity"]),
                _margin_text(limit),
                *_peak_texts(limit),
            )
            for limit in document["limits"].values()
        ]

    @staticmethod
    def number_rows(document: Document) -> tuple[Row, list[NumberRow]]:
        """Rows of the CSV: verdict, degrees of exceeding each limit, peaks of the lowest level."""
        head: Row = ("limited output", "unit", "limit", "verdict", "from α", "nature")
        head += ("least possibility", "greatest possibility", "least necessity")
        head += ("greatest necessity", "least margin", "peak at most", "peak reached")
        rows: list[NumberRow] = []
        for name, limit in document["limits"].items():
            peak = limit.get("peak") or {"proved": [None], "reached": [None]}
            first = (name, limit["unit"], limit["limit"], limit["verdict"], limit["from_level"])
            degrees = (*limit["possibility"], *limit["necessity"])
            ends = (limit["margin"]["lower"][0], peak["proved"][0], peak["reached"][0])
            rows.append((*first, limit["nature"], *degrees, *ends))
        return head, rows

    @staticmethod
    def words(document: Document) -> str:
        """Sentences on how to read the verdicts."""
        return (
            "A limit is not exceeded where no motion exceeds it, exceeded where every motion does,"
            " and can be exceeded where a motion is known that does."
            " Attained bounds show what is possible and exclude nothing."
        )
