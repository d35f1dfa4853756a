"""Limits of outputs, and what the results about single limits have in common."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from alphacut.base.errors import checked_number, require, require_choice
from alphacut.base.number_text import MINUS, ShownUnit, engineering
from alphacut.frame.analyses.answer import Record
from alphacut.frame.structures.linear import has_matrices
from alphacut.frame.structures.model import StructureModel
from alphacut.frame.structures.quantities import Output
from alphacut.frame.structures.storey import yields
from alphacut.frame.threshold import Threshold

Side = Literal["", "max", "min", "mean"]
"""What is limited: the largest magnitude, the largest value or the smallest value of an output over
time, or the mean over the records of a suite of its largest magnitude."""
ANY = "any of them"
"""Name of the event that any of several limits is exceeded."""


@dataclass(frozen=True)
class Limit:
    """Limit of an output over time, by default of its magnitude.

    Args:
        output: Name of the output, such as "drift1".
        value: Limit in the SI unit of the output. Two values are the ends of a range that the
            output must not leave.
        largest: True to limit the largest value of the output instead of its magnitude, False to
            limit its smallest value, which must not fall below `value`.
        mean: Whether the mean of the largest magnitudes over the records of a suite is limited.
        stated: Limit as its author wrote it, such as "1 %"; if empty, it is shown in its SI unit.
        event: Name that several limits share if the event that any of them is exceeded is of
            interest, such as "drift <= 1 %" for the drifts of all storeys; empty otherwise.

    Example:
        >>> [str(limit) for limit in Limit("q3", (-0.06, 0.08)).one_sided]
        ['min q3 ≥ −60.00 mm', 'max q3 ≤ 80.00 mm']
    """

    output: str
    value: float | tuple[float, float]
    largest: bool | None = None
    mean: bool = False
    stated: str = ""
    event: str = ""

    @property
    def one_sided(self) -> tuple[Limit, ...]:
        """The limit itself, or the limits of both ends of a range.

        A limit with one value gives itself alone. A pair of values (lower, upper) gives two
        limits: first of the smallest value by the lower end, then of the largest by the upper end.
        Output, event and stated text are those of this limit.
        """
        if not isinstance(self.value, Sequence):
            return (self,)
        lower, upper = self.value
        return (
            replace(self, value=lower, largest=False),
            replace(self, value=upper, largest=True),
        )

    @property
    def side(self) -> Side:
        """What is limited, by the word that a case file has for it."""
        if self.mean:
            return "mean"
        sides: dict[bool | None, Side] = {None: "", True: "max", False: "min"}
        return sides[self.largest]

    @property
    def peak(self) -> str:
        """Name of the limited peak, such as "max q3"."""
        return f"{self.side} {self.output}".strip()

    @property
    def number(self) -> float:
        """The value of a one-sided limit."""
        return float(self.value)  # type: ignore[arg-type]

    @property
    def outwards(self) -> float:
        """The number that a peak must not exceed, in the SI unit of the output.

        For a limit of the largest value or of the magnitude it is the limit itself. For a limit L
        of the smallest value of an output q it is -L, and the peak is the largest value of -q: it
        exceeds -L if the smallest value of q falls below L. The limit has one value, no range.
        """
        # Smallest values are compared by their negatives, so that all limits are upper limits.
        sign = -1.0 if self.side == "min" else 1.0
        return sign * self.number + 0.0  # -0.0 becomes 0.0

    @property
    def text(self) -> str:
        """The limit in the form of a case file, such as "min q3 >= -0.06"."""
        relation = ">=" if self.side == "min" else "<="
        return f"{self.peak} {relation} {self.stated or f'{self.number:g}'}"

    def __str__(self) -> str:
        """Return the limit as text, in the unit that a storey frame's output of this name has."""
        unit = Output(self.output).unit.removeprefix("SI")  # "SI" stands for an unknown unit
        return about_limit(self, unit).words


def limits_by_name(
    limits: Limit | Sequence[Limit], outputs: Sequence[str], *, magnitudes: bool = False
) -> dict[str, Limit]:
    """Check limits and return them by name, in their order.

    A range of two values becomes two limits, of the smallest and of the largest value. The name of
    a limit is that of the limited peak: "q3" for the magnitude of the output q3, "max q3" and
    "min q3" for its largest and smallest value, "mean q3" for the mean of magnitudes over records.
    If one peak has several limits, the name is the text of the limit, such as "max q3 <= 0.06".

    Args:
        limits: One limit or several.
        outputs: Names of the available outputs; empty to accept all.
        magnitudes: Whether each output may have only one limit, which must be of its magnitude.

    Raises:
        RefusedError: There is no limit; a limit is given twice, names no output or is not a finite
            number; a limit of a magnitude or of a mean is not positive; a mean has a range; or an
            output has several limits, or one that is not of its magnitude, though `magnitudes` is
            set.
    """
    if isinstance(limits, Limit):
        limits = [limits]
    single = [side for limit in limits for side in limit.one_sided]
    require(bool(single), "limits", value=None, allowed='one limit or more: Limit("q3", 0.1)')
    for limit in single:
        if outputs:
            require_choice("limits", limit.output, outputs)
        has_side = limit.largest is not None
        allowed = "a mean of magnitudes, with one value"
        require(not (limit.mean and has_side), "limits", value=limit.text, allowed=allowed)
        is_magnitude = limit.side in ("", "mean")
        checked_number(f"limit of {limit.peak}", limit.number, positive=is_magnitude)

    # One peak may have several limits, such as those of different states; then the text names them.
    peaks = [limit.peak for limit in single]
    named = {}
    for limit in single:
        is_only_one = peaks.count(limit.peak) == 1
        named[limit.peak if is_only_one else limit.text] = limit
    texts = ", ".join(limit.text for limit in single)
    require(len(named) == len(single), "limits", value=texts, allowed="each limit once")
    if magnitudes:
        is_one_each = all(name == limit.output for name, limit in named.items())
        allowed = "one limit of the magnitude for each output"
        require(is_one_each, "limits", value=texts, allowed=allowed)
    return named


@dataclass(frozen=True, eq=False, kw_only=True)
class LimitResult:
    """Base class of results about one limit, or about the event that any of several is exceeded.

    Args:
        side: What is limited.
        output: Name of the output, or the text of the event.
        unit: SI unit of the output; empty for an event.
        limit: The limit in that unit; 1 for an event.
        stated: The limit as its author wrote it; if empty, it is shown in its SI unit.
        is_event: Whether the result is about the event that any of several limits is exceeded.
        event_name: Name of the event to which the limit belongs; empty if there is none.
    """

    side: Side = ""
    output: str
    unit: str = ""
    limit: float = 1.0
    stated: str = ""
    is_event: bool = False
    event_name: str = ""

    @property
    def peak_name(self) -> str:
        """Name of the limited peak, such as "max q3"."""
        return f"{self.side} {self.output}".strip()

    @property
    def words(self) -> str:
        """The limit in words, or the text of the event that any of several limits is exceeded.

        A limit of a magnitude reads "|drift1| ≤ 1 % (30.00 mm)", of a mean over records
        "mean |q3| ≤ 40.00 mm", of a largest value "max q3 ≤ 80.00 mm", and of a smallest value
        "min q3 ≥ −60.00 mm".
        """
        if self.is_event:
            return self.output
        if self.side == "min":
            return f"min {self.output} ≥ {self.value_words}"
        if self.side == "max":
            return f"max {self.output} ≤ {self.value_words}"
        return f"{self.side} |{self.output}| ≤ {self.value_words}".strip()

    @property
    def value_words(self) -> str:
        """The value of the limit in words, such as "30.00 mm" or "1 % (30.00 mm)".

        It is the text that the author of the limit stated, if there is one, with typographic minus
        signs. A percentage, or a ratio of 1 to a whole number such as "1/200", is followed by the
        value in the SI unit of the output, if the output has one. Without a stated text it is the
        value with four digits and a suitable prefix of the unit.
        """
        in_si = engineering(self.limit, self.unit)
        if not self.stated:
            return in_si
        # Minus signs are typographic in texts.
        stated = re.sub(r"-(?=[\d.])", MINUS, self.stated)
        # A fraction of a storey height or of the weight tells an engineer more with its value.
        is_fraction = stated.endswith("%") or re.fullmatch(r"1\s*/\s*\d+", stated)
        if is_fraction and self.unit:
            return f"{stated} ({in_si})"
        return stated

    @property
    def stated_unit(self) -> ShownUnit | None:
        """The unit in which the limit was stated, such as "mm" with the factor 1000 from m.

        The factor is the stated value over the SI value. The result is None if the limit is zero,
        was not stated in words, or was stated as a percentage, as a ratio or as a plain number.
        """
        # A number followed by a unit; fractions ("1/200") and percentages have no unit.
        number_and_unit = r"([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*([^\d\s%/.].*)"
        match = re.fullmatch(number_and_unit, self.stated.replace(MINUS, "-"))
        if match is None or not self.limit or not float(match[1]):
            return None
        return ShownUnit(match[2], float(match[1]) / self.limit)

    def text_of_value(self, value: float) -> str:
        """Return the text of a value of the output, given in SI, in the unit of the limit."""
        unit = self.stated_unit
        if unit is None:
            return engineering(value, self.unit)
        return unit.text(value)

    @property
    def event(self) -> str:
        """Text of the event that the limit is exceeded, such as "|drift1| > 40.00 mm"."""
        words = self.words.replace("≤", ">").replace("≥", "<")
        return f"{words} exceeded" if self.is_event else words

    def columns(self, name: str) -> Record:
        """Return the first columns of a row of numbers about the limit with a name."""
        return {"limited output": name, "unit": self.unit, "limit": self.limit}


def stated_units(results: Iterable[LimitResult]) -> dict[str, ShownUnit]:
    """Return the unit in which the first limit of each output is stated, by output."""
    found: dict[str, ShownUnit] = {}
    for result in results:
        if result.stated_unit is not None:
            found.setdefault(result.output, result.stated_unit)
    return found


def about_limit(limit: Limit, unit: str) -> LimitResult:
    """Return what every result says about its limit: side, output, SI unit, value, stated text.

    Results of single analyses take these fields by `vars` and add their own.

    Args:
        limit: The limit, with one value.
        unit: SI unit of the output; empty if it has none.
    """
    return LimitResult(
        side=limit.side, output=limit.output, unit=unit, limit=limit.number, stated=limit.stated
    )


def thresholds_of(model: StructureModel, limits: Sequence[Limit]) -> tuple[Threshold, ...]:
    """Return limits as the questions that a proof answers.

    There are none of linear structures, whose peaks are bounded closely in any case. So is a peak
    whose mean over records is limited.

    Args:
        model: The structure.
        limits: Limits with one value each, in SI units.
    """
    if not yields(model):
        return ()
    return tuple(Threshold(x.output, None if x.mean else x.outwards, x.largest) for x in limits)


def require_fragile(model: StructureModel, limits: Sequence[Limit]) -> None:
    """Check that a structure and its limits permit a fragility analysis.

    Args:
        model: The structure.
        limits: Limits with one value each.

    Raises:
        RefusedError: The structure has no matrices of mass, damping and stiffness, does not start
            at rest or has forces; a limit is one of the mean over records; a linear structure at
            rest exceeds a limit; or columns yield, and a limit is not one of a magnitude.
    """
    is_moved_by_record = has_matrices(model) and not model.loads and model.is_at_rest
    # A start or a force would add a part to the response that does not scale with the record.
    allowed = "linear structures and frames that yield, at rest and without forces"
    require(is_moved_by_record, "fragility", value="of another motion", allowed=allowed)
    for limit in limits:
        # A structure that exceeds a limit at rest has no critical measure.
        if yields(model):
            fits = limit.side == ""
            allowed = "limits of magnitudes, of columns that yield"
        else:
            fits = limit.outwards > 0 and not limit.mean
            allowed = "limits of each record that the structure at rest keeps"
        require(fits, "limits", value=limit.text, allowed=allowed)
