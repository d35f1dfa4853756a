"""The image as the cell: both bounds of its stiffness or conductivity, proved at every α-level."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from threading import Event
from typing import Any, ClassVar, Generic, TypedDict, TypeVar, Unpack

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError, require
from alphacut.base.progress_bar import Progress
from alphacut.rve.image.bounds import (
    ConductivityBounds,
    Enclosure,
    LoewnerBounds,
    StiffnessBounds,
    inverse_below,
)
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.fields.element import Element, element_of
from alphacut.rve.image.fields.energy import solve_side
from alphacut.rve.image.fields.equilibrium import solve_stresses
from alphacut.rve.image.fields.fluxes import solve_fluxes
from alphacut.rve.image.fields.grid import device_array
from alphacut.rve.image.fields.kernels import call_kernels
from alphacut.rve.image.fields.split import SideSolution, solve_beside_pores
from alphacut.rve.image.memory import is_large
from alphacut.rve.image.phases import ModuliImages
from alphacut.rve.result.moduli import ISOTROPIC, require_average

Bounds = TypeVar("Bounds", bound=LoewnerBounds)
"""Bounds of a stiffness or of a conductivity."""


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


class GridSettings(TypedDict, total=False):
    """Arguments of a `GridModel` by name."""

    sides: tuple[float, ...]
    division: int
    solver: ConjugateGradient
    device: str


@dataclass(frozen=True)
class GridModel(Generic[Bounds]):
    """Settings of the solution of an image of pixels or voxels that repeats itself.

    Args:
        sides: Sides of a pixel along y and x, or of a voxel along z, y and x, over that along x.
        division: Number of elements along each side of a pixel or voxel; see `usual_division`.
        solver: Solver of the fields with its stopping rule.
        device: Where the fields are solved for: "cpu", or "cuda" by CuPy.

    Raises:
        RefusedError: A setting is not allowed.
    """

    conduction: ClassVar[bool]
    """Whether the fields are gradients and fluxes; else strains and stresses."""
    bounds_type: ClassVar[type]
    """Class of the bounds, whose arguments are the lower and the upper bound."""
    sides: tuple[float, ...] = (1.0, 1.0)
    division: int = 1
    solver: ConjugateGradient = field(default_factory=ConjugateGradient)
    device: str = "cpu"

    def __post_init__(self) -> None:
        """Check the settings; RefusedError for one that is not allowed.

        Sides are two of a pixel or three of a voxel, each between .001 and 1000 times that along x,
        and the division is a whole number from 1.
        """
        allowed = "two of a pixel or three of a voxel"
        require(len(self.sides) in (2, 3), "sides", self.sides, allowed)
        is_whole = isinstance(self.division, int) and self.division >= 1
        require(is_whole, "division", self.division, "a whole number from 1")
        # Beyond this ratio rounding spoils the fields, and the bounds become wide.
        max_ratio = 1e3
        for side in self.sides:
            require(
                1 / max_ratio <= side <= max_ratio,
                "side of a pixel or voxel over that along x",
                value=f"{side:.3g}",
                allowed=f"{1 / max_ratio:g} to {max_ratio:g}",
            )

    def _element(self, *, dual: bool) -> Element:
        """Return the element of stresses or fluxes (dual), or of displacements or temperatures."""
        return element_of(self.sides, dual=dual, conduction=self.conduction)

    def solve(
        self, images: ModuliImages, start: ImageSolution[Bounds] | None = None
    ) -> ImageSolution[Bounds]:
        """Return proved bounds of the stiffness of all images with moduli in given intervals.

        The stiffness C of a cell is the least energy of displacements, and C⁻¹ that of stresses in
        equilibrium, as quadratic forms of the mean strain and of the mean stress. So any
        displacements bound C from above, and any such stresses bound it from below. Stiffer
        materials make a stiffer cell: displacements are computed with the upper moduli, stresses
        with the lower ones, each on a thread. The same holds for the conductivity, of temperatures
        under a mean gradient, and of fluxes without sources.

        Args:
            images: Lower and upper moduli of each pixel or voxel.
            start: A solution of the same division, whose fields are the first guess.

        Raises:
            RefusedError: The images have another dimension than the model, or the device is
                missing.
            FailedError: The solver does not converge.
        """
        dimension = len(images.shape)
        what = f"{len(self.sides)} for a grid of shape {images.shape}"
        require(dimension == len(self.sides), "sides", what, "one for each axis")
        is_stopped = Event()

        def raise_if_stopped() -> None:
            """Stop this solution where the other one has ended; called before each iteration.

            Two threads run, one for each side of the bounds, and share the event `is_stopped`. What
            `self.solver.watch` raises, such as Ctrl-C, sets the event and is raised again; so the
            other thread ends at its next iteration, by an InterruptedError.
            """
            if is_stopped.is_set():
                raise InterruptedError("the other side's solution was stopped")
            try:
                self.solver.watch()
            except BaseException:
                is_stopped.set()
                raise

        def solve(dual: bool, guess: SideSolution | None) -> SideSolution | None:
            """Return dual fields for the lower moduli, or primal ones for the upper ones."""
            moduli = images.moduli_of_fields(dual=dual)
            if moduli is None:
                return None
            return self.solve_side(moduli, dual=dual, start=guess, watch=raise_if_stopped)

        guesses = (None, None) if start is None else (start.lower, start.upper)
        elements = [self._element(dual=dual) for dual in (True, False)]
        components = elements[0].part_matrix.shape
        # The sides share nothing but the images: two threads take half the time of one, as NumPy,
        # SciPy and the kernels release the interpreter. A device works on one side at a time, and
        # so does a grid whose finished fields leave the memory.
        workers = 2
        if self.device != "cpu" or is_large(images.shape, self.division):
            workers = 1
        if dimension == 2 or self.device != "cpu":
            elements = []  # without kernels
        call_kernels(elements)
        with ThreadPoolExecutor(workers) as pool:
            try:
                lower, upper = pool.map(solve, (True, False), guesses)
            finally:  # Ctrl-C and errors are not to wait for the other side
                is_stopped.set()
        lower_bound: Array = np.zeros(components)
        if lower is not None:
            lower_bound = lower.bound
        upper_bound = np.diag(np.full(len(lower_bound), np.inf))
        if upper is not None:
            upper_bound = upper.bound
        bounds: Bounds = self.bounds_type(lower_bound, upper_bound)
        return ImageSolution(bounds, upper, lower)

    def solve_side(
        self,
        moduli: Array,
        *,
        dual: bool,
        start: SideSolution | None,
        watch: Callable[[], None] | None = None,
    ) -> SideSolution:
        """Return fields of nearly least energy under unit loads.

        Args:
            moduli: Bulk modulus (of the plane K + G/3) and shear modulus of each pixel or voxel in
                Pa, shape (2, y, x) or (2, z, y, x); or its conductivity, shape (1, …). They are
                finite. A pore has a modulus of 0, or both for displacements.
            dual: Whether to solve for stresses or fluxes, whose energy bounds the inverse of the
                stiffness or conductivity from above; else for displacements or temperatures, whose
                energy bounds it from above.
            start: Solution of the same kind, whose fields are the first guess; None for zero.
            watch: Function called before each iteration in place of `self.solver.watch`; None for
                this one.

        Returns:
            `fields`, of strains and stresses under unit mean fields in Voigt's order, and `bound`.

        Raises:
            FailedError: The solver does not converge.
            RefusedError: The device "cuda" is missing.
        """
        to_device = device_array(self.device)
        solver = replace(self.solver, watch=watch or self.solver.watch)
        first_guess = None
        # Fields beside pores are of another kind than those without.
        beside_pores = not moduli.all()
        if start is not None and start.beside_pores == beside_pores:
            first_guess = start.fields
        if beside_pores:
            fine = self._divided(moduli)
            if not dual:
                element = self._element(dual=False)
                return solve_beside_pores(element, list(fine), solver=solver, start=first_guess)
            if self.conduction:
                return solve_fluxes(fine[0], self.sides, solver=solver, start=first_guess)
            return solve_stresses(fine, self.sides, solver=solver)
        solution = solve_side(
            self._element(dual=dual),
            [to_device(modulus) for modulus in self._divided(moduli)],
            solver=solver,
            start=first_guess,
        )
        bound = solution.energy.upper
        if dual:
            bound = inverse_below(bound)
        return SideSolution(solution.fields, bound)

    def _divided(self, moduli: Array) -> Array:
        """Return moduli of pixels on the grid of their elements, both of shape (moduli, *grid)."""
        for axis in range(1, moduli.ndim):
            moduli = np.repeat(moduli, self.division, axis=axis)
        return moduli

    def bounds_at_levels(
        self,
        images: Sequence[ModuliImages],
        crisp: tuple[ModuliImages, ImageSolution[Bounds]],
        progress: Progress | None = None,
    ) -> list[Bounds]:
        """Return proved bounds at each α-level.

        Args:
            images: Lower and upper moduli of each pixel or voxel at each level, for rising α, one
                at least. The intervals of a level contain the intervals of higher levels.
            crisp: Lower and upper moduli of one more image, such as the nominal one, and their
                solution by a model of the same division. Its fields are the first guess, and it is
                the solution of levels with the same moduli.
            progress: Function that is called with the fraction of the levels that is done, after
                each.

        Returns:
            One object a level, in the order of `images`.

        Raises:
            FailedError: A solution does not converge.
            RefusedError: The images have another dimension than the model, or the device is
                missing.
        """
        # Cuts are solved from the narrowest to the widest: the fields of each are so near to those
        # of the next that one iteration may do (one or two in place of fifteen at a step of 5 % in
        # the moduli), and equal images are not solved again.
        last_images, solution = crisp
        bounds = []  # for falling α, from the narrowest cut to the widest
        for level_images in reversed(images):
            if not level_images.equals(last_images):
                last_images = level_images
                solution = self.solve(level_images, solution)
            bounds.append(solution.bounds)
            if progress is not None:
                progress(len(bounds) / len(images))
        return bounds[::-1]

    def require_consistent(
        self, images: Sequence[ModuliImages], bounds: Sequence[LoewnerBounds]
    ) -> None:
        """Refuse bounds of cuts that contradict those of an image inside them.

        This tests the proof itself. Two images with the geometric means of the lower and upper
        moduli of the narrowest and of the widest cut are solved anew, without a first guess and
        with ten times the energy error: this is cheaper, but detects less.

        Args:
            images: Lower and upper moduli at each level, for rising α.
            bounds: Bounds at these levels, in the same order.

        Raises:
            FailedError: No stiffness or conductivity is inside the bounds of such an image and
                inside those of a cut that contains it; or the solver does not converge.
        """
        solver = replace(self.solver, accuracy=min(10 * self.solver.accuracy, 0.1))
        coarse_model = replace(self, solver=solver)
        narrowest = images[-1].geometric_mean
        widest = images[0].geometric_mean
        # The middle of the widest cut lies in no other cut for sure, so that it tests that one
        # alone.
        tests = [(narrowest, bounds)]  # it lies in every cut
        if not narrowest.equals(widest):
            tests.append((widest, bounds[:1]))
        for image, of_containing_cuts in tests:
            inside = coarse_model.solve(image).bounds
            for of_cut in of_containing_cuts:
                if not inside.overlaps(of_cut):
                    what = "bounds of an image inside a cut contradict those of the cut"
                    raise FailedError(f"the proof is wrong: {what}", "keep the case and report it")


@dataclass(frozen=True)
class ConductionModel(GridModel[ConductivityBounds]):
    """Settings of the solution of conduction in an image of pixels or voxels that repeats itself.

    Its `solve` takes images of one modulus, the conductivity.
    """

    conduction = True
    bounds_type = ConductivityBounds


@dataclass(frozen=True)
class ImageModel(GridModel[StiffnessBounds]):
    """Settings of the solution of the stiffness of an image that repeats itself.

    Args:
        average: Average of the stiffness that E and ν of the plane are of, a name in
            `moduli.AVERAGES`; in space they are of Hill's isotropic average.

    Raises:
        RefusedError: A setting is not allowed.
    """

    conduction = False
    bounds_type = StiffnessBounds
    average: str = ISOTROPIC

    def __post_init__(self) -> None:
        """RefusedError for a setting that is not allowed; the average is "axes" or "isotropic"."""
        super().__post_init__()
        require_average(self.average)

    def cuts(self, bounds: Sequence[StiffnessBounds]) -> list[ImageCut]:
        """Return nested bounds of E, ν and engineering constants at each α-level.

        Args:
            bounds: Bounds of the stiffness at each level, for rising α.

        Returns:
            One ImageCut a level, in the order of `bounds`: `bounds` as given, `modulus` E in Pa and
            `poisson` ν of the average, each with a lower and an upper end, and `constants` along
            the axes, shape (constants, 2). All but `bounds` are widened, if need be, to contain the
            intervals of higher levels.
        """
        young = nested([x.young(self.average) for x in bounds])
        poisson = nested([x.poisson(self.average) for x in bounds])
        constants = nested([x.constants() for x in bounds])
        return [
            ImageCut(x, Enclosure(*young[k]), Enclosure(*poisson[k]), constants[k])
            for k, x in enumerate(bounds)
        ]


def nested(intervals: Sequence[Enclosure] | Sequence[Array]) -> Array:
    """Return intervals at rising α that each contain all that follow, shape (levels, …, 2).

    Every image of a cut is one of the wider cuts too, so that this is what is known.
    """
    lower, upper = np.moveaxis(np.array(intervals)[::-1], -1, 0)
    ends = np.minimum.accumulate(lower), np.maximum.accumulate(upper)
    return np.stack(ends, axis=-1)[::-1]


def usual_division(images: ModuliImages) -> int:
    """Return the number of finite elements along each side of a pixel or voxel, 1 or 2.

    It is 2 for images of up to 2¹⁹ pixels whose largest bulk and shear moduli are each at most 10
    times the smallest, limits that are tuned. Of a voxel it is 1, since two elements take eight
    times as long and narrow the bounds by half.

    Args:
        images: Lower and upper moduli. With pores or rigid phases the contrast is infinite, and the
            division 1.
    """
    pairs = zip(images.lower, images.upper, strict=True)  # of each modulus
    is_mild = all(upper.max() <= 10.0 * lower.min() for lower, upper in pairs)
    is_small = len(images.shape) == 2 and images.lower[0].size <= 1 << 19
    return 2 if is_mild and is_small else 1


@dataclass(frozen=True, eq=False)
class ImageSolution(Generic[Bounds]):
    """Bounds of the stiffness or conductivity with the fields that prove them.

    Args:
        bounds: The bounds.
        upper: Displacements or temperatures, which prove the upper bound; None where a phase is
            rigid or conducts perfectly.
        lower: Stresses or fluxes, which prove the lower bound.
    """

    bounds: Bounds
    upper: SideSolution | None
    lower: SideSolution | None


def solve_conduction(
    conductivity: Array, **settings: Unpack[GridSettings]
) -> ImageSolution[ConductivityBounds]:
    """Return proved bounds of the conductivity of a periodic image of pixels or voxels.

    It is that of heat, of electricity, or of a diffusion.

    Args:
        conductivity: Conductivity of each pixel, shape (y, x), or voxel, shape (z, y, x), in any
            one unit; 0 in insulators, infinite in perfect conductors.
        settings: Arguments of `ConductionModel`: sides (of a pixel or voxel along the axes, over
            that along x; equal ones by default), division (elements along each side, 1 by default),
            solver, and device ("cpu" or "cuda").

    Returns:
        Solution whose `bounds` have the method `components` and the property `mean`, and whose
        `upper` and `lower` hold the temperatures and fluxes that prove them.

    Raises:
        RefusedError: The array has another number of axes, or holds negative numbers or NaN, or
            none but 0 and infinity; or a setting is not allowed.
        FailedError: The solver does not converge.

    Example:
        >>> checkerboard = np.kron([[1.0, 4.0], [4.0, 1.0]], np.ones((4, 4)))  # exactly √(1 · 4)
        >>> [round(end, 2) for end in solve_conduction(checkerboard).bounds.mean]
        [1.98, 2.02]
    """
    shape = np.shape(conductivity)
    is_grid = len(shape) in (2, 3)
    require(is_grid, "conductivity", f"of shape {shape}", "an array (y, x) or (z, y, x)")
    moduli = _checked_moduli("conductivity", [conductivity])
    settings.setdefault("sides", (1.0,) * len(shape))
    return ConductionModel(**settings).solve(ModuliImages(moduli, moduli))


def _checked_moduli(what: str, moduli: Sequence[Array]) -> Array:
    """Return arrays of moduli as one array of doubles; RefusedError for what is no modulus."""
    # Single precision would be a rounding that no bound of errors knows.
    checked = np.array(moduli, float)
    for values in checked:
        require(bool((values >= 0).all()), what, "negative or nan", "numbers from 0")
        is_solid = bool(((values > 0) & np.isfinite(values)).any())
        require(is_solid, what, "0 or infinite throughout", "a material with both bounds")
    return checked


def solve_image(bulk: Array, shear: Array, **settings: Any) -> ImageSolution[StiffnessBounds]:
    """Return proved bounds of the stiffness of a periodic image of pixels or voxels.

    Args:
        bulk: Bulk modulus in Pa, 0 in pores, infinite where rigid, shape (y, x) with that of plane
            strain, K + G/3, or (z, y, x).
        shear: Shear modulus in Pa, of the same shape, 0 and infinite likewise.
        settings: Arguments of `ImageModel`: sides (of a pixel or voxel along the axes, over that
            along x; equal ones by default), division (elements along each side, 1 by default),
            solver, average ("isotropic" or "axes") and device ("cpu" or "cuda").

    Returns:
        Solution whose `bounds` have the methods `young`, `poisson`, `shear` and `constants`, and
        whose `upper` and `lower` hold the displacements and stresses that prove them.

    Raises:
        RefusedError: The arrays are not alike, or hold negative numbers or NaN, or none but 0 and
            infinity; or a setting is not allowed.
        FailedError: The solver does not converge.

    Example:
        >>> stiff = np.array([[40e9, 20e9], [20e9, 20e9]])  # one pixel of four is stiffer
        >>> low, high = solve_image(stiff, stiff / 2).bounds.young()
        >>> [round(float(end) / 1e9, 2) for end in (low, high)]  # GPa
        [28.91, 29.03]
    """
    shape = np.shape(bulk)
    is_grid = shape == np.shape(shear) and len(shape) in (2, 3)
    allowed = "two arrays of one shape (y, x) or (z, y, x)"
    require(is_grid, "moduli", f"of shapes {shape}, {np.shape(shear)}", allowed)
    moduli = _checked_moduli("moduli", [bulk, shear])
    settings = {"sides": (1.0,) * len(shape), **settings}
    return ImageModel(**settings).solve(ModuliImages(moduli, moduli))
