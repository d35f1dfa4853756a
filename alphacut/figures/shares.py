"""Share of each input in the width of the vibration over time: Figs. 34 and 35 as numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import maximum_filter1d

from alphacut.figures.captions import INPUTS, in_words
from alphacut.figures.style import BLUE, GREY, ORANGE, PURPLE, prefix_axis
from alphacut.frame.structures.quantities import Output
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = (BLUE, ORANGE, PURPLE, GREY)
STYLES = ("-", "--", ":", "-.")
HATCHES = ("", "////", "....")  # of bars whose colour stands already
MOST = 4  # outputs in one figure
WINDOW = 1 / 40  # of the duration: the means wander less than the vibration


def over_time(found: xarray.Dataset) -> Figure:
    """Share of width lost when an input is fixed, for each output, above the width."""
    import matplotlib.pyplot as plt

    outputs = [str(name) for name in found["output"].values][-MOST:]
    size = (7.2, 1.0 + 1.9 * len(outputs))
    drawn, grid = plt.subplots(
        len(outputs), 1, figsize=size, sharex=True, squeeze=False, layout="constrained"
    )
    for axes, output in zip(grid[:, 0], outputs, strict=True):
        panel(axes, found.sel(output=output), output)
    span = float(found["time"].values[-1] - found["time"].values[0])
    title = (
        f"shares of the width at the lowest α, means over {WINDOW * span:.2g} s weighted with it;"
        " grey: largest width there"
    )
    grid[0, 0].set_title(title, loc="left", fontsize=10)
    grid[-1, 0].set_xlabel("time t, s")
    _legend_below(drawn, grid[0, 0])
    return drawn


def _legend_below(drawn: Figure, axes: Axes) -> None:
    """One legend for all axes, in as many columns as its longest text leaves room for."""
    handles, names = axes.get_legend_handles_labels()
    longest = 0.5 + 0.065 * max(map(len, names), default=0)  # inches at the size 8
    columns = max(1, min(4, len(names), int(drawn.get_figwidth() / longest)))
    drawn.legend(handles, names, fontsize=8, loc="outside lower center", ncols=columns)


def panel(axes: Axes, found: xarray.Dataset, output: str) -> None:
    """The shares in one output's width."""
    time, width = found["time"].values, found["width"].values
    behind = axes.twinx()
    largest = maximum_filter1d(width, 2 * _half(width) + 1, mode="nearest")
    behind.fill_between(time, 0, largest, color="#d9d9d9", lw=0)
    behind.set_ylim(bottom=0)
    behind.grid(False)
    prefix_axis(behind, f"width of {output}", Output(output).unit)
    axes.set_zorder(behind.get_zorder() + 1)
    axes.patch.set_visible(False)
    for index, name in enumerate(found["input"].values):
        colour = COLOURS[index % len(COLOURS)]
        dashes = STYLES[(index // len(COLOURS)) % len(STYLES)]
        share = weighted(found["share"].sel(input=name).values, width)
        words = INPUTS.get(str(name)) or in_words(str(name))
        axes.plot(time, share, color=colour, ls=dashes, lw=1.3, label=words)
    axes.set_xlim(time[0], time[-1])
    axes.set_ylim(0, 1)
    axes.set_ylabel("share")


def _half(width: Array) -> int:
    """Nodes on either side of one within its window."""
    return max(1, round(WINDOW * len(width) / 2))


def weighted(share: Array, width: Array) -> Array:
    """Moving means of the share over time, weighted with the width; NaN without width."""
    half = _half(width)
    above, below = (
        np.convolve(values, np.ones(2 * half + 1))[half:-half]
        for values in (np.nan_to_num(share) * width, width)
    )
    return np.asarray(np.divide(above, below, out=np.full(len(width), np.nan), where=below > 0))


def of_modulus(found: xarray.Dataset) -> Figure:
    """Widths of E and ν lost when an input of the cell is fixed, over the width, by level."""
    import matplotlib.pyplot as plt

    kinds = [(name, one) for name, one in OF_CELL.items() if name in found]
    drawn, grid = plt.subplots(
        len(kinds), 1, figsize=(6.4, 0.8 + 2.2 * len(kinds)), squeeze=False, layout="constrained"
    )
    for axes, (name, quantity) in zip(grid[:, 0], kinds, strict=True):
        cell_panel(axes, found[name], quantity)
    _legend_below(drawn, grid[0, 0])
    return drawn


OF_CELL = {"modulus_share": "E", "poisson_share": "ν"}
"""Variables of shares, and what they are of."""


def cell_panel(axes: Axes, found: xarray.DataArray, quantity: str) -> None:
    """Shares of the cell's inputs in the width of one quantity, bars at each level."""
    names = [str(name) for name in found["cell_input"].values]
    levels = [level for level in found["alpha"].values if level < 1]
    thickness = 0.8 / len(names)
    for index, name in enumerate(names):
        share = [float(found.sel(cell_input=name, alpha=level)) for level in levels]
        shift = (index - (len(names) - 1) / 2) * thickness
        places = [place + shift for place in range(len(levels))]
        again, kind = divmod(index, len(COLOURS))
        bars = axes.bar(places, share, thickness, color=COLOURS[kind], label=in_words(name), lw=0)
        for bar in bars:
            bar.set(hatch=HATCHES[again % len(HATCHES)], edgecolor="white")
    axes.set_xticks(range(len(levels)), [f"α = {level:g}" for level in levels])
    axes.set_ylabel(f"share of the width of {quantity}")
    axes.set_ylim(0, 1)
