"""Work that MPI ranks share, and failures of one that all of them raise."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from mpi4py import MPI

S = TypeVar("S")
T = TypeVar("T")


@dataclass(frozen=True)
class Ranks:
    """The ranks of a communicator; None stands for a process by itself.

    All ranks call every method in the same order.
    """

    comm: MPI.Comm | None = None

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

    def first(self, function: Callable[[], T]) -> T:
        """What rank 0 finds, on every rank."""
        if self.comm is None:
            return function()
        with self.together():
            own = [function()] if self.comm.rank == 0 else []
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

        `progress` is called with the share done of this rank's; `costs` are about those of items.
        """
        own: list[T] = []
        owners = self._owners(costs or [1.0] * len(items))
        mine = [item for item, owner in zip(items, owners, strict=True) if owner == self.rank]
        with self.together():
            for item in mine:
                own.append(function(item))
                if progress:
                    progress(len(own) / len(mine))
        dealt = [iter(part) for part in self.all(own)]
        return [next(dealt[owner]) for owner in owners]

    def _owners(self, costs: Sequence[float]) -> list[int]:
        """Rank of each item: the dearest first, to the idlest; few items as evenly as can be."""
        if self.size == 2 and 2 < len(costs) < 10:
            deals = list(product((0, 1), repeat=len(costs)))
            return list(deals[int(np.abs(np.array(deals) @ costs - sum(costs) / 2).argmin())])
        owners, loads = [0] * len(costs), [0.0] * self.size
        for k in sorted(range(len(costs)), key=lambda k: -costs[k]):
            owners[k] = loads.index(min(loads))
            loads[owners[k]] += costs[k]
        return owners

    def all(self, own: T) -> list[T]:
        """What every rank has, known to all."""
        return self.comm.allgather(own) if self.comm else [own]

    def swap(self, pieces: list[T]) -> list[T]:
        """A piece for each rank turned into one from each."""
        if self.comm is None or self.size == 1:
            return pieces
        own = self.comm.rank
        sent = [None if k == own else piece for k, piece in enumerate(pieces)]
        return [pieces[k] if k == own else got for k, got in enumerate(self.comm.alltoall(sent))]

    @property
    def rank(self) -> int:
        """Number of this one."""
        return self.comm.rank if self.comm else 0

    @property
    def size(self) -> int:
        """Number of ranks."""
        return self.comm.size if self.comm else 1


ALONE = Ranks()
