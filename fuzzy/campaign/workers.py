"""Executors of samples: this process, a pool of processes, MPI's, or the caller's own."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import contextmanager
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter, sleep
from typing import ParamSpec, TypeVar

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError, checked_number
from alphacut.fuzzy.campaign.call import Call, Outcome, named_point

P = ParamSpec("P")
T = TypeVar("T")
Task = tuple[list[int], Array]
"""Rows of a design, and their points, which one call evaluates."""
_GROUP_SIGNALS = [signal.SIGHUP] if hasattr(signal, "SIGHUP") else []  # not on Windows


@contextmanager
def pool(workers: int) -> Iterator[Executor | None]:
    """Context manager of an executor of `workers` processes; None where this process does the work.

    Under `python -m mpi4py.futures` it is the pool of all MPI processes, whatever `workers` says.
    Functions are sent by value where the processes cannot import them.
    """
    checked_number("workers", workers, positive=True, whole=True)
    if {"mpi4py.run", "mpi4py.futures"} <= sys.modules.keys():
        from mpi4py.futures import MPIPoolExecutor

        with MPIPoolExecutor() as executor:
            yield executor
    elif workers == 1:
        yield None
    else:
        with _processes(int(workers)) as executor:
            try:
                yield executor
            except BaseException:  # no results are awaited any more
                executor.shutdown(kill_workers=True)  # type: ignore[call-arg]
                raise


def _processes(workers: int) -> Executor:
    """Return an executor of processes, forked where that is safe, to import nothing anew."""
    from joblib.externals.loky import ProcessPoolExecutor

    threads = Path("/proc/self/task")
    # A lock that another thread holds while it is forked is never released in the child.
    is_safe = threads.exists() and len(list(threads.iterdir())) == 1
    context = get_context("fork") if is_safe else None

    # loky starts its semaphore tracker here. The tracker inherits the mask of blocked signals, so
    # that a hang-up of the process group does not end it before it has freed the semaphores.
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, _GROUP_SIGNALS) if _GROUP_SIGNALS else None
    try:
        executor: Executor = ProcessPoolExecutor(
            workers, context=context, initializer=_end_with_parent, initargs=(os.getpid(),)
        )
    finally:
        if mask is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
    return executor


def _end_with_parent(parent: int) -> None:
    """Start a thread that ends this process when process `parent` has ended: no orphans remain."""
    from threading import Thread

    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    # Ctrl-C reaches all processes of the group.
    for number in (signal.SIGINT, *_GROUP_SIGNALS):  # sent to all; the parent decides
        signal.signal(number, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            sleep(0.2)
        os._exit(1)

    Thread(target=watch, daemon=True).start()


def submit(
    executor: Executor | None, function: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs
) -> Future[T]:
    """Return the future of a call by an executor; without executor the call is made at once."""
    if executor is not None:
        return executor.submit(function, *args, **kwargs)
    done: Future[T] = Future()
    done.set_result(function(*args, **kwargs))
    return done


def completed(
    call: Call, tasks: Iterable[Task], executor: Executor | None
) -> Iterator[tuple[list[int], list[Outcome]]]:
    """Yield rows and outcomes of each task, in the order in which the tasks end.

    Tasks are read and sent in batches of about a tenth of a second, two for each worker at a time.
    Without executor this process evaluates one after another.

    Raises:
        FailedError: A worker process died, or the function cannot be sent to one.
    """
    if executor is None:
        yield from ((rows, call(points)) for rows, points in tasks)
        return
    queue = iter(tasks)
    batch_size = 1
    pending: dict[Future[tuple[list[list[Outcome]], float]], list[Task]] = {}
    try:
        while True:
            # Each worker has a batch to work on and one that waits for it, so that none is idle
            # between two.
            while len(pending) < 2 * n_workers(executor):
                batch = list(islice(queue, batch_size))
                if not batch:
                    break
                pending[executor.submit(_run, call, [points for _, points in batch])] = batch
            if not pending:
                return
            for future in wait(pending, return_when=FIRST_COMPLETED).done:
                batch = pending.pop(future)
                outcomes, seconds = _result(future, call, batch)
                # Quick calls come in batches of 0.1 s; sending a shorter one would cost more.
                ideal_size = 0.1 * len(batch) / max(seconds, 1e-9)
                batch_size = int(min(max(ideal_size, 1), 1024))
                for (rows, _), results in zip(batch, outcomes, strict=True):
                    yield rows, results
    finally:
        for future in pending:
            future.cancel()


def _run(call: Call, batch: list[Array]) -> tuple[list[list[Outcome]], float]:
    """Return the outcomes of each call of a batch, and the seconds that they took."""
    start = perf_counter()
    return [call(points) for points in batch], perf_counter() - start


def _result(future: Future[T], call: Call, batch: list[Task]) -> T:
    """Wait for the result of a batch, whose calls catch their own exceptions.

    Raises:
        FailedError: The worker process died, or the batch cannot be sent to one.
    """
    try:
        return future.result()
    except BrokenExecutor as error:
        rows, points = batch[0]
        inputs = named_point(call.names, np.atleast_2d(points)[0])
        values = ", ".join(f"{name} = {value:.6g}" for name, value in inputs.items())
        what = f"a worker process died at or near sample {rows[0] + 1} ({values})"
        cure = "out of memory, or a crash in compiled code; what a store holds stays"
        raise FailedError(what, cure) from error
    except Exception as error:
        what = f"the function or its outputs cannot be sent between processes: {error}"
        raise FailedError(what, "take workers=1, or a function that can be pickled") from error


def n_workers(executor: Executor) -> int:
    """Return the number of calls that an executor runs concurrently; if unknown, that of cores."""
    client = getattr(executor, "_client", None)  # dask
    if client is not None and (threads := sum(client.nthreads().values())):
        return int(threads)
    stated = getattr(executor, "_max_workers", 0) or getattr(executor, "num_workers", 0)
    return int(stated or os.cpu_count() or 1)
