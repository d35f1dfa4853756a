"""The frame to scale (Fig. 26), and as masses, springs and dampers (Fig. 27)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.case.structures import Frame
from alphacut.figures.style import BLUE, GREY, INK, ORANGE, Look, figure
from alphacut.fuzzy import Crisp

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def frame(section: Frame) -> Figure:
    """Fig. 26: floors, columns with their lengths, displacements."""
    known = section.lengths or (Crisp(3.0),)  # not to scale where only stiffnesses are given
    lengths = [length.modal for length in section.per_floor(known)]
    masses = [mass.modal for mass in section.per_floor(section.masses)]
    height = sum(lengths)
    span, level = 0.45 * max(height, 6.0) if len(lengths) < 5 else 0.3 * height, 0.0
    high = min(9.0, 1.4 + 0.5 * height, 4.4 * 1.13 * height / (2.15 * span))
    drawn, axes = figure(high * 2.15 * span / (1.13 * height), high)
    ground(axes, 0.0, span)
    for floor, (length, mass) in enumerate(zip(lengths, masses, strict=True), start=1):
        own = section.stiffness
        stiff = None if own is None else section.per_floor(own)[floor - 1].modal
        columns(axes, floor, level, length, span, stiff)
        level += length
        beam(axes, floor, level, mass, span)
    axes.set_xlim(-0.6 * span, 1.55 * span)
    axes.set_ylim(-0.05 * height, 1.08 * height)
    axes.set_aspect("equal")
    axes.axis("off")
    return drawn


def columns(
    axes: Axes, floor: int, foot: float, length: float, span: float, stiff: float | None = None
) -> None:
    """Both columns of a storey with their length, or its stiffness in N/m where that is given."""
    for x in (0.0, span):
        axes.plot([x, x], [foot, foot + length], color=INK, lw=1.4)
    spot = (-0.06 * span, foot + length / 2)
    words = f"$l_{{{floor}}}$ = {length:.2f} m"
    if stiff is not None:
        words = f"$k_{{{floor}}}$ = {stiff / 1e6:.4g} MN/m"
    axes.annotate(words, spot, ha="right", va="center", fontsize=8)


def beam(axes: Axes, floor: int, level: float, mass: float, span: float) -> None:
    """A floor with its mass and the arrow of its displacement."""
    axes.plot([-0.03 * span, 1.03 * span], [level, level], color=INK, lw=6, solid_capstyle="butt")
    above: Look = {"xytext": (0, 6), "textcoords": "offset points", "ha": "center", "va": "bottom"}
    words = f"$m_{{{floor}}}$ = {mass / 1000:g} t"
    axes.annotate(words, (span / 2, level), fontsize=8, **above)
    arrow = {"arrowstyle": "-|>", "color": ORANGE}
    axes.annotate("", (1.32 * span, level), (1.08 * span, level), arrowprops=arrow)
    axes.annotate(f"$q_{{{floor}}}$", (1.35 * span, level), va="center", color=ORANGE)


def ground(axes: Axes, left: float, right: float) -> None:
    """Hatched ground line at height 0."""
    across = (left - 0.1 * right, 1.1 * right)
    hatched(axes, across, (-0.03 * right, 0))
    axes.plot(across, [0, 0], color=INK, lw=1)


MOST = 5
"""Most masses of a chain that are drawn."""


def chain(section: Frame) -> Figure:
    """Fig. 27: the frame as masses on springs, with its dampers if it has any.

    Of more than `MOST` floors those between the third and the last are left out.
    """
    floors = len(section.masses)
    names = range(1, floors + 1) if floors <= MOST else (1, 2, 3, 0, floors)
    damped = section.damper_placement is not None and section.damped
    placement = section.damper_placement if damped else "none"
    slots = len(names)
    wide = min(7.2, 2.2 + 1.5 * slots)
    drawn, axes = figure(wide, 2.15 * wide / (1.6 * slots + 0.5) + 0.1)
    foot = -0.9 if placement == "ground" else -0.5
    axes.plot([0, 0], [foot, 0.75], color=INK, lw=1)
    hatched(axes, (-0.12, 0), (foot, 0.75))
    for slot, floor in enumerate(names, start=1):
        if not floor:
            axes.annotate("…", (1.6 * slot - 0.5, 0.2), ha="center", va="center", fontsize=16)
            continue
        link(axes, slot, floor)
        if placement == "ground":
            ground_damper(axes, slot, floor)
        elif placement == "storey":
            storey_damper(axes, slot, floor)
    if placement == "ground":
        right = 1.6 * slots + 0.2
        axes.plot([-0.12, right], [foot, foot], color=INK, lw=1)
        hatched(axes, (-0.12, right), (foot - 0.12, foot))
    axes.set_xlim(-0.2, 1.6 * slots + 0.3)
    axes.set_ylim(-1.1 if placement == "ground" else -0.7, 1.05)
    axes.set_aspect("equal")
    axes.axis("off")
    return drawn


def hatched(axes: Axes, across: tuple[float, float], up: tuple[float, float]) -> None:
    """A rectangle that stands for the ground."""
    axes.fill_between(across, *up, hatch="////", facecolor="white", edgecolor=GREY, lw=0)


def places(slot: int) -> tuple[float, float, float]:
    """Start of the spring of a mass, and the mass's left and right edges."""
    left = 1.6 * slot - 1.0
    return (0.0 if slot == 1 else left - 0.6), left, 1.6 * slot


def link(axes: Axes, slot: int, floor: int) -> None:
    """A mass with its spring and the arrow of its displacement."""
    start, left, right = places(slot)
    spring(axes, start, left, 0.2)
    axes.annotate(f"$k_{{{floor}}}$", ((start + left) / 2, 0.36), ha="center", fontsize=9)
    axes.fill_between(
        [left, right], [-0.3] * 2, [0.6] * 2, facecolor="#dbe9f4", edgecolor=INK, lw=1
    )
    axes.annotate(f"$m_{{{floor}}}$", ((left + right) / 2, 0.15), ha="center", va="center")
    arrow = {"arrowstyle": "-|>", "color": ORANGE}
    axes.annotate("", (right + 0.12, 0.85), (left + 0.4, 0.85), arrowprops=arrow)
    axes.annotate(f"$q_{{{floor}}}$", (left + 0.25, 0.85), ha="center", va="center", color=ORANGE)


def ground_damper(axes: Axes, slot: int, floor: int) -> None:
    """The damper between a mass and the ground."""
    _, left, right = places(slot)
    middle = (left + right) / 2
    damper(axes, (middle, -0.3), (middle, -0.9))
    axes.annotate(f"$d_{{{floor}}}$", (middle + 0.16, -0.6), va="center", fontsize=9)


def storey_damper(axes: Axes, slot: int, floor: int) -> None:
    """The damper beside a spring."""
    start, left, _ = places(slot)
    damper(axes, (start, -0.1), (left, -0.1))
    axes.annotate(f"$d_{{{floor}}}$", ((start + left) / 2, -0.3), ha="center", va="top", fontsize=9)


def spring(axes: Axes, left: float, right: float, height: float) -> None:
    """A zigzag between two points at one height."""
    inner = np.linspace(left + 0.15 * (right - left), right - 0.15 * (right - left), 10)
    zigzag = height + 0.1 * np.array([0, 1, -1, 1, -1, 1, -1, 1, -1, 0])
    axes.plot([left, *inner, right], [height, *zigzag, height], color=BLUE, lw=1.2)


def damper(axes: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    """A dashpot between two points, along the axes."""
    a, b = np.array(start), np.array(end)
    along, across = (b - a), 0.09 * np.array([a[1] - b[1], b[0] - a[0]]) / np.hypot(*(b - a))
    cup, piston = a + 0.4 * along, a + 0.55 * along
    rim = a + 0.68 * along
    for points in (
        [a, cup],
        [rim + across, cup + across, cup - across, rim - across],
        [piston + 0.8 * across, piston - 0.8 * across],
        [piston, b],
    ):
        axes.plot(*np.array(points).T, color=INK, lw=1)
