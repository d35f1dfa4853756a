"""A common check of record formats, which every format with one channel a file passes."""

from __future__ import annotations

import numpy as np

from alphacut.base.errors import RefusedError, require
from alphacut.frame.records.networks import FORMATS
from alphacut.frame.records.text_file import RecordFormat, TextFile


def check_record_format(one: RecordFormat, content: str) -> None:
    """Refuse a format that does not keep what reading asks of every format.

    A file of it is found by its mark and by no earlier one. It gives two finite samples or more,
    and a positive step. A file that is cut off, or has a word among its numbers, is refused.

    Args:
        one: The format.
        content: A whole file of this format, whose last line holds samples alone.

    Raises:
        RefusedError: Naming what the format does not do.
    """
    file = TextFile.from_bytes("sample", content.encode())
    require(one.has_marked(file), "mark", one.mark.pattern, "the beginning of a line of the file")
    for other in FORMATS[: FORMATS.index(one) if one in FORMATS else None]:
        taken = other.has_marked(file)
        require(not taken, "mark", f"also {other.mark.pattern}", "a mark that no other format has")
    found = one.read(file, "g")
    is_record = len(found.samples) > 1 and bool(np.isfinite(found.samples).all())
    require(is_record, "samples", found.samples, "two finite numbers or more")
    require(found.step > 0, "step", found.step, "a time in s above 0")
    body, _, last = content.rstrip().rpartition("\n")
    damages = {"cut off": body, "a word": f"{body}\n{last[: len(last) // 2]}x"}
    for what, text in damages.items():
        damaged = TextFile.from_bytes("sample", f"{text}\n".encode())
        try:
            one.read(damaged, "g")
        except RefusedError:
            continue
        raise RefusedError("read", f"takes a file with {what}", "RefusedError, naming the line")
