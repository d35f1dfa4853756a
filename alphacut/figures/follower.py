"""The Graph Follower step by step on the case's own structure (counterparts of Figs. 21 to 25)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from alphacut.figures.style import BLUE, GREY, INK, ORANGE, Look, prefix_axis
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.methods.follower_record import FollowerRecord, record_flow
from alphacut.frame.structures.quantities import Output
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DURATION = 5.0  # s
TITLES = (
    "initial guess, the modal graph",
    "optimum of the Taylor model, new graphs",
    "at a later node the best stored graph is the guess",
    "bounds left by the sweep, and the best of all graphs",
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

    walk, output = recorded(results, task)
    drawn, named = plt.subplot_mosaic("12;34;55", figsize=(8.4, 8.4), sharex=True, sharey=True)
    panels = [named[letter] for letter in "12345"]
    new = [step for step in walk.steps if step.new >= 0]
    first = [step for step in new if step.node == new[0].node]
    later = next(
        (step for step in new if step.node > 0.5 * len(walk.time) and step.guess > 0), new[-1]
    )
    base(panels[0], walk, [0], node=first[0].node, last=0)
    panels[0].plot(walk.time, walk.graphs[0], color=BLUE, lw=1.3)
    base(panels[1], walk, [0, *(step.new for step in first)], node=first[0].node, last=len(first))
    base(panels[2], walk, range(later.new + 1), node=later.node, last=1)
    panels[2].plot(walk.time, walk.graphs[later.guess], color=BLUE, lw=1.3)
    base(panels[3], walk, range(len(walk.graphs)), node=None, last=0)
    for local, final in ((walk.local_lower, walk.lower), (walk.local_upper, walk.upper)):
        panels[3].plot(walk.time, local, color=BLUE, lw=1.0)
        panels[3].plot(walk.time, final, color=INK, lw=1.3)
    panels[4].fill_between(walk.time, walk.lower, walk.upper, color=BLUE, alpha=0.2, lw=0)
    for final in (walk.lower, walk.upper):
        panels[4].plot(walk.time, final, color=INK, lw=1.3)
    for number, (panel, title) in enumerate(zip(panels, TITLES, strict=False), start=1):
        panel.set_title(
            f"{f'Fig. {20 + number}' if results.is_paper else number}: {title}",
            loc="left",
            fontsize=9,
        )
    panels[4].set_xlabel("time t (s)")
    for panel in panels[::2]:
        prefix_axis(panel, output, Output(output).unit)
    lines = [Line2D([], [], label=words, **look) for words, look in LINES.items()]
    drawn.legend(handles=lines, fontsize=8, loc="outside lower center", ncols=3)
    return drawn


def base(
    panel: Axes, walk: FollowerRecord, graphs: range | list[int], *, node: int | None, last: int
) -> None:
    """Stored graphs in grey, the newest `last` of them in orange, and the node under treatment."""
    shown = list(graphs)
    for index, graph in enumerate(shown):
        fresh = index >= len(shown) - last
        panel.plot(
            walk.time, walk.graphs[graph], color=ORANGE if fresh else GREY, lw=1.3 if fresh else 0.4
        )
    if node is not None:
        panel.axvline(walk.time[node], color=INK, lw=0.8, ls=":")


def recorded(results: Results, task: EnvelopeTask) -> tuple[FollowerRecord, str]:
    """A run of the Graph Follower that keeps every step, and the output it followed."""
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
        walk = record_flow(flow, output=output, tolerance=fine)
        if any(step.new >= 0 for step in walk.steps):
            break
    return walk, flow.outputs[output]
