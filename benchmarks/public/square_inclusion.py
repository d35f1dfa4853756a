"""Shear modulus of a square array of stiff squares.

In plane strain, a square of side 1/2 stands in a periodic square cell of side 1. Shear modulus G
and Poisson's ratio ν are 100 and .2 in the square, 1 and .3 around it. Sought is C1212 of the cell
along its axes.

The source solves it on a grid of 256² points by 400 steps of the fixed-point scheme of Moulinec and
Suquet (1998), with the reference medium G = 50, ν = .3. The second row is that scheme, written
anew.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alphacut.rve import solve_image
from benchmarks.public.row import Row

NAME = "Square inclusion (Janus)"
SOURCE = (
    "S. Brisard, Janus, `sphinx/tutorials/square_basic/square_basic.rst` in sbrisard/janus at"
    " a6196a0, section “The main block of the script”, and `square_basic.py` beside it"
)
PUBLISHED = "1.41903971282"
SQUARE = 100.0, 0.2
MATRIX = 1.0, 0.3
REFERENCE = 50.0, 0.3


def rows() -> Iterator[Row]:
    """Bounds of the exact value, and the source's scheme."""
    is_square = np.array([[True, False], [False, False]])
    bulk = np.where(is_square, _lame(*SQUARE) + SQUARE[0], _lame(*MATRIX) + MATRIX[0])
    shear = np.where(is_square, SQUARE[0], MATRIX[0])
    exact = solve_image(bulk, shear, division=64).bounds.shear("axes")
    remark = "theirs has the error of its grid; see the next row"
    yield Row("C1212", PUBLISHED, tuple(exact), digits=7, tolerance=5e-5, remark=remark)
    yield Row("C1212 by their scheme", PUBLISHED, fixed_point(256, steps=400), digits=12)


def fixed_point(points: int, *, steps: int) -> float:
    """C1212 by the fixed-point scheme on a grid.

    Args:
        points: Points along each side, an even number.
        steps: Number of iterations.
    """
    half = points // 2
    is_square = np.zeros((points, points), bool)
    is_square[:half, :half] = True
    shear, poisson = REFERENCE
    shear_contrast = np.where(is_square, SQUARE[0], MATRIX[0]) - shear
    lame_contrast = np.where(is_square, _lame(*SQUARE), _lame(*MATRIX)) - _lame(*REFERENCE)
    # The frequency at half the number of points counts as positive, as in the source.
    along_x = np.fft.fftfreq(points, 1 / points)
    along_x[half] = half
    x, y = np.meshgrid(along_x, np.fft.rfftfreq(points, 1 / points), indexing="ij")
    norm = np.hypot(x, y)
    norm[0, 0] = 1.0
    x /= norm
    y /= norm
    mean = np.array([0.0, 0.0, 1.0]).reshape(3, 1, 1)  # strains 11, 22, 12
    strain = np.broadcast_to(mean, (3, points, points))
    for _ in range(steps):
        stress = 2 * shear_contrast * strain
        stress[:2] += lame_contrast * (strain[0] + strain[1])
        s11, s22, s12 = np.fft.rfft2(stress)
        # Green's operator of an isotropic medium for the strain of a polarisation
        force_x = s11 * x + s12 * y
        force_y = s12 * x + s22 * y
        along = (force_x * x + force_y * y) / (2 * shear * (1 - poisson))
        response = np.array(
            [
                force_x * x / shear - along * x * x,
                force_y * y / shear - along * y * y,
                (force_x * y + force_y * x) / (2 * shear) - along * x * y,
            ]
        )
        response[:, 0, 0] = 0.0
        strain = mean - np.fft.irfft2(response, s=(points, points))
    return shear + float((shear_contrast * strain[2]).mean())


def _lame(shear: float, poisson: float) -> float:
    """Lamé's first constant."""
    return 2 * shear * poisson / (1 - 2 * poisson)
