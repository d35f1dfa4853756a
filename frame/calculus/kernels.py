"""Numba's decorator with a cache that no change of a helper outlives.

Numba compiles again where the file of a kernel has changed. The compiled code also holds the
kernels that it calls and the constants that it reads, which may stand in other files: here a cached
kernel is known by the texts of all of them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from numba import njit

with_kernels = set[str]()
"""Modules that have kernels; those of helpers come before those that call them."""
PACKAGE = Path(__file__).parents[2]
IMPORT = re.compile(r"^\s*from (alphacut[\w.]*) import (?:\(([\w\s,]*)\)|([\w, ]*))", re.MULTILINE)


def kernel(**options: object) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator that compiles functions at their first call, with options of Numba's njit.

    Compiled code is kept where Numba keeps it, or for the process alone where no folder can be
    written. Division by zero gives infinity or NaN, and the interpreter's lock is released.
    """
    options = {"nogil": True, "error_model": "numpy", **options}

    def decorate(function: Callable[..., Any]) -> Any:
        with_kernels.add(function.__module__)
        try:
            dispatcher = njit(cache=True, **options)(function)
            index = dispatcher._cache._cache_file
            if index._source_stamp:  # Numba's: time and size, or text, of the function's file
                index._source_stamp = digest(function.__module__)
        # no folder can be written, NUMBA_DISABLE_JIT, or a Numba whose cache is another
        except (RuntimeError, AttributeError):
            return njit(**options)(function)
        return dispatcher

    return decorate


compiled = kernel()


@cache
def digest(module: str) -> str:
    """Return a digest of the text of a module and, if it has kernels, of those that it imports."""
    text = _file(module).read_text("utf-8")
    total = sha256(text.encode())
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
