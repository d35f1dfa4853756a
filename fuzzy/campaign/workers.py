"""Executors of samples: this process, a pool of processes, or the caller's own."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import contextmanager, suppress
from numbers import Integral
from typing import Any


class ProcessPool(Executor):
    """Fresh processes of this machine that end with this one and are replaced when they die.

    Args:
        workers: How many.
    """

    def __init__(self, workers: int) -> None:
        self._max_workers = workers
        self._inner = _processes(workers)
        self._started = False

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run a call in one of the processes, new ones if one of them has died.

        Raises:
            RuntimeError: The processes end while they start, as new ones would.
        """
        if not self._started:
            self._start()
        try:
            return self._inner.submit(fn, *args, **kwargs)
        except BrokenExecutor:
            self._inner.shutdown(wait=False, cancel_futures=True)
            self._inner = _processes(self._max_workers)
            return self._inner.submit(fn, *args, **kwargs)

    def _start(self) -> None:
        """Start all processes and wait for the first that is ready."""
        from alphacut.fuzzy.campaign.pool_worker import GUARD

        try:
            ready = [self._inner.submit(os.getpid) for _ in range(self._max_workers)]
            next(iter(wait(ready, return_when=FIRST_COMPLETED).done)).result()
        except (BrokenExecutor, OSError, EOFError):
            reason = (
                "the worker processes ended before their first sample: each of them imports the"
                " main script"
            )
            raise RuntimeError(f"{reason}; {GUARD}") from None
        self._started = True

    def alone(self, fn: Callable[..., Any], /, *args: Any) -> Any:
        """Run one call in a process of its own, which may die.

        Raises:
            BrokenExecutor: It died.
        """
        with _processes(1) as executor:
            return executor.submit(fn, *args).result()

    def stop(self) -> None:
        """End the processes in the middle of what they do: nobody waits for it any more."""
        for process in list(getattr(self._inner, "_processes", None) or {}):
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGTERM)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes."""
        self._inner.shutdown(wait, cancel_futures=cancel_futures)


def _processes(workers: int) -> Executor:
    from concurrent.futures import ProcessPoolExecutor

    from alphacut.fuzzy.campaign.pool_worker import PoolContext

    return ProcessPoolExecutor(workers, mp_context=PoolContext(), initializer=_end_with_parent)


@contextmanager
def pool(workers: int) -> Iterator[Executor | None]:
    """A pool of `workers` processes, or None where one process does everything.

    Under `python -m mpi4py.futures` it is the pool of all MPI processes instead, whatever `workers`
    says.

    Raises:
        ValueError: `workers` is no whole number from 1, or the main script came from standard
            input.
    """
    require_workers(workers)
    if {"mpi4py.run", "mpi4py.futures"} <= sys.modules.keys():
        from mpi4py.futures import MPIPoolExecutor

        with MPIPoolExecutor() as executor:
            yield executor
    elif workers == 1:
        yield None
    else:
        from alphacut.fuzzy.campaign.pool_worker import refuse_in_import, require_script

        refuse_in_import()
        require_script()
        processes = ProcessPool(int(workers))
        try:
            yield processes
        except BaseException:
            processes.stop()
            raise
        finally:
            processes.shutdown(wait=True, cancel_futures=True)


def require_workers(workers: object) -> None:
    """Workers are a number of processes.

    Raises:
        ValueError: It is no whole number from 1.
    """
    if not isinstance(workers, Integral) or workers < 1:
        raise ValueError(
            f"the number of workers is {workers!r}; it must be a whole number, 1 or more"
        )


def require_executor(executor: object, workers: int) -> None:
    """An executor is one of `concurrent.futures`, and stands instead of workers.

    Raises:
        ValueError: It is something else, or both are given.
    """
    if executor is not None and not isinstance(executor, Executor):
        raise ValueError(
            f"the executor is a {type(executor).__name__}; it must be one of concurrent.futures"
            " (of a client of dask: client.get_executor())"
        )
    if executor is not None and workers != 1:
        raise ValueError("workers and an executor are both given; give one")


def _end_with_parent() -> None:
    """Leave when the process that started this one is gone: a killed campaign leaves no orphans."""
    from multiprocessing import parent_process
    from multiprocessing.connection import wait as wait_for
    from threading import Thread

    # Ctrl-C reaches the whole group; the parent decides
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()

    def watch() -> None:
        if parent is not None:
            wait_for([parent.sentinel])
            os._exit(1)

    Thread(target=watch, daemon=True).start()
