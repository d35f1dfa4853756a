"""The structure of a case in words and a table, for the head of the report's part on vibration."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from alphacut.case.case import Case
from alphacut.case.names import OTHERS
from alphacut.case.sections.structures import Frame
from alphacut.frame.calculus.jet import Jet
from alphacut.frame.structures.field_frame import FieldFrame
from alphacut.frame.structures.linear import Accelerogram
from alphacut.frame.structures.storey_springs import softening, springs
from alphacut.fuzzy import Crisp, FuzzyNumber, PiecewiseLinear
from alphacut.fuzzy.sets.stepwise import Stepwise
from alphacut.io.files import Document
from alphacut.io.units import MINUS, shown
from alphacut.stages.vibration.structure import Structure, per_floor
from alphacut.stages.vibration.studies import cut_line, fixed_line, left_out, studies

if TYPE_CHECKING:
    from alphacut.fuzzy.field import FuzzyField

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


SYMBOLS = dict(zip(UNITS, ("m{}", "l{}", "d{}", "q{}_0", "v{}_0"), strict=True))


def in_unit(number: FuzzyNumber, unit: str, si: str) -> str:
    """Fuzzy number as in a case: ``30 t``, ``[28, 30, 34] t``."""
    support, core = number.support, number.cut(1.0)
    low, high, left, right = (
        f"{shown(value, unit, si):.5g}".replace("-", MINUS) for value in (*support, *core)
    )
    if support == core:
        return f"{low if support.width == 0 else f'[{low}, {high}]'} {unit}".strip()
    if isinstance(number, PiecewiseLinear | Stepwise):
        top = f"core {left} … {right}" if core.width else f"modal {left}"
        return f"{low} … {high} {unit}, {top} {unit}".replace(" ,", ",").strip()
    middle = f"{left}, {right}" if core.width else left
    return f"[{low}, {middle}, {high}] {unit}".strip()


def structure_words(case: Case, wanted: Structure) -> Document:
    """Sentences on the structure, and head and rows of a table of its floors."""
    tasks = [study.task for study in studies(case)]
    fixed = left_out(wanted, tasks)
    told = [f"F{line[1:]}." for line in fixed_line(fixed)]
    words = {"fixed": fixed, "cut": cut_line(wanted, tasks)}
    if wanted.frame is not None:
        sentences = [*frame_sentences(case.frame, wanted), *told]
        return {"sentences": sentences, **floors(case.frame, wanted, fixed), **words}
    ground = None if wanted.linear is None else wanted.linear.ground
    sentences = [motion(case.tower.accelerogram, ground)] if ground is not None else []
    return {
        "sentences": [*sentences, *told],
        "head": ["input", "what it is", "value"],
        "rows": list(inputs(case)),
        **words,
    }


def inputs(case: Case) -> Iterator[list[str]]:
    """A row for each number of a pendulum or a tower, as the case writes it."""
    for section in OTHERS:
        for name, key, written in case.told(section):
            if key.kind != "text" and name != "tolerance":
                yield [name, key.about.partition(";")[0], str(written).replace("'", "")]


def frame_sentences(given: Frame, wanted: Structure) -> Iterator[str]:
    """Stiffness, damping, and what moves the frame."""
    assert wanted.frame is not None
    yield stiffness_words(given, wanted)
    if wanted.frame.gravity:
        taken = max(soft / k for k, soft in zip(*springs_at_modal(wanted), strict=True))
        yield (
            "P-Delta: the weight P of the floors above reduces the stiffness of each storey by P"
            f" over its height, at the modal values by up to {100 * taken:.2g} %."
        )
    if isinstance(wanted.frame, FieldFrame):
        yield field_words(wanted.frame.field)
    yield f"Damping: {'; '.join(damping(given)) or 'none'}."
    if wanted.frame.ground is not None:
        yield motion(str(given.accelerogram), wanted.frame.ground)
    elif moves(given):
        yield "The frame starts from the displacements and velocities of the table."


def stiffness_words(given: Frame, wanted: Structure) -> str:
    """Where the stiffness of the storeys comes from."""
    count = len(given.masses)
    floors_of = f"{count} rigid floor{'s' if count > 1 else ''}"
    if given.stiffness is not None:
        return f"{floors_of} on storeys whose stiffness is given."
    counts = set(given.columns)
    alone = next(iter(counts)) if len(counts) == 1 else None
    crisp = alone is not None and alone.support.width == 0
    number = f"{in_unit(alone, '', '')} in each storey" if alone else "c in a storey"
    formula = f"{12 * alone.modal:g} E I / l³" if alone and crisp else "12 c E I / l³"
    modulus, moment = wanted.numbers["E"], (given.second_moment or ())[0]
    alike = len(given.second_moment or ()) == 1
    section = f"I = {in_unit(moment, 'm^4', 'm^4')} of one column; " if alike else ""
    rigidity = f"E I = {modulus.modal * moment.modal / 1e6:.4g} MN m² at the modal values" + (
        "" if alike else ", in the ground storey"
    )
    return (
        f"{floors_of} on columns clamped at both ends, {number}:"
        f" stiffness {formula}. E = {in_unit(modulus, 'GPa', 'Pa')}, {section}{rigidity}."
    )


def springs_at_modal(wanted: Structure) -> tuple[list[float], list[float]]:
    """Stiffness of each storey at the modal values, and what weights take of it, in N/m."""
    frame = wanted.frame
    assert frame is not None
    at = {name: Jet.constant([low], 0) for name, (low, _) in frame.ranges({}).items()}
    soft = [float(x.value[0]) for x in softening(frame, at)] if frame.gravity else []
    return [float(k.value[0]) for k in springs(frame, at)], soft or [0.0] * frame.floors


def field_words(field: FuzzyField) -> str:
    """A field of columns or masses in words."""
    what, unit = FIELDS[field.name]
    low, high = field.centre - field.half_width, field.centre + field.half_width
    return (
        f"The {what} of the storeys are alike but not equal, each in [{low:.5g}, {high:.5g}]{unit},"
        f" correlated over {field.length:g} m: {', '.join(field.names)} move them together, and"
        f" neighbours differ by {field.apart:.3g}{unit} at most."
    )


FIELDS = {"c": ("columns", ""), "k": ("stiffnesses", " N/m"), "m": ("masses", " kg")}


def damping(given: Frame) -> Iterator[str]:
    """Everything that damps a frame."""
    yield from spread_damping(given)
    if given.damped:
        yield f"dashpots {PLACEMENT[str(given.damper_placement)]}"


def spread_damping(given: Frame) -> Iterator[str]:
    """The damping that no dashpot stands for."""
    ratios = given.damping_ratio or ()
    if any(number.support.upper > 0 for number in ratios):
        each = "of every mode" if len(ratios) == 1 else "of the modes, by rising frequency"
        yield (
            f"{', '.join(in_unit(ratio, '%', '') for ratio in ratios)} of the critical"
            f" damping {each}"
        )
    a, b = given.rayleigh_mass, given.rayleigh_stiffness
    if a.support.upper or b.support.upper:
        yield f"a M + b K with a = {in_unit(a, '1/s', '1/s')} and b = {in_unit(b, 'ms', 's')}"


def motion(file: str, ground: Accelerogram) -> str:
    """The record in words."""
    peak, end = float(np.abs(values := ground.acceleration).max()), (len(values) - 1) * ground.step
    return (
        f"The ground moves by the record {file}: {len(ground.acceleration)} values, one every"
        f" {ground.step:g} s up to {end:g} s, peak {peak:.3g} m/s²; displacements are relative to"
        " the ground."
    )


def moves(given: Frame) -> list[str]:
    """Names of displacements and velocities that are not zero at the start."""
    starts = {"displacements": given.displacements, "velocities": given.velocities}
    return [
        kind
        for kind, numbers in starts.items()
        if any(number.support.upper or number.support.lower for number in numbers)
    ]


def floors(given: Frame, wanted: Structure, fixed: Sequence[str]) -> Document:
    """Row for each floor, from the ground up: mass, height and what is not zero."""
    kinds: Sequence[str] = [
        "masses",
        *(["lengths"] if given.lengths else []),
        *(["dampers"] if given.damped else []),
        *moves(given),
    ]
    columns = [
        column(per_floor(given, getattr(given, kind)), SYMBOLS[kind], UNITS[kind], fixed)
        for kind in kinds
    ]
    head = ["floor", *(COLUMNS[kind] for kind in kinds)]
    for name, unit, symbol, entries in (
        ("columns c", "", "c{}", given.columns),
        ("second moment", "m^4", "I{}", given.second_moment or ()),
    ):
        if len(entries) > 1:
            told = column(entries, symbol, (unit, unit), fixed)
            head, columns = [*head, name], [*columns, told]
    head, columns = [*head, "stiffness"], [*columns, stiffnesses(given, wanted, fixed)]
    if wanted.frame is not None and wanted.frame.gravity:
        taken = [
            f"{-soft / 1e6:.4g} MN/m".replace("-", MINUS) for soft in springs_at_modal(wanted)[1]
        ]
        head, columns = [*head, "P-Delta"], [*columns, taken]
    return {
        "head": head,
        "rows": [
            [str(floor), *row] for floor, row in enumerate(zip(*columns, strict=True), start=1)
        ],
    }


def column(
    numbers: Sequence[FuzzyNumber], symbol: str, units: tuple[str, str], fixed: Sequence[str]
) -> list[str]:
    """Values of all floors, each that does not vary with the value at which it is fixed."""
    return [
        in_unit(number, *units)
        + f", fixed at {in_unit(Crisp(number.modal), *units)}" * (symbol.format(floor) in fixed)
        for floor, number in enumerate(numbers, start=1)
    ]


def stiffnesses(given: Frame, wanted: Structure, fixed: Sequence[str]) -> list[str]:
    """Stiffness of each storey in MN/m, as given or 12 c E I / l³ at the modal values."""
    if given.stiffness is not None:
        return column(per_floor(given, given.stiffness), "k{}", ("MN/m", "N/m"), fixed)
    return [f"{k / 1e6:.4g} MN/m" for k in springs_at_modal(wanted)[0]]
