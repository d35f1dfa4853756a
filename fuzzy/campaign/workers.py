"""Executors of samples: this process, a pool of processes, MPI's, or the caller's own."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import contextmanager
from itertools import islice
from time import perf_counter, sleep
from typing import ParamSpec, TypeVar

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.campaign.call import Call, Outcome
from alphacut.fuzzy.refused import FailedError, real

P = ParamSpec("P")
T = TypeVar("T")
Task = tuple[list[int], Array]  # rows of the design, and their points
_PARENT_PERIOD = 0.2  # seconds between two checks that the parent process runs
_BATCH_SECONDS = 0.1  # of work in a batch of quick calls: less, and sending them costs more
_MAX_BATCH = 1024  # calls in a batch
_GROUP_SIGNALS = [signal.SIGHUP] if hasattr(signal, "SIGHUP") else []  # not on Windows


@contextmanager
def pool(workers: int) -> Iterator[Executor | None]:
    """Pool of `workers` processes; None for one, which is this process.

    Under `python -m mpi4py.futures` it is the pool of all MPI processes instead, whatever `workers`
    says. Functions go to the processes by value where they cannot be imported.
    """
    real("workers", workers, positive=True, whole=True)
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
            except BaseException:  # nobody waits for what they do any more
                executor.shutdown(kill_workers=True)  # type: ignore[call-arg]
                raise


def _processes(workers: int) -> Executor:
    """Pool of processes of this machine that end when this process ends."""
    from joblib.externals.loky import ProcessPoolExecutor

    # loky's tracker of semaphores begins here and inherits what is blocked: it must outlive this
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, _GROUP_SIGNALS) if _GROUP_SIGNALS else None
    try:
        executor: Executor = ProcessPoolExecutor(
            workers, initializer=_end_with_parent, initargs=(os.getpid(),)
        )
    finally:
        if mask is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
    return executor


def _end_with_parent(parent: int) -> None:
    """End this process when its parent has ended: a killed campaign leaves no orphans."""
    from threading import Thread

    for number in (
        signal.SIGINT,
        *_GROUP_SIGNALS,
    ):  # which reach the whole group; the parent decides
        signal.signal(number, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            sleep(_PARENT_PERIOD)
        os._exit(1)

    Thread(target=watch, daemon=True).start()


def submitted(
    executor: Executor | None, function: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs
) -> Future[T]:
    """Future of a call by the executor; without one the call is made at once."""
    if executor is not None:
        return executor.submit(function, *args, **kwargs)
    done: Future[T] = Future()
    done.set_result(function(*args, **kwargs))
    return done


def completed(
    call: Call, tasks: Iterable[Task], executor: Executor | None
) -> Iterator[tuple[list[int], list[Outcome]]]:
    """Rows and outcomes of the tasks in the order in which they end.

    At most two batches for each slot of the executor are submitted at a time.

    Args:
        call: The function with the way it is called.
        tasks: Rows and points of each call; taken from the iterable only when there is room.
        executor: Any `concurrent.futures` executor; None runs here, one after the other.

    Raises:
        FailedError: A worker process died, or the function cannot be sent to one.
    """
    if executor is None:
        yield from ((rows, call(points)) for rows, points in tasks)
        return
    queue, size, most = iter(tasks), 1, 2 * slots(executor)
    waiting: dict[Future[tuple[list[list[Outcome]], float]], list[Task]] = {}
    try:
        while True:
            while len(waiting) < most and (batch := list(islice(queue, size))):
                waiting[executor.submit(_run, call, [points for _, points in batch])] = batch
            if not waiting:
                return
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                batch = waiting.pop(future)
                outcomes, seconds = _result(future, f" at or near {_sample_words(call, batch)}")
                size = int(
                    min(max(_BATCH_SECONDS * len(batch) / max(seconds, 1e-9), 1), _MAX_BATCH)
                )
                pairs = zip(batch, outcomes, strict=True)
                yield from ((rows, results) for (rows, _), results in pairs)
    finally:
        for future in waiting:
            future.cancel()


def _sample_words(call: Call, batch: list[Task]) -> str:
    """The first sample of a batch by its number and inputs, for messages."""
    rows, points = batch[0]
    first = np.atleast_2d(points)[0]
    values = ", ".join(f"{x} = {y:.6g}" for x, y in zip(call.names, first, strict=False))
    return f"sample {rows[0] + 1} ({values})"


def _run(call: Call, batch: list[Array]) -> tuple[list[list[Outcome]], float]:
    """Outcomes of a batch of calls, and the wall time that they took."""
    start = perf_counter()
    return [call(points) for points in batch], perf_counter() - start


def _result(future: Future[T], at: str = "") -> T:
    """Result of a batch; its calls raise nothing themselves.

    Args:
        future: The batch.
        at: Words on the samples that it computes, for the message.
    """
    try:
        return future.result()
    except Exception as error:
        what = f"the function or its outputs cannot be sent between processes: {error}"
        cure = "take workers=1, or a function that can be pickled"
        if isinstance(error, BrokenExecutor):
            what = f"a worker process died{at}"
            cure = "out of memory, or a crash in compiled code; what a store holds stays"
        raise FailedError(what, cure) from error


def slots(executor: Executor) -> int:
    """Calls that an executor runs at once; the number of cores where it does not say."""
    client = getattr(executor, "_client", None)  # dask
    if client is not None and (threads := sum(client.nthreads().values())):
        return int(threads)
    says = getattr(executor, "_max_workers", 0) or getattr(executor, "num_workers", 0)
    return int(says or os.cpu_count() or 1)
