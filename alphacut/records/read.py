"""Recordings from files as they are downloaded; the format is that of the content."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from alphacut.fuzzy.refused import RefusedError
from alphacut.records.cosmos import is_cosmos, read_cosmos
from alphacut.records.csv_record import read_csv_record
from alphacut.records.esm import is_esm, read_esm
from alphacut.records.knet import is_knet, read_knet
from alphacut.records.peer import is_peer, read_peer
from alphacut.records.recording import Recording
from alphacut.records.text_file import TextFile
from alphacut.records.uff import ENDINGS, read_uff_record

FORMATS: tuple[tuple[Callable[[TextFile], bool], Callable[[TextFile], Recording]], ...] = (
    (is_knet, read_knet),
    (is_esm, read_esm),
    (is_peer, read_peer),
)
"""Formats of one channel: what tells a file of it, and its reader."""


def read_recording(path: Path, channel: str = "") -> Recording:
    """Reads a recording from a file of PEER, K-NET, ESM or COSMOS, a universal or a CSV file.

    Args:
        path: The file.
        channel: Channel of a COSMOS or universal file with several.

    Raises:
        RefusedError: The file cannot be read, is of another format, or its head and its samples
            do not fit; the message names the line.
    """
    try:
        return _read_by_format(path, channel)
    except RefusedError:
        raise
    except (ValueError, OverflowError) as error:  # of a head's integer of thousands of digits
        raise RefusedError(path.name, str(error), "numbers of a recording") from None


def _read_by_format(path: Path, channel: str) -> Recording:
    """Reads a recording by the format that a file's ending or content shows."""
    if path.suffix.lower() in ENDINGS:
        return read_uff_record(path, channel)
    file = TextFile.read(path)
    if is_cosmos(file):
        return read_cosmos(file, channel)
    for is_format, read in FORMATS:
        if is_format(file):
            return read(file)
    if path.suffix.lower() == ".at2":
        return read_peer(file)  # refuses, and says what a head has
    return read_csv_record(file)
