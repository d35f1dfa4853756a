"""An image, the error of its fields pixel by pixel, and the proved bounds of E."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.figures.style import BLUE, INK, figure
from alphacut.stages.material.cell import GPA

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


def image(found: xarray.Dataset) -> Figure:
    """Phases, constitutive error where there is one, and α-cuts of E."""
    import matplotlib.pyplot as plt

    pictures = ["phase"] + ["gap"] * ("gap" in found)
    drawn, first = figure(width=3.2 * (len(pictures) + 1), height=3.0)
    first.remove()
    places = [drawn.add_subplot(1, len(pictures) + 1, k + 1) for k in range(len(pictures) + 1)]
    for axes, name in zip(places, pictures, strict=False):
        values = found[name].values
        if name == "gap":
            values = np.log10(np.maximum(values / values.max(), 1e-6))
        shown = axes.imshow(values, origin="lower", cmap="Greys_r" if name == "phase" else "magma")
        axes.set_xticks([])
        axes.set_yticks([])
        axes.set_title("phases" if name == "phase" else "error of the fields, log10", fontsize=9)
        if name == "gap":
            plt.colorbar(shown, ax=axes, shrink=0.8)
    alpha, ends = found["alpha"].values, found["E"].values / GPA
    for level, pair in zip(alpha, ends, strict=True):
        places[-1].plot(pair, [level, level], color=BLUE, lw=2)
    places[-1].plot(ends.ravel(order="F"), np.tile(alpha, 2), ".", color=INK, ms=3)
    places[-1].set_xlabel("E, GPa")
    places[-1].set_ylabel("α")
    return drawn
