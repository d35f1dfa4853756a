"""Decision: how possible and how necessary it is that limits are exceeded, and their margins."""

from __future__ import annotations

import numpy as np

from alphacut.case.limits import DecisionSection
from alphacut.frame.questions.peaks import ANY, passing, verdict_words
from alphacut.fuzzy.result import Nature
from alphacut.io.quantity import engineering
from alphacut.questions.question import (
    Answer,
    FuzzyResponse,
    LimitAnswer,
    Record,
    Row,
    limit_fields,
)
from alphacut.stages.envelope import PeakResult, peak_results
from alphacut.stages.store import CutsResult, Values


class LimitDecision(LimitAnswer):
    """Degrees to which it is possible and necessary that a limit is exceeded, and what is left.

    The margin is what the greatest and the least peak leave of the limit on each level, of several
    limits as fractions of them. The verdict holds from a level on, the lowest one computed.
    """

    possibility: tuple[float, float]
    necessity: tuple[float, float]
    margin: CutsResult
    verdict: str
    from_level: float
    nature: Nature
    peak: PeakResult | None

    @property
    def verdict_words(self) -> str:
        """The verdict, with the level from which on it holds if that is not 0."""
        return verdict_words(self.verdict, self.from_level)


def degree_text(ends: tuple[float, float]) -> str:
    """Bounds of a degree, or one number."""
    return " … ".join(dict.fromkeys(f"{end:.4g}" for end in ends))


def _margin_text(limit: LimitDecision) -> str:
    margin = float(limit.margin.lower[0])
    if not np.isfinite(margin):
        return "not known"
    return engineering(margin, limit.unit) if limit.unit else f"{margin:.1%}"


def _peak_texts(limit: LimitDecision) -> Row:
    """Texts of the peak at the lowest level: proved bound, reached, relative gap."""
    if limit.peak is None:
        return ("", "", "")
    proved, reached = float(limit.peak.proved[0]), float(limit.peak.reached[0])
    if not np.isfinite(proved):
        return ("not known", engineering(reached, limit.unit), "")
    gap = f"{abs((proved - reached) / proved):.1%}" if proved else ""
    return engineering(proved, limit.unit), engineering(reached, limit.unit), gap


class DecisionAnswer(Answer):
    """Possibility and necessity that limits are exceeded, by their names."""

    key = "decision"
    title = "Can or must limits be exceeded?"
    caption = "Fuzzy peak of each limited output over its limit"
    head = (
        *("limit", "verdict", "nature", "possibility", "necessity", "least margin"),
        *("peak at most", "peak reached", "gap"),
    )
    alpha: Values
    step: float
    limits: dict[str, LimitDecision]

    def rows(self) -> list[Row]:
        """A row for each limit."""
        return [
            (
                limit.words,
                limit.verdict_words,
                limit.nature,
                degree_text(limit.possibility),
                degree_text(limit.necessity),
                _margin_text(limit),
                *_peak_texts(limit),
            )
            for limit in self.limits.values()
        ]

    def records(self) -> list[Record]:
        """A row for each limit; margin and peaks are those of the lowest level."""
        return [
            {
                "limited output": name,
                "unit": limit.unit,
                "limit": limit.limit,
                "verdict": limit.verdict,
                "from α": limit.from_level,
                "nature": limit.nature,
                "least possibility": limit.possibility[0],
                "greatest possibility": limit.possibility[1],
                "least necessity": limit.necessity[0],
                "greatest necessity": limit.necessity[1],
                "least margin": float(limit.margin.lower[0]),
                "peak at most": None if limit.peak is None else float(limit.peak.proved[0]),
                "peak reached": None if limit.peak is None else float(limit.peak.reached[0]),
            }
            for name, limit in self.limits.items()
        ]

    def words(self) -> str:
        """Sentences on how to read the verdicts."""
        text = (
            "A limit is not exceeded where no motion exceeds it, exceeded where every motion does,"
            " and can be exceeded where a motion is known that does."
            " Attained bounds show what is possible and exclude nothing."
        )
        if any(limit.side == "mean" for limit in self.limits.values()):
            text += (
                " Of a mean over records the proved end is the mean of each record's greatest peak;"
                " what is reached is the mean of one structure."
            )
        return text


def decide(section: DecisionSection, response: FuzzyResponse) -> DecisionAnswer:
    """Possibility, necessity and margins of exceeding each limit, from the response's peaks."""
    assert response.peaks is not None
    limits = section.limits_by_name
    peaks = response.peaks.named({name: limit.peak for name, limit in limits.items()})
    by_peak = peak_results(response.peaks)
    decisions = {
        name: LimitDecision.model_validate(
            {
                **limit_fields(section, name, response.structure),
                "possibility": answer.possibility,
                "necessity": answer.necessity,
                "margin": CutsResult.of(answer.margin),
                "verdict": answer.outcome,
                "from_level": answer.lowest,
                "nature": answer.nature,
                "peak": None if name == ANY else by_peak[limits[name].peak],
            }
        )
        for name, answer in passing(peaks, section.in_si(response.structure)).items()
    }
    return DecisionAnswer(alpha=np.array(response.alpha), step=response.step, limits=decisions)
