"""Moduli of a random material of spheres from cells of two sizes, with an error in parts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.rve.cell import Phase
from alphacut.rve.certificate import ROUND_OFF, CertificateError
from alphacut.rve.spheres.bounds import hashin_shtrikman
from alphacut.stochastic.theta.truncated_normal import Array
from benchmarks.rve.many_random_cells import CellSample, Quantity, RandomCells


@dataclass(frozen=True)
class Declared:
    """A modulus and by how much it may be off, in parts; all in Pa.

    Args:
        value: The modulus.
        statistics: Half the 95 % interval over the larger cells.
        discretisation: What the grids may leave.
        solver: What the iteration may leave.
        finite_size: What the cells' size may leave; see `between_sizes`.
    """

    value: float
    statistics: float
    discretisation: float
    solver: float
    finite_size: float

    @property
    def error(self) -> float:
        """The parts' sum."""
        return self.statistics + self.discretisation + self.solver + self.finite_size


@dataclass(frozen=True)
class RandomMaterial:
    """Isotropic moduli of many random spheres.

    Args:
        young: E.
        bulk: K.
        shear: μ, of each cell the mean over all directions.
        volume_fraction: Share of spheres.
        sizes: Spheres in a cell of each size.
        smaller: Means of E, K and μ of the smaller cells, in Pa, shape (3,).
    """

    young: Declared
    bulk: Declared
    shear: Declared
    volume_fraction: float
    sizes: tuple[int, int]
    smaller: Array


def random_material(
    smaller: RandomCells,
    larger: RandomCells,
    matrix: Phase,
    inclusion: Phase,
    *,
    seed: int,
    workers: int = 1,
) -> RandomMaterial:
    """Moduli of a material of random spheres.

    Args:
        smaller: Cells of fewer spheres.
        larger: Cells of at least twice as many, of the same volume fraction and radii.
        matrix: Material between the spheres.
        inclusion: Material of the spheres.
        seed: Of the packings.
        workers: Processes.

    Raises:
        ValueError: The two do not fit one another.
        RefusedError: Spheres find no place.
        RuntimeError: A solver does not converge.
        CertificateError: A modulus lies outside the Hashin–Shtrikman bounds by more than its error.
    """
    few, many = smaller.packing, larger.packing
    if (few.volume_fraction, few.radii) != (many.volume_fraction, many.radii):
        raise ValueError("cells of two sizes need the same volume fraction and law of radii")
    if many.spheres < 2 * few.spheres:
        raise ValueError(
            f"the cells have {few.spheres} and {many.spheres} spheres; the larger need at least"
            " twice as many as the smaller"
        )
    first, second = (
        cells.solve(matrix, inclusion, seed=seed, workers=workers) for cells in (smaller, larger)
    )
    found = material_of(first, second)
    _require_bounds(found, matrix, inclusion)
    return found


def material_of(smaller: CellSample, larger: CellSample) -> RandomMaterial:
    """Moduli from solved cells of two sizes."""
    packing = larger.cells.packing
    young, bulk, shear = (between_sizes(smaller, larger, quantity) for quantity in ISOTROPIC)
    return RandomMaterial(
        young,
        bulk,
        shear,
        packing.volume_fraction,
        (smaller.cells.packing.spheres, packing.spheres),
        np.array([smaller.mean(quantity).value for quantity in ISOTROPIC]),
    )


def between_sizes(smaller: CellSample, larger: CellSample, quantity: Quantity) -> Declared:
    """Mean over the larger cells, and what their size may leave.

    A bias that falls at least as 1/N from n to N spheres is at N at most n/(N − n) of the
    difference between the two; this is known up to the statistics and the grids of both.
    """
    few, many = smaller.mean(quantity), larger.mean(quantity)
    sizes = [sample.cells.packing.spheres for sample in (smaller, larger)]
    share = sizes[0] / (sizes[1] - sizes[0])
    noise = np.hypot(few.statistics, many.statistics) + abs(
        few.discretisation - many.discretisation
    )
    return Declared(
        many.value,
        many.statistics,
        many.discretisation,
        many.solver,
        float(share * (abs(few.value - many.value) + noise)),
    )


def isotropic_shear(moduli: Array) -> Array:
    """Mean over all directions of the shear modulus at equal strain, of moduli (…, 3)."""
    return np.asarray((2 * moduli[..., 1] + 3 * moduli[..., 2]) / 5)


def isotropic_bulk(moduli: Array) -> Array:
    """K of moduli (…, 3)."""
    return np.asarray(moduli[..., 0])


def isotropic_young(moduli: Array) -> Array:
    """E of K and the mean shear modulus, of moduli (…, 3)."""
    bulk, shear = isotropic_bulk(moduli), isotropic_shear(moduli)
    return np.asarray(9 * bulk * shear / (3 * bulk + shear))


ISOTROPIC: tuple[Quantity, ...] = (isotropic_young, isotropic_bulk, isotropic_shear)


def _require_bounds(found: RandomMaterial, matrix: Phase, inclusion: Phase) -> None:
    """Raise where K or μ leaves the bounds of Hashin and Shtrikman."""
    limits = hashin_shtrikman(np.array(found.volume_fraction), matrix, inclusion)
    names = ("bulk modulus", "shear modulus")
    for name, own, (low, high) in zip(names, (found.bulk, found.shear), limits, strict=True):
        if max(low - own.value, own.value - high) > own.error + ROUND_OFF * own.value:
            raise CertificateError(
                f"the {name} {own.value:.6g} Pa with its error {own.error:.2g} Pa lies outside the"
                f" Hashin–Shtrikman bounds, {low:.6g} … {high:.6g} Pa; do not use this result"
            )
