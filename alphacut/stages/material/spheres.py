"""Results of a cell with a sphere as documents and lines, and what spheres change by the bounds."""

from __future__ import annotations

import numpy as np

from alphacut.io.files import Document
from alphacut.io.units import fixed
from alphacut.rve.cell import STRAIN
from alphacut.rve.spheres.cubic import cubic_voigt, hill_average, young_along
from alphacut.rve.spheres.result import HomogenisedSpheres

GPA = 1e9


def moduli(result: HomogenisedSpheres) -> Document:
    """What a document says besides E and ν, in GPa: see the keys."""
    bulk, deviator, shear = result.moduli / GPA
    along = young_along(result.moduli) / GPA
    return {
        "E_along_GPa": {"100": along[0], "111": along[1]},
        "K_GPa": bulk,
        "G_GPa": [shear, deviator],
        "C_GPa": np.asarray(result.stiffness) / GPA,
        "shear_ratio": result.shear_ratio[0],
    }


def declared_errors(result: HomogenisedSpheres) -> Document | None:
    """Declared absolute error of every number of a document; None without any."""
    if not result.errors:
        return None
    modulus, nu = result.error_of(hill_average)
    # mean σ11 and σ12 under eq. 15, ε33 = 0, from K, (C11 − C12)/2 and C44
    s11, s12 = (
        result.error_of(lambda k: STRAIN * np.array([2 * k[0] + 2 / 3 * k[1], 2 * k[2]])) / GPA
    )
    along = result.error_of(young_along) / GPA
    bulk, deviator, shear = result.error_of(lambda values: values) / GPA
    return {
        "E_GPa": modulus / GPA,
        "nu": nu,
        "stress_GPa": {"s11": s11, "s12": s12},
        "E_along_GPa": {"100": along[0], "111": along[1]},
        "K_GPa": bulk,
        "G_GPa": [shear, deviator],
        "C_GPa": result.error_of(lambda values: cubic_voigt(*values)) / GPA,
        "shear_ratio": result.shear_ratio[1],
        "curve": None,
    }


def lines(result: HomogenisedSpheres) -> str:
    """The result for people, every number with its declared error."""
    found, error = {"E_GPa": result.modulus / GPA, **moduli(result)}, declared_errors(result)
    off = error or dict.fromkeys(found, 0.0)
    along, slack = found["E_along_GPa"], off["E_along_GPa"]
    first, second = found["G_GPa"]
    return (
        f"E = {fixed(found['E_GPa'], 6)} ± {off['E_GPa']:.1e} GPa, nu = {result.poisson:.6f} ±"
        f" {off['nu']:.1e} (Hill's isotropic average)\n"
        f"E along 100 = {fixed(along['100'], 6)} ± {slack['100']:.1e} GPa, along 111 ="
        f" {fixed(along['111'], 6)} ± {slack['111']:.1e} GPa\n"
        f"K = {fixed(found['K_GPa'], 6)} ± {off['K_GPa']:.1e} GPa, C44 = {fixed(first, 6)} ±"
        f" {off['G_GPa'][0]:.1e} GPa, (C11 - C12)/2 = {second:.6f} ± {off['G_GPa'][1]:.1e} GPa\n"
        f"{result.method}: {result.reason}; {result.seconds['total']:.3f} s\n"
    )
