"""Fuzzy numbers (Fig. 36) and their α-cuts (Fig. 37), of a case's own input and result."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.figures import style
from alphacut.fuzzy import Crisp, FuzzyNumber, Interval, Trapezoidal
from alphacut.io.quantity import axis_prefix
from alphacut.stochastic.figures.style import BLUE, INK, ORANGE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CUTS = 6
"""Levels in Fig. 37."""


def number_of_each_kind(given: FuzzyNumber, result: FuzzyNumber) -> dict[str, FuzzyNumber]:
    """A fuzzy number of each kind, by its name: four made of an input, and a computed result."""
    half, three_quarters = given.cut(0.5), given.cut(0.75)
    ends = (given.support.lower, *three_quarters, given.support.upper)
    return {
        "crisp": Crisp(given.modal),
        "interval": Interval(*half),
        "triangular": given,
        "trapezoidal": Trapezoidal(*ends),
        "piecewise linear": result,
    }


def kinds_of_numbers(given: FuzzyNumber, result: FuzzyNumber) -> Figure:
    """Fig. 36: membership functions of crisp, interval, triangular … numbers, side by side.

    Four are made of the particle's Young's modulus in Pa, `given`; the last is the cell's.
    """
    import matplotlib.pyplot as plt

    numbers = number_of_each_kind(given, result)
    figure, panels = plt.subplots(1, len(numbers), figsize=(11.0, 2.6), sharey=True)
    for axes, (name, number) in zip(panels, numbers.items(), strict=True):
        number.plot(axes, color=BLUE, lw=1.6)
        margin = 0.15 * (number.support.width or given.support.width)
        axes.set(
            xlim=(number.support.lower - margin, number.support.upper + margin), ylim=(0, 1.08)
        )
        style.title(axes, name)
        source = "E" if number.modal == result.modal else "E$_i$"
        style.prefix_axis(axes, source, "Pa", across=True)
    panels[0].set_ylabel("membership μ")
    return figure


def alpha_cuts(number: FuzzyNumber) -> Figure:
    """Fig. 37: the particle's Young's modulus in Pa, a triangular number, in six α-cuts."""
    figure, axes = style.figure()
    alpha = np.linspace(0, 1, CUTS)
    number.plot(axes, color=INK, lw=1.4)
    factor, unit = axis_prefix(number.support.upper, "Pa")
    for level in alpha:
        cut = number.cut(float(level))
        axes.plot(cut, [level, level], color=ORANGE, lw=2.5, marker="o", ms=4)
        words = f"{factor * cut.lower:.4g} … {factor * cut.upper:.4g} {unit}"
        axes.annotate(
            f"α = {level:.1f}: {words}" if cut.width else f"α = {level:.1f}",
            (cut.upper, level),
            xytext=(8, 0),
            textcoords="offset points",
            va="center",
            fontsize=8,
        )
    axes.set_xlim(right=number.support.upper + 0.35 * number.support.width)
    style.membership_axes(axes, "")
    axes.set_ylim(-0.06, 1.06)
    style.prefix_axis(axes, "fuzzy Young's modulus of the particle E$_i$", "Pa", across=True)
    return figure
