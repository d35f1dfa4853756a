"""The geometric mean M # K of two positive definite matrices over a box, as a Taylor model.

It is the positive definite X with X M⁻¹ X = K (Pusz, Woronowicz 1975; Bhatia 2007, section 4.1),
X = M √(M⁻¹K). Damping of all modes by one ratio ζ is 2 ζ M Φ diag(ω) Φᵀ M = 2 ζ (M # K).
"""

from __future__ import annotations

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.calculus.monomials import matmul, product_part
from alphacut.frame.calculus.taylor_model import TaylorModel, solve
from alphacut.frame.calculus.unproved import UnprovedError

ROUNDS = 60
"""Most rounds in which the bound of the remainder is widened until it holds."""
WIDENING, SLACK = 1.02, 1.001
"""Factor of a round, and the one by which a bound must hold, so that its rounding does not
matter; both tuned."""


def geometric_mean(mass: TaylorModel, stiffness: TaylorModel, omega: Array) -> TaylorModel:
    """Enclose X = M # K over the box, shape (n, n), by Brouwer's theorem.

    X = X̃ + E, of which X̃ is the series. With W = M⁻¹, P = X̃ W − diag(ω) and Δ = K − X̃ W X̃ the
    remainder E obeys

        (ω_i + ω_j) E_ij = (Δ − E Pᵀ − P E − E W E)_ij.

    Where a bound |E| ≤ B gives itself back through this equation, Brouwer's theorem gives such an E
    at every u of the box (as Rump 2001). The map contracts (`right_side_bound`): E is the only one
    there and continuous in u. The squares of the eigenvalues of M⁻¹ X are those of
    M⁻¹ K, which are positive. The eigenvalues themselves are so in the middle of the box, hence by
    continuity everywhere, so that X is the positive definite solution.

    Args:
        mass: M, shape (n, n), in the middle of the box the unit matrix but for rounding.
        stiffness: K, in the middle diag(ω²) but for rounding. Both are positive definite.
        omega: ω, shape (n,).

    Raises:
        UnprovedError: The box is so wide that no bound gives itself back.
    """
    inverse_mass, sums = solve(mass, mass.like(np.eye(len(omega)))), omega[:, None] + omega
    series = _series(inverse_mass, stiffness, omega)
    product = series @ inverse_mass
    defect = (stiffness - product @ series).magnitude()
    coupling, inverse_size = (product - np.diag(omega)).magnitude(), inverse_mass.magnitude()
    bound = np.zeros_like(defect)
    for _ in range(ROUNDS):
        found = right_side_bound(defect, coupling, inverse_mass=inverse_size, bound=bound) / sums
        found = np.maximum(found, found.T)
        if not (found < sums).all():
            break
        if (SLACK * found <= bound).all():
            return series.widened(bound)
        bound = WIDENING * np.maximum(found, bound)
    what = "the box is so wide that the damping by a ratio is not enclosed"
    raise UnprovedError(what, "take narrower inputs")


def right_side_bound(defect: Array, coupling: Array, *, inverse_mass: Array, bound: Array) -> Array:
    """Bound of |Δ − E Pᵀ − P E − E W E| for |E| ≤ `bound`, which is symmetric, shape (n, n).

    `defect`, `coupling` and `inverse_mass` bound |Δ|, |P| and |W|. Where E changes by θ `bound` at
    most, the expression changes by θ times the result at most. This takes twice the product of the
    unknowns, since |E W E − E′ W E′| ≤ |E − E′| |W| |E| + |E′| |W| |E − E′|.
    """
    turned = coupling @ bound
    return np.asarray(defect + turned + turned.T + 2 * bound @ inverse_mass @ bound)


def _series(inverse_mass: TaylorModel, stiffness: TaylorModel, omega: Array) -> TaylorModel:
    """The series X̃ of X W X = K about the middle of the box, where W = 1, without a remainder."""
    d, W = inverse_mass.inputs, inverse_mass.parts
    X, XW = [np.diag(omega)[None]], [np.diag(omega)[None]]
    sums = omega[:, None] + omega
    for m in range(1, stiffness.order + 1):
        # in degree m, (ω_i + ω_j) X_ij and what lower degrees of X give are K
        XW.append(product_part(X, W, m, d, matmul))
        X.append((stiffness.homogeneous_part(m) - product_part(XW, X, m, d, matmul)) / sums)
        XW[m] = XW[m] + X[m]
    return TaylorModel(tuple(X), np.zeros(sums.shape), d, stiffness.order)
