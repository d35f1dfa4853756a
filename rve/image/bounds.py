"""Bounds of a stiffness or conductivity in the Loewner order, and what follows from them.

Each function states the inequality that it proves. A number that is computed with k rounded
operations is off by at most k + 1 rounding units of itself; the bounds are moved outwards by that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError
from alphacut.rve.image.fields.element import SHEARS
from alphacut.rve.image.fields.energy import SAFETY, UNIT
from alphacut.rve.result.moduli import AXES, shear_modulus, square_moduli


class Enclosure(NamedTuple):
    """Lower and upper bound of a number."""

    lower: float
    upper: float


@dataclass(frozen=True, eq=False)
class LoewnerBounds:
    """Bounds lower ≤ C ≤ upper of a symmetric tensor, as quadratic forms.

    Args:
        lower: Lower bound, shape (n, n); 0 in directions in which no solid percolates.
        upper: Upper bound, of the same shape; its diagonal is infinite where there is none, as
            beside rigid or perfectly conducting phases.
    """

    lower: Array
    upper: Array

    @property
    def has_lower(self) -> bool:
        """Whether the lower bound is positive: not where nothing percolates along some axis."""
        return bool((np.diagonal(self.lower) > 0).all())

    @property
    def has_upper(self) -> bool:
        """Whether the upper bound is finite: not beside rigid or perfectly conducting phases."""
        return bool(np.isfinite(self.upper).all())

    @property
    def width(self) -> float:
        """Largest ratio of the upper to the lower energy over all mean fields, minus one."""
        if not (self.has_lower and self.has_upper):
            return float("inf")
        from scipy.linalg import eigh  # takes time to import

        return float(eigh(self.upper, self.lower, eigvals_only=True)[-1] - 1)

    def contains(self, tensor: Array) -> bool:
        """Return whether a symmetric tensor of their shape lies between the bounds."""
        distances = np.stack([tensor - self.lower, self.upper - tensor])
        return bool((np.linalg.eigvalsh(distances)[:, 0] >= 0).all())

    def overlaps(self, other: LoewnerBounds) -> bool:
        """Return whether some tensor may lie between these bounds and between other ones.

        Then the lower bounds of each are below the upper bounds of the other.
        """
        pairs = (self, other), (other, self)
        return all(
            np.linalg.eigvalsh(above.upper - below.lower)[0] >= 0
            for above, below in pairs
            if above.has_upper
        )


class ConductivityBounds(LoewnerBounds):
    """Bounds lower ≤ K ≤ upper of a conductivity, as quadratic forms of the mean gradient.

    K is that of heat in W/(m K), of electricity in S/m, or a diffusivity in m²/s: bounds have the
    unit of the phases' conductivities, and the shape (2, 2) of the plane or (3, 3) of space.
    """

    @property
    def mean(self) -> Enclosure:
        """Bounds of the mean over all directions, the trace of K over the dimension."""
        n = len(self.lower)
        low = float(np.trace(self.lower)) / n
        high = float(np.trace(self.upper)) / n
        return Enclosure(low * (1 - 4 * UNIT), high * (1 + 4 * UNIT))

    def components(self) -> Array:
        """Return bounds of K_xx, K_yy and K_xy, or of K_xx, K_yy, K_zz, K_yz, K_xz and K_xy.

        Returns:
            Lower and upper bound of each, shape (components, 2). Components off the diagonal lie
            between −∞ and ∞ where a bound is missing.
        """
        n = len(self.lower)
        diagonal = np.diagonal([self.lower, self.upper], 0, 1, 2).T
        off_diagonal = [entry_bounds(self.lower, self.upper, i, j) for i, j in SHEARS[n]]
        return np.concatenate([diagonal, off_diagonal])


def entry_bounds(lower: Array, upper: Array, i: int, j: int) -> Enclosure:
    """Return bounds of entry (i, j) of a symmetric tensor from bounds in the Loewner order.

    With S between A and B in the Loewner order and D = B − A, the inequality of Cauchy and Schwarz
    gives, for any vectors x and y,

        |x·(S − (A + B)/2) y| ≤ √(x·D x) √(y·D y)/2.

    Here x and y are the unit vectors i and j, so that S_ij lies within √(D_ii D_jj)/2 of the mean
    of A_ij and B_ij; −∞ and ∞ where a bound is infinite.
    """
    if not np.isfinite(upper).all():
        return Enclosure(-np.inf, np.inf)
    middle = (lower[i, j] + upper[i, j]) / 2
    diagonal = np.maximum(np.diagonal(upper - lower)[[i, j]], 0)  # D_ii and D_jj
    radius = np.sqrt(diagonal).prod() / 2 + 4 * UNIT * np.abs(upper).max()
    return Enclosure(float(middle - radius), float(middle + radius))


class StiffnessBounds(LoewnerBounds):
    """Bounds lower ≤ C ≤ upper of a stiffness, as quadratic forms of the mean strain.

    The bounds are in Pa and in Voigt order: of the plane, shape (3, 3), with 2 ε12; of space, shape
    (6, 6), with the shears 23, 13, 12 and 2 ε. Beside pores that percolate the lower one is 0,
    beside rigid phases the upper one has an infinite diagonal.

    A modulus that is the value of the form at a strain, or a sum of such values, is bounded by
    those of the ends, and with it whatever rises in each of such moduli: in the plane C11 + C12,
    C11 − C12 and C33 of the square part; in space K and G of Voigt's average and, by the
    compliance, of Reuss's, with Hill's (1952) mean of the two.
    """

    @property
    def dimension(self) -> int:
        """2 in the plane, 3 in space."""
        return 2 if len(self.lower) == 3 else 3

    @property
    def bulk(self) -> Enclosure:
        """Bounds of K of Hill's average, in the plane of K_T = (C11 + C12)/2, in Pa."""
        if self.dimension == 3:
            return self._hill(0)
        low = float(square_moduli(self.lower)[0]) / 2
        high = float(square_moduli(self.upper)[0]) / 2
        return Enclosure(low - 2 * _rounding(self.lower), high + 2 * _rounding(self.upper))

    def shear(self, average: str = AXES) -> Enclosure:
        """Return bounds in Pa of the shear modulus of an isotropic average of the stiffness.

        The lower bound is 0 where pores percolate, and the upper one is infinite beside rigid
        phases.

        Args:
            average: In the plane, "axes" for C33, the modulus along the axes, or "isotropic" for
                Hill's mean over all directions of the plane. It is not used in space, where the
                average is Hill's.

        Raises:
            FailedError: In space, a bound of the stiffness is singular to rounding.
        """
        if self.dimension == 3:
            return self._hill(1)  # the bounds of Hill's G
        # Both averages rise in C11 − C12 and C33, each of which is the value of C at a strain.
        with np.errstate(divide="ignore"):  # a mean with a modulus of 0
            low = float(shear_modulus(square_moduli(self.lower), average))
            high = float(shear_modulus(square_moduli(self.upper), average))
        if average == AXES:  # C33 itself, which is not rounded
            return Enclosure(low, high)
        return Enclosure(low - 4 * _rounding(self.lower), high + 4 * _rounding(self.upper))

    def young(self, average: str = AXES) -> Enclosure:
        """Return bounds in Pa of Young's modulus E of an isotropic average of the stiffness.

        E = G (3 − x) with x = G/(K + G/3), where the K of plane strain is K + G/3 already. E rises
        with K; in space it rises with G as well. In the plane E = 3 G − G²/K rises with G up to G =
        3/2 K and falls beyond, so that it may be negative.

        Args:
            average: In the plane, "axes" for the average with G = C33, or "isotropic" for Hill's
                mean over all directions of the plane. It is not used in space, where the average is
                Hill's.

        Returns:
            Lower and upper bound. Without a lower bound of the stiffness (percolating pores) the
            lower one is 0 in space and −∞ in the plane; without an upper bound (rigid phases) the
            upper one is infinite, and in the plane, where G may then exceed any multiple of K, the
            lower one is −∞ as well.

        Raises:
            FailedError: In space, a bound of the stiffness is singular to rounding.
        """
        min_bulk, max_bulk = self.bulk
        min_shear, max_shear = self.shear(average)
        softest = [min_shear]
        stiffest = [max_shear]
        # The results where the stiffness has no lower or no upper bound.
        low = 0.0
        high = np.inf
        if self.dimension == 2:
            # The extremes over an interval of G are at its ends, or where E has its maximum over G.
            top = float(np.clip(1.5 * max_bulk, min_shear, max_shear))
            softest = stiffest = [min_shear, top, max_shear]
            low = -np.inf
        # `_young` gives E, moved down (side −1) or up (side 1) by its rounding.
        if self.has_lower:
            low = min(self._young(shear, min_bulk, side=-1) for shear in softest)
        if self.has_upper:
            high = max(self._young(shear, max_bulk, side=1) for shear in stiffest)
        return Enclosure(low, high)

    def _young(self, shear: float, bulk: float, *, side: int) -> float:
        """Return G (3 − x) rounded downwards (side −1) or upwards (side 1)."""
        ratio = self._ratio(shear, bulk)
        return shear * (3 - ratio) + side * 8 * UNIT * shear * (3 + ratio)

    def poisson(self, average: str = AXES) -> Enclosure:
        """Return bounds of Poisson's ratio ν = (1 − x)/2 of an isotropic average of the stiffness.

        Here x = G/(K + G/3), where the K of plane strain is K + G/3 already.

        Args:
            average: In the plane, "axes" for the average with G = C33, or "isotropic" for Hill's
                mean over all directions of the plane. It is not used in space, where the average is
                Hill's.

        Returns:
            Lower and upper bound. Where a bound of the stiffness is missing, they are the limits of
            an isotropic solid but for rounding: −1 in space or −∞ in the plane, and 1/2.

        Raises:
            FailedError: In space, a bound of the stiffness is singular to rounding.
        """
        min_bulk, max_bulk = self.bulk
        min_shear, max_shear = self.shear(average)
        # `_ratio` gives x, which rises with G and falls with K.
        max_ratio = self._ratio(max_shear, min_bulk)
        min_ratio = self._ratio(min_shear, max_bulk)
        # ν falls with x. Each ratio is off by 3 units, and the two operations here add one each.
        low = (1 - max_ratio) / 2 - 4 * UNIT * (1 + max_ratio)
        return Enclosure(low, (1 - min_ratio) / 2 + 4 * UNIT * (1 + min_ratio))

    def _ratio(self, shear: float, bulk: float) -> float:
        """Return G/(K + G/3) within 3 rounding units; K of the plane is K + G/3 already."""
        with np.errstate(divide="ignore", invalid="ignore"):  # of 0 and infinity
            inverse = np.float64(bulk) / shear
            if self.dimension == 3:
                inverse += 1 / 3
            return float(1 / inverse)

    def constants(self) -> Array:
        """Return bounds of the engineering constants along the axes, shape (constants, 2).

        With the compliance S, the inverse of the stiffness in Voigt's order, moduli are 1/S_kk in
        Pa and Poisson's ratios are −S_ij/S_ii.

        Returns:
            Lower and upper bound of E_x, E_y, ν_xy and G_xy in plane strain, or of E_x, E_y, E_z,
            ν_yz, ν_xz, ν_xy, G_yz, G_xz and G_xy in space. Without a lower bound of the stiffness
            moduli are bounded from below by 0, without an upper one they are infinite from above;
            without either one ratios lie between −∞ and ∞.

        Raises:
            FailedError: A bound of the stiffness is singular to rounding.
        """
        low, high = self._compliance
        n = self.dimension
        # The quotients and these numerators are off by one unit each; the lower bounds are moved
        # down and the upper ones up. The largest compliance gives the smallest modulus.
        numerators = np.array([1 - 4 * UNIT, 1 + 4 * UNIT])
        with np.errstate(divide="ignore"):
            moduli = numerators / np.diagonal([high, low], 0, 1, 2).T
        ratios = [self._lateral_ratio(i, j) for i, j in SHEARS[n]]
        return np.concatenate([moduli[:n], ratios, moduli[n:]])

    @property
    def _compliance(self) -> tuple[Array, Array]:
        """Lower and upper bound, in the Loewner order, of the inverse of the stiffness.

        Both compliances have the shape of the stiffness, (3, 3) or (6, 6), in 1/Pa. Where pores
        percolate there is no upper bound, and all its entries are infinite; beside rigid phases the
        lower one is zero. FailedError if a bound of the stiffness is singular to rounding.
        """
        low = np.zeros_like(self.upper)
        high = np.full_like(self.lower, np.inf)
        if self.has_upper:
            low = inverse_below(self.upper)
        if self.has_lower:
            high = inverse_above(self.lower)
        return low, high

    def _lateral_ratio(self, i: int, j: int) -> Enclosure:
        """Return bounds of −S_ij/S_ii from bounds of S, the inverse of the stiffness.

        Args:
            i: Index of the load in Voigt's order, from 0.
            j: Index of the other component in Voigt's order, from 0.

        Returns:
            Lower and upper bound; −∞ and ∞ where the lower or the upper bound of the stiffness is
            missing.

        Raises:
            FailedError: A bound of the stiffness is singular to rounding.
        """
        if not (self.has_lower and self.has_upper):
            return Enclosure(-np.inf, np.inf)
        low, high = self._compliance
        # S_ij and the positive S_ii lie in intervals; their quotient is extreme at the ends.
        cross_terms = np.negative(entry_bounds(low, high, i, j))
        ratios = np.outer(cross_terms, [1 / high[i, i], 1 / low[i, i]])
        margin = 4 * UNIT * np.abs(ratios).max()
        return Enclosure(float(ratios.min() - margin), float(ratios.max() + margin))

    def _hill(self, modulus: int) -> Enclosure:
        """Return bounds in Pa of K or G of Hill's average of a stiffness of space.

        Hill's average is the mean of Voigt's and Reuss's averages over all directions.

        Args:
            modulus: 0 for the bulk modulus K, 1 for the shear modulus G.

        Returns:
            Lower and upper bound; 0 where pores percolate, infinite beside rigid phases.

        Raises:
            FailedError: A bound of the stiffness is singular to rounding.
        """
        # Voigt's modulus rises with the stiffness, Reuss's falls with the compliance.
        min_compliance, max_compliance = self._compliance
        low = 0.0
        high = float("inf")
        if self.has_lower:
            low = hill_mean(self.lower, max_compliance, modulus, side=-1)
        if self.has_upper:
            high = hill_mean(self.upper, min_compliance, modulus, side=1)
        return Enclosure(low, high)


def hill_mean(stiffness: Array, compliance: Array, modulus: int, *, side: int) -> float:
    """Return a lower or upper bound in Pa of Hill's mean bulk or shear modulus in space.

    Voigt's averages of a stiffness C and Reuss's of a compliance S are, with sums over the normal
    components i ≠ j and over the shear components k of Voigt's order 11, 22, 33, 23, 13, 12,

        9 K_V = Σ C_ii + Σ C_ij,      15 G_V = Σ C_ii − Σ C_ij/2 + 3 Σ C_kk,
        1/K_R = Σ S_ii + Σ S_ij,      15/G_R = 4 Σ S_ii − 2 Σ S_ij + 3 Σ S_kk.

    Hill's (1952) mean is (K_V + K_R)/2 or (G_V + G_R)/2. The computed mean is moved to one side by
    a bound of its rounding error.

    Args:
        stiffness: Stiffness C of Voigt's average, finite, shape (6, 6), in Pa.
        compliance: Compliance S of Reuss's average, positive definite and finite, shape (6, 6), in
            1/Pa. It need not be the inverse of `stiffness`: both come from bounds.
        modulus: 0 for the bulk modulus K, 1 for the shear modulus G.
        side: −1 to move the mean down, so that it is a lower bound; 1 to move it up.
    """
    diagonal: Array = np.eye(6)
    is_normal: Array = np.zeros((6, 6))
    is_normal[:3, :3] = 1
    # The factor 3 of Σ C_kk and Σ S_kk; the weights of the formulas above are entries of matrices.
    is_shear = 3 * diagonal * (1 - is_normal)
    if modulus == 0:
        voigt_weights = is_normal / 9
        reuss_weights = is_normal
    else:
        voigt_weights = ((1.5 * diagonal - 0.5) * is_normal + is_shear) / 15
        reuss_weights = ((6 * diagonal - 2) * is_normal + is_shear) / 15
    voigt = voigt_weights * stiffness
    reuss = reuss_weights * compliance
    # 36 products and sums are off by fewer than 64 units of the sum of magnitudes
    rounding = 64 * UNIT * (abs(voigt).sum() + abs(reuss).sum() / reuss.sum() ** 2)
    return float((voigt.sum() + 1 / reuss.sum()) / 2 + side * rounding)


def _rounding(stiffness: Array) -> float:
    """Return a rounding unit of the largest entry of a stiffness."""
    return UNIT * float(np.abs(stiffness).max())


def inverse_below(matrix: Array) -> Array:
    """Return a lower bound of the inverses of all positive definite matrices ≤ `matrix`.

    The order is Loewner's: A ≤ B if B − A is positive semidefinite, and then B⁻¹ ≤ A⁻¹. The
    argument, symmetric positive definite, and the result have the shape (n, n). FailedError if
    `matrix` is singular to rounding.
    """
    inverse, error = _inverse_with_error(matrix)
    return np.asarray(inverse - error)


def inverse_above(matrix: Array) -> Array:
    """Return an upper bound of the inverses of all symmetric matrices ≥ `matrix`.

    The order is Loewner's: A ≤ B if B − A is positive semidefinite, and then B⁻¹ ≤ A⁻¹. The
    argument, symmetric positive definite, and the result have the shape (n, n). FailedError if
    `matrix` is singular to rounding.
    """
    inverse, error = _inverse_with_error(matrix)
    return np.asarray(inverse + error)


def _inverse_with_error(matrix: Array) -> tuple[Array, Array]:
    """Return the computed inverse of a symmetric positive definite matrix and a bound of its error.

    Args:
        matrix: The matrix, finite, shape (n, n).

    Returns:
        The computed inverse, made symmetric, and a diagonal matrix D, both of shape (n, n). The
        true inverse lies between inverse − D and inverse + D in the Loewner order, A ≤ B if B − A
        is positive semidefinite.

    Raises:
        FailedError: The matrix is singular to rounding, or has a diagonal entry that is not
            positive.
    """
    # Powers of two bring the diagonal near 1 without rounding: rows of any size count alike.
    scale = 2.0 ** -np.round(np.log2(np.diagonal(matrix)) / 2)
    scaled = scale[:, None] * matrix * scale
    try:
        inverse = np.linalg.inv(scaled)
    except np.linalg.LinAlgError:  # a pivot is exactly zero: NaN fails the test below
        inverse = np.full_like(scaled, np.nan)
    inverse = (inverse + inverse.T) / 2
    # With X the computed inverse and R = I − X·matrix, the true inverse is (I − R)⁻¹ X. In the
    # norm of row sums it is off by at most ‖R‖‖X‖/(1 − ‖R‖), and so is every eigenvalue.
    residual_norm = residual_above(inverse, scaled).sum(axis=1).max()
    if not residual_norm < 0.5:
        what = "a bound of the compliance is singular to rounding"
        raise FailedError(what, "lower the contrast of the phases")
    inverse_norm = np.abs(inverse).sum(axis=1).max()
    error = SAFETY * residual_norm / (1 - residual_norm) * inverse_norm
    return scale[:, None] * inverse * scale, np.diag(error * scale**2)


def residual_above(inverse: Array, matrix: Array) -> Array:
    """Return upper bounds of the entries of |I − inverse·matrix|, with the rounding of the product.

    Both arguments and the result have the shape (n, n). The bound holds for any finite matrices,
    also where `inverse` is no inverse.
    """
    size = len(matrix)
    # A sum of n products is off by at most n units of the sum of their magnitudes, in whatever
    # order it is taken (Higham, Accuracy and Stability of Numerical Algorithms, section 3.1).
    # `SAFETY` stands for the rounding of this bound itself.
    residual = np.abs(np.eye(size) - inverse @ matrix)
    return np.asarray(residual + size * SAFETY * UNIT * (np.abs(inverse) @ np.abs(matrix)))
