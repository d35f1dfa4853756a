"""The memory that is free, against which sizes are held that files promise."""

from __future__ import annotations

import os
from contextlib import suppress
from math import inf
from pathlib import Path
from stat import S_ISDIR, S_ISREG

from alphacut.base.errors import RefusedError

BYTES_OF_TEXT = 30
"""Memory of a byte of text while its numbers are told apart: two digits and a blank take 64."""
AVAILABLE = "MemAvailable:"
"""Line of /proc/meminfo with the kibibytes that processes can take without swapping."""


def free_memory() -> float:
    """Return the bytes that this process may still take; infinity where the system does not tell.

    The least of four: the machine's memory, what of it is free, what the control group has left,
    and what the process's own limit of address space (RLIMIT_AS) leaves.
    """
    free = [inf]
    with suppress(AttributeError, OSError, ValueError):  # Windows has no sysconf
        free.append(float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")))
    with suppress(OSError, ValueError, IndexError):
        lines = Path("/proc/meminfo").read_text().splitlines()
        free += [1024.0 * int(x.split()[1]) for x in lines if x.startswith(AVAILABLE)]
    with suppress(OSError, ValueError):  # "max" is no number: there is no limit
        group = Path("/sys/fs/cgroup")
        most = int((group / "memory.max").read_text())
        free.append(float(most - int((group / "memory.current").read_text())))
    with suppress(ImportError, OSError, ValueError, IndexError):
        import resource  # not on Windows

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        if limit != resource.RLIM_INFINITY:
            pages = int(Path("/proc/self/statm").read_text().split()[0])
            free.append(float(limit - pages * os.sysconf("SC_PAGE_SIZE")))
    return max(min(free), 0.0)


def require_free_memory(name: str, needed: float, what: str) -> None:
    """Refuse what takes more memory than is free.

    Args:
        name: Name of the file.
        needed: Bytes that reading it takes.
        what: What the file promises, as "an array of 3 × 4".

    Raises:
        RefusedError: `needed` is more than `free_memory()`.
    """
    free = free_memory()
    if needed > free:
        value = f"{what}, which takes {needed / 1e9:.3g} GB"
        raise RefusedError(name, value, f"what fits {free / 1e9:.3g} GB of free memory")


def require_text(path: Path) -> None:
    """Refuse a file of text that does not fit the free memory, and what is no regular file.

    Pipes and devices have no end, and reading them would wait for ever.

    Raises:
        RefusedError: As said.
        OSError: The file is not there.
    """
    status = path.stat()
    is_regular = S_ISREG(status.st_mode) or S_ISDIR(status.st_mode)  # reading a folder says so
    if not is_regular:
        raise RefusedError(str(path), "a pipe or a device", "a regular file")
    what = f"a text of {status.st_size} bytes"
    require_free_memory(path.name, float(BYTES_OF_TEXT * status.st_size), what)
