"""Limits and tolerances in the unit of their output, and checks of questions to the motion."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from alphacut.case.case import Case
from alphacut.case.names import OUTPUTS, frame_outputs, structures
from alphacut.case.values import nearest
from alphacut.io import quantity
from alphacut.io.problem import BadInput, Problem


def exceeded_limits(case: Case) -> dict[str, float]:
    """The limits of [exceedance] by output in SI, as `limit_in`: of output and limit, or limits."""
    given = case.exceedance
    if given.limits:
        return limits_in(case, "exceedance.limits", given.limits)
    return {given.output: limit_in(case, "exceedance.limit", given.output, given.limit)}


@dataclass(frozen=True)
class Limit:
    """Largest magnitude allowed of an output.

    Args:
        output: Of the structure.
        value: In the SI unit of the output.
        name: The output, or the limit as it is written where the output has several.
    """

    output: str
    value: float
    name: str


def limits_of(case: Case) -> tuple[Limit, ...]:
    """The limits of [decision], one or several for each output.

    Raises:
        BadInput: One is no sentence such as "drift1 <= 40 mm", or is there twice.
    """
    key = "decision.limits"
    parts = [limit_parts(case, key, text) for text in case.decision.limits]
    outputs = [output for output, _ in parts]
    found = tuple(
        Limit(
            output,
            limit_in(case, key, output, text),
            output if outputs.count(output) == 1 else f"{output} <= {text}",
        )
        for output, text in parts
    )
    if len({(one.output, one.value) for one in found}) < len(found):
        raise case.refuse(key, "a limit is there twice", "each once")
    return found


def limit_parts(case: Case, key: str, text: str) -> tuple[str, str]:
    """Output and quantity of a limit.

    Raises:
        BadInput: It is no sentence such as "drift1 <= 40 mm".
    """
    name, bound, limit = (part.strip() for part in text.partition("<="))
    if not bound or not re.fullmatch(r"\w+", name):
        what = f"'{text}' is no limit"
        raise case.refuse(key, what, "an output, <= and a quantity, as 'drift1 <= 40 mm'")
    return name, limit


def limits_in(case: Case, key: str, texts: Sequence[str]) -> dict[str, float]:
    """Limits by output, as `limit_in`.

    Raises:
        BadInput: One is no sentence such as "drift1 <= 40 mm", or an output has two.
    """
    found: dict[str, float] = {}
    for text in texts:
        name, limit = limit_parts(case, key, text)
        if name in found:
            allowed = "one for each output; [decision] takes several"
            raise case.refuse(key, f"{name} has two limits", allowed)
        found[name] = limit_in(case, key, name, limit)
    return found


def limit_in(case: Case, key: str, name: str, text: str) -> float:
    """Limit in the SI unit of its output; a drift also as a share of the height.

    Args:
        case: The case.
        key: The key that gives it, for the message.
        name: The output.
        text: The limit with its unit.

    Raises:
        BadInput: It is no positive quantity of that unit.
    """
    from alphacut.frame.structures.quantities import Output

    unit, height = Output(name).unit, storey_height(case, name)
    try:
        share = height is not None and text.rstrip().endswith("%")
        limit = (
            height * quantity.number(text, "") if share and height else quantity.number(text, unit)
        )
    except ValueError as error:
        kind = f"a quantity in {unit}, as the output is" + (
            ", or a share of the storey's height such as 0.5 %" if height else ""
        )
        if height is None and name.startswith("drift") and text.rstrip().endswith("%"):
            kind += "; a share of the storey's height needs frame.lengths"
        raise case.refuse(key, str(error), kind) from None
    if not limit > 0:
        raise case.refuse(key, "out of range", "greater than 0")
    return limit


def storey_height(case: Case, output: str) -> float | None:
    """The height in m of the storey whose drift an output is; None for any other output."""
    kind, floor = output.rstrip("0123456789"), output.lstrip("abcdefghijklmnopqrstuvwxyz_")
    if kind != "drift":
        return None
    lengths = (case.sections.frame.lengths or ()) if case.sections.frame else ()
    index = 0 if len(lengths) == 1 else int(floor or 1) - 1
    return lengths[index].modal if 0 <= index < len(lengths) else None


class AskedTolerance(NamedTuple):
    """Tolerance of envelopes in SI or as a share, and the unit: ``m``, ``shares of the peaks``."""

    value: float
    unit: str


def asked_tolerance(case: Case) -> AskedTolerance | None:
    """Tolerance of envelopes that a case names; None where a default stands in."""
    named: list[tuple[str, float | None, str]] = [
        ("envelope.relative_tolerance", case.envelope.relative_tolerance, "shares of the peaks"),
        ("envelope.tolerance", case.envelope.tolerance, "m"),
    ]
    if case.sections.pendulum:
        named.append(("pendulum.tolerance", case.pendulum.tolerance, "N"))
    for key, value, unit in named:
        if value is not None and case.asked(key):
            return AskedTolerance(value, unit)
    return None


def observed(case: Case) -> tuple[str, ...]:
    """Outputs of the case's structure."""
    if case.sections.frame is None:
        return next((OUTPUTS[name] for name in structures(case)), ())
    every = tuple(f"q{floor + 1}" for floor in range(len(case.frame.masses)))
    return case.frame.outputs or every


def unknown(key: str, names: Iterable[str], known: Sequence[str]) -> Iterator[Problem]:
    """Outputs that the structure does not have, or is not asked for."""
    for name in names:
        if name not in known:
            what = f"{name} is not among the structure's outputs"
            yield Problem(key, what, name, ", ".join(known), nearest(name, known))


def decision(case: Case) -> Iterator[Problem]:
    """Limits are on outputs of a storey frame that vibrates."""
    if case.sections.envelope is None or "envelope" not in case.stages:
        yield Problem("decision", "limits are judged over stage envelope", "", "that stage")
    if case.sections.frame is None:
        yield Problem("decision", "limits are judged for a storey frame", "", "[frame]")
        return
    try:
        known, key = frame_outputs(len(case.frame.masses)), "decision.limits"
        limits = list(dict.fromkeys(limit_parts(case, key, x)[0] for x in case.decision.limits))
        strangers = list(unknown(key, limits, known))
        yield from strangers
        if not strangers:
            limits_of(case)  # of a storey that is not there nothing can be said
        for name in limits if case.frame.accelerogram else ():
            if name.startswith("ar"):
                what = f"{name} is relative to the ground, and decisions are on absolute values"
                yield Problem("decision.limits", what, name, f"a{name[2:]}, or [exceedance]")
    except BadInput as error:
        yield from error.problems


def exceedance(case: Case) -> Iterator[Problem]:
    """Limits are for outputs of the structure in vibration, and in their units."""
    given = case.exceedance
    if case.sections.envelope is None:
        yield Problem("exceedance", "a probability needs the section [envelope]")
    alone = {"output": given.output, "limit": given.limit}
    for name, value in alone.items():
        if given.limits and value:
            what, allowed = "there are limits besides", "output and limit, or limits"
            yield Problem(f"exceedance.{name}", what, value, allowed)
        if not given.limits and not value:
            what = "missing: the output" if name == "output" else "missing: what it must not exceed"
            yield Problem(f"exceedance.{name}", what, allowed=f"a text for {name}; or limits")
    if (given.limits and any(alone.values())) or (not given.limits and not all(alone.values())):
        return
    parts = [text.partition("<=") for text in given.limits]
    names = [name.strip() for name, bound, _ in parts if bound] or [given.output] * (not parts)
    key, known = f"exceedance.{'limits' if given.limits else 'output'}", possible_outputs(case)
    kinds = "q, v, a, ar, drift, shear with a floor, base_shear" if case.sections.frame else ""
    strangers = [
        Problem(key, f"there is no output {x}", x, kinds or ", ".join(known), nearest(x, known))
        for x in (names if known else ())
        if x not in known
    ]
    yield from strangers
    try:
        if not strangers:
            exceeded_limits(case)  # of a storey that is not there nothing can be said
    except BadInput as error:
        yield from error.problems


def possible_outputs(case: Case) -> tuple[str, ...]:
    """Outputs that the case's structure may have; none where there is no structure."""
    if case.sections.frame is not None:
        return tuple(frame_outputs(len(case.frame.masses)))
    return observed(case)


def update(case: Case) -> Iterator[Problem]:
    """Modes are those of a storey frame, and levels begin above 0."""
    alpha, given = case.update.alpha, case.update
    if case.sections.frame is None:
        yield Problem("update", "natural modes are learned from for a storey frame", "", "[frame]")
    elif case.frame.p_delta:
        what = "measured modes are learned from without p_delta"
        yield Problem("update.measured", what, given.measured, "a frame without p_delta")
    if alpha[0] <= 0:
        yield Problem(
            "update.alpha",
            "measured values decide no cut at α = 0",
            str(list(alpha)),
            "levels above 0, as [0.05, 0.5, 1]",
        )


def asked_gap(case: Case) -> float | None:
    """Gap of proved bounds that a case names, in m; None where it names none."""
    return case.envelope.certify if case.asked("envelope.certify") else None


def by_auto(case: Case, key: str) -> str:
    """How method auto is asked for, in place of one that the command line gives or the file."""
    return f"{key}=auto in its place" if key in case.changed else f"--set {key}=auto"


def names_rough_integrator(case: Case) -> bool:
    """Whether the case names a time stepping that is not exact."""
    return case.asked("envelope.integrator") and case.envelope.integrator != "exact"
