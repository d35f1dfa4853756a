"""Limit of an exceedance and tolerance of envelopes, each in the unit of its output."""

from __future__ import annotations

from dataclasses import dataclass

from alphacut.case.case import Case
from alphacut.io import quantity


def limit_of(case: Case) -> float:
    """Limit in the SI unit of its output; a drift also as a share of the height.

    Raises:
        BadInput: It is no positive quantity of that unit.
    """
    from alphacut.frame.outputs import output_unit

    name, text = case.exceedance.output, case.exceedance.limit
    unit, height = output_unit(name), storey_height(case, name)
    try:
        share = height is not None and text.rstrip().endswith("%")
        limit = (
            height * quantity.number(text, "") if share and height else quantity.number(text, unit)
        )
    except ValueError as error:
        kind = f"a quantity in {unit}, as the output is" + (
            ", or a share of the storey's height such as 0.5 %" if height else ""
        )
        raise case.refuse("exceedance.limit", str(error), kind) from None
    if not limit > 0:
        raise case.refuse("exceedance.limit", "out of range", "greater than 0")
    return limit


def storey_height(case: Case, output: str) -> float | None:
    """The height in m of the storey whose drift an output is; None for any other output."""
    kind, floor = output.rstrip("0123456789"), output.lstrip("abcdefghijklmnopqrstuvwxyz_")
    if kind != "drift":
        return None
    if case.sections.tower:
        return case.tower.height
    lengths = case.sections.frame.lengths if case.sections.frame else ()
    index = 0 if len(lengths) == 1 else int(floor or 1) - 1
    return lengths[index].modal if 0 <= index < len(lengths) else None


@dataclass(frozen=True)
class AskedTolerance:
    """Tolerance of envelopes that a case names.

    Args:
        value: In SI, or a share of a peak.
        unit: Its unit in words, such as `` m`` or `` of a peak``.
        changed: Whether the command line names it.
    """

    value: float
    unit: str
    changed: bool


def asked_tolerance(case: Case) -> AskedTolerance | None:
    """Tolerance of envelopes that a case names; None where a default stands in."""
    named: list[tuple[str, float | None, str]] = [
        ("envelope.relative_tolerance", case.envelope.relative_tolerance, " of a peak"),
        ("envelope.tolerance", case.envelope.tolerance, " m"),
    ]
    if case.sections.pendulum:
        named.append(("pendulum.tolerance", case.pendulum.tolerance, " N"))
    for key, value, unit in named:
        if value is not None and case.asked(key):
            return AskedTolerance(value, unit, key in case.changed)
    return None
