"""Neighbour searches over discs of very different radii, in periodic and open rectangles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from alphacut.stochastic.particles.discs import Discs
from alphacut.stochastic.theta.truncated_normal import Array


@dataclass(frozen=True)
class Pairs:
    """Ordered pairs (i, j) of discs, grouped by i, one for each periodic image of j.

    Args:
        first: i, shape (m,), rising.
        second: j, shape (m,).
        apart: Vector from the centre of i to that image of j, shape (m, 2), in m.
    """

    first: Array
    second: Array
    apart: Array

    def where(self, keep: Array) -> Pairs:
        """The pairs that `keep` (mask or order) selects."""
        return Pairs(self.first[keep], self.second[keep], self.apart[keep])

    @staticmethod
    def join(parts: list[Pairs]) -> Pairs:
        """All pairs of `parts`, grouped by i again."""
        first = np.concatenate([part.first for part in parts])
        order = np.argsort(first, kind="stable")
        second = np.concatenate([part.second for part in parts])
        apart = np.concatenate([part.apart for part in parts])
        return Pairs(first[order], second[order], apart[order])


def size_classes(radii: Array) -> Iterator[Array]:
    """Indices of discs whose radii lie within a factor of two, class by class."""
    top = radii.max()
    level = (
        np.floor(np.log2(np.maximum(radii, top * 2.0**-20) / top))
        if top > 0
        else np.zeros_like(radii)
    )
    for value in np.unique(level):
        yield np.flatnonzero(level == value)


def nearest_in_each_class(discs: Discs, number: int, of: Array) -> Pairs:
    """The `number` nearest other centres of each size class, for each of the discs `of`."""
    from scipy.spatial import KDTree

    parts = []
    for members in size_classes(discs.radii):
        tree = KDTree(discs.centres[members], boxsize=discs.size if discs.periodic else None)
        wanted = min(number + 1, len(members))
        _, found = tree.query(discs.centres[of], k=np.arange(1, wanted + 1))
        first, second = np.repeat(of, wanted), members[found.ravel()]
        apart = first != second
        first, second = first[apart], second[apart]
        parts.append(Pairs(first, second, discs.separation(first, second)))
    return Pairs.join(parts)


def hidden_discs(discs: Discs, round_off: float) -> Array:
    """Mask of discs that lie inside another one, but for `round_off` (m), shape (n,)."""
    surroundings = Surroundings(discs, discs.radii.max() - discs.radii + round_off)
    hidden = np.zeros(len(discs), bool)
    for of in surroundings.portions():
        pairs = surroundings.pairs(of, round_off - discs.radii, closed=True)
        near = (
            np.hypot(pairs.apart[:, 0], pairs.apart[:, 1])
            + discs.radii[pairs.first]
            - discs.radii[pairs.second]
        )
        same = (
            np.abs(discs.radii[pairs.first] - discs.radii[pairs.second]) + np.hypot(*pairs.apart.T)
            <= round_off
        )
        inside = (
            (near <= round_off)
            & (pairs.first != pairs.second)
            & (~same | (pairs.second < pairs.first))
        )
        hidden[pairs.first[inside]] = True
    return hidden


class Surroundings:
    """Discs and their images, ready to be asked which come within reach of which.

    Args:
        discs: The discs.
        reach: Greatest reach of each disc that will be asked for, plus the largest radius where it
            is negative, shape (n,), in m.
    """

    def __init__(self, discs: Discs, reach: Array) -> None:
        from scipy.spatial import KDTree

        self.discs, self.reach = discs, reach
        self.classes = []
        for members in size_classes(discs.radii):
            largest = float(discs.radii[members].max())
            second, shift = _images(discs, members, float(reach.max()) + largest)
            self.classes.append((KDTree(discs.centres[second] + shift), second, shift, largest))

    def portions(self, most: int = 3_000_000) -> Iterator[Array]:
        """Indices of discs in portions of about `most` pairs within reach."""
        counts = np.zeros(len(self.discs))
        for tree, _, _, largest in self.classes:
            counts += tree.query_ball_point(
                self.discs.centres, np.maximum(self.reach + largest, 0), return_length=True
            )
        portion = np.floor(np.cumsum(counts) / most)
        for value in np.unique(portion):
            yield np.flatnonzero(portion == value)

    def pairs(self, of: Array, reach: Array, *, closed: bool = False) -> Pairs:
        """Pairs of discs i in `of` and images of j with |c_j − c_i| < reach_i + r_j (or ≤)."""
        discs, parts = self.discs, []
        for tree, second, shift, largest in self.classes:
            found = tree.query_ball_point(
                discs.centres[of],
                np.maximum(reach[of] + largest, 0) * (1 + 1e-12),
                return_sorted=False,
            )
            counts = np.fromiter(map(len, found), int, len(found))
            image = np.fromiter((k for one in found for k in one), int, counts.sum())
            first, other = np.repeat(of, counts), second[image]
            # the same, with its sign, seen from j
            apart = discs.centres[other] - discs.centres[first] + shift[image]
            distance, limit = np.hypot(apart[:, 0], apart[:, 1]), reach[first] + discs.radii[other]
            keep = ((distance <= limit) if closed else (distance < limit)) & (
                (first != other) | (distance > 0)
            )
            parts.append(Pairs(first[keep], other[keep], apart[keep]))
        return Pairs.join(parts)


def _images(discs: Discs, members: Array, margin: float) -> tuple[Array, Array]:
    """Indices of `members`, and shifts to all their images within `margin` of the rectangle."""
    if not discs.periodic:
        return members, np.zeros((len(members), 2))
    indices, shifts = [], []
    tiles = np.ceil(np.maximum(margin, 0) / discs.size).astype(int)
    for i in range(-tiles[0], tiles[0] + 1):
        for j in range(-tiles[1], tiles[1] + 1):
            image = discs.centres[members] + discs.size * (i, j)
            near = members[
                ((image > -margin) & (image < discs.size + margin)).all(axis=1) | (i == j == 0)
            ]
            indices.append(near)
            shifts.append(np.broadcast_to(discs.size * (i, j), (len(near), 2)))
    return np.concatenate(indices), np.concatenate(shifts)
