"""The frame to scale (Fig. 26), and as masses, springs and dampers (Fig. 27)."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from alphacut.base.arrays import Array
from alphacut.case.structure import Structure
from alphacut.figures.style import BLUE, GREY, INK, ORANGE, Look, prefix_axis
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.methods.graph_follower import Followed, GraphFollower
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy import Crisp
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.summary import Results

Point = tuple[float, float]
ARROW = {"arrowstyle": "-|>", "color": ORANGE}
PITCH = 1.6  # distance of the masses of the chain in Fig. 27; a mass is 1 wide


def draw_frame(structure: Structure) -> Figure:
    """Fig. 26: floors with mass m and displacement q, columns with length l or stiffness k."""
    masses, numbers = structure.floor_masses, structure.numbers
    # not to scale where only stiffnesses are given
    heights = [structure.heights.get(f"drift{z + 1}", Crisp(3.0)) for z in range(len(masses))]
    lengths = [height.nominal for height in heights]
    height, level = sum(lengths), 0.0  # of the frame, and of the floor below, in m
    span = 0.45 * max(height, 6.0) if len(lengths) < 5 else 0.3 * height
    inches = min(9.0, 1.4 + 0.5 * height, 2.31 * height / span)
    figure, axes = plt.subplots(figsize=(1.9 * inches * span / height, inches))
    draw_ground(axes, (-0.1 * span, 1.1 * span), (-0.03 * span, 0))
    for floor, (length, mass) in enumerate(zip(lengths, masses, strict=True), start=1):
        words = f"$l_{{{floor}}}$ = {length:.2f} m"
        if (stiffness := numbers.get(f"k{floor}")) is not None:
            words = f"$k_{{{floor}}}$ = {stiffness.nominal / 1e6:.4g} MN/m"
        for x in (0.0, span):
            axes.plot([x, x], [level, level + length], color=INK, lw=1.4)
        axes.annotate(words, (-0.06 * span, level + length / 2), ha="right", fontsize=8)
        level += length
        axes.plot([-0.03 * span, 1.03 * span], [level, level], color=INK, lw=6)
        above: Look = {"xytext": (0, 6), "textcoords": "offset points", "ha": "center"}
        words = f"$m_{{{floor}}}$ = {mass.nominal / 1000:g} t"
        axes.annotate(words, (span / 2, level), fontsize=8, **above)
        axes.annotate("", (1.32 * span, level), (1.08 * span, level), arrowprops=ARROW)
        axes.annotate(f"$q_{{{floor}}}$", (1.35 * span, level), va="center", color=ORANGE)
    set_to_scale(axes, (-0.6 * span, 1.55 * span), (-0.05 * height, 1.08 * height))
    return figure


def draw_chain(structure: Structure) -> Figure:
    """Fig. 27: the frame as a chain of masses and springs, with its dampers if it has any."""
    floors = structure.model.floors
    dampers = [structure.numbers[f"d{floor}"] for floor in range(1, floors + 1)]
    has_dampers = any(damper.support.upper > 0 for damper in dampers)
    placement = getattr(structure.model, "damper_placement", None) if has_dampers else None
    foot = -0.9 if placement == "ground" else -0.5
    right, width = PITCH * floors + 0.2, min(12.0, 2.2 + 1.5 * floors)  # of the axes, in inches
    height = 2.15 * width / (PITCH * floors + 0.5) + 0.1
    figure, axes = plt.subplots(figsize=(width, height))
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
    inner = np.linspace(start + 0.15 * (left - start), left - 0.15 * (left - start), 10)
    zigzag = 0.2 + 0.1 * np.array([0, 1, -1, 1, -1, 1, -1, 1, -1, 0])
    axes.plot([start, *inner, left], [0.2, *zigzag, 0.2], color=BLUE, lw=1.2)
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
    axes.set(xlim=across, ylim=up, aspect="equal")
    axes.axis("off")


def draw_ground(axes: Axes, across: Point, up: Point) -> None:
    """Draws a rectangle that stands for the ground."""
    axes.fill_between(across, *up, hatch="////", facecolor="white", edgecolor=GREY, lw=0)


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


DURATION = 5.0  # s
TITLES = (
    "initial guess, the nominal trajectory",
    "optimum of the Taylor model, new trajectories",
    "at a later node the best stored one is the guess",
    "bounds left by the sweep, and the best of all",
    "the discrete fuzzy mapping",
)
STORED: Look = {"color": GREY, "lw": 0.5}
GUESS, NEW, ENVELOPE = ({"color": colour, "lw": 1.3} for colour in (BLUE, ORANGE, INK))
NODE: Look = {"color": INK, "lw": 0.8, "ls": ":"}
LINES: dict[str, Look] = {
    "stored trajectory": STORED,
    "new trajectory": NEW,
    "guess, or bound left by the sweep": GUESS,
    "envelope": ENVELOPE,
    "node that is treated": NODE,
}


def graph_follower_steps(results: Results, task: EnvelopeTask) -> Figure:
    """Figs. 21 to 25: five steps of the Graph Follower, for one output at the lowest level.

    A graph is the trajectory of one point of the inputs. At each node (of time) and side (lower,
    upper) the follower guesses the best stored graph, and may compute a new one.
    """
    run, column = followed_run(results, task)
    flow, points = run.storage.flow, run.storage.points
    time, graphs = flow.time, flow.values(points)[..., column]  # (T,), (graphs, T)
    guess, new = run.guess[0, :, column], run.new[0, :, column]  # graphs by (node, side); −1: none
    computed = np.argwhere(new >= 0)  # (node, side) of each new graph
    first_node = computed[0, 0]
    first_graphs = new[first_node][new[first_node] >= 0]
    late = computed[(computed[:, 0] > 0.5 * len(time)) & (guess[*computed.T] > 0)]
    node, side = late[0] if len(late) else computed[-1]
    # what the sweep knew at each node: the guess, and the new graph if there is one
    nodes = np.arange(len(time))[:, None]
    swept = np.stack([graphs[guess, nodes], graphs[np.where(new < 0, guess, new), nodes]])
    bounds = np.stack([swept[..., 0].min(0), swept[..., 1].max(0)])
    envelope = np.stack([graphs.min(0), graphs.max(0)])
    figure, mosaic = plt.subplot_mosaic("12;34;55", figsize=(8.4, 8.4), sharex=True, sharey=True)
    panels = [mosaic[letter] for letter in "12345"]
    drawn: list[tuple[int, Array, Look]] = [
        (0, graphs[:1], GUESS),
        (1, graphs[:1], STORED),
        (1, graphs[first_graphs], NEW),
        (2, graphs[: new[node, side]], STORED),
        (2, graphs[new[node, side]][None], NEW),
        (2, graphs[guess[node, side]][None], GUESS),
        (3, graphs, STORED),
        (3, bounds, GUESS),
        (3, envelope, ENVELOPE),
        (4, envelope, ENVELOPE),
    ]
    for panel, curves, look in drawn:
        panels[panel].plot(time, curves.T, **look)
    for panel, marked in enumerate((first_node, first_node, node)):
        panels[panel].axvline(time[marked], **NODE)
    panels[4].fill_between(time, *envelope, color=BLUE, alpha=0.2, lw=0)
    for number, (axes, title) in enumerate(zip(panels, TITLES, strict=True), start=1):
        label = f"Fig. {20 + number}" if results.is_paper else number
        axes.set_title(f"{label}: {title}", fontsize=9)
    panels[4].set_xlabel("time t (s)")
    output = flow.outputs[column]
    for axes in panels[::2]:
        prefix_axis(axes, output, Output(output).unit)
    lines = [Line2D([], [], label=words, **look) for words, look in LINES.items()]
    figure.legend(handles=lines, loc="outside lower center", ncols=3)
    return figure


def followed_run(results: Results, task: EnvelopeTask) -> tuple[Followed, int]:
    """Bounds and graphs of a Graph Follower at α = 0; the column of the highest displacement."""
    structure, step = results.structure, task.section.step
    assert structure is not None
    cuts, tolerance = boxes(structure.inputs(task.fuzzy), (0.0,)), task.tolerance(structure)
    steps = max(1, min(round(DURATION / step), round(task.duration / step)))
    motion = make_flow(structure.model, cuts.names, steps * step, step, "midpoint")
    flow = UnitFlow(motion, cuts, not tolerance.unit)
    column = max(0, len([name for name in flow.outputs if name.startswith("q")]) - 1)
    for refinement in (1.0, 1e-2, 1e-4, 1e-8):  # until a new graph is computed, to have one to show
        gain = refinement * task.section.gain * tolerance.value
        run = GraphFollower(tolerance=gain).follow(flow)
        if (run.new[0, :, column] >= 0).any():
            break
    return run, column
