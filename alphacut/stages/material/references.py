"""What other composites of the same phases and fraction have: bounds and estimates beside E."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.case.case import Case
from alphacut.io.files import Document, say
from alphacut.rve import bounds as plane
from alphacut.rve.anisotropy import plane_average
from alphacut.rve.cell import STRAIN, Phase
from alphacut.rve.result import effective_modulus
from alphacut.rve.spheres import bounds as space
from alphacut.rve.spheres.cubic import hill_average
from alphacut.rve.spheres.result import volume_fraction
from alphacut.stages.material.cell import modal_values, parts
from alphacut.stages.material.spheres import says_spheres
from alphacut.stochastic import HermiteMap, gauss_rule
from alphacut.stochastic.theta.truncated_normal import Array

GPA = 1e9
SLACK = 1e-4
"""Share of E by which it may pass a bound without a warning: what models of the cell declare."""


@dataclass(frozen=True)
class References:
    """Young's moduli of isotropic composites, in Pa, in the convention of eq. 16.

    Args:
        particles: "cylinders" or "spheres": what the cell has.
        fraction: Their part of the material.
        fibres: Hashin and Shtrikman's bounds of long parallel fibres, across them.
        fibres_estimate: Mori and Tanaka's estimate of round ones.
        spheres: Hashin and Shtrikman's bounds in space.
        spheres_estimate: Mori and Tanaka's estimate of spheres.
        average: Isotropic average of the array's whole plane stiffness (mean of Voigt's and Reuss's
            over all directions, Hill 1952); None where E is such an average itself, or unknown.
    """

    particles: str
    fraction: float
    fibres: tuple[float, float]
    fibres_estimate: float
    spheres: tuple[float, float]
    spheres_estimate: float
    average: float | None

    def document(self) -> Document:
        """In GPa."""
        ends = {name: getattr(self, name) for name in ("fibres", "spheres")}
        return {
            "fraction": self.fraction,
            **{
                name: {
                    "hashin_shtrikman_E_GPa": [low / GPA, high / GPA],
                    "mori_tanaka_E_GPa": getattr(self, f"{name}_estimate") / GPA,
                }
                for name, (low, high) in ends.items()
            },
            "isotropic_average_E_GPa": None if self.average is None else self.average / GPA,
        }


def references(
    radius: HermiteMap,
    phases: tuple[Phase, Phase],
    moduli: tuple[float, float],
    ratio: float | None,
    particles: str,
) -> References:
    """The composites beside a cell.

    Args:
        radius: Its map.
        phases: Matrix and particle.
        moduli: Its E in Pa and ν, of eq. 16 or of Hill's average.
        ratio: Shear modulus along the diagonals over that along the axes; None where unknown.
        particles: "cylinders" or "spheres".
    """
    rule = gauss_rule(radius.distribution, points=40)
    radii = radius(rule.nodes)
    part = volume_fraction(radii) if particles == "spheres" else np.pi / 4 * radii**2
    share = np.asarray(rule.mean(part), float)
    in_plane, in_space = (
        plane.hashin_shtrikman(share, *phases),
        space.hashin_shtrikman(share, *phases),
    )
    whole, _, shear = plane.mori_tanaka(share, *phases)
    average = None if particles == "spheres" or ratio is None else _average(*moduli, ratio)
    return References(
        particles,
        float(share),
        (_across(in_plane[:, 0]), _across(in_plane[:, 1])),
        _across(np.array([whole / 2, shear])),
        (_young(in_space[:, 0]), _young(in_space[:, 1])),
        _young(space.mori_tanaka(share, *phases)),
        average,
    )


def _across(moduli: Array) -> float:
    """E of eq. 16 of an isotropic plane, from its bulk and shear modulus."""
    bulk, shear = 2 * STRAIN * moduli
    return effective_modulus(float(bulk), float(shear))[0]


def _young(moduli: Array) -> float:
    """E of an isotropic material from K and μ."""
    bulk, shear = moduli
    return float(hill_average(np.array([bulk, shear, shear]))[0])


def _average(modulus: float, poisson: float, ratio: float) -> float:
    """E of the isotropic average of an array whose shear modulus along its axes eq. 16 took."""
    axes = modulus / (2 * (1 + poisson))
    whole, diagonals = 2 * axes / (1 - 2 * poisson), ratio * axes
    return float(plane_average(np.array([whole, 2 * diagonals, axes]))[0])


def beside(case: Case, modulus: float, poisson: float, ratio: float | None) -> Document:
    """References at the modal values of a case's cell, and a warning where E contradicts its words.

    Args:
        case: With a cell and its radius.
        modulus: E in Pa at the modal values.
        poisson: ν there.
        ratio: Its shear ratio; None where unknown.
    """
    radius, matrix, inclusion = parts(modal_values(case), case.radius.theta)
    particles, moduli = case.cell.particles, (modulus, poisson)
    ratio = None if case.modulus.average == "isotropic" else ratio  # E is that average itself
    found = references(radius, (matrix, inclusion), moduli, ratio, particles).document()
    return {"beside": found, "outside": outside(case, found, modulus / GPA)}


def text_of(case: Case, told: Document) -> str:
    """The line of the references for people; a warning goes to standard error."""
    if told["outside"]:
        say(f"warning: {told['outside']}")
    return f"{line(told['beside'], case.cell.particles)}\n"


def line(found: Document, particles: str) -> str:
    """The references as one line."""
    kinds = [
        f"{words} {' … '.join(f'{x:.3f}' for x in one['hashin_shtrikman_E_GPa'])}"
        f" (Mori–Tanaka {one['mori_tanaka_E_GPa']:.3f})"
        for words, one in (("long fibres", found["fibres"]), ("spheres", found["spheres"]))
    ]
    average = found["isotropic_average_E_GPa"]
    own = f"; this array averaged over all directions {average:.3f}" if average else ""
    shape = (
        "discs of the plane are long fibres" if particles == "cylinders" else "these are spheres"
    )
    return (
        f"Hashin–Shtrikman bounds of E at the fraction {found['fraction']:.4f}, GPa:"
        f" {'; '.join(kinds)}{own}; {shape}"
    )


def outside(case: Case, found: Document, modulus: float) -> str:
    """Warning where E in GPa leaves the bounds in space and the case's words say spheres, or ''."""
    told = says_spheres(case)
    if told is None:
        return ""
    low, high = found["spheres"]["hashin_shtrikman_E_GPa"]
    if low * (1 - SLACK) <= modulus <= high * (1 + SLACK):
        return ""
    side, bound = ("below", low) if modulus < low else ("above", high)
    return (
        f"E = {modulus:.3f} GPa lies {side} the Hashin–Shtrikman bound {bound:.3f} GPa of spheres,"
        f" and {told}: its discs are long fibres;"
        ' cell.particles = "spheres" takes spheres, "cylinders" ends this warning'
    )
