"""The process in which a reader runs apart; it imports nothing that the reader does not need.

NumPy alone takes .1 s to import, as long as all that Gmsh needs to read a small mesh.
"""

from __future__ import annotations

import json
import os
import sys
from array import array
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import Any, TypedDict


class Order(TypedDict):
    """What the process is to read, and its bounds; handed on as JSON."""

    reader: str
    path: str
    options: dict[str, object]
    folder: str
    paths: list[str]
    bytes: float
    seconds: float


def work(order: Order) -> None:
    """Read as `read_apart` asks; leave arrays, or why not, what is allowed and the cure.

    An array of the module `array` is left as its bytes, in a file whose ending is its type code.
    """
    Thread(target=_end_with_parent, daemon=True).start()
    _limit(order)
    folder = Path(order["folder"])
    told = ["", "", ""]
    try:
        module, _, name = order["reader"].partition(":")
        read = getattr(import_module(module), name)
        for key, numbers in read(Path(order["path"]), **order["options"]).items():
            _save(folder, key, numbers)
    except MemoryError:
        told[0] = "too large: the memory that its size allows is not enough"
    except Exception as error:  # of libraries, errors of all kinds
        told[0] = " ".join(str(error).split())[:150] or type(error).__name__
        if hasattr(error, "cure"):  # a RefusedError, whose module imports NumPy
            told = [str(getattr(error, key)) for key in ("value", "allowed", "cure")]
    (folder / "told.json").write_text(json.dumps(told), encoding="utf-8")


def _save(folder: Path, key: str, numbers: Any) -> None:
    """Write an array of Python or of NumPy into a file of a folder."""
    if isinstance(numbers, array):
        with open(folder / f"{key}.{numbers.typecode}", "wb") as file:
            numbers.tofile(file)
    else:
        import numpy as np

        np.save(folder / f"{key}.npy", numbers, allow_pickle=False)


def _end_with_parent() -> None:
    """End this process where the one that started it has ended, and its input with it."""
    sys.stdin.buffer.read()
    os._exit(1)


def _limit(order: Order) -> None:
    """Bound memory and time of this process."""
    with suppress(ImportError, OSError, ValueError):
        import resource

        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        most = pages * os.sysconf("SC_PAGE_SIZE") + int(order["bytes"])
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        seconds = int(order["seconds"]) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
