"""What all figures share: their look and files, the α scale, axes with units, and memberships."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from alphacut.base.arrays import Array
from alphacut.base.number_text import MINUS, ShownUnit, axis_prefix

# Okabe & Ito
INK, BLUE, ORANGE, GREEN = "#1a1a1a", "#0072b2", "#d55e00", "#009e73"
PURPLE = "#7b3294"  # differs from blue and orange in lightness
GREY, PALE, LIGHT = "#8c8c8c", "#dce9f2", "#9ecae1"
WIDTH, HEIGHT = 7.2, 3.8  # inches
SETTINGS: dict[str, Any] = {
    "figure.figsize": (WIDTH, HEIGHT),
    "figure.titlesize": 10,
    "font.size": 10,
    "axes.titlelocation": "left",
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "figure.constrained_layout.use": True,
    "svg.fonttype": "none",
    "svg.hashsalt": "alphacut",
    "savefig.dpi": 150,
}


HOVER = "hover:"
"""Beginning of an artist's `gid`; the rest is what SVG shows where a pointer rests on it."""


@contextmanager
def figure_style() -> Iterator[None]:
    """Context manager that sets this style."""
    mpl.use("Agg")
    with mpl.rc_context(SETTINGS):
        yield


def save(figure: Figure, stem: Path) -> list[Path]:
    """Write a figure to STEM.svg and STEM.png, close it, and return the two paths."""
    stem.parent.mkdir(parents=True, exist_ok=True)
    if (layout := figure.get_layout_engine()) is not None:
        for _ in range(2):  # the second knows where the first put axes of equal scale
            layout.execute(figure)
    figure.set_layout_engine("none")
    files = []
    for kind in ("svg", "png"):
        partial, file = (stem.with_name(f"{stem.name}{x}.{kind}") for x in (".partial", ""))
        figure.savefig(partial, metadata={"Date": None} if kind == "svg" else None)
        if kind == "svg":
            drawn = partial.read_text(encoding="utf-8")
            titled = re.sub(rf'<g id="{HOVER}([^"]*)">', r"<g><title>\1</title>", drawn)
            partial.write_text(titled, encoding="utf-8")
        files.append(partial.replace(file))
    plt.close(figure)
    return files


Colour = tuple[float, float, float, float]
Look = dict[str, Any]  # keywords of a drawing function of Matplotlib


def colours(alpha: Array) -> list[Colour]:
    """Colour for each level, the darker the higher, fit for grey print."""
    return [colormaps["YlGnBu"](0.25 + 0.65 * float(level)) for level in alpha]


def alpha_legend(axes: Axes, alpha: Array, further: Sequence[Line2D] = ()) -> None:
    """Adds a legend of the colours of α-levels and of further lines, beside the axes."""
    shades = zip(alpha[:-1], colours(alpha), strict=False)
    patches = [Patch(facecolor=shade, label=f"α = {level:g}") for level, shade in shades]
    top = Line2D([], [], color=INK, lw=1, label=f"α = {alpha[-1]:g}")
    beside: Look = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0)}
    axes.legend(handles=[*patches, top, *further], title="α-cut", title_fontsize=8, **beside)


def prefix_axis(
    axes: Axes, label: str, si: str, *, across: bool = False, shown: ShownUnit | None = None
) -> None:
    """Labels the vertical axis, or the horizontal one if `across`, in a unit with a prefix.

    The data stay in SI: the labels of ticks are scaled. Where `shown` is given, it is the unit.
    """
    axis = axes.xaxis if across else axes.yaxis
    factor, unit = axis_prefix(max(map(abs, axis.get_view_interval())), si)
    if shown is not None:
        unit, factor = shown
    axis.set_label_text(f"{label} ({unit})".replace("^2", "²") if unit else label)
    if factor != 1.0:
        axis.set_major_formatter(lambda value, _: f"{value * factor:.10g}".replace("-", MINUS))


def membership_axes(axes: Axes, label: str) -> None:
    """Axes of a membership function: grade upwards from 0 to 1."""
    axes.set(xlabel=label, ylabel="membership μ", ylim=(0, 1.05))
    low, high = axes.get_xlim()
    if max(-low, high) > 100 * (high - low):  # numbers of many digits take more room
        axes.locator_params(axis="x", nbins=3)


def outline(lower: Array, upper: Array) -> Array:
    """Ends of α-cuts in one sequence: up the left branch, down the right."""
    return np.concatenate([lower, upper[::-1]])


def shaded_cuts(axes: Axes, alpha: Array, lower: Array, upper: Array) -> None:
    """Draws a membership function from its α-cuts, each cut as a bar at its level."""
    for level, low, high, shade in zip(alpha, lower, upper, colours(alpha), strict=True):
        axes.plot([low, high], [level, level], color=shade, lw=3, solid_capstyle="butt", zorder=2)
    line: Look = {"color": INK, "lw": 1.2, "marker": "o", "ms": 3.5, "zorder": 3}
    axes.plot(outline(lower, upper), outline(alpha, alpha), **line)
