"""Checks of an image's section as a whole."""

from __future__ import annotations

from collections.abc import Iterator

from alphacut.case.case import Case
from alphacut.io.problem import Problem

SOURCES = ("image.file", "image.polygons", "image.inequality")


def phase_count(case: Case) -> int:
    """Phases that thresholds, labels or an outline part."""
    if case.has("image.threshold"):
        return len(case.fuzzies("image.threshold")) + 1
    return len(case.numbers("image.labels")) if case.has("image.labels") else 2


def image(case: Case) -> Iterator[Problem]:
    """One picture, its pixels, and as many moduli as phases."""
    sources = [key for key in SOURCES if case.has(key)]
    if len(sources) != 1:
        yield Problem(
            "image",
            f"got {len(sources)} pictures",
            ", ".join(sources),
            f"one of {', '.join(SOURCES)}",
        )
        return
    yield from of_file(case) if case.has("image.file") else of_outline(case, sources[0])
    yield from phases(case)


def of_file(case: Case) -> Iterator[Problem]:
    """A file's pixel size, and one way to tell its phases."""
    if not case.has("image.pixel"):
        yield Problem("image.pixel", "missing: the width of a pixel", allowed='such as "2 µm"')
    ways = [key for key in ("image.threshold", "image.labels") if case.has(key)]
    if len(ways) != 1:
        yield Problem(
            "image.threshold",
            f"{'two things tell' if ways else 'nothing tells'} the phases apart",
            ", ".join(ways),
            "image.threshold for grey values or image.labels for labels",
        )
    if phase_count(case) < 2:
        yield Problem("image.labels", "there is one phase", allowed="two phases or more")
    if case.has("image.labels"):
        labels = case.numbers("image.labels")
        if len(set(labels)) != len(labels):
            yield Problem("image.labels", "a label stands twice", str(list(labels)))
    if case.has("image.window") and len(case.numbers("image.window")) != 2:
        yield Problem("image.window", "this takes a width and a height")


def of_outline(case: Case, source: str) -> Iterator[Problem]:
    """An outline's cell; keys of a file have no meaning beside it."""
    if not case.has("image.size") or len(case.numbers("image.size")) != 2:
        yield Problem("image.size", f"missing: {source} needs the width and height of its cell")
    for key in ("pixel", "pixel_height", "window", "threshold", "labels"):
        if case.has(f"image.{key}"):
            yield Problem(
                f"image.{key}", f"this is for image.file, and {source} is given", allowed=""
            )


def phases(case: Case) -> Iterator[Problem]:
    """E and ν, or K and G, of every phase."""
    pairs = [("image.modulus", "image.poisson"), ("image.bulk", "image.shear")]
    given = [pair for pair in pairs if any(case.has(key) for key in pair)]
    if len(given) != 1:
        told = "both E, ν and K, G are given" if given else "the phases have no moduli"
        allowed = "image.modulus and image.poisson, or image.bulk and image.shear"
        yield Problem("image.modulus", told, allowed=allowed)
        return
    count = phase_count(case)
    for key in given[0]:
        if not case.has(key):
            yield Problem(key, f"missing beside {', '.join(k for k in given[0] if k != key)}")
        elif len(case.fuzzies(key)) not in {count, 1 if key == "image.poisson" else count}:
            yield Problem(
                key,
                f"got {len(case.fuzzies(key))} values for {count} phases",
                allowed="one a phase",
            )
