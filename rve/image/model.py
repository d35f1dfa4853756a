"""The image as the cell: α-cuts of its stiffness, proved at every level."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import FailedError, RefusedError
from alphacut.rve.anisotropy import ISOTROPIC, require_average
from alphacut.rve.image.bounds import Ends, StiffnessBounds
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.phase_images import ModuliImages
from alphacut.rve.image.solve import ImageSolution, solve_between

MILD = 10.0
LARGE = 1 << 19
COARSER = 10.0
"""Multiple of the solver's accuracy for a test; a larger one is cheaper and sees less."""
FLATTEST = 1e-3  # least side of a pixel over the other; beyond, rounding spoils the fields


@dataclass(frozen=True, eq=False)
class ImageCut:
    """Proved bounds at one α-level.

    Args:
        bounds: Of the stiffness.
        modulus: Interval of E, in Pa, nested in those of lower levels.
        poisson: Interval of ν.
        constants: Intervals of E_x, E_y, ν_xy and G_xy in plane strain, likewise nested.
    """

    bounds: StiffnessBounds
    modulus: Ends
    poisson: Ends
    constants: Array


@dataclass(frozen=True)
class ImageModel:
    """Settings of the solution of an image that repeats itself.

    Args:
        aspect: Height of a pixel over its width.
        division: Parts along each side of a pixel; see `usual_division`.
        solver: Stopping rule of the fields.
        average: What E and ν are of, a name in `anisotropy.AVERAGES`.

    Raises:
        RefusedError: A value lies outside its range.
    """

    aspect: float = 1.0
    division: int = 1
    solver: ConjugateGradient = field(default_factory=ConjugateGradient)
    average: str = ISOTROPIC

    def __post_init__(self) -> None:
        require_average(self.average)
        if not FLATTEST <= self.aspect <= 1 / FLATTEST:
            allowed = f"{FLATTEST:g} to {1 / FLATTEST:g}"
            raise RefusedError("height of a pixel over its width", f"{self.aspect:.3g}", allowed)

    def solve(self, images: ModuliImages, start: ImageSolution | None = None) -> ImageSolution:
        """Bounds of every image between two."""
        return solve_between(
            images, aspect=self.aspect, solver=self.solver, division=self.division, start=start
        )

    def cuts(
        self, images: Sequence[ModuliImages], crisp: tuple[ModuliImages, ImageSolution]
    ) -> list[ImageCut]:
        """One cut for each pair of images, in their order; equal neighbours are solved once.

        Args:
            images: Least and greatest moduli, for rising α; the last ones are solved first.
            crisp: A pair and its solution by the same model, the start.
        """
        before, solution = crisp
        solutions = []
        for pair in reversed(images):
            if not pair.same(before):
                before, solution = pair, self.solve(pair, solution)
            solutions.append(solution)
        moduli, ratios = (
            nested([ends(solved.bounds, self.average) for solved in solutions])
            for ends in (StiffnessBounds.young, StiffnessBounds.poisson)
        )
        ends = np.array([solved.bounds.constants() for solved in solutions])
        constants = [np.minimum.accumulate(ends[..., 0]), np.maximum.accumulate(ends[..., 1])]
        rows = zip(solutions, moduli, ratios, np.stack(constants, axis=-1), strict=True)
        return [ImageCut(s.bounds, e, nu, c) for s, e, nu, c in rows][::-1]

    def require_consistent(self, images: Sequence[ModuliImages], cuts: Sequence[ImageCut]) -> None:
        """Refuse cuts that contradict bounds of images inside them, at another accuracy.

        These lie half way between the least and the greatest moduli of the narrowest and of the
        widest cut, and are solved anew, from no start, with fields that lack `COARSER` times the
        energy.

        Raises:
            FailedError: The proved interval of such an image lies outside the cut.
        """
        solver = replace(self.solver, accuracy=min(COARSER * self.solver.accuracy, 0.1))
        judge, points = replace(self, solver=solver), [images[-1].half_way, images[0].half_way]
        for k, point in enumerate(points[: 1 if points[0].same(points[1]) else 2]):
            bounds = judge.solve(point).bounds
            for cut in cuts if k == 0 else cuts[:1]:  # the narrowest one lies in all
                for name, end, (low, high) in (
                    ("E", cut.modulus, bounds.young(self.average)),
                    ("ν", cut.poisson, bounds.poisson(self.average)),
                ):
                    if not (low <= end[1] and end[0] <= high):
                        what = f"{name} of an image inside a cut is {low:.9g} … {high:.9g}"
                        what += f", the cut {end[0]:.9g} … {end[1]:.9g}"
                        cure = "keep the case and report it"
                        raise FailedError(f"the proof is wrong: {what}", cure)


def nested(intervals: Sequence[Ends]) -> list[Ends]:
    """Intervals in the order of falling α, each widened to hold those before it."""
    lows = np.minimum.accumulate([low for low, _ in intervals])
    highs = np.maximum.accumulate([high for _, high in intervals])
    return [(float(low), float(high)) for low, high in zip(lows, highs, strict=True)]


def usual_division(images: ModuliImages) -> int:
    """Parts of a pixel where nobody names them.

    Two where both moduli of an image stay within a factor `MILD`, so that few iterations are
    needed, and the image has up to `LARGE` pixels; else one.
    """
    ratio = max(float(pair[1].max() / pair[0].min()) for pair in (images.bulk, images.shear))
    return 2 if ratio <= MILD and images.bulk[0].size <= LARGE else 1
