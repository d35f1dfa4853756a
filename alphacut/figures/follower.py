"""The Graph Follower step by step on the case's own structure (counterparts of Figs. 21 to 25)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from alphacut.figures.style import BLUE, GREY, INK, ORANGE, prefix_axis
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


def follower(results: Results, study: EnvelopeTask) -> Figure:
    """Five panels: from the first guess to the envelope, for one output at the lowest level."""
    import matplotlib.pyplot as plt

    found, output = recorded(results, study)
    drawn, named = plt.subplot_mosaic("12;34;55", figsize=(8.4, 8.4), sharex=True, sharey=True)
    panels = [named[letter] for letter in "12345"]
    new = [step for step in found.steps if step.found >= 0]
    first = [step for step in new if step.node == new[0].node]
    later = next(
        (step for step in new if step.node > 0.5 * len(found.time) and step.guess > 0), new[-1]
    )
    base(panels[0], found, [0], node=first[0].node, last=0)
    panels[0].plot(found.time, found.graphs[0], color=BLUE, lw=1.3)
    base(
        panels[1], found, [0, *(step.found for step in first)], node=first[0].node, last=len(first)
    )
    base(panels[2], found, range(later.found + 1), node=later.node, last=1)
    panels[2].plot(found.time, found.graphs[later.guess], color=BLUE, lw=1.3, label="guess")
    panels[2].legend(loc="lower right", fontsize=8)
    base(panels[3], found, range(len(found.graphs)), node=None, last=0)
    for local, final in ((found.local_lower, found.lower), (found.local_upper, found.upper)):
        panels[3].plot(found.time, local, color=BLUE, lw=1.0)
        panels[3].plot(found.time, final, color=INK, lw=1.3)
    panels[4].fill_between(found.time, found.lower, found.upper, color=BLUE, alpha=0.2, lw=0)
    for final in (found.lower, found.upper):
        panels[4].plot(found.time, final, color=INK, lw=1.3)
    for number, (panel, title) in enumerate(zip(panels, TITLES, strict=False), start=1):
        panel.set_title(
            f"{f'Fig. {20 + number}' if results.is_paper else number}: {title}",
            loc="left",
            fontsize=9,
        )
    panels[4].set_xlabel("time t, s")
    for panel in panels[::2]:
        prefix_axis(panel, output, Output(output).unit)
    return drawn


def base(
    panel: Axes, found: FollowerRecord, graphs: range | list[int], *, node: int | None, last: int
) -> None:
    """Stored graphs in grey, the newest `last` of them in orange, and the node under treatment."""
    shown = list(graphs)
    for index, graph in enumerate(shown):
        fresh = index >= len(shown) - last
        panel.plot(
            found.time,
            found.graphs[graph],
            color=ORANGE if fresh else GREY,
            lw=1.3 if fresh else 0.4,
        )
    if node is not None:
        panel.axvline(found.time[node], color=INK, lw=0.8, ls=":")


def recorded(results: Results, study: EnvelopeTask) -> tuple[FollowerRecord, str]:
    """A run of the Graph Follower that keeps every step, and the output it followed."""
    wanted = results.structure
    assert wanted is not None
    cuts = boxes(wanted.inputs(study.fuzzy), (0.0,))
    steps = max(
        1, min(round(DURATION / study.section.step), round(study.duration / study.section.step))
    )
    flow = UnitFlow(
        wanted.flow(cuts.names, steps * study.section.step, study.section.step),
        cuts,
        not study.tolerance(wanted).unit,
    )
    output = max(0, len([name for name in flow.outputs if name.startswith("q")]) - 1)
    for share in (1.0, 1e-2, 1e-4, 1e-8):  # fine enough that there is something to see
        fine = share * study.section.gain * study.tolerance(wanted).value
        found = record_flow(flow, output=output, tolerance=fine)
        if any(step.found >= 0 for step in found.steps):
            break
    return found, flow.outputs[output]
