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


def geometric_mean(mass: TaylorModel, stiffness: TaylorModel, omega: Array) -> TaylorModel:
    """Enclose the geometric mean X = M # K over the box, shape (n, n), by Brouwer's theorem.

    It is the positive definite X with X M⁻¹ X = K. Let X = X̃ + E with the series X̃ of X about the
    midpoint. With W = M⁻¹, P = X̃ W − diag(ω) and Δ = K − X̃ W X̃ the remainder E obeys

        (ω_i + ω_j) E_ij = (Δ − E Pᵀ − P E − E W E)_ij.

    Where a bound |E| ≤ B gives itself back through this equation, Brouwer's theorem gives such an E
    at every u of the box (as Rump 2001). The map contracts (`right_side_bound`): E is the only one
    there and continuous in u; as Eᵀ solves the equation, too, E is symmetric. The squares of the
    eigenvalues of M⁻¹ X are those of M⁻¹ K, which are positive, so that no eigenvalue of X passes
    zero. On the way from u to the midpoint, and from the rounded matrices there to M = 1 and K =
    diag(ω²), whose terms lie within the same bounds and whose solution is E = 0, X thus stays as
    definite as diag(ω) is: it is the positive definite solution.

    Args:
        mass: M, shape (n, n), at the midpoint of the box the identity but for rounding.
        stiffness: K, at the midpoint diag(ω²) but for rounding. Both are positive definite.
        omega: ω, shape (n,), positive.

    Raises:
        UnprovedError: The box is so wide that no bound gives itself back, or that M may be
            singular.
    """
    sums = omega[:, np.newaxis] + omega
    inverse_mass = solve(mass, mass.like(np.eye(len(omega))))
    series = _series(inverse_mass, stiffness, omega)
    product = series @ inverse_mass
    defect = (stiffness - product @ series).magnitude()
    coupling = (product - np.diag(omega)).magnitude()
    inverse_magnitude = inverse_mass.magnitude()
    # The bound is widened by a factor of 1.02 a round until it holds; the factor 1.001 makes the
    # rounding of the bound itself harmless. All three numbers are tuned.
    bound = np.zeros_like(defect)
    for _ in range(60):
        right = right_side_bound(defect, coupling, inverse_mass=inverse_magnitude, bound=bound)
        found = right / sums
        found = np.maximum(found, found.T)
        # Bounds that have grown to ω_i + ω_j, or are not finite, will not give themselves back; the
        # rounds are ended early, and nothing rests on this.
        if not (found < sums).all():
            break
        if (1.001 * found <= bound).all():
            return series.widened(bound)
        bound = 1.02 * np.maximum(found, bound)
    what = "the box is so wide that the damping by a ratio is not enclosed"
    raise UnprovedError(what, "take narrower inputs")


def right_side_bound(defect: Array, coupling: Array, *, inverse_mass: Array, bound: Array) -> Array:
    """Bound |Δ − E Pᵀ − P E − E W E| for all E with |E| ≤ `bound`, shape (n, n).

    Where E changes by at most θ `bound`, the expression changes by at most θ times the result. This
    takes twice the product of the unknowns, since |E W E − E′ W E′| ≤ |E − E′| |W| |E| + |E′| |W|
    |E − E′|.

    Args:
        defect: Bound of |Δ|, shape (n, n), as all others.
        coupling: Bound of |P|.
        inverse_mass: Bound of |W|.
        bound: Bound of |E|, symmetric.
    """
    of_coupling = coupling @ bound
    of_unknowns = 2 * bound @ inverse_mass @ bound
    return np.asarray(defect + of_coupling + of_coupling.T + of_unknowns)


def _series(inverse_mass: TaylorModel, stiffness: TaylorModel, omega: Array) -> TaylorModel:
    """Return the series X̃ of X W X = K about the midpoint of the box, without a bound of its error.

    In degree m, (ω_i + ω_j) X_ij is that of K less what lower degrees of X give.

    Args:
        inverse_mass: W, a Taylor model of shape (n, n); at the midpoint the identity.
        stiffness: K, shape (n, n); at the midpoint diag(ω²).
        omega: ω, shape (n,), positive.

    Returns:
        Polynomials of shape (n, n) up to the order of K, with a remainder of zero.
    """
    d = inverse_mass.inputs
    sums = omega[:, np.newaxis] + omega
    X = [np.diag(omega)[np.newaxis]]  # coefficients by degree
    XW = [np.diag(omega)[np.newaxis]]
    for m in range(1, stiffness.order + 1):
        lower = product_part(X, inverse_mass.parts, m, d, matmul)
        XW.append(lower)
        known = product_part(XW, X, m, d, matmul)
        X.append((stiffness.homogeneous_part(m) - known) / sums)
        XW[m] = lower + X[m]
    return TaylorModel(tuple(X), np.zeros(sums.shape), d, stiffness.order)
