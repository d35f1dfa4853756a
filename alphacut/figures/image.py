"""An image, the error of its fields pixel by pixel, and the proved bounds of E."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.figures.style import BLUE, INK, figure
from alphacut.stages.material.cell import GPA

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SMALLEST = 1e-6  # error drawn, over the largest


def image(found: xarray.Dataset) -> Figure:
    """Phases, constitutive error, α-cuts of E."""
    drawn, first = figure(height=5.0)
    first.remove()
    grid = drawn.add_gridspec(2, 2, height_ratios=(1, 0.7), hspace=0.25)
    phases(drawn.add_subplot(grid[0, 0]), found)
    errors(drawn.add_subplot(grid[0, 1]), found)
    cuts(drawn.add_subplot(grid[1, :]), found)
    return drawn


def phases(axes: Axes, found: xarray.Dataset) -> None:
    """The number of each pixel's phase as grey."""
    plane(axes, "phases").imshow(found["phase"].values, origin="lower", cmap="Greys_r")


def errors(axes: Axes, found: xarray.Dataset) -> None:
    """The logarithm of the constitutive error over its largest value."""
    import matplotlib.pyplot as plt

    values = found["gap"].values
    values = np.log10(np.maximum(values / values.max(), SMALLEST))
    shown = plane(axes, "error of the fields, log10").imshow(values, origin="lower", cmap="magma")
    plt.colorbar(shown, ax=axes, shrink=0.8)


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
