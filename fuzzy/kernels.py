"""Numba's decorator with a cache that no change of a helper outlives and that checkouts share.

Numba compiles again where the file of a kernel has changed. The compiled code also holds the
kernels that it calls and the constants that it reads, which may stand in other files: here a cached
kernel is known by the texts of all of them, and by the versions of Numba, NumPy and Python. Numba
itself adds the processor.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any
from uuid import uuid4

import numba
import numpy as np
from numba.core.caching import IndexDataCacheFile

with_kernels = set[str]()
"""Modules that have kernels; those of helpers come before those that call them."""
PACKAGE = Path(__file__).parents[1]
IMPORT = re.compile(r"^\s*from (alphacut[\w.]*) import (?:\(([\w\s,]*)\)|([\w, ]*))", re.MULTILINE)
VERSIONS = f"{numba.__version__} {np.__version__} {sys.version}"
UNUSED_DAYS = 14
"""Days after which compiled code that no process has asked for is removed."""


def kernel(**options: object) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator that compiles functions at their first call, with options of Numba's njit.

    Compiled code is kept in `shared_folder`, else where Numba keeps it, or for the process alone
    where no folder can be written. Division by zero gives infinity or NaN, and the interpreter's
    lock is released.
    """
    options = {"nogil": True, "error_model": "numpy", **options}

    def decorate(function: Callable[..., Any]) -> Any:
        with_kernels.add(function.__module__)
        try:
            dispatcher = numba.njit(cache=True, **options)(function)
            code = dispatcher._cache
            folder = shared_folder(function.__module__) or code.cache_path
            stamp = digest(function.__module__)
            code._cache_file = _Index(str(folder), code._impl.filename_base, stamp)
        # no folder can be written, NUMBA_DISABLE_JIT, or a Numba whose cache is another
        except (RuntimeError, AttributeError):
            return numba.njit(**options)(function)
        return dispatcher

    return decorate


class _Index(IndexDataCacheFile):  # type: ignore[misc]
    """Numba's index of a kernel's compiled code, but with files that no other process writes."""

    def save(self, key: object, data: object) -> None:
        with suppress(
            OSError
        ):  # a full disk, or a folder that was cleared: compiled for this process
            super().save(key, data)

    def _data_name(self, number: int) -> str:
        return f"{self._index_name}.{uuid4().hex}.nbc"


@cache
def shared_folder(module: str) -> Path | None:
    """Return the folder of a module's compiled code that all checkouts of this user share.

    None where it cannot be written, where another user could write it, who could then run code as
    this one, or where NUMBA_CACHE_DIR names a folder. A new digest clears away what is unused.
    """
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    base = Path(os.environ.get("ALPHACUT_CACHE") or Path(home, "alphacut"), "kernels")
    folder = base / f"{module}-{digest(module)[:16]}"
    try:
        base.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = base.stat()
        if numba.config.CACHE_DIR or status.st_mode & 0o022 or status.st_uid != os.getuid():
            return None
        if not folder.exists():
            for unused in base.iterdir():
                if unused.stat().st_mtime < time.time() - UNUSED_DAYS * 86400:
                    shutil.rmtree(unused, ignore_errors=True)
        folder.mkdir(exist_ok=True)
        os.utime(folder)
    except (OSError, RuntimeError):
        return None
    return folder


compiled = kernel()


@cache
def digest(module: str) -> str:
    """Return a digest of a module's text, of what it imports if it has kernels, and of versions."""
    text = _file(module).read_text("utf-8")
    total = sha256((VERSIONS + text).encode())
    if module in with_kernels:
        for name in _imports(text):
            total.update(digest(name).encode())
    return total.hexdigest()


def _imports(text: str) -> Iterator[str]:
    for package, lines, line in IMPORT.findall(text):
        for module in (
            package,
            *(f"{package}.{name}" for name in re.findall(r"\w+", lines + line)),
        ):
            if _file(module).exists():
                yield module


def _file(module: str) -> Path:
    path = PACKAGE.joinpath(*module.split(".")[1:])
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
