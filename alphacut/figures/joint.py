"""Hull of two values of a motion together, level by level."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from alphacut.figures.style import GREY, INK, alpha_legend, colours, figure
from alphacut.io.units import MINUS, axis_prefix

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


def joint(found: xarray.Dataset) -> Figure:
    """Enclosing polygons shaded, hulls of pairs reached as lines, and the rectangle of ranges."""
    drawn, axes = figure(6.4, 4.4)
    alpha = found["alpha"].values
    for level, shade in enumerate(colours(alpha)):
        axes.fill(*found["outer"].values[level].T, color=shade, lw=0)
        reached = found["inner"].values[level]
        axes.plot(*np.vstack([reached, reached[:1]]).T, color=INK, lw=0.7)
    (left, low), (right, high) = (end(found["outer"].values[0], axis=0) for end in (np.min, np.max))
    axes.plot([left, right, right, left, left], [low, low, high, high, low], color=GREY, ls="--")
    sides = ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim()))
    words = zip(found["value"].values, found["unit"].values, strict=True)
    for (axis, ends), (name, si) in zip(sides, words, strict=True):
        factor, unit = axis_prefix(max(map(abs, ends)), str(si))
        axis.set_label_text(f"{name}, {unit}")
        axis.set_major_formatter(partial(_ticks, factor))
    alpha_legend(axes, alpha, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return drawn


def _ticks(factor: float, value: float, _: int) -> str:
    return f"{value * factor:.10g}".replace("-", MINUS)
