"""Section on forces: their course over time, and their amplitudes by floor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Annotated, Self

import numpy as np
from pydantic import Field, ValidationInfo, model_validator

from alphacut.case.structure import Structure
from alphacut.case.types import Section, case_file, text
from alphacut.frame import Force, History, MatrixStructure, StoreyFrame
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError, chosen, require
from alphacut.io import quantity
from alphacut.records.force_history import read_force_history

KINDS = ("step", "harmonic", "impulse")
HISTORY = (
    '"step", "harmonic, 1.5 Hz, 90 deg", "impulse" or a file as "wind.csv", then "from 2 s" or'
    ' "static"'
)


@dataclass(frozen=True)
class ForceCourse:
    """Course of a force, and what its amplitudes are.

    Args:
        history: The course; None of an impulse.
        unit: SI unit of amplitudes; empty of a factor.
        size: Size of an amplitude of 1 in SI: of a file with a unit its largest magnitude.
    """

    history: History | None
    unit: str = "N"
    size: float = 1.0


def _course(value: object, info: ValidationInfo) -> ForceCourse:
    """The course of a text such as "harmonic, 1.5 Hz, from 2 s"."""
    kind, *words = (word.strip() for word in str(value).split(","))
    static = [word for word in words if word == "static"]
    starts = [word.removeprefix("from ") for word in words if word.startswith("from ")]
    numbers = [word for word in words if word not in static and not word.startswith("from ")]
    wanted = (1, 2) if kind == "harmonic" else (0,)
    fits = len(numbers) in wanted and len(static) + len(starts) <= (kind != "impulse")
    require(fits and not (static and kind == "harmonic"), "", value=value, allowed=HISTORY)
    try:
        start = quantity.number(starts[0], "s") if starts else 0.0
        if kind == "harmonic":
            phase = quantity.number(numbers[1], "rad") if numbers[1:] else 0.0
            wave = History.harmonic(quantity.number(numbers[0], "1/s"), phase, start)
            return ForceCourse(wave)
    except ValueError as error:
        raise RefusedError("", value, HISTORY, str(error)) from None
    if kind == "impulse":
        return ForceCourse(None, "N*s")
    if kind == "step":
        return ForceCourse(History.constant(start, is_static=bool(static)))
    return _of_file(kind, start, bool(static), info)


def _of_file(name: str, start: float, is_static: bool, info: ValidationInfo) -> ForceCourse:
    try:
        path = case_file(name, info)
    except RefusedError as error:
        raise RefusedError("", name, f"{HISTORY}; {error.allowed}") from None
    series = read_force_history(path)
    size = float(np.abs(series.samples).max()) if series.has_unit else 1.0
    history = History(series.step, np.asarray(series.samples / size), start, is_static=is_static)
    return ForceCourse(history, "" if series.has_unit else "N", size)


def _amplitude(value: object, _: ValidationInfo) -> tuple[FuzzyNumber, str]:
    """Number in SI, and its SI unit."""
    for unit in ("N", "N*s", ""):
        try:
            return quantity.fuzzy(value, unit), unit
        except ValueError:
            continue
    allowed = 'a force, an impulse or a number, as "8 kN ± 10 %", "0.3 kN s", "1 ± 10 %"'
    raise RefusedError("", value, allowed)


Amplitude = Annotated[tuple[FuzzyNumber, str], text(_amplitude)]


class ForceSection(Section):
    """Forces with one course over time; the amplitude on floor 3 is parameter F3.

    A second force on a floor is F3_2, an impulse J3. Of a structure from matrices forces act on
    unknowns, and their parameters are F1, F2 … in their order.
    """

    history: Annotated[ForceCourse, text(_course)] = Field(
        description="step, harmonic with frequency and phase, impulse, or a file; then its start"
    )
    amplitude: dict[str, Amplitude] = Field(
        description='amplitude by floor or unknown, as {3 = "8 kN"}; factor of a file with a unit'
    )

    @property
    def amplitudes(self) -> dict[str, FuzzyNumber]:
        """Amplitude on each floor, in SI."""
        size = self.history.size
        return {unknown: _scaled(number, size) for unknown, (number, _) in self.amplitude.items()}

    @model_validator(mode="after")
    def _complete(self) -> Self:
        """Refuses amplitudes of another unit."""
        require(bool(self.amplitude), "force.amplitude", value=None, allowed="one floor or more")
        quantity_name, example = quantity.QUANTITIES[self.history.unit]
        for unknown, (_, unit) in self.amplitude.items():
            fits, shown = unit == self.history.unit, unit or "a number"
            key = f"force.amplitude.{unknown}"
            require(fits, key, value=shown, allowed=f'{quantity_name}, as "{example}"')
        return self


def _scaled(number: FuzzyNumber, factor: float) -> FuzzyNumber:
    """A number of crisp corners times a positive factor."""
    corners = (getattr(number, field.name) for field in fields(number))  # type: ignore[arg-type]
    return type(number)(*(factor * corner for corner in corners))


def with_forces(
    structure: Structure, sections: Sequence[ForceSection], unknowns: Sequence[str]
) -> Structure:
    """The structure with the forces of a case; `unknowns` are the names of those of matrices.

    Raises:
        RefusedError: It takes no forces, or has no such floor.
    """
    if not sections:
        return structure
    model = structure.linear
    if model is None:
        raise RefusedError("force", "on a pendulum", "beside [frame] or [matrices]")
    pairs = [
        (unknown, number, section.history.history)
        for section in sections
        for unknown, number in section.amplitudes.items()
    ]
    if isinstance(model, StoreyFrame):
        moved: StoreyFrame | MatrixStructure = _on_floors(model, pairs)
        names = moved.force_names  # type: ignore[union-attr]
    else:
        names = tuple(f"F{number}" for number in range(1, len(pairs) + 1))
        moved = _on_unknowns(model, pairs, names, unknowns)
    numbers = {name: number for name, (_, number, _) in zip(names, pairs, strict=True)}
    return replace(structure, model=moved, numbers={**structure.numbers, **numbers})


Placed = Sequence[tuple[str, FuzzyNumber, History | None]]


def _on_floors(model: StoreyFrame, pairs: Placed) -> StoreyFrame:
    floors = {str(floor): floor for floor in range(1, model.floors + 1)}
    for unknown, _, _ in pairs:
        chosen("force.amplitude", unknown, floors)
    loads = [Force(floors[unknown], number.modal, course) for unknown, number, course in pairs]
    return replace(model, loads=loads)


def _on_unknowns(
    model: MatrixStructure, pairs: Placed, names: Sequence[str], unknowns: Sequence[str]
) -> MatrixStructure:
    for unknown, _, _ in pairs:
        chosen("force.amplitude", unknown, tuple(unknowns))
    rows: list[Array] = [
        np.array([float(x == unknown) for x in unknowns]) for unknown, _, _ in pairs
    ]
    loads = [Force(row, name, x[2]) for row, name, x in zip(rows, names, pairs, strict=True)]
    modal: Mapping[str, float] = {name: x[1].modal for name, x in zip(names, pairs, strict=True)}
    return replace(model, loads=loads, parameters={**model.parameters, **modal})
