"""Curves over θ between the nodes that a model has chosen."""

from __future__ import annotations

import numpy as np

from alphacut.stochastic.theta.truncated_normal import Array

FEWEST = 10  # nodes, from which on a polynomial through those of a Gauss rule beats pieces
LARGEST = (
    30.0  # Lebesgue constant up to which a polynomial is trusted: rules in layers have far more
)


def between_nodes(nodes: Array, values: Array, at: Array) -> Array:
    """A curve at `at` (any shape) from its values at rising nodes, shape (n,).

    The polynomial through all nodes where they are those of one Gauss rule, whose Lebesgue constant
    is small: its error falls with the number of nodes as that of the rule itself does. Pieces that
    keep the order of the values elsewhere.
    """
    from scipy.interpolate import PchipInterpolator

    if len(nodes) >= FEWEST and lebesgue(nodes, at) <= LARGEST:
        return barycentric(nodes, values, at)
    return np.asarray(PchipInterpolator(nodes, values)(at))


def barycentric(nodes: Array, values: Array, at: Array) -> Array:
    """Polynomial through values at nodes, shape (n,), at `at` (any shape).

    The second form of the barycentric formula (Berrut and Trefethen, SIAM Review 46, 2004). SciPy's
    takes the nodes in a random order, and its last digits change from run to run.
    """
    scaled = 4 / (nodes[-1] - nodes[0]) * (nodes[:, None] - nodes)
    np.fill_diagonal(scaled, 1.0)
    gaps = np.asarray(at, float)[..., None] - nodes
    hit = gaps == 0
    shares = 1 / np.prod(scaled, axis=1) / np.where(hit, 1.0, gaps)
    shares = np.where(hit.any(axis=-1, keepdims=True), hit, shares)
    total: Array = (shares * values).sum(axis=-1) / shares.sum(axis=-1)
    return total


def lebesgue(nodes: Array, at: Array) -> float:
    """Lebesgue constant of polynomial interpolation at `at`; infinite for over 40 nodes."""
    if len(nodes) > 40:
        return float("inf")
    distance = nodes[:, None] - nodes
    np.fill_diagonal(distance, 1.0)
    gaps = np.asarray(at, float).ravel()[:, None] - nodes
    found = np.zeros(len(gaps))
    for own in range(len(nodes)):
        others = np.arange(len(nodes)) != own
        found += np.abs(np.prod(gaps[:, others] / distance[own, others], axis=1))
    return float(found.max())
