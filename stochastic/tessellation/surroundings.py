"""Discs and their images within reach of each other, in periodic and open rectangles."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from alphacut.fuzzy.arrays import Array, Mask, Rows
from alphacut.stochastic.particles.neighbour_search import balls
from alphacut.stochastic.particles.particles import Particles

MOST = 3_000_000  # pairs in a portion


@dataclass(frozen=True)
class Pairs:
    """Ordered pairs (i, j) of discs, grouped by i, one for each periodic image of j.

    Args:
        first: i, shape (m,), rising.
        second: j, shape (m,).
        apart: Vector from the centre of i to that image of j, shape (m, 2), in m.
    """

    first: Rows
    second: Rows
    apart: Array

    def where(self, keep: Mask) -> Pairs:
        """The pairs that a mask selects."""
        return Pairs(self.first[keep], self.second[keep], self.apart[keep])

    @staticmethod
    def join(parts: list[Pairs]) -> Pairs:
        """All pairs of `parts`, grouped by i again."""
        first = np.concatenate([part.first for part in parts])
        order = np.argsort(first, kind="stable")
        second = np.concatenate([part.second for part in parts])
        apart = np.concatenate([part.apart for part in parts])
        return Pairs(first[order], second[order], apart[order])


def pairs_within(discs: Particles, of: Rows, reach: Array) -> Iterator[tuple[Rows, Pairs]]:
    """Pairs of discs i in `of` and images of j with |c_j − c_i| < reach_i, in portions of i.

    Args:
        discs: The discs.
        of: Indices i, shape (k,).
        reach: Distance, shape (k,), in m.
    """
    image, shift = _images(discs, float(reach.max()))
    places = discs.centres[image] + shift
    tree = KDTree(places)
    number = tree.query_ball_point(discs.centres[of], reach, return_length=True)
    portion = np.cumsum(number) // MOST
    for value in np.unique(portion):
        part = of[portion == value]
        counts, near = balls(tree, discs.centres[part], reach[portion == value])
        first, second = np.repeat(part, counts), image[near]
        # the same, with its sign, seen from j
        apart = discs.centres[second] - discs.centres[first] + shift[near]
        keep = (first != second) | (apart != 0).any(axis=1)
        yield part, Pairs(first, second, apart).where(keep)


def _images(discs: Particles, margin: float) -> tuple[Rows, Array]:
    """Indices of all discs, and shifts to all their images within `margin` of the rectangle."""
    every = np.arange(len(discs), dtype=np.intp)
    indices: list[Rows] = [every]
    shifts: list[Array] = [np.zeros((len(discs), 2))]
    tiles = np.ceil(margin / discs.size).astype(int) if discs.periodic else (0, 0)
    for tile in itertools.product(*(range(-number, number + 1) for number in tiles)):
        image = discs.centres + discs.size * tile
        near = ((image > -margin) & (image < discs.size + margin)).all(axis=1) & any(tile)
        indices.append(every[near])
        shifts.append(np.broadcast_to(discs.size * tile, (int(near.sum()), 2)))
    return np.concatenate(indices), np.concatenate(shifts)
