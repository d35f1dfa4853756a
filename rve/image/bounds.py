"""Bounds of a stiffness or conductivity in the Loewner order, and what follows from them.

Each function states the inequality that it proves. A number that is computed with k rounded
operations is off by at most k + 1 rounding units of itself; the bounds are moved outwards by that.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError, require_ordered
from alphacut.rve.image.fields.element import SHEARS
from alphacut.rve.image.fields.energy import SAFETY, UNIT
from alphacut.rve.result.moduli import AXES, shear_modulus, square_moduli


class _Ends(NamedTuple):
    """The fields of an `Enclosure`."""

    lower: float
    upper: float


class Enclosure(_Ends):
    """Lower and upper bound of a number, infinite where it has none.

    Raises:
        FailedError: The lower bound is above the upper one, or one of them is NaN.
    """

    __slots__ = ()

    def __new__(cls, lower: float, upper: float) -> Self:
        """Check the ends."""
        require_ordered("a constant", lower, upper)
        return super().__new__(cls, lower, upper)


@dataclass(frozen=True, eq=False)
class LoewnerBounds:
    """Bounds lower ≤ C ≤ upper of a symmetric tensor, as quadratic forms.

    C itself is positive semidefinite. What follows from the bounds holds for all such C.

    Args:
        lower: Lower bound, shape (n, n); 0 in directions in which no solid percolates.
        upper: Upper bound, of the same shape; its diagonal is infinite where there is none, as
            beside rigid or perfectly conducting phases.

    Raises:
        FailedError: An entry is NaN, or `upper` − `lower` is not positive semidefinite, beyond
            rounding.
    """

    lower: Array
    upper: Array

    def __post_init__(self) -> None:
        """Check that the bounds are numbers and in order."""
        for matrix in (self.lower, self.upper):
            require_ordered("a tensor", matrix, np.inf)  # which NaN is not
        diagonals = np.diagonal([self.lower, self.upper], axis1=1, axis2=2)
        require_ordered("a tensor's diagonal", diagonals[0], diagonals[1])
        if self.has_upper:
            # Eigenvalues of the rounded difference are off by a few units of all entries.
            rounding = 32 * UNIT * float(np.abs([self.lower, self.upper]).sum())
            smallest = np.linalg.eigvalsh(self.upper - self.lower)[0]
            require_ordered("a tensor", -rounding, smallest)

    @cached_property
    def has_lower(self) -> bool:
        """Whether the lower bound is positive definite: not where some field carries nothing.

        Otherwise it does not bound the inverse of the tensor.
        """
        return is_positive_definite(self.lower)

    @property
    def has_upper(self) -> bool:
        """Whether the upper bound is finite: not beside rigid or perfectly conducting phases."""
        return bool(np.isfinite(self.upper).all())

    @property
    def has_both(self) -> bool:
        """Whether the lower bound is positive definite and the upper one finite."""
        return self.has_lower and self.has_upper

    @property
    def width(self) -> float:
        """Largest ratio of the upper to the lower energy over all mean fields, minus one."""
        if not self.has_both:
            return float("inf")
        from scipy.linalg import eigh  # takes time to import

        try:
            return float(eigh(self.upper, self.lower, eigvals_only=True)[-1] - 1)
        except np.linalg.LinAlgError:  # the lower bound is singular to rounding
            return float("inf")

    def contains(self, tensor: Array) -> bool:
        """Return whether a symmetric tensor of their shape lies between the bounds."""
        distances = [tensor - self.lower]
        if self.has_upper:
            distances.append(self.upper - tensor)
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
        low = max(float(np.trace(self.lower)) / n, 0.0)
        high = float(np.trace(self.upper)) / n
        return Enclosure(low * (1 - 4 * UNIT), high * (1 + 4 * UNIT))

    def components(self) -> Array:
        """Return bounds of K_xx, K_yy and K_xy, or of K_xx, K_yy, K_zz, K_yz, K_xz and K_xy.

        Returns:
            Lower and upper bound of each, shape (components, 2). Components off the diagonal lie
            between −∞ and ∞ where a bound is missing.
        """
        n = len(self.lower)
        diagonal = np.maximum(np.diagonal([self.lower, self.upper], 0, 1, 2).T, 0)
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
    (6, 6), with the shears 23, 13, 12 and 2 ε. The lower one is 0 for strains that no connected
    solid resists, the upper one has an infinite diagonal beside rigid phases.

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
        low = float(square_moduli(self.lower)[0]) / 2 - 2 * _rounding(self.lower)
        high = float(square_moduli(self.upper)[0]) / 2
        return Enclosure(max(low, 0.0), high + 2 * _rounding(self.upper))

    def shear(self, average: str = AXES) -> Enclosure:
        """Return bounds in Pa of the shear modulus of an isotropic average of the stiffness.

        The lower bound is 0 where the solid does not percolate in all directions, and the upper one
        is infinite beside rigid phases.

        Args:
            average: In the plane, "axes" for C33, the modulus along the axes, or "isotropic" for
                Hill's mean over all directions of the plane. It is not used in space, where the
                average is Hill's.
        """
        if self.dimension == 3:
            return self._hill(1)  # the bounds of Hill's G
        # Both averages rise in C11 − C12 and C33, each of which is the value of C at a strain.
        with np.errstate(divide="ignore"):  # a mean with a modulus of 0
            low = float(shear_modulus(np.maximum(square_moduli(self.lower), 0), average))
            high = float(shear_modulus(np.maximum(square_moduli(self.upper), 0), average))
        if average == AXES:  # C33 itself, which is not rounded
            return Enclosure(low, high)
        low -= 4 * _rounding(self.lower)
        return Enclosure(max(low, 0.0), high + 4 * _rounding(self.upper))

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
            Lower and upper bound. Where the lower bound of the stiffness is not positive (no solid
            percolates) the lower one is 0 in space and −∞ in the plane; without an upper bound
            (rigid phases) the upper one is infinite, and in the plane, where G may then exceed any
            multiple of K, the lower one is −∞ as well.
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
        if min_bulk > 0:
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
        """
        low, high = self._compliance
        n = self.dimension
        # The quotients and these numerators are off by one unit each; the lower bounds are moved
        # down and the upper ones up. The largest compliance gives the smallest modulus.
        numerators = np.array([1 - 4 * UNIT, 1 + 4 * UNIT])
        # The compliance is positive. Rounding may take its lower bound below 0: then no modulus
        # bounds this one from above.
        compliances = np.maximum(np.diagonal([high, low], 0, 1, 2).T, 0)
        with np.errstate(divide="ignore"):
            moduli = numerators / compliances
        ratios = [self._lateral_ratio(i, j) for i, j in SHEARS[n]]
        found: Array = np.concatenate([moduli[:n], ratios, moduli[n:]])
        require_ordered("constants along the axes", found[:, 0], found[:, 1])
        return found

    @cached_property
    def _compliance(self) -> tuple[Array, Array]:
        """Lower and upper bound, in the Loewner order, of the inverse of the stiffness.

        Both compliances have the shape of the stiffness, (3, 3) or (6, 6), in 1/Pa. Where
        the solid does not percolate in all directions there is no upper bound, and all its entries
        are infinite; beside rigid phases the lower one is zero.
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
            missing, or S_ii has no positive lower bound.
        """
        low, high = self._compliance
        if not (self.has_lower and low[i, i] > 0):
            return Enclosure(-np.inf, np.inf)
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
            Lower and upper bound; 0 where the solid does not percolate in all directions, infinite
            beside rigid phases.
        """
        # Voigt's modulus rises with the stiffness, Reuss's falls with the compliance.
        min_compliance, max_compliance = self._compliance
        low = 0.0
        high = float("inf")
        if self.has_lower:
            low = max(low, hill_mean(self.lower, max_compliance, modulus, side=-1))
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
    a bound of its rounding error. Where rounding leaves no upper bound of Reuss's modulus, Voigt's
    takes its place, which is never below it.

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
    # 36 products and sums are off by fewer than 64 units of the sum of magnitudes; the other half
    # of the margin of Reuss's sum is for the quotient and the mean.
    inverse = reuss.sum() - side * 128 * UNIT * abs(reuss).sum()
    reuss_modulus = voigt.sum()
    if inverse > 0:
        reuss_modulus = 1 / inverse
    return float((voigt.sum() + reuss_modulus) / 2 + side * 64 * UNIT * abs(voigt).sum())


def _rounding(stiffness: Array) -> float:
    """Return a rounding unit of the largest entry of a stiffness."""
    return UNIT * float(np.abs(stiffness).max())


def inverse_below(matrix: Array) -> Array:
    """Return a lower bound of the inverses of all positive definite matrices ≤ `matrix`.

    The order is Loewner's: A ≤ B if B − A is positive semidefinite, and then B⁻¹ ≤ A⁻¹. The
    argument, symmetric positive definite, and the result have the shape (n, n). FailedError if
    `matrix` is not positive definite.
    """
    inverse, error = _inverse_with_error(matrix)
    return np.asarray(inverse - error)


def inverse_above(matrix: Array) -> Array:
    """Return an upper bound of the inverses of all symmetric matrices ≥ `matrix`.

    The order is Loewner's: A ≤ B if B − A is positive semidefinite, and then B⁻¹ ≤ A⁻¹. The
    argument, symmetric positive definite, and the result have the shape (n, n). FailedError if
    `matrix` is not positive definite.
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
        FailedError: The matrix is not positive definite, so that it is singular to rounding.
    """
    # Powers of two bring the diagonal near 1 without rounding: rows of any size count alike.
    with np.errstate(divide="ignore", invalid="ignore"):  # of diagonals that are not positive
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
    if residual_norm < 0.5:
        inverse_norm = np.abs(inverse).sum(axis=1).max()
        error = SAFETY * residual_norm / (1 - residual_norm) * inverse_norm
        if np.linalg.eigvalsh(inverse)[0] > error:
            return scale[:, None] * inverse * scale, np.diag(error * scale**2)

    # The error hides the smallest eigenvalue of the inverse: rational numbers keep it.
    exact = _exact_inverse(matrix)
    if exact is None:
        what = "a bound of the compliance is singular to rounding"
        raise FailedError(what, "lower the contrast of the phases")
    # Entries are rounded by a unit of their magnitudes |X_ij| ≤ √(X_ii X_jj). By Gershgorin's
    # circles of √X_ii⁻¹ error √X_jj⁻¹ that is below n units of X_ii on the diagonal; one more is
    # for adding it to the inverse.
    return exact, SAFETY * (len(matrix) + 1) * UNIT * np.diag(np.diagonal(exact))


def is_positive_definite(matrix: Array) -> bool:
    """Return whether a symmetric matrix is positive definite, as its entries are, without rounding.

    One with entries that are not finite is not.
    """
    return _exact_inverse(matrix) is not None


def _exact_inverse(matrix: Array) -> Array | None:
    """Return the inverse of a symmetric matrix, rounded once, or None if not positive definite.

    Gauss's elimination is done in rational numbers. By Sylvester's criterion a matrix is positive
    definite if, and only if, all pivots without a change of rows are positive.

    Args:
        matrix: Shape (n, n). One with entries that are not finite is not positive definite.
    """
    size = len(matrix)
    if not np.isfinite(matrix).all():
        return None
    extended = np.hstack([matrix, np.eye(size)])
    rows = [[Fraction(float(entry)) for entry in row] for row in extended]
    for k, pivot_row in enumerate(rows):
        pivot = pivot_row[k]
        if pivot <= 0:
            return None
        rows[k] = [entry / pivot for entry in pivot_row]
        for other in range(size):
            if other != k:
                factor = rows[other][k]
                pairs = zip(rows[other], rows[k], strict=True)
                rows[other] = [entry - factor * above for entry, above in pairs]
    return np.array([row[size:] for row in rows], float)


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
