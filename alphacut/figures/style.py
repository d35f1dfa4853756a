"""Style of all figures: sizes, colours, the α scale, and saving as SVG and PNG."""

from __future__ import annotations

from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.io.files import whole_file
from alphacut.io.units import MINUS, axis_prefix
from alphacut.stochastic.figures import style as figure_style
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK = figure_style.INK
BLUE = figure_style.BLUE
ORANGE = figure_style.ORANGE
GREY = figure_style.GREY
PURPLE = "#7b3294"  # differs from Okabe's and Ito's blue and orange in lightness
WIDTH, HEIGHT = 6.4, 3.8  # inches


def style() -> AbstractContextManager[None]:
    """The project's look, for the figures drawn inside the block."""
    return figure_style.style({"axes.edgecolor": INK, "axes.labelcolor": INK})


def figure(width: float = WIDTH, height: float = HEIGHT) -> tuple[Figure, Axes]:
    """A figure with one pair of axes."""
    import matplotlib.pyplot as plt

    drawn, axes = plt.subplots(figsize=(width, height))
    return drawn, axes


def save(drawn: Figure, stem: Path) -> list[Path]:
    """Write STEM.svg and STEM.png, whole or not at all, and close the figure."""
    import matplotlib.pyplot as plt

    paths = [stem.with_name(stem.name + ending) for ending in (".svg", ".png")]
    for path in paths:
        with whole_file(path) as partial:
            drawn.savefig(partial, metadata={"Date": None} if path.suffix == ".svg" else None)
    plt.close(drawn)
    return paths


def colours(alpha: Array) -> list[tuple[float, float, float, float]]:
    """Colour for each level, the darker the higher, fit for grey print."""
    from matplotlib import colormaps

    scale = colormaps["YlGnBu"]
    return [tuple(scale(0.25 + 0.65 * float(level))) for level in alpha]  # type: ignore[misc]


def alpha_legend(
    axes: Axes,
    alpha: Array,
    *,
    loc: str = "best",
    bbox_to_anchor: tuple[float, float] | None = None,
) -> None:
    """The α scale, explained."""
    from matplotlib.patches import Patch

    shades = colours(alpha)
    patches = [Patch(facecolor=shades[i], label=f"α = {alpha[i]:g}") for i in range(len(alpha) - 1)]
    from matplotlib.lines import Line2D

    handles: list[Any] = [*patches, Line2D([], [], color=INK, lw=1, label=f"α = {alpha[-1]:g}")]
    axes.legend(
        handles=handles,
        title="α-cut",
        fontsize=8,
        title_fontsize=8,
        loc=loc,
        bbox_to_anchor=bbox_to_anchor,
    )


def prefix_axis(axes: Axes, label: str, si: str) -> None:
    """Label the vertical axis, with a prefix to its unit; the data stay in SI."""
    factor, unit = axis_prefix(max(map(abs, axes.get_ylim())), si)
    axes.set_ylabel(f"{label}, {unit}".replace("^2", "²"))
    if factor != 1.0:
        axes.yaxis.set_major_formatter(
            lambda value, _: f"{value * factor:.10g}".replace("-", MINUS)
        )


def membership_axes(axes: Axes, label: str) -> None:
    """Axes of a membership function: grade upwards from 0 to 1."""
    axes.set_xlabel(label)
    axes.set_ylabel("membership μ")
    axes.set_ylim(0, 1.05)


def shaded_cuts(axes: Axes, alpha: Array, lower: Array, upper: Array) -> None:
    """A membership function from its α-cuts, each cut as a bar at its level."""
    for level, low, high, shade in zip(alpha, lower, upper, colours(alpha), strict=True):
        axes.plot([low, high], [level, level], color=shade, lw=3, solid_capstyle="butt", zorder=2)
    axes.plot(
        np.concatenate([lower, upper[::-1]]),
        np.concatenate([alpha, alpha[::-1]]),
        color=INK,
        lw=1.2,
        marker="o",
        ms=3.5,
        zorder=3,
    )
