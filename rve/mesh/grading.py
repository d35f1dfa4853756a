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
    """Function of (x1, x2): edge length near a particle and in gaps, over the nominal one.

    Args:
        outline: Of the particle.
        radius: Its radius.
        thickness: Of a ring around it.
    """
    half_width, half_height, least = (radius * extent for extent in extents(outline))
    outer = half_width + thickness, half_height + thickness
    return lambda x, y: _size_near_particle(x, y, *outer, least)


def bend_grading(outline: Outline, radius: float, refinement: float) -> Sizes:
    """Function of (x1, x2): edge length by the bends of an outline, over the nominal one.

    It is proportional to the least sum of bend radius and distance over the outline's points, so
    that on a circle it is the same at all of them and grows with the distance.

    Args:
        outline: Of the particle.
        radius: Its radius.
        refinement: Divides the edge length.
    """
    points, unit_bend_radii = bend_radii(outline)
    px, py = radius * points.T
    radii = radius * unit_bend_radii
    factor = _PER_RADIUS / refinement
    return lambda x, y: factor * float((radii + np.hypot(px - x, py - y)).min())


def _size_near_particle(
    x: float, y: float, half_width: float, half_height: float, least: float
) -> float:
    """Edge length at (x, y), over the nominal one, near a particle and between it and its images.

    Gmsh calls this for each point, hence no NumPy. `least` is that of the outline's distances from
    the centre.
    """
    x, y = abs(x), abs(y)
    by_distance = _PER_RADIUS * max(hypot(x, y), least)
    # width of the gap to the cell's side, which grows along it as beside a circle
    gap_beside = 1 - half_width + y * y / (2 * half_width) + max(0.0, half_width - x)
    gap_above = 1 - half_height + x * x / (2 * half_height) + max(0.0, half_height - y)
    return min(1.0, by_distance, 4 * gap_beside, 4 * gap_above)
