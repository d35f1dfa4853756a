"""The Graph Follower step by step on the case's own structure (counterparts of Figs. 21 to 25)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from alphacut.figures.style import Look, prefix_axis
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.methods.graph_follower import Followed, GraphFollower
from alphacut.frame.structures.quantities import Output
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.results import Results
from alphacut.stochastic.figures.style import BLUE, GREY, INK, ORANGE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DURATION = 5.0  # s
TITLES = (
    "initial guess, the modal trajectory",
    "optimum of the Taylor model, new trajectories",
    "at a later node the best stored one is the guess",
    "bounds left by the sweep, and the best of all",
    "the discrete fuzzy mapping",
)
LINES: dict[str, Look] = {
    "stored trajectory": {"color": GREY, "lw": 0.8},
    "new trajectory": {"color": ORANGE, "lw": 1.3},
    "guess, or bound left by the sweep": {"color": BLUE, "lw": 1.3},
    "envelope": {"color": INK, "lw": 1.3},
    "node that is treated": {"color": INK, "lw": 0.8, "ls": ":"},
}


def graph_follower_steps(results: Results, task: EnvelopeTask) -> Figure:
    """Figs. 21 to 25: five steps of the Graph Follower, for one output at the lowest level.

    A graph is the trajectory of one point of the inputs. At each node (of time) and side (lower,
    upper) the follower guesses the best stored graph, and may compute a new one.
    """
    import matplotlib.pyplot as plt
    from matplotlib.lines import Line2D

    run, column = followed_run(results, task)
    flow, points = run.storage.flow, run.storage.points
    time, graphs = flow.time, flow.values(points)[..., column]  # (T,), (graphs, T)
    guess, new = run.guess[0, :, column], run.new[0, :, column]  # graphs by (node, side); −1: none
    lower, upper = graphs.min(0), graphs.max(0)
    figure, mosaic = plt.subplot_mosaic("12;34;55", figsize=(8.4, 8.4), sharex=True, sharey=True)
    panels = [mosaic[letter] for letter in "12345"]
    computed = np.argwhere(new >= 0)  # (node, side) of each new graph
    first_node = computed[0, 0]
    first_graphs = new[first_node][new[first_node] >= 0]
    late = computed[(computed[:, 0] > 0.5 * len(time)) & (guess[*computed.T] > 0)]
    node, side = late[0] if len(late) else computed[-1]

    def draw_graphs(panel: Axes, indices: Iterable[int], node: int | None, n_new: int) -> None:
        """Draws graphs in grey, the last `n_new` of them in orange, and marks a node."""
        shown = list(indices)
        for position, graph in enumerate(shown):
            is_new = position >= len(shown) - n_new
            colour, width = (ORANGE, 1.3) if is_new else (GREY, 0.4)
            panel.plot(time, graphs[graph], color=colour, lw=width)
        if node is not None:
            panel.axvline(time[node], color=INK, lw=0.8, ls=":")

    draw_graphs(panels[0], [0], first_node, 0)
    panels[0].plot(time, graphs[0], color=BLUE, lw=1.3)
    draw_graphs(panels[1], [0, *first_graphs], first_node, len(first_graphs))
    draw_graphs(panels[2], range(new[node, side] + 1), node, 1)
    panels[2].plot(time, graphs[guess[node, side]], color=BLUE, lw=1.3)
    draw_graphs(panels[3], range(len(graphs)), None, 0)
    nodes = np.arange(len(time))[:, None]
    # what the sweep knew at each node: the guess, and the new graph if there is one
    swept = np.stack([graphs[guess, nodes], graphs[np.where(new < 0, guess, new), nodes]])
    for bound, final in ((swept[..., 0].min(0), lower), (swept[..., 1].max(0), upper)):
        panels[3].plot(time, bound, color=BLUE, lw=1.0)
        panels[3].plot(time, final, color=INK, lw=1.3)
    panels[4].fill_between(time, lower, upper, color=BLUE, alpha=0.2, lw=0)
    for final in (lower, upper):
        panels[4].plot(time, final, color=INK, lw=1.3)
    for number, (panel, title) in enumerate(zip(panels, TITLES, strict=False), start=1):
        label = f"Fig. {20 + number}" if results.is_paper else number
        panel.set_title(f"{label}: {title}", loc="left", fontsize=9)
    panels[4].set_xlabel("time t (s)")
    output = flow.outputs[column]
    for panel in panels[::2]:
        prefix_axis(panel, output, Output(output).unit)
    lines = [Line2D([], [], label=words, **look) for words, look in LINES.items()]
    figure.legend(handles=lines, fontsize=8, loc="outside lower center", ncols=3)
    return figure


def followed_run(results: Results, task: EnvelopeTask) -> tuple[Followed, int]:
    """Bounds and graphs of a Graph Follower at α = 0; the column of the highest displacement."""
    structure, step = results.structure, task.section.step
    assert structure is not None
    cuts, tolerance = boxes(structure.inputs(task.fuzzy), (0.0,)), task.tolerance(structure)
    steps = max(1, min(round(DURATION / step), round(task.duration / step)))
    motion = make_flow(structure.model, cuts.names, steps * step, step)
    flow = UnitFlow(motion, cuts, not tolerance.unit)
    column = max(0, len([name for name in flow.outputs if name.startswith("q")]) - 1)
    for refinement in (1.0, 1e-2, 1e-4, 1e-8):  # until a new graph is computed, to have one to show
        gain = refinement * task.section.gain * tolerance.value
        run = GraphFollower(tolerance=gain).follow(flow)
        if (run.new[0, :, column] >= 0).any():
            break
    return run, column
