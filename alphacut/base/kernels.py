"""Numba's decorator with a cache of compiled code that all checkouts of a user share.

Numba compiles a kernel again if its own file has changed. But the compiled code also contains the
kernels that it calls and the constants that it reads, which may stand in other files. Here the key
of cached code is made from the texts of all these files and from the versions of Numba, NumPy and
Python. Numba itself adds the processor.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
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
"""Names of the modules that have kernels, in the order of their import."""
before_compiling = list[Callable[[], None]]()
"""Functions that are called each time before Numba compiles a kernel, without arguments."""
prange = range
"""The loop of parallel kernels, until Numba is imported and its own prange takes its place."""
_creation_lock = RLock()
_known_types = set[bytes]()
"""Types of tuples and Booleans that Numba has met as arguments of kernels, as its fingerprints."""
_first_calls = RLock()
"""Held during calls that bring a type of tuple or Boolean which Numba has not met."""


class _Kernel:
    """A function that Numba compiles at its first call; Numba is not imported before.

    Args:
        function: The function.
        options: Options of `numba.njit`.
    """

    def __init__(self, function: Callable[..., Any], options: Mapping[str, object]) -> None:
        update_wrapper(self, function)
        self._function = function
        self._options = options
        self._created: Any = None
        with_kernels.add(function.__module__)

    def __call__(self, *arguments: Any) -> Any:
        """Call the compiled function.

        At each call Numba looks the types of the arguments up in a table of the process, to which
        tuples and Booleans of a new type are added. Debian's build of Numba 0.61 ends the process
        where two threads add the same type at once ("_hashtable.cpp … Assertion `entry == NULL'
        failed"); other builds drop the assertion. So calls with a new type wait for each other.
        """
        dispatcher = self._dispatcher
        types = _fingerprints(arguments)
        if types <= _known_types:
            return dispatcher(*arguments)
        with _first_calls:
            found = dispatcher(*arguments)
            _known_types.update(types)
        return found

    @property
    def _dispatcher(self) -> Any:
        """Numba's dispatcher of the function, whose compiled code is in `shared_folder`."""
        if self._created is None:
            # with two dispatchers, kernels compiled with the first one would not know the second
            with _creation_lock:
                self._created = self._created or self._create()
        return self._created

    def _create(self) -> Any:
        """Return a new dispatcher of Numba for the function; nothing is compiled yet.

        Its compiled code is kept in the folder of `shared_folder`, or where Numba keeps it, under
        names with a digest of all texts that it was made from. If no folder can be written, or
        Numba does not compile here (NUMBA_DISABLE_JIT), the dispatcher has no cache, so that each
        process compiles anew. For a kernel with the option `parallel` the name `prange` in the
        module of the function becomes Numba's.
        """
        import numba  # takes .3 s

        function = self._function
        options = self._options
        if options.get("parallel"):
            function.__globals__["prange"] = numba.prange
        try:
            dispatcher = numba.njit(cache=True, **options)(function)
            code = dispatcher._cache
            folder = shared_folder(function.__module__) or code.cache_path
            stamp = digest(function.__module__)
            code._cache_file = _shared_index(str(folder), code._impl.filename_base, stamp)
            dispatcher._compiler.compile = _announced(dispatcher._compiler.compile)
        # Numba raises a RuntimeError if no folder can be written. Its cache is no public interface:
        # with NUMBA_DISABLE_JIT, or in a later version, the attributes above may be missing.
        except (RuntimeError, AttributeError):
            return numba.njit(**options)(function)
        return dispatcher

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the dispatcher, which Numba asks for in kernels that call it."""
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self._dispatcher, name)

    def __reduce__(self) -> str:
        """Pickle the kernel as the global of its name."""
        return str(self.__qualname__)


def _fingerprints(arguments: Iterable[object]) -> set[bytes]:
    """Return Numba's fingerprints of the types of the tuples and Booleans among arguments."""
    tabulated = [argument for argument in arguments if isinstance(argument, tuple | bool)]
    if not tabulated:
        return set()
    from numba._dispatcher import compute_fingerprint

    return {compute_fingerprint(argument) for argument in tabulated}


def _announced(compile_types: Callable[..., Any]) -> Callable[..., Any]:
    """Return Numba's function that compiles for types, with a call of `before_compiling` before.

    Numba does not call it where it takes compiled code from the cache.
    """

    def compile_announced(*types: object) -> object:
        for announce in tuple(before_compiling):
            announce()
        return compile_types(*types)

    return compile_announced


def kernel(**options: object) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator that compiles a function by Numba, for each new type of its arguments.

    The compiled code is kept in the user's cache, or where Numba keeps it, or for the process alone
    if no folder can be written. Division by zero gives infinity or NaN, and the lock of the
    interpreter is released during calls. Numba itself is imported at the first call.

    Args:
        options: Further options of `numba.njit`, such as `parallel` or `fastmath`; they override
            those said above.
    """
    return partial(_Kernel, options={"nogil": True, "error_model": "numpy", **options})


def _shared_index(folder: str, name: str, stamp: str) -> Any:
    """Return Numba's index of a kernel's compiled code, made safe for several processes.

    Numba keeps the code of each signature in a file of its own, and an index of these files beside
    them. Several processes may read and write them at once. So each process writes code to files of
    its own names, and each file ends with a digest of its content. A file with another digest, such
    as a copy that was interrupted, is removed and taken as missing: unpickling it would raise an
    error or end the process. Where files cannot be read or written, code is compiled for the
    process alone, and no error is raised.

    Args:
        folder: Folder of the files.
        name: Beginning of their names, one for each kernel.
        stamp: Digest of what the code is compiled from. Code with another stamp is ignored.
    """
    from numba.core.caching import IndexDataCacheFile

    class Index(IndexDataCacheFile):  # type: ignore[misc]
        """Numba's index with other file names, digests, and without errors of the file system."""

        def load(self, key: object) -> object:
            with suppress(OSError):  # compiled for this process
                return super().load(key)
            return None

        def save(self, key: object, data: object) -> None:
            with suppress(OSError):  # a full disk, or a cleared folder: compiled for this process
                super().save(key, data)

        def _data_name(self, number: int) -> str:
            # Numba counts the signatures, so that two processes would write different code to one
            # name.
            return f"{self._index_name}.{uuid4().hex}.nbc"

        def _load_index(self) -> object:
            _remove_damaged(Path(self._index_path))
            return super()._load_index()

        def _load_data(self, name: str) -> object:
            _remove_damaged(Path(self._data_path(name)))
            return super()._load_data(name)

        @contextmanager
        def _open_for_write(self, path: str) -> Iterator[BytesIO]:
            # Numba's file takes its place by renaming when it is closed. Numba unpickles only the
            # beginning, so that the digest behind it does no harm.
            with super()._open_for_write(path) as file:
                content = BytesIO()
                yield content
                file.write(content.getvalue() + sha256(content.getvalue()).digest())

    return Index(folder, name, stamp)


def _remove_damaged(path: Path) -> None:
    """Remove a file whose last 32 bytes are not the SHA-256 of all others; it may be missing.

    A file of fewer than 32 bytes is removed, too.

    Raises:
        OSError: The file cannot be read or removed.
    """
    digest_bytes = sha256().digest_size
    with suppress(FileNotFoundError):
        content = path.read_bytes()
        if sha256(content[:-digest_bytes]).digest() != content[-digest_bytes:]:
            path.unlink()


@cache
def shared_folder(module: str) -> Path | None:
    """Return the folder of a module's compiled code, which all checkouts of this user share.

    Its name has the module and a digest of the texts and versions that the code is made from. It is
    made if need be; then folders of compiled code that were not used for two weeks are removed.
    None is returned if the environment variable NUMBA_CACHE_DIR names a folder, which Numba takes
    by itself, or if the user's cache cannot be written. The result is kept for the process.

    Args:
        module: Full name of a module of this project, such as alphacut.frame.response.duhamel.
    """
    if os.environ.get("NUMBA_CACHE_DIR"):
        return None
    base = user_folder("kernels")
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
    """Return the SHA-256, in hexadecimal, of all that a module's compiled code depends on.

    It covers the text of the module and the versions of Numba, NumPy and Python. Compiled code
    contains the kernels that it calls and the constants that it reads, which may stand in other
    modules. So the digest of a module with kernels also covers the digests of all modules of this
    project that it imports. A module has kernels if it has been imported and has decorated a
    function (`with_kernels`). Modules with kernels must not import each other in a circle. The
    result is kept for the process.

    Args:
        module: Full name of a module of this project, such as alphacut.frame.response.duhamel.

    Raises:
        OSError: The module's file cannot be read.
    """
    text = _file(module).read_text("utf-8")
    total = sha256(f"{version('numba')} {np.__version__} {sys.version}{text}".encode())
    if module in with_kernels:
        for name in _imports(text):
            total.update(digest(name).encode())
    return total.hexdigest()


def _imports(text: str) -> Iterator[str]:
    """Yield the names of this project's modules that the text of a module imports.

    Only statements "from alphacut… import names" count; for a name that is itself a module, as in
    "from alphacut.frame import response", the module is yielded after its package. Names without a
    file are left out, and a module may be yielded several times.
    """
    statement = r"^\s*from (alphacut[\w.]*) import (?:\(([\w\s,]*)\)|([\w, ]*))"
    for package, names_in_brackets, names in re.findall(statement, text, re.MULTILINE):
        modules = [package]
        for name in re.findall(r"\w+", names_in_brackets + names):
            modules.append(f"{package}.{name}")  # if it is a module and no function
        for module in modules:
            if _file(module).exists():
                yield module


def _file(module: str) -> Path:
    """Return the file of a module of this project, such as alphacut.frame."""
    package = Path(__file__).parents[1]
    path = package.joinpath(*module.split(".")[1:])
    if path.is_dir():
        return path / "__init__.py"
    return path.with_suffix(".py")
