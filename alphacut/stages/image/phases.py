"""What each phase of an image is and covers, in words; remarks where the case says otherwise."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator

import numpy as np

from alphacut.case.case import Case
from alphacut.case.sections.picture import Picture
from alphacut.io.units import engineering
from alphacut.stages.image.study import ImageStudy
from alphacut.stages.plausible import SOFT, STIFF

BEYOND = {
    "periodic": 'boundary = "periodic": the image repeats itself',
    "window": 'boundary = "window": a piece of a larger material',
}
IF = {"periodic": ', if the image repeats itself (boundary = "periodic")', "window": " (E alone)"}
SEAM, OFTENER = 0.1, 3  # of an edge, and of neighbouring lines: beyond both an edge does not match
APART = 0.05  # of the area, by which a phase may differ from what the case's words say


def phase_names(given: Picture, count: int) -> tuple[str, ...]:
    """Name of each phase, in the order of cell.modulus."""
    if given.labels is not None:
        return tuple(f"phase of label {label:g}" for label in given.labels)
    if given.threshold is None:
        return "phase outside the outline", "phase inside"
    ends = [f"{number.modal:g}" for number in given.threshold]
    dark, bright = ("dark", "bright") if count == 2 else ("darkest", "brightest")
    between = (f"phase from {a} to {b}" for a, b in itertools.pairwise(ends))
    return f"{dark} phase (below {ends[0]})", *between, f"{bright} phase (above {ends[-1]})"


def phase_lines(study: ImageStudy) -> list[str]:
    """A line for each phase: its share of the area, and its moduli, at the modal values."""
    first, second = ("E", "nu") if study.young else ("K", "G")
    modal = " (modal values)" if study.fuzzy_phases or study.fuzzy_threshold else ""
    return [
        f"{name}: {share:.1%} of the area, {first} {engineering(one.modal, 'Pa')}, {second}"
        f" {engineering(other.modal, '' if study.young else 'Pa')}{modal}"
        for name, share, (one, other) in zip(study.names, study.fractions, study.pairs, strict=True)
    ]


def unmatched(study: ImageStudy) -> Iterator[str]:
    """A remark where phases differ across opposite edges more than between neighbouring lines."""
    phase, found = study.ranges(None)[0], []
    for name, lines in (("left and right", phase.T), ("top and bottom", phase)):
        seam, inner = np.mean(lines[0] != lines[-1]), np.mean(lines[1:] != lines[:-1])
        if seam > max(SEAM, OFTENER * inner):
            found.append(f"{name} on {seam:.0%}")
    if found and study.model.boundary == "periodic":
        yield (
            f"cell.boundary: the image's edges do not match, {', '.join(found)} of their length:"
            ' boundary = "window" is for a piece of a larger material'
        )


def contradicted(case: Case, study: ImageStudy) -> Iterator[str]:
    """Remarks where phases cover another percentage than the case names, or edges do not match."""
    if case.picture.inequality is None:
        yield from unmatched(study)
    shares = list(zip(study.fractions, study.pairs, strict=True)) if study.young else []
    for pattern, (low, high) in (STIFF | SOFT).items():
        meant = sum(share for share, (young, _) in shares if low <= young.modal <= high)
        number = r"(\d+(?:[.,]\d+)?) ?(?:%|per ?cent|vol\.?-?%)"
        found = re.search(rf"(?i){number} (?:of )?({pattern})\b", case.words)
        if meant and found and abs(meant - float(found[1].replace(",", ".")) / 100) > APART:
            yield (
                f"cell.modulus: the case says {found[0]!r}, and the phases of such a modulus cover"
                f" {meant:.1%} of the image; are they swapped? Order: from dark to bright, or as"
                " labelled"
            )
