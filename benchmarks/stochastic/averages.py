"""Averages of the one-particle cell beside direct homogenisation and bounds.

The paper averages the stress over θ at equal strain: over the cells of the material this is a Voigt
average of their stiffness. The same cells averaged at equal stress give a Reuss average; the truth
may lie anywhere near, for cells neither strain nor stress alike. All moduli are those of the
isotropic material nearest to a stiffness, so that cells and square arrays compare.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.rve import bounds
from alphacut.rve.bounds import hashin_shtrikman_bulk, reuss, voigt
from alphacut.rve.cell import Phase
from alphacut.stochastic.theta.truncated_normal import Array


@dataclass(frozen=True)
class Isotropic:
    """In-plane moduli of the isotropic material nearest to a plane stiffness.

    Args:
        bulk: In-plane bulk modulus, in Pa.
        shear: Mean of the two shear moduli, in Pa.
    """

    bulk: float
    shear: float

    @classmethod
    def of(cls, stiffness: Array) -> Isotropic:
        """Projection of a Voigt matrix (11, 22, 12 with 2 ε12), shape (3, 3)."""
        c = stiffness
        return cls(
            float(c[0, 0] + c[1, 1] + 2 * c[0, 1]) / 4,
            float((c[0, 0] + c[1, 1] - 2 * c[0, 1]) / 4 + c[2, 2]) / 2,
        )

    @property
    def modulus(self) -> float:
        """Young's modulus of eq. 16 from A = 2 G and B = 2 K, in Pa."""
        poisson = (1 - self.shear / self.bulk) / 2
        return 2 * self.shear * (1 + poisson)


def mori_tanaka(fraction: float, matrix: Phase, inclusion: Phase) -> Isotropic:
    """Round aligned fibres in plane strain (Mori & Tanaka 1973)."""
    moduli = bounds.mori_tanaka(np.asarray(fraction), matrix, inclusion)
    return Isotropic(float(moduli[0]) / 2, float(moduli[2]))


@dataclass(frozen=True)
class Averages:
    """Moduli that are to be compared with those of many-particle cells.

    Args:
        one_particle: Voigt average of the square cells over the sample of r_n: the paper's model.
        equation_16: The same mean with the shear modulus along the array's axes alone, as eq. 16
            takes it; so E of `alphacut cell` is made.
        equal_stress: Reuss average of the same cells.
        single: Square cell of the mean area fraction.
        mori_tanaka: Estimate for round fibres; for stiffer particles the isotropic lower bound.
        upper: Isotropic upper bound (phases exchanged).
        voigt: Uniform strain in both phases.
        reuss: Uniform stress in both phases.
        bulk_bounds: Hashin–Shtrikman bounds of the in-plane bulk modulus, in Pa.
    """

    one_particle: Isotropic
    equation_16: Isotropic
    equal_stress: Isotropic
    single: Isotropic
    mori_tanaka: Isotropic
    upper: Isotropic
    voigt: Isotropic
    reuss: Isotropic
    bulk_bounds: tuple[float, float]


def averages(radii: Array, weights: Array, matrix: Phase, inclusion: Phase) -> Averages:
    """Averages over a sample of r_n.

    Args:
        radii: r_n below 1, shape (n,).
        weights: Shares of area, shape (n,), sum 1.
        matrix: Material outside the particles.
        inclusion: Material of the particles.
    """
    from alphacut.rve.series.stiffness import square_stiffness

    fraction = float(np.pi / 4 * weights @ radii**2)  # eq. 10
    places = np.append(radii, np.sqrt(4 * fraction / np.pi))
    # a smooth function of the radius: interpolated
    grid = np.linspace(0, max(float(places.max()), 0.05) + 1e-9, 120)
    table = square_stiffness(grid, matrix, [inclusion]).matrix[:, 0]
    cells = _interpolated(places, grid, table)
    single, cells = cells[-1], cells[:-1]
    mean = np.tensordot(weights, cells, axes=1)
    compliant = np.linalg.inv(np.tensordot(weights, np.linalg.inv(cells), axes=1))
    low, high = hashin_shtrikman_bulk(np.asarray(fraction), matrix, inclusion)
    return Averages(
        Isotropic.of(mean),
        Isotropic(Isotropic.of(mean).bulk, float(mean[2, 2])),
        Isotropic.of(compliant),
        Isotropic.of(single),
        mori_tanaka(fraction, matrix, inclusion),
        mori_tanaka(1 - fraction, inclusion, matrix),
        Isotropic.of(voigt(np.asarray(fraction), matrix, inclusion)),
        Isotropic.of(reuss(np.asarray(fraction), matrix, inclusion)),
        (float(low), float(high)),
    )


def _interpolated(places: Array, grid: Array, table: Array) -> Array:
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(grid, table)(places))
