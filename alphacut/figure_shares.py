"""Share of each input in the width of the vibration over time: Figs. 34 and 35 as numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from alphacut.captions import in_words
from alphacut.figure_envelope import WORDS
from alphacut.figure_style import BLUE, GREY, ORANGE, PURPLE, figure, prefix_axis

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

COLOURS = (BLUE, ORANGE, PURPLE, GREY)
SEEN = 0.01  # share of the largest width below which there is nothing to have a share of
STYLES = ("-", "--", ":", "-.")


def over_time(found: xarray.Dataset) -> Figure:
    """Width lost when an input is fixed, over the width, for the last output; above it the width itself."""
    import matplotlib.pyplot as plt

    from frame.envelope import output_unit

    drawn, grid = plt.subplots(2, 1, figsize=(7.2, 4.8), sharex=True, height_ratios=(1, 1.6))
    output = str(found["output"].values[-1])
    time, width = found["time"].values, found["width"].sel(output=output)
    grid[0].fill_between(time, 0, width, color="#cfe3f0", lw=0)
    grid[0].plot(time, width, color=BLUE, lw=1)
    grid[0].set_ylim(bottom=0)
    prefix_axis(grid[0], "width", output_unit(output))
    grid[0].set_title(f"width of {output} at the lowest α, and shares of it", loc="left", fontsize=10)
    for index, name in enumerate(found["input"].values):
        colour, dashes = COLOURS[index % len(COLOURS)], STYLES[(index // len(COLOURS)) % len(STYLES)]
        share = found["share"].sel(output=output, input=name).where(width > SEEN * width.max())
        grid[1].plot(time, share, color=colour, ls=dashes, lw=1.3, label=WORDS.get(str(name), str(name)))
    grid[1].set_xlabel("time t, s")
    grid[1].set_ylabel("share of width")
    grid[1].set_ylim(0, 1)
    grid[1].set_xlim(time[0], time[-1])
    grid[1].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, fontsize=8, borderaxespad=0.2)
    return drawn


def of_modulus(found: xarray.Dataset) -> Figure:
    """Width of E lost when an input of the cell is fixed, over the width, by level."""
    drawn, axes = figure(6.4, 3.2)
    names = [str(name) for name in found["cell_input"].values]
    levels = [level for level in found["alpha"].values if level < 1]
    thickness = 0.8 / len(names)
    for index, name in enumerate(names):
        share = [float(found["modulus_share"].sel(cell_input=name, alpha=level)) for level in levels]
        places = [place + (index - (len(names) - 1) / 2) * thickness for place in range(len(levels))]
        axes.bar(places, share, thickness, color=COLOURS[index % len(COLOURS)], label=in_words(name))
    axes.set_xticks(range(len(levels)), [f"α = {level:g}" for level in levels])
    axes.set_ylabel("share of the width of E")
    axes.set_ylim(0, 1)
    axes.legend(fontsize=8)
    return drawn
