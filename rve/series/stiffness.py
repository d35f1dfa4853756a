"""Stiffness of the one-particle cell by multipole series, to a declared error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Phase, square_voigt
from alphacut.rve.series.multipoles import LOADS, MOST_HARMONICS, Contrast, modulus, multipoles
from alphacut.rve.series.truncation import Truncation, error_by_more_terms, require_radii

_BATCH = 2_000_000  # entries of one batch of matrices
_ROUND_OFF = 2e-14
_SAFETY = 1.6
_TRUNCATION = Truncation(
    lambda harmonics: harmonics * 4 // 3 + 2, MOST_HARMONICS, "harmonics", "particles"
)


@dataclass(frozen=True)
class SquareStiffness:
    """Plane stiffness of a square-symmetric cell by its three moduli, in Pa.

    Args:
        bulk: C11 + C12, from ε11 = ε22.
        deviator: C11 − C12, from ε11 = −ε22.
        shear: C33, σ12 over 2 ε12.
        errors: Declared relative truncation errors of the three, shape (…, 3).
        harmonics: Harmonics per potential that reached it.
    """

    bulk: Array
    deviator: Array
    shear: Array
    errors: Array
    harmonics: Array

    @property
    def matrix(self) -> Array:
        """Voigt matrices (11, 22, 12 with 2 ε12), shape (…, 3, 3)."""
        return square_voigt(self.bulk, self.deviator, self.shear)


def square_stiffness(
    radius: Array,
    matrix: Phase,
    inclusions: Sequence[Phase],
    *,
    tolerance: float = 1e-12,
    loads: Sequence[str] = LOADS,
) -> SquareStiffness:
    """Stiffness of n cells times m inclusions.

    Args:
        radius: Radii over half the cell's side, shape (n,), each in [0, 1).
        matrix: Material outside the particle.
        inclusions: Materials of the particle, m of them.
        tolerance: Relative truncation error allowed, at least 1e-13.
        loads: Those solved, of `LOADS`; the moduli of others are nan.

    Returns:
        Moduli of shape (n, m).

    Raises:
        RefusedError: A radius lies outside [0, 1).
        SeriesError: The series does not reach `tolerance` (particles nearly in touch).
    """
    radius, count = require_radii(radius), len(inclusions)
    contrast = Contrast.of(matrix, inclusions)

    def solve(rows: Array, harmonics: int) -> tuple[Array, Array]:
        batches = -(-rows.size * count * harmonics**2 // _BATCH)  # so that matrices stay small
        parts = np.array_split(rows, max(1, batches))
        solved = [_solve_batch(radius[part], contrast, harmonics, loads) for part in parts]
        values, errors = zip(*solved, strict=True)
        return np.concatenate(values), np.concatenate(errors)

    moduli, errors, used = _TRUNCATION.settle(
        radius, count, _first_guess(radius, tolerance), solve, tolerance=max(tolerance, _ROUND_OFF)
    )
    bulk, deviator, shear = np.moveaxis(moduli, -1, 0)
    return SquareStiffness(bulk, deviator, shear, errors, used)


def _first_guess(radius: Array, tolerance: float) -> Array:
    """Harmonics for each radius, from the decay of images, in few steps."""
    rate = 8 * np.arccosh(1 / np.maximum(radius, 1e-3))
    steps = np.array([3, 4, 5, 6, 8, 10, 12, 16, 24, 32, 48, 64, 96, 128, MOST_HARMONICS])
    return np.asarray(
        steps[np.minimum(np.searchsorted(steps, np.log(1 / tolerance) / rate), steps.size - 1)]
    )


def _solve_batch(
    radius: Array, contrast: Contrast, count: int, loads: Sequence[str]
) -> tuple[Array, Array]:
    """Moduli and their declared relative errors, shape (rows, m, 3) each.

    They are nan and zero of other loads. A quarter and a half more harmonics tell the error of
    `count`, with a margin.
    """
    counts = count, count + max(2, count // 4), count + max(4, count // 2)
    moduli = np.full((len(counts), radius.size, contrast.kappa_i.size, len(LOADS)), np.nan)
    for load in loads:
        moduli[..., LOADS.index(load)] = [
            modulus(load, multipoles(load, radius, contrast, harmonics=n), radius, contrast)
            for n in counts
        ]
    gap = np.nan_to_num(error_by_more_terms(*moduli))
    return moduli[0], _ROUND_OFF / 10 + _SAFETY * gap
