"""Results of a cell with a sphere as documents and lines, and what spheres change by the bounds."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from alphacut.case.case import Case
from alphacut.case.checks_material import taking_spheres
from alphacut.io.files import Document
from alphacut.io.units import fixed
from alphacut.rve.anisotropy import ratio_of
from alphacut.rve.bounds import mori_tanaka as of_cylinders
from alphacut.rve.cell import STRAIN, Phase
from alphacut.rve.result import effective_modulus
from alphacut.rve.spheres.bounds import mori_tanaka as of_spheres
from alphacut.rve.spheres.cubic import cubic_voigt, hill_average, young_along
from alphacut.rve.spheres.result import HomogenisedSpheres
from alphacut.stochastic.particles.csv_columns import has_places

GPA = 1e9
WORDS = re.compile(
    r"\b((micro)?spher\w*|aggregates?|(cenosphere|grain|bead|ball|pebble|granule)s?|gravel|sand"
    r"|siev(e\w*|ing)|diameters? of (the )?particles?|particle (size|diameter)s?"
    r"|\w*kugel\w*|\w*(körner|körnung)\w*|korn(größe|durchmesser)\w*|zuschl[aä]g\w*|kies|splitt"
    r"|sieb(linie|durchgang|weite)?\w*)\b",
    re.IGNORECASE,
)
"""Words for particles that are round in every section."""
LONG = re.compile(
    r"\b(\w*(fibre|fiber|faser)\w*|(wire|rod|rebar|tube|cylinder|whisker)s?|\w*zylinder\w*"
    r"|stäben?|drähten?)\b",
    re.IGNORECASE,
)
"""Words for particles that are long."""


def moduli(result: HomogenisedSpheres) -> Document:
    """What a document says besides E and ν, in GPa: see the keys."""
    bulk, deviator, shear = result.moduli / GPA
    along = young_along(result.moduli) / GPA
    return {
        "E_along_GPa": {"100": along[0], "111": along[1]},
        "K_GPa": bulk,
        "G_GPa": [shear, deviator],
        "C_GPa": np.asarray(result.stiffness) / GPA,
        "shear_ratio": ratio_of(result)[0],
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
        "shear_ratio": ratio_of(result)[1],
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


def remark(case: Case, share: float, matrix: Phase, inclusion: Phase) -> str | None:
    """Warning to a user of cylinders whose words or data say spheres, with the difference's size.

    None where nothing says so, or where the case names cylinders itself. The difference is that of
    the bounds of Hashin and Shtrikman that the matrix gives, in the plane and in space, at one
    fraction, the area's share.
    """
    told = says_spheres(case)
    if told is None:
        return None
    bulk, _, shear = of_cylinders(np.asarray(share), matrix, inclusion)
    plane, _ = effective_modulus(STRAIN * bulk, 2 * STRAIN * shear)
    k, mu = of_spheres(np.asarray(share), matrix, inclusion)
    space = float(hill_average(np.array([k, mu, mu]))[0])
    return (
        f"cell.particles: {told}, and the particles are cylinders; of"
        f" spheres at the same volume fraction {share:.4f} the Hashin–Shtrikman bound of E is"
        f" {space / GPA:.2f} GPa, of cylinders {plane / GPA:.2f} GPa"
        f" ({100 * (space / plane - 1):+.1f} %); {cure(case)}"
    )


def unmeasured(case: Case) -> Iterator[str]:
    """That warning before the fraction is known: without the size of the difference."""
    if case.cell.particles == "cylinders" and (told := says_spheres(case)) is not None:
        yield (
            f"cell.particles: {told}, and the particles are cylinders, whose E is lower than that"
            f" of stiffer spheres; {cure(case)}"
        )


def cure(case: Case) -> str:
    """What takes spheres, and what ends the warning."""
    return f'"cylinders" there ends this warning, spheres are taken by {taking_spheres(case)}'


def says_spheres(case: Case) -> str | None:
    """What of a case says that its particles are round in space; None where nothing does.

    A word does, and so do sizes without places, which are of particles out of their matrix; neither
    where another word says that they are long, or the case names their kind. Sizes with places are
    of a section, as those of an image are.
    """
    if case.names_particles or LONG.search(case.words):
        return None
    if word := WORDS.search(case.words):
        return f"the case says {word.group(0)!r}"
    given = case.sections.microstructure
    file = given and given.packing and given.packing.file
    if not file or has_places(case.beside(file)):
        return None
    return f"{file} has sizes without places, as of particles that were sieved"
