"""Picture of the circles found in the image of a section, over the image."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.stochastic.figures.style import ORANGE
from alphacut.stochastic.particles.discs import Discs
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_overlay(picture: Array, discs: Discs) -> Figure:
    """The grey image with the outline of every circle that was taken from it.

    Args:
        picture: Grey values, shape (rows, columns).
        discs: Circles in the same window; y points up from the lower edge.
    """
    import matplotlib.pyplot as plt
    from matplotlib.collections import EllipseCollection

    width, height = 1e3 * discs.size
    drawn, axes = plt.subplots(figsize=(6.4, 6.4 * float(np.clip(height / width, 0.5, 1.6))))
    axes.imshow(picture, cmap="gray", extent=(0, width, 0, height), interpolation="none")
    across = 2e3 * discs.radii
    place = {"offsets": 1e3 * discs.centres, "offset_transform": axes.transData}
    outline = {"facecolors": "none", "edgecolors": ORANGE, "linewidths": 1.0}
    axes.add_collection(
        EllipseCollection(across, across, 0 * across, units="xy", **place, **outline)
    )
    axes.set(xlim=(0, width), ylim=(0, height), xlabel="x [mm]", ylabel="y [mm]")
    axes.set_title(f"{len(discs)} circles; what has no outline was left out", fontsize="medium")
    axes.grid(visible=False)
    return drawn
