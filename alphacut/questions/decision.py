"""Decision: how possible and how necessary it is that limits are exceeded, and their margins."""

from __future__ import annotations

from collections.abc import Iterator
from math import floor, log10

import numpy as np
from pydantic import Field

from alphacut.base.number_text import MINUS, engineering, percent_text
from alphacut.case.limits import DecisionSection
from alphacut.frame.analyses.peaks import ANY, passing
from alphacut.fuzzy.result import Nature, rounded
from alphacut.questions.question import FuzzyResponse, LimitAnswer, LimitsAnswer, Record, Texts
from alphacut.stages.envelope import PeakResult, peak_results
from alphacut.stages.store import CutsResult


class LimitDecision(LimitAnswer):
    """Degrees to which it is possible and necessary that a limit is exceeded, and what is left.

    The margin is what the greatest and the least peak leave of the limit on each level, of several
    limits as fractions of them. The verdict holds from a level on, the lowest one computed; the
    peak is reached under `record` where a suite moves the structure, at inputs in `input_units`.
    """

    possibility: tuple[float, float]
    necessity: tuple[float, float]
    margin: CutsResult
    verdict: str
    from_level: float
    nature: Nature
    peak: PeakResult | None
    record: str = ""
    input_units: dict[str, str] = Field(default={})

    @property
    def verdict_words(self) -> str:
        """The verdict, with the level from which on it holds if that is not 0."""
        holds_from = bool(self.from_level) and self.verdict in ("exceeded", "not exceeded")
        return f"{self.verdict} from α = {self.from_level:g} up" if holds_from else self.verdict

    @property
    def verdict_and_motion(self) -> str:
        """The verdict; where only some motions exceed the limit, with the inputs of one."""
        inputs = {} if self.peak is None else self.peak.reached_at
        if self.verdict != "can be exceeded" or not inputs:
            return self.verdict_words
        units = self.input_units
        texts = [f"{x} = {engineering(value, units.get(x, ''))}" for x, value in inputs.items()]
        texts += [f"record {self.record}"] if self.record else []
        return f"{self.verdict}, as at {', '.join(texts)}"

    def text_of(self, value: float, side: str, nature: Nature = Nature.GUARANTEED) -> str:
        """Text of a bound of a peak or a margin, rounded to its side; of several limits a share.

        The side is "lower" or "upper"; the bound may be infinite.
        """
        if not np.isfinite(value):
            return "not known"
        if self.output != ANY:
            return engineering(rounded(value, side, nature), self.unit)
        digits = 4 + floor(log10(abs(value))) if value else 1  # a tenth of a per cent is the last
        return percent_text(rounded(value, side, nature, max(digits, 1)))


def degree_text(ends: tuple[float, float]) -> str:
    """Bounds of a degree, or one number."""
    return " … ".join(dict.fromkeys(f"{end:.4g}" for end in ends)).replace("-", MINUS)


class DecisionAnswer(LimitsAnswer[LimitDecision]):
    """Possibility and necessity that limits are exceeded, by their names."""

    key = "decision"
    title = "Can or must limits be exceeded?"
    caption = "Fuzzy peak of each limited output over its limit"

    def texts_of(self, limit: LimitDecision) -> Texts:
        """Verdict, degrees, and on the lowest level margin, proved and reached peak, and gap."""
        proved, reached, gap = "", "", ""
        if (peak := limit.peak) is not None:
            bound, inner = float(peak.proved[0]), float(peak.reached[0])
            side, relation = ("lower", "≥") if peak.is_least else ("upper", "≤")
            proved = limit.text_of(bound, side)
            proved = f"{relation} {proved}" if np.isfinite(bound) else proved
            reached = limit.text_of(inner, side, Nature.ATTAINED)
            has_gap = bound and np.isfinite(bound) and np.isfinite(inner)
            gap = f"{abs((bound - inner) / bound):.1%}" if has_gap else ""
        return {
            "limit": limit.words,
            "verdict": limit.verdict_and_motion,
            "nature": self.nature_text(limit.nature),
            "possibility": degree_text(limit.possibility),
            "necessity": degree_text(limit.necessity),
            "least margin": limit.text_of(float(limit.margin.lower[0]), "lower", limit.nature),
            "bound of peak": proved,
            "peak reached": reached,
            "gap": gap,
        }

    def numbers_of(self, limit: LimitDecision) -> Iterator[Record]:
        """Yields one record; margin and peaks are those of the lowest level."""
        yield {
            "verdict": limit.verdict,
            "from α": limit.from_level,
            "nature": self.nature_text(limit.nature),
            "least possibility": limit.possibility[0],
            "greatest possibility": limit.possibility[1],
            "least necessity": limit.necessity[0],
            "greatest necessity": limit.necessity[1],
            "least margin": float(limit.margin.lower[0]),
            "bound of peak": None if limit.peak is None else float(limit.peak.proved[0]),
            "peak reached": None if limit.peak is None else float(limit.peak.reached[0]),
        }

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
        return f"{text} {self.words_on_box()}".strip()


def decide(section: DecisionSection, response: FuzzyResponse) -> DecisionAnswer:
    """Possibility, necessity and margins of exceeding each limit, from the response's peaks."""
    assert response.peaks is not None
    limits = section.limits_by_name
    peaks = {name: response.peaks[limit.peak] for name, limit in limits.items()}
    by_peak = peak_results(response.peaks)
    names = {x for peak in by_peak.values() for x in peak.reached_at}
    units = {x: response.structure.input_unit(x) for x in sorted(names)}
    farthest = {} if response.suite is None else response.suite.farthest_record
    decisions = {
        name: LimitDecision.of(
            section,
            name,
            response.structure,
            possibility=answer.possibility,
            necessity=answer.necessity,
            margin=CutsResult.of(answer.margin),
            verdict=answer.outcome,
            from_level=answer.lowest,
            nature=answer.nature,
            peak=None if name == ANY else by_peak[limits[name].peak],
            input_units=units,
            record=farthest.get("" if name == ANY else limits[name].peak, ""),
        )
        for name, answer in passing(peaks, section.limits_in_si(response.structure)).items()
    }
    return DecisionAnswer(
        encloses=response.encloses, alpha=np.array(response.alpha), limits=decisions
    )
