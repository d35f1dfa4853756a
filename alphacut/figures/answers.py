"""Figures of the answers to the questions of a case."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from alphacut.figures import style
from alphacut.figures.style import BLUE, GREY, INK, ORANGE, Look, alpha_legend, colours
from alphacut.frame.questions.peaks import ANY, verdict_words
from alphacut.fuzzy.arrays import Array
from alphacut.io.files import Document
from alphacut.io.quantity import engineering
from alphacut.questions.decision import degree
from alphacut.questions.question import limit_words

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw_decision(document: Document) -> Figure:
    """Peak of each limited output over its limit, a bar for each level."""
    limits = {name: limit for name, limit in document["limits"].items() if name != ANY}
    figure, axes = style.figure(7.2, 1.2 + 0.7 * len(limits))
    alpha = np.asarray(document["alpha"], float)
    heights = np.arange(len(limits))[::-1]
    for height, limit in zip(heights, limits.values(), strict=True):
        margins = (np.asarray(limit["margin"][side], float) for side in ("upper", "lower"))
        size = max(abs(limit["limit"]), 1e-300)
        low, high = (1 - margin / size for margin in margins)
        for level, left, right, shade in zip(alpha, low, high, colours(alpha), strict=True):
            bar: Look = {"left": left, "height": 0.66 - 0.4 * level, "color": shade, "lw": 0}
            axes.barh(height, right - left, **bar)
        possible, necessary = degree(limit["possibility"]), degree(limit["necessity"])
        verdict = verdict_words(limit["verdict"], limit["from_level"])
        text = f"{verdict} ({limit['nature']}): possible to {possible}"
        text += f", necessary to {necessary}"
        axes.text(0.01, height + 0.4, text, fontsize=8, transform=axes.get_yaxis_transform())
    axes.axvline(1.0, color=ORANGE, lw=1.4, ls="--")
    axes.axvline(0.0, color=GREY, lw=0.4)
    axes.set_ylim(-0.5, len(limits) - 0.2)
    words = [limit_words(x["output"], x["limit"], x["unit"]) for x in limits.values()]
    axes.set_yticks(heights, words, color=INK)
    axes.set_xlabel("peak over its limit (dashed); the darker the higher α")
    return figure


def _mark(axes: Axes, limit: float, limits: Array, unit: str) -> None:
    """The case's limit, where it is near the curve."""
    words = engineering(limit, unit) if unit else "1"
    near = limit <= 2 * limits[-1]
    if near:
        axes.axvline(limit, color=ORANGE, lw=1.2, ls="--")
    axes.set_title(f"limit {words} ({'dashed' if near else 'far off'})", loc="left", fontsize=10)


def draw_probability(document: Document) -> Figure:
    """Probability over the limit, for the last event, between its bounds by level."""
    name, event = list(document["events"].items())[-1]
    alpha = np.asarray(document["alpha"], float)
    limits = np.asarray(event["curve"]["limit"], float)
    lower, upper = (np.asarray(event["curve"][side], float) for side in ("lower", "upper"))
    figure, axes = style.figure(7.2, 3.6)
    for low, high, shade in zip(lower[:-1], upper[:-1], colours(alpha), strict=False):
        axes.fill_between(limits, low, high, color=shade, lw=0)
    for end in (lower[-1], upper[-1]):
        axes.plot(limits, end, color=INK, lw=1)
    _mark(axes, event["limit"], limits, event["unit"])
    title = f"limit of |{name}|" if event["unit"] else "all limits, over those of the case"
    style.prefix_axis(axes, title, event["unit"], across=True)
    axes.set(ylabel="probability of exceeding it", ylim=(0, 1.02))
    alpha_legend(axes, alpha)
    return figure


def draw_tolerances(document: Document) -> Figure:
    """Supports of the case and at the scale that exceeds no limit, over their modal values."""
    supports = document["supports"]
    figure, axes = style.figure(7.2, 1.0 + 0.4 * len(supports))
    places = np.arange(len(supports))[::-1]
    series = (("own", GREY, 0.7, "in the case"), ("kept", BLUE, 0.35, "no limit exceeded"))
    for kind, colour, height, label in series:
        ends = np.array(
            [np.asarray(support[kind]) / (support["modal"] or 1.0) for support in supports.values()]
        )
        wide = ends[:, 1] - ends[:, 0]
        axes.barh(places, wide, left=ends[:, 0], height=height, color=colour, lw=0, label=label)
    axes.axvline(1.0, color=INK, lw=0.8)
    axes.set_yticks(places, list(supports))
    axes.set_xlabel("value over the modal one")
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def draw_fragility(document: Document) -> Figure:
    """Band of the share of records over the measure, for the last limit, by level."""
    limit = list(document["limits"].values())[-1]
    alpha = np.asarray(document["alpha"], float)
    measure = np.asarray(limit["measure"], float)
    lower, upper = (np.asarray(limit["band"][end], float) for end in ("lower", "upper"))
    figure, axes = style.figure(7.2, 3.8)
    for low, high, shade in zip(lower, upper, colours(alpha), strict=True):
        axes.fill_between(measure, low, high, color=shade, lw=0, step="post")
    for end in (lower[-1], upper[-1]):
        axes.step(measure, end, color=INK, lw=1, where="post")
    for end in limit.get("confidence", {}).values():
        axes.plot(measure, np.asarray(end, float)[0], color=BLUE, lw=0.9, ls="--")
    words = limit_words(limit["output"], limit["limit"], limit["output_unit"])
    axes.set_title(words, loc="left", fontsize=10)
    style.prefix_axis(axes, document["measure"], document["unit"], across=True)
    axes.set(ylabel="share of records that exceed it", ylim=(0, 1.02))
    alpha_legend(axes, alpha)
    return figure


DRAWINGS: dict[str, Callable[[Document], Figure]] = {
    "probability": draw_probability,
    "decision": draw_decision,
    "tolerances": draw_tolerances,
    "fragility": draw_fragility,
}
"""Drawing of the answer to each question, by the question's key."""
