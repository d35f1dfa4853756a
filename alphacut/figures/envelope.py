"""Envelopes (Figs. 28 to 35), the fuzzy mapping (Fig. 20), identified inputs, and answers."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from textwrap import fill
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from alphacut.base.arrays import Array
from alphacut.base.number_text import ShownUnit
from alphacut.figures import style
from alphacut.figures.style import BLUE, GREY, INK, ORANGE, WIDTH
from alphacut.frame import Decision, Fragility, LearnedInputs, Probability, Tolerances
from alphacut.frame.analyses.decision import degree_text
from alphacut.frame.analyses.fragility import LimitFragility
from alphacut.frame.analyses.peaks import Peak
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.result import Ends
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.summary import Parts, Results

FIT: style.Look = {"color": ORANGE, "lw": 1.2, "ls": ":"}
"""Line of a lognormal fit."""


def drawings(task: EnvelopeTask, results: Results) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Yields the name of each figure of a study, one an output, and the function that draws it."""
    dataset, structure = results.envelopes[task.name].arrays, results.structure
    assert structure is not None
    parts = Parts.of(results)
    peaks = parts.envelopes[task.name].peak
    for name in task.figures or map(str, dataset["output"].values):
        output = Output(name, structure.unit(name))
        number = f"fig{task.figures[output]}-" if output in task.figures else ""
        yield (
            f"{number}envelope-{task.name}-{output}",
            partial(envelope, dataset, output, task, parts.shown_units[name], peak=peaks.get(name)),
        )


def envelope(
    dataset: xarray.Dataset,
    output: Output,
    task: EnvelopeTask,
    unit: ShownUnit,
    *,
    peak: Peak | None = None,
) -> Figure:
    """Draws the bands between lower and upper envelope of an output, by level, and their errors.

    The title states the error of the output's `peak`, as the table of peaks does, where it is
    given.
    """
    figure, axes = plt.subplots()
    shown = dataset.sel(output=str(output))
    alpha, time = dataset["alpha"].values, dataset["time"].values
    for level, shade in enumerate(style.colours(alpha)[:-1]):
        band = shown.isel(alpha=level)
        axes.fill_between(time, band["lower"], band["upper"], color=shade, lw=0)
    for side in ("lower", "upper"):
        axes.plot(time, shown.isel(alpha=-1)[side], color=INK, lw=0.8)
        axes.plot(time, shown.isel(alpha=0)[side], color=INK, lw=0.3)
    nature = str(dataset.attrs["nature"])
    error = draw_error_band(axes, time, shown.isel(alpha=0), nature, unit)
    if error and peak is not None:  # which contains what lies between nodes
        error = f", peak ± {unit.text(float(peak.error.max()), digits=2)} (at nodes dashed)"
    time_axes(axes, time, output, unit)
    title = f"{output.words}; fuzzy: {', '.join(task.fuzzy)}; {nature}{error}".replace("^2", "²")
    axes.set_title(fill(re.sub(r"(?<=\d) ", "\u00a0", title), 80))  # keeps units by numbers
    style.alpha_legend(axes, alpha)
    return figure


def draw_error_band(
    axes: Axes, time: Array, lowest: xarray.Dataset, nature: str, unit: ShownUnit
) -> str:
    """Draws the declared error around a band; returns it as text, empty where none is estimated."""
    if "error" not in lowest or nature != "estimated":
        return ""
    error = lowest["error"]
    for end in (lowest["lower"] - error, lowest["upper"] + error):
        axes.plot(time, end, color=GREY, lw=0.7, ls="--")
    return f", ± {unit.text(float(error.max()), digits=2)} (dashed)"


def time_axes(axes: Axes, time: Array, output: Output, unit: ShownUnit) -> None:
    """Axes of an output over time, in the unit in which it is shown."""
    axes.set(xlim=(time[0], time[-1]), xlabel="time t (s)")
    words = output.words.removesuffix(f" ({output})")
    style.prefix_axis(axes, words, output.unit, shown=unit)


def mapping(results: Results) -> Figure:
    """Fig. 20: 40 motions of random inputs in the lowest cut for 5 s, and their envelope."""
    task = next((x for x in results.tasks if len(x.fuzzy) > 1), results.tasks[0])
    dataset, structure = results.envelopes[task.name].arrays.isel(alpha=0), results.structure
    assert structure is not None
    names = [str(name) for name in dataset["output"].values]
    output = names[-1] if "q" in names[-1] else names[0]  # the last one if it is a displacement
    inputs, step = structure.inputs(task.fuzzy), task.section.step
    end = round(min(5.0, task.duration) / step) * step
    flow = make_flow(structure.model, tuple(inputs), end, step, task.section.integrator)
    lower, upper = np.array([x.cut(float(dataset["alpha"])) for x in inputs.values()]).T
    points = np.random.default_rng(0).uniform(lower, upper, (40, len(inputs)))
    curves = flow.values(points)[:, :, list(flow.outputs).index(output)]
    figure, axes = plt.subplots()
    axes.plot(flow.time, curves.T, color=BLUE, lw=0.5, alpha=0.5)
    shown = dataset.sel(output=output).isel(time=slice(0, len(flow.time)))
    for side in ("lower", "upper"):
        axes.plot(flow.time, shown[side], color=INK, lw=1.3)
    unit = Parts.of(results).shown_units[output]
    time_axes(axes, flow.time, Output(output, structure.unit(output)), unit)
    level = f"α = {float(dataset['alpha']):g}"
    axes.set_title(f"{output} at {level}: {len(points)} random motions (blue) and their envelope")
    return figure


def draw_bars(
    intervals: Sequence[tuple[Array, style.Look]], names: Iterable[str], label: str
) -> Figure:
    """Draws intervals of inputs as bars, a row an input; each series (inputs, 2) has its look."""
    rows = np.arange(len(intervals[0][0]), dtype=float)[::-1]
    figure, axes = plt.subplots(figsize=(WIDTH, 0.9 + 0.36 * len(rows)))
    for ends, look in intervals:
        axes.barh(rows, np.ptp(ends, axis=1), left=ends[:, 0], lw=0, **look)
    axes.set_yticks(rows, list(names))
    axes.set_xlabel(label)
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def identified_inputs(result: LearnedInputs) -> Figure:
    """Draws each input's prior interval and its identified cuts, over the prior's middle."""
    alpha, prior = result.alpha, np.array([result.prior[name] for name in result.inputs], float)
    middles = prior.mean(axis=1)[:, None]
    look: style.Look = {"height": 0.7, "color": GREY, "alpha": 0.45, "label": "before"}
    intervals = [(prior / middles, look)]
    for k, level in enumerate(alpha):
        label = f"after, α = {level:g}" if k in (0, len(alpha) - 1) else None
        look = {"height": 0.5 - 0.3 * level, "alpha": 0.35 + 0.6 * level, "label": label}
        cuts = np.array([(ends.lower[k], ends.upper[k]) for ends in result.inputs.values()])
        intervals.append((cuts / middles, {"color": BLUE, **look}))
    return draw_bars(intervals, result.inputs, "value over the middle of what it was before")


def draw_decision(answer: Decision) -> Figure:
    """Draws bars from the smallest to the largest peak over its limit, of each limit and level."""
    limits = [limit for limit in answer.limits.values() if limit.peak is not None]
    figure, axes = plt.subplots(figsize=(WIDTH, 1.2 + 0.7 * len(limits)))
    alpha, rows = answer.alpha, np.arange(len(limits))[::-1]  # the first limit on top
    for row, limit in zip(rows, limits, strict=True):
        margins = np.concatenate([limit.margin.lower, limit.margin.upper])
        # of a limit of zero the largest margin has length 1
        largest = np.abs(margins[np.isfinite(margins)]).max(initial=1e-300)
        size = abs(limit.limit) or float(largest)
        # margin = limit − peak, so that the largest margin belongs to the smallest peak
        lefts, rights = 1 - limit.margin.upper / size, 1 - limit.margin.lower / size
        look: style.Look = {"height": 0.66 - 0.4 * alpha, "color": style.colours(alpha), "lw": 0}
        axes.barh(row, rights - lefts, left=lefts, **look)
        possible, necessary = degree_text(limit.possibility), degree_text(limit.necessity)
        degrees = f"possible to {possible}, necessary to {necessary}"
        text = f"{limit.verdict_words} ({answer.nature_text(limit.nature)}): {degrees}"
        axes.text(0.01, row + 0.4, text, fontsize=8, transform=axes.get_yaxis_transform())
    axes.axvline(1.0, color=ORANGE, lw=1.4, ls="--")
    axes.axvline(0.0, color=GREY, lw=0.4)
    axes.set_ylim(-0.5, len(limits) - 0.2)
    axes.set_yticks(rows, [limit.words for limit in limits], color=INK)
    axes.set_xlabel("peak over its limit (dashed); the darker the higher α")
    return figure


def draw_bands(axes: Axes, x: Array, bands: Ends, alpha: Array, *, in_steps: bool = False) -> None:
    """Draws lower and upper bounds (levels, x) of a probability over x; the highest as lines."""
    band: style.Look = {"step": "post"} if in_steps else {}
    line: style.Look = {"drawstyle": "steps-post"} if in_steps else {}
    levels = zip(bands.lower[:-1], bands.upper[:-1], style.colours(alpha)[:-1], strict=True)
    for low, high, shade in levels:
        axes.fill_between(x, low, high, color=shade, lw=0, **band)
    for end in (bands.lower[-1], bands.upper[-1]):  # which agree where its band has no width
        axes.plot(x, end, color=INK, lw=1, **line)
    axes.set_ylim(0, 1.02)


def draw_probability(answer: Probability) -> Figure:
    """Draws the bounds of the exceedance probability of the last event over its limit, by level."""
    event = [*answer.events.values()][-1]
    limits, limit_text = event.curve.limit, "1" if event.is_event else event.value_words
    is_near = event.limit <= 2 * limits[-1]
    figure, axes = plt.subplots()
    draw_bands(axes, limits, Ends(event.curve.lower, event.curve.upper), answer.alpha)
    style.alpha_legend(axes, answer.alpha)
    axes.set_title(f"limit {limit_text} ({'dashed' if is_near else 'far off'})".replace("^2", "²"))
    if is_near:
        axes.axvline(event.limit, color=ORANGE, lw=1.2, ls="--")
    axes.set_ylabel("probability of exceeding it")
    label = f"limit of |{event.output}|"
    if event.is_event:
        label = "all limits, over those of the case"
    style.prefix_axis(axes, label, event.unit, across=True, shown=event.stated_unit)
    return figure


def draw_tolerances(answer: Tolerances) -> Figure:
    """Draws the supports of the inputs over nominal values: in the case, and with no exceedance."""
    supports = answer.supports.values()
    nominal = np.array([[x.nominal or 1.0] for x in supports])
    stated = np.array([x.own for x in supports]) / nominal
    admissible = np.array([x.kept for x in supports]) / nominal
    intervals: list[tuple[Array, style.Look]] = [
        (stated, {"color": GREY, "height": 0.7, "label": "in the case"}),
        (admissible, {"color": BLUE, "height": 0.35, "label": "no limit exceeded"}),
    ]
    figure = draw_bars(intervals, answer.supports, "value over the nominal one")
    figure.axes[0].axvline(1.0, color=INK, lw=0.8)
    return figure


def draw_fragility(answer: Fragility) -> Figure:
    """Draws the bounds of the share of records that exceed each limit over their measure.

    A limit of all storeys is drawn as the event that any storey exceeds it.
    """
    shown = [part for part in answer.limits.values() if not part.event_name]
    size = WIDTH, 0.9 + 2.3 * len(shown)
    figure, panels = plt.subplots(len(shown), squeeze=False, figsize=size)
    for axes, part in zip(panels[:, 0], shown, strict=True):
        draw_fragility_of(axes, answer, part)
    fit = Line2D([], [], **FIT, label=f"lognormal fit\nat α = {answer.alpha[-1]:g}")
    style.alpha_legend(panels[0, 0], answer.alpha, [fit])
    return figure


def draw_fragility_of(axes: Axes, answer: Fragility, part: LimitFragility) -> None:
    """Draws the bands of one limit or event, and the lognormal fit on the highest level."""
    draw_bands(axes, part.measure, part.band, answer.alpha, in_steps=True)
    for curve in part.lognormal_fit(-1):
        axes.plot(part.measure, curve, **FIT)
    if part.confidence is not None:
        for end in part.confidence:
            axes.plot(part.measure, end[0], color=BLUE, lw=0.9, ls="--")
    axes.set_title(part.words.replace("^2", "²"))
    axes.set_ylabel("share of records")
    style.prefix_axis(axes, answer.measure, answer.unit, across=True)


def draw_incremental(answer: Fragility) -> Figure:
    """Draws least and greatest peak found over the measure, of each peak, record and level.

    A peak is drawn once with all its limits. In SVG its curves show their record's name on hover.
    """
    demands = answer.limits_by_demand
    size = WIDTH, 0.6 + 1.9 * len(demands)
    figure, panels = plt.subplots(len(demands), sharex=True, squeeze=False, figsize=size)
    for axes, (peak, names) in zip(panels[:, 0], demands.items(), strict=True):
        for record, increment in answer.increments.items():
            measure, (high, low) = increment.measure, answer.demand_curve(names[0], record)
            for level, shade in enumerate(style.colours(answer.alpha)):
                band: style.Look = {"color": shade, "lw": 0, "alpha": 0.7}
                filled = axes.fill_between(measure, low[level], high[level], **band)
                filled.set_gid(f"{style.HOVER}{record}")
            (line,) = axes.plot(measure, high[-1], color=INK, lw=0.7)
            line.set_gid(f"{style.HOVER}{record}")
        limits = [answer.limits[name] for name in names]
        for limit in limits:
            axes.axhline(limit.limit, color=ORANGE, lw=1.2, ls="--")
            axes.annotate(
                limit.value_words, (1.0, limit.limit), xycoords=("axes fraction", "data"),
                ha="right", va="bottom", fontsize=8, color=ORANGE,
            )  # fmt: skip
        largest, smallest = (pick(x.limit for x in limits) for pick in (max, min))
        axes.set_xlim(0.0, max(answer.limits[name].measure[-1] for name in names))
        axes.set_ylim(0.0, max(3 * smallest, 1.5 * largest))
        unit = limits[0].stated_unit
        style.prefix_axis(axes, f"peak of {peak}", limits[0].unit, shown=unit)
    style.prefix_axis(axes, answer.measure, answer.unit, across=True)
    panels[0, 0].set_title(f"{len(answer.increments)} records; limits dashed")
    style.alpha_legend(panels[0, 0], answer.alpha)
    return figure


DRAWINGS: dict[str, Callable[[Any], Figure]] = {
    "probability": draw_probability,
    "decision": draw_decision,
    "tolerances": draw_tolerances,
    "fragility": draw_fragility,
}
"""Drawing of the answer to each question, by the question's key."""
