"""Envelopes of outputs over time, one figure for each output of a study."""

from __future__ import annotations

import re
from textwrap import fill

import matplotlib.pyplot as plt
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from alphacut.base.arrays import Array
from alphacut.base.number_text import ShownUnit
from alphacut.figures import style
from alphacut.figures.style import GREY
from alphacut.frame.analyses.peaks import Peak
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.result import Ends, Nature
from alphacut.stages.envelope import EnvelopeTask


def envelope(
    dataset: xarray.Dataset,
    output: Output,
    task: EnvelopeTask,
    unit: ShownUnit,
    *,
    peak: Peak | None = None,
) -> Figure:
    """Draw the band between the lower and the upper envelope of an output on each α-level.

    Args:
        dataset: Envelopes of a study, with the axes alpha, output and time, in SI units.
        output: Output that is drawn, one of the dataset.
        task: The study, for the names of its fuzzy inputs.
        unit: Unit in which values are shown.
        peak: Peak of the output, whose error the title then states, as the table of peaks does.
    """
    figure, axes = plt.subplots()
    shown = dataset.sel(output=str(output))
    alpha = dataset["alpha"].values
    time = dataset["time"].values
    lower, upper = (shown[side].transpose("alpha", "time").values for side in ("lower", "upper"))
    style.draw_bands(axes, time, Ends(lower, upper), alpha, is_outlined=True)
    nature = Nature(dataset.attrs["nature"])
    error = ""
    # Guaranteed bounds contain their error, and the error of attained bounds is not known.
    if nature is Nature.ESTIMATED and "error" in dataset:
        error = draw_error_band(axes, time, shown.isel(alpha=0), unit)
        if peak is not None:  # its error contains what lies between nodes
            error = f", peak ± {unit.text(float(peak.error.max()), digits=2)} (at nodes dashed)"
    time_axes(axes, time, output, unit)
    title = f"{output.words}; fuzzy: {', '.join(task.fuzzy)}; {nature}{error}".replace("^2", "²")
    # A space that does not break keeps each unit in the line of its number.
    axes.set_title(fill(re.sub(r"(?<=\d) ", "\u00a0", title), 80))
    style.alpha_legend(axes, alpha)
    return figure


def draw_error_band(axes: Axes, time: Array, lowest: xarray.Dataset, unit: ShownUnit) -> str:
    """Draw the estimated error outside the bounds of the lowest level; return it as a text.

    Args:
        axes: Axes that are drawn on.
        time: Nodes, shape (T,), in s.
        lowest: Variables lower, upper and error of shape (T,), in SI units.
        unit: Unit in which the largest error is written.
    """
    error = lowest["error"]
    for end in (lowest["lower"] - error, lowest["upper"] + error):
        axes.plot(time, end, color=GREY, lw=0.7, ls="--")
    return f", ± {unit.text(float(error.max()), digits=2)} (dashed)"


def time_axes(axes: Axes, time: Array, output: Output, unit: ShownUnit) -> None:
    """Label the axes of an output over time, in the unit in which it is shown."""
    axes.set(xlim=(time[0], time[-1]), xlabel="time t (s)")
    words = output.words.removesuffix(f" ({output})")
    style.prefix_axis(axes, words, output.unit, shown=unit)
