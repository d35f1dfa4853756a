"""Reading apart: what may crash, hang or exhaust a process runs in a process of its own.

It is a new process of this Python, never a fork: a fork of a process with threads may hang, and the
start of workers by `multiprocessing` would run the user's script once more. Arrays come back as
files of NumPy; nothing is pickled. Memory and time are bounded on Linux alone. This protects from
crashes, not from attack.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from pkgutil import resolve_name
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alphacut.base.errors import RefusedError
from alphacut.base.memory import free_memory

MIN_BYTES = 700e6
"""Memory that a reader may take beyond what it maps at its start; libraries take some 300 MB."""
BYTES_PER_BYTE = 40
"""Further bytes of memory for each byte of the file; texts of short numbers take the most."""
MIN_SECONDS = 6
"""Processor time that a reader may take for a small file."""
SECONDS_PER_BYTE = 2e-6
MPI = ("OMPI_", "PMI", "PMIX", "MPI", "HYDRA", "I_MPI", "SLURM_")
"""How the names of variables begin that tell a process that it is one of several."""
PROGRAM = (
    "import json, sys; order = json.loads(sys.argv[1]); sys.path[:] = order['paths'];"
    " from alphacut.base.apart import work; work(order)"
)


def read_apart(
    reader: str, path: Path, *, library: str, options: Mapping[str, object] | None = None
) -> dict[str, NDArray[Any]]:
    """Return what a function reads from a file, in a process of its own.

    Args:
        reader: The function as "package.module:name". It takes the path and the options, and
            returns arrays of numbers or texts by name. It is imported there alone.
        path: The file.
        library: Name of the library that reads, for messages.
        options: Numbers and texts by the names of the function's arguments.

    Raises:
        RefusedError: The function raised an error, the process ended by a signal, or it took more
            memory or time than is allowed.
    """
    size = path.stat().st_size
    seconds = MIN_SECONDS + SECONDS_PER_BYTE * size
    with TemporaryDirectory(prefix="alphacut-") as folder:
        order = {
            "reader": reader,
            "path": str(path.resolve()),
            "options": dict(options or {}),
            "folder": folder,
            "paths": [entry or os.getcwd() for entry in sys.path],
            "bytes": min(MIN_BYTES + BYTES_PER_BYTE * size, free_memory()),
            "seconds": seconds,
            "parent": os.getpid(),
        }
        command = [sys.executable, "-I", "-S", "-c", PROGRAM, json.dumps(order)]
        environment = {k: x for k, x in os.environ.items() if not k.startswith(MPI)}
        environment |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        null = subprocess.DEVNULL
        try:
            # The process is killed where this one is interrupted.
            ended = subprocess.run(
                command, env=environment, stdin=null, stdout=null, stderr=null, check=False,
                timeout=4 * seconds,
            )  # fmt: skip
            reason = f"{library} ended by signal {-ended.returncode}"
        except subprocess.TimeoutExpired:
            reason = f"{library} took more than {4 * seconds:.0f} s"
        told = Path(folder, "told.json")
        if told.exists():
            reason = json.loads(told.read_text(encoding="utf-8"))
        if reason:
            cure = "write the file anew, or copy it anew"
            raise RefusedError(path.name, reason, f"a file that {library} reads", cure)
        files = Path(folder).glob("*.npy")
        return {file.stem: np.load(file, allow_pickle=False) for file in files}


def work(order: Mapping[str, Any]) -> None:
    """Read as `read_apart` asks, and leave arrays and the reason of a failure in its folder."""
    _limit(order)
    folder = Path(order["folder"])
    reason = ""
    try:
        read: Callable[..., Mapping[str, NDArray[Any]]] = resolve_name(order["reader"])
        for name, array in read(Path(order["path"]), **order["options"]).items():
            np.save(folder / f"{name}.npy", array, allow_pickle=False)
    except MemoryError:
        reason = "too large: the memory that its size allows is not enough"
    except Exception as error:  # of libraries, errors of all kinds
        reason = " ".join(str(error).split())[:150] or type(error).__name__
    (folder / "told.json").write_text(json.dumps(reason), encoding="utf-8")


def _limit(order: Mapping[str, Any]) -> None:
    """Bound memory and time of this process, and let it end with the one that started it."""
    with suppress(ImportError, OSError, ValueError):
        import ctypes
        import resource
        import signal

        end_with_parent = 1  # PR_SET_PDEATHSIG
        ctypes.CDLL(None).prctl(end_with_parent, signal.SIGKILL)
        if os.getppid() != order["parent"]:  # it has ended before
            os._exit(1)
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        most = pages * os.sysconf("SC_PAGE_SIZE") + int(order["bytes"])
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        seconds = int(order["seconds"]) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
