"""Inputs before and after measured modes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.figures.style import BLUE, GREY, Look, figure
from alphacut.fuzzy.arrays import Array
from alphacut.io.files import Document

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def inputs(document: Document) -> Figure:
    """Each input's interval at every level over that of its prior, over the middle of that.

    Args:
        document: What `stages.identify.learned` gives.
    """
    names, alpha = list(document["inputs"]), np.asarray(document["alpha"], float)
    drawn, axes = figure(height=0.9 + 0.32 * len(names))
    places = np.arange(len(names), dtype=float)[::-1]
    prior = np.array([document["prior"][name] for name in names], float)
    unit = prior.mean(axis=1)
    _bars(axes, places, prior / unit[:, None], height=0.7, color=GREY, alpha=0.45, label="before")
    for row, level in enumerate(alpha):
        after = [[document["inputs"][x][side][row] for side in ("lower", "upper")] for x in names]
        words = f"after, α = {level:g}" if row in (0, len(alpha) - 1) else None
        look: Look = {"height": 0.5 - 0.3 * level, "color": BLUE, "alpha": 0.35 + 0.6 * level}
        _bars(axes, places, np.array(after) / unit[:, None], label=words, **look)
    axes.set_yticks(places, names)
    axes.set_xlabel("value over the middle of what it was before")
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return drawn


def _bars(axes: Axes, places: Array, ends: Array, **look: Any) -> None:
    """Horizontal bars between two ends each, shape (n, 2)."""
    axes.barh(places, np.ptp(ends, axis=1), left=ends[:, 0], lw=0, **look)
