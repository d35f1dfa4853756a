"""A format of records to copy: a line of words, step and count, and samples in g.

    ACME RECORDER  step .01 s  400 samples
    0.0012 0.0034 …

Add the `RecordFormat` to `FORMATS` in `frame/records/networks.py`, or register it as an entry point
``acme = "MODULE:ACME"`` of your own distribution in the group "alphacut.records".
`alphacut.frame.records.check` has the check that it must pass.
"""

from __future__ import annotations

import re

import numpy as np

from alphacut.frame.records.recording import Recording
from alphacut.frame.records.text_file import RecordFormat, TextFile, recording_in_si, require_step

MARK = re.compile(r"ACME RECORDER\s+step\s+([0-9.eE+-]+) s\s+([0-9]+) samples\s*$")


def read_acme(file: TextFile, unit: str) -> Recording:
    """Return the recording in a file of this format, whose unit is g.

    Raises:
        RefusedError: The head is another one, a sample is no number, or there are more or fewer
            than the head says.
    """
    head = MARK.match(file.lines[0])
    if head is None:
        raise file.refusal(0, file.lines[0], "ACME RECORDER step .01 s 400 samples", "mend it")
    step = float(head[1])
    require_step(file.location(0), step, "the step is in seconds")
    samples: list[float] = []
    for number, line in enumerate(file.lines[1:], start=1):
        try:
            samples += map(float, line.split())
        except ValueError:
            raise file.refusal(number, line, "numbers", "mend the line") from None
    if len(samples) != int(head[2]):
        value = f"{head[2]} samples, and {len(samples)} follow"
        raise file.refusal(0, value, "as many as follow", "load the file anew")
    return recording_in_si(file.location(0), "Acme", "g", step, np.array(samples))


ACME = RecordFormat("Acme", MARK, 1, read_acme)
