"""The frame to scale (Fig. 26), and as masses, springs and dampers (Fig. 27)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.case.structure import Frame
from alphacut.figures import style
from alphacut.figures.style import Look
from alphacut.fuzzy import Crisp
from alphacut.stochastic.figures.style import BLUE, GREY, INK, ORANGE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Point = tuple[float, float]
ARROW = {"arrowstyle": "-|>", "color": ORANGE}
PITCH = 1.6
"""Distance of the masses of the chain in Fig. 27; a mass is 1 wide."""


def frame(section: Frame) -> Figure:
    """Fig. 26: floors with mass m and displacement q, columns with length l or stiffness k."""
    default_lengths = (Crisp(3.0),)  # not to scale where only stiffnesses are given
    per_floor = section.per_floor(section.lengths or default_lengths)
    lengths = [length.modal for length in per_floor]
    height, level = sum(lengths), 0.0  # of the frame, and of the floor below, in m
    span = 0.45 * max(height, 6.0) if len(lengths) < 5 else 0.3 * height
    inches = min(9.0, 1.4 + 0.5 * height, 2.31 * height / span)
    figure, axes = style.figure(1.9 * inches * span / height, inches)
    draw_ground(axes, (-0.1 * span, 1.1 * span), (-0.03 * span, 0))
    masses, stiffness = section.per_floor(section.masses), section.per_floor(section.stiffness)
    for floor, (length, mass) in enumerate(zip(lengths, masses, strict=True), start=1):
        words = f"$l_{{{floor}}}$ = {length:.2f} m"
        if stiffness:
            words = f"$k_{{{floor}}}$ = {stiffness[floor - 1].modal / 1e6:.4g} MN/m"
        for x in (0.0, span):
            axes.plot([x, x], [level, level + length], color=INK, lw=1.4)
        axes.annotate(words, (-0.06 * span, level + length / 2), ha="right", fontsize=8)
        level += length
        axes.plot([-0.03 * span, 1.03 * span], [level, level], color=INK, lw=6)
        above: Look = {"xytext": (0, 6), "textcoords": "offset points", "ha": "center"}
        words = f"$m_{{{floor}}}$ = {mass.modal / 1000:g} t"
        axes.annotate(words, (span / 2, level), fontsize=8, **above)
        axes.annotate("", (1.32 * span, level), (1.08 * span, level), arrowprops=ARROW)
        axes.annotate(f"$q_{{{floor}}}$", (1.35 * span, level), va="center", color=ORANGE)
    set_to_scale(axes, (-0.6 * span, 1.55 * span), (-0.05 * height, 1.08 * height))
    return figure


def chain(section: Frame) -> Figure:
    """Fig. 27: the frame as a chain of masses and springs, with its dampers if it has any."""
    floors, placement = section.floors, section.damper_placement if section.has_dampers else None
    foot = -0.9 if placement == "ground" else -0.5
    right, width = PITCH * floors + 0.2, min(12.0, 2.2 + 1.5 * floors)  # of the axes, in inches
    figure, axes = style.figure(width, 2.15 * width / (PITCH * floors + 0.5) + 0.1)
    draw_ground(axes, (-0.12, 0), (foot, 0.75))
    if placement == "ground":
        draw_ground(axes, (-0.12, right), (foot - 0.12, foot))
    for floor in range(1, floors + 1):
        draw_storey(axes, floor, placement)
    set_to_scale(axes, (-0.2, right + 0.1), (foot - 0.2, 1.05))
    return figure


def draw_storey(axes: Axes, floor: int, placement: str | None) -> None:
    """Draws a floor's mass m, spring k, displacement q and damper d to "ground" or "storey"."""
    right = PITCH * floor
    left, start = right - 1.0, max(0.0, right - PITCH)
    middle, half = (left + right) / 2, (start + left) / 2
    draw_spring(axes, start, left, 0.2)
    axes.annotate(f"$k_{{{floor}}}$", (half, 0.36), ha="center", fontsize=9)
    box: Look = {"facecolor": "#dbe9f4", "edgecolor": INK, "lw": 1}
    axes.fill_between([left, right], [-0.3] * 2, [0.6] * 2, **box)
    axes.annotate(f"$m_{{{floor}}}$", (middle, 0.15), ha="center", va="center")
    axes.annotate("", (right + 0.12, 0.85), (left + 0.4, 0.85), arrowprops=ARROW)
    axes.annotate(f"$q_{{{floor}}}$", (left + 0.25, 0.85), ha="center", va="center", color=ORANGE)
    if placement == "ground":
        draw_damper(axes, (middle, -0.3), (middle, -0.9))
        axes.annotate(f"$d_{{{floor}}}$", (middle + 0.16, -0.6), va="center", fontsize=9)
    elif placement == "storey":
        draw_damper(axes, (start, -0.1), (left, -0.1))
        axes.annotate(f"$d_{{{floor}}}$", (half, -0.3), ha="center", va="top", fontsize=9)


def set_to_scale(axes: Axes, across: Point, up: Point) -> None:
    """Sets the limits of axes to scale, and hides their lines and ticks."""
    axes.set_xlim(*across)
    axes.set_ylim(*up)
    axes.set_aspect("equal")
    axes.axis("off")


def draw_ground(axes: Axes, across: Point, up: Point) -> None:
    """Draws a draw_ground rectangle that stands for the ground."""
    axes.fill_between(across, *up, hatch="////", facecolor="white", edgecolor=GREY, lw=0)


def draw_spring(axes: Axes, left: float, right: float, height: float) -> None:
    """Draws a spring as a zigzag between two points at the same height."""
    inner = np.linspace(left + 0.15 * (right - left), right - 0.15 * (right - left), 10)
    zigzag = height + 0.1 * np.array([0, 1, -1, 1, -1, 1, -1, 1, -1, 0])
    axes.plot([left, *inner, right], [height, *zigzag, height], color=BLUE, lw=1.2)


def draw_damper(axes: Axes, start: Point, end: Point) -> None:
    """Draws a dashpot between two points on a horizontal or vertical line."""
    a, b = np.array(start), np.array(end)
    along = b - a
    across = 0.09 * np.array([-along[1], along[0]]) / np.hypot(*along)
    bottom, rim, piston = a + 0.4 * along, a + 0.68 * along, a + 0.55 * along
    cylinder = [rim + across, bottom + across, bottom - across, rim - across]
    head = [piston + 0.8 * across, piston - 0.8 * across]
    for points in ([a, bottom], cylinder, head, [piston, b]):
        axes.plot(*np.array(points).T, color=INK, lw=1)
