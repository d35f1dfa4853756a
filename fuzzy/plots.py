"""Pictures of fuzzy sets: memberships (paper, Fig. 36) and α-cuts (Fig. 37)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from alphacut.fuzzy.sets.boxes import levels
from alphacut.fuzzy.sets.membership import FuzzySet
from alphacut.fuzzy.sets.numbers import Crisp, FuzzyNumber, Interval, Trapezoidal, Triangular

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito: told apart by everyone
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")


def plot_membership(
    axes: Axes, sets: Mapping[str, FuzzyNumber | FuzzySet], *, quantity: str = "p"
) -> None:
    """Draw membership functions, each under its name.

    Args:
        axes: Where to draw.
        sets: Fuzzy numbers and sets by name.
        quantity: What the abscissa shows, with its unit.
    """
    for (name, fuzzy), colour in zip(sets.items(), _COLOURS * len(sets), strict=False):
        x, grade = _outline(fuzzy)
        axes.plot(x, grade, color=colour, label=name, linewidth=1.8)
        axes.fill_between(x, grade, color=colour, alpha=0.12, linewidth=0)
    axes.set(xlabel=quantity, ylabel="membership μ", ylim=(0, 1.08))
    axes.legend(
        fontsize="small", frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=3
    )


def plot_cuts(
    axes: Axes, number: FuzzyNumber, alpha: Sequence[float], *, quantity: str = "p"
) -> None:
    """Draw a fuzzy number decomposed into α-cuts.

    Args:
        axes: Where to draw.
        number: The number.
        alpha: Levels.
        quantity: What the abscissa shows, with its unit.
    """
    x, grade = _outline(number)
    axes.plot(x, grade, color=_COLOURS[0], linewidth=1.8)
    for level in alpha:
        cut = number.cut(level)
        axes.plot(cut, (level, level), color=_COLOURS[1], marker="|", markersize=9, linewidth=1.4)
        axes.annotate(
            f"α = {level:.3g}",
            (cut.upper, level),
            xytext=(5, 2),
            textcoords="offset points",
            fontsize="small",
        )
    axes.margins(x=0.15)  # room for the labels
    axes.set(xlabel=quantity, ylabel="membership μ, α", ylim=(-0.03, 1.12))


def _outline(fuzzy: FuzzyNumber | FuzzySet) -> tuple[list[float], list[float]]:
    """Corners of the membership function, with its jumps."""
    if isinstance(fuzzy, FuzzySet):
        return [fuzzy.x[0], *fuzzy.x, fuzzy.x[-1]], [0.0, *fuzzy.grade, 0.0]
    alpha, lower, upper = fuzzy.cuts
    return [lower[0], *lower, *upper[::-1], upper[0]], [0.0, *alpha, *alpha[::-1], 0.0]


def figure_36() -> Figure:
    """Crisp, interval, triangular, trapezoidal and non-convex subnormal sets (Fig. 36)."""
    from matplotlib.figure import Figure

    x = np.linspace(9, 11, 81)
    waves = 0.45 * np.sin(np.pi * (x - 9) / 2) + 0.3 * np.sin(3 * np.pi * (x - 9) / 2) ** 2
    sets: dict[str, FuzzyNumber | FuzzySet] = {
        "crisp number": Crisp(1.0),
        "crisp interval": Interval(2.0, 3.0),
        "triangular fuzzy number": Triangular(4.0, 4.5, 5.0),
        "fuzzy interval": Trapezoidal(6.0, 6.5, 7.5, 8.0),
        "non-convex, subnormal fuzzy set": FuzzySet(tuple(x), tuple(np.clip(waves, 0, 1))),
    }
    figure = Figure(figsize=(7.2, 2.9), layout="constrained")
    plot_membership(figure.subplots(), sets)
    return figure


def figure_37() -> Figure:
    """The paper's Fig. 37: a triangular number decomposed into six α-cuts."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.2, 3.0), layout="constrained")
    plot_cuts(figure.subplots(), Triangular(1.0, 2.0, 3.5), levels(5))
    return figure
