"""Laws of the basic random variable θ (section 3.1)."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import require

MASS_GAP = 1e-8
"""Most by which the integral of a density may miss the difference of its distribution function."""
NARROWEST = 1e-4  # width of a support over its greater end, beside which rounding is small
_PANEL_GAP = 1e-13
_HALVINGS, _MOST_PANELS = 48, 400


class ThetaLaw(Protocol):
    """Law of θ on a bounded support, with a density.

    Laws that can be hashed (frozen dataclasses) have their quadrature rules kept.
    """

    @property
    def lower(self) -> float:
        """Left end of the support, finite."""

    @property
    def upper(self) -> float:
        """Right end of the support, finite and greater than `lower`."""

    def pdf(self, theta: ArrayLike) -> Array:
        """Density f_Θ at `theta` (any shape), finite; its integral over the support is 1."""

    def cdf(self, theta: ArrayLike) -> Array:
        """P(Θ ≤ theta), any shape: 0 at `lower` and 1 at `upper`."""

    def quantile(self, probability: ArrayLike) -> Array:
        """The θ below which a share `probability` in [0, 1] lies, any shape."""


def require_support(lower: float, upper: float, unit: float = 0.0) -> None:
    """Refuse a support that is not two finite ends in order, `NARROWEST` or more apart.

    Raises:
        RefusedError: It is not.
    """
    least = NARROWEST * max(abs(lower), abs(upper), unit)
    ordered = np.isfinite(lower) and np.isfinite(upper) and lower < upper
    wide = ordered and upper - lower >= 0.999 * least  # 9.999 … 10 is wide enough
    apart = f", {least:.2g} or more apart" if ordered else ""
    require(wide, "support of θ", [lower, upper], f"two finite ends, rising{apart}")


def require_shares(share: Array) -> None:
    """Refuse probabilities outside [0, 1].

    Raises:
        RefusedError: One lies outside.
    """
    inside = (share >= 0) & (share <= 1)
    wrong = share[~inside]
    require(not wrong.size, "probability", next(wrong.flat, None), "values in [0, 1]")


def panel_edges(law: ThetaLaw, edges: Array, rule: tuple[Array, Array]) -> Array:
    """Edges of panels on which a rule integrates the density, rising, shape (m + 1,), m ≥ n.

    A panel whose integrals miss those by the distribution function is halved. Corners and
    jumps of the density, steep ends and narrow peaks are met by halving alone.

    Args:
        law: Law of θ.
        edges: To begin with, rising, shape (n + 1,).
        rule: Nodes and weights of a rule on [−1, 1].

    Raises:
        RefusedError: What all panels miss together stays above `MASS_GAP`: density and distribution
            function are not of one law, or the density is not finite.
    """
    for _ in range(_HALVINGS):
        gaps = _mass_gaps(law, edges, rule)
        coarse = np.flatnonzero(~(gaps <= _PANEL_GAP))  # also where a gap is not a number
        if not coarse.size or len(edges) > _MOST_PANELS:
            break
        edges = np.insert(edges, coarse + 1, (edges[coarse] + edges[coarse + 1]) / 2)
    total = float(_mass_gaps(law, edges, rule).sum())
    key = "probability between the density of θ and its distribution function"
    cure = "pdf must be the derivative of cdf, finite everywhere on the support"
    require(total <= MASS_GAP, key, f"{total:.1e}", f"differences up to {MASS_GAP:g}", cure)
    return edges


def _mass_gaps(law: ThetaLaw, edges: Array, rule: tuple[Array, Array]) -> Array:
    """Probability by which the rule on each panel misses that of the distribution function F.

    Of f and of x f, x from −1 to 1 over the panel, whose integral is [x F] − ∫ F dx: a jump right
    in the middle of a panel shows in the second alone.
    """
    x, w = rule
    half = np.diff(edges)[:, None] / 2
    theta = edges[:-1, None] + half * (1 + x)
    mass, below = half * w * law.pdf(theta), law.cdf(edges)
    even = mass.sum(axis=1) - np.diff(below)
    odd = (mass * x).sum(axis=1) - (below[1:] + below[:-1] - (w * law.cdf(theta)).sum(axis=1))
    gaps: Array = np.maximum(np.abs(even), np.abs(odd))
    return gaps
