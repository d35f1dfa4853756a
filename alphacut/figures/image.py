"""An image and the proved bounds of its E."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.figures.style import BLUE, INK, figure
from alphacut.stages.cell import GPA

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def image(found: xarray.Dataset) -> Figure:
    """Phases and α-cuts of E."""
    drawn, first = figure(height=3.0)
    first.remove()
    grid = drawn.add_gridspec(1, 2)
    phases(drawn.add_subplot(grid[0]), found)
    cuts(drawn.add_subplot(grid[1]), found)
    return drawn


def phases(axes: Axes, found: xarray.Dataset) -> None:
    """The number of each pixel's phase as grey."""
    plane(axes, "phases").imshow(found["phase"].values, origin="lower", cmap="Greys_r")


def plane(axes: Axes, title: str) -> Axes:
    """Axes of a picture, without ticks."""
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_title(title, fontsize=9)
    return axes


def cuts(axes: Axes, found: xarray.Dataset) -> None:
    """The α-cuts of E."""
    alpha, ends = found["alpha"].values, found["E"].values / GPA
    for level, pair in zip(alpha, ends, strict=True):
        axes.plot(pair, [level, level], color=BLUE, lw=2)
    axes.plot(ends.ravel(order="F"), np.tile(alpha, 2), ".", color=INK, ms=3)
    axes.set_xlabel("E, GPa")
    axes.set_ylabel("α")
