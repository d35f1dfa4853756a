"""Checks of a cell that is a picture, and of its keys where it is none."""

from __future__ import annotations

from collections.abc import Iterator

from alphacut.case.case import Case
from alphacut.case.schema_image import PICTURE_KEYS, PICTURES
from alphacut.io.problem import Problem

SOURCES = tuple(f"cell.{name}" for name in PICTURES)
OF_PARTICLE = ("cell.matrix_", "cell.inclusion_", "radius.", "mesh.", "response.")
OF_SAMPLES = tuple(f"modulus.{key}" for key in ("method", "plan", "tolerance"))
OF_FILE = ("pixel", "threshold", "threshold_deviation", "quantiles", "labels")


def picture(case: Case) -> str:
    """Full name of the key that gives the cell's picture; empty for a round particle."""
    return next((key for key in SOURCES if case.has(key)), "")


def phase_count(case: Case) -> int:
    """Phases that thresholds, labels or an outline part."""
    if case.has("cell.threshold"):
        return len(case.fuzzies("cell.threshold")) + 1
    return len(case.numbers("cell.labels")) if case.has("cell.labels") else 2


def image(case: Case) -> Iterator[Problem]:
    """One picture, its pixels, and as many moduli as phases."""
    sources = [key for key in SOURCES if case.has(key)]
    if not sources:
        yield from unpictured(case)
        return
    if len(sources) > 1:
        allowed = f"one of {', '.join(SOURCES)}"
        yield Problem("cell", f"got {len(sources)} pictures", ", ".join(sources), allowed)
        return
    yield from strangers(case, sources[0])
    yield from of_file(case) if case.has("cell.image") else of_outline(case, sources[0])
    yield from phases(case)


def unpictured(case: Case) -> Iterator[Problem]:
    """Keys of a picture beside a round particle, and a stage that needs one."""
    lost = [name for name in PICTURE_KEYS if case.asked(f"cell.{name}")]
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
    if not case.has("cell.pixel"):
        yield Problem("cell.pixel", "missing: the side of a pixel", allowed='such as "2 µm"')
    elif len(case.numbers("cell.pixel")) > 2:
        yield Problem("cell.pixel", "this takes a side, or a width and a height")
    ways = [key for key in ("cell.threshold", "cell.labels") if case.has(key)]
    if len(ways) != 1:
        yield Problem(
            "cell.threshold",
            f"{'two things tell' if ways else 'nothing tells'} the phases apart",
            ", ".join(ways),
            "cell.threshold for grey values or cell.labels for labels",
        )
    if phase_count(case) < 2:
        yield Problem("cell.labels", "there is one phase", allowed="two phases or more")
    if case.has("cell.labels"):
        labels = case.numbers("cell.labels")
        if len(set(labels)) != len(labels):
            yield Problem("cell.labels", "a label stands twice", str(list(labels)))
    if case.has("cell.size") and len(case.numbers("cell.size")) != 2:
        yield Problem("cell.size", "this takes a width and a height")
    if case.asked("cell.pixels"):
        yield Problem(
            "cell.pixels", "an image has its own pixels", allowed="cell.pixels of outlines"
        )
    yield from random_threshold(case)


def random_threshold(case: Case) -> Iterator[Problem]:
    """A random threshold parts two phases of a periodic image."""
    key = "cell.threshold_deviation"
    if not case.has(key):
        if case.asked("cell.quantiles"):
            what = "quantiles are of a random threshold"
            yield Problem("cell.quantiles", what, allowed=f"this key beside {key}")
        return
    if not case.has("cell.threshold") or len(case.fuzzies("cell.threshold")) != 1:
        yield Problem(key, "a random threshold parts two phases", allowed="one cell.threshold")
    if not case.fuzzy(key).support.lower > 0:
        what = "the deviation of a random threshold is positive"
        yield Problem(key, what, str(case.written[key]), "no deviation for a crisp threshold")
    if case.text("cell.boundary") == "window":
        what = "a random threshold is for a periodic image"
        yield Problem(key, what, allowed='boundary = "periodic"')


def of_outline(case: Case, source: str) -> Iterator[Problem]:
    """An outline's cell; keys of a file have no meaning beside it."""
    if not case.has("cell.size") or len(case.numbers("cell.size")) != 2:
        yield Problem("cell.size", f"missing: {source} needs the width and height of its cell")
    for key in OF_FILE:
        if case.asked(f"cell.{key}"):
            yield Problem(f"cell.{key}", f"this is for cell.image, and {source} is given")


def phases(case: Case) -> Iterator[Problem]:
    """E and ν, or K and G, of every phase."""
    pairs = [("cell.modulus", "cell.poisson"), ("cell.bulk", "cell.shear")]
    given = [pair for pair in pairs if any(case.has(key) for key in pair)]
    if len(given) != 1:
        told = "both E, ν and K, G are given" if given else "the phases have no moduli"
        allowed = "cell.modulus and cell.poisson, or cell.bulk and cell.shear"
        yield Problem("cell.modulus", told, allowed=allowed)
        return
    count = phase_count(case)
    if count < 2:
        return
    for key in given[0]:
        if not case.has(key):
            yield Problem(key, f"missing beside {', '.join(k for k in given[0] if k != key)}")
        elif len(case.fuzzies(key)) not in {count, 1 if key == "cell.poisson" else count}:
            yield Problem(
                key,
                f"got {len(case.fuzzies(key))} values for {count} phases",
                allowed="one a phase",
            )
