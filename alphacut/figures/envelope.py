"""Envelopes over time (Figs. 28 to 35), exceedance of a limit, the record and its spectrum."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from alphacut.figures import style as look
from alphacut.figures.captions import INPUTS
from alphacut.frame.structures.linear import Accelerogram
from alphacut.frame.structures.quantities import Output
from alphacut.io.units import engineering
from alphacut.stages.envelope import EnvelopeTask

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


def drawings(
    study: EnvelopeTask, dataset: xarray.Dataset
) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Name and function of each figure of a study."""
    outputs = [study.output] if study.output else [str(name) for name in dataset["output"].values]
    for index, output in enumerate(outputs):
        number = f"fig{study.figures[index]}-" if index < len(study.figures) else ""
        yield f"{number}envelope-{study.name}-{output}", partial(envelope, dataset, output, study)


def envelope(dataset: xarray.Dataset, output: str, study: EnvelopeTask) -> Figure:
    """Nested bands between lower and upper envelope, and the modal trajectory."""
    drawn, axes = look.figure(7.2, 3.6)
    shown = dataset.sel(output=output)
    alpha, time = dataset["alpha"].values, dataset["time"].values
    for level, shade in enumerate(look.colours(alpha)[:-1]):
        band = shown.isel(alpha=level)
        axes.fill_between(time, band["lower"], band["upper"], color=shade, lw=0)
    for side in ("lower", "upper"):
        axes.plot(time, shown.isel(alpha=-1)[side], color=look.INK, lw=0.8)
        axes.plot(time, shown.isel(alpha=0)[side], color=look.INK, lw=0.3)
    axes.set_xlabel("time t, s")
    look.prefix_axis(axes, output, Output(output).unit)
    axes.set_xlim(time[0], time[-1])
    # letters mean something else in a pendulum
    known = INPUTS if output.startswith(("q", "v", "a", "drift", "shear", "base", "roof")) else {}
    words = ", ".join(known.get(name, name) for name in study.fuzzy)
    title = f"{Output(output).words}; fuzzy: {words}"
    axes.set_title(fill(title, 84), loc="left", fontsize=10)
    look.alpha_legend(axes, alpha, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return drawn


def record(ground: Accelerogram) -> Figure:
    """The record as it is read, its peak marked."""
    drawn, axes = look.figure(7.2, 2.4)
    acceleration = np.asarray(ground.acceleration)
    time, peak = np.arange(len(acceleration)) * ground.step, int(np.abs(acceleration).argmax())
    axes.plot(time, acceleration, color=look.INK, lw=0.7)
    axes.plot(time[peak], acceleration[peak], "o", color=look.ORANGE, ms=4)
    strongest = engineering(float(acceleration[peak]), "m/s^2", digits=3).replace("^2", "²")
    axes.set_title(f"peak {strongest} at {time[peak]:.4g} s", loc="left", fontsize=10)
    axes.set_xlabel("time t, s")
    axes.set_ylabel("ground acceleration, m/s²")
    axes.set_xlim(time[0], time[-1])
    return drawn


SPECTRUM_LINES = [
    (colour, dash)
    for dash in ("-", "--", ":")
    for colour in (look.INK, look.BLUE, look.ORANGE, look.PURPLE, look.GREY)
]


TICKS = [digit * 10.0**power for power in range(-3, 4) for digit in (1, 2, 5)]
