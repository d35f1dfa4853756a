"""Quadrature rules for means under the distribution of θ, and interpolation between their nodes."""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import checked_number, require
from alphacut.stochastic.theta.distribution import ThetaDistribution


@dataclass(frozen=True)
class ThetaRule:
    """Nodes θ, rising, and weights, of sum 1, for ∫ g(θ) f_Θ(θ) dθ ≈ Σ w_k g(θ_k), (n,) each."""

    nodes: Array
    weights: Array

    def mean(self, values: Array) -> Array:
        """Return the mean of `values`, shape (n, …), under f_Θ."""
        return np.asarray(np.tensordot(self.weights, values, axes=1), float)


def level_rule(distribution: ThetaDistribution, levels: Array, *, points: int) -> ThetaRule:
    """Return the rule with `points` Gauss–Legendre nodes in each interval of rising levels of θ.

    The weights contain the density f_Θ and are scaled to the sum 1. Where the density is smooth,
    the error of the mean of a smooth function falls with the power 2·points of the interval.
    """
    return _weighted(distribution, levels, np.polynomial.legendre.leggauss(points))


Rule = tuple[Array, Array]
"""Nodes and weights of a quadrature rule on [−1, 1], shape (points,) each."""


def _on_panels(edges: Array, rule: Rule) -> tuple[Array, Array]:
    """Return the nodes and weights of a rule on each panel, shape (panels, points) each.

    Args:
        edges: Ends of the panels, rising, shape (panels + 1,).
        rule: Nodes and weights of the rule on [−1, 1], shape (points,) each.
    """
    x, weights = rule
    # [−1, 1] is mapped to each panel; the derivative of the map scales the weights.
    half_width = np.diff(edges)[:, None] / 2
    return edges[:-1, None] + half_width * (1 + x), half_width * weights


def _weighted(distribution: ThetaDistribution, edges: Array, rule: Rule) -> ThetaRule:
    """Return the composite rule on panels between rising edges, weighted by the density f_Θ."""
    nodes, panel_weights = _on_panels(edges, rule)
    weights = panel_weights.ravel() * distribution.pdf(nodes.ravel())
    return ThetaRule(nodes.ravel(), weights / weights.sum())


def gauss_rule(distribution: ThetaDistribution, *, points: int) -> ThetaRule:
    """Return the Gauss rule of the density f_Θ, exact for polynomials of degree 2·points − 1.

    The recurrence of the orthogonal polynomials comes from the discretised Stieltjes procedure on a
    fine Legendre rule (Gautschi, Orthogonal Polynomials, 2004, section 2.2.3), the nodes from the
    Jacobi matrix (Golub & Welsch 1969).

    Args:
        distribution: Distribution of θ. The rules of distributions that are compared by value
            (frozen dataclasses) are cached.
        points: Number of nodes, at least 1.

    Returns:
        Nodes, rising, and positive weights of the sum 1, shape (points,) each, which cannot be
        written to.

    Raises:
        RefusedError: `points` is no whole number of 1 or more, or density and distribution function
            disagree.

    Example:
        >>> from alphacut.stochastic import TruncatedNormal
        >>> rule = gauss_rule(TruncatedNormal(), points=3)
        >>> rule.mean(rule.nodes**2).round(4).item()
        0.9733
    """
    checked_number("points", points, whole=True, least=1)
    # An object that is compared by identity would keep its place in the cache for itself alone.
    if isinstance(distribution, Hashable) and type(distribution).__hash__ is not object.__hash__:
        return _cached_rule(distribution, points)
    return _stieltjes_rule(distribution, points)


def _stieltjes_rule(distribution: ThetaDistribution, points: int) -> ThetaRule:
    """Return the Gauss rule of the density of θ with so many points, made anew.

    Args:
        distribution: Distribution of θ.
        points: Number of nodes, at least 1.

    Returns:
        Nodes, rising, and weights of the sum 1, shape (points,) each, which cannot be written to.

    Raises:
        RefusedError: The density is not the derivative of the distribution function.
    """
    # Integrals of the density times polynomials of degree 2·points are taken by a fine rule. Nodes
    # of almost no weight are left out: they are so far off that the polynomials overflow there.
    panels = min(math.ceil(distribution.upper - distribution.lower), 64)
    edges = np.asarray(np.linspace(distribution.lower, distribution.upper, panels + 1), float)
    legendre = np.polynomial.legendre.leggauss(16 + 2 * points)
    fine = _weighted(distribution, _panel_edges(distribution, edges, legendre), legendre)
    relevant = fine.weights > 1e-200
    theta = fine.nodes[relevant]
    weights = fine.weights[relevant]

    # The orthonormal polynomials p_k obey √β_{k+1} p_{k+1} = (θ − α_k) p_k − √β_k p_{k−1}.
    alpha = np.zeros(points)
    sqrt_beta = np.zeros(points + 1)
    last = np.zeros_like(theta)
    current = np.ones_like(theta)
    for k in range(points):
        alpha[k] = weights @ (theta * current**2)
        following = (theta - alpha[k]) * current - sqrt_beta[k] * last
        sqrt_beta[k + 1] = np.sqrt(weights @ following**2)
        last = current
        current = following / sqrt_beta[k + 1]

    # The nodes are the eigenvalues of the Jacobi matrix, the weights the squares of the first
    # components of its eigenvectors.
    off_diagonal = sqrt_beta[1:-1]
    jacobi = np.diag(alpha) + np.diag(off_diagonal, 1) + np.diag(off_diagonal, -1)
    nodes, vectors = np.linalg.eigh(jacobi)
    rule = ThetaRule(nodes, vectors[0] ** 2)
    for shared_array in (rule.nodes, rule.weights):
        shared_array.flags.writeable = False
    return rule


_cached_rule = lru_cache(maxsize=256)(_stieltjes_rule)


def _panel_edges(distribution: ThetaDistribution, edges: Array, rule: Rule) -> Array:
    """Refine panels until a rule integrates the density of θ on each of them.

    A panel on which the integral misses the difference of the distribution function is halved, at
    most 48 times and up to some 400 panels, which resolves corners, jumps and narrow peaks of the
    density.

    Args:
        distribution: Distribution of θ.
        edges: Ends of the first panels, rising, shape (panels + 1,).
        rule: Nodes and weights of the rule on [−1, 1].

    Returns:
        Ends of the refined panels, rising.

    Raises:
        RefusedError: The errors of the last panels add up to more than 1e-8 or to NaN: the density
            is not the derivative of the distribution function.
    """
    max_halvings = 48  # of a panel; narrower ones are rounding
    max_panels = 400
    for _ in range(max_halvings):
        gaps = _mass_gaps(distribution, edges, rule)
        coarse = np.flatnonzero(~(gaps <= 1e-13))  # also where a gap is not a number
        if not coarse.size or len(edges) > max_panels:
            break
        midpoints = (edges[coarse] + edges[coarse + 1]) / 2
        edges = np.insert(edges, coarse + 1, midpoints)
    total = float(_mass_gaps(distribution, edges, rule).sum())
    max_total = 1e-8  # eight digits of all means; a jump within the narrowest panel leaves less
    require(
        total <= max_total,
        "probability between the density of θ and its distribution function",
        value=f"{total:.1e}",
        allowed=f"differences up to {max_total:g}",
        cure="pdf must be the derivative of cdf, finite everywhere on the support",
    )
    return edges


def _mass_gaps(distribution: ThetaDistribution, edges: Array, rule: Rule) -> Array:
    """Return the error of a rule for the density f on each panel, shape (panels,).

    F is the distribution function, and x runs from −1 to 1 over the panel. Exactly, ∫ f is F at the
    upper end less F at the lower end, and ∫ x f is the sum of both less ∫ F dx. The larger of the
    two errors is returned. A jump right in the middle of a panel shows in the second one alone.

    Args:
        distribution: Distribution of θ.
        edges: Ends of the panels, rising, shape (panels + 1,).
        rule: Nodes and weights of the rule on [−1, 1], shape (points,) each.
    """
    x, weights = rule
    theta, panel_weights = _on_panels(edges, rule)
    masses = panel_weights * distribution.pdf(theta)
    F = distribution.cdf(edges)
    error = masses.sum(axis=1) - np.diff(F)
    integral_of_F = (weights * distribution.cdf(theta)).sum(axis=1)
    moment_error = (masses * x).sum(axis=1) - (F[1:] + F[:-1] - integral_of_F)
    gaps: Array = np.maximum(np.abs(error), np.abs(moment_error))
    return gaps


def between_nodes(nodes: Array, values: Array, at: Array) -> Array:
    """Interpolate values at rising nodes.

    With 10 to 40 nodes the polynomial through all of them is taken, if its Lebesgue function (the
    sum of the magnitudes of the Lagrange polynomials) is at most 30 at the points, as for the nodes
    of one Gauss rule. Otherwise monotone cubic pieces (PCHIP) are taken, which are safe with any
    nodes.

    Args:
        nodes: At least two rising nodes, shape (n,).
        values: Values at the nodes, shape (n,).
        at: Points, at least one, any shape. Beyond the nodes the interpolation is continued.

    Returns:
        Values at the points, in the shape of `at`.
    """
    from scipy.interpolate import BarycentricInterpolator, PchipInterpolator

    if 10 <= len(nodes) <= 40:
        # SciPy takes the nodes in a random order; with one seed the digits are the same each time.
        lagrange = BarycentricInterpolator(nodes, np.eye(len(nodes)), rng=0)(at)
        lebesgue_constant = np.abs(lagrange).sum(axis=-1).max()
        if lebesgue_constant <= 30.0:
            return np.asarray(lagrange @ values)
    return np.asarray(PchipInterpolator(nodes, values)(at))
