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
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from alphacut.base.apart_work import Order
from alphacut.base.array_files import Numbers
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
    " from alphacut.base.apart_work import work; work(order)"
)


def read_apart(
    reader: str, path: Path, *, library: str, options: Mapping[str, object] | None = None
) -> dict[str, Numbers]:
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
        order: Order = {
            "reader": reader,
            "path": str(path.resolve()),
            "options": dict(options or {}),
            "folder": folder,
            "paths": [entry or os.getcwd() for entry in sys.path],
            "bytes": min(MIN_BYTES + BYTES_PER_BYTE * size, free_memory()),
            "seconds": seconds,
        }
        command = [sys.executable, "-I", "-S", "-c", PROGRAM, json.dumps(order)]
        environment = {k: x for k, x in os.environ.items() if not k.startswith(MPI)}
        environment |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        null = subprocess.DEVNULL
        # It reads its input, of which nothing is written, to see that this process has ended.
        with subprocess.Popen(
            command, env=environment, stdin=subprocess.PIPE, stdout=null, stderr=null
        ) as process:
            try:
                status = _wait(process, 4 * seconds)
            finally:
                process.kill()  # also where this process is interrupted
        reason = f"{library} took more than {4 * seconds:.0f} s"
        if status is not None:
            reason = f"{library} ended by signal {-status}"
        allowed = cure = ""
        told = Path(folder, "told.json")
        if told.exists():
            reason, allowed, cure = json.loads(told.read_text(encoding="utf-8"))
        if reason:
            allowed = allowed or f"a file that {library} reads"
            cure = cure or "write the file anew, or copy it anew"
            raise RefusedError(path.name, reason, allowed, cure)
        return {x.stem: _load(x) for x in Path(folder).iterdir() if x.name != told.name}


def _load(file: Path) -> Numbers:
    """Return an array that the process has left: of NumPy, or bytes of a type code."""
    if file.suffix == ".npy":
        array: Numbers = np.load(file, allow_pickle=False)
        return array
    return np.fromfile(file, dtype=file.suffix[1:])


def _wait(process: subprocess.Popen[bytes], seconds: float) -> int | None:
    """Return how a process ended; None if it waits for something after so many seconds.

    One that computes goes on: other programs may have the processors, and its time is bounded.
    """
    while True:
        with suppress(subprocess.TimeoutExpired):
            return process.wait(seconds)
        state = Path(f"/proc/{process.pid}/stat")
        if not state.exists() or state.read_text("ascii", "replace").rpartition(")")[2][1] != "R":
            return process.poll()
