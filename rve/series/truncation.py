"""Truncation of a multipole series: for each cell as late as its declared error asks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import FailedError, RefusedError

_BATCH = 2_000_000  # entries of one batch of matrices
Solve = Callable[[Array, int], Array]
"""Three moduli of k cells times m inclusions, shape (k, m, 3), from radii and number of terms."""


class SeriesError(FailedError):
    """The multipole series does not reach its tolerance."""


@dataclass(frozen=True, eq=False)
class CellModuli:
    """Moduli of n cells times m inclusions.

    Args:
        moduli: In Pa, shape (n, m, 3): of the plane C11 + C12, C11 − C12 and C33, of space K,
            (C11 − C12)/2 and C44.
        errors: Their declared relative truncation errors, same shape.
        terms: Number of terms that reached it, shape (n, m).
        voigt: Stiffness from the three moduli.
    """

    moduli: Array
    errors: Array
    terms: Array
    voigt: Callable[[Array, Array, Array], Array]

    @property
    def matrix(self) -> Array:
        """Voigt matrices, shape (n, m, 3, 3) of the plane and (n, m, 6, 6) of space, in Pa."""
        return self.voigt(*np.moveaxis(self.moduli, -1, 0))


@dataclass(frozen=True)
class Truncation:
    """Numbers of terms of a series, its error estimate, and the words of its error message.

    Args:
        steps: Numbers of terms to try, rising.
        decay: d in: error ~ exp(−d · terms · arccosh(1/r)).
        unknowns: Of one linear system with so many terms.
        safety: Factor of the estimated error.
        round_off: Relative, of a modulus.
        terms: Their name in the message, such as "harmonics".
        particles: Name of the particles that nearly touch.
        voigt: Stiffness from the three moduli.
    """

    steps: tuple[int, ...]
    decay: float
    unknowns: Callable[[int], int]
    safety: float
    round_off: float
    terms: str
    particles: str
    voigt: Callable[[Array, Array, Array], Array]

    def converged_moduli(
        self, radius: Array, inclusions: int, solve: Solve, *, tolerance: float
    ) -> CellModuli:
        """Moduli of n cells times m inclusions, each with as many terms as its error asks.

        Args:
            radius: Radii over half the cell's side, shape (n,), each in [0, 1).
            inclusions: Number m of inclusions.
            solve: Moduli by the series, from radii and number of terms.
            tolerance: Relative error allowed, of the moduli.

        Raises:
            RefusedError: A radius lies outside [0, 1).
            SeriesError: The largest number of terms does not suffice.
        """
        radius, tolerance = np.atleast_1d(radius), max(tolerance, 2 * self.round_off)
        if not ((radius >= 0) & (radius < 1)).all():
            worst = float(radius[np.argmax(np.abs(radius - 0.5))])
            raise RefusedError("radius", worst, "values in [0, 1) halves of the cell's side")
        steps, shape = np.array(self.steps), (radius.size, inclusions)
        moduli, errors = np.zeros((*shape, 3)), np.full((*shape, 3), np.inf)
        terms, unsolved = np.zeros(shape, int), np.arange(radius.size)
        rate = self.decay * np.arccosh(1 / np.maximum(radius, 1e-3))
        step_index = np.searchsorted(steps, np.log(1 / tolerance) / rate)
        step_index = np.minimum(step_index, steps.size - 1)
        while unsolved.size:
            for step in np.unique(step_index[unsolved]):
                cells = unsolved[step_index[unsolved] == step]
                # results do not depend on which inclusions are solved together
                is_open = errors[cells].max(axis=2) > tolerance
                new_moduli, new_errors = self._moduli_with_errors(
                    radius[cells], inclusions, solve, int(steps[step])
                )
                moduli[cells] = np.where(is_open[..., None], new_moduli, moduli[cells])
                errors[cells] = np.where(is_open[..., None], new_errors, errors[cells])
                terms[cells] = np.where(is_open, steps[step], terms[cells])
            unsolved = unsolved[errors[unsolved].max(axis=(1, 2)) > tolerance]
            failed = unsolved[step_index[unsolved] == steps.size - 1]
            if failed.size:
                raise SeriesError(
                    f"the series at r = {radius[failed].max():.6g} reaches a relative error of"
                    f" {errors[failed].max():.1e} with {self.steps[-1]} {self.terms},"
                    f" {tolerance:.1e} is allowed: {self.particles} nearly touch",
                    "lower the radius or raise the tolerance",
                )
            step_index[unsolved] += 1
        return CellModuli(moduli, errors, terms, self.voigt)

    def _moduli_with_errors(
        self, radius: Array, inclusions: int, solve: Solve, terms: int
    ) -> tuple[Array, Array]:
        """Moduli by a number of terms and their relative errors, shape (k, inclusions, 3) each.

        The error is the distance from the moduli by a quarter and by half more terms, times a
        safety factor.
        """
        counts = terms, terms + max(2, terms // 4), terms + max(4, terms // 2)
        coarse, finer, finest = (
            np.concatenate([solve(part, n) for part in self._batches(radius, inclusions, n)])
            for n in counts
        )
        return coarse, self.safety * error_by_more_terms(coarse, finer, finest) + self.round_off

    def _batches(self, radius: Array, inclusions: int, terms: int) -> Iterator[Array]:
        """Radii in so many parts that matrices stay small."""
        parts = -(-radius.size * inclusions * self.unknowns(terms) ** 2 // _BATCH)
        yield from np.array_split(radius, min(radius.size, parts))


def error_by_more_terms(coarse: Array, finer: Array, finest: Array) -> Array:
    """Relative distance from the farther of two better values.

    One alone may meet the value by chance, for changes have either sign.
    """
    return np.asarray(np.maximum(np.abs(coarse / finer - 1), np.abs(coarse / finest - 1)))
