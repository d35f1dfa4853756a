"""Records of the ground's acceleration from files: one, and a suite of them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from glob import glob
from pathlib import Path
from typing import get_args

from alphacut.base.errors import RefusedError, checked_number, path_of, require, require_choice
from alphacut.base.stated import require_overrides
from alphacut.base.units import ACCELERATION, factor_of
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.records.recording import Baseline, Recording
from alphacut.frame.records.text_file import ACCELERATION_UNITS, require_stated_step

# Files of a suite: fragility analyses use 20 to 100 records, and more than 500 files are a mistake
# in the pattern.
MAX_RECORDS = 500


def read_record(
    path: str | Path,
    *,
    channel: str = "",
    step: float | None = None,
    unit: str = "",
    baseline: Baseline = "none",
    override: Sequence[str] = (),
) -> Accelerogram:
    """Read a record of the ground's acceleration from a file as networks publish them.

    Read are PEER AT2, COSMOS, CSMIP, GeoNet V2A, SMC, K-NET, ESM, miniSEED, SAC, UFF 58 and tables
    (CSV); the marks in a file say which it is.

    Args:
        path: The file.
        channel: Number, orientation or code of the channel, as "1", "90 deg" or "HNE", in a file
            of several.
        step: Time between samples, in s, of a file that does not state it.
        unit: Unit of a file that states none, as "g", "gal" or "cm/s^2".
        baseline: What is subtracted from the samples: "none", their "mean", or their straight line
            of least squares ("linear").
        override: "unit" or "step", where the file states a wrong one and that given here counts.

    Returns:
        Samples in m/s². `name` is the file's without ending; `remarks` are clauses on what is
        unusual, or was taken for granted.

    Raises:
        RefusedError: An argument is of another type or is unknown; or the file cannot be read, is
            of another format, states another unit or step than is given here, or does not fit its
            own head: the message names the line.

    Example:
        >>> ground = read_record("cases/suite/record-2001.AT2")
        >>> ground.name, len(ground.samples), ground.step
        ('record-2001', 501, 0.02)
    """
    _require_arguments(channel, step, unit=unit, baseline=baseline, override=override)
    (recording,) = read_recordings(
        [path_of("path", path)], channel=channel, step=step, unit=unit, override=override
    )
    return recording.accelerogram(baseline)


def read_suite(
    files: str | Path | Sequence[str | Path],
    *,
    channel: str = "",
    step: float | None = None,
    unit: str = "",
    baseline: Baseline = "none",
    override: Sequence[str] = (),
) -> tuple[Accelerogram, ...]:
    """Read a suite of ground motion records from all files that some patterns match.

    Args:
        files: A file, or a pattern of names such as ``records/*.AT2``, or a sequence of them. A
            name that is a file is never taken as a pattern.
        channel: Number, orientation or code of the channel of every file, as "1", "90 deg" or
            "HNE"; empty where each has only one.
        step: Time between samples, in s, of files that do not state it.
        unit: Unit of files that state none, as "g", "gal" or "cm/s^2".
        baseline: What is subtracted from each record: "none", its "mean", or its straight line of
            least squares ("linear").
        override: "unit" or "step", where files state a wrong one and that given here counts.

    Returns:
        One record for each file, with samples in m/s²: in the order of `files`, and those of one
        pattern sorted by their paths. A pattern that matches nothing adds none.

    Raises:
        RefusedError: An argument is of another type or is unknown; there is no file, or there are
            more than 500, or two have the same name; or files cannot be read, are of other formats,
            or do not fit their own heads, of which all are named at once.

    Example:
        >>> suite = read_suite("cases/suite/*.AT2", baseline="mean")
        >>> len(suite), suite[0].name
        (11, 'record-2001')
    """
    _require_arguments(channel, step, unit=unit, baseline=baseline, override=override)
    paths: list[Path] = []
    patterns: Sequence[object] = [files]
    if isinstance(files, Sequence) and not isinstance(files, str):
        patterns = files
    for pattern in patterns:
        path = path_of("files", pattern)
        is_file = False
        with suppress(OSError):  # of a name that is too long
            is_file = path.is_file()
        if is_file:
            paths.append(path)
        else:
            paths += [Path(name) for name in sorted(glob(str(pattern)))]
    recordings = read_recordings(
        paths, channel=channel, step=step, unit=unit, override=override, shown=files
    )
    require_distinct("files", [recording.name for recording in recordings])
    return tuple(recording.accelerogram(baseline) for recording in recordings)


def read_recordings(
    paths: Sequence[Path],
    *,
    channel: str = "",
    step: float | None = None,
    unit: str = "",
    override: Sequence[str] = (),
    shown: object = None,
) -> tuple[Recording, ...]:
    """Read one channel of each file, in the order of the files.

    Args:
        paths: The files.
        channel: Number, orientation or code of the channel of every file, as "1", "90 deg" or
            "HNE"; empty where each has only one.
        step: Time between samples, in s, of files that do not state it.
        unit: Unit of files that state none, as "g".
        override: "unit" or "step", where files state a wrong one and that given here counts.
        shown: The files as the caller gave them, for the message that there is none.

    Returns:
        Recordings with samples in m/s². The name of each is that of its file without ending, and of
        the channel if one was named, joined by "_"; other characters than letters, digits, "_", "+"
        and "-" become "_".

    Raises:
        RefusedError: There is no file, or there are more than 500; or some cannot be read: the
            message has the reason of the first, and the names of all others.
    """
    from alphacut.frame.records.read import read_recording  # with all formats, in .02 s

    is_suite = 0 < len(paths) <= MAX_RECORDS
    require(is_suite, "files", shown, allowed=f"1 to {MAX_RECORDS} files, and {len(paths)} match")
    recordings: list[Recording] = []
    errors: list[RefusedError] = []
    for path in paths:
        try:
            recording = read_recording(path, channel, step, unit, override)
        except RefusedError as error:
            errors.append(error)
            continue
        # Names of results are those of files and variables as well, and have their alphabet.
        name = path.stem
        if channel:
            name += f"_{channel}"
        name = re.sub(r"[^A-Za-z0-9_+-]+", "_", name)
        recordings.append(replace(recording, name=name))
    if len(errors) == 1:
        raise errors[0]
    if errors:  # the others are named in the cure, which is never cut off
        first, *others = errors
        names = ", ".join(error.key.partition(",")[0] for error in others)
        cure = "; ".join(filter(None, (f"bad as well: {names}", first.cure)))
        raise RefusedError(first.key, first.value, first.allowed, cure)
    return tuple(recordings)


def require_distinct(key: str, names: Sequence[str]) -> None:
    """Raise RefusedError if two records have the same name, which is that of their results."""
    repeated = ", ".join(sorted(name for name, count in Counter(names).items() if count > 1))
    require(not repeated, key, repeated, allowed="each file once, by its name")


def _require_arguments(
    channel: str, step: float | None, *, unit: str, baseline: str, override: Sequence[str]
) -> None:
    """Check the arguments that all readers of records have.

    Raises:
        RefusedError: `channel` is no text; `step` is neither None nor from 4e-5 s to below 0.5 s;
            `unit` is neither empty nor a unit of acceleration; `baseline` is not "none", "mean" or
            "linear"; or `override` has other words than "unit" and "step".
    """
    require(isinstance(channel, str), "channel", repr(channel), 'a name in quotes, as "2"')
    if step is not None:
        checked_number("step", step, positive=True)
        require_stated_step("step", step)
    is_known = isinstance(unit, str) and (not unit or factor_of(unit, ACCELERATION) > 0)
    require(is_known, "unit", repr(unit), allowed=f"a unit of {ACCELERATION_UNITS}")
    require_choice("baseline", baseline, get_args(Baseline))
    require_overrides(override, ("unit", "step"))
