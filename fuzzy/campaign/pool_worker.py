"""Worker processes of a pool, which refuse to run a campaign while they start."""

from __future__ import annotations

import os
import sys
from multiprocessing import current_process
from multiprocessing.context import ForkServerContext, ForkServerProcess
from pathlib import Path

GUARD = 'put the calls in that script under `if __name__ == "__main__":`, or take workers=1'


class PoolWorker(ForkServerProcess):
    """A worker of a pool, known by its name."""


class PoolContext(ForkServerContext):
    """Starts workers from a clean server process."""

    Process = PoolWorker


def refuse_in_import() -> None:
    """End a process that begins a campaign while it imports the main script.

    A worker ends in silence, since its parent tells the reason; another process tells it itself.
    """
    process = current_process()
    if not getattr(process, "_inheriting", False):
        return
    if not process.name.startswith(f"{PoolWorker.__name__}-"):
        sys.stderr.write(
            f"a process that imports the main script would start workers in turn: {GUARD}\n"
        )
        sys.stderr.flush()
    os._exit(1)


def require_script() -> None:
    """Workers import the main script, so it must be a file where there is one.

    Raises:
        ValueError: It came from standard input.
    """
    main = sys.modules["__main__"]
    path = getattr(main, "__file__", None)
    if getattr(main, "__spec__", None) is None and path is not None and not Path(path).exists():
        raise ValueError(
            f"the main script is {path}, which worker processes cannot import; save it as a file,"
            " or take workers=1"
        )
