"""What all figures share: their look and files, the α scale, axes with units, and memberships."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from alphacut.base.arrays import Array
from alphacut.base.number_text import MINUS, ShownUnit, axis_prefix
from alphacut.fuzzy.result import Ends

# Colours of Okabe and Ito, which colour-blind readers tell apart; purple differs from blue and
# orange in lightness as well.
INK, BLUE, ORANGE, GREEN = "#1a1a1a", "#0072b2", "#d55e00", "#009e73"
PURPLE = "#7b3294"
GREY, PALE, LIGHT = "#8c8c8c", "#dce9f2", "#9ecae1"
WIDTH, HEIGHT = 7.2, 3.8
"""Size of a figure in inches, as the style sheet has it."""
HOVER = "hover:"
"""Beginning of an artist's `gid`. SVG shows the remaining text where a pointer rests on it."""
Colour = tuple[float, float, float, float]
Look = dict[str, Any]
"""Keyword arguments of one of Matplotlib's drawing functions."""


@contextmanager
def figure_style() -> Iterator[None]:
    """Use the style sheet of this folder, and no display, within the block."""
    mpl.use("Agg")
    with mpl.rc_context(fname=Path(__file__).with_name("alphacut.mplstyle")):
        yield


def panels(
    height: float, rows: int = 1, columns: int = 1, *, sharex: bool = False, sharey: bool = False
) -> tuple[Figure, list[Axes]]:
    """Return a new figure of usual width, and its panels row by row.

    Args:
        height: Height of the figure in inches.
        rows: Number of rows.
        columns: Number of panels in a row.
        sharex: Whether all panels have one range of x.
        sharey: Whether all panels have one range of y.
    """
    size = (WIDTH, height)
    figure, grid = plt.subplots(
        rows, columns, squeeze=False, figsize=size, sharex=sharex, sharey=sharey
    )
    return figure, list(grid.flat)


def legend_beside(
    axes: Axes, handles: Sequence[Artist] | None = None, title: str | None = None
) -> None:
    """Add a legend on the right of the axes, of all that has a label or of some handles."""
    axes.legend(handles=handles, title=title, loc="upper left", bbox_to_anchor=(1.0, 1.0))


def rows_of(axes: Axes, names: Iterable[str]) -> Array:
    """Label a row of the axes by each name, the first one on top, and return their places."""
    labels = list(names)
    places = np.arange(len(labels), dtype=float)[::-1]
    axes.set_yticks(places, labels)
    return places


def save(figure: Figure, stem: Path) -> list[Path]:
    """Write a figure to STEM.svg and STEM.png, close it, and return the two paths.

    Equal figures give equal files. In the SVG file an artist whose `gid` begins with `HOVER` shows
    the text behind it where a pointer rests on the artist.
    """
    stem.parent.mkdir(parents=True, exist_ok=True)
    # Axes of equal scale are known only after a first layout, which the second one can then use.
    # Without an engine, saving keeps this layout.
    if (layout := figure.get_layout_engine()) is not None:
        layout.execute(figure)
        layout.execute(figure)
    figure.set_layout_engine("none")
    picture = stem.with_name(f"{stem.name}.png")
    drawing = stem.with_name(f"{stem.name}.svg")
    figure.savefig(picture)
    figure.savefig(drawing, metadata={"Date": None})
    # Matplotlib writes no titles into SVG. The names in `gid` are escaped by it.
    text = drawing.read_text(encoding="utf-8")
    titled = re.sub(rf'<g id="{HOVER}([^"]*)">', r"<g><title>\1</title>", text)
    drawing.write_text(titled, encoding="utf-8")
    plt.close(figure)
    return [drawing, picture]


def colours(alpha: Array) -> list[Colour]:
    """Return a colour for each α-level: the higher the darker, distinct in grey print as well."""
    # The ends of the colour map are left out: one is as light as paper, one as dark as lines.
    return [colormaps["YlGnBu"](0.25 + 0.65 * float(level)) for level in alpha]


def draw_bands(
    axes: Axes,
    x: Array,
    bands: Ends,
    alpha: Array,
    *,
    in_steps: bool = False,
    is_outlined: bool = False,
    is_upright: bool = False,
) -> None:
    """Fill the band between lower and upper bounds over x, on each α-level.

    Args:
        axes: Axes that are drawn on.
        x: Rising values, shape (X,).
        bands: Bounds, shape (A, X) each.
        alpha: Rising levels, shape (A,).
        in_steps: Whether the bounds jump at each value x and are constant up to the next.
        is_outlined: Whether a thin line around the lowest level keeps pale bands visible in print.
        is_upright: Whether x stands on the vertical axis.
    """
    fill = axes.fill_betweenx if is_upright else axes.fill_between
    # Cuts are nested, so that higher levels are drawn over lower ones.
    levels = zip(bands.lower[:-1], bands.upper[:-1], colours(alpha), strict=False)
    for low, high, shade in levels:
        fill(x, low, high, color=shade, lw=0, step="post" if in_steps else None)
    # On the highest level crisp inputs leave a band of no width: it is drawn as lines.
    widths = {-1: 1.0, 0: 0.3} if is_outlined else {-1: 1.0}
    for level, width in widths.items():
        for end in bands:
            across, up = (end[level], x) if is_upright else (x, end[level])
            axes.plot(across, up, color=INK, lw=width, ds="steps-post" if in_steps else "default")


def alpha_legend(axes: Axes, alpha: Array, further: Sequence[Line2D] = ()) -> None:
    """Add a legend of the α-levels beside the axes: a line for the highest, patches for the others.

    Args:
        axes: The axes.
        alpha: Rising levels, shape (levels,).
        further: Lines that are added below; each brings its own label.
    """
    shades = zip(alpha[:-1], colours(alpha), strict=False)
    patches = [Patch(facecolor=shade, label=f"α = {level:g}") for level, shade in shades]
    top = Line2D([], [], color=INK, lw=1, label=f"α = {alpha[-1]:g}")
    handles: list[Artist] = list(patches)
    handles.append(top)
    handles.extend(further)
    legend_beside(axes, handles=handles, title="α-cut")


def prefix_axis(
    axes: Axes, label: str, si: str, *, across: bool = False, shown: ShownUnit | None = None
) -> None:
    """Label the vertical axis, or the horizontal one if `across`, in a unit with a prefix.

    The data stay in the SI unit; only the numbers beside the ticks are scaled. The axis must have
    its final limits, unless `shown` is given.

    Args:
        axes: The axes.
        label: What the axis shows, without its unit.
        si: SI unit of the data; empty for a pure number.
        across: Whether the horizontal axis is meant.
        shown: Unit to be shown, with its factor from SI; None for the prefix that fits the largest
            magnitude in view.
    """
    axis = axes.xaxis if across else axes.yaxis
    if shown is None:
        factor, unit = axis_prefix(max(map(abs, axis.get_view_interval())), si)
    else:
        unit = shown.label
        factor = shown.factor
    if unit:
        label = f"{label} ({unit})".replace("^2", "²")
    axis.set_label_text(label)
    if factor != 1.0:
        axis.set_major_formatter(lambda value, _: f"{value * factor:.10g}".replace("-", MINUS))


def membership_axes(axes: Axes, label: str) -> None:
    """Label the axes of a membership function, whose grades rise from 0 to 1."""
    axes.set(xlabel=label, ylabel="membership μ", ylim=(0, 1.05))
    low, high = axes.get_xlim()
    # Numbers on a narrow interval far from zero have many digits: only few of them have room.
    if max(-low, high) > 100 * (high - low):
        axes.locator_params(axis="x", nbins=3)


def outline(lower: Array, upper: Array) -> Array:
    """Return the ends of α-cuts on rising levels in one sequence: the left branch upwards first."""
    return np.concatenate([lower, upper[::-1]])


def shaded_cuts(axes: Axes, alpha: Array, lower: Array, upper: Array) -> None:
    """Draw a membership function from its α-cuts, and each cut as a bar at its level."""
    for level, low, high, shade in zip(alpha, lower, upper, colours(alpha), strict=True):
        axes.plot([low, high], [level, level], color=shade, lw=3, solid_capstyle="butt", zorder=2)
    line: Look = {"color": INK, "lw": 1.2, "marker": "o", "ms": 3.5, "zorder": 3}
    axes.plot(outline(lower, upper), outline(alpha, alpha), **line)
