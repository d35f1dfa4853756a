"""Head start of one product-space cell by a second process.

Loading PETSc and DOLFINx takes as long as Gmsh takes to load and to mesh; the coarser solves that
judge the layers wait for nothing of the finest. A second process does both from the start.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
from collections.abc import Callable, Iterable
from typing import NoReturn

from alphacut.rve.mesh.triangulation import Triangulation
from alphacut.stochastic.theta.truncated_normal import Array

_LAUNCHED = ("OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_SIZE", "MPI_LOCALNRANKS")


def launched() -> bool:
    """True if mpirun or its like started this process."""
    return any(name in os.environ for name in _LAUNCHED)


def possible() -> bool:
    """True if a second processor is free for a copy of this process that knows nothing of MPI."""
    return (
        hasattr(os, "sched_getaffinity")  # Linux
        and len(os.sched_getaffinity(0)) > 1
        and len(os.listdir("/proc/self/task")) == 1  # threads do not survive a fork
        and "mpi4py.MPI" not in sys.modules
        and not launched()
    )


class HeadStart:
    """Mesh and errors of the layers of one cell, from a second process that starts at once.

    Args:
        mesh: Makes the mesh under the prisms.
        errors: Makes the errors of the layers, see `PrismModel.errors_of_layers`.
    """

    def __init__(
        self, mesh: Callable[[], Triangulation], errors: Callable[[], list[Array]]
    ) -> None:
        receiver, sender = os.pipe()
        self._process = os.fork()
        if self._process == 0:
            os.close(receiver)
            _send((mesh, errors), sender)
        os.close(sender)
        self._results = os.fdopen(receiver, "rb")

    def mesh(self) -> Triangulation | None:
        """The mesh, once; None if the second process failed or gave it already."""
        found = self._take()
        return found if isinstance(found, Triangulation) else None

    def errors(self) -> list[Array] | None:
        """Errors of the layers, once and after the mesh; None if the second process failed."""
        found = self._take()
        return found if isinstance(found, list) else None

    def stop(self) -> None:
        """End the second process, finished or not."""
        self._results.close()
        os.kill(self._process, signal.SIGKILL)
        os.waitpid(self._process, 0)

    def _take(self) -> object:
        try:
            return pickle.load(self._results)
        except EOFError:
            return None


def _send(steps: Iterable[Callable[[], object]], sender: int) -> NoReturn:
    """Send the results of `steps` as they come; end without what the parent does at its end."""
    try:
        with os.fdopen(sender, "wb") as results:
            for step in steps:
                pickle.dump(step(), results)
                results.flush()
    finally:
        os._exit(0)
