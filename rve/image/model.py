"""Bounds of an image as the material's modulus: periodic, or a window with its tiles."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np

from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.rve.image.cuts import ENCLOSED, TWO_CORNERS, nested
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.fields.side import DISPLACEMENT, STRESS, solve_side
from alphacut.rve.image.phase_images import ModuliImages
from alphacut.rve.image.read import require_memory
from alphacut.rve.image.solve import CrispBounds, solve_between
from alphacut.rve.image.windows import Tiling, tiles_of
from alphacut.rve.result import Homogenised, StressCurve
from alphacut.stochastic.theta.truncated_normal import Array

MODULI = np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 0.0, 1.0]])  # strains of each modulus
BOUNDARIES = ("periodic", "window")
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
        seconds: Wall time.
    """

    bounds: StiffnessBounds
    modulus: tuple[float, float]
    nature: str
    solution: CrispBounds | None
    iterations: int
    seconds: float

    @property
    def homogenised(self) -> Homogenised:
        """Middle of the bounds as a model of the cell gives it, with its error."""
        middle = (self.bounds.lower + self.bounds.upper) / 2
        values = np.einsum("mj,jk,mk->m", MODULI, middle, MODULI)
        gaps = np.einsum("mj,jk,mk->m", MODULI, self.bounds.upper - middle, MODULI)
        mean = 0.01 * values[0] / 2, 0.02 * values[2]  # eq. 15: ε11 = ε22 = 0.01, and ε12 = 0.01
        curve = StressCurve(
            np.zeros(1), np.ones(1), np.array([mean[0]]), np.array([mean[1]]), middle[None]
        )
        return Homogenised(
            curve,
            "image",
            iterations=(self.iterations,),
            seconds={"total": self.seconds},
            errors={"space": gaps / values},
            reason=self.nature,
        )


@dataclass(frozen=True)
class ImageModel:
    """Settings of the solution of an image.

    Args:
        aspect: Height of a pixel over its width.
        boundary: "periodic": the image repeats itself; "window": it is cut from a larger material.
        tiles: Tiles along each side of a window.
        division: Parts along each side of a pixel.
        solver: Stopping rule.
        width: Width of the stiffness's bounds that a crisp periodic image is to have; pixels are
            divided further until it has. None: as many parts as `division` says.

    Raises:
        ValueError: A value lies outside its range.
    """

    aspect: float = 1.0
    boundary: str = "periodic"
    tiles: int = 2
    division: int = 1
    solver: ConjugateGradient = field(default_factory=ConjugateGradient)
    width: float | None = None

    def __post_init__(self) -> None:
        if self.boundary not in BOUNDARIES:
            raise ValueError(f"the boundary is {self.boundary!r}; take periodic or window")
        if self.boundary == "window" and self.tiles < 2:
            raise ValueError("one tile has no scatter; divide the window into 2 × 2 tiles or more")

    def run(self, images: Sequence[ModuliImages]) -> list[ImageCut]:
        """One cut for each pair of images, in their order; equal neighbours are solved once.

        Args:
            images: Least and greatest moduli, for rising α; the last ones are solved first.
        """
        model, cuts = self.divided_enough(images[-1])
        before = images[-1]
        for pair in reversed(images[:-1]):
            if not _same(pair, before):
                cuts.append(model.cut(pair, cuts[-1].solution))
            else:
                cuts.append(cuts[-1])
            before = pair
        intervals = nested([cut.modulus for cut in cuts])
        widened = [_with_modulus(c, m) for c, m in zip(cuts, intervals, strict=True)]
        return widened[::-1]

    def divided_enough(self, images: ModuliImages) -> tuple[ImageModel, list[ImageCut]]:
        """The model with the parts that its width needs, and the cut of this image by it.

        Raises:
            ValueError: The image is not crisp, or the width needs more memory than there is.
        """
        cut = self.cut(images)
        if self.width is None or cut.solution is None or cut.bounds.width <= self.width:
            return self, [cut]
        if not all(np.array_equal(*pair) for pair in (images.bulk, images.shear)):
            raise ValueError(
                "a width can be asked for where the top level is crisp; "
                f"here its inputs alone cause {cut.bounds.width:.2e}"
            )
        rows, columns = images.bulk[0].shape
        require_memory(rows, columns, 2 * self.division)
        return replace(self, division=2 * self.division).divided_enough(images)

    def cut(self, images: ModuliImages, start: CrispBounds | None = None) -> ImageCut:
        """Bounds between two images."""
        began = perf_counter()
        if self.boundary == "window":
            tiling, iterations = self.tiling(images, self.tiles)
            bounds, modulus, nature = tiling.bracket, tiling.material_modulus(), CONFIDENT
            return ImageCut(bounds, modulus, nature, None, iterations, perf_counter() - began)
        solution = solve_between(
            images,
            aspect=self.aspect,
            solver=self.solver,
            division=self.division,
            start=start,
            pixels=start is None,
        )
        nature = TWO_CORNERS if images.attained else ENCLOSED
        iterations = max(solution.upper.iterations, solution.lower.iterations)
        bounds = solution.bounds
        seconds = perf_counter() - began
        return ImageCut(bounds, bounds.modulus, nature, solution, iterations, seconds)

    def tiling(self, images: ModuliImages, along: int) -> tuple[Tiling, int]:
        """Tiles of a window under uniform displacement and uniform traction, and the iterations."""
        with ThreadPoolExecutor(2) as pool:
            upper, lower = (
                pool.submit(
                    solve_side,
                    side,
                    tiles_of(images.bulk[end], along),
                    tiles_of(images.shear[end], along),
                    solver=self.solver,
                    aspect=self.aspect,
                    division=self.division,
                    clamped=True,
                )
                for side, end in ((DISPLACEMENT, 1), (STRESS, 0))
            )
        sides = upper.result(), lower.result()
        tiling = Tiling(*(side.energy.upper for side in sides))
        return tiling, max(side.iterations for side in sides)


def _same(first: ModuliImages, second: ModuliImages) -> bool:
    pairs = zip((*first.bulk, *first.shear), (*second.bulk, *second.shear), strict=True)
    return all(np.array_equal(a, b) for a, b in pairs)


def _with_modulus(cut: ImageCut, modulus: tuple[float, float]) -> ImageCut:
    return replace(cut, modulus=modulus)


def reduced_to_pixels(values: Array, division: int) -> Array:
    """Means over the parts of each pixel, shape (rows, columns)."""
    rows, columns = values.shape
    parts = values.reshape(rows // division, division, columns // division, division)
    return np.asarray(parts.mean(axis=(1, 3)))
