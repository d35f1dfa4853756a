"""Executors of samples: this process, a pool of processes, or the caller's own."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import contextmanager, suppress
from itertools import islice
from numbers import Integral
from typing import Any

from alphacut.fuzzy.campaign.call import Call, Failure, Outcome
from alphacut.fuzzy.sets.numbers import Array

Task = tuple[list[int], Array]  # rows of the design, and their points
Done = tuple[list[int], list[Outcome]]


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

    def alone(self, call: Call, points: Array) -> list[Outcome]:
        """Run one call in a process of its own, which may die."""
        with _processes(1) as executor:
            try:
                return executor.submit(call, points).result()
            except BrokenExecutor:
                if len(points) == 1:
                    return [
                        Failure(
                            "the process that ran it died: out of memory, or a crash in compiled"
                            " code"
                        )
                    ]
        return [self.alone(call, point[None])[0] for point in points]

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


def completed(call: Call, tasks: Iterable[Task], executor: Executor | None) -> Iterator[Done]:
    """Run the tasks and yield each as it ends, with no more than a few waiting in the executor.

    Args:
        call: The function with the way it is called.
        tasks: Rows and points of each call; taken from the iterable only when there is room.
        executor: Any `concurrent.futures` executor; None runs here, one after the other.
    """
    if executor is None:
        for rows, points in tasks:
            yield rows, call(points)
        return
    queue = iter(tasks)
    waiting: dict[Future[list[Outcome]], Task] = {}
    room = 2 * _width(executor)
    try:
        while True:
            for rows, points in islice(queue, room - len(waiting)):
                waiting[executor.submit(call, points)] = rows, points
            if not waiting:
                return
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                rows, points = waiting.pop(future)
                yield rows, _outcomes(future, executor, call, points)
    finally:
        for future in waiting:
            future.cancel()


def _outcomes(
    future: Future[list[Outcome]], executor: Executor, call: Call, points: Array
) -> list[Outcome]:
    """Outcomes of a call, run again by itself if its process died."""
    try:
        return future.result()
    except BrokenExecutor:
        if isinstance(executor, ProcessPool):
            return executor.alone(call, points)
        raise
    except Exception as error:  # a call raises nothing itself
        failure = (
            f"the function or its outputs cannot be sent between processes ({type(error).__name__}:"
            f" {error})"
        )
        return [Failure(failure)] * len(points)


def _width(executor: Executor) -> int:
    """Number of calls that the executor runs at once, as far as it says."""
    return int(
        getattr(executor, "_max_workers", 0)
        or getattr(executor, "num_workers", 0)
        or os.cpu_count()
        or 1
    )
