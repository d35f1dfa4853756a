"""Memory that a campaign needs against what this machine has left."""

from __future__ import annotations

import os
from pathlib import Path

_NUMBER = 8  # bytes
_COPIES = 3  # a plan holds its samples, their sorted copy and the result's
_SMALL = 50_000_000  # bytes not worth a look
_SHARE = 0.9  # of what is free


class TooLargeError(ValueError):
    """A campaign needs more memory than there is."""


def available() -> int:
    """Bytes that this process may still take."""
    free = [_meminfo()]
    try:
        limit = Path("/sys/fs/cgroup/memory.max").read_text().strip()
        used = int(Path("/sys/fs/cgroup/memory.current").read_text())
        free += [int(limit) - used] if limit != "max" else []
    except (OSError, ValueError):
        pass
    return min(free)


def _meminfo() -> int:
    try:
        lines = dict(line.split(":", 1) for line in Path("/proc/meminfo").read_text().splitlines())
        return int(lines["MemAvailable"].split()[0]) * 1024
    except (OSError, KeyError, ValueError):
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def needed(samples: int, columns: int) -> int:
    """Bytes for so many samples of so many inputs and outputs."""
    return samples * columns * _NUMBER * _COPIES


def require(samples: int, columns: int) -> None:
    """Refuse a campaign that does not fit, before it starts.

    Args:
        samples: Samples of the campaign.
        columns: Inputs and outputs of each.

    Raises:
        TooLargeError: It does not fit.
    """
    need = needed(samples, columns)
    if need < _SMALL:
        return
    free = available()
    if need > _SHARE * free:
        size = (
            f"{samples:,} samples of {columns} inputs and outputs need {need / 1e9:.3g} GB of"
            f" memory and {free / 1e9:.3g} GB are free"
        )
        raise TooLargeError(
            f"{size}; take fewer levels, a plan with fewer samples (reduced, signed), or fewer"
            " outputs"
        )
