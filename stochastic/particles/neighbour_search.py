"""Neighbour searches over particles of very different radii, in periodic and open boxes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial import KDTree

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.stochastic.particles.particles import Particles


def size_classes(radii: Array) -> Iterator[Rows]:
    """Indices of particles whose radii lie within a factor of two, class by class."""
    level = np.zeros(len(radii))
    if (top := radii.max(initial=0.0)) > 0:
        level = np.floor(np.log2(np.maximum(radii, top * 2.0**-20) / top))
    for value in np.unique(level):
        yield np.flatnonzero(level == value)


def close_pairs(particles: Particles, gap: float) -> tuple[Rows, Rows]:
    """Unordered pairs (first, second), each of shape (m,), whose surfaces are within `gap` (m)."""
    box = particles.size if particles.periodic else None
    classes = list(size_classes(particles.radii))
    trees = [KDTree(particles.centres[members], boxsize=box) for members in classes]
    largest = [particles.radii[members].max() for members in classes]
    pairs = []
    for k, members in enumerate(classes):
        pairs.append(members[trees[k].query_pairs(2 * largest[k] + gap, output_type="ndarray")])
        for m in range(k):
            reach = largest[k] + largest[m] + gap
            near = trees[k].sparse_distance_matrix(trees[m], reach, output_type="ndarray")
            pairs.append(np.stack([members[near["i"]], classes[m][near["j"]]], axis=1))
    first, second = np.concatenate(pairs).T
    close = surface_distance(particles, first, second) < gap
    return first[close], second[close]


def surface_distance(particles: Particles, first: Rows, second: Rows) -> Array:
    """Distance between the surfaces of pairs (nearest image), negative where they overlap, in m."""
    distance = np.linalg.norm(particles.separation(first, second), axis=-1)
    return np.asarray(distance - particles.radii[first] - particles.radii[second])


def balls(tree: KDTree, centres: Array, reach: Array) -> tuple[Rows, Rows]:
    """Numbers of points in balls, shape (n,), and the points of all balls, one after the other."""
    near = tree.query_ball_point(centres, reach, return_sorted=False)
    counts = np.fromiter(map(len, near), int, len(near))
    return counts, np.fromiter((k for one in near for k in one), int, counts.sum())
