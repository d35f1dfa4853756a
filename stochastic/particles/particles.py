"""Discs in a rectangle and spheres in a box, periodic or seen through an open window."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.stochastic.particles.shapes import DISCS, SPHERES, Shape


@dataclass(frozen=True, eq=False)
class Particles:
    """Discs in the rectangle [0, width] × [0, height], or spheres in a box.

    Args:
        centres: shape (n, 2) or (n, 3), in m, inside the rectangle or box.
        radii: shape (n,), in m, not negative.
        size: Sides of the rectangle or box, shape (2,) or (3,), in m.
        periodic: Whether it repeats itself; otherwise it is a window on a larger section.
    """

    centres: Array
    radii: Array
    size: Array
    periodic: bool = True

    def __post_init__(self) -> None:
        size = np.array(self.size, float)
        centres: Array = np.array(self.centres, float)
        if self.periodic:
            wrapped = np.mod(centres, size)
            centres = np.where(wrapped < size, wrapped, 0.0)
        radii = np.array(self.radii, float)
        for name, array in (("centres", centres), ("radii", radii), ("size", size)):
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.radii)

    @property
    def shape(self) -> Shape:
        """Kind of the particles."""
        return DISCS if len(self.size) == 2 else SPHERES

    @property
    def measure(self) -> float:
        """Area of the rectangle in m², or volume of the box in m³."""
        return float(self.size.prod())

    @property
    def fraction(self) -> float:
        """Measure of all particles over that of the rectangle or box."""
        return float(self.shape.measure(self.radii).sum() / self.measure)

    @property
    def spacing(self) -> float:
        """Side of the square or cube of one particle's share, in m."""
        return float((self.measure / len(self)) ** (1 / len(self.size)))

    def separation(self, first: Ints, second: Ints) -> Array:
        """Return vectors from centres `first` to the nearest images of `second`, (…, d), in m."""
        offset: Array = self.centres[second] - self.centres[first]
        return nearest_image(offset, self.size) if self.periodic else offset


def nearest_image(offset: Array, size: Array) -> Array:
    """Return vectors between centres (…, d) to the nearest image in a periodic box of `size`."""
    return np.asarray(offset - size * np.round(offset / size))


MAX_PAIRS = 3_000_000  # in a portion, so that it fits into memory


def size_classes(radii: Array) -> Iterator[Ints]:
    """Yield the indices of particles by class: radii of a class lie within a factor of two."""
    number = np.zeros(len(radii))
    largest = radii.max(initial=0.0)
    if largest > 0:
        number = np.floor(np.log2(np.maximum(radii, largest * 2.0**-20) / largest))
    for value in np.unique(number):
        yield np.flatnonzero(number == value)


def close_pairs(particles: Particles, gap: float) -> tuple[Ints, Ints]:
    """Return first and second index of unordered pairs with surfaces closer than `gap`, (m,) each.

    The gap is in m, 0 finds overlaps; particles are in a periodic box or a window.
    """
    box = particles.size if particles.periodic else None
    classes = list(size_classes(particles.radii))
    trees = [KDTree(particles.centres[members], boxsize=box) for members in classes]
    largest = [particles.radii[members].max() for members in classes]
    pairs = []
    for k, members in enumerate(classes):
        # within a class, then between it and each class before
        pairs.append(members[trees[k].query_pairs(2 * largest[k] + gap, output_type="ndarray")])
        for m in range(k):
            reach = largest[k] + largest[m] + gap
            near = trees[k].sparse_distance_matrix(trees[m], reach, output_type="ndarray")
            pairs.append(np.stack([members[near["i"]], classes[m][near["j"]]], axis=1))
    first, second = np.concatenate(pairs).T
    is_close = surface_distance(particles, first, second) < gap
    return first[is_close], second[is_close]


def surface_distance(particles: Particles, first: Ints, second: Ints) -> Array:
    """Distance between the surfaces of pairs (nearest image), negative where they overlap, in m."""
    distance = np.linalg.norm(particles.separation(first, second), axis=-1)
    return np.asarray(distance - particles.radii[first] - particles.radii[second])


def points_in_balls(tree: KDTree, centres: Array, reach: Array) -> tuple[Ints, Ints]:
    """Number of points in each ball, shape (n,), and indices of all points, ball after ball."""
    near = tree.query_ball_point(centres, reach, return_sorted=False)
    counts = np.fromiter(map(len, near), int, len(near))
    return counts, np.fromiter((k for ball in near for k in ball), int, counts.sum())


@dataclass(frozen=True)
class Pairs:
    """Ordered pairs (i, j) of discs, grouped by i, one for each periodic image of j.

    Args:
        first: i, shape (m,), rising.
        second: j, shape (m,).
        offset: Vector from the centre of i to that image of j, shape (m, 2), in m.
    """

    first: Ints
    second: Ints
    offset: Array

    def select(self, keep: Mask | Ints) -> Pairs:
        """The pairs of a mask, or of indices."""
        return Pairs(self.first[keep], self.second[keep], self.offset[keep])

    @staticmethod
    def join(parts: list[Pairs]) -> Pairs:
        """All pairs of `parts`, grouped by i again."""
        first = np.concatenate([part.first for part in parts])
        order = np.argsort(first, kind="stable")
        second = np.concatenate([part.second for part in parts])
        offset = np.concatenate([part.offset for part in parts])
        return Pairs(first[order], second[order], offset[order])


def pairs_within(discs: Particles, reach: Array) -> Iterator[tuple[Ints, Pairs]]:
    """Yield ordered pairs of disc i and periodic image of disc j with centres within reach_i.

    They come in portions of `MAX_PAIRS` pairs or so, with the indices i of each; `reach` is in m,
    shape (n,).
    """
    disc_of_image, shift = _periodic_images(discs, float(reach.max()))
    tree = KDTree(discs.centres[disc_of_image] + shift)
    n_pairs = tree.query_ball_point(discs.centres, reach, return_length=True)
    portion_number = np.cumsum(n_pairs) // MAX_PAIRS
    for value in np.unique(portion_number):
        portion = np.flatnonzero(portion_number == value)
        counts, images = points_in_balls(tree, discs.centres[portion], reach[portion])
        first, second = np.repeat(portion, counts), disc_of_image[images]
        # by the centres, so that the pair (j, i) has exactly the negative offset
        offset = discs.centres[second] - discs.centres[first] + shift[images]
        is_pair = (first != second) | (offset != 0).any(axis=1)
        yield portion, Pairs(first, second, offset).select(is_pair)


def _periodic_images(discs: Particles, margin: float) -> tuple[Ints, Array]:
    """Disc and shift of all periodic images within `margin` of the box, originals first."""
    originals = np.arange(len(discs), dtype=np.intp)
    indices: list[Ints] = [originals]
    shifts: list[Array] = [np.zeros((len(discs), 2))]
    tiles = np.ceil(margin / discs.size).astype(int) if discs.periodic else (0, 0)
    for tile in itertools.product(*(range(-number, number + 1) for number in tiles)):
        if not any(tile):  # the discs themselves
            continue
        image = discs.centres + discs.size * tile
        is_near = ((image > -margin) & (image < discs.size + margin)).all(axis=1)
        indices.append(originals[is_near])
        shifts.append(np.broadcast_to(discs.size * tile, (int(is_near.sum()), 2)))
    return np.concatenate(indices), np.concatenate(shifts)
