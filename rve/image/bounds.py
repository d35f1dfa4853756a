"""Bounds of a stiffness in the Loewner order, and what follows from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import FailedError
from alphacut.rve.image.fields.energy import SAFETY, UNIT
from alphacut.rve.result.moduli import AXES, shear_modulus, square_moduli

Interval = tuple[float, float]


@dataclass(frozen=True, eq=False)
class StiffnessBounds:
    """Lower ≤ C ≤ upper as quadratic forms of the mean strain, in Voigt order, (3, 3), in Pa.

    The moduli C11 + C12, C11 − C12 and C33 of the square part are such forms, so that those of the
    ends bound them, and with them whatever rises in each of the three.
    """

    lower: Array
    upper: Array

    @property
    def width(self) -> float:
        """Largest ratio of the upper to the lower energy over all strains, minus one."""
        return float(eigh(self.upper, self.lower, eigvals_only=True)[-1] - 1)

    @property
    def bulk(self) -> Interval:
        """Bounds of the plane-strain bulk modulus K_T = (C11 + C12)/2, in Pa."""
        low, high = (float(square_moduli(end)[0]) / 2 for end in (self.lower, self.upper))
        return low - 2 * self._rounding, high + 2 * self._rounding

    def shear(self, average: str = AXES) -> Interval:
        """Bounds of the shear modulus G_T of an average, in Pa."""
        ends = (square_moduli(end) for end in (self.lower, self.upper))
        low, high = (float(shear_modulus(moduli, average)) for moduli in ends)
        slack = 0.0 if average == AXES else 4 * self._rounding
        return low - slack, high + slack

    def young(self, average: str = AXES) -> Interval:
        """Lower and upper bound of Young's modulus E = 3 G − G²/K of an average, in Pa."""
        # E rises with K; with G it rises up to G = 3/2 K and falls beyond
        (min_shear, max_shear), (min_bulk, max_bulk) = self.shear(average), self.bulk
        low = min(
            _young(shear, min_bulk) - _young_rounding(shear, min_bulk)
            for shear in (min_shear, max_shear)
        )
        stiffest = float(np.clip(1.5 * max_bulk, min_shear, max_shear))  # G of the largest E
        return low, _young(stiffest, max_bulk) + _young_rounding(stiffest, max_bulk)

    def poisson(self, average: str = AXES) -> Interval:
        """Lower and upper bound of Poisson's ratio ν = (1 − G/K)/2 of an average."""
        (min_shear, max_shear), (min_bulk, max_bulk) = self.shear(average), self.bulk
        max_ratio, min_ratio = max_shear / min_bulk, min_shear / max_bulk
        low = (1 - max_ratio) / 2 - UNIT * (1 + max_ratio)
        return low, (1 - min_ratio) / 2 + UNIT * (1 + min_ratio)

    def constants(self) -> Array:
        """Bounds of E_x, E_y (Pa), ν_xy and G_xy (Pa) in plane strain, shape (4, 2)."""
        low, high = inverse_below(self.upper), inverse_above(self.lower)
        slack = 4 * UNIT
        moduli = [(1 / high[k, k] * (1 - slack), 1 / low[k, k] * (1 + slack)) for k in range(3)]
        # S12 differs from the middle of its bounds by at most √(d11 d22)/2 with d = high − low
        middle, difference = (low[0, 1] + high[0, 1]) / 2, high - low
        half_width = np.sqrt(difference[0, 0] * difference[1, 1]) / 2 + slack * abs(high).max()
        cross_terms = [-middle - half_width, -middle + half_width]
        ratios = np.outer(cross_terms, [1 / high[0, 0], 1 / low[0, 0]])  # ν = −S12/S11
        margin = slack * abs(ratios).max()
        poisson = (ratios.min() - margin, ratios.max() + margin)
        return np.array([*moduli[:2], poisson, moduli[2]])

    def contains(self, stiffness: Array) -> bool:
        """True if a symmetric stiffness, shape (3, 3), lies between the bounds."""
        ends = stiffness - self.lower, self.upper - stiffness
        return all(bool(np.linalg.eigvalsh(end)[0] >= 0) for end in ends)

    @property
    def _rounding(self) -> float:
        return UNIT * float(np.abs(self.upper).max())


def _young(shear: float, bulk: float) -> float:
    return 3 * shear - shear * shear / bulk


def _young_rounding(shear: float, bulk: float) -> float:
    return 2 * UNIT * (3 * shear + shear * shear / bulk)


def inverse_below(matrix: Array) -> Array:
    """Lower bound of the inverses of symmetric matrices ≤ `matrix` (Loewner's order), (…, 3, 3)."""
    inverse, error = _inverse(matrix)
    return np.asarray(inverse - error * np.eye(matrix.shape[-1]))


def inverse_above(matrix: Array) -> Array:
    """Upper bound of the inverses of symmetric matrices ≥ `matrix` (Loewner's order), (…, 3, 3)."""
    inverse, error = _inverse(matrix)
    return np.asarray(inverse + error * np.eye(matrix.shape[-1]))


def _inverse(matrix: Array) -> tuple[Array, Array]:
    """Computed symmetric inverse (…, n, n), and a bound of the norm of its error, (…, 1, 1)."""
    # with R = I − X·matrix the true inverse is off by at most ‖R‖‖X‖/(1 − ‖R‖)
    inverse = np.linalg.inv(matrix)
    inverse = (inverse + np.swapaxes(inverse, -1, -2)) / 2
    residual_norm = residual_above(inverse, matrix).sum(axis=-1).max(axis=-1)
    if not np.all(residual_norm < 0.5):
        what = "a bound of the compliance is singular to rounding"
        raise FailedError(what, "lower the contrast of the phases")
    inverse_norm = np.abs(inverse).sum(axis=-1).max(axis=-1)
    error = SAFETY * residual_norm / (1 - residual_norm) * inverse_norm
    return inverse, np.asarray(error[..., None, None])


def residual_above(inverse: Array, matrix: Array) -> Array:
    """Bound of the magnitudes of I − inverse·matrix, whatever the order of the sums."""
    size = matrix.shape[-1]
    residual = np.abs(np.eye(size) - inverse @ matrix)
    return np.asarray(residual + size * SAFETY * UNIT * (np.abs(inverse) @ np.abs(matrix)))
