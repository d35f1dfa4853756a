"""Executors of samples: this process, a pool of processes, MPI's, or the caller's own."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import contextmanager
from itertools import islice
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


def _hang_up_signals() -> list[signal.Signals]:
    """Return SIGHUP, which all processes of a terminal get when it closes; none on Windows."""
    return [signal.SIGHUP] if hasattr(signal, "SIGHUP") else []


@contextmanager
def pool(workers: int) -> Iterator[Executor | None]:
    """Yield an executor of several processes during a context, and end the processes afterwards.

    None is yielded for one worker: then this process shall do the work. Under
    `python -m mpi4py.futures` the executor is the pool of all MPI processes, whatever `workers`
    says. If the context raises an exception, processes that are still busy are killed.

    Args:
        workers: Number of processes, 1 or more.

    Raises:
        RefusedError: `workers` is not a positive whole number.
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
            # Ctrl-C is a BaseException. No result is awaited any more, and samples may take hours.
            except BaseException:
                executor.shutdown(kill_workers=True)  # type: ignore[call-arg]
                raise


def _processes(workers: int) -> Executor:
    """Return an executor of `workers` processes on this machine, which start at its first task.

    They are forked if this process is known to have one thread, so that they need not import
    anything again; else they start anew. They end when this process has ended, and ignore Ctrl-C
    and hang-ups.
    """
    # Unlike the executor of the standard library, loky's sends functions by value where another
    # process cannot import them, such as lambdas.
    # Both modules take time to import, and one process needs neither.
    from multiprocessing import get_context

    from joblib.externals.loky import ProcessPoolExecutor

    threads = Path("/proc/self/task")
    # A lock that another thread holds while it is forked is never released in the child.
    is_safe = threads.exists() and len(list(threads.iterdir())) == 1
    context = get_context("fork") if is_safe else None

    # loky starts its semaphore tracker here. The tracker inherits the mask of blocked signals, so
    # that a hang-up of the process group does not end it before it has freed the semaphores.
    blocked = _hang_up_signals()
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, blocked) if blocked else None
    try:
        executor: Executor = ProcessPoolExecutor(
            workers, context=context, initializer=_end_with_parent, initargs=(os.getpid(),)
        )
    finally:
        if mask is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
    return executor


def _end_with_parent(parent: int) -> None:
    """Let this worker process end when the process that has started it has ended.

    A thread looks five times a second whether the parent has ended, and then ends this process
    without cleaning up. From now on Ctrl-C and hang-ups are ignored, and SIGTERM ends the process
    at once.

    Args:
        parent: Process id of the parent.
    """
    from threading import Thread

    # A forked process inherits handlers of the parent, which may end other processes.
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    # A terminal sends Ctrl-C and hang-ups to all processes of the group. The parent alone decides
    # what follows, and may still write the samples that are done.
    for number in (signal.SIGINT, *_hang_up_signals()):
        signal.signal(number, signal.SIG_IGN)

    def watch() -> None:
        """Wait until this process is an orphan, and end it."""
        # The kernel gives an orphan another parent.
        while os.getppid() == parent:
            sleep(0.2)
        os._exit(1)

    Thread(target=watch, daemon=True).start()


def submit(
    executor: Executor | None, function: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs
) -> Future[T]:
    """Return the future of a function's call with some arguments.

    An executor gets the call; its future holds the result, or the exception of the call. With None
    the call is made here before this function returns, and an exception of it is raised at once.
    """
    if executor is not None:
        return executor.submit(function, *args, **kwargs)
    done: Future[T] = Future()
    done.set_result(function(*args, **kwargs))
    return done


def completed(
    call: Call, tasks: Iterable[Task], executor: Executor | None
) -> Iterator[tuple[list[int], list[Outcome]]]:
    """Evaluate tasks, and yield the result of each when it is there.

    Tasks are sent to the executor in batches of about a tenth of a second. If the caller stops
    early, or an error is raised, batches that have not begun are cancelled.

    Args:
        call: The function of the user, which returns an outcome for each point: a sample, or a
            failure with the text of an exception, so that tasks themselves raise nothing.
        tasks: Pairs of rows, the numbers of some points in their design, and these points, shape
            (rows, inputs). They are read lazily, at most two batches for each worker ahead of the
            results.
        executor: Any executor; with None this process evaluates one task after another.

    Yields:
        The rows of a task as they were given, and the outcome of each row. Without an executor the
        tasks come in their order, else about in the order in which they end.

    Raises:
        FailedError: A worker process died, or the function or its outputs cannot be sent between
            processes.
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
                # The outcomes of each task of the batch, and the time that they took.
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
    """Return the outcomes of each call of a batch, and the seconds that all took together."""
    start = perf_counter()
    return [call(points) for points in batch], perf_counter() - start


def _result(future: Future[T], call: Call, batch: list[Task]) -> T:
    """Wait for the result of a batch of calls, and return it.

    Exceptions of the user's function are caught in the worker and belong to the result, so that an
    exception here means that processes do not work together.

    Args:
        future: Future of the batch.
        call: The calls' function; the names of its inputs stand in the message.
        batch: Pairs of rows and points, one or more; the first one is named in the message.

    Raises:
        FailedError: The worker process died, or the batch or its result cannot be sent between
            processes.
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
