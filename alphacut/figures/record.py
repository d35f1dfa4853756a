"""The ground's acceleration over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.figures.style import INK, ORANGE, figure
from alphacut.io.units import engineering

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from alphacut.frame.structures.linear import Accelerogram


def record(ground: Accelerogram) -> Figure:
    """The record as it is read, its peak marked."""
    drawn, axes = figure(7.2, 2.4)
    acceleration = np.asarray(ground.acceleration)
    time, peak = np.arange(len(acceleration)) * ground.step, int(np.abs(acceleration).argmax())
    axes.plot(time, acceleration, color=INK, lw=0.7)
    axes.plot(time[peak], acceleration[peak], "o", color=ORANGE, ms=4)
    strongest = engineering(float(acceleration[peak]), "m/s^2", digits=3).replace("^2", "²")
    axes.set_title(f"peak {strongest} at {time[peak]:.4g} s", loc="left", fontsize=10)
    axes.set_xlabel("time t, s")
    axes.set_ylabel("ground acceleration, m/s²")
    axes.set_xlim(time[0], time[-1])
    return drawn
