"""Discs in a rectangle and spheres in a box, periodic or seen through an open window."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.stochastic.particles.shapes import DISCS, SPHERES, Shape

if TYPE_CHECKING:
    from scipy.spatial import KDTree


@dataclass(frozen=True, eq=False)
class Particles:
    """Discs in the rectangle [0, width] × [0, height], or spheres in a box.

    Args:
        centres: Centres in m, shape (n, 2) or (n, 3), inside the rectangle or box; in a periodic
            one they are moved there.
        radii: Radii in m, shape (n,), not negative.
        size: Sides of the rectangle or box, shape (2,) or (3,), in m.
        periodic: Whether it repeats itself; otherwise it is a window on a larger section.
    """

    centres: Array
    radii: Array
    size: Array
    periodic: bool = True

    def __post_init__(self) -> None:
        """Copy the arrays as floats, and move centres into a periodic box.

        Shapes and values are not checked.
        """
        size = np.array(self.size, float)
        centres: Array = np.array(self.centres, float)
        if self.periodic:
            wrapped = np.mod(centres, size)
            centres = np.where(wrapped < size, wrapped, 0.0)  # rounding may give `size` itself
        object.__setattr__(self, "centres", centres)
        object.__setattr__(self, "radii", np.array(self.radii, float))
        object.__setattr__(self, "size", size)

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
        """Fraction of the rectangle or box that the particles take."""
        return float(self.shape.measure(self.radii).sum() / self.measure)

    @property
    def spacing(self) -> float:
        """Side of a square or cube as large as the mean cell of a particle, in m."""
        return float((self.measure / len(self)) ** (1 / len(self.size)))

    def separation(self, first: Ints, second: Ints) -> Array:
        """Return vectors from centres `first` to the nearest images of `second`, (…, d), in m.

        In a window they go to the centres themselves.
        """
        offset: Array = self.centres[second] - self.centres[first]
        return nearest_image(offset, self.size) if self.periodic else offset


def nearest_image(offset: Array, size: Array) -> Array:
    """Return vectors between centres to the nearest image in a periodic box.

    At half a side, where two images are equally near, one of them is taken.

    Args:
        offset: Vectors to any image in m, shape (…, d).
        size: Sides of the box in m, shape (d,).

    Returns:
        Vectors in m, in the shape of `offset`.
    """
    return np.asarray(offset - size * np.round(offset / size))


def size_classes(radii: Array) -> Iterator[Ints]:
    """Yield the indices of particles by class: radii of a class lie within a factor of two.

    Radii below 2⁻²⁰ (about 1e-6) of the largest one are all in one class. Each index comes once.

    Args:
        radii: Radii, not negative, shape (n,).
    """
    number = np.zeros(len(radii))
    largest = radii.max(initial=0.0)
    if largest > 0:
        # A single search for all sizes would look as far as the largest radius from every particle.
        number = np.floor(np.log2(np.maximum(radii, largest * 2.0**-20) / largest))
    for value in np.unique(number):
        yield np.flatnonzero(number == value)


def close_pairs(particles: Particles, gap: float) -> tuple[Ints, Ints]:
    """Return the unordered pairs of particles whose surfaces are closer than a gap.

    Args:
        particles: Particles in a periodic box or a window, at least one. In a box only the nearest
            images of a pair count.
        gap: The gap in m; 0 finds overlaps, without particles that just touch.

    Returns:
        First and second index of each pair, shape (m,) each; each pair once, in no certain order.
    """
    from scipy.spatial import KDTree  # takes time to import

    box = particles.size if particles.periodic else None
    classes = list(size_classes(particles.radii))
    trees = [KDTree(particles.centres[members], boxsize=box) for members in classes]
    largest = [particles.radii[members].max() for members in classes]
    pairs = []
    for k, members in enumerate(classes):
        # Pairs within the class, and then pairs with each class before
        pairs.append(members[trees[k].query_pairs(2 * largest[k] + gap, output_type="ndarray")])
        for m in range(k):
            reach = largest[k] + largest[m] + gap
            near = trees[k].sparse_distance_matrix(trees[m], reach, output_type="ndarray")
            pairs.append(np.stack([members[near["i"]], classes[m][near["j"]]], axis=1))
    first, second = np.concatenate(pairs).T
    is_close = surface_distance(particles, first, second) < gap
    return first[is_close], second[is_close]


def surface_distance(particles: Particles, first: Ints, second: Ints) -> Array:
    """Return the distance between the surfaces of pairs, in m, shape (m,).

    It is negative where they overlap. In a periodic box the nearest image of the second particle
    counts.

    Args:
        particles: The particles.
        first: Index of the first particle of each pair, shape (m,).
        second: Index of the second particle of each pair, shape (m,).
    """
    distance = np.linalg.norm(particles.separation(first, second), axis=-1)
    return np.asarray(distance - particles.radii[first] - particles.radii[second])


def points_in_balls(tree: KDTree, centres: Array, reach: Array) -> tuple[Ints, Ints]:
    """Return the points of a tree that lie in some balls, their surfaces included.

    Args:
        tree: The points.
        centres: Centres of the balls, shape (n, d).
        reach: Radii of the balls, shape (n,).

    Returns:
        Number of points in each ball, shape (n,), and the indices of all points, ball after ball,
        in no certain order within one.
    """
    near = tree.query_ball_point(centres, reach, return_sorted=False)
    counts = np.array([len(ball) for ball in near], int)
    return counts, np.array(list(itertools.chain.from_iterable(near)), int)


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
        """Return the pairs of a mask, or of indices."""
        return Pairs(self.first[keep], self.second[keep], self.offset[keep])

    def joined(self, other: Pairs) -> Pairs:
        """Return the pairs of both, grouped by their first disc again.

        A pair is a disc, a second disc or its image, and the vector between the centres. Among the
        pairs of one first disc those of `self` come first.
        """
        both = Pairs(
            first=np.concatenate([self.first, other.first]),
            second=np.concatenate([self.second, other.second]),
            offset=np.concatenate([self.offset, other.offset]),
        )
        return both.select(np.argsort(both.first, kind="stable"))


def pairs_within(discs: Particles, reach: Array) -> Iterator[tuple[Ints, Pairs]]:
    """Yield ordered pairs of disc i and periodic image of disc j with centres within reach_i.

    They come in portions of some three million pairs, which fit into memory. A disc is paired with
    its own images too, but not with itself. In a window there are no images.

    Args:
        discs: The discs, at least one.
        reach: Largest distance of the centres for each i, in m, shape (n,).

    Yields:
        The indices i of a portion, and its pairs, grouped by i, with the vectors between the
        centres.
    """
    from scipy.spatial import KDTree  # takes time to import

    # Each image is a point of the tree. A periodic tree would find only the nearest image of each
    # disc, but cells of few large discs have walls towards several images of one disc.
    disc_of_image, shift = _periodic_images(discs, float(reach.max()))
    tree = KDTree(discs.centres[disc_of_image] + shift)
    n_pairs = tree.query_ball_point(discs.centres, reach, return_length=True)
    portion_number = np.cumsum(n_pairs) // 3_000_000
    for value in np.unique(portion_number):
        portion = np.flatnonzero(portion_number == value)
        counts, images = points_in_balls(tree, discs.centres[portion], reach[portion])
        first = np.repeat(portion, counts)
        second = disc_of_image[images]
        # In this order of terms the pair (j, i) has exactly the negative offset.
        offset = discs.centres[second] - discs.centres[first] + shift[images]
        is_pair = (first != second) | (offset != 0).any(axis=1)
        yield portion, Pairs(first, second, offset).select(is_pair)


def _periodic_images(discs: Particles, margin: float) -> tuple[Ints, Array]:
    """Return all periodic images whose centres are within `margin` of the box, originals first.

    A window has the originals alone.

    Args:
        discs: The discs in their box, n of them.
        margin: Distance from the box in m, along each side.

    Returns:
        Index of the disc of each image, shape (k,), and its shift from the disc in m, shape (k, 2),
        which is 0 in the first n rows.
    """
    originals = np.arange(len(discs), dtype=np.intp)
    indices: list[Ints] = [originals]
    shifts: list[Array] = [np.zeros((len(discs), 2))]
    n_tiles = np.ceil(margin / discs.size).astype(int) if discs.periodic else np.zeros(2, int)
    tiles_along_sides = [range(-count, count + 1) for count in n_tiles]
    for tile in itertools.product(*tiles_along_sides):
        if not any(tile):  # the discs themselves
            continue
        shift = discs.size * tile
        image = discs.centres + shift
        # Farther images are out of reach of every disc in the box.
        is_near = ((image > -margin) & (image < discs.size + margin)).all(axis=1)
        indices.append(originals[is_near])
        shifts.append(np.broadcast_to(shift, (int(is_near.sum()), 2)))
    return np.concatenate(indices), np.concatenate(shifts)
