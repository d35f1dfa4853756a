"""Where samples run: in this process, in a pool of processes, or through any executor that the caller brings."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import contextmanager
from itertools import islice

from fuzzy.call import Call, Outcome
from fuzzy.numbers import Array

Task = tuple[list[int], Array]  # rows of the design, and their points
Done = tuple[list[int], list[Outcome]]


@contextmanager
def pool(workers: int) -> Iterator[Executor | None]:
    """A pool of `workers` processes, or None where one process does everything.

    The processes start afresh (no copy of this process's MPI or threads) and end with it, even when it is killed.

    Raises:
        ValueError: `workers` is below 1.
    """
    if workers < 1:
        raise ValueError(f"the number of workers is {workers}; it must be 1 or more")
    if workers == 1:
        yield None
        return
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    executor = ProcessPoolExecutor(workers, mp_context=get_context("forkserver"), initializer=_end_with_parent)
    try:
        yield executor
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _end_with_parent() -> None:
    """Watch the process that started this one, and leave when it is gone: a killed campaign leaves no orphans."""
    from multiprocessing import parent_process
    from multiprocessing.connection import wait as wait_for
    from threading import Thread

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
    waiting: dict[Future[list[Outcome]], list[int]] = {}
    room = 2 * _width(executor)
    try:
        while True:
            for rows, points in islice(queue, room - len(waiting)):
                waiting[executor.submit(call, points)] = rows
            if not waiting:
                return
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                yield waiting.pop(future), future.result()
    finally:
        for future in waiting:
            future.cancel()


def _width(executor: Executor) -> int:
    """How many calls the executor runs at once, as far as it says."""
    return int(getattr(executor, "_max_workers", 0) or getattr(executor, "num_workers", 0) or os.cpu_count() or 1)
