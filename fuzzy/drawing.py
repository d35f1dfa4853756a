"""Drawings of α-cuts: a membership function, and bands that narrow with the level."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.fuzzy.arrays import Array
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


def draw_membership(axes: Axes, alpha: Array, lower: Array, upper: Array, error: Array) -> None:
    """Draw a membership function in steps: each cut holds up to the next level.

    Args:
        axes: Where to draw.
        alpha: Levels, rising, shape (A,).
        lower: Lower ends of the cuts, shape (A,).
        upper: Upper ends of the cuts, shape (A,).
        error: Of both ends, drawn dotted, shape (A,).
    """
    grade, low, high = np.repeat(alpha, 2)[1:], np.repeat(lower, 2)[:-1], np.repeat(upper, 2)[:-1]
    x, y = np.concatenate([low, high[::-1]]), np.concatenate([grade, grade[::-1]])
    axes.plot(x, y, color=_BLUE, linewidth=1.8)
    axes.fill(x, y, color=_BLUE, alpha=0.12, linewidth=0)
    for end in (lower - error, upper + error):
        axes.plot(end, alpha, color="black", linestyle=":", linewidth=0.8)
    axes.set(ylabel="membership μ", ylim=(0, 1.08))


def draw_bands(
    axes: Axes, time: Array, alpha: Array, lower: Array, upper: Array, error: Array
) -> None:
    """Draw a band over time for each level, darker for a higher one.

    Args:
        axes: Where to draw.
        time: Nodes, shape (T,), in s.
        alpha: Levels, rising, shape (A,).
        lower: Lower ends, shape (A, T).
        upper: Upper ends, shape (A, T).
        error: Of the widest band, drawn dotted, shape (A, T).
    """
    for grade, low, high in zip(alpha, lower, upper, strict=True):
        shade, name = 0.15 + 0.45 * float(grade), f"α = {grade:g}"
        axes.fill_between(time, low, high, color=_BLUE, alpha=shade, linewidth=0.4, label=name)
    for end in (lower[0] - error[0], upper[0] + error[0]):
        axes.plot(time, end, color="black", linestyle=":", linewidth=0.8)
    axes.set(xlabel="time [s]")
    axes.legend(fontsize="small", frameon=False, loc="upper left", bbox_to_anchor=(1, 1))
