"""The image as the cell: both bounds of its stiffness, and their α-cuts, proved at every level."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from threading import Event
from typing import Any

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError, require
from alphacut.base.progress_bar import Progress
from alphacut.base.threads import KernelThreads
from alphacut.rve.image.bounds import Enclosure, StiffnessBounds, inverse_below
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.fields.element import Element, element_of
from alphacut.rve.image.fields.energy import SideSolution, solve_side
from alphacut.rve.image.fields.grid import device_array
from alphacut.rve.image.fields.kernels import call_kernels
from alphacut.rve.image.phases import ModuliImages
from alphacut.rve.result.moduli import ISOTROPIC, require_average


@dataclass(frozen=True, eq=False)
class ImageCut:
    """Proved bounds at one α-level.

    Args:
        bounds: Bounds of the stiffness.
        modulus: Interval of E, in Pa, nested in those of lower levels.
        poisson: Interval of ν, likewise nested.
        constants: Intervals of the constants of `StiffnessBounds.constants`, likewise nested, shape
            (constants, 2).
    """

    bounds: StiffnessBounds
    modulus: Enclosure
    poisson: Enclosure
    constants: Array


@dataclass(frozen=True)
class ImageModel:
    """Settings of the solution of an image of pixels or voxels that repeats itself.

    Args:
        sides: Sides of a pixel along y and x, or of a voxel along z, y and x, over that along x.
        division: Number of elements along each side of a pixel or voxel; see `usual_division`.
        solver: Solver of the fields with its stopping rule.
        average: Average of the stiffness that E and ν of the plane are of, a name in
            `moduli.AVERAGES`; in space they are of Hill's isotropic average.
        device: Where the fields are solved for: "cpu", or "cuda" by CuPy.

    Raises:
        RefusedError: A setting is not allowed.
    """

    sides: tuple[float, ...] = (1.0, 1.0)
    division: int = 1
    solver: ConjugateGradient = field(default_factory=ConjugateGradient)
    average: str = ISOTROPIC
    device: str = "cpu"

    def __post_init__(self) -> None:
        require_average(self.average)
        allowed = "two of a pixel or three of a voxel"
        require(len(self.sides) in (2, 3), "sides", self.sides, allowed)
        is_whole = isinstance(self.division, int) and self.division >= 1
        require(is_whole, "division", self.division, "a whole number from 1")
        max_ratio = 1e3  # beyond it rounding spoils the fields
        for side in self.sides:
            require(
                1 / max_ratio <= side <= max_ratio,
                "side of a pixel or voxel over that along x",
                value=f"{side:.3g}",
                allowed=f"{1 / max_ratio:g} to {max_ratio:g}",
            )

    @property
    def elements(self) -> tuple[Element, Element]:
        """Elements of stresses and of displacements."""
        return element_of(self.sides, stress=True), element_of(self.sides, stress=False)

    def solve(self, images: ModuliImages, start: ImageSolution | None = None) -> ImageSolution:
        """Return proved bounds of the stiffness of all images with moduli in given intervals.

        The stiffness C of a cell is the least energy of displacements, and C⁻¹ that of stresses in
        equilibrium, as quadratic forms of the mean strain and of the mean stress. So any
        displacements bound C from above, and any such stresses bound it from below. Stiffer
        materials make a stiffer cell: displacements are computed with the upper moduli, stresses
        with the lower ones, each on a thread.

        Args:
            images: Lower and upper moduli of each pixel or voxel.
            start: A solution of the same division, whose fields are the first guess.

        Raises:
            RefusedError: The images have another dimension than the model, or the device is
                missing.
            FailedError: The solver does not converge.
        """
        shape = images.bulk[0].shape
        what = f"{len(self.sides)} for a grid of shape {shape}"
        require(len(shape) == len(self.sides), "sides", what, "one for each axis")
        is_stopped = Event()

        def raise_if_stopped() -> None:
            """End this thread where the other one has ended; called before each iteration."""
            if is_stopped.is_set():
                raise InterruptedError("the other side's solution was stopped")
            try:
                self.solver.watch()
            except BaseException:
                is_stopped.set()
                raise

        def solve(end: int, guess: SideSolution | None) -> SideSolution | None:
            """Return stresses for the lower moduli (end 0) or displacements for the upper (1)."""
            moduli = images.moduli_of_fields(end)
            if moduli is None:
                return None
            return self.solve_side(end, *moduli, guess, raise_if_stopped)

        guesses = (None, None) if start is None else (start.lower, start.upper)
        has_kernels = len(shape) == 3 and self.device == "cpu"
        with KernelThreads(
            workers=2 if self.device == "cpu" else 1,
            call_kernels=partial(call_kernels, self.elements if has_kernels else ()),
        ) as pool:
            try:
                lower, upper = pool.map(solve, (0, 1), guesses)
            finally:  # Ctrl-C and errors are not to wait for the other side
                is_stopped.set()
        components = 3 * (len(shape) - 1)  # of the strain in Voigt's order: 3 or 6
        lower_bound: Array = np.zeros((components, components))
        if lower is not None:
            lower_bound = inverse_below(lower.energy.upper)
        upper_bound = np.diag(np.full(components, np.inf))
        if upper is not None:
            upper_bound = upper.energy.upper
        return ImageSolution(StiffnessBounds(lower_bound, upper_bound), upper, lower)

    def solve_side(
        self,
        end: int,
        bulk: Array,
        shear: Array,
        start: SideSolution | None,
        watch: Callable[[], None] | None = None,
    ) -> SideSolution | None:
        """Return stresses (end 0) or displacements (end 1) of least energy for given moduli.

        Args:
            end: 0 for stresses, whose energy bounds the compliance from above; 1 for displacements,
                whose energy bounds the stiffness from above.
            bulk: Bulk modulus of each pixel or voxel in Pa, of the plane K + G/3.
            shear: Shear modulus, of the same shape.
            start: Solution whose fields are the first guess.
            watch: Function in place of that of the solver.

        Returns:
            The solution; None where pores percolate, so that no stress is found that vanishes in
            them.
        """
        to_device = device_array(self.device)
        return solve_side(
            self.elements[end],
            to_device(bulk),
            to_device(shear),
            solver=replace(self.solver, watch=watch or self.solver.watch),
            division=self.division,
            start=None if start is None else start.fields,
        )

    def cuts(
        self,
        images: Sequence[ModuliImages],
        crisp: tuple[ModuliImages, ImageSolution],
        progress: Progress | None = None,
    ) -> list[ImageCut]:
        """Return nested bounds of stiffness, E, ν and engineering constants at each α-level.

        Args:
            images: Lower and upper moduli at each level, for rising α.
            crisp: A pair of images and its solution by the same model, the first guess.
            progress: Function that is called with the fraction of the levels that is done.
        """
        last_images, solution = crisp
        bounds = []  # for falling α, from the narrowest cut to the widest
        for level_images in reversed(images):
            if not level_images.equals(last_images):
                last_images = level_images
                solution = self.solve(level_images, solution)
            bounds.append(solution.bounds)
            if progress is not None:
                progress(len(bounds) / len(images))
        # intervals of E, ν and the other constants, (levels, constants, 2); each contains those of
        # higher levels, since every image of a cut is one of the wider cuts
        intervals = np.array(
            [[x.young(self.average), x.poisson(self.average), *x.constants()] for x in bounds]
        )
        np.minimum.accumulate(intervals[..., 0], out=intervals[..., 0])
        np.maximum.accumulate(intervals[..., 1], out=intervals[..., 1])
        cuts = []
        for level_bounds, (young, poisson, *constants) in zip(bounds, intervals, strict=True):
            ends = Enclosure(*young), Enclosure(*poisson)
            cuts.append(ImageCut(level_bounds, *ends, np.array(constants)))
        return cuts[::-1]

    def require_consistent(self, images: Sequence[ModuliImages], cuts: Sequence[ImageCut]) -> None:
        """Refuse cuts that contradict the bounds of an image inside them.

        Two images with moduli in the middle of the narrowest and of the widest cut are solved anew,
        without a first guess and with ten times the energy error: a coarser solution is cheaper and
        sees less.

        Args:
            images: Lower and upper moduli at each level, for rising α.
            cuts: Their cuts, in the same order.

        Raises:
            FailedError: E or ν of such an image lies outside a cut.
        """
        solver = replace(self.solver, accuracy=min(10 * self.solver.accuracy, 0.1))
        coarse_model = replace(self, solver=solver)
        narrowest = images[-1].geometric_mean
        widest = images[0].geometric_mean
        tests = [(narrowest, cuts)]  # it lies in every cut
        if not narrowest.equals(widest):
            tests.append((widest, cuts[:1]))
        for image, containing_cuts in tests:
            bounds = coarse_model.solve(image).bounds
            young = bounds.young(self.average)
            poisson = bounds.poisson(self.average)
            for cut in containing_cuts:
                _require_overlap("E", young, cut.modulus)
                _require_overlap("ν", poisson, cut.poisson)


def _require_overlap(name: str, inside: Enclosure, cut: Enclosure) -> None:
    """Refuse a cut that has no number in common with the bounds of an image inside it."""
    if inside.lower > cut.upper or cut.lower > inside.upper:
        what = f"{name} of an image inside a cut is {inside.lower:.9g} … {inside.upper:.9g}"
        what += f", the cut {cut.lower:.9g} … {cut.upper:.9g}"
        raise FailedError(f"the proof is wrong: {what}", "keep the case and report it")


def usual_division(images: ModuliImages) -> int:
    """Return the number of elements along each side of a pixel or voxel, 1 or 2.

    It is 2 for images of up to 2¹⁹ pixels and contrasts of up to 10. Of a voxel it is 1, since two
    elements take eight times as long and narrow the bounds by half.
    """
    pairs = images.bulk, images.shear
    is_mild = all(upper.max() <= 10.0 * lower.min() for lower, upper in pairs)
    is_small = images.bulk[0].ndim == 2 and images.bulk[0].size <= 1 << 19
    return 2 if is_mild and is_small else 1


@dataclass(frozen=True, eq=False)
class ImageSolution:
    """Bounds of the stiffness with the fields that prove them.

    Args:
        bounds: The bounds.
        upper: Displacements, which prove the upper bound; None where a phase is rigid.
        lower: Stresses, which prove the lower bound; None where pores percolate.
    """

    bounds: StiffnessBounds
    upper: SideSolution | None
    lower: SideSolution | None


def solve_image(bulk: Array, shear: Array, **settings: Any) -> ImageSolution:
    """Return proved bounds of a periodic image of pixels or voxels.

    Args:
        bulk: Bulk modulus in Pa, 0 in pores, infinite where rigid, shape (y, x) with that of plane
            strain, K + G/3, or (z, y, x).
        shear: Shear modulus in Pa, of the same shape.
        settings: Those of `ImageModel`.

    Returns:
        Solution whose `bounds` have the methods `young`, `poisson`, `shear` and `constants`.

    Raises:
        RefusedError: The arrays are not alike, or hold negative numbers or none but 0 and infinity.
    """
    moduli = np.asarray(bulk, float), np.asarray(shear, float)  # the proof is of doubles
    shapes = [values.shape for values in moduli]
    is_grid = shapes[0] == shapes[1] and len(shapes[0]) in (2, 3)
    allowed = "two arrays of one shape (y, x) or (z, y, x)"
    require(is_grid, "moduli", f"of shapes {shapes[0]}, {shapes[1]}", allowed)
    for values in moduli:
        require(bool((values >= 0).all()), "moduli", "negative or nan", "numbers from 0")
        is_solid = bool(((values > 0) & np.isfinite(values)).any())
        require(is_solid, "moduli", "0 or infinite throughout", "a material with both bounds")
    settings = {"sides": (1.0,) * len(shapes[0]), **settings}
    return ImageModel(**settings).solve(ModuliImages.crisp(*moduli))
