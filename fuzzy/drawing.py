"""Drawings of α-cuts: a membership function, and bands that narrow with the level."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from alphacut.fuzzy.refused import require

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BLUE = "#0072B2"


def new_axes(axes: Axes | None) -> Axes:
    """The axes, or those of a new figure that a notebook shows."""
    if axes is not None:
        plain = hasattr(axes, "fill_between")
        require(plain, "axes", axes, "Matplotlib's, or none for a new figure")
        return axes
    from matplotlib import pyplot

    return pyplot.subplots(figsize=(5.0, 3.0), layout="constrained")[1]


def draw_membership(
    axes: Axes,
    alpha: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    *,
    name: str = "",
    steps: bool = False,
) -> None:
    """Draw the membership function through α-cuts, from the lowest one up.

    Args:
        axes: Where to draw.
        alpha: Levels, rising, shape (n,).
        lower: Lower ends of the cuts, shape (n,).
        upper: Upper ends of the cuts, shape (n,).
        name: Name in the legend; none if empty.
        steps: Whether each cut is drawn up to the next level; else ends go straight between them.
    """
    grade, low, high = (np.asarray(ends, float) for ends in (alpha, lower, upper))
    if steps:
        grade, low, high = (np.repeat(grade, 2)[1:], *(np.repeat(x, 2)[:-1] for x in (low, high)))
    x, y = np.concatenate([low, high[::-1]]), np.concatenate([grade, grade[::-1]])
    (line,) = axes.plot(x, y, linewidth=1.8, label=name or None)
    axes.fill(x, y, color=line.get_color(), alpha=0.12, linewidth=0)
    axes.set(ylabel="membership μ", ylim=(0, 1.08))


def draw_bands(
    axes: Axes, x: ArrayLike, alpha: ArrayLike, lower: ArrayLike, upper: ArrayLike
) -> None:
    """Draw a band for each level, darker for a higher one.

    Args:
        axes: Where to draw.
        x: Abscissas, shape (n,).
        alpha: Levels, rising, shape (levels,).
        lower: Lower ends, shape (levels, n).
        upper: Upper ends, shape (levels, n).
    """
    grades = np.asarray(alpha, float)
    bands = zip(grades, np.asarray(lower), np.asarray(upper), strict=True)
    for grade, low, high in bands:
        shade = 0.15 + 0.45 * float(grade)
        axes.fill_between(
            x, low, high, color=_BLUE, alpha=shade, linewidth=0.4, label=f"α = {grade:g}"
        )
    axes.legend(fontsize="small", frameon=False, loc="upper left", bbox_to_anchor=(1, 1))
