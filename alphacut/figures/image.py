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
    """Phases, constitutive error, E over a random threshold where there is one, α-cuts of E."""
    random = "E_of_threshold" in found
    drawn, first = figure(height=6.0 if random else 5.0)
    first.remove()
    grid = drawn.add_gridspec(2, 2, height_ratios=(1, 1 if random else 0.7), hspace=0.25)
    phases(drawn.add_subplot(grid[0, 0]), found)
    errors(drawn.add_subplot(grid[0, 1]), found)
    if random:
        over_threshold(drawn.add_subplot(grid[1, 0]), found)
    cuts(drawn.add_subplot(grid[1, 1] if random else grid[1, :]), found)
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


def over_threshold(axes: Axes, found: xarray.Dataset) -> None:
    """Bounds of E over the random threshold, and the band of its outer quantiles."""
    order = np.argsort(found["threshold"].values)
    ends = found["E_of_threshold"].values[order] / GPA
    grey = found["threshold"].values[order]
    axes.fill_between(grey, *ends.T, color=BLUE, alpha=0.35, lw=0)
    axes.plot(grey, ends, color=BLUE, lw=1)
    quantiles, shares = found["quantile"].values[-1] / GPA, found["share"].values
    for pair, share in zip(quantiles, shares, strict=True):
        axes.axhspan(*pair, color=INK, alpha=0.25, lw=0)
        axes.axhline(pair.mean(), color=INK, lw=0.5)
        place = grey[-1], pair.max()
        axes.text(*place, f"{share:g}", fontsize=8, va="bottom", ha="right", color=INK)
    axes.set_xlabel("threshold, grey value")
    axes.set_ylabel("E, GPa")
    axes.set_title("E over the threshold, its quantiles", fontsize=9)


def cuts(axes: Axes, found: xarray.Dataset) -> None:
    """The α-cuts of E."""
    alpha, ends = found["alpha"].values, found["E"].values / GPA
    for level, pair in zip(alpha, ends, strict=True):
        axes.plot(pair, [level, level], color=BLUE, lw=2)
    axes.plot(ends.ravel(order="F"), np.tile(alpha, 2), ".", color=INK, ms=3)
    axes.set_xlabel("E, GPa")
    axes.set_ylabel("α")
