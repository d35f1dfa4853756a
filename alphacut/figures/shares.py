"""Share of each input in the width of the modulus, and of the vibration over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import maximum_filter1d

from alphacut.figures.captions import INPUTS, in_words
from alphacut.figures.style import BLUE, GREY, ORANGE, PURPLE, WIDTH, Look, prefix_axis, title
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.arrays import Array

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = (BLUE, ORANGE, PURPLE, GREY)
STYLES = ("-", "--", ":", "-.")
HATCHES = ("", "////", "....")  # of bars whose colour stands already
MOST = 4  # outputs in one figure
WINDOW = 1 / 40  # of the duration: the means wander less than the vibration
OF_CELL = {"modulus_share": "E", "poisson_share": "ν"}
"""Variables of shares, and what they are of."""


def over_time(dataset: xarray.Dataset) -> Figure:
    """Share of width lost when an input is fixed, for each output, above the width in grey."""
    outputs = [str(name) for name in dataset["output"].values][-MOST:]
    drawn, panels = _panels(len(outputs), 1.9)
    for axes, output in zip(panels, outputs, strict=True):
        _panel(axes, dataset.sel(output=output), output)
    span = float(np.ptp(dataset["time"].values))
    title(panels[0], f"weighted means over {WINDOW * span:.2g} s; grey: the width at the lowest α")
    panels[-1].set_xlabel("time t (s)")
    _legend_below(drawn, panels[0])
    return drawn


def of_modulus(dataset: xarray.Dataset) -> Figure:
    """Widths of E and ν lost when an input of the cell is fixed, over the width, by level."""
    kinds = [(name, one) for name, one in OF_CELL.items() if name in dataset]
    drawn, panels = _panels(len(kinds), 2.2)
    for axes, (name, quantity) in zip(panels, kinds, strict=True):
        _bars(axes, dataset[name], quantity)
    _legend_below(drawn, panels[0])
    return drawn


def _panels(count: int, height: float) -> tuple[Figure, list[Axes]]:
    """Axes below each other."""
    import matplotlib.pyplot as plt

    size = (WIDTH, 1.0 + height * count)
    drawn, grid = plt.subplots(count, 1, figsize=size, sharex=True, squeeze=False)
    return drawn, list(grid[:, 0])


def _legend_below(drawn: Figure, axes: Axes) -> None:
    """One legend for all axes, in as many columns as its longest text leaves room for."""
    handles, names = axes.get_legend_handles_labels()
    longest = 0.5 + 0.065 * max(map(len, names), default=0)  # inches at the size 8
    columns = max(1, min(4, len(names), int(drawn.get_figwidth() / longest)))
    drawn.legend(handles, names, fontsize=8, loc="outside lower center", ncols=columns)


def _panel(axes: Axes, dataset: xarray.Dataset, output: str) -> None:
    """The shares in one output's width."""
    time, width = dataset["time"].values, dataset["width"].values
    half, behind = max(1, round(WINDOW * len(width) / 2)), axes.twinx()
    largest = maximum_filter1d(width, 2 * half + 1, mode="nearest")
    behind.fill_between(time, 0, largest, color="#d9d9d9", lw=0)
    behind.set_ylim(bottom=0)
    behind.grid(False)
    prefix_axis(behind, f"width of {output}", Output(output).unit)
    axes.set_zorder(behind.get_zorder() + 1)
    axes.patch.set_visible(False)
    for index, name in enumerate(map(str, dataset["input"].values)):
        share = weighted(dataset["share"].sel(input=name).values, width, half)
        look: Look = {"color": COLOURS[index % 4], "ls": STYLES[(index // 4) % 4], "lw": 1.3}
        axes.plot(time, share, label=INPUTS.get(name) or in_words(name), **look)
    axes.set_xlim(time[0], time[-1])
    axes.set_ylim(0, 1)
    axes.set_ylabel("share")


def weighted(share: Array, width: Array, half: int) -> Array:
    """Means over 2 · half + 1 nodes of the share, weighted with the width; NaN without width."""
    above, below = (
        np.convolve(values, np.ones(2 * half + 1))[half:-half]
        for values in (np.nan_to_num(share) * width, width)
    )
    return np.asarray(np.divide(above, below, out=np.full(len(width), np.nan), where=below > 0))


def _bars(axes: Axes, shares: xarray.DataArray, quantity: str) -> None:
    """Shares of the cell's inputs in the width of one quantity, bars at each level."""
    names = [str(name) for name in shares["cell_input"].values]
    levels = [level for level in shares["alpha"].values if level < 1]
    thick = 0.8 / len(names)
    for index, name in enumerate(names):
        share = [float(shares.sel(cell_input=name, alpha=level)) for level in levels]
        places = np.arange(len(levels)) + (index - (len(names) - 1) / 2) * thick
        look: Look = {
            "color": COLOURS[index % 4],
            "hatch": HATCHES[index // 4 % 3],
            "edgecolor": "white",
        }
        axes.bar(places, share, thick, label=in_words(name), lw=0, **look)
    axes.set_xticks(range(len(levels)), [f"α = {level:g}" for level in levels])
    axes.set_ylabel(f"share of the width of {quantity}")
    axes.set_ylim(0, 1)
