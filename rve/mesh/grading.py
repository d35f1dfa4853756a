"""Edge lengths of the planar cell: short near small particles, in gaps, and where outlines bend."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot

import numpy as np

from alphacut.rve.outline import Outline, bend_radii, extents

Sizes = Callable[[float, float], float]
_PER_RADIUS = 1.4
"""Edge length on a circle over its radius, for a mesh size of 1: spreads the error evenly over
radii from 0.1 to 0.98."""


REFINEMENTS = (0.5, 0.75, 1.1, 1.7, 2.5, 4.0)
"""Factors of `bend_grading` that are tried one after the other until all elements are valid."""


def particle_grading(outline: Outline, radius: float, thickness: float = 0.0) -> Sizes:
    """Edge length near a small particle and in gaps over the nominal one, at (x1, x2).

    Args:
        outline: Of the particle.
        radius: Its radius.
        thickness: Of a ring around it.
    """
    wide, high, least = (radius * extent for extent in extents(outline))
    return lambda x, y: _around(x, y, wide + thickness, high + thickness, least)


def bend_grading(outline: Outline, radius: float, refinement: float) -> Sizes:
    """Edge length that follows the bends of an outline over the nominal one, at (x1, x2).

    On the outline its ratio to the bend radius is that of edge and radius on a circle, divided by
    `refinement`; off the outline it grows as around a circle.

    Args:
        outline: Of the particle.
        radius: Its radius.
        refinement: Above 1 edges are shorter.
    """
    points, radii = bend_radii(outline)
    px, py = radius * points.T
    radii = radius * radii
    factor = _PER_RADIUS / refinement
    return lambda x, y: factor * float((radii + np.hypot(px - x, py - y)).min())


def _around(x: float, y: float, wide: float, high: float, least: float) -> float:
    """Edge length near the particle and in the gaps between it and its images.

    Gmsh calls this for each point, hence no NumPy.

    Args:
        x: First coordinate.
        y: Second coordinate.
        wide: Greatest |x1| of the particle.
        high: Greatest |x2|.
        least: Least distance of its outline from the centre.
    """
    x, y = abs(x), abs(y)
    near = _PER_RADIUS * max(hypot(x, y), least)
    beside = 1 - wide + y * y / (2 * wide) + max(0.0, wide - x)
    above = 1 - high + x * x / (2 * high) + max(0.0, high - y)
    return min(1.0, near, 4 * beside, 4 * above)
