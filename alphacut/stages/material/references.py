"""What other composites of the same phases and fraction have: bounds and estimates beside E."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.case.case import Case
from alphacut.case.checks_material import taking_spheres
from alphacut.fuzzy import FuzzyNumber
from alphacut.io.files import Document, say
from alphacut.io.units import fixed
from alphacut.rve import bounds as plane
from alphacut.rve.anisotropy import plane_average
from alphacut.rve.cell import STRAIN, Cell, Phase
from alphacut.rve.fibre_constants import across_fibres
from alphacut.rve.result import effective_modulus
from alphacut.rve.spheres import bounds as space
from alphacut.rve.spheres.cubic import hill_average
from alphacut.rve.spheres.result import volume_fraction
from alphacut.stages.material.cell import cell_inputs, modal_parts, parts
from alphacut.stages.material.modulus import FuzzyModulus
from alphacut.stages.material.spheres import cure, says_spheres
from alphacut.stochastic import RadiusMap, gauss_rule
from alphacut.stochastic.theta.law import Array

GPA = 1e9
VALUES = ("E", "nu")
KINDS = ("fibres", "spheres")
Cuts = tuple[Array, Array, Array]
"""Levels α, rising, with the lower and upper ends of E in Pa, shape (A,) each."""
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
        across: Constants of the array as fibres, see `across_fibres`, its G23 that of the isotropic
            average; None of spheres, or where that is unknown.
    """

    particles: str
    fraction: float
    fibres: tuple[float, float]
    fibres_estimate: float
    spheres: tuple[float, float]
    spheres_estimate: float
    average: float | None
    across: dict[str, float] | None = None

    def document(self) -> Document:
        """In GPa."""
        ends = {name: getattr(self, name) for name in KINDS}
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
            "across": self.across
            and {
                name if (bare := name == "nu_LT") else f"{name}_GPa": value if bare else value / GPA
                for name, value in self.across.items()
            },
        }


def references(
    radius: RadiusMap,
    phases: tuple[Phase, Phase],
    moduli: tuple[float, float],
    ratio: float | None,
    particles: str,
    *,
    averaged: bool = False,
) -> References:
    """The composites beside a cell of E in Pa and ν by eq. 16, averaged, or by Hill's average.

    The ratio is the shear modulus along the diagonals over that along the axes, None if unknown.
    """
    share = np.asarray(mean_share(radius, particles))
    fibres, spheres = bounds_of(float(share), phases)
    whole, _, shear = plane.mori_tanaka(share, *phases)
    own = particles == "cylinders" and (averaged or ratio is not None)
    average, poisson = _average(*moduli, 1.0 if averaged else ratio or 1.0)
    cell, shear23 = Cell(phases[0], phases[1], radius), average / (2 * (1 + poisson))
    bulk23 = shear23 / (1 - 2 * poisson)
    return References(
        particles,
        float(share),
        fibres,
        across(np.array([whole / 2, shear])),
        spheres,
        young(space.mori_tanaka(share, *phases)),
        average if own and not averaged else None,
        across_fibres(cell, bulk23, shear23) if own else None,
    )


MIDDLE = " at the middle of the cut at α = 1"


def bounds_over_cuts(case: Case, alpha: Sequence[float]) -> Document:
    """Least lower and greatest upper bound of E on each level, in GPa, of fibres and of spheres.

    At the corners of the box of the cell's inputs, and half-way of Poisson's ratios, in which the
    bounds need not be monotone.
    """
    inputs = cell_inputs(case)
    ends = np.array([_over_box(case, inputs, level) for level in alpha])
    return {
        "alpha": list(alpha),
        **{
            kind: {"lower": ends[:, k, 0] / GPA, "upper": ends[:, k, 1] / GPA}
            for k, kind in enumerate(KINDS)
        },
    }


def _over_box(case: Case, inputs: dict[str, FuzzyNumber], level: float) -> Array:
    """Bounds over one α-cut, shape (fibres and spheres, 2), in Pa."""
    found = np.array(list(_at_corners(case, inputs, level)))
    return np.stack([found[..., 0].min(axis=0), found[..., 1].max(axis=0)], axis=-1)


def _at_corners(case: Case, inputs: dict[str, FuzzyNumber], level: float) -> Iterator[Array]:
    """Bounds at each corner, shape (fibres and spheres, 2), in Pa."""
    family, particles = case.radius.family, case.cell.particles
    shares: dict[RadiusMap, float] = {}
    for corner in itertools.product(*(_places(name, n, level) for name, n in inputs.items())):
        radius, *phases = parts(dict(zip(inputs, corner, strict=True)), family)
        if radius not in shares:
            shares[radius] = mean_share(radius, particles)
        yield np.array(bounds_of(shares[radius], (phases[0], phases[1])))


def _places(name: str, number: FuzzyNumber, level: float) -> list[float]:
    """Values of an input that are tried on a level."""
    low, high = number.cut(level)
    middle = {(low + high) / 2} if name.endswith("poisson") else set[float]()
    return sorted({low, high} | middle)


def mean_share(radius: RadiusMap, particles: str) -> float:
    """Mean part of the material that the particles take."""
    rule = gauss_rule(radius.distribution, points=40)
    radii = radius(rule.nodes)
    part = volume_fraction(radii) if particles == "spheres" else np.pi / 4 * radii**2
    return float(rule.mean(part))


def bounds_of(
    share: float, phases: tuple[Phase, Phase]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Bounds of E in Pa of long fibres, across them, and of spheres: lower and upper of each."""
    at = np.asarray(share)
    in_plane, in_space = plane.hashin_shtrikman(at, *phases), space.hashin_shtrikman(at, *phases)
    return (across(in_plane[:, 0]), across(in_plane[:, 1])), (
        young(in_space[:, 0]),
        young(in_space[:, 1]),
    )


def across(moduli: Array) -> float:
    """E of eq. 16 of an isotropic plane, from its bulk and shear modulus."""
    bulk, shear = 2 * STRAIN * moduli
    return effective_modulus(float(bulk), float(shear))[0]


def young(moduli: Array) -> float:
    """E of an isotropic material from K and μ."""
    bulk, shear = moduli
    return float(hill_average(np.array([bulk, shear, shear]))[0])


def _average(modulus: float, poisson: float, ratio: float) -> Array:
    """E and ν of the isotropic average of an array whose shear along its axes eq. 16 took."""
    axes = modulus / (2 * (1 + poisson))
    whole, diagonals = 2 * axes / (1 - 2 * poisson), ratio * axes
    return plane_average(np.array([whole, 2 * diagonals, axes]))


def beside(
    case: Case, modulus: float, poisson: float, ratio: float | None, cuts: Cuts | None = None
) -> Document:
    """References at nominal inputs of a case's cell, over its α-cuts, and what they say of E in Pa.

    The modulus and ν are of the middle of the highest of the cuts, where E is fuzzy.

    Returns:
        "beside", with "cuts" where E is fuzzy, "outside", a warning where E contradicts the case's
        words or data, and "publish", which E to publish.
    """
    radius, matrix, inclusion = modal_parts(case)
    particles, moduli = case.cell.particles, (modulus, poisson)
    averaged, phases = case.modulus.average == "isotropic", (matrix, inclusion)
    found = references(radius, phases, moduli, ratio, particles, averaged=averaged).document()
    support = (modulus, modulus)
    if cuts is not None and len(cuts[0]):
        found["cuts"] = bounds_over_cuts(case, [float(level) for level in cuts[0]])
        support = float(cuts[1][0]), float(cuts[2][0])
    return {
        "beside": found,
        "outside": outside(case, found, modulus / GPA, (support[0] / GPA, support[1] / GPA)),
        "publish": publish(case, found) + _beyond_bounds(case, found, modulus / GPA),
    }


def of_modulus(case: Case, found: FuzzyModulus) -> Document:
    """`beside` a fuzzy modulus."""
    modal, poisson = (float(np.mean([ends[-1] for ends in found.result.bounds(x)])) for x in VALUES)
    cuts = (np.asarray(found.result.alpha), *found.result.bounds("E"))
    return beside(case, modal, poisson, found.shear_ratio and found.shear_ratio[0], cuts)


def text_of(case: Case, told: Document) -> str:
    """The lines of the references for people; a warning goes to standard error."""
    if told["outside"]:
        say(f"warning: {told['outside']}")
    return "\n".join([*lines(told["beside"], case.cell.particles), told["publish"], ""])


def lines(found: Document, particles: str) -> list[str]:
    """The references, and what E is not, a line each."""
    return [_bounds_in_words(found, particles), *_fibres_in_words(found, particles)]


def _fibres_in_words(found: Document, particles: str) -> Iterator[str]:
    """That E of the plane is not the transverse Young's modulus, and what that one is."""
    if particles == "spheres" or "across" not in found:  # results of an older program
        return
    place = MIDDLE if found.get("cuts") else ""
    if own := found.get("across"):
        told = (
            f"that is E_T = {fixed(own['E_T_GPa'], 3)} GPa{place}: 1/E_T = 1/(4 G23) + 1/(4 K23)"
            f" + ν_LT²/E_L, G23 {fixed(own['G23_GPa'], 3)} GPa averaged over all directions, K23"
            f" {fixed(own['K23_GPa'], 3)} GPa of plane strain, E_L {fixed(own['E_L_GPa'], 3)} GPa,"
            f" ν_LT {own['nu_LT']:.4f}"
        )
    else:
        told = "that one follows from the series, which refuses this cell"
    yield (
        "E is of plane strain: that of an isotropic solid with the plane's bulk and shear moduli,"
        f" not the transverse Young's modulus of a fibre composite; {told}"
    )


def _bounds_in_words(found: Document, particles: str) -> str:
    """The references as one line."""
    kinds = [
        f"{words} {' … '.join(f'{fixed(x, 3)}' for x in one['hashin_shtrikman_E_GPa'])}"
        f" (Mori–Tanaka {fixed(one['mori_tanaka_E_GPa'], 3)})"
        for words, one in (("long fibres", found["fibres"]), ("spheres", found["spheres"]))
    ]
    kind = "volume" if particles == "spheres" else "area"  # of a section across the fibres
    average = found["isotropic_average_E_GPa"]
    place = MIDDLE if found.get("cuts") else ""
    own = f"; this array averaged over all directions {fixed(average, 3)}{place}" if average else ""
    shape = (
        "discs of the plane are long fibres, their E in the same sense as the E above"
        if particles == "cylinders"
        else "these are spheres"
    )
    return (
        f"Hashin–Shtrikman bounds of E at nominal inputs and the {kind} fraction"
        f" {found['fraction']:.4f}, GPa: {'; '.join(kinds)}{own}; {shape}{over_support(found)}"
    )


def over_support(found: Document) -> str:
    """The bounds beside a fuzzy E, over the same whole ranges of its inputs; empty without."""
    cuts = found.get("cuts")
    if cuts is None:
        return ""
    ends = [
        f"{words} {fixed(cuts[kind]['lower'][0], 3)} … {fixed(cuts[kind]['upper'][0], 3)}"
        for words, kind in (("long fibres", "fibres"), ("spheres", "spheres"))
    ]
    return f". Over the inputs' ranges at α = {cuts['alpha'][0]:g}: {'; '.join(ends)}"


def publish(case: Case, found: Document) -> str:
    """Which E to publish, in one sentence."""
    if case.cell.particles == "spheres":
        return (
            "To publish: this E, the isotropic (Hill) average of spheres in a cubic array. What one"
            " cubic cell misses of many random spheres is not in its error: 0.44 % at a fraction of"
            " 0.21 (benchmarks.rve.many_spheres), more where they are denser or stiffer."
        )
    if says_spheres(case) is not None:
        return (
            f"To publish: E of spheres, by {taking_spheres(case)}; the E above is of long parallel"
            " fibres, across them."
        )
    if case.modulus.average == "isotropic":
        return (
            "To publish: this E for plane strain, the isotropic average of the square array; E_T as"
            " modulus across long fibres."
        )
    average, across = found["isotropic_average_E_GPa"], found["across"]
    told = f", {fixed(average, 3)} GPa{MIDDLE if found.get('cuts') else ''}" if average else ""
    first = f" E_T = {fixed(across['E_T_GPa'], 3)} GPa as modulus across them;" if across else ""
    return (
        f"To publish for long fibres:{first} for plane strain the isotropic average{told}"
        ' (modulus.average = "isotropic"); E of the square array (eq. 16) is of its axes alone.'
    )


def _beyond_bounds(case: Case, found: Document, modulus: float) -> str:
    """That the E to publish passes what isotropic materials reach, and why; else empty."""
    spheres = case.cell.particles == "spheres"
    value = modulus if spheres else found["isotropic_average_E_GPa"] or modulus
    if not spheres and value == modulus and case.modulus.average != "isotropic":
        return ""
    high = found["spheres" if spheres else "fibres"]["hashin_shtrikman_E_GPa"][1]
    if cuts := found.get("cuts"):  # the middle of inputs need not give the middle of E
        high = cuts["spheres" if spheres else "fibres"]["upper"][-1]
    if value <= high * (1 + SLACK):
        return ""
    return (
        f" But {value:.4g} GPa lies {100 * (value / high - 1):.2g} % above {high:.4g} GPa, the"
        " Hashin–Shtrikman bound of every isotropic material of these phases and this fraction:"
        " cells of all radii share one strain, which overrates E where radii scatter and particles"
        " are soft. It is that of the array alone; of a random material publish the bounds."
    )


def outside(
    case: Case, found: Document, modulus: float, support: tuple[float, float] | None = None
) -> str:
    """Warning where E in GPa leaves the bounds in space and the case's words say spheres, or ''."""
    told = says_spheres(case)
    if told is None:
        return ""
    low, high = found["spheres"]["hashin_shtrikman_E_GPa"]
    if low * (1 - SLACK) <= modulus <= high * (1 + SLACK):
        return ""
    side, bound = ("below", low) if modulus < low else ("above", high)
    return (
        f"E = {fixed(modulus, 3)} GPa lies {side} the Hashin–Shtrikman bound {fixed(bound, 3)} GPa"
        f" of spheres{_whole(found, support)}, and {told}: its discs are long fibres, and its nu is"
        f" theirs too; cell.particles: {cure(case)}"
    )


def _whole(found: Document, support: tuple[float, float] | None) -> str:
    """Words where the whole fuzzy E lies beyond the bounds over the same cuts."""
    cuts = found.get("cuts")
    if cuts is None or support is None:
        return ""
    least, most = cuts["spheres"]["lower"][0], cuts["spheres"]["upper"][0]
    ends = f"[{fixed(support[0], 3)}, {fixed(support[1], 3)}] GPa"
    within = f"{fixed(least, 3)} … {fixed(most, 3)}"
    if support[1] < least or support[0] > most:
        return f" (so does all of its support {ends}: bounds there {within})"
    return f" (its support is {ends}, the bounds over it {within})"
