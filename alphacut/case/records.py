"""Section on a suite of records: files, correction, trimming and scaling."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, ValidationInfo, model_validator

from alphacut.case.types import NotEmpty, OneOrMany, Section, text
from alphacut.fuzzy.refused import RefusedError, require
from alphacut.io import quantity
from alphacut.records.read import read_recording
from alphacut.records.recording import Baseline, Recording, Trim

MAX_RECORDS = 500
ENDING = re.compile(r"[^A-Za-z0-9_+-]+")


@dataclass(frozen=True)
class Scale:
    """Scale of every record: a factor, or the value in m/s² of the measure "PGA" or "Sa(T1)"."""

    value: float = 1.0
    measure: str = ""


@dataclass(frozen=True, eq=False)
class NamedRecording:
    """A recording by the name of its file without ending, which no other has."""

    name: str
    recording: Recording


def _read_files(value: object, info: ValidationInfo) -> tuple[NamedRecording, ...]:
    """Recordings of all files below the case's folder that "records/*.AT2" or "a.v2#1" matches."""
    folder: Path = (info.context or {}).get("folder", Path())
    # the text after # is the channel of each file
    pattern, _, channel = str(value).partition("#")
    allowed = f"files or patterns such as records/*.AT2, from the folder {folder.absolute()}"
    is_relative = isinstance(value, str) and not pattern.startswith("/") and pattern.strip() != ""
    require(is_relative, "", value=value, allowed=allowed)
    paths = sorted(path for path in folder.glob(pattern) if path.is_file())
    allowed = f"{allowed}; 1 to {MAX_RECORDS} files"
    require(0 < len(paths) <= MAX_RECORDS, "", value=value, allowed=allowed)
    names = [ENDING.sub("_", path.stem) + (f"_{channel}" if channel else "") for path in paths]
    recordings = [read_recording(path, channel) for path in paths]
    return tuple(NamedRecording(*pair) for pair in zip(names, recordings, strict=True))


def _parse_scale(value: object, _: ValidationInfo) -> Scale:
    """Parse a scale such as 1.2 or "PGA = 0.3 g"."""
    allowed = 'a factor above 0 as 1.2, or "PGA = 0.3 g", or "Sa(T1) = 0.5 g"'
    measure, equals, size = (part.strip() for part in str(value).partition("="))
    try:
        if not equals:
            scale = Scale(quantity.number(value, ""))
        else:
            scale = Scale(quantity.number(size, "m/s^2"), measure)
    except ValueError as error:
        raise RefusedError("", value, allowed, str(error)) from None
    fits = scale.value > 0 and scale.measure in ("", "PGA", "Sa(T1)")
    require(fits, "", value=value, allowed=allowed)
    return scale


def _parse_trim(value: object, _: ValidationInfo) -> Trim:
    """Parse the part of a record to keep: "arias", or times such as ["2 s", "30 s"], as floats."""
    allowed = '"arias" for 5 to 95 % of the Arias intensity, or two times as ["2 s", "30 s"]'
    if value == "arias":
        return "arias"
    try:
        first, last = (quantity.number(x, "s") for x in value)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise RefusedError("", value, allowed) from None
    require(0 <= first < last, "", value=value, allowed=allowed)
    return first, last


Files = Annotated[tuple[NamedRecording, ...], text(_read_files)]


class RecordsSection(Section):
    """Suite of records of the ground's acceleration: each moves the structure by itself.

    Each record is corrected, then trimmed, then scaled. A motion lasts as long as its record and
    five natural periods, and at most envelope.duration.
    """

    files: Annotated[tuple[Files, ...], OneOrMany, NotEmpty] = Field(
        description="files or patterns, as `records/*.AT2`; FILE#CHANNEL of several"
    )
    baseline: Baseline = Field(default="none", description="mean or straight line to subtract")
    trim: Annotated[Trim, text(_parse_trim)] | None = Field(
        default=None, description='times to keep, as ["2 s", "30 s"], or "arias"'
    )
    scale: Annotated[Scale, text(_parse_scale)] = Field(
        default=Scale(), description='factor, "PGA = 0.3 g" or "Sa(T1) = 0.5 g"'
    )

    @property
    def recordings(self) -> tuple[NamedRecording, ...]:
        """The recordings of all files."""
        return tuple(named for group in self.files for named in group)

    @model_validator(mode="after")
    def _check_names(self) -> Self:
        """Refuses two files of the same name, which is that of their results."""
        names = [named.name for named in self.recordings]
        repeated = ", ".join(sorted({name for name in names if names.count(name) > 1}))
        allowed = "each file once, by its name"
        require(not repeated, "records.files", value=repeated, allowed=allowed)
        return self
