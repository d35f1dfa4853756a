"""The free memory, and checks that what a file promises fits into it before it is read."""

from __future__ import annotations

import os
from contextlib import suppress
from math import inf
from pathlib import Path
from stat import S_ISDIR, S_ISREG

from alphacut.base.errors import RefusedError


def free_memory() -> float:
    """Return the number of bytes that this process may still take; infinity if unknown.

    It is the smallest of these that are known: the machine's memory; the memory that is free; the
    rest of the control group's limit; and the rest of this process's limit of address space
    (RLIMIT_AS).
    """
    free = [inf]
    with suppress(AttributeError, OSError, ValueError):  # Windows has no sysconf
        free.append(float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")))
    with suppress(OSError, ValueError, IndexError):
        # the kibibytes that processes can take without swapping
        _, _, behind = Path("/proc/meminfo").read_text().partition("MemAvailable:")
        free.append(1024.0 * int(behind.split(maxsplit=1)[0]))
    # A container has the machine's /proc/meminfo, but its own control group, whose limit ends the
    # process without a message. The word "max" is no number: there is no limit.
    with suppress(OSError, ValueError):
        group = Path("/sys/fs/cgroup")
        allowed = int((group / "memory.max").read_text())
        used = int((group / "memory.current").read_text())
        free.append(float(allowed - used))
    with suppress(ImportError, OSError, ValueError, IndexError):
        import resource  # not on Windows

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        if limit != resource.RLIM_INFINITY:
            pages = int(Path("/proc/self/statm").read_text().split()[0])
            free.append(float(limit - pages * os.sysconf("SC_PAGE_SIZE")))
    return max(min(free), 0.0)


def require_free_memory(name: str, needed: float, what: str) -> None:
    """Raise RefusedError if reading a file would take more memory than is free.

    Nothing is checked where the free memory is unknown, or less than a megabyte is needed.

    Args:
        name: Name of the file.
        needed: Number of bytes that reading it takes.
        what: What the file promises, such as "an array of 3 × 4".
    """
    # A megabyte is not worth the question, which takes as long as reading a short file.
    if needed > 1e6 and needed > (free := free_memory()):
        value = f"{what}, which takes {needed / 1e9:.3g} GB"
        raise RefusedError(name, value, f"what fits {free / 1e9:.3g} GB of free memory")


def require_text(path: Path) -> None:
    """Check that a file of text can be read: it is a regular file and fits into the free memory.

    Reading a pipe or a device might never end. Folders pass, since opening one says clearly that it
    is a folder.

    Raises:
        RefusedError: The file is a pipe or a device, or too large.
        OSError: The file does not exist.
    """
    # The numbers in a text are split into a list of texts. Two digits and a blank, three bytes of
    # the file, take 64 bytes of memory there; longer numbers take less for each byte.
    bytes_per_byte = 30
    status = path.stat()
    if not (S_ISREG(status.st_mode) or S_ISDIR(status.st_mode)):
        raise RefusedError(str(path), "a pipe or a device", "a regular file")
    what = f"a text of {status.st_size} bytes"
    require_free_memory(path.name, float(bytes_per_byte * status.st_size), what)
