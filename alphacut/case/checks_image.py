"""Checks of a cell that is a picture, and of its keys where it is none."""

from __future__ import annotations

from collections.abc import Iterator

from alphacut.case.case import Case
from alphacut.case.key import keys_of
from alphacut.case.sections.picture import PICTURES, Picture
from alphacut.io.problem import Problem

SOURCES = tuple(f"cell.{name}" for name in PICTURES)
OF_PARTICLE = ("cell.particles", "cell.matrix_", "cell.inclusion_", "radius.", "mesh.", "response.")
OF_SAMPLES = tuple(f"modulus.{key}" for key in ("method", "plan", "tolerance"))


def phase_count(given: Picture) -> int:
    """Phases that thresholds, labels or an outline part."""
    if given.threshold is not None:
        return len(given.threshold) + 1
    return 2 if given.labels is None else len(given.labels)


def image(case: Case) -> Iterator[Problem]:
    """One picture, its pixels, and as many moduli as phases."""
    if case.sections.picture is None:
        yield from unpictured(case)
        return
    yield from strangers(case, "cell.image")
    yield from of_file(case)
    yield from phases(case.picture)


def unpictured(case: Case) -> Iterator[Problem]:
    """Keys of a picture beside a round particle, and a stage that needs one."""
    lost = [name for name in keys_of(Picture) if case.asked(f"cell.{name}")]
    if lost:
        what = f"there is no picture for {', '.join(lost)}"
        yield Problem(f"cell.{lost[0]}", what, allowed=f"one of {', '.join(SOURCES)}")
    elif "image" in case.stages:
        yield Problem("cell", "stage image needs a picture", allowed=f"one of {', '.join(SOURCES)}")


def strangers(case: Case, source: str) -> Iterator[Problem]:
    """Keys that have no meaning beside a picture."""
    for key in case.written:
        if key.startswith(OF_PARTICLE):
            yield Problem(key, f"this is of a round particle, and {source} is given", allowed="")
        if key in OF_SAMPLES:
            yield Problem(key, f"{source} is given, and a picture takes no samples", allowed="")
    if "modulus" in case.stages:
        allowed = 'stages = ["image", …]'
        yield Problem("stages", f"stage modulus does not read {source}", allowed=allowed)


def of_file(case: Case) -> Iterator[Problem]:
    """A file's pixel size, and one way to tell its phases."""
    given = case.picture
    if given.pixel is None:
        yield Problem("cell.pixel", "missing: the side of a pixel", allowed='such as "2 µm"')
    elif len(given.pixel) > 2:
        yield Problem("cell.pixel", "this takes a side, or a width and a height")
    every = {"cell.threshold": given.threshold, "cell.labels": given.labels}
    ways = [key for key, value in every.items() if value is not None]
    if len(ways) != 1:
        yield Problem(
            "cell.threshold",
            f"{'two things tell' if ways else 'nothing tells'} the phases apart",
            ", ".join(ways),
            "cell.threshold for grey values or cell.labels for labels",
        )
    if phase_count(given) < 2:
        yield Problem("cell.labels", "there is one phase", allowed="two phases or more")
    labels = given.labels or ()
    if len(set(labels)) != len(labels):
        yield Problem("cell.labels", "a label stands twice", str(list(labels)))


def phases(given: Picture) -> Iterator[Problem]:
    """E and ν, or K and G, of every phase."""
    young = {"modulus": given.modulus, "poisson": given.poisson}
    bulk = {"bulk": given.bulk, "shear": given.shear}
    pairs = [pair for pair in (young, bulk) if any(x is not None for x in pair.values())]
    if len(pairs) != 1:
        told = "both E, ν and K, G are given" if pairs else "the phases have no moduli"
        allowed = "cell.modulus and cell.poisson, or cell.bulk and cell.shear"
        yield Problem("cell.modulus", told, allowed=allowed)
        return
    count = phase_count(given)
    if count < 2:
        return
    for key, values in pairs[0].items():
        if values is None:
            (other,) = (name for name in pairs[0] if name != key)
            yield Problem(f"cell.{key}", f"missing beside cell.{other}")
        elif len(values) not in {count, 1 if key == "poisson" else count}:
            what = f"got {len(values)} values for {count} phases"
            yield Problem(f"cell.{key}", what, allowed="one a phase")
