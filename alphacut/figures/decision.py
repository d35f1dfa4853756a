"""Fuzzy peaks beside their limits, with how possible and how necessary it is to exceed them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.figures.style import INK, ORANGE, colours, figure

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


def decision(found: xarray.Dataset) -> Figure:
    """Peak of each limited output over its limit, a bar for each level, and both degrees."""
    names, alpha = [str(name) for name in found["output"].values], found["alpha"].values
    drawn, axes = figure(7.2, 1.1 + 0.75 * len(names))
    share = 1 - found["margin"] / found["allowed"]
    places = np.arange(len(names))[::-1]
    for place, name in zip(places, names, strict=True):
        ends = share.sel(output=name)
        low, high = ends.sel(bound="upper").values, ends.sel(bound="lower").values
        for level, left, right, shade in zip(alpha, low, high, colours(alpha), strict=True):
            height = 0.66 - 0.4 * float(level)
            axes.barh(place, right - left, left=left, height=height, color=shade, lw=0)
        axes.plot([low[-1], high[-1]], [place, place], color=INK, lw=2)
        words, across = degrees(found.sel(limit=name)), axes.get_yaxis_transform()
        axes.text(0.01, place + 0.38, words, fontsize=8, transform=across)
    axes.axvline(1.0, color=ORANGE, lw=1.4, ls="--")
    axes.set_ylim(-0.5, len(names) - 0.2)
    left, right = axes.get_xlim()
    axes.set_xlim(left, max(right, 1 + 0.1 * (1 - left)))
    axes.set_yticks(places, names)
    axes.set_xlabel("peak over its limit (dashed), the darker the higher α")
    return drawn


def degrees(found: xarray.Dataset) -> str:
    """Bounds of possibility and necessity of exceeding one limit."""
    words = []
    for kind, word in (("possibility", "possible"), ("necessity", "necessary")):
        low, high = found[kind].values
        ends = f"{low:.3g}" if high - low < 5e-4 else f"{low:.3g} … {high:.3g}"
        words.append(f"{word} to {ends}")
    return f"exceeding is {', '.join(words)}"
