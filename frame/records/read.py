"""Recordings from files as they are downloaded; what a file is, its own marks decide first."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import numpy as np

from alphacut.base.entry_points import registered
from alphacut.base.errors import RefusedError, require
from alphacut.base.extras import extra_named
from alphacut.base.stated import Stated, settled
from alphacut.base.units import ACCELERATION, factor_of
from alphacut.frame.records.cosmos import is_cosmos, read_cosmos
from alphacut.frame.records.geonet import is_geonet, read_geonet
from alphacut.frame.records.networks import FORMATS
from alphacut.frame.records.recording import Recording
from alphacut.frame.records.stated_peak import StatedPeak
from alphacut.frame.records.tables import is_table, read_table
from alphacut.frame.records.text_file import (
    RecordFormat,
    TextFile,
    choose_channel,
    read_bytes,
    recording_in_si,
)
from alphacut.frame.records.uff import is_universal, read_uff_record


def read_recording(
    path: Path,
    channel: str = "",
    step: float | None = None,
    unit: str = "",
    override: Collection[str] = (),
) -> Recording:
    """Read a recording of the ground's acceleration, or one channel of several, from a file.

    Formats are PEER AT2, COSMOS, CSMIP, GeoNet V2A, SMC, K-NET, ESM, miniSEED, SAC, UFF 58 and CSV.
    The content says which it is, and not the name of the file.

    Args:
        path: The file.
        channel: Name of the channel; empty where there is only one.
        step: Time between samples in s, for files that do not state it.
        unit: Unit of the samples, as "g", for files that state none.
        override: "step" or "unit", where the file states a wrong one: that of the user is taken.

    Returns:
        The recording: two or more finite samples in m/s², its step in s, and what the file says of
        it. Its `name` is empty.

    Raises:
        RefusedError: The file cannot be read, is of another format, has no such channel, or its
            head and its samples do not fit; the message names the line.
    """
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # of damaged numbers, which are refused
            recording = _read_by_marks(path, channel, step, unit=unit, override=override)
            recording = _agreed(path.name, recording, step, unit, override=override)
    except RefusedError:
        raise
    except (ValueError, OverflowError) as error:  # of a head's integer of thousands of digits
        raise RefusedError(path.name, str(error), "numbers of a recording") from None
    samples = recording.samples
    allowed = "two finite samples or more"
    fits = len(samples) > 1 and bool(np.isfinite(samples).all())
    require(fits, path.name, f"a record of {len(samples)} samples", allowed)
    return recording


def _agreed(
    name: str, recording: Recording, step: float | None, unit: str, *, override: Collection[str]
) -> Recording:
    """Return a recording with step and unit of which file and user agree, or the user overrides.

    Args:
        name: Name of the file, for the message.
        recording: The recording, in the step and the unit of the file.
        step: Step that the user says, in s; None if nothing.
        unit: Unit that the user says; empty if nothing.
        override: Keys of which the user says that the file is wrong.

    Raises:
        RefusedError: They disagree.
    """
    own = Stated(recording.step, f"{recording.step:.6g} s")
    said = Stated(step, f"{step:.6g} s") if step is not None else None
    taken_step = settled(name, "step", [own], said, override=override) or own
    own = Stated(factor_of(recording.unit, ACCELERATION) or 1.0, recording.unit)
    said = Stated(factor_of(unit, ACCELERATION) or 1.0, unit) if unit else None
    taken_unit = settled(name, "unit", [own], said, override=override) or own
    remarks = tuple(filter(None, (taken_step.remark, taken_unit.remark)))
    return replace(
        recording,
        step=taken_step.value,
        unit=taken_unit.text,
        samples=recording.samples * (taken_unit.value / own.value),
        remarks=recording.remarks + remarks,
    )


def _read_by_marks(
    path: Path, channel: str, step: float | None, *, unit: str, override: Collection[str]
) -> Recording:
    """Read a recording from a file of the format whose marks its content has.

    Marks that are sure go first: those of universal files (UFF) and of miniSEED and SAC, which are
    binary, then those of text formats, and at last a table of numbers, which has no mark.

    Args:
        path: The file.
        channel: Name of the channel; empty where there is only one. Formats with one channel a file
            (PEER, K-NET, ESM, SMC) ignore it.
        step: Time between samples in s, for a table without times; None if the user states none.
            Other formats ignore it.
        unit: Unit of the samples, for files that state none; empty if the user states none.
        override: "step" or "unit", where the user says that the file is wrong.

    Returns:
        The recording, with samples in m/s². They may be too few or not finite.

    Raises:
        RefusedError: The file cannot be read, is empty or of another format, has no such channel,
            or its head and its samples do not fit.
        ValueError, OverflowError: A whole number in a head has thousands of digits.
    """
    content = read_bytes(path)
    require(bool(content.strip()), path.name, "empty", "a file with a record", "load it anew")
    if is_universal(content):
        return read_uff_record(path.name, content, channel, unit)
    if file_format := _waveform_format(content):
        return _read_waveform(path.name, content, file_format, channel=channel, unit=unit)
    file = TextFile.from_bytes(path.name, content)
    if is_geonet(file):
        return read_geonet(file, channel)
    if is_cosmos(file):
        return read_cosmos(file, channel, unit)
    for known in FORMATS:
        if known.has_marked(file):
            return known.read(file, unit)
    # A table has no mark, and numbers in a head of another format may look like one.
    for place in registered("alphacut.records").values():
        further: RecordFormat = resolve_name(place)
        if further.has_marked(file):
            return further.read(file, unit)
    if is_table(file):
        return read_table(file, step, unit, channel, override)
    others = "COSMOS, CSMIP, GeoNet V2A, miniSEED, SAC, UFF 58, CSV"
    allowed = ", ".join([*(known.name for known in FORMATS), others])
    raise RefusedError(path.name, "of no format that is read", allowed)


def _waveform_format(content: bytes) -> str:
    """Return "SAC" or "MSEED" if a content is of the format that ObsPy calls so, or else "".

    A content of at most 632 bytes, which is the size of the head of SAC, is not taken for SAC.
    """
    # The head of SAC has 158 words of 4 bytes, in either order of bytes. It has no mark: word 76 is
    # the version of the head, 6 or 7, and word 79 the count of samples, each of 4 bytes. Words are
    # counted from 0. That samples of this count follow makes a chance hit unlikely.
    head_bytes = 632
    if len(content) > head_bytes:
        for order in ("<i4", ">i4"):
            words = np.frombuffer(content[:head_bytes], order)
            version = int(words[76])
            count = int(words[79])
            if version in (6, 7) and 0 < 4 * count <= len(content) - head_bytes:
                return "SAC"
    # miniSEED 2 begins with six digits, which number the record, and its quality D, R, Q or M;
    # miniSEED 3 begins with MS and the byte 3.
    if re.match(rb"[0-9 ]{6}[DRQM][ \0]|MS\x03", content):
        return "MSEED"
    return ""


def _read_waveform(
    name: str, content: bytes, file_format: str, *, channel: str, unit: str
) -> Recording:
    """Return the recording in a file of miniSEED or SAC, which have no unit.

    Args:
        name: Name of the file, for messages.
        content: The file.
        file_format: ObsPy's name of the format.
        channel: Name of the channel; empty where there is only one.
        unit: Unit that the user states.

    Raises:
        RefusedError: ObsPy is not installed or cannot read the file, there is no such channel or it
            has gaps, the unit is missing, or the samples do not fit the peak in the head.
    """
    with extra_named(f"{name}, miniSEED or SAC"):
        import obspy
    try:
        # ObsPy is told the format, since to find one it loads pickles, which are programs. It is
        # handed the content, since of names it unpacks archives and follows patterns.
        traces = list(obspy.read(BytesIO(content), format=file_format))
    except Exception as error:  # readers of damaged files raise errors of many kinds
        reason = " ".join(str(error).split())[:80] or type(error).__name__
        raise RefusedError(name, reason, "miniSEED or SAC that obspy reads") from None
    names = [(str(trace.stats.channel).lower(),) for trace in traces]
    trace = traces[choose_channel(f"{name} without gaps", channel, names)]
    # The head of SAC may say what its samples are: 6 a displacement, 7 a velocity.
    others = {6: "a displacement", 7: "a velocity"}
    quantity = others.get(int(trace.stats.get("sac", {}).get("idep", 0)), "")
    require(not quantity, name, quantity, "an acceleration, IDEP 8")
    require(bool(unit), name, "without a unit", "records.unit, as the network gives it")
    return recording_in_si(
        name,
        file_format,
        unit,
        float(trace.stats.delta),
        np.asarray(trace.data, float),
        str(trace.stats.channel),
        stated=_sac_peak(trace.stats.get("sac", {}), unit),
    )


def _sac_peak(head: Mapping[str, Any], unit: str) -> list[StatedPeak]:
    """Return the peak that the head of a SAC file states in a unit; none of another format."""
    to_si = factor_of(unit, ACCELERATION)
    if not to_si or not {"depmin", "depmax"} <= head.keys():
        return []
    magnitude = max(abs(float(head["depmin"])), abs(float(head["depmax"])))
    return [StatedPeak(to_si * magnitude)]
