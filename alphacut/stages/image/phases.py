"""Names and shares of the phases of an image."""

from __future__ import annotations

import itertools

from alphacut.case.sections.picture import Picture
from alphacut.io.units import engineering
from alphacut.stages.image.study import ImageStudy

BEYOND = "proved of the image as segmented, if it repeats itself"
NATURE = "guaranteed"


def phase_names(given: Picture, count: int) -> tuple[str, ...]:
    """Name of each phase, in the order of cell.modulus."""
    if given.labels is not None:
        return tuple(f"phase of label {label:g}" for label in given.labels)
    ends = [f"{number.modal:g}" for number in given.threshold or ()]
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
