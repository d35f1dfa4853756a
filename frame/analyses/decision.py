"""Decision: how possible and how necessary it is that limits are exceeded, and the margins left.

Exceeding a limit is possible to the degree of the highest α-cut that holds such a motion. It is
necessary to one less the degree to which not exceeding it is possible (Dubois and Prade,
Possibility Theory, chapter 1). A greatest peak below the limit excludes the motion on its level and
above, and one that is reached above it proves the possibility.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import floor, log10
from typing import Any

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import require_choice
from alphacut.base.number_text import MINUS, engineering, percent_text
from alphacut.frame.analyses.answer import Record, known
from alphacut.frame.analyses.limits import (
    ANY,
    About,
    Limit,
    LimitsAnswer,
    facts_of,
    limits_by_name,
)
from alphacut.frame.analyses.peaks import Peak, Peaks, peaks
from alphacut.frame.analyses.suites import SuitePeaks
from alphacut.frame.envelope import Envelope
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.result import Ends, Nature, rounded


@dataclass(frozen=True, eq=False, kw_only=True)
class LimitDecision(About):
    """Degrees to which it is possible and necessary that a limit is exceeded, and what is left.

    Args:
        possibility: Lower and upper bound of the degree, from 0 to 1.
        necessity: Lower and upper bound, from 0 to 1.
        margin: What the greatest (`lower`) and the least peak leave of the limit on each level,
            shape (A,), in SI units; −∞ where nothing excludes a greater peak. Of several limits
            fractions of them.
        verdict: "not exceeded" by any motion, "exceeded" by all, "can be exceeded" by one that is
            known, or "undecided"; on and above the level `from_level`.
        from_level: Lowest level computed; below it nothing is known.
        nature: Guarantee of the bounds that both degrees rest on.
        peak: The limited peak; None of several limits.
        record: Record of a suite under which the peak is reached; empty without one.
        input_units: SI units of the inputs at which it is reached, where they are known.
    """

    possibility: tuple[float, float]
    necessity: tuple[float, float]
    margin: Ends
    verdict: str
    from_level: float
    nature: Nature
    peak: Peak | None = None
    record: str = ""
    input_units: Mapping[str, str] = field(default_factory=dict)

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
        """Return the text of a bound of a peak or a margin, rounded to its side.

        The side is "lower" or "upper"; the bound may be infinite. Of several limits it is a
        fraction of them.
        """
        if not np.isfinite(value):
            return "not known"
        if not self.is_event:
            factor = 1.0 if self.stated_unit is None else self.stated_unit.factor
            return self.text_of_value(rounded(factor * value, side, nature) / factor)
        digits = 4 + floor(log10(abs(value))) if value else 1  # a tenth of a per cent is the last
        return percent_text(rounded(value, side, nature, max(digits, 1)))


@dataclass(frozen=True, eq=False, repr=False)
class Decision(LimitsAnswer[LimitDecision]):
    """Possibility and necessity that limits are exceeded, on levels `alpha` (A,), by their names.

    Of several limits `ANY` is the event that any of them is exceeded.
    """

    key = "decision"
    title = "Can or must limits be exceeded?"
    alpha: Array
    limits: dict[str, LimitDecision]

    @property
    def parts(self) -> dict[str, LimitDecision]:
        """The decisions by the names of their limits."""
        return self.limits

    def texts_of(self, part: LimitDecision) -> dict[str, str]:
        """Return verdict, degrees, and on the lowest level margin, bound, reached peak and gap."""
        bound_text, reached_text, gap = "", "", ""
        if (peak := part.peak) is not None:
            bound, reached = float(peak.proved[0]), float(peak.reached[0])
            side, relation = ("lower", "≥") if peak.is_least else ("upper", "≤")
            bound_text = part.text_of(bound, side)
            bound_text = f"{relation} {bound_text}" if np.isfinite(bound) else bound_text
            reached_text = part.text_of(reached, side, Nature.ATTAINED)
            has_gap = bound and np.isfinite(bound) and np.isfinite(reached)
            gap = f"{abs((bound - reached) / bound):.1%}" if has_gap else ""
        return {
            "limit": part.words,
            "verdict": part.verdict_and_motion,
            "nature": self.nature_text(part.nature),
            "possibility": degree_text(part.possibility),
            "necessity": degree_text(part.necessity),
            "least margin": part.text_of(float(part.margin.lower[0]), "lower", part.nature),
            "bound of peak": bound_text,
            "peak reached": reached_text,
            "gap": gap,
        }

    def numbers_of(self, part: LimitDecision) -> Iterator[Record]:
        """Yield one record; margin and peaks are those of the lowest level."""
        yield {
            "verdict": part.verdict,
            "from α": part.from_level,
            "nature": self.nature_text(part.nature),
            "least possibility": part.possibility[0],
            "greatest possibility": part.possibility[1],
            "least necessity": part.necessity[0],
            "greatest necessity": part.necessity[1],
            "least margin": known(part.margin.lower[0]),
            "bound of peak": None if part.peak is None else known(part.peak.proved[0]),
            "peak reached": None if part.peak is None else known(part.peak.reached[0]),
        }

    def words(self) -> str:
        """Return sentences on how to read the verdicts."""
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


def degree_text(ends: tuple[float, float]) -> str:
    """Return the bounds of a degree, or one number where they agree."""
    return " … ".join(dict.fromkeys(f"{end:.4g}" for end in ends)).replace("-", MINUS)


def decide(
    response: Envelope | SuitePeaks | Peaks,
    limits: Limit | Sequence[Limit],
    *,
    units: Mapping[str, str] | None = None,
    input_units: Mapping[str, str] | None = None,
) -> Decision:
    """Return possibility, necessity and margins of exceeding each limit.

    Args:
        response: An envelope, the peaks over a suite of records, or peaks by name.
        limits: Limits of outputs, in SI units.
        units: SI units of outputs, where `response` does not hold them.
        input_units: SI units of the inputs, for the text that names a motion.

    Raises:
        RefusedError: There is no limit, one is not positive, or it names no output or peak.

    Example:
        >>> from alphacut.frame import Limit, StoreyFrame, decide, envelope
        >>> from alphacut.fuzzy import Interval
        >>> frame = StoreyFrame(masses=[1e3], stiffness=[4e4], q0=[0.1], outputs=("q1",))
        >>> band = envelope(frame, {"k1": Interval(38e3, 42e3)}, duration=2.0, step=0.02)
        >>> decide(band, [Limit("q1", 0.15)]).limits["q1"].verdict
        'not exceeded'
    """
    known_units, found, farthest = dict(units or {}), dict[str, Peak](), dict[str, str]()
    if isinstance(response, Envelope):
        outputs = [*map(str, response.outputs)]
        named = limits_by_name(limits, outputs)
        known_units |= dict(zip(outputs, response.units or map(_unit, outputs), strict=True))
        found = peaks(response, [*dict.fromkeys(limit.peak for limit in named.values())])
    else:
        if isinstance(response, SuitePeaks):
            known_units, farthest = known_units | response.units, response.farthest_record
            response = response.peak
        found = dict(response)
        named = limits_by_name(limits, ())
    for limit in named.values():
        require_choice("limits", limit.peak, found)
    decisions: dict[str, LimitDecision] = {}
    for name, limit in named.items():
        unit = known_units.get(limit.output) or _unit(limit.output)
        decisions[name] = LimitDecision(
            **facts_of(limit, unit),
            **_passing(found[limit.peak], limit.outwards),
            peak=found[limit.peak],
            record=farthest.get(limit.peak, ""),
            input_units=dict(input_units or {}),
        )
    if len(decisions) > 1:
        decisions[ANY] = _passing_of_any([*decisions.values()])
    first = next(iter(found.values()))
    return Decision(first.alpha, decisions, encloses=first.encloses)


def _unit(output: str) -> str:
    return Output(output).unit


def _passing(peak: Peak, limit: float) -> dict[str, Any]:
    """Return degrees, margin, verdict, level and nature of a peak and a limit, both outwards."""
    greatest, least, alpha = peak.greatest_bounds, peak.least_bounds, peak.alpha
    reaches, is_excluded = greatest.lower > limit, greatest.upper <= limit
    possibility = float(alpha[reaches].max(initial=0.0)), _excluded(alpha, is_excluded)
    is_kept = np.broadcast_to(least.upper <= limit, alpha.shape)  # by some motion
    keeping = float(alpha[is_kept].max(initial=0.0)), _excluded(alpha, least.lower > limit)
    # one less the possibility of keeping the limit (Dubois, Prade 1988)
    necessity = 1 - keeping[1], 1 - keeping[0]
    lowest = float(alpha[0])
    return {
        "possibility": possibility,
        "necessity": necessity,
        "margin": Ends(limit - greatest.upper, limit - least.lower),
        "verdict": _verdict(possibility, necessity, lowest, is_reached=bool(reaches.any())),
        "from_level": lowest,
        "nature": peak.nature,
    }


def _passing_of_any(single: Sequence[LimitDecision]) -> LimitDecision:
    """Return the decision on the event that any of several limits is exceeded."""
    possibility = tuple(max(x.possibility[k] for x in single) for k in (0, 1))
    # below 1 all motions of the highest cut keep all limits
    necessity = max(x.necessity[0] for x in single), 0.0 if possibility[1] < 1 else 1.0
    margins = [  # of a limit of 0 they are the sign
        np.stack(x.margin) / abs(x.limit) if x.limit else np.sign(x.margin) for x in single
    ]
    lowest = single[0].from_level
    is_reached = any(x.verdict in ("exceeded", "can be exceeded") for x in single)
    return LimitDecision(
        output=ANY,
        is_event=True,
        possibility=(possibility[0], possibility[1]),
        necessity=necessity,
        margin=Ends(*np.min(margins, axis=0)),
        verdict=_verdict(possibility, necessity, lowest, is_reached=is_reached),
        from_level=lowest,
        nature=Nature.weakest(x.nature for x in single),
    )


def _verdict(
    possibility: Sequence[float], necessity: Sequence[float], lowest: float, *, is_reached: bool
) -> str:
    """Return what is known from the lowest level on; `is_reached`: a motion exceeds the limit."""
    if possibility[1] <= lowest:
        return "not exceeded"
    if necessity[0] >= 1 - lowest:
        return "exceeded"
    return "can be exceeded" if is_reached else "undecided"


def _excluded(alpha: Array, excluded: Mask) -> float:
    """Return the lowest level from which on the mask (A,) holds on all levels, 1 without one."""
    first = np.flatnonzero(~excluded).max(initial=-1) + 1
    return float(alpha[first]) if first < len(alpha) else 1.0
