"""Analytical references of a cell's modulus: Hashin–Shtrikman bounds, Mori–Tanaka estimates."""

from __future__ import annotations

import numpy as np

from alphacut.case.case import Case
from alphacut.fuzzy.arrays import Array
from alphacut.io.files import Document
from alphacut.rve import bounds as plane
from alphacut.rve.cell import STRAIN, Phase
from alphacut.rve.result import effective_modulus
from alphacut.rve.spheres import bounds as space
from alphacut.rve.spheres.cubic import hill_average
from alphacut.rve.spheres.result import volume_fraction
from alphacut.stages.material.cell import GPA, modal_parts
from alphacut.stochastic import RadiusMap, gauss_rule


def mean_share(radius: RadiusMap, particles: str) -> float:
    """Mean part of the material that the particles take, by the law of θ."""
    rule = gauss_rule(radius.distribution, points=40)
    radii = radius(rule.nodes)
    part = volume_fraction(radii) if particles == "spheres" else np.pi / 4 * radii**2
    return float(rule.mean(part))


def across(moduli: Array) -> float:
    """Young's modulus of eq. 16 in Pa of an isotropic plane with bulk and shear `moduli`, (2,)."""
    bulk, shear = 2 * STRAIN * moduli
    return effective_modulus(float(bulk), float(shear))[0]


def young(moduli: Array) -> float:
    """Young's modulus in Pa of an isotropic material with bulk and shear `moduli`, (2,)."""
    bulk, shear = moduli
    return float(hill_average(np.array([bulk, shear, shear]))[0])


def references(case: Case) -> Document:
    """Fraction of the particles, bounds and estimate of E in GPa at the modal inputs."""
    radius, matrix, inclusion = modal_parts(case)
    share = mean_share(radius, case.cell.particles)
    of = of_spheres if case.cell.particles == "spheres" else of_fibres
    (low, high), estimate = of(share, matrix, inclusion)
    return {
        "fraction": share,
        "hashin_shtrikman_E_GPa": [low / GPA, high / GPA],
        "mori_tanaka_E_GPa": estimate / GPA,
    }


def of_fibres(share: float, matrix: Phase, inclusion: Phase) -> tuple[tuple[float, float], float]:
    """Bounds and estimate of E in Pa of long fibres in plane strain."""
    at = np.asarray(share)
    ends = plane.hashin_shtrikman(at, matrix, inclusion)
    whole, _, shear = plane.mori_tanaka(at, matrix, inclusion)
    return (across(ends[:, 0]), across(ends[:, 1])), across(np.array([whole / 2, shear]))


def of_spheres(share: float, matrix: Phase, inclusion: Phase) -> tuple[tuple[float, float], float]:
    """Bounds and estimate of E in Pa of spheres."""
    at = np.asarray(share)
    ends = space.hashin_shtrikman(at, matrix, inclusion)
    estimate = young(space.mori_tanaka(at, matrix, inclusion))
    return (young(ends[:, 0]), young(ends[:, 1])), estimate
