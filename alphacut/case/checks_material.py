"""Checks of particles and radius map as a whole."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from alphacut.case.case import Case
from alphacut.case.sections.material import SPHERE_METHODS
from alphacut.case.sections.particles import Packing
from alphacut.io.problem import Problem
from alphacut.stochastic import HermiteMap, TruncatedNormal


def particles(case: Case) -> Iterator[Problem]:
    """Exactly one source of particles, and numbers in it that fit together."""
    study = case.microstructure
    every = {"packing": study.packing, "circles": study.circles, "image": study.image}
    sources = [name for name, source in every.items() if source]
    if len(sources) != 1:
        allowed = (
            "one of [microstructure.packing], [microstructure.circles], [microstructure.image]"
        )
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
        yield from sizes(case, study.packing)
    if study.circles:
        for name, pair in (("size", study.circles.size), ("origin", study.circles.origin)):
            if len(pair) != 2:
                key = f"microstructure.circles.{name}"
                yield Problem(key, f"got {len(pair)} values", allowed="two: across and up")


def sizes(case: Case, packing: Packing) -> Iterator[Problem]:
    """The radii of packed discs: a file of them, or both ends of their law in order."""
    key = "microstructure.packing"
    low, high = (f"{key}.{end}_radius" for end in ("smallest", "largest"))
    ends = [name for name in (low, high) if case.asked(name)]
    if packing.file and ends:
        yield Problem(
            ends[0],
            "the radii come from a file besides",
            str(case.written[ends[0]]),
            f"one of {key}.file and the two ends",
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
        yield Problem(
            low, "the smallest radius is greater than the largest", str(case.written[low])
        )


def radius(case: Case, alpha: float) -> Iterator[Problem]:
    """r(θ) stays inside (0, 1) in every corner of the α-cuts; r is linear in a1 … a4."""
    theta = case.radius.theta
    if len(theta) != 2 or not theta[0] < theta[1]:
        yield Problem(
            "radius.theta",
            "the support of θ needs two ends in rising order",
            str(list(theta)),
            "for example [-3, 3]",
        )
        return
    law = TruncatedNormal(*theta)
    for corner in itertools.product(
        *(sorted(set(number.cut(alpha))) for number in case.radius.slopes)
    ):
        a1, a2, a3, a4 = corner
        try:
            HermiteMap(a1, a2, a3, a4, law)
        except ValueError as error:
            key = guilty(corner)
            yield Problem(f"radius.{key}", str(error), str(case.written.get(f"radius.{key}", "")))
            return


def sphere_model(case: Case) -> Iterator[Problem]:
    """Spheres have models of their own, and no stage that makes their radii yet."""
    method = case.modulus.method if case.sections.modulus else "prism"
    if case.cell.particles == "spheres" and method not in SPHERE_METHODS:
        yield Problem(
            "modulus.method",
            "this model is one of cylinders, and cell.particles is spheres",
            method,
            ", ".join(SPHERE_METHODS),
        )
    if case.cell.particles == "spheres" and "microstructure" in case.stages:
        yield Problem(
            "cell.particles",
            "stage microstructure measures discs in their planar cells, whose radii are not those"
            " of spheres",
            "spheres",
            '"cylinders", or section radius from benchmarks.stochastic.sphere_map in place of the'
            " stage, as cases/paper-3d.toml",
        )


def guilty(corner: tuple[float, ...]) -> str:
    """Slope to name when r(θ) leaves (0, 1): the one whose change cures it, else the steeper."""
    a1, a2, a3, a4 = corner
    tame = a3 - a1
    for name, slope2, slope4 in (("a2", tame, a4), ("a4", a2, tame)):
        try:
            HermiteMap(a1, slope2, a3, slope4)
        except ValueError:
            continue
        return name
    return "a2" if abs(a2 - tame) > abs(a4 - tame) else "a4"
