"""Truncation of a multipole series: for each cell as late as its declared error asks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import FailedError, RefusedError

Solve = Callable[[Array, int], tuple[Array, Array]]


class SeriesError(FailedError):
    """The multipole series does not reach its tolerance."""


@dataclass(frozen=True)
class Truncation:
    """How a series is continued, and what is said where it ends.

    Args:
        following: The next numbers of terms to try, from those tried.
        most: Largest number of terms.
        terms: Their name in the message, such as "harmonics".
        particles: Name of the particles that nearly touch.
    """

    following: Callable[[Array], Array]
    most: int
    terms: str
    particles: str

    def settle(
        self, radius: Array, inclusions: int, first: Array, solve: Solve, *, tolerance: float
    ) -> tuple[Array, Array, Array]:
        """Moduli of n cells times m inclusions, each with as many terms as it needs.

        Args:
            radius: Radii over half the cell's side, shape (n,).
            inclusions: m.
            first: Numbers of terms to begin with, shape (n,).
            solve: Three moduli of k cells and their declared relative errors, shape (k, m, 3)
                each, from the cells' rows and the number of terms.
            tolerance: Relative error allowed, of the moduli.

        Returns:
            Moduli and declared relative errors, shape (n, m, 3) each, and terms used, (n, m).

        Raises:
            SeriesError: `most` terms do not suffice.
        """
        shape = (radius.size, inclusions)
        moduli, error = np.zeros((*shape, 3)), np.full((*shape, 3), np.inf)
        used, todo = np.zeros(shape, int), np.arange(radius.size)
        terms = np.minimum(first, self.most)
        while todo.size:
            for count in np.unique(terms[todo]):
                rows = todo[terms[todo] == count]
                # what is settled stays, whatever its companions need
                open_ = error[rows].max(axis=2) > tolerance
                values, left = solve(rows, int(count))
                moduli[rows] = np.where(open_[..., None], values, moduli[rows])
                error[rows] = np.where(open_[..., None], left, error[rows])
                used[rows] = np.where(open_, count, used[rows])
            todo = todo[error[todo].max(axis=(1, 2)) > tolerance]
            self._refuse(radius[todo], terms[todo], error[todo], tolerance)
            terms[todo] = np.minimum(self.following(terms[todo]), self.most)
        return moduli, error, used

    def _refuse(self, radius: Array, terms: Array, errors: Array, tolerance: float) -> None:
        """Raise where no more terms are to be had."""
        stuck = terms >= self.most
        if stuck.any():
            raise SeriesError(
                f"the series at r = {radius[stuck].max():.6g} reaches a relative error of"
                f" {errors[stuck].max():.1e} with {self.most} {self.terms}, {tolerance:.1e} is"
                f" allowed: {self.particles} nearly touch",
                "lower the radius or raise the tolerance",
            )


def error_by_more_terms(own: Array, finer: Array, finest: Array) -> Array:
    """Relative distance from the farther of two longer series.

    One alone may meet the value by chance, for changes have either sign.
    """
    return np.asarray(np.maximum(np.abs(own / finer - 1), np.abs(own / finest - 1)))


def require_radii(radius: Array) -> Array:
    """The radii as an array, refused outside [0, 1).

    Raises:
        RefusedError: A radius lies outside.
    """
    radius = np.atleast_1d(np.asarray(radius, float))
    if not (np.all(radius >= 0) and np.all(radius < 1)):
        worst = float(radius[np.argmax(np.abs(radius - 0.5))])
        raise RefusedError("radius", worst, "values in [0, 1) halves of the cell's side")
    return radius
