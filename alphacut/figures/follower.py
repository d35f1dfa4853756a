"""The Graph Follower step by step on the case's own structure (counterparts of Figs. 21 to 25)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from alphacut.figures.style import BLUE, GREY, INK, ORANGE, Look, prefix_axis
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.methods.graph_follower import Followed, GraphFollower
from alphacut.frame.structures.quantities import Output
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.results import Results

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


def follower(results: Results, task: EnvelopeTask) -> Figure:
    """Five panels: from the first guess to the envelope, for one output at the lowest level."""
    import matplotlib.pyplot as plt
    from matplotlib.lines import Line2D

    walk, column = recorded(results, task)
    flow, points = walk.storage.flow, walk.storage.points
    time, graphs = flow.time, flow.values(points)[..., column]
    guess, new = walk.guess[0, :, column], walk.new[0, :, column]  # by node and side
    lower, upper = graphs.min(0), graphs.max(0)
    figure, named = plt.subplot_mosaic("12;34;55", figsize=(8.4, 8.4), sharex=True, sharey=True)
    panels = [named[letter] for letter in "12345"]
    places = np.argwhere(new >= 0)
    start = places[0, 0]
    first = new[start][new[start] >= 0]
    late = places[(places[:, 0] > 0.5 * len(time)) & (guess[*places.T] > 0)]
    node, side = late[0] if len(late) else places[-1]

    def base(panel: Axes, shown: Iterable[int], node: int | None, last: int) -> None:
        """Stored graphs in grey, the newest `last` in orange, and the node under treatment."""
        rows = list(shown)
        for index, row in enumerate(rows):
            fresh = index >= len(rows) - last
            colour, width = (ORANGE, 1.3) if fresh else (GREY, 0.4)
            panel.plot(time, graphs[row], color=colour, lw=width)
        if node is not None:
            panel.axvline(time[node], color=INK, lw=0.8, ls=":")

    base(panels[0], [0], start, 0)
    panels[0].plot(time, graphs[0], color=BLUE, lw=1.3)
    base(panels[1], [0, *first], start, len(first))
    base(panels[2], range(new[node, side] + 1), node, 1)
    panels[2].plot(time, graphs[guess[node, side]], color=BLUE, lw=1.3)
    base(panels[3], range(len(graphs)), None, 0)
    nodes = np.arange(len(time))[:, None]
    seen = np.stack([graphs[guess, nodes], graphs[np.where(new < 0, guess, new), nodes]])
    for local, final in ((seen[..., 0].min(0), lower), (seen[..., 1].max(0), upper)):
        panels[3].plot(time, local, color=BLUE, lw=1.0)
        panels[3].plot(time, final, color=INK, lw=1.3)
    panels[4].fill_between(time, lower, upper, color=BLUE, alpha=0.2, lw=0)
    for final in (lower, upper):
        panels[4].plot(time, final, color=INK, lw=1.3)
    for number, (panel, title) in enumerate(zip(panels, TITLES, strict=False), start=1):
        panel.set_title(
            f"{f'Fig. {20 + number}' if results.is_paper else number}: {title}",
            loc="left",
            fontsize=9,
        )
    panels[4].set_xlabel("time t (s)")
    output = flow.outputs[column]
    for panel in panels[::2]:
        prefix_axis(panel, output, Output(output).unit)
    lines = [Line2D([], [], label=words, **look) for words, look in LINES.items()]
    figure.legend(handles=lines, fontsize=8, loc="outside lower center", ncols=3)
    return figure


def recorded(results: Results, task: EnvelopeTask) -> tuple[Followed, int]:
    """A run of the Graph Follower, and the column of the output drawn."""
    structure = results.structure
    assert structure is not None
    cuts = boxes(structure.inputs(task.fuzzy), (0.0,))
    steps = max(
        1, min(round(DURATION / task.section.step), round(task.duration / task.section.step))
    )
    flow = UnitFlow(
        structure.flow(cuts.names, steps * task.section.step, task.section.step),
        cuts,
        not task.tolerance(structure).unit,
    )
    output = max(0, len([name for name in flow.outputs if name.startswith("q")]) - 1)
    for share in (1.0, 1e-2, 1e-4, 1e-8):  # fine enough that there is something to see
        fine = share * task.section.gain * task.tolerance(structure).value
        walk = GraphFollower(tolerance=fine).follow(flow)
        if (walk.new[0, :, output] >= 0).any():
            break
    return walk, output
