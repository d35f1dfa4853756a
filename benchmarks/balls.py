"""Cells with discs or balls, bounded by images of pixels or voxels.

A pixel that the surface of a ball cuts takes the smaller moduli in one image and the larger ones in
another. As the stiffness rises with the moduli of every point, the lower bound of the first and the
upper bound of the second image enclose that of the balls themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.rve import solve_image
from alphacut.rve.image.bounds import StiffnessBounds

Moduli = tuple[float, float]
"""Bulk and shear modulus; the bulk modulus of a plane is that of plane strain."""


def coverage(
    shape: Sequence[int], lengths: Sequence[float], centres: Array, radius: float
) -> tuple[Mask, Mask]:
    """Find the pixels or voxels that equal balls may touch, and those that lie inside one.

    Args:
        shape: Pixels along each axis of the cell.
        lengths: Length of the cell along each axis; a radius is at most half of each.
        centres: Centres in the cell, shape (balls, axes). The balls repeat with the cell.
        radius: That of all balls.

    Returns:
        Whether each pixel may be touched, and whether it is inside, in the shape of the grid.
    """
    nearest = np.full(shape, np.inf)  # squared distance of the nearest point to a centre
    farthest = np.full(shape, np.inf)  # the same of the farthest point of a pixel
    for centre, image in product(centres, product((-1, 0, 1), repeat=len(shape))):
        near = np.zeros(())
        far = np.zeros(())
        for axis, count in enumerate(shape):
            side = lengths[axis] / count
            start = np.arange(count) * side - (centre[axis] + image[axis] * lengths[axis])
            ends = np.abs([start, start + side])
            is_beside = (start < 0) & (start + side > 0)
            near = np.add.outer(near, np.where(is_beside, 0, ends.min(axis=0)) ** 2)
            far = np.add.outer(far, ends.max(axis=0) ** 2)
        nearest = np.minimum(nearest, near)
        farthest = np.minimum(farthest, far)
    rounding = 1e-12  # far above that of the squared distances
    return nearest < radius**2 * (1 + rounding), farthest < radius**2 * (1 - rounding)


def moduli_between(
    shape: Sequence[int],
    lengths: Sequence[float],
    centres: Array,
    *,
    matrix: Moduli,
    balls: Sequence[tuple[float, Moduli]],
) -> tuple[Array, Array]:
    """Lower and upper moduli of each pixel or voxel, shape (2, *shape).

    Args:
        shape: As for `coverage`, like `lengths` and `centres`.
        lengths: Of the cell.
        centres: Of the balls.
        matrix: Moduli outside all balls.
        balls: Radius and moduli of each ball about every centre, the largest first.
    """
    column = (2, *[1] * len(shape))
    lower = upper = np.broadcast_to(np.reshape(matrix, column), (2, *shape))
    for radius, moduli in balls:
        is_touched, is_inside = coverage(shape, lengths, centres, radius)
        of_ball = np.reshape(moduli, column)
        lower = np.where(is_touched, np.minimum(lower, of_ball), lower)
        upper = np.where(is_touched, np.maximum(upper, of_ball), upper)
        lower = np.where(is_inside, of_ball, lower)
        upper = np.where(is_inside, of_ball, upper)
    return lower, upper


def stiffness_between(lower: Array, upper: Array, **settings: Any) -> StiffnessBounds:
    """Bounds of the stiffness of every cell with moduli between those of two images.

    Args:
        lower: Lower moduli, as of `moduli_between`.
        upper: Upper moduli.
        settings: As for `solve_image`.
    """
    softest = solve_image(*lower, **settings).bounds
    return replace(softest, upper=solve_image(*upper, **settings).bounds.upper)
