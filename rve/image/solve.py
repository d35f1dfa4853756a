"""Both bounds of a crisp image."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from threading import Event

from alphacut.rve.image.bounds import StiffnessBounds, inverse_below
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.fields.side import DISPLACEMENT, STRESS, SideSolution, solve_side
from alphacut.rve.image.fields.solver import Solver
from alphacut.rve.image.phase_images import ModuliImages
from alphacut.stochastic.theta.truncated_normal import Array


@dataclass(frozen=True)
class CrispBounds:
    """Bounds of one image with the fields that prove them.

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
    solver: Solver | None = None,
    division: int = 1,
    pixels: bool = False,
) -> CrispBounds:
    """Proved bounds of the effective stiffness of the periodic image, as by `solve_between`.

    The plane-strain bulk modulus K + G/3 and the shear modulus of each pixel have the shape (rows,
    columns) and are in Pa; row 0 is at the bottom, y rises with rows.
    """
    images = ModuliImages((bulk, bulk), (shear, shear), attained=True)
    return solve_between(images, aspect=aspect, solver=solver, division=division, pixels=pixels)


def solve_between(
    images: ModuliImages,
    *,
    aspect: float = 1.0,
    solver: Solver | None = None,
    division: int = 1,
    start: CrispBounds | None = None,
    pixels: bool = False,
) -> CrispBounds:
    """Proved bounds of the stiffness of every image between two.

    The aspect is the height of a pixel over its width, the division the number of parts along each
    side of a pixel. `start` is a result of as many parts, whose fields are the first guess.
    """
    fields = None if start is None else (start.upper.fields, start.lower.fields)
    upper, lower = both_sides(
        tuple((images.bulk[end][None], images.shear[end][None]) for end in (1, 0)),
        solver=solver or ConjugateGradient(),
        aspect=aspect,
        division=division,
        start=fields,
        pixels=pixels,
    )
    bounds = StiffnessBounds(inverse_below(lower.energy.upper[0]), upper.energy.upper[0])
    return CrispBounds(bounds, upper, lower)


def both_sides(
    moduli: Sequence[tuple[Array, Array]],
    *,
    solver: Solver,
    aspect: float,
    division: int,
    start: tuple[Array, Array] | None = None,
    clamped: bool = False,
    pixels: bool = False,
) -> tuple[SideSolution, SideSolution]:
    """Displacements, then stresses, by `solve_side` on as many threads as the solver allows."""
    stopped = Event()

    def watch() -> None:
        if stopped.is_set():
            raise InterruptedError("the other side's solution was stopped")
        try:
            solver.watch()
        except BaseException:
            stopped.set()
            raise

    with ThreadPoolExecutor(solver.threads) as pool:
        upper, lower = (
            pool.submit(
                solve_side,
                side,
                *moduli[k],
                solver=replace(solver, watch=watch),
                aspect=aspect,
                division=division,
                start=None if start is None else start[k],
                clamped=clamped,
                pixels=pixels,
            )
            for k, side in enumerate((DISPLACEMENT, STRESS))
        )
        try:
            return upper.result(), lower.result()
        except BaseException:  # Ctrl-C among them, which is not to wait for the solution
            stopped.set()
            raise
