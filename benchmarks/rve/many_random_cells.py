"""Periodic cubes of random spheres of one size, on four grids, and what their mean may be off by.

All cells are solved on the coarsest of four grids, the first few on all four. The mean of the
many is corrected by the mean difference of the few between their coarsest grid and the limit of an
endlessly fine one, from the three finer grids: the moduli of laminate voxels converge as the square
of the voxel's width.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context

import numpy as np
from scipy.stats import t as students_t

from alphacut.rve.cell import Phase
from alphacut.stochastic.errors import RefusedError
from alphacut.stochastic.spheres.packing import SpherePacking
from alphacut.stochastic.spheres.spheres import Spheres
from alphacut.stochastic.theta.truncated_normal import Array
from benchmarks.rve.voxels.stiffness import stiffness_of
from benchmarks.rve.voxels.voxels import voxels_of

Quantity = Callable[[Array], Array]  # of moduli (…, 3), K, (C11 − C12)/2 and C44: shape (…)
REFINEMENTS = (1.0, 1.75, 2.6, 3.75)  # the last three make the limit
SOLVER = 1e-6  # relative error of the energies that the solver may leave
_AMPLIFIED = 3  # what extrapolation makes of it, at most
LEVEL = 0.95
_LIMITS, _REST = 3.0, 0.5  # of the extrapolation's error; see `limit_of_grids`
_ATTEMPTS = 100


@dataclass(frozen=True)
class RandomCells:
    """Specification of periodic cubes of random spheres.

    Args:
        packing: Number of spheres in each, volume fraction and law of the radii.
        cells: How many, at least 8.
        refined: How many of them on all four grids, from 4 to `cells`.
        resolution: Voxels along the mean spacing of the spheres on the coarsest grid, from 4 on.

    Raises:
        ValueError: A value lies outside its range.
    """

    packing: SpherePacking
    cells: int = 60
    refined: int = 8
    resolution: float = 8.0

    def __post_init__(self) -> None:
        if not 4 <= self.refined <= self.cells or self.cells < 8:
            raise ValueError(
                f"{self.cells} cells, {self.refined} of them refined, are asked for; take at least"
                " 8, and from 4 of them to all refined"
            )
        if not 4 <= self.resolution <= 100:
            raise ValueError(
                f"the resolution is {self.resolution:g} voxels a sphere; it must lie in [4, 100]"
            )

    @property
    def grids(self) -> tuple[int, int, int, int]:
        """Voxels along an edge, four odd numbers that rise."""
        coarse, first, second, third = (
            smooth_odd(self.resolution * factor * np.cbrt(self.packing.spheres))
            for factor in REFINEMENTS
        )
        return coarse, first, second, third

    def cell(self, number: int, seed: int) -> Spheres:
        """Packing `number`, the same in whatever order and number of processes.

        Raises:
            RefusedError: No packing in 100 attempts.
        """
        generator = np.random.default_rng([seed, self.packing.spheres, number])
        for _ in range(_ATTEMPTS - 1):
            try:
                return self.packing.make(generator)
            except RefusedError:
                continue
        return self.packing.make(generator)

    def solve(self, matrix: Phase, inclusion: Phase, *, seed: int, workers: int = 1) -> CellSample:
        """Moduli of all cells.

        Args:
            matrix: Material between the spheres.
            inclusion: Material of the spheres.
            seed: Of the packings.
            workers: Processes.

        Raises:
            RefusedError: Spheres find no place.
            RuntimeError: A solver does not converge.
        """
        task = partial(self._moduli, matrix=matrix, inclusion=inclusion, seed=seed)
        if workers == 1:
            found = [task(number) for number in range(self.cells)]
        else:
            with ProcessPoolExecutor(workers, mp_context=get_context("forkserver")) as pool:
                found = list(pool.map(task, range(self.cells)))
        coarse = np.array([moduli[0] for moduli in found])
        return CellSample(self, coarse, np.array(found[: self.refined]))

    def _moduli(self, number: int, *, matrix: Phase, inclusion: Phase, seed: int) -> Array:
        """Moduli of one cell, shape (grids, 3), in Pa."""
        spheres = self.cell(number, seed)
        grids = self.grids if number < self.refined else self.grids[:1]
        return np.array(
            [
                stiffness_of(voxels_of(spheres, grid), matrix, inclusion, accuracy=SOLVER).moduli
                for grid in grids
            ]
        )


@dataclass(frozen=True, eq=False)
class CellSample:
    """Moduli of cells of one size.

    Args:
        cells: What was asked for.
        coarse: K, (C11 − C12)/2 and C44 of each cell on the coarsest grid, shape (cells, 3), in Pa.
        refined: The same of the first cells on all grids, shape (refined, 4 grids, 3), in Pa.
    """

    cells: RandomCells
    coarse: Array
    refined: Array

    def mean(self, quantity: Quantity) -> SampleMean:
        """Mean of a quantity over the cells, for an endlessly fine grid."""
        coarse, few, grids = quantity(self.coarse), quantity(self.refined), self.cells.grids[1:]
        corrections = limit_of_grids(few[:, 1:].T, grids)[0] - few[:, 0]
        value = float(coarse.mean() + corrections.mean())
        _, error = limit_of_grids(self.refined[:, 1:].mean(axis=0), grids)
        half = half_width(coarse) + half_width(corrections)
        return SampleMean(value, half, error * value, _AMPLIFIED * SOLVER * value)


@dataclass(frozen=True)
class SampleMean:
    """Mean of a quantity over cells of one size.

    Args:
        value: The mean.
        statistics: Half the 95 % interval of the mean.
        discretisation: What the grids may leave.
        solver: What the iteration may leave.
    """

    value: float
    statistics: float
    discretisation: float
    solver: float


def limit_of_grids(values: Array, grids: tuple[int, int, int]) -> tuple[Array, float]:
    """Limits of values on three grids whose error falls as the square of the voxel.

    The declared relative error, one for all values because one alone may be near by chance, is the
    largest of three times the distance between the limits by the finer and by the coarser two
    grids, and half of what the finest grid still lacks.

    Args:
        values: On grids that become finer, shape (3, …).
        grids: Voxels along an edge.

    Returns:
        Limits, shape (…), and the relative error.
    """
    first, second, third = (grid**2 for grid in grids)
    coarser = (values[1] * second - values[0] * first) / (second - first)
    finer = (values[2] * third - values[1] * second) / (third - second)
    error = _LIMITS * abs(finer - coarser) + _REST * abs(finer - values[2])
    return finer, float((error / abs(finer)).max())


def half_width(values: Array) -> float:
    """Half of the 95 % interval of the mean of independent values, by Student's t."""
    count = len(values)
    quantile = float(students_t.ppf((1 + LEVEL) / 2, count - 1))
    return float(quantile * values.std(ddof=1) / np.sqrt(count))


def smooth_odd(length: float) -> int:
    """The odd number nearest to `length`, at least 3, without prime factors above 13."""
    start = max(3, round(length))
    near = sorted(range(3, 2 * start + 3, 2), key=lambda n: abs(n - length))
    return next(n for n in near if _is_smooth(n))


def _is_smooth(number: int) -> bool:
    for prime in (3, 5, 7, 11, 13):
        while number % prime == 0:
            number //= prime
    return number == 1
