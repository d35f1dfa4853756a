"""By how much the answer narrows if each input is known twice as well, and exactly."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.figures.captions import in_words
from alphacut.figures.style import BLUE, GREY, INK, figure
from alphacut.io.files import Document

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def gains(found: Document) -> Figure:
    """Bars of both gains by input, with the least over where the better value may lie."""
    names = [*found["gains"]]
    drawn, axes = figure(7.2, 1.0 + 0.42 * max(len(names), 1))
    places = np.arange(len(names))[::-1]
    for kind, colour, shift, words in (
        ("exact", GREY, 0.19, "known exactly"),
        ("half", BLUE, -0.19, "known twice as well"),
    ):
        share = [100 * found["gains"][name][kind] for name in names]
        least = [100 * found["gains"][name][f"{kind}_least"] for name in names]
        axes.barh(places + shift, share, height=0.36, color=colour, lw=0, label=words)
        label = "at least" if kind == "half" else None
        axes.plot(least, places + shift, "|", color=INK, ms=9, label=label)
    axes.set_yticks(places, [in_words(name) for name in names])
    axes.set_xlabel(f"width lost at α = {found['alpha']:g}, %")
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return drawn
