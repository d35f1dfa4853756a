"""Elimination of the periodic constraints from the product-space system: K_per = Pᵀ K P.

P only renumbers: every node becomes one unknown pair or none. So it needs no matrix product;
element matrices are added where they belong.

Unknowns are numbered level by level: all planar unknowns of level 0, the vertex unknowns half-way
to level 1, those of level 1, and so on; two displacement components each. On several ranks each
owns whole levels; where there are more ranks than levels, several own parts of one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from alphacut.rve.mesh.periodicity import Periodicity
from alphacut.rve.mesh.prism_grid import PrismGrid
from alphacut.rve.mesh.triangulation import Integers
from alphacut.rve.petsc import PETSc, zero_matrix
from alphacut.rve.ranks import Ranks
from alphacut.rve.solver.c_loops import WEDGES, c_loops
from alphacut.stochastic.theta.truncated_normal import Array


@dataclass(frozen=True)
class LevelShare:
    """The levels of one rank, and its part of them.

    Args:
        levels: With a level goes what lies between it and the next.
        part: Number of this rank among those of the same levels.
        parts: Number of those.
    """

    levels: range
    part: int = 0
    parts: int = 1

    def of(self, numbers: range, multiple: int = 1) -> range:
        """The rank's part of what belongs to its levels, bounds being multiples of a number."""
        bounds = [len(numbers) // multiple * k // self.parts for k in (self.part, self.part + 1)]
        return range(*(numbers.start + multiple * bound for bound in bounds))


class Overlap:
    """Rows of vectors that each rank owns, and those that it works on.

    Args:
        ranks: The ranks.
        owned: For each rank, in rising order.
        wanted: For each rank; they may overlap.
        shares: Where ranks of the same levels part the columns among them: the parts.
    """

    def __init__(
        self,
        ranks: Ranks,
        owned: Sequence[range],
        wanted: Sequence[range],
        shares: Sequence[LevelShare] = (),
    ) -> None:
        self.ranks, self.owned, self.wanted = ranks, owned, wanted
        self.shares = shares or [LevelShare(range(0))] * ranks.size

    @property
    def own(self) -> range:
        """Rows that this rank owns."""
        return self.owned[self.ranks.rank]

    @property
    def works(self) -> range:
        """Rows that this rank works on."""
        return self.wanted[self.ranks.rank]

    @property
    def start(self) -> int:
        """The first of them."""
        return self.works.start

    def columns(self, rank: int, count: int) -> slice:
        """Columns that a rank works on, of so many."""
        part = self.shares[rank].of(range(count))
        return slice(part.start, part.stop)

    def fetch(self, own: Array) -> Array:
        """The rows and columns to work on from those owned, shape (rows, columns)."""
        if self.ranks.size == 1:
            return own
        columns = own.shape[1]
        pieces = [
            own[_common(self.own, rows), self.columns(k, columns)]
            for k, rows in enumerate(self.wanted)
        ]
        return np.concatenate(self.ranks.swap(pieces))

    def give(self, worked: Array, columns: int) -> Array:
        """The rows owned, `columns` wide, as sums of those that were worked on."""
        if self.ranks.size == 1:
            return worked
        total, wanted = np.zeros((len(self.own), columns)), self.works
        pieces = [worked[_common(wanted, rows)] for rows in self.owned]
        for k, piece in enumerate(self.ranks.swap(pieces)):
            total[_common(self.own, self.wanted[k]), self.columns(k, columns)] += piece
        return total


def _common(own: range, other: range) -> slice:
    """Places in `own` of the numbers that both have."""
    start, stop = max(own.start, other.start), min(own.stop, other.stop)
    return slice(start - own.start, max(start, stop) - own.start)


@dataclass(frozen=True)
class LevelNumbering:
    """Positions of the unknowns of each level.

    Args:
        grid: Topology; all levels count, but nodes are those of its span.
        periodicity: Unknowns of one level.
    """

    grid: PrismGrid
    periodicity: Periodicity

    @property
    def stride(self) -> int:
        """Unknowns from one level to the next."""
        return 2 * (self.periodicity.count + self.periodicity.vertices)

    @property
    def size(self) -> int:
        """Unknowns in all."""
        return self.grid.layers * self.stride + 2 * self.periodicity.count

    @cached_property
    def unknown_of_node(self) -> Integers:
        """First of the two unknowns of each grid node, −1 on the fixed line, shape (nodes,)."""
        span = self.grid.span
        planar = self.periodicity.unknown
        vertices = self.periodicity.unknown[: self.grid.plane.vertices]
        level, middle = (np.arange(span.start, span.stop + 1)[:, None], np.array(span)[:, None])
        full = np.where(planar >= 0, 2 * planar + level * self.stride, -1)
        half = np.where(
            vertices >= 0, 2 * (vertices + self.periodicity.count) + middle * self.stride, -1
        )
        return np.concatenate([full.ravel(), half.ravel()])

    def shares(self, ranks: int) -> list[LevelShare]:
        """Levels of so many ranks; several share one where there are more ranks than levels."""
        layers, levels = self.grid.layers, self.grid.layers + 1
        if ranks <= levels:
            first = [-(-layers * rank // ranks) for rank in range(ranks)] + [levels]
            return [LevelShare(range(*pair)) for pair in pairwise(first)]
        level = [rank * levels // ranks for rank in range(ranks)]
        return [
            LevelShare(range(k, k + 1), rank - level.index(k), level.count(k))
            for rank, k in enumerate(level)
        ]

    def rows(self, levels: range) -> range:
        """Unknowns of levels, and of what lies between each and the next."""
        return range(levels.start * self.stride, min(levels.stop * self.stride, self.size))

    def owned(self, ranks: int) -> list[range]:
        """Unknowns of each of so many ranks."""
        return [share.of(self.rows(share.levels), 2) for share in self.shares(ranks)]

    def beside(self, levels: range) -> range:
        """Unknowns of levels, and of what lies below and above each."""
        below = 2 * self.periodicity.vertices if levels.start else 0
        return range(levels.start * self.stride - below, self.rows(levels).stop)

    def on_levels(self, count: int, ranks: Ranks, wanted: Sequence[range] = ()) -> Overlap:
        """So many unknowns of every level, owned as displacements are.

        Args:
            count: Of a level.
            ranks: The ranks.
            wanted: Levels that each works on; none: its own, and its part of the columns.
        """
        shares = self.shares(ranks.size)
        own = [range(s.levels.start * count, s.levels.stop * count) for s in shares]
        works = [range(part.start * count, part.stop * count) for part in wanted] or own
        owned = [share.of(rows) for share, rows in zip(shares, own, strict=True)]
        return Overlap(ranks, owned, works, () if wanted else shares)

    def near(self, levels: range) -> PrismGrid:
        """The wedges below and above levels."""
        triangles = len(self.grid.plane.triangles)
        first, last = max(levels.start - 1, 0), min(levels.stop, self.grid.layers)
        wedges = range(first * triangles, last * triangles)
        return self.grid if wedges == self.grid.own else replace(self.grid, wedges=wedges)

    def span_of(self, around: range) -> range:
        """Layers of unknowns that are `around` wedges."""
        return range(around.start // self.stride, around.stop // self.stride)

    def around(self, wedges: range) -> range:
        """Unknowns of the layers that wedges lie in."""
        span = replace(self.grid, wedges=wedges).span
        last = span.stop * self.stride + 2 * self.periodicity.count
        return range(span.start * self.stride, last)

    @cached_property
    def pairs(self) -> NDArray[np.int32]:
        """Unknown pair of each node of the wedges, −1 on the fixed line, shape (wedges, 15)."""
        return (self.unknown_of_node[self.grid.cells] // 2).astype(np.int32)

    def around_rows(self, ranks: Ranks) -> LevelNumbering:
        """The same of the wedges around this rank's rows."""
        near = self.near(self.shares(ranks.size)[ranks.rank].levels)
        return self if near is self.grid else replace(self, grid=near)

    def matrix(self, ranks: Ranks) -> tuple[PETSc.Mat, NDArray[np.int32]]:
        """Zero matrix in 2 × 2 blocks that keeps this rank's rows of Pᵀ K P of element matrices.

        With the places of the blocks of the wedges, all of which lie around those rows, shape
        (wedges, 15, 15): n in the part whose columns this rank owns too, −2 − n in the other, −1
        where a node is fixed or the row another rank's.
        """
        own, pairs = self.owned(ranks.size)[ranks.rank], self.pairs
        starts, columns = (
            [np.empty(size, np.int32) for _ in range(2)]
            for size in (len(own) // 2 + 1, 15 * pairs.size)
        )
        places = np.empty((*pairs.shape, 15), np.int32)
        if c_loops(WEDGES).couple(
            len(pairs), pairs.ctypes, own.start // 2, own.stop // 2, self.size // 2,
            starts[0].ctypes, columns[0].ctypes, starts[1].ctypes, columns[1].ctypes, places.ctypes,
        ):  # fmt: skip
            raise MemoryError("no memory is left for the matrix")
        return zero_matrix(starts, columns, self.size, 2, ranks), places

    def to_nodes(self, values: Array, start: int) -> Array:
        """Displacements of the nodes, zero on the line, shape (nodes, 2, columns).

        Args:
            values: Solutions from the unknown `start` on, shape (unknowns, columns).
            start: The first unknown of the nodes' levels.
        """
        first = self.unknown_of_node
        found = values[np.maximum(first - start, 0)[:, None] + np.arange(2)]
        return np.where(first[:, None, None] >= 0, found, 0.0)
