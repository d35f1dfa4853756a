"""Quadrature rules for means under the law of θ, and interpolation between their nodes."""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import checked_number, require
from alphacut.stochastic.theta.distribution import ThetaDistribution

MASS_GAP = 1e-8
"""Most by which the integral of a density may miss the difference of its distribution function."""
_PANEL_GAP = 1e-13
_HALVINGS, _MAX_PANELS = 48, 400
_FIRST_PANELS = 64
_NEGLIGIBLE = 1e-200  # weight of nodes so far off that polynomials overflow there
MIN_NODES = 10  # nodes, from which on a polynomial through those of a Gauss rule beats pieces
MAX_LEBESGUE = 30.0  # of a polynomial that is trusted; rules in layers have far more
MAX_NODES = 40  # nodes of a polynomial


@dataclass(frozen=True)
class ThetaRule:
    """Nodes θ, rising, and weights, of sum 1, for ∫ g(θ) f_Θ(θ) dθ ≈ Σ w_k g(θ_k), (n,) each."""

    nodes: Array
    weights: Array

    def mean(self, values: Array) -> Array:
        """Mean of `values`, shape (n, …), under f_Θ."""
        return np.asarray(np.tensordot(self.weights, values, axes=1), float)


def level_rule(distribution: ThetaDistribution, levels: Array, *, points: int) -> ThetaRule:
    """Return the rule with `points` Gauss–Legendre nodes in each interval of rising levels of θ.

    The weights contain the density f_Θ and are scaled to the sum 1. Where the density is smooth,
    the error of the mean of a smooth function falls with the power 2·points of the interval.
    """
    return _weighted(distribution, levels, np.polynomial.legendre.leggauss(points))


def _weighted(law: ThetaDistribution, edges: Array, rule: tuple[Array, Array]) -> ThetaRule:
    """Composite rule of `rule`, nodes and weights on [−1, 1], in panels, weighted by f_Θ."""
    x, w = rule
    half = np.diff(edges)[:, None] / 2
    nodes = (edges[:-1, None] + half * (1 + x)).ravel()
    weights = (half * w).ravel() * law.pdf(nodes)
    return ThetaRule(nodes, weights / weights.sum())


def gauss_rule(distribution: ThetaDistribution, *, points: int) -> ThetaRule:
    """Return the Gauss rule of the density f_Θ, exact for polynomials of degree 2·points − 1.

    The recurrence of the orthogonal polynomials comes from the discretised Stieltjes procedure on a
    fine Legendre rule (Gautschi, Orthogonal Polynomials, 2004, section 2.2.3), the nodes from the
    Jacobi matrix (Golub & Welsch 1969).

    The rules of laws that are compared by value are cached.

    Raises:
        RefusedError: There is no point, or density and distribution function disagree.

    Example:
        >>> from alphacut.stochastic import TruncatedNormal
        >>> rule = gauss_rule(TruncatedNormal(), points=3)
        >>> rule.mean(rule.nodes**2).round(4).item()
        0.9733
    """
    checked_number("points", points, whole=True, least=1)
    if isinstance(distribution, Hashable) and type(distribution).__hash__ is not object.__hash__:
        return _cached_rule(distribution, points)
    return _stieltjes_rule(distribution, points)


def _stieltjes_rule(distribution: ThetaDistribution, points: int) -> ThetaRule:
    panels = min(math.ceil(distribution.upper - distribution.lower), _FIRST_PANELS)
    levels = np.asarray(np.linspace(distribution.lower, distribution.upper, panels + 1), float)
    legendre = np.polynomial.legendre.leggauss(16 + 2 * points)
    fine = _weighted(distribution, _panel_edges(distribution, levels, legendre), legendre)
    relevant = fine.weights > _NEGLIGIBLE
    theta, weights = fine.nodes[relevant], fine.weights[relevant]
    alpha, beta = np.zeros(points), np.zeros(points + 1)  # of the recurrence; beta[0] = 0
    last, current = np.zeros_like(theta), np.ones_like(theta)  # orthonormal polynomials at θ
    for k in range(points):
        alpha[k] = weights @ (theta * current**2)
        following = (theta - alpha[k]) * current - beta[k] * last
        beta[k + 1] = np.sqrt(weights @ following**2)
        last, current = current, following / beta[k + 1]
    off_diagonal = beta[1:-1]
    jacobi = np.diag(alpha) + np.diag(off_diagonal, 1) + np.diag(off_diagonal, -1)
    nodes, vectors = np.linalg.eigh(jacobi)
    rule = ThetaRule(nodes, vectors[0] ** 2)
    for shared_array in (rule.nodes, rule.weights):
        shared_array.flags.writeable = False
    return rule


_cached_rule = lru_cache(maxsize=256)(_stieltjes_rule)


def _panel_edges(law: ThetaDistribution, edges: Array, rule: tuple[Array, Array]) -> Array:
    """Refine rising edges until a rule on [−1, 1] integrates the density of θ on each panel."""
    # a panel on which it misses the difference of the distribution function is halved, which
    # resolves corners, jumps and narrow peaks of the density
    for _ in range(_HALVINGS):
        gaps = _mass_gaps(law, edges, rule)
        coarse = np.flatnonzero(~(gaps <= _PANEL_GAP))  # also where a gap is not a number
        if not coarse.size or len(edges) > _MAX_PANELS:
            break
        edges = np.insert(edges, coarse + 1, (edges[coarse] + edges[coarse + 1]) / 2)
    total = float(_mass_gaps(law, edges, rule).sum())
    key = "probability between the density of θ and its distribution function"
    cure = "pdf must be the derivative of cdf, finite everywhere on the support"
    allowed = f"differences up to {MASS_GAP:g}"
    require(total <= MASS_GAP, key, value=f"{total:.1e}", allowed=allowed, cure=cure)
    return edges


def _mass_gaps(law: ThetaDistribution, edges: Array, rule: tuple[Array, Array]) -> Array:
    """Error of a rule for the density f on each panel, (n,), by its distribution function F."""
    # the larger of the errors of ∫ f, which is [F], and of ∫ x f, x from −1 to 1 over the panel,
    # which is [x F] − ∫ F dx: a jump right in the middle of a panel shows in the second alone
    x, w = rule
    half = np.diff(edges)[:, None] / 2
    theta = edges[:-1, None] + half * (1 + x)
    mass, F = half * w * law.pdf(theta), law.cdf(edges)
    error = mass.sum(axis=1) - np.diff(F)
    integral_of_F = (w * law.cdf(theta)).sum(axis=1)
    moment_error = (mass * x).sum(axis=1) - (F[1:] + F[:-1] - integral_of_F)
    gaps: Array = np.maximum(np.abs(error), np.abs(moment_error))
    return gaps


def between_nodes(nodes: Array, values: Array, at: Array) -> Array:
    """Interpolate values at rising nodes, both of shape (n,), at points `at` of any shape.

    By the polynomial through all nodes if these are few and its Lebesgue function is small at the
    points, as for the nodes of one Gauss rule; otherwise by monotone cubic pieces (PCHIP).
    """
    from scipy.interpolate import BarycentricInterpolator, PchipInterpolator

    if MIN_NODES <= len(nodes) <= MAX_NODES:
        # the same digits each time: SciPy takes the nodes in a random order
        lagrange = BarycentricInterpolator(nodes, np.eye(len(nodes)), rng=0)(at)
        lebesgue_constant = np.abs(lagrange).sum(axis=-1).max()
        if lebesgue_constant <= MAX_LEBESGUE:
            return np.asarray(lagrange @ values)
    return np.asarray(PchipInterpolator(nodes, values)(at))
