"""Envelopes (Figs. 28 to 35), the fuzzy mapping behind them (Fig. 20), inputs identified."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import partial
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from alphacut.figures import style
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.arrays import Array
from alphacut.io.quantity import engineering
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.identify import IdentifiedResult
from alphacut.stages.results import Results
from alphacut.stages.suite import SuiteResult
from alphacut.stochastic.figures.style import BLUE, GREY, INK, ORANGE

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def drawings(task: EnvelopeTask, results: Results) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Yields the name of each figure of a study, one an output, and the function that draws it."""
    dataset, structure = results.envelopes[task.name].arrays, results.structure
    assert structure is not None
    for name in task.figures or map(str, dataset["output"].values):
        output = Output(name, structure.unit(name))
        number = f"fig{task.figures[output]}-" if output in task.figures else ""
        yield f"{number}envelope-{task.name}-{output}", partial(envelope, dataset, output, task)


def envelope(dataset: xarray.Dataset, output: Output, task: EnvelopeTask) -> Figure:
    """Draws the bands between lower and upper envelope of an output, by level, and their errors."""
    figure, axes = style.figure()
    shown = dataset.sel(output=str(output))
    alpha, time = dataset["alpha"].values, dataset["time"].values
    for level, shade in enumerate(style.colours(alpha)[:-1]):
        band = shown.isel(alpha=level)
        axes.fill_between(time, band["lower"], band["upper"], color=shade, lw=0)
    for side in ("lower", "upper"):
        axes.plot(time, shown.isel(alpha=-1)[side], color=INK, lw=0.8)
        axes.plot(time, shown.isel(alpha=0)[side], color=INK, lw=0.3)
    nature = str(dataset.attrs["nature"])
    error = draw_error_band(axes, time, shown.isel(alpha=0), nature, output.unit)
    time_axes(axes, time, output)
    title = f"{output.words}; fuzzy: {', '.join(task.fuzzy)}; {nature}{error}"
    style.title(axes, fill(re.sub(r"(?<=\d) ", "\u00a0", title), 80))  # keeps units by numbers
    style.alpha_legend(axes, alpha)
    return figure


def draw_error_band(axes: Axes, time: Array, lowest: xarray.Dataset, nature: str, unit: str) -> str:
    """Draws the declared error around a band; returns it as text, empty for guaranteed bounds."""
    if "error" not in lowest or nature == "guaranteed":
        return ""
    error = lowest["error"]
    for end in (lowest["lower"] - error, lowest["upper"] + error):
        axes.plot(time, end, color=GREY, lw=0.7, ls="--")
    return f", ± {engineering(float(error.max()), unit, digits=2)} (dashed)"


def time_axes(axes: Axes, time: Array, output: Output) -> None:
    """Axes of an output over time."""
    axes.set(xlim=(time[0], time[-1]), xlabel="time t (s)")
    name = output.words.removesuffix(f" ({output})")
    style.prefix_axis(axes, name, output.unit)


def mapping(results: Results, *, count: int = 40, duration: float = 5.0) -> Figure:
    """Fig. 20: `count` motions of random inputs in the lowest cut, and the envelope around them."""
    task = next((x for x in results.tasks if len(x.fuzzy) > 1), results.tasks[0])
    dataset, structure = results.envelopes[task.name].arrays.isel(alpha=0), results.structure
    assert structure is not None
    names = [str(name) for name in dataset["output"].values]
    output = names[-1] if "q" in names[-1] else names[0]  # the last one if it is a displacement
    inputs, step = structure.inputs(task.fuzzy), task.section.step
    end = round(min(duration, task.duration) / step) * step
    scheme = task.section.integrator or ("exact" if structure.frame else "midpoint")
    flow = make_flow(structure.model, tuple(inputs), end, step, scheme)
    lower, upper = np.array([x.cut(float(dataset["alpha"])) for x in inputs.values()]).T
    points = np.random.default_rng(0).uniform(lower, upper, (count, len(inputs)))
    curves = flow.values(points)[:, :, list(flow.outputs).index(output)]
    figure, axes = style.figure()
    axes.plot(flow.time, curves.T, color=BLUE, lw=0.5, alpha=0.5)
    shown = dataset.sel(output=output).isel(time=slice(0, len(flow.time)))
    for side in ("lower", "upper"):
        axes.plot(flow.time, shown[side], color=INK, lw=1.3)
    time_axes(axes, flow.time, Output(output, structure.unit(output)))
    level = f"α = {float(dataset['alpha']):g}"
    style.title(axes, f"{output} at {level}: {count} random motions (blue) and their envelope")
    return figure


def identified_inputs(result: IdentifiedResult) -> Figure:
    """Draws each input's prior interval and its identified cuts, over the prior's middle."""
    names, alpha = list(result.inputs), result.alpha
    figure, axes = style.figure(height=0.9 + 0.32 * len(names))
    rows = np.arange(len(names), dtype=float)[::-1]
    prior = np.array([result.prior[name] for name in names], float)  # (inputs, 2)
    middles = prior.mean(axis=1)[:, None]
    before = prior / middles
    wide: style.Look = {"height": 0.7, "color": GREY, "alpha": 0.45, "label": "before"}
    axes.barh(rows, np.ptp(before, axis=1), left=before[:, 0], lw=0, **wide)
    cuts = result.inputs.values()
    lower, upper = (
        np.array([getattr(x, end) for x in cuts]) / middles for end in ("lower", "upper")
    )
    for k, level in enumerate(alpha):
        label = f"after, α = {level:g}" if k in (0, len(alpha) - 1) else None
        bar: style.Look = {"height": 0.5 - 0.3 * level, "alpha": 0.35 + 0.6 * level, "label": label}
        widths = upper[:, k] - lower[:, k]
        axes.barh(rows, widths, left=lower[:, k], lw=0, color=BLUE, **bar)
    axes.set_yticks(rows, names)
    axes.set_xlabel("value over the middle of what it was before")
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def spectra(suite: SuiteResult) -> Figure:
    """Draws the response spectra of the records of a suite, their mean, and T1."""
    figure, axes = style.figure(7.2, 3.6)
    periods = suite.spectra["period_s"]
    curves = np.array([suite.spectra[name] for name in suite.records])
    axes.plot(periods, curves.T, color=GREY, lw=0.6)
    axes.plot(periods, curves.mean(0), color=BLUE, lw=1.6, label="mean")
    axes.axvline(suite.period_s, color=ORANGE, lw=1.2, ls="--", label="T1")
    axes.set(
        xscale="log", xlabel="period [s]", ylabel=f"Sa [m/s²], damping {suite.damping_ratio:.3g}"
    )
    axes.legend(fontsize=8)
    return figure
