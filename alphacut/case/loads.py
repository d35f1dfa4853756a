"""Sections on what moves a structure: forces over time, and a suite of records."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import inf, isfinite, radians
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, cast

from pydantic import Field, ValidationInfo

from alphacut.base.errors import RefusedError, by_keys, is_number, require, require_choice
from alphacut.base.units import ACCELERATION, factor_of
from alphacut.case.generated import section_at
from alphacut.case.structure import Structure
from alphacut.case.types import (
    FirstUse,
    NotEmpty,
    OneOrMany,
    Section,
    Time,
    after,
    case_file,
    require_alone,
    text,
)
from alphacut.frame import History, StoreyFrame
from alphacut.frame.records.components import require_one_ground
from alphacut.frame.records.recording import Baseline, Recording
from alphacut.frame.records.suite import MAX_RECORDS, read_recordings, require_distinct
from alphacut.frame.records.text_file import ACCELERATION_UNITS, require_stated_step
from alphacut.frame.structures.model import PlacedForce
from alphacut.fuzzy import FuzzyNumber
from alphacut.io import quantity


class ForceHistory(NamedTuple):
    """Time history of a force (None: impulse), and SI unit of its amplitudes, empty of factors.

    The `frequency` in Hz stands there if it is fuzzy; the history has its nominal value.
    """

    history: History | None
    unit: str = "N"
    frequency: FuzzyNumber | None = None


def _parse_history(value: object, info: ValidationInfo) -> ForceHistory:
    """Return the time history that a text such as "harmonic, 1.5 Hz, 90 deg, from 2 s" states.

    The words are separated by commas. The first is "step", "harmonic", "impulse" or the name of a
    file. A harmonic force has a frequency, which may be fuzzy, and may have a phase. All but the
    impulse may have "from TIME", the start; a step or a file may have "static" instead, by which
    the structure starts at rest under the force.

    Args:
        value: The text.
        info: Its context, whose folder the file stands in.

    Returns:
        ForceHistory: The history, None of an impulse; and the SI unit of the amplitudes: "N*s" of
        an impulse, "" if a file with a unit of force has the forces themselves, else "N".

    Raises:
        RefusedError: The text has another form, or the file is missing or holds no history.
    """
    allowed = (
        '"step", "harmonic, 1.5 Hz, 90 deg", "impulse" or a file as "wind.csv", then "from 2 s" or'
        ' "static"'
    )
    # The commas within the brackets of a fuzzy frequency separate no words.
    kind, *words = [word.strip() for word in re.split(r",(?![^\[]*\])", str(value))]
    options = [word for word in words if word == "static" or word.startswith("from ")]
    numbers = [word for word in words if word not in options]
    is_static = options == ["static"]
    # A static force has acted for ever, at its first value. A harmonic one has no such value.
    counts = (1, 2) if kind == "harmonic" else (0,)
    fits = len(numbers) in counts and len(options) <= (kind != "impulse")
    require(fits and not (is_static and numbers), "", value, allowed)
    if kind == "impulse":
        return ForceHistory(None, "N*s")
    try:
        start = 0.0
        if options and not is_static:
            start = quantity.parse_number(options[0].removeprefix("from "), "s")
        if kind == "harmonic":
            frequency = quantity.parse_fuzzy(numbers[0], "Hz")
            if frequency.support.lower <= 0:
                raise ValueError("frequencies are above 0 Hz")
            phase = quantity.parse_number(numbers[1], "rad") if numbers[1:] else 0.0
            history = History.harmonic(frequency.nominal, phase, start)
            is_fuzzy = frequency.support.width > 0
            return ForceHistory(history, frequency=frequency if is_fuzzy else None)
        if kind == "step":
            return ForceHistory(History.constant(start, is_static=is_static))
    except ValueError as error:
        raise RefusedError("", value, allowed, str(error)) from None
    # Any other first word is the name of a file. A misspelt kind is one as well, so that the
    # message of a missing file names the kinds.
    try:
        path = case_file(kind, info)
    except RefusedError as error:
        raise RefusedError("", kind, f"{allowed}; {error.allowed}") from None
    from alphacut.frame.records.tables import read_force_history  # takes time to import

    force = read_force_history(path)
    history = History(force.step, force.samples, start, is_static=is_static)
    # A file with a unit has forces, and amplitudes are factors of them; one without has numbers,
    # and amplitudes are forces.
    return ForceHistory(history, "" if force.has_unit else "N")


def _parse_amplitude(value: object, _: ValidationInfo) -> tuple[FuzzyNumber, str]:
    """Parse an amplitude: its value in SI, and its SI unit ("N", "N*s" or "" of a factor)."""
    try:
        return quantity.parse_fuzzy_in_any_unit(value, ("N", "N*s", ""))
    except ValueError as error:
        allowed = 'a force, an impulse or a number, as "8 kN ± 10 %", "0.3 kN s", "1 ± 10 %"'
        raise RefusedError("", value, allowed, str(error)) from None


Amplitude = Annotated[tuple[FuzzyNumber, str], text(_parse_amplitude)]


class ForceSection(Section):
    """Forces with one history over time; the amplitude on floor 3 is parameter F3.

    A second force on a floor is F3_2, an impulse J3. Of a structure from matrices forces act on
    unknowns, and their parameters are F1, F2 … in their order.

    Args:
        history: step, harmonic with frequency and phase, impulse, or a file; then its start; the
            frequency of the only force on a frame may be fuzzy, as harmonic, [8, 12] Hz: it is the
            input `frequency` of each study, times count in periods, and peaks alone are given.
        amplitude: amplitude by floor or unknown, as {3 = "8 kN"}; factor of a file with a unit.
    """

    history: Annotated[ForceHistory, text(_parse_history)]
    amplitude: dict[str, Amplitude]

    def require_consistent(self) -> None:
        """Refuse a section without amplitudes, and amplitudes in a unit that does not fit.

        The history says which unit amplitudes must have: N, or N s for an impulse. If the file of
        the history states a unit, amplitudes are factors without one.

        Raises:
            RefusedError: With the key of the first amplitude that does not fit.
        """
        require(bool(self.amplitude), "force.amplitude", None, "one floor or more")
        dimension = quantity.QUANTITIES[self.history.unit]
        for unknown, (_, unit) in self.amplitude.items():
            key = f"force.amplitude.{unknown}"
            allowed = f'{dimension.name}, as "{dimension.example}"'
            cure = ""
            if not self.history.unit:
                cure = "the file of the history states the unit: give a factor, as 1.0"
            require(unit == self.history.unit, key, unit or "a number", allowed, cure)


def with_forces(
    structure: Structure, sections: Sequence[ForceSection], places: Sequence[str]
) -> Structure:
    """Return the structure with the forces of a case; their amplitudes become its parameters.

    Args:
        structure: The structure without forces. It is not changed. Without sections it is returned
            itself.
        sections: Each has one time history and, for each degree of freedom on which it acts, an
            amplitude: a fuzzy number and its SI unit.
        places: Names of the degrees of freedom in their order; none if the structure takes no
            forces.

    Raises:
        RefusedError: The structure takes no forces, a force acts on no degree of freedom, or
            several forces or another structure than a frame have a fuzzy frequency.
    """
    if not sections:
        return structure
    require(bool(places), "force", "on a pendulum", "beside [frame] or [matrices]")
    forces: list[PlacedForce] = []
    amplitudes: list[FuzzyNumber] = []
    units: list[str] = []
    for section in sections:
        for place, (amplitude, unit) in section.amplitude.items():
            require_choice("force.amplitude", place, places)
            history = section.history.history
            forces.append(PlacedForce(places.index(place), amplitude.nominal, history))
            amplitudes.append(amplitude)
            units.append(unit)
    # The model returns a name for each amplitude, in the order of the forces. A frame names them by
    # floor: F3, and F3_2 for a second force on floor 3. A structure from matrices has F1, F2 …
    model, names = structure.model.with_forces(forces)
    numbers = {**structure.numbers, **dict(zip(names, amplitudes, strict=True))}
    input_units = {**structure.input_units, **dict(zip(names, units, strict=True))}
    structure = replace(structure, model=model, numbers=numbers, input_units=input_units)
    ranges = [section.history.frequency for section in sections if section.history.frequency]
    if not ranges:
        return structure
    is_possible = isinstance(model, StoreyFrame) and len(sections) == 1
    allowed = "the frequency of the only force on a frame, or one number"
    require(is_possible, "force.history", "of a fuzzy frequency", allowed)
    (frequency,) = ranges
    try:
        model = replace(cast("StoreyFrame", model), frequency=frequency.nominal)
    except RefusedError as error:
        raise RefusedError("force.history", "of a fuzzy frequency", error.allowed) from None
    numbers = {**numbers, "frequency": frequency}
    return replace(structure, model=model, numbers=numbers, always_fuzzy=("frequency",))


SCALED_MEASURES = ("PGA", "Sa(T1)", "RotD50(T1)", "RotD100(T1)")
"""Intensity measures to which records may be scaled; the last two of two components alone."""


@dataclass(frozen=True)
class Scale:
    """Scale of every record.

    Args:
        value: A factor or, with a measure, the value in m/s² that each record is scaled to.
        measure: Intensity measure, as "PGA" or "RotD50(T1)"; empty for a factor.
    """

    value: float = 1.0
    measure: str = ""


def _read_suite(value: object, info: ValidationInfo) -> tuple[tuple[Recording, ...], ...]:
    """Return the components of each record that an entry of `files` states.

    Args:
        value: A text such as "records/*.AT2" or "a.v2#1", whose files are records of one component
            each; or a list of two or three of them, one for each component. Of patterns the first
            file of each makes the first record, and so on.
        info: As of `_read_recordings`.

    Raises:
        RefusedError: A text is no such pattern, a file holds no record, there are not two or three
            components, or their patterns match different numbers of files.
    """
    if not isinstance(value, list):
        return tuple((recording,) for recording in _read_recordings(value, info))
    allowed = 'two or three files, as ["x.AT2", "y.AT2"]: horizontal ones, then the vertical one'
    require(len(value) in (2, 3), "", value, allowed)
    components = [_read_recordings(pattern, info) for pattern in value]
    counts = [len(recordings) for recordings in components]
    what = " and ".join(map(str, counts)) + " files"
    require(len(set(counts)) == 1, "", what, "as many files for each component")
    return tuple(zip(*components, strict=True))


def _read_recordings(value: object, info: ValidationInfo) -> tuple[Recording, ...]:
    """Return the recordings of all files that a text such as "records/*.AT2" or "a.v2#1" matches.

    The part before "#" is a path or pattern relative to the folder of the case; the part after it
    is the channel that is read from each file. Files are read in the order of their names.

    Args:
        value: The text.
        info: Its context: the folder of the case, and the keys `step` (in s) and `unit` for files
            that state neither.

    Returns:
        The recordings; none if `step` or `unit` was refused, since without them the files would
        seem to lack these, and a second message would mislead.

    Raises:
        RefusedError: The pattern is not relative, no file or more than `MAX_RECORDS` files match,
            or a file holds no record.
    """
    if "step" not in info.data or "unit" not in info.data:
        return ()
    folder: Path = (info.context or {}).get("folder", Path())
    pattern, _, channel = str(value).partition("#")
    allowed = f"files or patterns such as records/*.AT2, from the folder {folder.absolute()}"
    is_relative = isinstance(value, str) and not pattern.startswith("/") and pattern.strip() != ""
    require(is_relative, "", value, allowed)
    cure = "name the folders, as records/*/*.AT2: ** would look through all folders below"
    require("**" not in pattern, "", value, allowed, cure)
    # Sorted, so that a suite has the same order, and the same results, on every file system.
    paths = sorted(path for path in folder.glob(pattern) if path.is_file())
    allowed += f"; 1 to {MAX_RECORDS} files"
    require(0 < len(paths) <= MAX_RECORDS, "", value, allowed)
    return read_recordings(
        paths,
        channel=channel,
        step=info.data.get("step"),
        unit=info.data.get("unit") or "",
        override=info.data.get("override", []),
    )


def _step_of_record(step: float) -> float:
    """Return a step of records in s as it is, or refuse one that no record has."""
    require_stated_step("", step)
    return step


def _parse_unit(value: object, _: ValidationInfo) -> str:
    """Return a unit of accelerations as it was given, or refuse it."""
    # The unit is converted with the file, so that messages can show it as it was given.
    require(factor_of(str(value), ACCELERATION) > 0, "", value, f"a unit of {ACCELERATION_UNITS}")
    return str(value)


def _parse_scale(value: object, _: ValidationInfo) -> Scale:
    """Return the scale of all records that a factor such as 1.2 or "PGA = 0.3 g" states.

    Args:
        value: A number, by which records are multiplied; or "PGA = VALUE", and so on with "Sa(T1)",
            "RotD50(T1)" and "RotD100(T1)", the intensity measure to which each record is scaled, an
            acceleration.
        _: Context of the validation, which is not used.

    Returns:
        Scale: The factor with the measure "", or the value in m/s² with its measure.

    Raises:
        RefusedError: The value is not positive, no such quantity, or of another measure.
    """
    allowed = 'a factor above 0 as 1.2, or "PGA = 0.3 g", or "Sa(T1) = 0.5 g"'
    allowed += ', of two components "RotD50(T1) = 0.5 g"'
    measure, equals, size = [part.strip() for part in str(value).partition("=")]
    try:
        if equals:
            number = quantity.parse_number(size, "m/s^2")
        else:
            number = quantity.parse_number(value, "")
            measure = ""
    except ValueError as error:
        raise RefusedError("", value, allowed, str(error)) from None
    is_known = measure in SCALED_MEASURES or not equals
    require(number > 0 and is_known, "", value, allowed)
    return Scale(number, measure)


def _parse_angle(value: object, _: ValidationInfo) -> float:
    """Return an angle in rad, or infinity for all angles, from 30, "30 deg" or "all"."""
    if value == "all":
        return inf
    allowed = '"all", or degrees, as 30'
    if is_number(value):
        angle = radians(float(str(value)))
        require(isfinite(angle), "", value, allowed)
        return angle
    try:
        return quantity.parse_number(value, "rad")
    except ValueError as error:
        raise RefusedError("", value, allowed, str(error)) from None


Files = Annotated[tuple[tuple[Recording, ...], ...], text(_read_suite)]


SPECTRUM = partial(
    section_at, "records.spectrum", "alphacut.frame.spectra.code_spectrum:SuiteTarget"
)
"""The section of the target spectrum."""


class RecordsSection(Section):
    """Suite of records of the ground's acceleration: each moves the structure by itself.

    Each record is corrected, then scaled. A response lasts as long as its record and
    five natural periods, and at most envelope.duration.

    Args:
        step: time between the numbers of a file of one column.
        unit: unit of files that have none: columns without a head, waveforms.
        override: what files state wrongly: that of the case is taken, and said.
        files: files or patterns, as `records/*.AT2`; FILE#CHANNEL of several. A record of two or
            three components is a list, as ["x.AT2", "y.AT2"]: two horizontal ones, then the
            vertical one.
        angle: degrees by which both horizontal components are turned together, from the first one
            of matrices.directions towards the second; "all" bounds peaks over all angles of
            incidence.
        baseline: mean or straight line to subtract.
        scale: factor, "PGA = 0.3 g" or "Sa(T1) = 0.5 g", of every record; Sa(T1) is the
            pseudo-acceleration `ω² max |u|` at the nominal structure's first period, with its own
            damping ratio (not 5 %). Of two components it is the larger one, "RotD50(T1) = 0.5 g"
            the median over all directions, and RotD100(T1) the largest one.
    """

    step: Annotated[Time, after(_step_of_record)] | None = None
    unit: Annotated[str, text(_parse_unit)] | None = None
    override: list[Literal["unit", "step"]] = Field([])
    files: Annotated[OneOrMany[Files], NotEmpty]
    angle: Annotated[float, text(_parse_angle)] = 0.0
    baseline: Baseline = "none"
    scale: Annotated[Scale, text(_parse_scale)] = Scale()
    spectrum: Annotated[Any, FirstUse(SPECTRUM)] | None = None

    @property
    def suite(self) -> tuple[tuple[Recording, ...], ...]:
        """The recordings of all components of each record."""
        return tuple(components for group in self.files for components in group)

    @property
    def component_count(self) -> int:
        """Number of components of each record, from 1 to 3."""
        return len(self.suite[0])

    @property
    def has_all_angles(self) -> bool:
        """Whether peaks are those over all angles of incidence."""
        return self.angle == inf

    def require_consistent(self) -> None:
        """Refuse a scale beside a spectrum, records of one name, and components that do not fit."""
        is_scaled = self.spectrum is not None and self.has_key("scale")
        require_alone("records.scale", is_scaled, "[records.spectrum]")
        names = ["+".join(x.name for x in components) for components in self.suite]
        require_distinct("records.files", names)
        # Results are files record_NAME.json, whose names have 101 characters at most.
        longest = max(names, key=len, default="")
        allowed = "names of all components of 88 characters together, as names of results"
        require(len(longest) <= 88, "records.files", longest, allowed)
        if self.suite:  # empty where a step or a unit was refused
            self._require_components()

    def _require_components(self) -> None:
        """Refuse components that are no motions of one ground, and what needs two components."""
        key = "records.files"
        count = self.component_count
        for components in self.suite:
            what = f"{count} and {len(components)} files a record"
            require(len(components) == count, key, what, "as many components of each record")
            with by_keys(lambda _: key):
                require_one_ground(components)
        allowed = 'beside records of two components, as files = [["x.AT2", "y.AT2"]]'
        require(count > 1 or self.angle == 0, "records.angle", "with one component", allowed)
        is_rotated = self.scale.measure.startswith("RotD")
        require(count > 1 or not is_rotated, "records.scale", self.scale.measure, allowed)
        allowed = 'scale, as "RotD50(T1) = 0.5 g"'
        is_single = count == 1 or self.spectrum is None
        require(is_single, "records.spectrum", "beside records of several components", allowed)
