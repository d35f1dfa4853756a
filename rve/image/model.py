"""Bounds of an image as the material's modulus: periodic, or a window with its tiles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import log2

import numpy as np

from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.rve.image.cuts import ENCLOSED, TWO_CORNERS, nested
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.fields.solver import Solver
from alphacut.rve.image.phase_images import ModuliImages
from alphacut.rve.image.read import memory
from alphacut.rve.image.solve import CrispBounds, both_sides, solve_between
from alphacut.rve.image.windows import Tiling, tiles_of
from alphacut.stochastic.theta.truncated_normal import Array

BOUNDARIES = ("periodic", "window")
MILD = 10.0
LARGE = 1 << 19
FLATTEST = 1e-3  # least side of a pixel over the other; beyond, rounding spoils the fields
CONFIDENT = "95 % confidence interval of the material, no proof"


@dataclass(frozen=True)
class ImageCut:
    """Bounds at one α-level.

    Args:
        bounds: Of the stiffness: the material's of a periodic image, the tiles' bracket of a
            window.
        modulus: Interval of E of eq. 16, in Pa; of a window widened by the scatter of its tiles.
        nature: What the interval is worth.
        solution: Fields of a periodic image.
        iterations: Of the slowest system.
    """

    bounds: StiffnessBounds
    modulus: tuple[float, float]
    nature: str
    solution: CrispBounds | None
    iterations: int


@dataclass(frozen=True)
class ImageModel:
    """Settings of the solution of an image.

    Args:
        aspect: Height of a pixel over its width.
        boundary: "periodic": the image repeats itself; "window": it is cut from a larger material.
        tiles: Tiles along each side of a window.
        division: Parts along each side of a pixel; None: `usual_division`.
        solver: Way to the fields.
        width: Width of the stiffness's bounds that a crisp periodic image is to have; pixels are
            divided further until it has. None: as many parts as `division` says.

    Raises:
        ValueError: A value lies outside its range.
    """

    aspect: float = 1.0
    boundary: str = "periodic"
    tiles: int = 2
    division: int | None = None
    solver: Solver = field(default_factory=ConjugateGradient)
    width: float | None = None

    def __post_init__(self) -> None:
        if self.boundary not in BOUNDARIES:
            raise ValueError(f"the boundary is {self.boundary!r}; take periodic or window")
        if not FLATTEST <= self.aspect <= 1 / FLATTEST:
            what = f"a pixel is {self.aspect:.3g} times as high as wide"
            raise ValueError(f"{what}; allowed: {FLATTEST:g} to {1 / FLATTEST:g} times")
        if self.boundary == "window" and self.tiles < 2:
            raise ValueError("one tile has no scatter; divide the window into 2 × 2 tiles or more")

    def refined(self, images: ModuliImages, before: float = 0.0) -> tuple[ImageModel, ImageCut]:
        """The model with the parts that its width needs, and periodic bounds of the image by it.

        Args:
            images: Least and greatest moduli for crisp inputs, equal but where an outline cuts.
            before: Width with half as many parts; 0: not known.

        Raises:
            ValueError: The width is out of reach, of an outline's pixels or of the memory.
        """
        model = replace(self, division=self.division or usual_division(images))
        crisp = model.periodic(images, pixels=True)
        if self.width is None or crisp.bounds.width <= self.width:
            return model, crisp
        if not all(np.array_equal(*pair) for pair in (images.bulk, images.shear)):
            raise ValueError(
                f"pixels that the outline cuts cause a width of {crisp.bounds.width:.2e} by"
                f" themselves, {self.width:.2e} is asked for; take more pixels"
            )
        rows, columns = images.bulk[0].shape
        needed, have = memory(rows, columns, model.parts)
        power = max(log2(before / crisp.bounds.width), 1.0) if before else 2.0
        least = crisp.bounds.width * (needed / have) ** (power / 2)
        if needed > have / 4 or least > self.width:
            raise ValueError(
                f"the width {self.width:.2e} takes more parts of a pixel than fit into memory: "
                f"{model.parts} give {crisp.bounds.width:.1e}, those that fit {least:.1e} at best; "
                "take a larger width, or an image of fewer pixels"
            )
        return replace(model, division=2 * model.parts).refined(images, crisp.bounds.width)

    def cuts(
        self, images: Sequence[ModuliImages], crisp: tuple[ModuliImages, ImageCut]
    ) -> list[ImageCut]:
        """One cut for each pair of images, in their order; equal neighbours are solved once.

        Args:
            images: Least and greatest moduli, for rising α; the last ones are solved first.
            crisp: A pair and its periodic bounds by the same model, the start.
        """
        before, last = crisp
        solved = self.boundary == "periodic"
        found: list[ImageCut] = []
        for pair in reversed(images):
            if not (solved and pair.same(before)):
                last = self.cut(pair, last.solution)
            found.append(last)
            before, solved = pair, True
        intervals = nested([cut.modulus for cut in found])
        widened = [replace(cut, modulus=m) for cut, m in zip(found, intervals, strict=True)]
        return widened[::-1]

    def cut(self, images: ModuliImages, start: CrispBounds | None = None) -> ImageCut:
        """Bounds between two images, of the boundary that the model has."""
        if self.boundary == "periodic":
            return self.periodic(images, start)
        tiling, iterations = self.tiling(images, self.tiles)
        return ImageCut(tiling.bracket, tiling.material_modulus(), CONFIDENT, None, iterations)

    def periodic(
        self, images: ModuliImages, start: CrispBounds | None = None, *, pixels: bool = False
    ) -> ImageCut:
        """Bounds between two images that repeat themselves."""
        solution = solve_between(
            images,
            aspect=self.aspect,
            solver=self.solver,
            division=self.parts,
            start=start,
            pixels=pixels,
        )
        nature = TWO_CORNERS if images.attained else ENCLOSED
        iterations = max(solution.upper.iterations, solution.lower.iterations)
        bounds = solution.bounds
        return ImageCut(bounds, bounds.modulus, nature, solution, iterations)

    def tiling(self, images: ModuliImages, along: int) -> tuple[Tiling, int]:
        """Tiles of a window under uniform displacement and uniform traction, and the iterations."""
        tiles = [[tiles_of(m, along) for m in pair] for pair in (images.bulk, images.shear)]
        upper, lower = both_sides(
            ((tiles[0][1], tiles[1][1]), (tiles[0][0], tiles[1][0])),
            solver=self.solver,
            aspect=self.aspect,
            division=self.parts,
            clamped=True,
        )
        tiling = Tiling(upper.energy.upper, lower.energy.upper)
        return tiling, max(upper.iterations, lower.iterations)

    @property
    def parts(self) -> int:
        """Parts along each side of a pixel."""
        return self.division or 1


def usual_division(images: ModuliImages) -> int:
    """Parts of a pixel where nobody names them.

    Two where both moduli of an image stay within a factor `MILD`, so that few iterations are
    needed, and the image has up to `LARGE` pixels; else one.
    """
    ratio = max(float(pair[1].max() / pair[0].min()) for pair in (images.bulk, images.shear))
    return 2 if ratio <= MILD and images.bulk[0].size <= LARGE else 1


def reduced_to_pixels(values: Array, division: int) -> Array:
    """Means over the parts of each pixel, shape (rows, columns)."""
    rows, columns = values.shape
    parts = values.reshape(rows // division, division, columns // division, division)
    return np.asarray(parts.mean(axis=(1, 3)))
