"""Bounds of a stiffness in the Loewner order, and what follows from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError
from alphacut.rve.image.fields.element import SHEARS
from alphacut.rve.image.fields.energy import SAFETY, UNIT
from alphacut.rve.result.moduli import AXES, shear_modulus, square_moduli

Interval = tuple[float, float]

_UNIT, _NORMAL = np.eye(6), np.kron([[1, 0], [0, 0]], np.ones((3, 3)))
_SHEAR = 3 * _UNIT * (1 - _NORMAL)
VOIGT = np.array([_NORMAL / 9, ((1.5 * _UNIT - 0.5) * _NORMAL + _SHEAR) / 15])
REUSS = np.array([_NORMAL, ((6 * _UNIT - 2) * _NORMAL + _SHEAR) / 15])
"""Sums of their products with C are K and G of Voigt's, with S 1/K and 1/G of Reuss's average."""


@dataclass(frozen=True, eq=False)
class StiffnessBounds:
    """Lower ≤ C ≤ upper as quadratic forms of the mean strain, in Voigt order, in Pa.

    Of pores that percolate the lower one is 0, of rigid phases the upper one has an infinite
    diagonal.

    Of the plane, (3, 3), with 2 ε12, or of space, (6, 6), with shears 23, 13, 12 and 2 ε. Moduli
    that are such forms are bounded by those of the ends, and with them whatever rises in each of
    them: in the plane C11 + C12, C11 − C12 and C33 of the square part; in space K and G of Voigt's
    average and, by the compliance, of Reuss's, with Hill's (1952) mean of the two.
    """

    lower: Array
    upper: Array

    @property
    def dimension(self) -> int:
        """2 in the plane, 3 in space."""
        return 2 if len(self.lower) == 3 else 3

    @property
    def has_lower(self) -> bool:
        """Whether the cell is known to resist: not where pores percolate."""
        return bool(self.lower.any())

    @property
    def has_upper(self) -> bool:
        """Whether the cell is known to yield."""
        return bool(np.isfinite(self.upper).all())

    @property
    def _compliance(self) -> tuple[Array, Array]:
        """Lower and upper bound of the compliance: 0 without an upper bound of the stiffness."""
        low = inverse_below(self.upper) if self.has_upper else np.zeros_like(self.upper)
        high = inverse_above(self.lower) if self.has_lower else np.full_like(self.lower, np.inf)
        return low, high

    @property
    def width(self) -> float:
        """Largest ratio of the upper to the lower energy over all strains, minus one."""
        if not (self.has_lower and self.has_upper):
            return float("inf")
        return float(eigh(self.upper, self.lower, eigvals_only=True)[-1] - 1)

    @property
    def bulk(self) -> Interval:
        """Bounds of the plane-strain bulk modulus K_T = (C11 + C12)/2 or of space's K, in Pa."""
        if self.dimension == 3:
            return self._hill(0)
        low, high = (float(square_moduli(end)[0]) / 2 for end in (self.lower, self.upper))
        return low - 2 * _rounding(self.lower), high + 2 * _rounding(self.upper)

    def shear(self, average: str = AXES) -> Interval:
        """Bounds of the shear modulus of an average, in Pa: of space's, whatever the name."""
        if self.dimension == 3:
            return self._hill(1)
        ends = (square_moduli(end) for end in (self.lower, self.upper))
        with np.errstate(divide="ignore"):  # a mean of 0, of infinity
            low, high = (float(shear_modulus(moduli, average)) for moduli in ends)
        if average == AXES:
            return low, high
        return low - 4 * _rounding(self.lower), high + 4 * _rounding(self.upper)

    def young(self, average: str = AXES) -> Interval:
        """Lower and upper bound of Young's modulus of an average, in Pa.

        E = G (3 − x) with x = G/(K + G/3), where the plane's K is K + G/3 already.
        """
        # E rises with K, in space with G; of the plane it rises up to G = 3/2 K and falls beyond
        (min_shear, max_shear), (min_bulk, max_bulk) = self.shear(average), self.bulk
        shears = np.array([min_shear, np.clip(1.5 * max_bulk, min_shear, max_shear), max_shear])
        low_ratios, high_ratios = (self._ratios(shears, bulk) for bulk in (min_bulk, max_bulk))
        with np.errstate(invalid="ignore"):  # without a bound
            low = shears * (3 - low_ratios) - 8 * UNIT * shears * (3 + low_ratios)
            high = shears * (3 - high_ratios) + 8 * UNIT * shears * (3 + high_ratios)
        unknown = -np.inf  # of the plane E may fall below 0
        if self.dimension == 3:
            low, high, unknown = low[:1], high[-1:], 0.0
        return (
            float(low.min()) if self.has_lower else unknown,
            float(high.max()) if self.has_upper else np.inf,
        )

    def poisson(self, average: str = AXES) -> Interval:
        """Lower and upper bound of Poisson's ratio (1 − x)/2 of an average, x as of `young`."""
        (min_shear, max_shear), (min_bulk, max_bulk) = self.shear(average), self.bulk
        max_ratio, min_ratio = self._ratios(max_shear, min_bulk), self._ratios(min_shear, max_bulk)
        low = (1 - max_ratio) / 2 - 4 * UNIT * (1 + max_ratio)
        return float(low), float((1 - min_ratio) / 2 + 4 * UNIT * (1 + min_ratio))

    def _ratios(self, shear: Array | float, bulk: float) -> Array:
        """G/(K + G/3) within 3 rounding units; K of the plane is K + G/3 already."""
        with np.errstate(divide="ignore", invalid="ignore"):  # of 0 and infinity
            bulk_ratio = bulk / np.asarray(shear)
            return np.asarray(1 / (bulk_ratio if self.dimension == 2 else bulk_ratio + 1 / 3))

    def constants(self) -> Array:
        """Bounds of engineering constants along the axes, in Pa, shape (constants, 2).

        E_x, E_y, ν_xy and G_xy in plane strain; in space E_x, E_y, E_z, ν_yz, ν_xz, ν_xy, G_yz,
        G_xz and G_xy. Moduli are 1/S_kk of the compliance S, ratios −S_ij/S_ii.
        """
        low, high = self._compliance
        slack, n = 4 * UNIT, self.dimension
        with np.errstate(divide="ignore"):
            moduli = np.array([1 - slack, 1 + slack]) / np.diagonal([high, low], 0, 1, 2).T
        ratios = [self._ratio(low, high, i, j) for i, j in SHEARS[n]]
        return np.array([*moduli[:n], *ratios, *moduli[n:]])

    def _ratio(self, low: Array, high: Array, i: int, j: int) -> Interval:
        """Bounds of −S_ij/S_ii from those of S."""
        if not (self.has_lower and self.has_upper):
            return -np.inf, np.inf
        # |x · (S − middle) y| ≤ √(x · D x) √(y · D y)/2 with D = high − low
        middle, slack = (low[i, j] + high[i, j]) / 2, 4 * UNIT
        variances = np.maximum(np.diagonal(high - low)[[i, j]], 0)
        half_width = np.sqrt(variances).prod() / 2 + slack * np.abs(high).max()
        cross_terms = [-middle - half_width, -middle + half_width]
        ratios = np.outer(cross_terms, [1 / high[i, i], 1 / low[i, i]])
        margin = slack * np.abs(ratios).max()
        return float(ratios.min() - margin), float(ratios.max() + margin)

    def _hill(self, modulus: int) -> Interval:
        """Bounds of K (0) or G (1) of Hill's average of a stiffness of space."""
        least, greatest = self._compliance
        low = _hill_mean(self.lower, greatest, modulus, -1) if self.has_lower else 0.0
        high = _hill_mean(self.upper, least, modulus, 1) if self.has_upper else np.inf
        return low, high

    def contains(self, stiffness: Array) -> bool:
        """True if a symmetric stiffness, shape (3, 3), lies between the bounds."""
        ends = stiffness - self.lower, self.upper - stiffness
        return all(bool(np.linalg.eigvalsh(end)[0] >= 0) for end in ends)


def _hill_mean(stiffness: Array, compliance: Array, modulus: int, side: int) -> float:
    """Bound of the mean of Voigt's and Reuss's K (0) or G (1), below (side −1) or above (1)."""
    voigt, reuss = VOIGT[modulus] * stiffness, REUSS[modulus] * compliance
    rounding = 64 * UNIT * (abs(voigt).sum() + abs(reuss).sum() / reuss.sum() ** 2)
    return float((voigt.sum() + 1 / reuss.sum()) / 2 + side * rounding)


def _rounding(stiffness: Array) -> float:
    return UNIT * float(np.abs(stiffness).max())


def inverse_below(matrix: Array) -> Array:
    """Lower bound of the inverses of symmetric matrices ≤ `matrix` (Loewner's order), (…, n, n)."""
    inverse, error = _inverse(matrix)
    return np.asarray(inverse - error)


def inverse_above(matrix: Array) -> Array:
    """Upper bound of the inverses of symmetric matrices ≥ `matrix` (Loewner's order), (…, n, n)."""
    inverse, error = _inverse(matrix)
    return np.asarray(inverse + error)


def _inverse(matrix: Array) -> tuple[Array, Array]:
    """Computed symmetric inverse and a diagonal matrix that bounds its error, (…, n, n) each."""
    # powers of two make the diagonal near 1 without rounding, so that loads of any size count alike
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    scale = 2.0 ** -np.round(np.log2(diagonal) / 2)
    scaled = scale[..., :, None] * matrix * scale[..., None, :]
    # with R = I − X·matrix the true inverse is off by at most ‖R‖‖X‖/(1 − ‖R‖)
    inverse = np.linalg.inv(scaled)
    inverse = (inverse + np.swapaxes(inverse, -1, -2)) / 2
    residual_norm = residual_above(inverse, scaled).sum(axis=-1).max(axis=-1)
    if not np.all(residual_norm < 0.5):
        what = "a bound of the compliance is singular to rounding"
        raise FailedError(what, "lower the contrast of the phases")
    inverse_norm = np.abs(inverse).sum(axis=-1).max(axis=-1)
    error = SAFETY * residual_norm / (1 - residual_norm) * inverse_norm
    squares = (error[..., None] * scale**2)[..., None] * np.eye(matrix.shape[-1])
    return scale[..., :, None] * inverse * scale[..., None, :], squares


def residual_above(inverse: Array, matrix: Array) -> Array:
    """Bound of the magnitudes of I − inverse·matrix, whatever the order of the sums."""
    size = matrix.shape[-1]
    residual = np.abs(np.eye(size) - inverse @ matrix)
    return np.asarray(residual + size * SAFETY * UNIT * (np.abs(inverse) @ np.abs(matrix)))
