"""Bounds of a stiffness in the Loewner order, and what follows from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from alphacut.rve.cell import square_moduli
from alphacut.rve.image.fields.energy import SAFETY, UNIT
from alphacut.stochastic.theta.truncated_normal import Array


@dataclass(frozen=True, eq=False)
class StiffnessBounds:
    """Lower ≤ C ≤ upper as quadratic forms of the mean strain.

    Args:
        lower: Voigt order (11, 22, 12 with 2 ε12), shape (3, 3), in Pa.
        upper: Same.
    """

    lower: Array
    upper: Array

    @property
    def width(self) -> float:
        """Largest ratio of the upper to the lower energy over all strains, minus one."""
        return float(eigh(self.upper, self.lower, eigvals_only=True)[-1] - 1)

    @property
    def bulk(self) -> tuple[float, float]:
        """Bounds of B = (C11 + C22)/2 + C12, in Pa, the energy of equal strains."""
        return _form(self.lower, EQUAL), _form(self.upper, EQUAL)

    @property
    def shear(self) -> tuple[float, float]:
        """Bounds of A = 2 C1212, in Pa."""
        return 2 * float(self.lower[2, 2]), 2 * float(self.upper[2, 2])

    @property
    def modulus(self) -> tuple[float, float]:
        """Bounds of Young's modulus of eq. 16, E = 3 A/2 − A²/(2 B), in Pa.

        E rises with B, and with A as far as A = 3/2 B.
        """
        (softest, stiffest), (least, most) = self.shear, self.bulk
        low = min(_young(softest, least), _young(stiffest, least))
        high = _young(float(np.clip(1.5 * most, softest, stiffest)), most)
        slack = 16 * UNIT * stiffest * (1.5 + stiffest / (2 * least))
        return low - slack, high + slack

    def require_rising(self, cure: str) -> None:
        """Raise ValueError where E may fall with A, for what rests on E rising with both."""
        if not (steepest := self.shear[1] / self.bulk[0]) < 1.5:
            what = f"A, twice the shear modulus, may be {steepest:.3g} times the bulk modulus B"
            raise ValueError(f"{what}, and from 1.5 times on E of eq. 16 falls as A rises: {cure}")

    @property
    def relative_error(self) -> Array:
        """Errors of C11 + C12, C11 − C12 and C33 of the middle of the bounds, shape (3,).

        Each is a quadratic form: the true one lies from middle/(1 + error) to middle·(1 + error).
        """
        lower, upper = square_moduli(self.lower), square_moduli(self.upper)
        return np.asarray((lower + upper) / 2 / lower - 1)

    def contains(self, stiffness: Array) -> bool:
        """True if a symmetric stiffness, shape (3, 3), lies between the bounds."""
        return bool(
            np.linalg.eigvalsh(stiffness - self.lower)[0] >= 0
            and np.linalg.eigvalsh(self.upper - stiffness)[0] >= 0
        )


EQUAL = np.array([1.0, 1.0, 0.0])


def _young(a: float, b: float) -> float:
    return 1.5 * a - a * a / (2 * b)


def _form(stiffness: Array, strain: Array) -> float:
    return float(strain @ stiffness @ strain) / 2


def inverse_below(matrix: Array) -> Array:
    """Matrix below the inverse of every symmetric matrix up to the given one, shape (…, 3, 3).

    With X the computed inverse and R = I − X·matrix, the true one differs from X by at most
    ‖R‖‖X‖/(1 − ‖R‖), rounding of R included.
    """
    inverse = np.linalg.inv(matrix)
    inverse = (inverse + np.swapaxes(inverse, -1, -2)) / 2
    size = len(matrix[0]) if matrix.ndim == 2 else matrix.shape[-1]
    residual = np.abs(np.eye(size) - inverse @ matrix) + (size + 2) * UNIT * (
        np.abs(inverse) @ np.abs(matrix) + np.eye(size)
    )
    gap = residual.sum(axis=-1).max(axis=-1)
    if not np.all(gap < 0.5):
        raise ValueError(
            "a bound of the compliance is singular to rounding; lower the contrast of the phases"
        )
    error = SAFETY * gap / (1 - gap) * np.abs(inverse).sum(axis=-1).max(axis=-1)
    return np.asarray(inverse - error[..., None, None] * np.eye(size))
