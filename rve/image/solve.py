"""Both bounds of an image, or of all images between two."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from threading import Event

from alphacut.fuzzy.arrays import Array
from alphacut.rve.image.bounds import StiffnessBounds, inverse_below
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.fields.element import airy_element, displacement_element
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
    """Proved bounds of the effective stiffness of the periodic image, as by `solve_between`.

    The plane-strain bulk modulus K + G/3 and the shear modulus of each pixel have the shape (rows,
    columns) and are in Pa; row 0 is at the bottom, y rises with rows.
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
    """Proved bounds of the stiffness of every image between two, one side on a thread each.

    The aspect is the height of a pixel over its width, the division the number of parts along each
    side of a pixel. `start` is a result of as many parts, whose fields are the first guess.
    """
    rule, stopped = solver or ConjugateGradient(), Event()

    def watch() -> None:
        if stopped.is_set():
            raise InterruptedError("the other side's solution was stopped")
        try:
            rule.watch()
        except BaseException:
            stopped.set()
            raise

    def solved(end: int) -> SideSolution:
        guess = None if start is None else (start.lower, start.upper)[end].fields
        return solve_side(
            (airy_element, displacement_element)[end](aspect),
            images.bulk[end],
            images.shear[end],
            solver=replace(rule, watch=watch),
            division=division,
            start=guess,
        )

    with ThreadPoolExecutor(2) as pool:
        try:
            lower, upper = pool.map(solved, (0, 1))
        finally:  # Ctrl-C and errors are not to wait for the other side
            stopped.set()
    bounds = StiffnessBounds(inverse_below(lower.energy.upper), upper.energy.upper)
    return ImageSolution(bounds, upper, lower)
