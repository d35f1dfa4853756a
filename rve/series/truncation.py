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
    """How a series is continued, how it is judged, and what is said where it ends.

    Args:
        steps: Numbers of terms to try, rising.
        decay: What a term takes from the logarithm of the error, over arccosh(1/r).
        unknowns: Of one linear system with so many terms.
        safety: Margin of the estimated error.
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

    def settle(
        self, radius: Array, inclusions: int, solve: Solve, *, tolerance: float
    ) -> CellModuli:
        """Moduli of n cells times m inclusions, each with as many terms as it needs.

        Args:
            radius: Radii over half the cell's side, shape (n,), each in [0, 1).
            inclusions: m.
            solve: The series.
            tolerance: Relative error allowed, of the moduli.

        Raises:
            RefusedError: A radius lies outside [0, 1).
            SeriesError: The last step does not suffice.
        """
        radius, tolerance = np.atleast_1d(radius), max(tolerance, 2 * self.round_off)
        if not ((radius >= 0) & (radius < 1)).all():
            worst = float(radius[np.argmax(np.abs(radius - 0.5))])
            raise RefusedError("radius", worst, "values in [0, 1) halves of the cell's side")
        steps, shape = np.array(self.steps), (radius.size, inclusions)
        moduli, errors = np.zeros((*shape, 3)), np.full((*shape, 3), np.inf)
        used, todo = np.zeros(shape, int), np.arange(radius.size)
        rate = self.decay * np.arccosh(1 / np.maximum(radius, 1e-3))
        step_number = np.searchsorted(steps, np.log(1 / tolerance) / rate)
        step_number = np.minimum(step_number, steps.size - 1)
        while todo.size:
            for step in np.unique(step_number[todo]):
                rows = todo[step_number[todo] == step]
                # what is settled stays, whatever its companions need
                open_ = errors[rows].max(axis=2) > tolerance
                values, left = self._with_error(radius[rows], inclusions, solve, int(steps[step]))
                moduli[rows] = np.where(open_[..., None], values, moduli[rows])
                errors[rows] = np.where(open_[..., None], left, errors[rows])
                used[rows] = np.where(open_, steps[step], used[rows])
            todo = todo[errors[todo].max(axis=(1, 2)) > tolerance]
            ended = todo[step_number[todo] == steps.size - 1]
            if ended.size:
                raise SeriesError(
                    f"the series at r = {radius[ended].max():.6g} reaches a relative error of"
                    f" {errors[ended].max():.1e} with {self.steps[-1]} {self.terms},"
                    f" {tolerance:.1e} is allowed: {self.particles} nearly touch",
                    "lower the radius or raise the tolerance",
                )
            step_number[todo] += 1
        return CellModuli(moduli, errors, used, self.voigt)

    def _with_error(
        self, radius: Array, inclusions: int, solve: Solve, terms: int
    ) -> tuple[Array, Array]:
        """Moduli and their errors, with a margin: a quarter and a half more terms tell them."""
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
