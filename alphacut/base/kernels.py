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
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache, partial, update_wrapper
from hashlib import sha256
from importlib.metadata import version
from io import BytesIO
from pathlib import Path
from threading import RLock
from typing import Any
from uuid import uuid4

import numpy as np

from alphacut.base.user_cache import remove_unused, user_folder

with_kernels = set[str]()
"""Modules that have kernels; those of helpers come before those that call them."""
PACKAGE = Path(__file__).parents[1]
IMPORT = re.compile(r"^\s*from (alphacut[\w.]*) import (?:\(([\w\s,]*)\)|([\w, ]*))", re.MULTILINE)
DIGEST_BYTES = sha256().digest_size
_LOCK = RLock()
prange = range
"""Loop of parallel kernels, in whose module Numba's prange takes its place."""


class _Kernel:
    """A function that Numba compiles at its first call, before which Numba is not imported."""

    def __init__(self, function: Callable[..., Any], options: Mapping[str, object]) -> None:
        update_wrapper(self, function)
        self._function, self._options = function, options
        self._created: Any = None
        with_kernels.add(function.__module__)

    def __call__(self, *arguments: Any) -> Any:
        """Call the compiled function."""
        return self._dispatcher(*arguments)

    @property
    def _dispatcher(self) -> Any:
        """Numba's dispatcher of the function, with its code in `shared_folder`."""
        if self._created is None:
            with _LOCK:  # a second dispatcher would leave kernels that were compiled with the first
                self._created = self._created or self._create()
        return self._created

    def _create(self) -> Any:
        import numba  # which takes time to import

        function, options = self._function, self._options
        if options.get("parallel"):
            function.__globals__["prange"] = numba.prange
        try:
            dispatcher = numba.njit(cache=True, **options)(function)
            code = dispatcher._cache
            folder = shared_folder(function.__module__) or code.cache_path
            stamp = digest(function.__module__)
            code._cache_file = _shared_index(str(folder), code._impl.filename_base, stamp)
        # no folder can be written, NUMBA_DISABLE_JIT, or a Numba whose cache is another
        except (RuntimeError, AttributeError):
            return numba.njit(**options)(function)
        return dispatcher

    def __getattr__(self, name: str) -> Any:
        """Return what Numba asks of a dispatcher that another kernel calls, as its type."""
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self._dispatcher, name)

    def __reduce__(self) -> str:
        """Pickle by name."""
        return str(self.__qualname__)


def kernel(**options: object) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator that compiles functions at their first call, with options of Numba's njit.

    Compiled code is kept in `shared_folder`, else where Numba keeps it, or for the process alone
    where no folder can be written. Division by zero gives infinity or NaN, and the interpreter's
    lock is released.
    """
    return partial(_Kernel, options={"nogil": True, "error_model": "numpy", **options})


def _shared_index(folder: str, name: str, stamp: str) -> Any:
    """Numba's index of a kernel's compiled code, but with files that no other process writes.

    A digest of its content ends each file. A file that it does not fit, as of a copy that was
    interrupted, is removed and taken as missing: unpickled, it would raise or end the process.
    """
    from numba.core.caching import IndexDataCacheFile

    class Index(IndexDataCacheFile):  # type: ignore[misc]
        def load(self, key: object) -> object:
            with suppress(OSError):  # compiled for this process
                return super().load(key)
            return None

        def save(self, key: object, data: object) -> None:
            with suppress(OSError):  # a full disk, or a cleared folder: compiled for this process
                super().save(key, data)

        def _data_name(self, number: int) -> str:
            return f"{self._index_name}.{uuid4().hex}.nbc"

        def _load_index(self) -> object:
            _remove_damaged(Path(self._index_path))
            return super()._load_index()

        def _load_data(self, name: str) -> object:
            _remove_damaged(Path(self._data_path(name)))
            return super()._load_data(name)

        @contextmanager
        def _open_for_write(self, path: str) -> Iterator[BytesIO]:
            with super()._open_for_write(path) as file:
                content = BytesIO()
                yield content
                file.write(content.getvalue() + sha256(content.getvalue()).digest())

    return Index(folder, name, stamp)


def _remove_damaged(path: Path) -> None:
    """Remove a file that does not end with the digest of what stands before, if there is one.

    Raises:
        OSError: It cannot be read or removed.
    """
    with suppress(FileNotFoundError):
        content = path.read_bytes()
        if sha256(content[:-DIGEST_BYTES]).digest() != content[-DIGEST_BYTES:]:
            path.unlink()


@cache
def shared_folder(module: str) -> Path | None:
    """Return the folder of a module's compiled code that all checkouts of this user share.

    None where `user_folder` is, or where NUMBA_CACHE_DIR names a folder. A new digest clears away
    what is unused.
    """
    base = None if os.environ.get("NUMBA_CACHE_DIR") else user_folder("kernels")
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
    total = sha256(f"{version('numba')} {np.__version__} {sys.version}{text}".encode())
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
