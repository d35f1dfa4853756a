"""Limits of outputs as the texts of a case state them.

A limit is a text such as "drift1 <= 40 mm" or "drift1 <= 0.5 %" of the magnitude, "max q3 <= 80 mm"
or "min q3 >= -60 mm" of one side, "mean drift1 <= 30 mm" of the mean over the records of a suite.
"drift <= 1/200" limits every storey, "base_shear <= 8 %" is in shares of the weight.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Annotated, cast

from pydantic import PlainValidator

from alphacut.base.errors import RefusedError, require
from alphacut.base.number_text import STANDARD_GRAVITY
from alphacut.case.structure import Structure
from alphacut.case.types import NotEmpty
from alphacut.frame import Limit
from alphacut.frame.analyses.limits import Side
from alphacut.frame.structures.quantities import OUTPUTS, Output
from alphacut.io import quantity

BASE_SHEAR = "base_shear"


@dataclass(frozen=True)
class CaseLimit:
    """Limit of an output over time, as the text of a case states it.

    Args:
        side: "" if the magnitude of the output is limited, "mean" if the mean of the largest
            magnitudes over the records of a suite is, "max" or "min" if its largest or smallest
            value is.
        output: Name of the output, such as "drift1".
        value: The limit. If `is_relative`, a fraction of the height of the storey or of the weight;
            else in the SI unit of the output.
        is_relative: Whether `value` is such a fraction.
        text: The limit as the case states it.
        event: Text of the limit of all storeys of which this one is a part; empty otherwise.
    """

    side: Side
    output: str
    value: float
    is_relative: bool
    text: str
    event: str = ""

    @property
    def peak(self) -> str:
        """Name of the limited peak, such as "max q3"."""
        return f"{self.side} {self.output}".strip()  # of a magnitude the side is empty

    def limit(self, structure: Structure, key: str) -> Limit:
        """Return the limit in the SI unit of its output, as `alphacut.frame` takes it.

        The side is "max", "min" or "mean", or empty if the magnitude of the output is limited; the
        text is the whole limit as the case states it, such as "max q3 <= 80 mm".

        Args:
            structure: Structure with the output. Heights and weight are taken from it.
            key: Key of the limits in the case, for messages.

        Raises:
            RefusedError: A fraction refers to a height or weight that the structure lacks, or the
                unit is not that of the output.
        """
        return Limit(
            self.output,
            self.value_in_si(structure, key),
            largest={"max": True, "min": False}.get(self.side),  # None: the magnitude is limited
            mean=self.side == "mean",
            stated=re.split("[<>]=", self.text)[1].strip(),
            event=self.event,
        )

    def value_in_si(self, structure: Structure, key: str) -> float:
        """Return the limit in the SI unit of its output.

        A relative limit, such as "drift1 <= 1 %", has a fraction as its `value`. For the base shear
        it is a fraction of the weight of all floors, for any other output of the height of the
        storey, unless the output is a ratio itself.

        Args:
            structure: The structure, for its weight, heights and the units of its outputs.
            key: Key of the limits in the case, for messages.

        Raises:
            RefusedError: The structure has no floor masses, or no height of the storey; or the
                limit is not in the unit of the output.
        """
        if not self.is_relative:
            return self._value_in_unit_of_output(structure, key)
        # A structure from matrices may have a drift over its height as an output.
        if self.output in structure.outputs and not structure.unit(self.output):
            return self.value
        if self.output == BASE_SHEAR:
            allowed = "a share of the weight beside [frame], or a force, as 90 kN"
            # A fuzzy weight or height enters with the lower end of its support: the limit is then
            # the strictest of those that it may mean.
            masses = structure.floor_masses
            require(bool(masses), key, self.text, allowed)
            min_mass = sum(mass.support.lower for mass in masses)
            return self.value * (STANDARD_GRAVITY * min_mass)
        height = structure.heights.get(self.output)
        if height is None:
            raise RefusedError(key, self.text, "a drift of a storey whose length frame.lengths has")
        return self.value * height.support.lower

    def _value_in_unit_of_output(self, structure: Structure, key: str) -> float:
        """Return an absolute limit in the SI unit of its output.

        The name of an output of a frame tells its unit, so `value` was converted when the case was
        read. A structure from matrices states the unit of each output itself: its limit is
        converted here. Outputs in a unit without a known dimension keep the number as it is.

        Args:
            structure: The structure, which may not have the output; then `value` is returned.
            key: Key of the limits in the case, for messages.

        Raises:
            RefusedError: The limit is in another unit, or in none.
        """
        if self.output not in structure.outputs:
            return self.value
        unit = structure.unit(self.output)
        is_read = unit == Output(self.output).unit  # by which the limit was converted
        if is_read or unit not in quantity.QUANTITIES:
            return self.value
        dimension = quantity.QUANTITIES[unit]
        try:
            return quantity.parse_number(re.split("[<>]=", self.text)[1].strip(), unit)
        except ValueError as error:
            allowed = f'{dimension.name}, as "{dimension.example}"'
            raise RefusedError(key, self.text, allowed, str(error)) from None

    def by_storey(self, structure: Structure) -> tuple[CaseLimit, ...]:
        """Return one limit for each floor or storey, if the output is named without a number.

        In a frame with three floors "drift <= 1 %" becomes "drift1 <= 1 %", "drift2 <= 1 %" and
        "drift3 <= 1 %". If there are several, each has the original text as its `event`, by which
        questions join them again.

        Args:
            structure: The structure, for its number of floors.

        Returns:
            The limits from the ground up. A limit with a number or of the whole frame, and any
            limit of a structure without floors, is returned alone and unchanged.
        """
        # OUTPUTS has words, such as "drift of storey", for outputs that each storey or floor has,
        # and an empty text for outputs of the whole frame, such as the base shear.
        _, words = OUTPUTS.get(self.output, ("", ""))
        if not structure.model.floors or not words:
            return (self,)
        names = [f"{self.output}{z}" for z in range(1, structure.model.floors + 1)]
        # With a single storey there is nothing to join.
        event = ""
        if len(names) > 1:
            event = self.text
        limits = []
        for name in names:
            # Whole words alone are replaced: in "max a <= 1 g" the second a, not that of max.
            text = re.sub(rf"\b{self.output}\b", name, self.text)
            limits.append(replace(self, output=name, text=text, event=event))
        return tuple(limits)


def parse_limit(value: object) -> CaseLimit:
    """Return the limit that a text such as "drift1 <= 40 mm" states.

    The text is "[max|min|mean] OUTPUT <= VALUE", and "min OUTPUT >= VALUE". VALUE is a quantity
    with its unit. Of drifts, residual drifts and the base shear it may be a fraction, "1/200" or
    "0.5 %", which then refers to the height of the storey or to the weight.

    Returns:
        CaseLimit: Its value is in the SI unit of the output, or a fraction if it refers to a height
        or the weight. If the name of the output tells no unit, the value is in the SI unit that
        belongs to the unit written.

    Raises:
        RefusedError: The text has another form, "<=" or ">=" does not fit max or min, VALUE is
            several values or an interval, its unit is not that of the output, or a limit of a
            magnitude is not positive.
    """
    match = re.fullmatch(r"(?:(max|min|mean) )?(\w+)\s*(<=|>=)\s*(.+)", str(value).strip())
    allowed = "'drift1 <= 40 mm', 'drift <= 1/200', 'max q3 <= 80 mm' or 'min q3 >= -60 mm'"
    if match is None or (match[3] == ">=") != (match[1] == "min"):  # only least values have >=
        raise RefusedError("", value, allowed)
    side, name, _, text = match.groups()
    ratio = re.fullmatch(r"1\s*/\s*([1-9][0-9]{0,8})", text)
    has_reference = name.startswith(("drift", "residual")) or name == BASE_SHEAR
    is_relative = has_reference and (ratio is not None or text.endswith("%"))
    # Fractions without a reference, such as "q1 <= 5 %", are refused by their unit.
    unit = Output(name).unit
    if is_relative:
        unit = ""
    try:
        if ratio is not None and is_relative:
            number = 1 / int(ratio[1])
        elif unit == "SI":
            # Only a structure from matrices knows the unit of such an output: any unit is taken
            # here, and `CaseLimit.value_in_si` reads the text again.
            fuzzy, _ = quantity.parse_fuzzy_in_any_unit(text)
            if fuzzy.support.width > 0:
                raise ValueError("several values stand where one is needed")
            number = float(fuzzy.nominal)
        else:
            number = quantity.parse_number(text, unit)
    except ValueError as error:
        cure = str(error)
        if has_reference and re.fullmatch(r"\d*\.?\d+", text):
            of = "the weight" if name == BASE_SHEAR else "the storey's height"
            cure += f", or % of {of}, as {100 * float(text):g} %"
        raise RefusedError("", value, allowed, cure) from None
    # A magnitude is never below 0, while values of an output may be negative.
    require(number > 0 or side in ("max", "min"), "", value, allowed)
    return CaseLimit(cast("Side", side or ""), name, number, is_relative, str(value))


AnyLimit = Annotated[CaseLimit, PlainValidator(parse_limit)]
Limits = Annotated[tuple[AnyLimit, ...], NotEmpty]
