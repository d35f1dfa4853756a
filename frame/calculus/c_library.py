"""C code compiled on first use, where there is a compiler."""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
from functools import lru_cache
from pathlib import Path

import numpy as np

from alphacut.frame.calculus.jet import Array

FLAGS = ("-O3", "-march=native", "-fno-math-errno", "-ffp-contract=off", "-shared", "-fPIC")
FUSED = ("-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-shared", "-fPIC")
"""Where products may be rounded together with the sums that they go into."""
SECONDS = 60
"""Longest time a compiler may take."""


@lru_cache(64)
def c_library(source: str, flags: tuple[str, ...] = FLAGS) -> ctypes.CDLL | None:
    """The compiled `source`, kept for other runs; `flags` are the compiler's.

    Returns:
        The library; None without a compiler, where it fails, or where the environment variable
        ALPHACUT_KERNEL is "numpy".
    """
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None or os.environ.get("ALPHACUT_KERNEL") == "numpy":
        return None
    content = "\n".join([*flags, source, platform.machine(), _processor()])
    key = hashlib.sha256(content.encode()).hexdigest()[:16]
    folder = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "alphacut" / "kernels"
    made = folder / f"{key}.so"
    try:
        if not made.exists():
            _compile(compiler, flags, source, made)
        return ctypes.CDLL(str(made))
    except (OSError, subprocess.SubprocessError):
        return None


def _compile(compiler: str, flags: tuple[str, ...], source: str, made: Path) -> None:
    made.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=made.parent) as work:
        text, fresh = Path(work) / "source.c", Path(work) / made.name
        text.write_text(source, encoding="utf-8")
        command = [compiler, *flags, str(text), "-o", str(fresh), "-lm"]
        subprocess.run(command, check=True, capture_output=True, timeout=SECONDS)
        fresh.replace(made)


def _processor() -> str:
    """Abilities of the processor, for which code is compiled."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line for line in lines if line.startswith(("flags", "Features"))), "")


def address(array: Array) -> ctypes.c_void_p:
    """Where a contiguous array of doubles begins; it must outlive the call.

    Raises:
        TypeError: The array is not of that kind.
    """
    if array.dtype != np.float64 or not array.flags.c_contiguous:
        raise TypeError(f"array: {array.dtype} of strides {array.strides} is no C array of doubles")
    return ctypes.c_void_p(array.ctypes.data)
