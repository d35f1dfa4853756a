"""The structure of a case in words and a table, for the head of the report's part on vibration."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.case.case import Case
from alphacut.case.names import OTHERS
from alphacut.case.schema import SECTIONS
from alphacut.fuzzy import FuzzyNumber, PiecewiseLinear
from alphacut.io.units import MINUS, shown
from alphacut.stages.structure import Structure, per_floor, ratios
from alphacut.stages.structure import columns as count_columns

if TYPE_CHECKING:
    from alphacut.frame.structures.linear import Accelerogram

PLACEMENT = {"ground": "from each floor to the ground", "storey": "between neighbouring floors"}
UNITS = {  # those in which people say the SI units of the schema
    "masses": ("t", "kg"),
    "lengths": ("m", "m"),
    "dampers": ("kN s/m", "N*s/m"),
    "displacements": ("mm", "m"),
    "velocities": ("m/s", "m/s"),
}
COLUMNS = {
    "masses": "mass",
    "lengths": "storey height",
    "dampers": "damper",
    "displacements": "displacement",
    "velocities": "velocity",
}


def in_unit(number: FuzzyNumber, unit: str, si: str) -> str:
    """Fuzzy number as in a case: ``30 t``, ``[28, 30, 34] t``."""
    (low, high), (left, right) = number.support, number.cut(1.0)
    if isinstance(number, PiecewiseLinear) and low < high:
        ends = [
            f"{shown(value, unit, si):.5g}".replace("-", MINUS)
            for value in (low, high, number.modal)
        ]
        return f"{ends[0]} … {ends[1]} {unit}, modal {ends[2]} {unit}".strip()
    values = (
        [low]
        if low == high
        else (
            [low, high]
            if (low, high) == (left, right)
            else list(dict.fromkeys([low, left, right, high]))
        )
    )
    numbers = [f"{shown(value, unit, si):.5g}".replace("-", MINUS) for value in values]
    return f"{numbers[0] if len(numbers) == 1 else '[' + ', '.join(numbers) + ']'} {unit}".strip()


def structure_words(case: Case, wanted: Structure) -> dict[str, Any]:
    """Sentences on the structure, and head and rows of a table of its floors."""
    if wanted.frame is not None:
        return {"sentences": list(frame_sentences(case, wanted)), **floors(case, wanted)}
    ground = None if wanted.linear is None else wanted.linear.ground
    sentences = [motion(case.text("tower.accelerogram"), ground)] if ground is not None else []
    return {
        "sentences": sentences,
        "head": ["input", "what it is", "value"],
        "rows": list(inputs(case)),
    }


def inputs(case: Case) -> Iterator[list[str]]:
    """A row for each number of a pendulum or a tower, as the case writes it."""
    for section in OTHERS:
        for name, key in SECTIONS[section].keys.items():
            if (
                key.kind != "text"
                and name != "tolerance"
                and (written := case.written.get(f"{section}.{name}")) is not None
            ):
                yield [name, key.about.partition(";")[0], str(written).replace("'", "")]


def frame_sentences(case: Case, wanted: Structure) -> Iterator[str]:
    """Stiffness, damping, and what moves the frame."""
    assert wanted.frame is not None
    modulus, moment = wanted.numbers["E"], wanted.numbers["I"]
    counts = set(case.fuzzies("frame.columns"))
    alone = next(iter(counts)) if len(counts) == 1 else None
    crisp = alone is not None and alone.support.width == 0
    number = f"{in_unit(alone, '', '')} in each storey" if alone else "c in a storey"
    formula = f"{12 * alone.modal:g} E I / l³" if alone and crisp else "12 c E I / l³"
    alike = len(case.fuzzies("frame.second_moment")) == 1
    section = f"I = {in_unit(moment, 'm^4', 'm^4')} of one column; " if alike else ""
    rigidity = f"E I = {modulus.modal * moment.modal / 1e6:.4g} MN m² at the modal values" + (
        "" if alike else ", in the ground storey"
    )
    yield (
        f"{len(wanted.frame.masses)} rigid floors on columns clamped at both ends, {number}:"
        f" stiffness {formula}. E = {in_unit(modulus, 'GPa', 'Pa')}, {section}{rigidity}."
    )
    yield f"Damping: {'; '.join(damping(case)) or 'none'}."
    if wanted.frame.ground is not None:
        yield motion(case.text("frame.accelerogram"), wanted.frame.ground)
    elif moves(case):
        yield "The frame starts from the displacements and velocities of the table."


def damping(case: Case) -> Iterator[str]:
    """Everything that damps a frame."""
    yield from spread_damping(case)
    if any(number.support.upper > 0 for number in case.fuzzies("frame.dampers")):
        yield f"dashpots {PLACEMENT[case.text('frame.damper_placement')]}"


def spread_damping(case: Case) -> Iterator[str]:
    """The damping that no dashpot stands for."""
    if any(number.support.upper > 0 for number in ratios(case)):
        each = "of every mode" if len(ratios(case)) == 1 else "of the modes, by rising frequency"
        yield (
            f"{', '.join(in_unit(ratio, '%', '') for ratio in ratios(case))} of the critical"
            f" damping {each}"
        )
    a, b = (case.fuzzy(f"frame.rayleigh_{name}") for name in ("mass", "stiffness"))
    if a.support.upper or b.support.upper:
        yield f"a M + b K with a = {in_unit(a, '1/s', '1/s')} and b = {in_unit(b, 'ms', 's')}"


def motion(file: str, ground: Accelerogram) -> str:
    """The record in words."""
    peak, end = (
        float(np.abs(ground.acceleration).max()),
        (len(ground.acceleration) - 1) * ground.step,
    )
    return (
        f"The ground moves by the record {file}: {len(ground.acceleration)} values, one every"
        f" {ground.step:g} s up to {end:g} s, peak {peak:.3g} m/s²; displacements are relative to"
        " the ground."
    )


def moves(case: Case) -> list[str]:
    """Names of displacements and velocities that are not zero at the start."""
    kinds = ("displacements", "velocities")
    return [
        kind
        for kind in kinds
        if any(
            number.support.upper or number.support.lower for number in case.fuzzies(f"frame.{kind}")
        )
    ]


def floors(case: Case, wanted: Structure) -> dict[str, Any]:
    """Row for each floor, from the ground up: mass, height and what is not zero."""
    damped = any(number.support.upper > 0 for number in case.fuzzies("frame.dampers"))
    kinds: Sequence[str] = ["masses", "lengths", *(["dampers"] if damped else []), *moves(case)]
    columns = [
        [in_unit(number, *UNITS[kind]) for number in per_floor(case, f"frame.{kind}")]
        for kind in kinds
    ]
    head = ["floor", *(COLUMNS[kind] for kind in kinds)]
    for name, entries in (
        ("columns c", case.fuzzies("frame.columns")),
        ("second moment", case.fuzzies("frame.second_moment")),
    ):
        if len(entries) > 1:
            unit = "m^4" if name == "second moment" else ""
            told = [in_unit(x, unit, unit) for x in entries]
            head, columns = [*head, name], [*columns, told]
    head, columns = [*head, "stiffness"], [*columns, stiffnesses(case, wanted)]
    return {
        "head": head,
        "rows": [
            [str(floor), *row] for floor, row in enumerate(zip(*columns, strict=True), start=1)
        ],
    }


def stiffnesses(case: Case, wanted: Structure) -> list[str]:
    """Stiffness of each storey at the modal values, 12 c E I / l³, in MN/m."""
    rigidity = wanted.numbers["E"].modal * wanted.numbers["I"].modal
    lengths = [length.modal for length in per_floor(case, "frame.lengths")]
    return [
        f"{12e-6 * c.modal * rigidity / length**3:.4g} MN/m"
        for c, length in zip(count_columns(case), lengths, strict=True)
    ]
