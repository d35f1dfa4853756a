"""Checks of particles and radius map as a whole."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping

from alphacut.case.case import Case
from alphacut.case.sections.material import SPHERE_METHODS
from alphacut.case.sections.particles import PackedSpheres, Packing
from alphacut.io.problem import Problem
from alphacut.io.provenance import door
from alphacut.stochastic import HermiteMap
from alphacut.stochastic.radius_map import MapFamily


def particles(case: Case) -> Iterator[Problem]:
    """Exactly one source of particles, and numbers in it that fit together."""
    study = case.microstructure
    every = {
        "packing": study.packing,
        "circles": study.circles,
        "image": study.image,
        "spheres": study.spheres,
    }
    sources = [name for name, source in every.items() if source]
    if len(sources) != 1:
        allowed = "one of " + ", ".join(f"[microstructure.{name}]" for name in every)
        yield Problem(
            "microstructure",
            f"got {len(sources)} sources of particles",
            ", ".join(sources),
            allowed,
        )
    limits = study.limits
    if limits is not None and (len(limits) != 2 or not limits[0] < limits[1]):
        yield Problem(
            "microstructure.limits",
            "the limits need two values in rising order",
            str(list(limits)),
            "for example [0.13, 0.87]",
        )
    if study.packing:
        yield from sizes(case, "packing", study.packing)
    if study.spheres:
        yield from sizes(case, "spheres", study.spheres)
    if study.circles:
        for name, pair in (("size", study.circles.size), ("origin", study.circles.origin)):
            if len(pair) != 2:
                key = f"microstructure.circles.{name}"
                yield Problem(key, f"got {len(pair)} values", allowed="two: across and up")


def sizes(case: Case, source: str, packing: Packing | PackedSpheres) -> Iterator[Problem]:
    """The radii of packed particles: a file of them, or both ends of their law in order."""
    key = f"microstructure.{source}"
    low, high = (f"{key}.{end}_radius" for end in ("smallest", "largest"))
    ends = [name for name in (low, high) if case.asked(name)]
    if packing.file and ends:
        yield case.problem(
            ends[0], "the radii come from a file besides", f"one of {key}.file and the two ends"
        )
    elif not packing.file:
        for name in (low, high):
            if name not in ends:
                yield Problem(
                    name,
                    "missing: the law of the radii needs it",
                    allowed=f'a length such as "1.6 mm", or {key}.file',
                )
    smallest, largest = packing.smallest_radius, packing.largest_radius
    if smallest is not None and largest is not None and smallest > largest:
        yield case.problem(low, "the smallest radius is greater than the largest")


def radius(case: Case, alpha: float) -> Iterator[Problem]:
    """r(θ) stays inside (0, 1) in every corner of the α-cuts.

    The map is linear in a1 … a4, and the exponential one rises in both of its radii.
    """
    theta = case.radius.theta
    if len(theta) != 2 or not theta[0] < theta[1]:
        yield Problem(
            "radius.theta",
            "the support of θ needs two ends in rising order",
            str(list(theta)),
            "for example [-3, 3]",
        )
        return
    if problems := [*radius_keys(case)]:
        yield from problems
        return
    try:
        family = case.radius.family
    except ValueError as error:
        yield Problem("radius.theta", str(error), str(list(theta)), "for example [-3, 3]")
        return
    numbers = case.radius.numbers
    for corner in itertools.product(
        *(sorted(set(number.cut(alpha))) for number in numbers.values())
    ):
        values = dict(zip(numbers, corner, strict=True))
        try:
            family(values)
        except ValueError as error:
            key = guilty(family, values)
            yield case.problem(f"radius.{key}", str(error))
            return


def radius_keys(case: Case) -> Iterator[Problem]:
    """The law and the map have the keys that they need, and no others."""
    given = case.radius
    for name in ("a2", "a4"):
        if given.map != "hermite" and case.asked(f"radius.{name}"):
            yield case.problem(
                f"radius.{name}",
                f"map {given.map} has no such slope",
                'radius.map = "hermite" beside it',
            )
    exponents = given.exponents
    if given.law == "beta" and (exponents is None or len(exponents) != 2):
        yield Problem(
            "radius.exponents",
            "law beta needs its two exponents",
            "" if exponents is None else str(list(exponents)),
            "for example [2, 5]",
        )
    elif given.law != "beta" and exponents is not None:
        yield Problem(
            "radius.exponents",
            f"law {given.law} has no exponents",
            str(list(exponents)),
            'radius.law = "beta" beside them',
        )


def sphere_model(case: Case) -> Iterator[Problem]:
    """Spheres have models of their own, and a source of radii of their own."""
    method = case.modulus.method if case.sections.modulus else "prism"
    if case.cell.particles == "spheres" and method not in SPHERE_METHODS:
        yield Problem(
            "modulus.method",
            "this model is one of cylinders, and cell.particles is spheres",
            method,
            ", ".join(SPHERE_METHODS),
        )
    own = "modulus.average" in case.changed or "cell.particles" not in case.changed
    if case.cell.particles == "spheres" and own and case.asked("modulus.average"):
        yield case.problem(
            "modulus.average",
            "E of spheres is Hill's isotropic average, and this has an effect on cylinders alone",
            'beside cell.particles = "cylinders"',
        )
    if "microstructure" in case.stages and case.sections.microstructure:
        yield from one_shape(case)


def one_shape(case: Case) -> Iterator[Problem]:
    """The stage makes the radii of the particles that the cell has."""
    packed = case.microstructure.spheres is not None
    if case.cell.particles == "spheres" and not packed:
        yield Problem(
            "cell.particles",
            "stage microstructure measures discs in their planar cells here, whose radii are not"
            " those of spheres",
            "spheres",
            f'"cylinders", or {taking_spheres(case)}',
        )
    if case.cell.particles == "cylinders" and packed:
        yield Problem(
            "cell.particles",
            "stage microstructure packs spheres, and the cell is one of cylinders",
            "cylinders",
            '"spheres"',
        )


def taking_spheres(case: Case) -> str:
    """What a case takes spheres by, whatever its particles come from."""
    takes, given = 'cell.particles = "spheres"', case.sections.microstructure
    if "microstructure" not in case.stages or given is None or given.spheres:
        return takes
    wanted = "its volume_fraction, spheres, and radii or a file of diameters"
    behind = "its volume_fraction, spheres, smallest_radius, largest_radius, and circles"
    source = "packing"
    if given.circles:
        source, wanted = "circles", f'{behind} = "{given.circles.file}"'
    elif given.image:
        source = "image"
        wanted = (
            f"{behind} = particles/circles.csv, which {door('microstructure', case.path)} --out"
            " particles writes of this case with cylinders: circles seen in an image are"
            " smaller than their spheres"
        )
    return (
        f"{takes} with section [microstructure.spheres] in place of [microstructure.{source}]:"
        f" {wanted}"
    )


def guilty(family: MapFamily, values: Mapping[str, float]) -> str:
    """Parameter to name when r(θ) leaves (0, 1).

    The slope whose change cures it, else the steeper one; without slopes the first such radius.
    """
    a1, a3 = values["a1"], values["a3"]
    if family.kind != "hermite":
        return "a1" if not 0 < a1 < 1 else "a3"
    a2, a4 = values["a2"], values["a4"]
    tame = a3 - a1
    for name, slope2, slope4 in (("a2", tame, a4), ("a4", a2, tame)):
        try:
            HermiteMap(a1, slope2, a3, slope4)
        except ValueError:
            continue
        return name
    return "a2" if abs(a2 - tame) > abs(a4 - tame) else "a4"
