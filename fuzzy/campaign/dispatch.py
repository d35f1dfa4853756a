"""Dispatch of calls to an executor: enough to keep all of it busy, quick ones in batches."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass, field
from itertools import islice
from time import perf_counter

from alphacut.fuzzy.campaign.call import Call, Failure, Outcome
from alphacut.fuzzy.campaign.workers import ProcessPool
from alphacut.fuzzy.sets.numbers import Array

Task = tuple[list[int], Array]  # rows of the design, and their points
Done = tuple[list[int], list[Outcome]]

_ENOUGH = 0.1  # seconds of work in a batch of quick calls
_LIMIT = 1.0  # seconds after which a batch hands back the calls that it has not begun
_LARGEST = 1024  # calls in a batch
_BUSY = 0.75  # share of the batches at the executor that run at once: it may have free slots


def completed(call: Call, tasks: Iterable[Task], executor: Executor | None) -> Iterator[Done]:
    """Run the tasks and yield each as it ends, with no more at the executor than keep it busy.

    Args:
        call: The function with the way it is called.
        tasks: Rows and points of each call; taken from the iterable only when there is room.
        executor: Any `concurrent.futures` executor; None runs here, one after the other.
    """
    if executor is None:
        for rows, points in tasks:
            yield rows, call(points)
        return
    load, back, queue = _Load(2 * slots(executor)), deque[Task](), iter(tasks)
    waiting: dict[Future[list[list[Outcome]]], list[Task]] = {}
    try:
        while True:
            while len(waiting) < load.room and (batch := _next(back, queue, load.size)):
                waiting[executor.submit(run, call, [points for _, points in batch])] = batch
            if not waiting:
                return
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                batch = waiting.pop(future)
                outcomes = _outcomes(future, executor, call, [points for _, points in batch])
                back.extend(batch[len(outcomes) :])
                load.note(outcomes)
                yield from ((rows, one) for (rows, _), one in zip(batch, outcomes, strict=False))
    finally:
        for future in waiting:
            future.cancel()


def _next(back: deque[Task], queue: Iterator[Task], count: int) -> list[Task]:
    """The next tasks: those handed back first."""
    batch = [back.popleft() for _ in range(min(count, len(back)))]
    return batch + list(islice(queue, count - len(batch)))


def run(call: Call, batch: Sequence[Array]) -> list[list[Outcome]]:
    """Outcomes of the first calls of a batch: one at least, and what a second or so allows."""
    start, outcomes = perf_counter(), []
    for points in batch:
        outcomes.append(call(points))
        if perf_counter() - start > _LIMIT:
            break
    return outcomes


@dataclass
class _Load:
    """Number of batches at an executor, and of calls in each.

    What runs at once is, by Little's law, the calls' own time over the time that passes. Where
    nearly all that is at the executor runs at once, it may have free slots: it gets twice as much.

    Args:
        room: Batches at the executor.
        size: Calls in a batch.
    """

    room: int
    size: int = 1
    _work: float = 0.0
    _batches: int = 0
    _since: float = field(default_factory=perf_counter)

    def note(self, batch: Sequence[Sequence[Outcome]]) -> None:
        """Learn from a batch that has ended."""
        seconds = sum(outcome.seconds for outcomes in batch for outcome in outcomes)
        self.size = int(min(max(_ENOUGH * len(batch) / max(seconds, 1e-9), 1), _LARGEST))
        self._work += seconds
        self._batches += 1
        if self._batches >= 2 * self.room:
            now = perf_counter()
            if self._work > _BUSY * self.room * (now - self._since):
                self.room *= 2
            self._work, self._batches, self._since = 0.0, 0, now


def _outcomes(
    future: Future[list[list[Outcome]]], executor: Executor, call: Call, batch: Sequence[Array]
) -> list[list[Outcome]]:
    """Outcomes of the first calls of a batch, run again by itself if its process died."""
    try:
        return future.result()
    except BrokenExecutor:
        if isinstance(executor, ProcessPool):
            return _salvaged(executor, call, batch)
        raise
    except Exception as error:  # a call raises nothing itself
        if len(batch) > 1:
            half = batch[: len(batch) // 2]
            return _outcomes(executor.submit(run, call, half), executor, call, half)
        failure = (
            f"the function or its outputs cannot be sent between processes ({type(error).__name__}:"
            f" {error})"
        )
        return [[Failure(failure)] * len(batch[0])]


def _salvaged(executor: ProcessPool, call: Call, batch: Sequence[Array]) -> list[list[Outcome]]:
    """Outcomes of the first calls of a batch that ended its process, each part in its own."""
    try:
        return executor.alone(run, call, batch)
    except BrokenExecutor:
        if len(batch) > 1:
            return _salvaged(executor, call, batch[: len(batch) // 2])
        if len(batch[0]) > 1:
            return [[_salvaged(executor, call, [point[None]])[0][0] for point in batch[0]]]
    died = "the process that ran it died: out of memory, or a crash in compiled code"
    return [[Failure(died)]]


def slots(executor: Executor) -> int:
    """Number of calls that an executor runs at once as far as it says, else the cores here."""
    client = getattr(executor, "_client", None)  # dask
    if client is not None and (threads := sum(client.nthreads().values())):
        return int(threads)
    return int(
        getattr(executor, "_max_workers", 0)
        or getattr(executor, "num_workers", 0)
        or os.cpu_count()
        or 1
    )
