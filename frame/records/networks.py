"""Records of networks with one channel a file: PEER, K-NET and KiK-net, ESM and ITACA, SMC.

Readers raise RefusedError with the line at which a file is not of its format.

PEER's files of type AT2 are read with all the heads that were written since 1999. The head names
the unit and, in one of its first lines, the number of samples and their step: ``NPTS= 4000, DT=
.0050 SEC``, with a comma at its end or without SEC, ``4000 .0050 NPTS, DT``, or the step alone.
Behind the samples there may be text, such as ``*** End Data ***``.
"""

from __future__ import annotations

import re
from math import ceil

import numpy as np

from alphacut.frame.records.recording import Recording
from alphacut.frame.records.stated_peak import StatedPeak, peaks_in_text
from alphacut.frame.records.text_file import (
    ACCELERATION_UNITS,
    NUMBER,
    TextFile,
    recording_in_si,
    require_step,
)

PEER_HEAD_LINES = 12
"""Lines in which a head ends; most have four."""
REAL = r"([0-9]*\.?[0-9]+(?:[eEdD][-+]?[0-9]+)?)"
PEER_STEP = re.compile(
    rf"(?:NPTS\s*=?\s*([0-9]+)\s*[,;]?\s*)?\bDT\s*=?\s*{REAL}\s*(?:S|SEC|SECONDS?)?\s*[,;.]?\s*",
    re.I,
)
PEER_STEP_WORD = re.compile(r"\b(?:DT|NPTS)\b", re.I)
PEER_STEP_FIRST = re.compile(rf"([0-9]+)[\s,]+{REAL}[\s,]+NPTS\s*,?\s*DT\s*[,;.]?\s*", re.I)
PEER_MARK = re.compile(
    rf".*(?:\bNPTS\b|\bDT\s*=?\s*{REAL}|\bPEER\b.*\b(?:DATABASE|RECORD)\b)", re.I
)
PEER_UNIT = re.compile(r"\bunits\s*(?:of|are|is|=|:)?\s*\(?\s*([^\s,;()]+)", re.I)
PEER_IN_GRAVITY = re.compile(r"\bacceleration\b.*\bin\s+\(?(g(?:'s|s)?)\b", re.I)
PEER_COMPONENT = re.compile(r".*,\s*([\w-]+)\s*(?:\(.*\))?\s*")
PEER_HEAD = "a head with UNITS OF G and NPTS= 4000, DT= .0050 SEC, and as many numbers below it"
SCALE = re.compile(r"\s*([0-9.]+)\s*\(gal\)\s*/\s*([0-9.]+)\s*", re.IGNORECASE)
FREQUENCY = re.compile(r"\s*([0-9.]+)\s*Hz\s*", re.IGNORECASE)
DURATION = re.compile(r"\s*([0-9.]+)\s*")
KNET_FIELDS = {"Sampling Freq(Hz)": FREQUENCY, "Duration Time(s)": DURATION, "Scale Factor": SCALE}
KNET_LABEL = 18
"""Columns of a label in the head."""
ESM_LINE = re.compile(r"([A-Z][A-Z0-9_/.^]*(?: [A-Z0-9_/.]+)*)\s*:\s*(.*)")
INTERVAL, COUNT, KIND = "SAMPLING_INTERVAL_S", "NDATA", "DATA_TYPE"
ESM_PEAK = "PGA_CM/S^2"
SMC = re.compile(r"\s*([1-4])\s+(?:(?:UN)?CORRECTED ACCELEROGRAM|VELOCITY|DISPLACEMENT)\s*$")
SMC_TEXT, SMC_INTEGERS, SMC_REALS = 11, 6, 10
"""Lines of the three heads of an SMC file."""
VERTICAL_ANGLE, COMMENTS, POINTS, RATE = 13, 16, 17, 2
"""Entries of the integer head, from 1, and the one of the real head with samples in a second."""
SMC_EXTREMES, SMC_NULL = (30, 32), 1e38
"""Entries of the real head with the largest and the least sample; numbers above stand for none."""
GAL = 0.01  # in m/s²


def read_peer(file: TextFile, unit: str = "") -> Recording:
    """Return the recording in a file of type AT2; `unit` is for a head that states none."""
    head = enumerate(file.lines[:PEER_HEAD_LINES])
    found = ((k, PEER_STEP_FIRST.search(x) or PEER_STEP.search(x)) for k, x in head)
    row, match = next(((k, match) for k, match in found if match), (0, None))
    head_lines = file.lines[:PEER_HEAD_LINES]
    step_line = next((k for k, x in enumerate(head_lines) if PEER_STEP_WORD.search(x)), row)
    if match is None or re.search(r"\bDT\s*=?\s*\d*,\d", file.lines[step_line], re.I):
        cure = "write the step as a number above 0 with a decimal point: DT= .0050 SEC"
        raise file.refusal(step_line, file.lines[step_line].strip(), PEER_HEAD, cure)
    count, step = int(match[1] or 0), float(re.sub("[dD]", "e", match[2]))
    require_step(file.location(row), step, "DT is in seconds: write 20 ms as DT= .0200 SEC")
    line, own_unit = _peer_unit(file, row)
    unit = own_unit or unit
    if word := re.search(r"\b(velocity|displacement)\b", file.lines[line], re.I):
        allowed = f"accelerations in {ACCELERATION_UNITS}"
        cure = f"this is a {word[1].lower()}: take the file .AT2 of the acceleration"
        raise file.refusal(line, f"in units of {unit}", allowed, cure)
    samples = file.numbers(row + 1, len(file.lines), count=count)
    if count:
        file.require_count(samples, count, row)
    component = PEER_COMPONENT.fullmatch(file.lines[1]) if row > 1 else None
    channel = component[1] if component else ""
    stated = peaks_in_text(file.lines[: row + 1], unit)
    location = file.location(line)
    return recording_in_si(location, "PEER AT2", unit, step, samples, channel, stated=stated)


def _peer_unit(file: TextFile, last: int) -> tuple[int, str]:
    """Line that states the unit, and the unit; empty where no line up to `last` does."""
    for pattern in (PEER_UNIT, PEER_IN_GRAVITY):
        for row, line in enumerate(file.lines[: last + 1]):
            if match := pattern.search(line):
                return row, match[1].rstrip(".")
    return last, ""


def read_knet(file: TextFile, unit: str = "") -> Recording:
    """Recording of a K-NET or KiK-net file: a head of 17 lines, then counts, eight to a line.

    One count is the scale factor ``7845(gal)/8223790``. Counts keep the sensor's offset, so that
    such a record wants ``baseline = "mean"``.
    """
    end = next((k for k, line in enumerate(file.lines) if line.startswith("Memo")), None)
    if end is None:
        raise file.refusal(len(file.lines) - 1, "without a line Memo.", "the head of a K-NET file")
    head = {x[:KNET_LABEL].strip(): (k, x[KNET_LABEL:]) for k, x in enumerate(file.lines[:end])}
    numbers: list[float] = []  # in the order of `KNET_FIELDS`
    for name, pattern in KNET_FIELDS.items():
        line, text = head.get(name, (end, ""))
        match = pattern.fullmatch(text)
        if match is None or any(float(number) <= 0 for number in match.groups()):
            value = text.strip() or f"without {name}"
            raise file.refusal(line, value, f"{name}, as in files of K-NET")
        numbers += map(float, match.groups())
    rate, duration, gal, full_scale = numbers
    counts = file.numbers(end + 1, len(file.lines))
    file.require_count(counts, round(duration * rate), head["Duration Time(s)"][0])
    channel = head.get("Dir.", (0, ""))[1].strip()
    return recording_in_si(
        file.location(end),
        "K-NET",
        "gal",
        1 / rate,
        counts * (gal / full_scale),
        channel,
        stated=peaks_in_text(file.lines[:end], "gal"),
    )


def read_esm(file: TextFile, unit: str = "") -> Recording:
    """Recording of a file of ESM or ITACA: a head of lines ``KEY: value``, then a sample a line."""
    head = dict[str, tuple[str, int]]()  # value and line, from 0, of each key
    for row, line in enumerate(file.lines):
        if match := ESM_LINE.fullmatch(line.strip()):
            head[match[1]] = match[2].strip(), row
        elif NUMBER.fullmatch(line.strip()):
            break
    for key in (INTERVAL, COUNT):
        text, row = head.get(key, ("", 0))
        if not NUMBER.fullmatch(text) or float(text) <= 0:
            raise file.refusal(row, f"{key}: {text}", "a number above 0", "load the file anew")
    kind, kind_row = head.get(KIND, ("ACCELERATION", 0))
    if "ACCELERATION" not in kind.upper():
        raise file.refusal(kind_row, kind, f"accelerations in {ACCELERATION_UNITS}")
    step, count = float(head[INTERVAL][0]), int(float(head[COUNT][0]))
    samples = file.numbers(1 + max(row for _, row in head.values()), len(file.lines))
    file.require_count(samples, count, head[COUNT][1])
    unit, unit_row = head.get("UNITS", (unit, head[INTERVAL][1]))
    channel, _ = head.get("STREAM", ("", 0))
    peak, _ = head.get(ESM_PEAK, ("", 0))
    stated = peaks_in_text([f"PGA: {peak} cm/s^2"], "cm/s^2")
    location = file.location(unit_row)
    return recording_in_si(location, "ESM", unit, step, samples, channel, stated=stated)


def read_smc(file: TextFile, unit: str = "") -> Recording:
    """Recording of an SMC file of the USGS, in cm/s²: three heads, comments, 8 samples a line."""
    match = SMC.match(file.lines[0])
    assert match is not None
    if match[1] not in "12":
        raise file.refusal(0, file.lines[0].strip(), "1 UNCORRECTED or 2 CORRECTED ACCELEROGRAM")
    integers = file.numbers(SMC_TEXT, SMC_TEXT + SMC_INTEGERS, width=10)
    reals_line = SMC_TEXT + SMC_INTEGERS
    reals = file.numbers(reals_line, reals_line + SMC_REALS, width=15)
    if len(integers) < POINTS or len(reals) < RATE:
        value, allowed = f"{len(integers)} integers and {len(reals)} reals", "48 and 50, as in SMC"
        raise file.refusal(SMC_TEXT, value, allowed)
    count, comments = int(integers[POINTS - 1]), max(int(integers[COMMENTS - 1]), 0)
    rate = float(reals[RATE - 1])
    if not (count > 1 and rate > 0):
        value = f"{count} samples, {rate:g} in a second"
        raise file.refusal(reals_line, value, "two or more, at a rate above 0")
    first = reals_line + SMC_REALS + comments
    samples = file.numbers(first, first + ceil(count / 8), width=10)
    file.require_count(samples, count, SMC_TEXT)
    channel = "vertical" if integers[VERTICAL_ANGLE - 1] in (0, 180) else ""
    in_text = [*peaks_in_text(file.lines[:SMC_TEXT], "cm/s^2")]
    extremes = np.abs([reals[k - 1] for k in SMC_EXTREMES if k <= len(reals)])
    largest = float(extremes[extremes < SMC_NULL].max(initial=0.0))
    return recording_in_si(
        file.location(reals_line),
        "SMC",
        "cm/s^2",
        1 / rate,
        samples,
        channel,
        stated=[*in_text, StatedPeak(GAL * largest)],
    )


FORMATS = (
    (re.compile("Origin Time"), 1, read_knet),
    (SMC, 1, read_smc),
    (re.compile(INTERVAL), 80, read_esm),
    (PEER_MARK, PEER_HEAD_LINES, read_peer),
)
"""How a line of a file of each format begins, in how many first lines, and its reader."""
