"""Contributions to the width of E of an image, and the source to improve first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from alphacut.rve.image.random_threshold import NODES
from alphacut.stages.image.study import ImageStudy, Level

CURES = {
    "discretisation": "divide the pixels: cell.division or cell.width",
    "outline": "take more pixels across: cell.pixels",
    "finite window": "take a larger window, or another number of tiles",
    "threshold steps": f"up to {NODES} grey values within four deviations: each is solved",
    "threshold": "state cell.threshold more closely",
    "phases": "state the moduli of the phases more closely",
}


@dataclass(frozen=True)
class Contribution:
    """Width of E from one source.

    Args:
        source: A key of `CURES`.
        width: Width of E that it adds to that of crisp inputs, in Pa; of the discretisation, or of
            the pixels that an outline cuts, that width itself.
    """

    source: str
    width: float

    @property
    def cure(self) -> str:
        """Change of the case that narrows it."""
        return CURES[self.source]


def contributions(
    study: ImageStudy, discretisation: float, width: Callable[[Level, Level], float]
) -> tuple[Contribution, ...]:
    """The sources there are, the widest first, by widths of E in Pa: of pixels, and at levels."""
    base, lowest = width(None, None), study.alpha[0]
    widths = {"outline" if study.outlined else "discretisation": discretisation}
    if study.model.boundary == "window":
        widths["finite window"] = base - discretisation
    if study.random is not None:
        widths["threshold steps"] = base - discretisation
    if study.fuzzy_threshold:
        widths["threshold"] = width(lowest, None) - base
    if study.fuzzy_phases:
        widths["phases"] = width(None, lowest) - base
    rows = (Contribution(source, max(0.0, value)) for source, value in widths.items())
    return tuple(sorted(rows, key=lambda row: -row.width))
