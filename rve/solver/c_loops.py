"""C loops beside their Python, compiled on first use for this processor, as forms are."""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
from functools import cache
from pathlib import Path

WEDGES = Path(__file__).with_name("wedges.c")
_FLAGS = ("-O3", "-fno-math-errno", "-shared", "-fPIC")


def kernels() -> Path:
    """Folder of compiled code, kept for other runs."""
    caches = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    folder = caches / "alphacut" / "kernels"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@cache
def c_loops(source: Path) -> ctypes.CDLL:
    """The functions of a C file.

    Raises:
        RuntimeError: The compiler is missing or fails.
    """
    key = "\n".join((*_FLAGS, source.read_text(encoding="utf-8"), _processor()))
    made = kernels() / f"{source.stem}-{hashlib.sha256(key.encode()).hexdigest()[:16]}.so"
    if not made.exists():
        from tempfile import TemporaryDirectory

        with TemporaryDirectory(dir=made.parent) as work:  # renamed when whole, for others
            _compile(source, Path(work) / made.name).replace(made)
    return ctypes.CDLL(str(made))


def _compile(source: Path, made: Path) -> Path:
    import subprocess

    command = [os.environ.get("CC", "cc"), *_FLAGS, str(source), "-o", str(made), "-lm"]
    for more in (["-march=native"], []):  # which not every compiler knows
        try:
            subprocess.run([*command, *more], check=True, capture_output=True, timeout=60)
            return made
        except (OSError, subprocess.SubprocessError) as error:
            failure = error
    raise RuntimeError(f"{source.name} needs a C compiler, as DOLFINx does: {failure}")


def _processor() -> str:
    """Abilities of the processor, for which code is compiled."""
    try:
        with Path("/proc/cpuinfo").open(encoding="utf-8") as lines:
            return next((line for line in lines if line.startswith(("flags", "Features"))), "")
    except OSError:
        return platform.processor()
