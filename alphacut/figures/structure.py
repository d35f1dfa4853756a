"""Figures of a structure of storeys: the model, profiles over its height, and loops of storeys."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from alphacut.base.number_text import ShownUnit
from alphacut.figures import style
from alphacut.figures.style import BLUE, GREY, INK, ORANGE, Look
from alphacut.frame import Peak, StoreyFrame
from alphacut.frame.analyses.storey_table import storey_table
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.result import Ends

PANEL_HEIGHT = 4.2
"""Height of a figure over the storeys, in inches."""


class Level(NamedTuple):
    """An output of a storey or floor.

    Attributes:
        number: Number of the storey or floor, from 1 from below.
        name: Name of the output.
    """

    number: int
    name: str


def families(names: Mapping[str, object]) -> dict[str, list[Level]]:
    """Return the outputs that exist in several storeys, by their kind, from below.

    Args:
        names: Names of outputs, as "drift3"; those of largest or smallest values, as "max q3", are
            left out.

    Returns:
        Lists of two levels at least, by the name without its number, as "drift".
    """
    by_kind: dict[str, list[Level]] = {}
    for name in names:
        match = re.fullmatch(r"([^\W\d]\w*?)_?(\d{1,4})", name)
        if match is not None:
            by_kind.setdefault(match[1], []).append(Level(int(match[2]), name))
    return {kind: sorted(levels) for kind, levels in by_kind.items() if len(levels) > 1}


def profiles(peaks: Mapping[str, Peak], units: Mapping[str, ShownUnit]) -> Figure | None:
    """Draw the peaks of all outputs that exist in several storeys over the height.

    There is a panel for each kind of output, with a band for each α-level between the lower and the
    upper bound of the peaks, a line at the highest level, and a dot at the farthest attained peak
    of the lowest level.

    Args:
        peaks: Peaks by the names of their outputs.
        units: Unit in which each output is shown.

    Returns:
        The figure, or None if no output exists in two storeys, or none of them has finite bounds.
    """
    kinds = families({name: peak for name, peak in peaks.items() if np.isfinite(peak.upper).all()})
    if not kinds:
        return None
    figure, panels = style.panels(PANEL_HEIGHT, columns=len(kinds))
    for axes, levels in zip(panels, kinds.values(), strict=True):
        numbers = [level.number for level in levels]
        of_levels = [peaks[level.name] for level in levels]
        alpha = of_levels[0].alpha
        # Values are in the unit shown, so that the ticks of g are round numbers.
        unit = units[levels[0].name]
        lower = unit.factor * np.array([peak.lower for peak in of_levels]).T  # (levels, storeys)
        upper = unit.factor * np.array([peak.upper for peak in of_levels]).T
        bands = Ends(lower, upper)
        style.draw_bands(axes, np.array(numbers), bands, alpha, is_outlined=True, is_upright=True)
        attained = [unit.factor * peak.reached[0] for peak in of_levels]
        axes.plot(attained, numbers, ls="", marker="o", ms=3.5, color=ORANGE)
        axes.set_yticks(numbers)
        axes.set_xlim(left=0)
        axes.locator_params(axis="x", nbins=4)
        output = Output(levels[0].name)
        words = output.words.split(" of ")[0].rstrip("_0123456789 ")
        axes.set_xlabel(f"{words} ({unit.label})".replace("^2", "²").removesuffix(" ()"))
    panels[0].set_ylabel("floor or storey")
    dot = Line2D([], [], ls="", marker="o", ms=3.5, color=ORANGE, label="attained")
    style.alpha_legend(panels[-1], alpha, [dot])
    return figure


def loops(frame: StoreyFrame, peaks: Mapping[str, Peak], *, duration: float, step: float) -> Figure:
    """Draw the force over the drift of each storey that yields, as hysteresis loops.

    Args:
        frame: Frame whose columns yield, at its nominal values.
        peaks: Peaks with the inputs that attain them; the response under those of the farthest peak
            of the first output is drawn beside the nominal one.
        duration: Length of the response, in s.
        step: Distance of the time nodes, in s.
    """
    storeys = [z + 1 for z, hardening in enumerate(frame.hardening) if hardening < 1]
    names = [f"{kind}{z}" for z in storeys for kind in ("drift", "shear")]
    worst = next((peak.reached_at for peak in peaks.values() if peak.reached_at), {})
    observed = replace(frame, outputs=tuple(names))
    nominal = {name: frame.parameters[name] for name in worst}
    flow = make_flow(observed, tuple(worst), duration, step)
    points = np.array([list(nominal.values()), list(worst.values())])
    responses = flow.values(points)  # (2, time nodes, drifts and shears in turn)
    figure, panels = style.panels(PANEL_HEIGHT - 1, columns=len(storeys), sharey=True)
    looks: list[Look] = [
        {"color": BLUE, "lw": 1.0, "label": "nominal", "zorder": 3},
        {"color": ORANGE, "lw": 0.8, "label": "inputs of the farthest peak"},
    ]
    for column, (axes, storey) in enumerate(zip(panels, storeys, strict=True)):
        for response, look in zip(responses, looks, strict=True):
            axes.plot(response[:, 2 * column], response[:, 2 * column + 1], **look)
        axes.axhline(0.0, color=GREY, lw=0.5)
        axes.axvline(0.0, color=GREY, lw=0.5)
        axes.locator_params(axis="x", nbins=4)
        style.prefix_axis(axes, f"drift {storey}", "m", across=True)
    style.prefix_axis(panels[0], "shear", "N")
    style.legend_beside(panels[-1])
    return figure


def sketch(frame: StoreyFrame) -> Figure:
    """Draw the frame: floors with their weights, storeys with their stiffness and height."""
    heights = np.array(frame.lengths or (1.0,) * frame.floors)
    levels = np.concatenate([[0.0], np.cumsum(heights)])
    figure, (axes,) = style.panels(PANEL_HEIGHT)
    axes.fill_between([-0.3, 1.3], -0.04 * levels[-1], 0.0, color=GREY, alpha=0.4, lw=0)
    rows = storey_table(frame).records[::-1]
    for z, (below, above) in enumerate(pairwise(levels)):
        is_yielding = bool(frame.hardening) and frame.hardening[z] < 1
        look: Look = {"color": ORANGE if is_yielding else INK, "lw": 1.5}
        for x in (0.1, 0.9):
            axes.plot([x, x], [below, above], **look)
        axes.plot([0.0, 1.0], [above, above], color=BLUE, lw=5, solid_capstyle="butt", zorder=3)
        row = rows[z]
        axes.text(1.05, above, row["weight"], va="center", fontsize=8)
        middle = (below + above) / 2
        axes.text(0.5, middle, row["stiffness"], ha="center", va="center", fontsize=8)
        if "height" in row:
            axes.text(-0.05, middle, row["height"], ha="right", va="center", fontsize=8)
    axes.set_axis_off()
    axes.set_xlim(-0.6, 3.4)  # pages show figures in one width: this one needs half of it
    return figure
