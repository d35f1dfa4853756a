"""Both bounds of an image, or of all images between two."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from threading import Event

from alphacut.fuzzy.arrays import Array
from alphacut.rve.image.bounds import StiffnessBounds, inverse_below
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.fields.element import Element, airy_element, displacement_element
from alphacut.rve.image.fields.side import SideSolution, solve_side
from alphacut.rve.image.phase_images import ModuliImages


@dataclass(frozen=True, eq=False)
class ImageSolution:
    """Bounds of the stiffness with the fields that prove them.

    Args:
        bounds: Of the stiffness.
        upper: Displacement side.
        lower: Stress side.
    """

    bounds: StiffnessBounds
    upper: SideSolution
    lower: SideSolution


def solve_image(
    bulk: Array,
    shear: Array,
    *,
    aspect: float = 1.0,
    solver: ConjugateGradient | None = None,
    division: int = 1,
) -> ImageSolution:
    """Proved bounds of the effective stiffness of a periodic image; see `solve_between`.

    `bulk` and `shear` are the plane-strain bulk modulus K + G/3 and the shear modulus of each
    pixel, shape (rows, columns), in Pa, row 0 at the bottom.
    """
    images = ModuliImages((bulk, bulk), (shear, shear))
    return solve_between(images, aspect=aspect, solver=solver, division=division)


def solve_between(
    images: ModuliImages,
    *,
    aspect: float = 1.0,
    solver: ConjugateGradient | None = None,
    division: int = 1,
    start: ImageSolution | None = None,
) -> ImageSolution:
    """Proved bounds of the stiffness of all images with moduli between the least and greatest.

    The lower bound is that of stresses with the least moduli, the upper one that of displacements
    with the greatest; each is computed on a thread.

    Args:
        images: Least and greatest moduli of each pixel.
        aspect: Height of a pixel over its width.
        solver: Stopping rule.
        division: Elements along each side of a pixel.
        start: Solution of the same division, whose fields are the first guess.
    """
    rule, is_stopped = solver or ConjugateGradient(), Event()

    def raise_if_stopped() -> None:
        """Called before each iteration; ends this thread where the other one has ended."""
        if is_stopped.is_set():
            raise InterruptedError("the other side's solution was stopped")
        try:
            rule.watch()
        except BaseException:
            is_stopped.set()
            raise

    def solve(element: Element, end: int, guess: SideSolution | None) -> SideSolution:
        """Fields of least energy with the least (end 0) or greatest (end 1) moduli."""
        return solve_side(
            element,
            images.bulk[end],
            images.shear[end],
            solver=replace(rule, watch=raise_if_stopped),
            division=division,
            start=None if guess is None else guess.fields,
        )

    stresses, displacements = airy_element(aspect), displacement_element(aspect)
    guesses = (None, None) if start is None else (start.lower, start.upper)
    with ThreadPoolExecutor(2) as pool:
        try:
            lower, upper = pool.map(solve, (stresses, displacements), (0, 1), guesses)
        finally:  # Ctrl-C and errors are not to wait for the other side
            is_stopped.set()
    bounds = StiffnessBounds(inverse_below(lower.energy.upper), upper.energy.upper)
    return ImageSolution(bounds, upper, lower)
