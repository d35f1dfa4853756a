"""Records of networks with one channel a file: PEER, K-NET and KiK-net, ESM and ITACA, SMC.

Readers raise RefusedError with the line at which a file is not of its format. Each takes the file
and the unit that the user states, which counts where the head states none.

PEER's files of type AT2 are read with all the heads that were written since 1999. The head names
the unit and, in one of its first lines, the number of samples and their step: ``NPTS= 4000, DT=
.0050 SEC``, with a comma at its end or without SEC, ``4000 .0050 NPTS, DT``, or the step alone.
Behind the samples there may be text, such as ``*** End Data ***``.
"""

from __future__ import annotations

import re
from collections import defaultdict
from dataclasses import replace
from typing import NamedTuple

from alphacut.base.arrays import Array
from alphacut.base.stated import settled
from alphacut.frame.records.recording import Recording
from alphacut.frame.records.stated import TextStatements
from alphacut.frame.records.stated_peak import StatedPeak, peaks_in_text
from alphacut.frame.records.stated_timing import StatedTiming, require_timing
from alphacut.frame.records.text_file import (
    ACCELERATION_UNITS,
    NUMBER,
    RecordFormat,
    TextFile,
    recording_in_si,
    require_step,
)

# The marks of PEER are looked for in so many first lines. Most heads have four; a larger number
# would find the marks in other formats' text.
PEER_LINES = 12


def read_peer(file: TextFile, unit: str) -> Recording:
    """Return the recording in a file of type AT2 of PEER.

    The head names the unit and, in one of its first 12 lines, the count of samples and their step,
    as "NPTS= 4000, DT= .0050 SEC". Samples follow the line with the step, separated by spaces. If
    the count is stated, text behind the samples, as "*** End Data ***", is passed over.

    Args:
        file: The file.
        unit: Unit of acceleration that the user states, or empty. It counts only if the head names
            none, as in "UNITS OF G" or "ACCELERATION TIME HISTORY IN G".

    Returns:
        The recording, with samples in m/s². Its channel is the last word of the second line behind
        a comma, as "090"; empty without one.

    Raises:
        RefusedError: The head does not state the step in s; no unit of acceleration is stated, or
            the head names velocities or displacements; a sample is no finite number, or there are
            more or fewer than stated; the step is not from 4e-5 s to below 0.5 s; or the samples
            have another peak than the head.
    """
    # Heads of 1999 have the names behind the numbers: "4000 .0050 NPTS, DT".
    names_last = r"(?i)^\s*(\d+)[\s,]+([\d.]+(?:[ed][-+]?\d+)?)[\s,]+NPTS\s*,?\s*DT\b"
    head = [re.sub(names_last, r"NPTS= \1, DT= \2", x) for x in file.lines[:PEER_LINES]]
    file = replace(file, lines=(*head, *file.lines[PEER_LINES:]))
    named = [k for k, text in enumerate(head) if re.search(r"(?i)\b(?:DT|NPTS)\b", text)]
    timed = [k for k in named if re.search(r"(?i)\bDT\s*=?\s*[\d.]", head[k])]
    line = (timed or named or [min(3, len(file.lines) - 1)])[0]
    found = TextStatements.of(file, range(line + 1))
    place = f"line {file.line_number(line)}"
    steps = [stated.value for stated in found.steps if stated.place == place]
    counts = [int(stated.value) for stated in found.counts if stated.place == place]
    is_counted = bool(counts and counts[0] > 0) or "NPTS" not in file.lines[line].upper()
    if not steps or not is_counted or re.search(r"\d,\d", file.lines[line]):
        allowed = "a head with UNITS OF G and NPTS= 4000, DT= .0050 SEC, and as many numbers below"
        cure = "write the count and the step in s, with a decimal point: NPTS= 4000, DT= .0050 SEC"
        raise file.refusal(line, file.lines[line].strip(), allowed, cure)
    step = steps[0]
    cure = "DT is in seconds: write 20 ms as DT= .0200 SEC"
    require_step(file.location(line), step, cure)
    if found.quantities and not found.units:
        what, row = found.quantities[0]
        allowed = f"accelerations in {ACCELERATION_UNITS}"
        cure = f"this is {what}: take the file .AT2 of the acceleration"
        raise file.refusal(row, file.lines[row].strip(), allowed, cure)
    place = file.location(line)
    own_unit = settled(place, "unit", found.units)
    text = (own_unit.text if own_unit else unit).strip("()[] ")
    if own_unit:
        place = f"{file.name}, {own_unit.place}"
    count = sum(counts[:1])
    samples = file.numbers(line + 1, len(file.lines), count=count)
    if count:
        file.require_count(samples, count, line)
    component = ""
    pattern = r".*,\s*([\w-]+)\s*(?:\(.*\))?\s*"
    if line > 1 and (title := re.fullmatch(pattern, file.lines[1])):
        component = title[1]
    return recording_in_si(
        place,
        "PEER AT2",
        text,
        step,
        samples,
        component,
        stated=peaks_in_text(file.lines[: line + 1], text),
    )


def read_knet(file: TextFile, unit: str) -> Recording:
    """Return the recording in a K-NET or KiK-net file: 17 lines of head, then counts of the sensor.

    A line of the head has a label of 18 characters and a value. The last one is "Memo.". One count
    is the scale factor, as "7845(gal)/8223790". The counts keep the sensor's offset, so that such a
    record wants ``baseline = "mean"``.

    Args:
        file: The file.
        unit: Not used, since the format states gal (cm/s²).

    Returns:
        The recording, with samples in m/s². Its channel is the text of the field "Dir.", as "N-S".

    Raises:
        RefusedError: The line Memo. is missing; the sampling frequency, the duration or the scale
            factor is missing or is not above 0; a count is no number, or their number is not the
            duration times the frequency; the step is not from 4e-5 s to below 0.5 s; or the samples
            have another peak than the head.
    """
    memo_lines = [k for k, line in enumerate(file.lines) if line.startswith("Memo")]
    if not memo_lines:
        cure = "load the file anew"
        line = len(file.lines) - 1
        raise file.refusal(line, "without a line Memo.", "the head of a K-NET file", cure)
    end = memo_lines[0]
    label_width = 18
    head = {x[:label_width].strip(): (k, x[label_width:]) for k, x in enumerate(file.lines[:end])}
    real = r"([0-9]+\.?[0-9]*|\.[0-9]+)"
    [rate] = _knet_numbers(file, head, end, "Sampling Freq(Hz)", rf"{real}\s*Hz", "100Hz")
    [duration] = _knet_numbers(file, head, end, "Duration Time(s)", real, "300")
    scale = rf"{real}\s*\(gal\)\s*/\s*{real}"
    example = "7845(gal)/8223790"
    gal, full_scale = _knet_numbers(file, head, end, "Scale Factor", scale, example)
    counts = file.numbers(end + 1, len(file.lines))
    file.require_count(counts, round(duration * rate), head["Duration Time(s)"][0])
    _, channel = head.get("Dir.", (0, ""))
    return recording_in_si(
        file.location(end),
        "K-NET",
        "gal",
        1 / rate,
        counts * (gal / full_scale),
        channel.strip(),
        stated=peaks_in_text(file.lines[:end], "gal"),
    )


def _knet_numbers(
    file: TextFile,
    head: dict[str, tuple[int, str]],
    end: int,
    name: str,
    pattern: str,
    example: str,
) -> list[float]:
    """Return the numbers above 0 of a field in the head of a K-NET file.

    Args:
        file: The file.
        head: Index of the line, counted from 0, and text of each field by its name.
        end: Index of the line at which the head ends, for the message.
        name: Name of the field.
        pattern: Regular expression of its text, with a group for each decimal number.
        example: A text that it may have, for the message.

    Raises:
        RefusedError: The field is missing or has another text, or a number is not above 0.
    """
    line, text = head.get(name, (end, ""))
    match = re.fullmatch(pattern, text.strip(), re.IGNORECASE)
    numbers = [float(number) for number in match.groups()] if match else []
    if not numbers or min(numbers) <= 0:
        value = text.strip() or f"without {name}"
        allowed = f"{name}, as in files of K-NET"
        raise file.refusal(line, value, allowed, f"load the file anew, or write as {example}")
    return numbers


class _EsmField(NamedTuple):
    """Value of a key in the head of a file of ESM, and its line, counted from 0."""

    text: str
    line: int


def read_esm(file: TextFile, unit: str) -> Recording:
    """Return the recording in a file of ESM or ITACA: lines ``KEY: value``, then one sample a line.

    SAMPLING_INTERVAL_S, the step in s, and NDATA, the count of samples, must be there. UNITS,
    DATA_TYPE (an acceleration if it is missing), STREAM (the channel), DURATION_S and PGA_CM/S^2
    (the peak) may be missing.

    Args:
        file: The file.
        unit: Unit of acceleration that the user states. It counts only if the key UNITS is missing.

    Returns:
        The recording, with samples in m/s².

    Raises:
        RefusedError: The step or the count is missing or not above 0; the data are no
            accelerations, or no unit is stated; a sample is no finite number, or there are more or
            fewer than stated; the step is not from 4e-5 s to below 0.5 s; or the samples have
            another duration or peak than the head states.
    """
    head = defaultdict[str, _EsmField](lambda: _EsmField("", 0))
    for row, line in enumerate(file.lines):
        pattern = r"([A-Z][A-Z0-9_/.^]*(?: [A-Z0-9_/.]+)*)\s*:\s*(.*)"
        if match := re.fullmatch(pattern, line.strip()):
            head[match[1]] = _EsmField(match[2].strip(), row)
        elif NUMBER.fullmatch(line.strip()):
            break
    numbers = []
    # An empty text matches no number, so a missing key is refused like a wrong one.
    for key, example in (("SAMPLING_INTERVAL_S", "0.005"), ("NDATA", "4000")):
        text, row = head[key]
        if not NUMBER.fullmatch(text) or float(text) <= 0:
            cure = f"load the file anew, or write {key}: {example}"
            raise file.refusal(row, f"{key}: {text}", "a number above 0", cure)
        numbers.append(float(text))
    step, count = numbers
    kind = head["DATA_TYPE"]
    if kind.text and "ACCELERATION" not in kind.text.upper():
        cure = "take the file of the acceleration"
        allowed = f"accelerations in {ACCELERATION_UNITS}"
        raise file.refusal(kind.line, kind.text, allowed, cure)
    # Comments without a colon may stand among the keys: samples begin behind the last key.
    samples = file.numbers(1 + max(field.line for field in head.values()), len(file.lines))
    file.require_count(samples, int(count), head["NDATA"].line)
    step_line = head["SAMPLING_INTERVAL_S"].line
    duration = head["DURATION_S"]
    if NUMBER.fullmatch(duration.text):
        stated = [StatedTiming(duration.line, "duration", float(duration.text))]
        require_timing(file, step_line, stated, count=int(count), step=step)
    own_unit = head["UNITS"] if "UNITS" in head else _EsmField(unit, step_line)
    peak = f"PGA: {head['PGA_CM/S^2'].text} cm/s^2"
    return recording_in_si(
        file.location(own_unit.line),
        "ESM",
        own_unit.text,
        step,
        samples,
        head["STREAM"].text,
        stated=peaks_in_text([peak], "cm/s^2"),
    )


def read_smc(file: TextFile, unit: str) -> Recording:
    """Return the recording in an SMC file of the USGS, which states accelerations in cm/s².

    The head has 11 lines of text, 6 lines of 48 integers in columns of 10 characters, and 10 lines
    of 50 reals in columns of 15 characters. Behind it stand as many lines of comments as the head
    says, and then the samples, 8 in a line of columns of 10 characters. Integer 13 is the angle of
    the sensor from the vertical in degrees, 16 counts the comments and 17 the samples; real 2 is
    the count of samples in a second; reals 30 and 32 are the extremes. All
    are counted from 1.

    Args:
        file: The file, whose first line is not empty.
        unit: Not used.

    Returns:
        The recording, with samples in m/s². Its channel is "vertical" or empty.

    Raises:
        RefusedError: The first line does not begin with 1 or 2, the numbers of accelerograms; the
            head has more or fewer lines or numbers; it counts fewer than two samples, or a rate
            that is not above 0; samples are missing or are no numbers;
            the step is not from 4e-5 s to below 0.5 s; or the samples have another peak than the
            head.
    """
    if file.lines[0].split()[0] not in ("1", "2"):
        allowed = "1 UNCORRECTED or 2 CORRECTED ACCELEROGRAM"
        raise file.refusal(0, file.lines[0].strip(), allowed, "take the file of the acceleration")
    integers_line = 11
    reals_line = 17
    comments_line = 27
    layout = "11 lines of text, 6 of integers and 10 of reals, as in SMC"
    integers = file.head_numbers(integers_line, 6, width=10, layout=layout)
    reals = file.head_numbers(reals_line, 10, width=15, layout=layout)
    if len(integers) != 48 or len(reals) != 50:
        value = f"{len(integers)} integers and {len(reals)} reals"
        raise file.refusal(integers_line, value, "48 and 50, as in SMC", "load the file anew")
    # The places below are counted from 0, those of the format's description from 1.
    is_vertical = integers[12] in (0, 180)
    n_comments = max(int(integers[15]), 0)  # the format's number for none is -32768
    count = int(integers[16])
    rate = float(reals[1])
    if not (count > 1 and rate > 0):
        value = f"{count} samples, {rate:g} in a second"
        raise file.refusal(reals_line, value, "two or more, at a rate above 0")
    samples = file.fixed_columns(
        comments_line + n_comments,
        count=count,
        per_line=8,
        width=10,
        head=integers_line,
    )
    stated = list(peaks_in_text(file.lines[:integers_line], "cm/s^2"))
    stated += _smc_peaks(reals)
    return recording_in_si(
        file.location(reals_line),
        "SMC",
        "cm/s^2",
        1 / rate,
        samples,
        "vertical" if is_vertical else "",
        stated=stated,
    )


def _smc_peaks(reals: Array) -> list[StatedPeak]:
    """Return the peak in the 50 reals of an SMC file's head, in m/s²; none if it states none."""
    # Places counted from 0: the largest and the smallest sample in cm/s². The format's number for
    # none is 1.7e38.
    stated = [abs(float(reals[place])) for place in (29, 31) if abs(reals[place]) < 1e38]
    return [StatedPeak(0.01 * max(stated))] if stated else []


# The formats are tried in this order. PEER's is the last, since its words are the most common ones;
# its heads are long only with NPTS or DT in them, or with the name of the database.
FORMATS = (
    RecordFormat("K-NET", re.compile("Origin Time"), 1, read_knet),
    RecordFormat(
        "SMC",
        re.compile(
            r"\s*[1-6]\s+(?:(?:(?:UN)?CORRECTED ACCELEROGRAM|VELOCITY|DISPLACEMENT)\s*$"
            r"|(?:RESPONSE|FOURIER)\b.*\bSPECTR)"
        ),
        1,
        read_smc,
    ),
    RecordFormat("ESM", re.compile("SAMPLING_INTERVAL_S"), 80, read_esm),
    RecordFormat(
        "PEER AT2",
        re.compile(
            r".*(?:\bNPTS\b.*\bDT\b|\bPEER\b.*\b(?:DATABASE|RECORD)\b)",
            re.IGNORECASE,
        ),
        PEER_LINES,
        read_peer,
    ),
)
"""Formats with one channel a file; a further one is a line here, or an entry point in the group
"alphacut.records". `demos/templates/record_format.py` is one to copy."""
