"""Numba's decorator with a cache that no change of a helper outlives and that checkouts share.

Numba compiles again where the file of a kernel has changed. The compiled code also holds the
kernels that it calls and the constants that it reads, which may stand in other files: here a cached
kernel is known by the texts of all of them, and by the versions of Numba, NumPy and Python. Numba
itself adds the processor.
"""

from __future__ import annotations

import os
import re
import sys
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

from alphacut.fuzzy.user_cache import remove_unused, user_folder

with_kernels = set[str]()
"""Modules that have kernels; those of helpers come before those that call them."""
PACKAGE = Path(__file__).parents[1]
IMPORT = re.compile(r"^\s*from (alphacut[\w.]*) import (?:\(([\w\s,]*)\)|([\w, ]*))", re.MULTILINE)
VERSIONS = f"{numba.__version__} {np.__version__} {sys.version}"


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

    None where `user_folder` is, or where NUMBA_CACHE_DIR names a folder. A new digest clears away
    what is unused.
    """
    base = None if numba.config.CACHE_DIR else user_folder("kernels")
    if base is None:
        return None
    folder = base / f"{module}-{digest(module)[:16]}"
    try:
        if not folder.exists():
            remove_unused(base)
        folder.mkdir(exist_ok=True)
        os.utime(folder)
    except OSError:
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
