"""Pictures of fuzzy sets: memberships (paper, Fig. 36) and α-cuts (Fig. 37)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.fuzzy.drawing import draw_membership
from alphacut.fuzzy.sets.boxes import levels
from alphacut.fuzzy.sets.numbers import Crisp, FuzzyNumber, Interval, Trapezoidal, Triangular

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figure_36() -> Figure:
    """Crisp, interval, triangular, trapezoidal and non-convex subnormal sets (Fig. 36)."""
    from matplotlib.figure import Figure

    numbers: dict[str, FuzzyNumber] = {
        "crisp number": Crisp(1.0),
        "crisp interval": Interval(2.0, 3.0),
        "triangular fuzzy number": Triangular(4.0, 4.5, 5.0),
        "fuzzy interval": Trapezoidal(6.0, 6.5, 7.5, 8.0),
    }
    figure = Figure(figsize=(7.2, 2.9), layout="constrained")
    axes = figure.subplots()
    for name, number in numbers.items():
        alpha, lower, upper = number.cuts
        foot = (0.0, *alpha), (lower[0], *lower), (upper[0], *upper)  # jumps down to 0
        draw_membership(axes, *foot, name=name)
    x = np.linspace(9, 11, 81)
    waves = 0.45 * np.sin(np.pi * (x - 9) / 2) + 0.3 * np.sin(3 * np.pi * (x - 9) / 2) ** 2
    (line,) = axes.plot(x, np.clip(waves, 0, 1), label="non-convex, subnormal fuzzy set")
    axes.fill_between(x, np.clip(waves, 0, 1), color=line.get_color(), alpha=0.12, linewidth=0)
    axes.set(xlabel="p")
    axes.legend(fontsize="small", frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.2))
    return figure


def figure_37() -> Figure:
    """The paper's Fig. 37: a triangular number decomposed into six α-cuts."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.2, 3.0), layout="constrained")
    axes, number = figure.subplots(), Triangular(1.0, 2.0, 3.5)
    draw_membership(axes, *number.cuts)
    for level in levels(5):
        cut = number.cut(level)
        axes.plot(cut, (level, level), color="#D55E00", marker="|", markersize=9, linewidth=1.4)
        at = cut.upper + 0.05, level + 0.01
        axes.annotate(f"α = {level:.3g}", at, fontsize="small")
    axes.margins(x=0.15)  # room for the labels
    axes.set(xlabel="p", ylabel="membership μ, α", ylim=(-0.03, 1.12))
    return figure
