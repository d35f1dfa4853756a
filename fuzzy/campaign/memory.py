"""Memory that a computation needs, refused before it starts where there is too little."""

from __future__ import annotations

import os
from pathlib import Path

_SMALL = 50_000_000  # bytes not worth a look
_SHARE = 0.9  # of what is free


class TooLargeError(ValueError):
    """A computation needs more memory than there is."""


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


def require_bytes(need: int, what: str, cure: str) -> None:
    """Refuse what does not fit, before it starts.

    Args:
        need: Bytes.
        what: They are for.
        cure: What to do else.

    Raises:
        TooLargeError: It does not fit.
    """
    if need > _SMALL and need > _SHARE * (free := available()):
        size = f"{need / 1e9:.3g} GB of memory and {free / 1e9:.3g} GB are free"
        raise TooLargeError(f"{what} need {size}; {cure}")
