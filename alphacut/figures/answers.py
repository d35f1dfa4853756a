"""Figures of the answers to the questions of a case."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.figures import style
from alphacut.figures.style import Look, alpha_legend, colours
from alphacut.fuzzy.arrays import Array
from alphacut.io.quantity import engineering
from alphacut.questions.decision import DecisionAnswer, degree_text
from alphacut.questions.fragility import FragilityAnswer
from alphacut.questions.probability import ProbabilityAnswer
from alphacut.questions.tolerances import TolerancesAnswer
from alphacut.stochastic.figures.style import BLUE, GREY, INK, ORANGE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw_decision(answer: DecisionAnswer) -> Figure:
    """Draws bars from the least to the greatest peak over its limit, of each limit and level."""
    limits = [limit for limit in answer.limits.values() if limit.peak is not None]
    figure, axes = style.figure(7.2, 1.2 + 0.7 * len(limits))
    alpha, rows = answer.alpha, np.arange(len(limits))[::-1]  # the first limit on top
    for row, limit in zip(rows, limits, strict=True):
        size = max(abs(limit.limit), 1e-300)
        # margin = limit − peak, so that the greatest margin belongs to the least peak
        least, greatest = 1 - limit.margin.upper / size, 1 - limit.margin.lower / size
        for level, left, right, shade in zip(alpha, least, greatest, colours(alpha), strict=True):
            bar: Look = {"left": left, "height": 0.66 - 0.4 * level, "color": shade, "lw": 0}
            axes.barh(row, right - left, **bar)
        possible, necessary = degree_text(limit.possibility), degree_text(limit.necessity)
        text = f"{limit.verdict_words} ({limit.nature}): possible to {possible}"
        text += f", necessary to {necessary}"
        axes.text(0.01, row + 0.4, text, fontsize=8, transform=axes.get_yaxis_transform())
    axes.axvline(1.0, color=ORANGE, lw=1.4, ls="--")
    axes.axvline(0.0, color=GREY, lw=0.4)
    axes.set_ylim(-0.5, len(limits) - 0.2)
    axes.set_yticks(rows, [limit.words for limit in limits], color=INK)
    axes.set_xlabel("peak over its limit (dashed); the darker the higher α")
    return figure


def _mark_limit(axes: Axes, limit: float, limits: Array, unit: str) -> None:
    """Names the limit of the case in the title, and marks it if it is near the curve's `limits`."""
    limit_text = engineering(limit, unit) if unit else "1"
    is_near = limit <= 2 * limits[-1]
    if is_near:
        axes.axvline(limit, color=ORANGE, lw=1.2, ls="--")
    note = "dashed" if is_near else "far off"
    axes.set_title(f"limit {limit_text} ({note})", loc="left", fontsize=10)


def draw_probability(answer: ProbabilityAnswer) -> Figure:
    """Draws the bounds of the exceedance probability of the last event over its limit, by level."""
    event, alpha = [*answer.limits.values()][-1], answer.alpha
    limits, lower, upper = (event.curve[x] for x in ("limit", "lower", "upper"))
    figure, axes = style.figure(7.2, 3.6)
    # the highest level is drawn by lines, as its band may have no width
    for low, high, shade in zip(lower[:-1], upper[:-1], colours(alpha), strict=False):
        axes.fill_between(limits, low, high, color=shade, lw=0)
    for end in (lower[-1], upper[-1]):
        axes.plot(limits, end, color=INK, lw=1)
    _mark_limit(axes, event.limit, limits, event.unit)
    title = f"limit of |{event.output}|" if event.unit else "all limits, over those of the case"
    style.prefix_axis(axes, title, event.unit, across=True)
    axes.set(ylabel="probability of exceeding it", ylim=(0, 1.02))
    alpha_legend(axes, alpha)
    return figure


def draw_tolerances(answer: TolerancesAnswer) -> Figure:
    """Draws the supports of the inputs, over modal values: in the case, and with no exceedance."""
    supports = answer.supports
    figure, axes = style.figure(7.2, 1.0 + 0.4 * len(supports))
    rows = np.arange(len(supports))[::-1]
    series = (("own", GREY, 0.7, "in the case"), ("kept", BLUE, 0.35, "no limit exceeded"))
    for kind, colour, height, label in series:
        pairs = [np.array(getattr(x, kind)) / (x.modal or 1.0) for x in supports.values()]
        lower, upper = np.array(pairs).T
        widths = upper - lower
        axes.barh(rows, widths, left=lower, height=height, color=colour, lw=0, label=label)
    axes.axvline(1.0, color=INK, lw=0.8)
    axes.set_yticks(rows, list(supports))
    axes.set_xlabel("value over the modal one")
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def draw_fragility(answer: FragilityAnswer) -> Figure:
    """Draws the bounds of the share of records that exceed the last limit over their measure."""
    limit, alpha = [*answer.limits.values()][-1], answer.alpha
    measure, lower, upper = limit.measure, limit.band.lower, limit.band.upper
    figure, axes = style.figure(7.2, 3.8)
    for low, high, shade in zip(lower, upper, colours(alpha), strict=True):
        axes.fill_between(measure, low, high, color=shade, lw=0, step="post")
    for end in (lower[-1], upper[-1]):
        axes.step(measure, end, color=INK, lw=1, where="post")
    if limit.confidence is not None:
        for end in (limit.confidence.lower, limit.confidence.upper):
            axes.plot(measure, end[0], color=BLUE, lw=0.9, ls="--")
    axes.set_title(limit.words, loc="left", fontsize=10)
    style.prefix_axis(axes, answer.measure, answer.unit, across=True)
    axes.set(ylabel="share of records that exceed it", ylim=(0, 1.02))
    alpha_legend(axes, alpha)
    return figure


DRAWINGS: dict[str, Callable[[Any], Figure]] = {
    "probability": draw_probability,
    "decision": draw_decision,
    "tolerances": draw_tolerances,
    "fragility": draw_fragility,
}
"""Drawing of the answer to each question, by the question's key."""
