"""Boxes still open in the branch and bound, each shared by all problems that need it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from alphacut.frame.calculus.jet import Array

FACES = 16
"""Codes from here on confine an item to faces, as those of `kernel`."""
LOWER, UPPER = -1, -2
"""Places of an axis that is confined to an end of the domain."""


@dataclass(frozen=True, eq=False)
class Frontier:
    """Open items by box, node and column.

    Along each axis a box is a dyadic interval of the domain, 2^depth + index, or one of its ends,
    `LOWER` or `UPPER`.

    Args:
        place: Intervals of the boxes, shape (B, d).
        box: Box of each item, rising, shape (I,).
        problem: Number of its problem, rising for each box, shape (I,).
    """

    place: Array
    box: Array
    problem: Array

    @classmethod
    def whole(cls, d: int, problems: Array) -> Frontier:
        """The domain for all `problems` (N,)."""
        return cls(np.ones((1, d), np.int64), np.zeros(len(problems), np.int64), problems)

    def __len__(self) -> int:
        return len(self.box)

    def geometry(
        self, lower: Array, upper: Array, boxes: slice = slice(None)
    ) -> tuple[Array, Array, Array]:
        """Centres and radii (B, d) in the domain, and which faces are its own (B, 2, d)."""
        place = self.place[boxes]
        inner = np.maximum(place, 1)
        width = 2.0 ** -np.floor(np.log2(inner + 0.5))  # share of the domain
        begin = inner * width - 1
        ends = [place == LOWER, place == UPPER]
        share = np.select(ends, [0.0, 1.0], begin + width / 2)
        radius = np.where(place < 0, 0.0, (upper - lower) / 2 * width)
        return (
            lower + (upper - lower) * share,
            radius,
            np.stack([begin == 0, begin + width == 1], 1),
        )

    def pieces(self, most: int) -> Iterator[tuple[slice, slice]]:
        """Boxes and items in parts of about `most` items, box by box."""
        ends = np.append(np.searchsorted(self.box, np.arange(len(self.place))), len(self))
        start = 0
        while start < len(self.place):
            stop = int(np.searchsorted(ends, ends[start] + most, "right")) - 1
            stop = min(max(stop, start + 1), len(self.place))
            yield slice(start, stop), slice(int(ends[start]), int(ends[stop]))
            start = stop

    def children(self, code: Array) -> Frontier:
        """Boxes and items that the examination's codes (I,) leave open."""
        d = self.place.shape[1]
        split, faced = np.flatnonzero((code > 0) & (code < FACES)), np.flatnonzero(code >= FACES)
        count, box = 2 * d + 3**d, self.box[split]
        votes = np.bincount(box * d + code[split] - 1, minlength=d * len(self.place))
        halves = box * count + 2 * votes.reshape(-1, d).argmax(1)[box]
        faces = self.box[faced] * count + 2 * d + code[faced] - FACES
        keys = np.concatenate([halves, halves + 1, faces])
        problem = self.problem[np.concatenate([split, split, faced])]
        fresh = np.unique(keys)
        place, merged = _distinct(self._places(fresh, count))
        most = int(problem.max(initial=0)) + 1
        items = np.unique(merged[np.searchsorted(fresh, keys)] * most + problem)
        return Frontier(place, *np.divmod(items, most))

    def _places(self, keys: Array, count: int) -> Array:
        """Intervals of the children with these keys, shape (K, d)."""
        d = self.place.shape[1]
        place: Array = self.place[keys // count].copy()
        local = keys % count
        rows = np.flatnonzero(local < 2 * d)
        axis, half = np.divmod(local[rows], 2)
        place[rows, axis] = 2 * place[rows, axis] + half
        rows = np.flatnonzero(local >= 2 * d)
        ternary = (local[rows, None] - 2 * d) // 3 ** np.arange(d) % 3
        place[rows] = np.select([ternary == 1, ternary == 2], [LOWER, UPPER], place[rows])
        return np.asarray(place)


def _distinct(rows: Array) -> tuple[Array, Array]:
    """Distinct rows (B, d) of integers, rising, and which of them each row is, as `np.unique`."""
    order = np.lexsort(rows.T[::-1])
    fresh = np.any(np.diff(rows[order], axis=0, prepend=-3), axis=1)
    number = np.empty(len(rows), np.int64)
    number[order] = np.cumsum(fresh) - 1
    return rows[order][fresh], number
