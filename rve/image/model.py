"""The image as the cell: both bounds of its stiffness, and their α-cuts, proved at every level."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from threading import Event
from typing import Any

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import FailedError, require
from alphacut.base.progress_bar import Progress
from alphacut.base.threads import KernelThreads
from alphacut.rve.image.bounds import Interval, StiffnessBounds, inverse_below
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.fields.element import Element, element_of
from alphacut.rve.image.fields.energy import (
    SideSolution,
    coefficients,
    energies,
    solve_side,
)
from alphacut.rve.image.fields.grid import device_array, on_host
from alphacut.rve.image.fields.kernels import call_kernels
from alphacut.rve.image.phases import ModuliImages
from alphacut.rve.result.moduli import ISOTROPIC, require_average, square_moduli
from alphacut.rve.result.result import PhaseEnergies

MILD = 10.0
LARGE = 1 << 19
COARSER = 10.0
"""Multiple of the solver's accuracy for a test; a larger one is cheaper and sees less."""
MIN_SIDE_RATIO = 1e-3  # least side of a pixel over the other; beyond, rounding spoils the fields


@dataclass(frozen=True, eq=False)
class ImageCut:
    """Proved bounds at one α-level.

    Args:
        bounds: Of the stiffness.
        modulus: Interval of E, in Pa, nested in those of lower levels.
        poisson: Interval of ν.
        constants: Intervals of the constants of `StiffnessBounds.constants`, likewise nested.
    """

    bounds: StiffnessBounds
    modulus: Interval
    poisson: Interval
    constants: Array


@dataclass(frozen=True)
class ImageModel:
    """Settings of the solution of an image of pixels or voxels that repeats itself.

    Args:
        sides: Sides of a pixel along y and x, or of a voxel along z, y and x, over that along x.
        division: Parts along each side of a pixel or voxel; see `usual_division`.
        solver: Stopping rule of the fields.
        average: What E and ν of the plane are of, a name in `moduli.AVERAGES`; in space they are of
            Hill's isotropic average.
        device: Where the fields are solved for: "cpu", or "cuda" by CuPy.
    """

    sides: tuple[float, ...] = (1.0, 1.0)
    division: int = 1
    solver: ConjugateGradient = field(default_factory=ConjugateGradient)
    average: str = ISOTROPIC
    device: str = "cpu"

    def __post_init__(self) -> None:
        require_average(self.average)
        allowed = f"{MIN_SIDE_RATIO:g} to {1 / MIN_SIDE_RATIO:g}"
        allowed_sides = "two of a pixel or three of a voxel"
        require(len(self.sides) in (2, 3), "sides", self.sides, allowed_sides)
        is_whole = isinstance(self.division, int) and self.division >= 1
        require(is_whole, "division", self.division, "a whole number from 1")
        for side in self.sides:
            require(
                MIN_SIDE_RATIO <= side <= 1 / MIN_SIDE_RATIO,
                "side of a pixel or voxel over that along x",
                value=f"{side:.3g}",
                allowed=allowed,
            )

    @property
    def elements(self) -> tuple[Element, Element]:
        """Elements of stresses and of displacements."""
        return element_of(self.sides, stress=True), element_of(self.sides, stress=False)

    def solve(self, images: ModuliImages, start: ImageSolution | None = None) -> ImageSolution:
        """Proved bounds of the stiffness of all images with moduli between the least and greatest.

        The lower bound is that of stresses with the least moduli, the upper one that of
        displacements with the greatest; each is computed on a thread. The fields of `start`, a
        solution of the same division, are the first guess.
        """
        shape = images.bulk[0].shape
        what = f"{len(self.sides)} for a grid of shape {shape}"
        require(len(shape) == len(self.sides), "sides", what, "one for each axis")
        is_stopped = Event()

        def raise_if_stopped() -> None:
            """Called before each iteration; ends this thread where the other one has ended."""
            if is_stopped.is_set():
                raise InterruptedError("the other side's solution was stopped")
            try:
                self.solver.watch()
            except BaseException:
                is_stopped.set()
                raise

        def solve(end: int, guess: SideSolution | None) -> SideSolution | None:
            """Fields of least energy with the least (end 0) or greatest (end 1) moduli, if any."""
            moduli = images.moduli_of_fields(end)
            if moduli is None:
                return None
            return self.solve_side(end, *moduli, guess, raise_if_stopped)

        guesses = (None, None) if start is None else (start.lower, start.upper)
        # pixels and devices are worked on without kernels
        has_kernels = len(shape) == 3 and self.device == "cpu"
        with KernelThreads(
            workers=2 if self.device == "cpu" else 1,
            call_kernels=partial(call_kernels, self.elements if has_kernels else ()),
        ) as pool:
            try:
                lower, upper = pool.map(solve, (0, 1), guesses)
            finally:  # Ctrl-C and errors are not to wait for the other side
                is_stopped.set()
        size = 3 * (len(shape) - 1)  # strains of the plane and of space in Voigt's order: 3 and 6
        least = np.zeros((size, size)) if lower is None else inverse_below(lower.energy.upper)
        greatest = np.diag(np.full(size, np.inf)) if upper is None else upper.energy.upper
        return ImageSolution(StiffnessBounds(least, greatest), upper, lower)

    def solve_side(
        self,
        end: int,
        bulk: Array,
        shear: Array,
        start: SideSolution | None,
        watch: Callable[[], None] | None = None,
    ) -> SideSolution | None:
        """Stresses (end 0), which bound the compliance, or displacements (1) of least energy.

        None where pores percolate, so that no stress is found that vanishes in them.
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
        """Bounds of stiffness, E, ν and engineering constants at each α-level, nested, in order.

        Args:
            images: Least and greatest moduli of each level, for rising α.
            crisp: A pair of images and its solution by the same model, the first guess.
            progress: Takes the share of the levels that is done.
        """
        last_pair, solution = crisp
        bounds = []  # for falling α, from the narrowest cut to the widest
        for pair in reversed(images):
            if not pair.equals(last_pair):
                last_pair, solution = pair, self.solve(pair, solution)
            bounds.append(solution.bounds)
            if progress is not None:
                progress(len(bounds) / len(images))
        # of E, ν and the other constants, (levels, …, 2), each made to contain those before
        intervals = np.array(
            [[x.young(self.average), x.poisson(self.average), *x.constants()] for x in bounds]
        )
        np.minimum.accumulate(intervals[..., 0], out=intervals[..., 0])
        np.maximum.accumulate(intervals[..., 1], out=intervals[..., 1])
        return [
            ImageCut(level, (x[0, 0], x[0, 1]), (x[1, 0], x[1, 1]), x[2:])
            for level, x in zip(bounds[::-1], intervals[::-1], strict=True)
        ]

    def require_consistent(self, images: Sequence[ModuliImages], cuts: Sequence[ImageCut]) -> None:
        """Refuse cuts, one a level of `images`, that contradict bounds of an image inside them.

        Two images with moduli in the middle of the narrowest and of the widest cut are solved anew,
        with `COARSER` times the energy error and without a first guess.
        """
        solver = replace(self.solver, accuracy=min(COARSER * self.solver.accuracy, 0.1))
        coarse_model = replace(self, solver=solver)
        narrowest, widest = images[-1].geometric_mean, images[0].geometric_mean
        tests = [(narrowest, cuts)]  # it lies in every cut
        if not narrowest.equals(widest):
            tests.append((widest, cuts[:1]))
        for image, containing_cuts in tests:
            bounds = coarse_model.solve(image).bounds
            young, poisson = bounds.young(self.average), bounds.poisson(self.average)
            for cut in containing_cuts:
                for name, inside, end in (("E", young, cut.modulus), ("ν", poisson, cut.poisson)):
                    if inside[0] <= end[1] and end[0] <= inside[1]:
                        continue
                    what = f"{name} of an image inside a cut is {inside[0]:.9g} … {inside[1]:.9g}"
                    what += f", the cut {end[0]:.9g} … {end[1]:.9g}"
                    raise FailedError(f"the proof is wrong: {what}", "keep the case and report it")


def usual_division(images: ModuliImages) -> int:
    """Elements along each side of a pixel: 2 up to `MILD` contrast and `LARGE` pixels, else 1.

    One of a voxel, since two take eight times as long and narrow the bounds by half.
    """
    pairs = images.bulk, images.shear
    is_mild = all(upper.max() <= MILD * lower.min() for lower, upper in pairs)
    is_small = images.bulk[0].ndim == 2 and images.bulk[0].size <= LARGE
    return 2 if is_mild and is_small else 1


@dataclass(frozen=True, eq=False)
class ImageSolution:
    """Bounds of the stiffness, and displacements (upper) and stresses (lower) that prove them.

    None for displacements where a phase is rigid, for stresses where pores percolate.
    """

    bounds: StiffnessBounds
    upper: SideSolution | None
    lower: SideSolution | None


def solve_image(bulk: Array, shear: Array, **settings: Any) -> ImageSolution:
    """Proved bounds of a periodic image of pixels or voxels.

    Args:
        bulk: Bulk modulus in Pa, 0 in pores, infinite where rigid, shape (y, x) with that of plane
            strain, K + G/3, or (z, y, x).
        shear: Shear modulus in Pa, same shape.
        settings: Those of `ImageModel`.

    Returns:
        Its `bounds` have the methods `young`, `poisson`, `shear` and `constants`.

    Raises:
        RefusedError: The arrays are not alike, or hold negative numbers or none but 0 and infinity.
    """
    bulk, shear = (np.asarray(x, float) for x in (bulk, shear))  # the proof is of doubles
    allowed = "two arrays of one shape (y, x) or (z, y, x)"
    require(bulk.shape == shear.shape, "moduli", f"of shapes {bulk.shape}, {shear.shape}", allowed)
    require(bulk.ndim in (2, 3), "moduli", f"of shape {bulk.shape}", allowed)
    for values in (bulk, shear):
        require(bool((values >= 0).all()), "moduli", "negative or nan", "numbers from 0")
        is_solid = bool(((values > 0) & np.isfinite(values)).any())
        require(is_solid, "moduli", "0 or infinite throughout", "a material with both bounds")
    settings = {"sides": (1.0,) * bulk.ndim, **settings}
    return ImageModel(**settings).solve(ModuliImages((bulk, bulk), (shear, shear)))


def phase_energies(
    model: ImageModel, solution: ImageSolution, images: ModuliImages, phase: Ints, count: int
) -> PhaseEnergies:
    """Estimated parts of K and G of each phase in C11 + C12, C11 − C12 and C33 of the plane.

    The mean of the values by displacements and by stresses, whose distance is the declared error;
    nothing is proved.

    Args:
        model: The model of the solution.
        solution: Fields of one image.
        images: Its moduli, the least equal to the greatest.
        phase: Number of the phase of each pixel, shape (y, x).
        count: Number of phases.
    """
    assert solution.lower is not None
    assert solution.upper is not None
    stress_energies, strain_energies = (
        energy_parts(element, side, images, phase, count)
        for element, side in zip(model.elements, (solution.lower, solution.upper), strict=True)
    )
    # parts of the compliance S = C⁻¹ become parts of C by ∂S = −S ∂C S
    stiffness = np.linalg.inv(stress_energies.sum(axis=(0, 1)))
    by_strain = square_moduli(strain_energies)
    by_stress = square_moduli(stiffness @ stress_energies @ stiffness)
    return PhaseEnergies((by_strain + by_stress) / 2, abs(by_strain - by_stress))


def energy_parts(
    element: Element, side: SideSolution, images: ModuliImages, phase: Ints, count: int
) -> Array:
    """Energies of unit strains or stresses in K and in G of each phase, shape (count, 2, 3, 3)."""
    bulk, shear = images.bulk[0], images.shear[0]  # bulk is K + G/3, the modulus of the trace
    division = np.ones((side.fields.shape[-2] // len(phase),) * 2)
    trace, deviator = coefficients(element, bulk, shear)
    by_shear = trace * shear / (3 * bulk)  # G/3 over K + G/3
    of_trace, of_deviator = element.parts
    rows = of_trace, of_trace, of_deviator
    weights = [
        (modes, np.kron(weight * (phase == k), division))
        for k in range(count)
        for modes, weight in zip(rows, (trace - by_shear, by_shear, deviator), strict=True)
    ]
    values = energies(element, on_host(side.fields), element.mean_modes(np.eye(3)), weights).value
    by_part = values.reshape(count, 3, 3, 3)
    return np.stack([by_part[:, 0], by_part[:, 1] + by_part[:, 2]], axis=1)
