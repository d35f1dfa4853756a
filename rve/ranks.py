"""Work that MPI ranks share, and failures of one that all of them raise."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from sys import byteorder
from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from mpi4py import MPI

    from alphacut.stochastic.theta.truncated_normal import Array

S = TypeVar("S")
T = TypeVar("T")


@dataclass(frozen=True)
class Ranks:
    """The ranks of a communicator; None stands for a process by itself.

    All ranks call every method in the same order.
    """

    comm: MPI.Intracomm | None = None

    @contextmanager
    def together(self) -> Iterator[None]:
        """Raise on every rank what the block, free of communication, raises on any."""
        failure: Exception | None = None
        try:
            yield
        except (ArithmeticError, MemoryError, OSError, RuntimeError, ValueError) as error:
            failure = error
        for raised in self.all(failure):
            if raised is not None:
                raise raised

    def first(self, function: Callable[[], T], meanwhile: Callable[[], object] | None = None) -> T:
        """What rank 0 finds, on every rank; the others do something else `meanwhile`."""
        if self.comm is None:
            return function()
        with self.together():
            own = [function()] if self.comm.rank == 0 else []
            if not own and meanwhile:
                meanwhile()
        found: list[T] = self.comm.bcast(own)
        return found[0]

    def each(
        self,
        function: Callable[[S], T],
        items: Sequence[S],
        progress: Callable[[float], None] | None = None,
        costs: Sequence[float] | None = None,
    ) -> list[T]:
        """The function of every item, each computed on one rank and known to all.

        Ranks of one machine take the dearest that is left; others are dealt theirs beforehand.
        `progress` is called with the share of the items taken; `costs` are about those of items.
        """
        order = sorted(range(len(items)), key=lambda k: -costs[k] if costs else k)
        own: dict[int, T] = {}
        with self.together():
            for k in self._drawn(len(items)):
                own[order[k]] = function(items[order[k]])
                if progress:
                    progress((k + 1) / len(items))
        found = self._joined(own)
        return [found[k] for k in range(len(items))]

    def until(
        self,
        enough: Callable[[int, T], bool],
        function: Callable[[S], T],
        items: Sequence[S],
        progress: Callable[[float], None] | None = None,
    ) -> dict[int, T]:
        """The function of items in their order until that of some number is enough; known to all.

        Ranks of several machines, which cannot tell each other in time, compute one each.
        """
        own: dict[int, T] = {}
        counter = self._counter(len(items))
        with self.together():
            for k in self._drawn(len(items)):
                own[k] = function(items[k])
                if progress:
                    progress((k + 1) / len(items))
                if enough(k, own[k]) or (self.size > 1 and counter is None):
                    if counter is not None:
                        _count(counter, len(items))
                    break
        return self._joined(own)

    def _joined(self, own: dict[int, T]) -> dict[int, T]:
        return {k: one for part in self.all(own) for k, one in part.items()}

    def _counter(self, count: int) -> MPI.Win | None:
        """What numbers below `count` are drawn from, where that is worth while."""
        return _counter(self.comm.handle) if self.comm and count > self.size > 1 else None

    def _drawn(self, count: int) -> Iterator[int]:
        """Numbers below `count`, in rising order, each for the rank that asks first."""
        counter = self._counter(count)
        if self.comm is None or counter is None:
            yield from range(self.rank, count, self.size)
            return
        if self.rank == 0:
            counter.tomemory()[:] = self.size.to_bytes(8, byteorder)
        self.comm.Barrier()
        yield self.rank  # so the first ones go to the same ranks in every run
        while (number := _count(counter, 1)) < count:
            yield number

    def all(self, own: T) -> list[T]:
        """What every rank has, known to all."""
        return self.comm.allgather(own) if self.comm else [own]

    def swap(self, pieces: list[Array]) -> list[Array]:
        """Numbers for each rank turned into those from each; they go as they lie in memory."""
        if self.comm is None or self.size == 1:
            return pieces
        shapes, own = self.comm.alltoall([piece.shape for piece in pieces]), self.rank
        found = [pieces[own] if k == own else np.empty(shape) for k, shape in enumerate(shapes)]
        coming = [self.comm.Irecv(array, k) for k, array in enumerate(found) if k != own]
        for k in set(range(self.size)) - {own}:
            self.comm.Send(np.ascontiguousarray(pieces[k]), k)
        for one in coming:
            one.Wait()
        return found

    @property
    def rank(self) -> int:
        """Number of this one."""
        return self.comm.rank if self.comm else 0

    @property
    def size(self) -> int:
        """Number of ranks."""
        return self.comm.size if self.comm else 1


def _count(counter: MPI.Win, step: int) -> int:
    """The number, which is a step further from now on."""
    number = np.zeros(1, np.int64)
    counter.Lock(0)
    counter.Fetch_and_op(np.full(1, step), number, 0)
    counter.Unlock(0)
    return int(number[0])


@cache
def _counter(handle: int) -> MPI.Win | None:
    """A number that ranks of one machine count up; None on several machines."""
    from mpi4py import MPI

    comm = MPI.Intracomm.fromhandle(handle)
    near = comm.Split_type(MPI.COMM_TYPE_SHARED)
    if near.size < comm.size or not isinstance(near, MPI.Intracomm):
        return None
    return MPI.Win.Allocate_shared(8 if near.rank == 0 else 0, 8, comm=near)


ALONE = Ranks()
