"""Answers about a motion: limits, two values together, what to measure, what was learned."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.figures.style import (
    BLUE,
    GREY,
    INK,
    figure,
    prefix_axis,
)
from alphacut.frame.identify.possibility import widest
from alphacut.frame.structures.quantities import Output
from alphacut.io.units import MINUS
from alphacut.stages.identify import Learned

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


def _ticks(factor: float, value: float, _: int) -> str:
    return f"{value * factor:.10g}".replace("-", MINUS)


def bands(dataset: xarray.Dataset, output: str) -> Figure:
    """Envelope with the priors and with what was learned, at the lowest level."""
    drawn, axes = figure(7.2, 3.6)
    shown, time = dataset.sel(output=output).isel(alpha=0), dataset["time"].values
    for knowledge, colour, words in (("prior", GREY, "before"), ("posterior", BLUE, "after")):
        band = shown.sel(knowledge=knowledge)
        axes.fill_between(
            time,
            band["lower"],
            band["upper"],
            color=colour,
            lw=0,
            label=f"{words} the measurement",
            alpha=0.55 if knowledge == "prior" else 0.9,
        )
    axes.set_xlim(time[0], time[-1])
    axes.set_xlabel("time t, s")
    prefix_axis(axes, output, Output(output).unit)
    level = float(dataset["alpha"].values[0])
    axes.set_title(f"{output} at α = {level:g}", loc="left", fontsize=10)
    axes.legend(fontsize=8, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0))
    return drawn


def boxes(learned: Learned) -> Figure:
    """Each input's interval at every level over that of its prior, as shares of its modal value."""
    found = learned.posterior
    assert found is not None
    drawn, axes = figure(7.2, 0.9 + 0.32 * len(found.names))
    places = np.arange(len(found.names))[::-1]
    prior = np.array([widest(number) for number in learned.prior.values()])
    nominal = np.array([number.modal for number in learned.prior.values()])
    axes.barh(
        places,
        np.ptp(prior, axis=1) / nominal,
        left=prior[:, 0] / nominal,
        height=0.7,
        color=GREY,
        alpha=0.45,
        lw=0,
        label="prior",
    )
    for row, level in enumerate(found.alpha):
        width = (found.upper[row] - found.lower[row]) / nominal
        axes.barh(
            places,
            width,
            left=found.lower[row] / nominal,
            height=0.5 - 0.3 * level,
            color=BLUE,
            alpha=0.35 + 0.6 * float(level),
            lw=0,
            label=f"after, α = {level:g}" if row in (0, len(found.alpha) - 1) else None,
        )
    axes.plot(found.best / nominal, places, "|", color=INK, ms=9, label="agrees best")
    axes.use_sticky_edges = False
    axes.autoscale_view()
    axes.set_yticks(places, found.names)
    axes.set_xlabel("value over the nominal one")
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return drawn
