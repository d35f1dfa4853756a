"""Decision: how possible and how necessary it is that limits are exceeded, and the margins left.

It is possible that a limit is exceeded to the degree α of the highest α-cut that contains a
response beyond the limit. It is necessary to the degree 1 - π, where π is the degree to which it is
possible that the limit is not exceeded (Dubois and Prade, Possibility Theory, 1988, chapter 1). A
guaranteed bound of the peaks that lies below the limit excludes the exceedance on its level and on
all higher ones; an attained peak above the limit proves that an exceedance is possible.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import floor, log10

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import require_choice
from alphacut.base.number_text import MINUS, ShownUnit, engineering, percent_text
from alphacut.base.progress_bar import Progress
from alphacut.frame.analyses.answer import Answer, Row
from alphacut.frame.analyses.limits import (
    ANY,
    Limit,
    LimitResult,
    about_limit,
    limits_by_name,
    stated_units,
)
from alphacut.frame.analyses.peaks import Peak, Peaks, peaks
from alphacut.frame.analyses.question import Asked, Question
from alphacut.frame.analyses.suites import SuitePeaks
from alphacut.frame.result import Envelope
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.result import Ends, Nature, rounded


@dataclass(frozen=True, eq=False, kw_only=True)
class LimitDecision(LimitResult):
    """Degrees to which it is possible and necessary that a limit is exceeded, and the margins.

    Args:
        possibility: Lower and upper bound of the degree of possibility, between 0 and 1.
        necessity: Lower and upper bound of the degree of necessity, between 0 and 1.
        margin: Limit minus largest peak (`lower`) and limit minus smallest peak (`upper`) on each
            level, shape (levels,) each, in SI units; -∞ where no larger peak is excluded. For the
            event of several limits the margins are fractions of the limits.
        verdict: "not exceeded" by any response, "exceeded" by all responses, "can be exceeded" by a
            known response, or "undecided". It holds for the cuts on `from_level` and above.
        from_level: Lowest level that was computed.
        nature: Guarantee of the bounds on which both degrees rest.
        peak: The limited peak; None for the event of several limits.
        record: Record of a suite under which the peak is attained, with the angle of incidence if
            all angles are meant; empty if there is none.
        input_units: SI units of the inputs at which the peak is attained, as far as known.
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
    def peak_bound(self) -> float:
        """Guaranteed bound of the peak on the lowest level; NaN for an event."""
        return np.nan if self.peak is None else float(self.peak.proved[0])

    @property
    def attained_peak(self) -> float:
        """Attained value of the peak on the lowest level; NaN for an event."""
        return np.nan if self.peak is None else float(self.peak.reached[0])

    @property
    def verdict_words(self) -> str:
        """The verdict, with the lowest level for which it holds unless this is 0.

        A verdict on all responses that rests on an estimate says that it is unproved.
        """
        is_about_all = self.verdict in ("exceeded", "not exceeded")
        words = self.verdict
        if is_about_all and self.from_level > 0:
            words += f" from α = {self.from_level:g} up"
        if is_about_all and self.nature is not Nature.GUARANTEED:
            words += ", unproved"
        return words

    @property
    def verdict_and_motion(self) -> str:
        """The verdict in words; if only some responses exceed the limit, with one of them.

        Such a response is named by its inputs, and by its record if there is a suite: "can be
        exceeded, as at k1 = 38.00 MN/m, record RSN953". If all or no responses exceed the limit,
        or no inputs are known, the verdict stands alone. Where a proof to the limit has left part
        of the box open, an undecided one says which. A lowest computed level other than 0 is
        then added: "not exceeded from α = 0.5 up".
        """
        open_part = ""
        if self.peak is not None and self.peak.is_to_limits:
            open_part = self.peak.cause
        if self.verdict == "undecided" and open_part:
            return f"{self.verdict}: {open_part}"
        # If all responses exceed the limit, a single one is no news.
        is_by_some = self.verdict == "can be exceeded"
        if not is_by_some or self.peak is None or not self.peak.reached_at:
            return self.verdict_words
        texts = []
        for name, value in self.peak.reached_at.items():
            texts.append(f"{name} = {engineering(value, self.input_units.get(name, ''))}")
        if self.record:
            texts.append(f"record {self.record}")
        return f"{self.verdict}, as at {', '.join(texts)}"

    def text_of(self, value: float, side: str, nature: Nature = Nature.GUARANTEED) -> str:
        """Return the text of a bound of a peak or of a margin, rounded so that it stays a bound.

        Args:
            value: Bound in the SI unit of the output, or, in the decision on the event that any of
                several limits is exceeded, as a fraction of the limits; may be infinite or NaN.
            side: "lower" or "upper", for a lower or an upper bound.
            nature: Guarantee of the bound. Attained bounds are rounded into the range, all others
                out of it.

        Returns:
            The bound with its unit, which is that of the limit as it was stated; a percentage for
            an event; "not known" for a value that is not finite.
        """
        if not np.isfinite(value):
            return "not known"
        if self.is_event:
            # Percentages have one decimal place, which is the third one of the fraction. A fraction
            # whose first digit has the place 10^e has e + 4 digits up to there; 0 counts as 0.001.
            exponent = floor(log10(abs(value) or 1e-3))
            return percent_text(rounded(value, side, nature, max(4 + exponent, 1)))
        # The number is rounded in the unit in which it is shown, that of the limit. Rounded in SI,
        # it could be no bound any more after the conversion.
        factor = 1.0
        if self.stated_unit is not None:
            factor = self.stated_unit.factor
        return self.text_of_value(rounded(factor * value, side, nature) / factor)


@dataclass(frozen=True)
class DecisionQuestion(Question):
    """Possibility and necessity that limits are exceeded.

    Args:
        limits: Limits, of the largest peak over the records of a suite or of the mean over them.
    """

    reads_peaks = True
    records = "allowed"
    limits: tuple[Limit, ...]

    def answer(self, asked: Asked, progress: Progress) -> Decision:
        """Return the verdicts, which follow from the peaks alone."""
        found = asked.suite or asked.peaks
        assert found is not None  # of a question that reads peaks
        # Units are given, since peaks know the names of outputs and inputs alone.
        units = {limit.output: asked.model.unit_of(limit.output) for limit in self.limits}
        return decide(found, self.limits, units=units, input_units=asked.input_units)


@dataclass(frozen=True, eq=False, repr=False)
class Decision(Answer):
    """Possibility and necessity that limits are exceeded.

    Args:
        alpha: Levels, shape (levels,).
        limits: Decision on each limit by its name. If there are several limits, the last one, with
            the name `ANY`, is on the event that any of them is exceeded.
    """

    key = "decision"
    title = "Can or must limits be exceeded?"
    alpha: Array
    limits: dict[str, LimitDecision]

    @property
    def stated_units(self) -> dict[str, ShownUnit]:
        """Units in which the limits are stated, by output."""
        return stated_units(self.limits.values())

    def compared(self) -> dict[str, float | str]:
        """Return the verdict on each limit in words."""
        return {limit.words: limit.verdict_words for limit in self.limits.values()}

    def text_rows(self) -> Iterator[Row]:
        """Yield a row for each limit; margin, bound, attained peak and gap are of the lowest α."""
        yield from map(self._texts, self.limits.values())

    def _texts(self, part: LimitDecision) -> Row:
        """Return one row of the table by the titles of the columns.

        Margin, bound, attained peak and gap are those of the lowest level. The gap is the distance
        of bound and attained peak over the bound; it is empty where it is unknown or the bound is
        0. The event that any of several limits is exceeded has no bound, attained peak and gap.

        Args:
            part: Decision on the limit or event of the row.
        """
        bound_text = attained_text = gap = ""
        if part.peak is not None:
            bound = part.peak_bound
            attained = part.attained_peak
            bound_text = part.text_of(bound, part.peak.bound_side)
            if np.isfinite(bound):
                # The bound is an end of an interval that is open on the other side.
                relation = {"lower": "≥", "upper": "≤"}[part.peak.bound_side]
                bound_text = f"{relation} {bound_text}"
                if part.peak.is_to_limits:
                    bound_text += ", not sought closer"
            attained_text = part.text_of(attained, part.peak.bound_side, Nature.ATTAINED)
            # A gap of a bound of zero has no meaning as a fraction.
            if bound and np.isfinite(bound) and np.isfinite(attained):
                gap = f"{abs((bound - attained) / bound):.1%}"
        return {
            "limit": part.words,
            "verdict": part.verdict_and_motion,
            "nature": part.nature,
            "possibility": degree_text(part.possibility),
            "necessity": degree_text(part.necessity),
            "least margin": part.text_of(float(part.margin.lower[0]), "lower", part.nature),
            "bound of peak": bound_text,
            "peak reached": attained_text,
            "gap": gap,
        }

    def number_rows(self) -> Iterator[Row]:
        """Yield a row of numbers for each limit, and last for the event that any is exceeded.

        The first columns are name, SI unit and value of the limit. Then follow the verdict, the
        lowest computed level α and the guarantee; both bounds of the degrees to which exceeding the
        limit is possible and necessary; and on the lowest level the smallest margin, the bound of
        the peak and its attained value, in SI units. The margin of an event is a fraction of the
        limits.
        """
        for name, part in self.limits.items():
            yield {
                **part.columns(name),
                "verdict": part.verdict,
                "from α": part.from_level,
                "nature": part.nature,
                "least possibility": part.possibility[0],
                "greatest possibility": part.possibility[1],
                "least necessity": part.necessity[0],
                "greatest necessity": part.necessity[1],
                "least margin": part.margin.lower[0],
                "bound of peak": part.peak_bound,
                "peak reached": part.attained_peak,
            }

    def words(self) -> str:
        """Return sentences that explain the verdicts."""
        text = (
            "A limit is not exceeded if no response exceeds it, it is exceeded if every response"
            " does, and it can be exceeded if a response is known that does. Attained bounds show"
            " what is possible and exclude nothing."
        )
        if any(part.verdict == "undecided" for part in self.limits.values()):
            text += (
                " It is undecided where its bounds lie on both sides of the limit and no response"
                " beyond it was found: a smaller time step, narrower inputs, or method auto may"
                " decide."
            )
        if any(part.side == "mean" for part in self.limits.values()):
            text += (
                " The guaranteed bound of a mean over records is the mean of the largest peaks of"
                " the records; the attained value is the mean of one structure."
            )
        return text


def degree_text(bounds: tuple[float, float]) -> str:
    """Return both bounds of a degree as text, or one number if they agree."""
    return " … ".join(dict.fromkeys(f"{bound:.4g}" for bound in bounds)).replace("-", MINUS)


def decide(
    response: Envelope | SuitePeaks | Peaks,
    limits: Limit | Sequence[Limit],
    *,
    units: Mapping[str, str] | None = None,
    input_units: Mapping[str, str] | None = None,
) -> Decision:
    """Return the possibility and the necessity of exceeding limits, and the margins.

    The possibility is the degree α of the highest α-cut that contains a response beyond the limit.
    The necessity is 1 minus the degree to which it is possible that the limit is kept.

    Args:
        response: An envelope, the peaks over a suite of records, or peaks by name.
        limits: Limits of outputs, in SI units.
        units: SI units by the name of the output, where `response` does not hold them; by default
            those that a storey frame's outputs of these names have.
        input_units: SI units by the name of the input, for the text that names a response beyond a
            limit.

    Returns:
        The decision on each limit by its name. With several limits the last decision is on the
        event that any of them is exceeded.

    Raises:
        RefusedError: There is no limit; a limit is given twice or is not finite; a limit of a
            magnitude is not positive; or `response` has no such output or peak.

    Example:
        >>> from alphacut.frame import Limit, StoreyFrame, decide, envelope
        >>> from alphacut.fuzzy import Interval
        >>> frame = StoreyFrame(masses=[1e3], stiffness=[4e4], q0=[0.1], outputs=("q1",))
        >>> band = envelope(frame, {"k1": Interval(38e3, 42e3)}, duration=2.0, step=0.02)
        >>> decide(band, [Limit("q1", 0.15)]).limits["q1"].verdict
        'not exceeded'
    """
    output_units = dict(units or {})
    records: Mapping[str, str] = {}
    if isinstance(response, Envelope):
        named = limits_by_name(limits, response.outputs)
        output_units |= dict(zip(response.outputs, response.units, strict=False))
        found: Peaks = peaks(response, [limit.peak for limit in named.values()])
    else:
        named = limits_by_name(limits, ())
        # A limit applies to the largest peak over the records, or to the mean.
        if isinstance(response, SuitePeaks):
            output_units |= response.units
            records = {peak: response.where(peak) for peak in response.peak}
            response = response.peak
        found = response

    decisions = {}
    for name, limit in named.items():
        require_choice("limits", limit.peak, found)
        decisions[name] = _decide_limit(
            limit,
            found[limit.peak],
            unit=output_units.get(limit.output, Output(limit.output).unit),
            record=records.get(limit.peak, ""),
            input_units=input_units or {},
        )
    if len(decisions) > 1:
        # With one limit the event that any is exceeded is the limit itself.
        decisions[ANY] = _decide_any(list(decisions.values()))
    # All peaks have the same levels and enclose the same set.
    first = next(iter(found.values()))
    return Decision(first.alpha, decisions, encloses=first.encloses)


def _decide_limit(
    limit: Limit, peak: Peak, *, unit: str, record: str, input_units: Mapping[str, str]
) -> LimitDecision:
    """Return the decision on one limit from the bounds of the limited peak.

    Args:
        limit: Limit with one value, in SI units.
        peak: Bounds of the limited peak on all levels.
        unit: SI unit of the output.
        record: Record under which the peak is attained; empty if there is none.
        input_units: SI units by the name of the input, as far as known.
    """
    alpha = peak.alpha  # rising
    # All limits are treated as upper limits. "q ≥ L" is "-q ≤ -L": then `outwards` gives -L, and
    # the bounds below are those of peaks of -q.
    largest_allowed = limit.outwards
    # Lower and upper bounds of the largest and of the smallest peak in each cut, (levels,) each.
    max_peak = peak.max_peak_bounds
    min_peak = peak.min_peak_bounds

    # Some response of a cut exceeds the limit if and only if the largest peak of the cut does. The
    # possibility is the highest level of such a cut. It is at least the highest level at which the
    # lower bound of this peak exceeds the limit, and at most the level from which on the upper
    # bound keeps it (1 if there is none).
    is_exceeded = max_peak.lower > largest_allowed
    possibility = (
        float(alpha[is_exceeded].max(initial=0.0)),
        _level_from_which(alpha, max_peak.upper <= largest_allowed),
    )
    # Some response of a cut keeps the limit if and only if the smallest peak of the cut does.
    is_kept = min_peak.upper <= largest_allowed
    possibility_of_keeping = (
        float(alpha[is_kept].max(initial=0.0)),
        _level_from_which(alpha, min_peak.lower > largest_allowed),
    )
    # Responses of the highest cut exceed the limit or keep it, so that the larger one of both
    # possibilities is 1: the necessity is 0 where the possibility is below 1.
    necessity = (
        1 - possibility_of_keeping[1],
        1 - possibility_of_keeping[0] if possibility[1] == 1 else 0.0,
    )
    if necessity[0] > 0:
        possibility = (1.0, 1.0)
    lowest_level = float(alpha[0])
    return LimitDecision(
        **vars(about_limit(limit, unit)),
        possibility=possibility,
        necessity=necessity,
        margin=Ends(largest_allowed - max_peak.upper, largest_allowed - min_peak.lower),
        # Cuts are nested: what holds on the lowest level holds on all.
        verdict=_verdict(
            is_excluded=bool(max_peak.upper[0] <= largest_allowed),
            is_necessary=bool(min_peak.lower[0] > largest_allowed),
            is_exceeded=bool(is_exceeded.any()),
        ),
        from_level=lowest_level,
        nature=peak.nature,
        peak=peak,
        record=record,
        input_units=dict(input_units),
    )


def _decide_any(single: Sequence[LimitDecision]) -> LimitDecision:
    """Return the decision on the event that any of several limits is exceeded.

    Its margins are the smallest ones of the single limits as fractions of these limits; a limit of
    0 counts as -1, 0 or 1 by the sign of its margin. It has no peak and no record, and its
    guarantee is the weakest one of the single decisions.

    Args:
        single: Decisions on the limits one by one, at least one, on the same levels.
    """
    # Let Π be the possibility and N = 1 - Π(all limits are kept) the necessity of the event. With
    # the events A_i that single limits are exceeded, Π is max Π(A_i), and N is at least max N(A_i).
    # As max(Π, 1 - N) = 1 (some response of the highest cut either exceeds or keeps the limits), N
    # is 0 unless Π is 1; no other upper bound follows from the single limits.
    possibility = (
        max(part.possibility[0] for part in single),
        max(part.possibility[1] for part in single),
    )
    necessity = (
        max(part.necessity[0] for part in single),
        float(possibility[1] >= 1),
    )
    margins = []
    for part in single:
        margin = np.stack(part.margin)
        # Only fractions of limits compare where units differ. A limit of 0 has no fraction, so that
        # the sign of its margin is taken.
        if part.limit:
            margins.append(margin / abs(part.limit))
        else:
            margins.append(np.sign(margin))
    # The event leaves the smallest of the margins.
    lower, upper = np.min(margins, axis=0)
    lowest_level = single[0].from_level
    verdicts = [part.verdict for part in single]
    return LimitDecision(
        output=ANY,
        is_event=True,
        possibility=possibility,
        necessity=necessity,
        margin=Ends(lower, upper),
        verdict=_verdict(
            is_excluded=set(verdicts) == {"not exceeded"},
            is_necessary="exceeded" in verdicts,
            is_exceeded="can be exceeded" in verdicts,
        ),
        from_level=lowest_level,
        nature=Nature.weakest(part.nature for part in single),
    )


def _verdict(*, is_excluded: bool, is_necessary: bool, is_exceeded: bool) -> str:
    """Return the verdict on the cuts from the lowest computed level on, as one of four texts.

    Args:
        is_excluded: Whether no response of these cuts exceeds the limit: "not exceeded".
        is_necessary: Whether all do: "exceeded".
        is_exceeded: Whether one is known that does: "can be exceeded"; else it is "undecided".
    """
    if is_excluded:
        return "not exceeded"
    if is_necessary:
        return "exceeded"
    if is_exceeded:
        return "can be exceeded"
    return "undecided"


def _level_from_which(alpha: Array, holds: Mask) -> float:
    """Return the lowest level from which on a mask holds up to the top, or 1 if there is none.

    Args:
        alpha: Rising levels, shape (levels,).
        holds: The mask, shape (levels,).
    """
    # The level above the last one at which the mask does not hold, or 1, the largest possibility,
    # if that is the last level.
    first = np.flatnonzero(~holds).max(initial=-1) + 1
    return float(np.append(alpha, 1.0)[first])
