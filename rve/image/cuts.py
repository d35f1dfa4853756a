"""Guaranteed α-cuts of the stiffness of an image whose threshold and phases are fuzzy."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.rve.image.fields.solver import Solver
from alphacut.rve.image.moduli import ModuliInterval
from alphacut.rve.image.phase_images import ModuliImages, moduli_images, threshold_ranges
from alphacut.rve.image.solve import CrispBounds, solve_between
from alphacut.stochastic.theta.truncated_normal import Array

TWO_CORNERS = "guaranteed, at two corners"
ENCLOSED = "guaranteed enclosure"


@dataclass(frozen=True)
class ImageBox:
    """One α-cut of the input.

    Args:
        thresholds: Least and greatest grey value of each threshold, rising.
        phases: Moduli of each phase, one more than thresholds; phase k has k thresholds at or below
            its grey values.

    Raises:
        ValueError: The numbers do not fit, or thresholds run backwards.
    """

    thresholds: Sequence[tuple[float, float]]
    phases: Sequence[ModuliInterval]

    def __post_init__(self) -> None:
        if len(self.phases) != len(self.thresholds) + 1:
            raise ValueError(
                f"{len(self.thresholds)} thresholds part {len(self.thresholds) + 1} phases; "
                f"{len(self.phases)} are given"
            )
        for end in (0, 1):
            values = [threshold[end] for threshold in self.thresholds]
            if values != sorted(values):
                raise ValueError(f"the thresholds {values} do not rise")
        if any(low > high for low, high in self.thresholds):
            raise ValueError("the interval of a threshold runs backwards")


@dataclass(frozen=True)
class Cut:
    """One α-cut of the stiffness.

    Args:
        bounds: Of every stiffness in the cut.
        nature: `TWO_CORNERS` where both ends belong to possible materials, else `ENCLOSED`.
        solution: Fields and costs.
    """

    bounds: StiffnessBounds
    nature: str
    solution: CrispBounds


def each_cut(
    grey: Array,
    boxes: Iterable[ImageBox],
    *,
    aspect: float = 1.0,
    solver: Solver | None = None,
    division: int = 1,
) -> Iterator[Cut]:
    """A guaranteed cut for each box: one solve with stresses and one with displacements.

    The order of the phases is needed at the two corners only. Where a pixel that the threshold
    leaves open may be of phases without order, it takes the least of their K + G/3 and the least of
    their G: still a proof, but of an enclosure.

    Each box lies inside the one before or the other way round; neighbours give the first guess, and
    equal ones are solved once. The rest is as in `solve_between`.
    """
    last: Cut | None = None
    before: ModuliImages | None = None
    for box in boxes:
        images = moduli_images(*threshold_ranges(grey, box.thresholds), box.phases)
        if last is None or before is None or not images.same(before):
            start = None if last is None else last.solution
            solution = solve_between(
                images, aspect=aspect, solver=solver, division=division, start=start
            )
            nature = TWO_CORNERS if images.attained else ENCLOSED
            last, before = Cut(solution.bounds, nature, solution), images
        yield last


def nested(intervals: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Intervals in the order of falling α, each widened to hold those before it."""
    lows = np.minimum.accumulate([low for low, _ in intervals])
    highs = np.maximum.accumulate([high for _, high in intervals])
    return [(float(low), float(high)) for low, high in zip(lows, highs, strict=True)]
