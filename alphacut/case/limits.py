"""Limits of outputs, and the sections of the questions that are about them.

A limit is a text such as "drift1 <= 40 mm" or "drift1 <= 0.5 %" of the magnitude, "max q3 <= 80 mm"
or "min q3 >= -60 mm" of one side, "mean drift1 <= 30 mm" of the mean over the records of a suite.
"drift <= 1/200" limits every storey, "base_shear <= 8 %" is in shares of the weight.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal, Self, cast

import numpy as np
from pydantic import PlainValidator

from alphacut.base.errors import RefusedError, require
from alphacut.case.structure import Structure
from alphacut.case.types import NotEmpty, Quantity, Section
from alphacut.frame.structures.quantities import OUTPUTS, Output
from alphacut.io import quantity

Side = Literal["", "max", "min", "mean"]
BASE_SHEAR = "base_shear"


@dataclass(frozen=True)
class Limit:
    """Largest magnitude allowed of an output, or its greatest or least value.

    `side` is "max" or "min" of the output itself, "" of its magnitude, "mean" of that over records;
    the value is in SI or, if relative, a fraction of the storey's height or of the weight.
    """

    side: Side
    output: str
    value: float
    is_relative: bool
    text: str

    @property
    def peak(self) -> str:
        """Name of the peak as `Peaks` has it, such as "max q3"."""
        return f"{self.side} {self.output}".strip()

    @property
    def sign(self) -> int:
        """−1 of a least value, whose peak is that of the output's negative; else 1."""
        return -1 if self.side == "min" else 1

    def value_in_si(self, structure: Structure, key: str) -> float:
        """The limit in the SI unit of its output; a fraction is of the least height or weight."""
        if not self.is_relative:
            return self.value
        if self.output == BASE_SHEAR:
            allowed = "a share of the weight beside [frame], or a force, as 90 kN"
            require(structure.frame is not None, key, self.text, allowed)
            return self.value * structure.least_weight
        height = structure.heights.get(self.output)
        if height is None:
            raise RefusedError(key, self.text, "a drift of a storey whose length frame.lengths has")
        return self.value * height.support.lower

    def by_storey(self, structure: Structure) -> tuple[Limit, ...]:
        """The limits of all floors or storeys of a frame that "drift" means; else itself."""
        _, words = OUTPUTS.get(self.output, ("", ""))
        if structure.frame is None or not words:
            return (self,)
        names = [f"{self.output}{z}" for z in range(1, structure.frame.floors + 1)]
        word = rf"\b{self.output}\b"  # the "a" of "max a" alone
        return tuple(replace(self, output=x, text=re.sub(word, x, self.text)) for x in names)


def parse_limit(value: object) -> Limit:
    """Limit that a text such as "drift1 <= 40 mm" states; of a magnitude it is positive."""
    match = re.fullmatch(r"(?:(max|min|mean) )?(\w+)\s*(<=|>=)\s*(.+)", str(value).strip())
    allowed = "'drift1 <= 40 mm', 'drift <= 1/200', 'max q3 <= 80 mm' or 'min q3 >= -60 mm'"
    if match is None or (match[3] == ">=") != (match[1] == "min"):  # only least values have >=
        raise RefusedError("", value, allowed)
    side, name, _, text = match.groups()
    ratio = re.fullmatch(r"1\s*/\s*([1-9][0-9]{0,8})", text)
    has_reference = name.startswith(("drift", "residual")) or name == BASE_SHEAR
    is_relative = has_reference and (ratio is not None or text.endswith("%"))
    unit = "" if is_relative else Output(name).unit
    try:
        if ratio is not None and is_relative:
            number = 1 / int(ratio[1])
        elif unit == "SI":  # the output's is not known here
            number = float(quantity.parse_fuzzy_in_any_unit(text).nominal)
        else:
            number = quantity.parse_number(text, unit)
    except ValueError as error:
        raise RefusedError("", value, allowed, str(error)) from None
    require(number > 0 or side in ("max", "min"), "", value, allowed)
    return Limit(cast("Side", side or ""), name, number, is_relative, str(value))


AnyLimit = Annotated[Limit, PlainValidator(parse_limit)]
Limits = Annotated[tuple[AnyLimit, ...], NotEmpty]


class QuestionSection(Section):
    """A question about limits of outputs, as a section of the case.

    `reads_peaks`: the answer follows from the peaks of the limited outputs. `needs_magnitudes`:
    each output has one limit, of its magnitude.
    """

    key: ClassVar[str]
    reads_peaks: ClassVar[bool] = False
    needs_magnitudes: ClassVar[bool] = False
    limits: Limits
    """limits of outputs, 'drift1 <= 40 mm', 'max q3 <= 80 mm', 'min q3 >= -60 mm';
    'drift <= 1 %' or 'drift <= 1/200' of the height of every storey, 'base_shear <= 8 %' of the
    weight"""

    def with_storeys(self, structure: Structure) -> Self:
        """The section with a limit of every storey as one of each; see `Limit.by_storey`."""
        limits = (x for limit in self.limits for x in limit.by_storey(structure))
        return self.model_copy(update={"limits": tuple(limits)})

    @property
    def limits_by_name(self) -> dict[str, Limit]:
        """Limits by name: the peak, such as "max q3", or the text where a peak has several."""
        peaks = [limit.peak for limit in self.limits]
        return {x.peak if peaks.count(x.peak) == 1 else x.text: x for x in self.limits}

    def limits_in_si(self, structure: Structure) -> dict[str, float]:
        """Value of each peak's limit in the SI unit of its output, by `limits_by_name`.

        The peak of a least value is that of the output's negative, and so is its limit.
        """
        key, limits = f"{self.key}.limits", self.limits_by_name
        # 0.0 − 0.0 is no negative zero
        values = {name: 0.0 + x.sign * x.value_in_si(structure, key) for name, x in limits.items()}
        outputs = tuple(dict.fromkeys(limit.output for limit in self.limits))
        structure.require_quantities(key, outputs)
        texts = ", ".join(limit.text for limit in self.limits)
        require(len(values) == len(self.limits), key, texts, "each limit once")
        return values

    def require_answerable(self, structure: Structure) -> None:
        """Refuses outputs that the structure lacks, and limits that this question cannot take."""
        self.limits_in_si(structure)
        if self.needs_magnitudes:
            is_one_each = all(name == x.output for name, x in self.limits_by_name.items())
            texts = ", ".join(limit.text for limit in self.limits)
            allowed = "one limit of the magnitude for each output"
            require(is_one_each, f"{self.key}.limits", texts, allowed)


class DecisionSection(QuestionSection):
    """Possibility and necessity that limits are exceeded."""

    key = "decision"
    reads_peaks = True


class ProbabilitySection(QuestionSection):
    """Fuzzy probability that limits are exceeded; inputs that are not random stay fuzzy."""

    key = "probability"
    needs_magnitudes = True

    random: tuple[str, ...] = ()
    """inputs that are random, with the shape of their membership"""
    samples: Annotated[int, Quantity(minimum=1, maximum=10_000, is_integer=True)] = 200
    """random draws at each fuzzy point"""

    def require_answerable(self, structure: Structure) -> None:
        """Refuses limits and random inputs that the structure does not have."""
        super().require_answerable(structure)
        structure.inputs([name for name in self.random if name != "E"], "probability.random")


class TolerancesSection(QuestionSection):
    """Largest scale of the supports of the fuzzy inputs at which no limit is exceeded."""

    key = "tolerances"
    needs_magnitudes = True
    reads_peaks = True

    most: Annotated[float, Quantity(above=0, maximum=100)] = 2.0
    """largest scale that is tried; 1 is that of the case"""


class FragilitySection(QuestionSection):
    """Fraction of the records under which limits are exceeded, over a measure of records."""

    key = "fragility"
    reads_peaks = True

    measure: Literal["Sa(T1)", "PGA", "scale"] = "Sa(T1)"
    """measure of a record; Sa(T1) is the pseudo-acceleration ω² max |u| at the nominal structure's
    first period, with its own damping ratio (not 5 %)"""
    independent: bool = False
    """whether records count as independent draws: 95 % limits"""
    most: Annotated[float, Quantity(above=0, maximum=100)] = 2.0
    """of columns that yield: largest measure tried, as a multiple of the one at which the nominal
    structure would reach all limits under all records if it were elastic"""

    def require_answerable(self, structure: Structure) -> None:
        """Refuses structures with forces or a start beside the record, and unfit limits."""
        super().require_answerable(structure)
        linear = structure.linear
        is_free = linear is not None and not linear.loads
        is_at_rest = not any(np.any(getattr(linear, start, 0)) for start in ("q0", "v0"))
        allowed = "linear structures and frames that yield, at rest and without forces"
        require(is_free and is_at_rest, "fragility", "of another motion", allowed)
        yields = bool(getattr(linear, "hardening", ()))
        is_used = yields or not self.has_key("most")
        require(is_used, "fragility.most", self.most, "beside columns that yield")
        for limit in self.limits:
            fits = limit.sign * limit.value > 0 and limit.side != "mean"
            allowed = "limits of each record that the structure at rest keeps"
            if yields:
                fits, allowed = limit.side == "", "limits of magnitudes, of columns that yield"
            require(fits, "fragility.limits", limit.text, allowed)
