"""Pairs of discs that nearly touch."""

from __future__ import annotations

import numpy as np

from alphacut.stochastic.particles.discs import Discs
from alphacut.stochastic.particles.neighbour_search import size_classes
from alphacut.stochastic.theta.truncated_normal import Array


def close_pairs(discs: Discs, gap: float) -> tuple[Array, Array]:
    """Unordered pairs (first, second), each of shape (m,), whose surfaces are within `gap` (m)."""
    from scipy.spatial import cKDTree

    box = discs.size if discs.periodic else None
    classes = list(size_classes(discs.radii))
    trees = [cKDTree(discs.centres[members], boxsize=box) for members in classes]
    largest = [discs.radii[members].max() for members in classes]
    found = []
    for k, members in enumerate(classes):
        found.append(members[trees[k].query_pairs(2 * largest[k] + gap, output_type="ndarray")])
        for m in range(k):
            near = trees[k].sparse_distance_matrix(
                trees[m], largest[k] + largest[m] + gap, output_type="ndarray"
            )
            found.append(np.stack([members[near["i"]], classes[m][near["j"]]], axis=1))
    first, second = np.concatenate(found).T
    close = surface_distance(discs, first, second) < gap
    return first[close], second[close]


def surface_distance(discs: Discs, first: Array, second: Array) -> Array:
    """Distance between the surfaces of pairs (nearest image), negative where they overlap, in m."""
    apart = discs.separation(first, second)
    return np.asarray(
        np.hypot(apart[..., 0], apart[..., 1]) - discs.radii[first] - discs.radii[second]
    )


def smallest_gap(discs: Discs) -> float:
    """Least distance between two surfaces, periodic images included, in m."""
    own = float(discs.size.min() - 2 * discs.radii.max()) if discs.periodic else np.inf
    probe = 0.1 * float(discs.radii.mean() + np.sqrt(discs.area / len(discs)))
    while True:
        first, second = close_pairs(discs, probe)
        if len(first):
            return min(own, float(surface_distance(discs, first, second).min()))
        if probe > 2 * discs.size.sum():
            return own
        probe *= 2
