"""Identified inputs, and the answers to questions: decision, probability, tolerances, fragility."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import cycle
from textwrap import fill

import matplotlib.pyplot as plt
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy.special import ndtr

from alphacut.base.arrays import Array
from alphacut.base.number_text import STANDARD_GRAVITY, engineering
from alphacut.figures import style
from alphacut.figures.style import BLUE, GREY, INK, ORANGE, Look
from alphacut.frame import (
    Decision,
    FloorSpectrum,
    Fragility,
    LearnedInputs,
    Probability,
    ScaledSuite,
    SpectrumAccuracy,
    SpectrumResponse,
    StaticBounds,
    Tolerances,
)
from alphacut.frame.analyses.decision import LimitDecision, degree_text
from alphacut.frame.analyses.fragility import LimitFragility
from alphacut.fuzzy.result import Ends

LIMIT: Look = {"color": ORANGE, "lw": 1.3, "ls": "--"}
"""Line of a limit."""
FIT: Look = {"color": ORANGE, "lw": 1.2, "ls": ":"}
"""Line of a lognormal fit."""


def draw_bars(bars: Sequence[tuple[Array, Look]], names: Iterable[str], label: str) -> Figure:
    """Draw intervals of inputs as bars, one row for each input, the first one on top.

    Args:
        bars: Series of intervals, shape (inputs, 2) each, with the look of its bars. Later series
            are drawn over earlier ones.
        names: Names of the inputs.
        label: Label of the horizontal axis.
    """
    # inches: the axis with its label takes 0.9, each row 0.36
    figure, (axes,) = style.panels(0.9 + 0.36 * len(bars[0][0]))
    rows = style.rows_of(axes, names)
    for intervals, look in bars:
        lower, upper = intervals.T
        axes.barh(rows, upper - lower, left=lower, lw=0, **look)
    axes.set_xlabel(label)
    style.legend_beside(axes)
    return figure


def identified_inputs(result: LearnedInputs) -> Figure:
    """Draw the interval of each input before the measurement, and its α-cuts after it.

    All are divided by the middle of the interval before, so that inputs share one axis. Higher
    levels have darker and thinner bars.

    Args:
        result: What was learned. It must not be refuted, and an interval must not be centred at
            zero.
    """
    alpha = result.alpha
    prior = np.array([result.prior[name] for name in result.inputs], float)  # (inputs, 2)
    # Inputs have different units and sizes: ratios to the middle share one axis.
    middle = prior.mean(axis=1, keepdims=True)
    before: Look = {"height": 0.7, "color": GREY, "alpha": 0.45, "label": "before"}
    bars = [(prior / middle, before)]
    for k, level in enumerate(alpha):
        look: Look = {"height": 0.5 - 0.3 * level, "color": BLUE, "alpha": 0.35 + 0.6 * level}
        if k in (0, len(alpha) - 1):
            look["label"] = f"after, α = {level:g}"
        cuts = np.array([(ends.lower[k], ends.upper[k]) for ends in result.inputs.values()])
        bars.append((cuts / middle, look))
    return draw_bars(bars, result.inputs, "value over the middle of what it was before")


def draw_tolerances(answer: Tolerances) -> Figure:
    """Draw the supports of the inputs in the case, and those within which no limit is exceeded.

    All are divided by the nominal value of the input, or by 1 where this is zero.

    Args:
        answer: For each input `own`, its support in the case, and `kept`, the scaled support within
            which no limit is exceeded. If limits are exceeded at each scale, `kept` is the nominal
            value alone.
    """
    supports = answer.supports.values()
    nominal = np.array([[x.nominal or 1.0] for x in supports])  # (inputs, 1)
    stated: Look = {"color": GREY, "height": 0.7, "label": "in the case"}
    admissible: Look = {"color": BLUE, "height": 0.35, "label": "no limit exceeded"}
    bars = [
        (np.array([x.own for x in supports]) / nominal, stated),
        (np.array([x.kept for x in supports]) / nominal, admissible),
    ]
    figure = draw_bars(bars, answer.supports, "value over the nominal one")
    figure.axes[0].axvline(1.0, color=INK, lw=0.8)
    return figure


def draw_decision(answer: Decision) -> Figure:
    """Draw a bar from the smallest to the largest peak for each limit and α-level.

    Peaks are divided by their limit. Each limit has a row, in which the bars of all its levels lie
    over each other, higher levels darker and thinner. Above them stands the verdict with its
    guarantee and the degrees to which exceeding the limit is possible and necessary. Events that
    any of several limits is exceeded have no peak and are left out.

    Args:
        answer: Verdicts on the limits, the first of which is drawn on top.
    """
    limits = [limit for limit in answer.limits.values() if limit.peak is not None]
    figure, (axes,) = style.panels(1.2 + 0.85 * len(limits))
    rows = style.rows_of(axes, (limit.words.replace("^2", "²") for limit in limits))
    # Rows are 1 apart: the widest bar, of 0.66, leaves room for two lines of text above it.
    for row, limit in zip(rows, limits, strict=True):
        ratios = peak_over_limit(limit)
        look: Look = {"height": 0.66 - 0.4 * answer.alpha, "color": style.colours(answer.alpha)}
        axes.barh(row, ratios.upper - ratios.lower, left=ratios.lower, lw=0, **look)
        degrees = (
            f"possible to {degree_text(limit.possibility)},"
            f" necessary to {degree_text(limit.necessity)}"
        )
        # Two lines of 72 letters have room between the bars of two limits. Their place along the
        # axis is a fraction of its length, 0.01, and not a value.
        text = fill(f"{limit.verdict_words} ({answer.nature_text(limit.nature)}): {degrees}", 72)
        place: Look = {"fontsize": 8, "linespacing": 1.0, "transform": axes.get_yaxis_transform()}
        axes.text(0.01, row + 0.37, text, **place)
    axes.axvline(1.0, **LIMIT)
    axes.axvline(0.0, color=GREY, lw=0.4)
    axes.set_ylim(-0.5, len(limits) - 0.2)
    axes.set_xlabel("peak over its limit (dashed); the darker the higher α")
    return figure


def peak_over_limit(limit: LimitDecision) -> Ends:
    """Return the smallest and the largest peak on each level, divided by the limit.

    More exactly they are 1 − margin / size, where size is the magnitude of the limit. For a limit
    of zero it is the largest magnitude of a finite margin, so that bars have a length to be seen.

    Args:
        limit: Limit and margins, in the unit of the output. A margin is the limit less the peak.
            The largest peak is infinite where no peak is excluded.

    Returns:
        Ratios, shape (levels,) each.
    """
    size = abs(limit.limit)
    if size == 0.0:
        margins = np.concatenate([limit.margin.lower, limit.margin.upper])
        size = float(np.abs(margins[np.isfinite(margins)]).max(initial=1e-300))
    # The margin is the limit less the peak, so the largest margin belongs to the smallest peak.
    lower = np.asarray(1 - limit.margin.upper / size)
    upper = np.asarray(1 - limit.margin.lower / size)
    return Ends(lower, upper)


def draw_probability(answer: Probability) -> Figure:
    """Draw bounds of the probability of exceeding a limit, over the limit, on each α-level.

    The last entry of the answer is drawn: the event that any limit is exceeded, if there are
    several, else the only limit. Over the horizontal axis stand limits in the unit of the output
    or, for the event, factors of all limits at once.

    Args:
        answer: Probability of exceeding each limit.
    """
    event = list(answer.events.values())[-1]
    limits = event.curve.limit
    # A limit far beyond all computed peaks would squeeze the curve into a corner.
    is_near = event.limit <= 2 * limits[-1]
    place = "far off"
    if is_near:
        place = "dashed"
    figure, axes = plt.subplots()
    curve = Ends(event.curve.lower, event.curve.upper)
    style.draw_bands(axes, limits, curve, answer.alpha)
    style.alpha_legend(axes, answer.alpha)
    limit_text = event.value_words
    label = f"limit of |{event.output}|"
    if event.is_event:
        limit_text = "1"
        label = "all limits, over those of the case"
    axes.set_title(f"limit {limit_text} ({place})".replace("^2", "²"))
    if is_near:
        axes.axvline(event.limit, **LIMIT)
    axes.set(ylabel="probability of exceeding it", ylim=(0, 1.02))
    style.prefix_axis(axes, label, event.unit, across=True, shown=event.stated_unit)
    return figure


def draw_fragility(answer: Fragility) -> Figure:
    """Draw bounds of the fraction of records that exceed each limit, over the intensity measure.

    Each limit has a panel. Limits of single storeys that belong to one limit of all storeys are
    drawn as the event that any storey exceeds it.

    Args:
        answer: Fragility of each limit and event.
    """
    shown = [part for part in answer.limits.values() if not part.event_name]
    figure, panels = style.panels(0.9 + 2.3 * len(shown), len(shown))
    for axes, part in zip(panels, shown, strict=True):
        draw_fragility_of(axes, answer, part)
    fit = Line2D([], [], **FIT, label=f"lognormal fit\nat α = {answer.alpha[-1]:g}")
    style.alpha_legend(panels[0], answer.alpha, [fit])
    return figure


def draw_fragility_of(axes: Axes, answer: Fragility, part: LimitFragility) -> None:
    """Draw the bands of one limit or event, and lognormal fits on the highest level.

    Args:
        axes: Axes that are drawn on.
        answer: The answer, for its levels and intensity measure.
        part: Bounds of the fraction of records on each level, and the limits of 95 % confidence,
            which are drawn dashed for the lowest level if there are some.
    """
    style.draw_bands(axes, part.measure, part.band, answer.alpha, in_steps=True)
    axes.set_ylim(0, 1.02)
    for curve in part.lognormal_fit(-1):  # one or two curves, of the ends on the highest level
        axes.plot(part.measure, curve, **FIT)
    if part.confidence is not None:
        lowest_level = 0
        for end in part.confidence:
            axes.plot(part.measure, end[lowest_level], color=BLUE, lw=0.9, ls="--")
    axes.set_title(part.words.replace("^2", "²"))
    axes.set_ylabel("fraction of records")
    style.prefix_axis(axes, answer.measure, answer.unit, across=True)


def draw_states(answer: Fragility) -> Figure | None:
    """Draw all damage states over the intensity measure, each in a colour.

    Of each state there are the band of the fraction of records on the lowest level, and for the
    nominal structure the first crossings of the records as points and the lognormal fit as a line.

    Args:
        answer: Fragility with damage states.
    """
    if not answer.states:
        return None
    figure, axes = plt.subplots()
    parts = [answer.limits[state] for state in answer.states]
    top = max(float(part.measure[-1]) for part in parts)
    axes.set(xlim=(0.0, top), ylim=(0.0, 1.02))
    style.prefix_axis(axes, answer.measure, answer.unit, across=True)
    colours = colormaps["viridis_r"](np.linspace(0.15, 0.95, len(parts)))
    for state, part, colour in zip(answer.states, parts, colours, strict=True):
        band: Look = {"color": colour, "alpha": 0.25, "lw": 0, "step": "post"}
        axes.fill_between(part.measure, part.band.lower[0], part.band.upper[0], **band)
        # Records that do not bring the state are missing at the upper end.
        crossings = np.sort(answer.nominal_crossings(state))
        fractions = np.arange(1, len(crossings) + 1) / len(crossings)
        axes.plot(crossings, fractions, color=colour, ls="none", marker="o", ms=3)
        fit = answer.nominal_fit(state)
        label = part.words
        if np.isfinite(fit).all() and fit.dispersion > 0:
            x = np.linspace(top / 400, top, 400)
            axes.plot(x, ndtr(np.log(x / fit.median) / fit.dispersion), color=colour, lw=1.8)
            label += f": θ = {engineering(fit.median, answer.unit)}, β = {fit.dispersion:.2f}"
        axes.plot([], [], color=colour, lw=1.8, label=label.replace("^2", "²"))
    axes.set_title(
        f"damage states under {len(crossings)} records, nominal inputs;"
        f" bands: α = {answer.alpha[0]:g}"
    )
    axes.set_ylabel("fraction of records")
    axes.legend(loc="lower right")
    return figure


def draw_spectra(scaled: ScaledSuite) -> Figure:
    """Draw spectra of scaled records, their mean and median, the target, and the floor of the mean.

    The periods are those that were compared. In SVG the curves of records show their names.

    Args:
        scaled: The scaled records, with their spectra at T1, at the periods compared, and at 0.
    """
    periods = scaled.periods[1:-1]
    spectra = scaled.spectra[:, 1:-1] / STANDARD_GRAVITY
    goal = scaled.target(periods) / STANDARD_GRAVITY
    figure, axes = plt.subplots()
    for name, spectrum in zip(scaled.factors, spectra, strict=True):
        axes.plot(periods, spectrum, color=GREY, lw=0.6, gid=f"{style.HOVER}{name}")
    axes.plot(periods, spectra.mean(axis=0), color=INK, label="mean")
    axes.plot(periods, np.median(spectra, axis=0), color=BLUE, ls="--", label="median")
    axes.plot(periods, goal, color=ORANGE, label="target")
    floor = scaled.target.rule.floor
    axes.plot(periods, floor * goal, **FIT, label=f"{floor:.0%} of it")
    axes.set(title=scaled.target.name, xlabel="period T (s)", ylim=(0.0, None))
    axes.set_ylabel("pseudo-acceleration Sa (g)")
    style.legend_beside(axes)
    return figure


def draw_floor_spectrum(answer: FloorSpectrum) -> Figure:
    """Draw the floor spectra over the period: bounds, attained values and the nominal curve.

    Each floor has a panel. Bounds on each level are lines, down to which the nominal curve is
    filled. Attained values on the lowest level are dots. Each damping ratio has a style of lines.

    Args:
        answer: Floor spectra, of one level at least.
    """
    outputs = list(dict.fromkeys(answer.outputs))
    figure, panels = style.panels(0.6 + 2.6 * len(outputs), len(outputs), sharex=True)
    order = np.argsort(answer.periods)
    periods = answer.periods[order]
    nominal, bounds, attained = (
        values[..., order] / STANDARD_GRAVITY
        for values in (answer.nominal, answer.bound, answer.attained[0])
    )
    colours = colormaps["viridis_r"](np.linspace(0.25, 0.85, len(answer.alpha)))
    for name, axes in zip(outputs, panels, strict=True):
        curves = [k for k, output in enumerate(answer.outputs) if output == name]
        ratios = [f"ζ = {answer.damping[k]:.3g}" for k in curves]
        for k, ratio, dashes in zip(curves, ratios, cycle(("-", "--", "-.", ":")), strict=False):
            damping = "" if len(curves) == 1 else f", {ratio}"
            for alpha, bound, colour in zip(answer.alpha, bounds[:, k], colours, strict=True):
                axes.fill_between(periods, nominal[k], bound, color=colour, alpha=0.15, lw=0)
                label = f"bound, α = {alpha:g}{damping}"
                axes.plot(periods, bound, color=colour, ls=dashes, lw=1.2, label=label)
            # one entry of the legend, since the dots of all damping ratios look alike
            label = f"attained, α = {answer.alpha[0]:g}" if k == curves[0] else ""
            axes.plot(periods, attained[k], color=ORANGE, ls="none", marker="o", ms=3, label=label)
            axes.plot(periods, nominal[k], color=INK, ls=dashes, lw=1.2, label=f"nominal{damping}")
        natures = dict.fromkeys(str(x) for k in curves for x in answer.natures[k])
        title = f"{name}, {', '.join(ratios)}; {' and '.join(natures)} bounds"
        if answer.suite:
            title += f" of the mean over {len(answer.suite)} records"
        axes.set(title=title, ylim=(0.0, None), xlim=(0.0, None))
        axes.set_ylabel("floor spectrum Sa (g)")
        style.legend_beside(axes)
    axes.set_xlabel("period T (s)")
    return figure


def draw_incremental(answer: Fragility) -> Figure | None:
    """Draw the smallest and the largest peak found over the intensity measure of each record.

    Each peak has a panel with all its limits, and each record a band for each level. In SVG the
    curves show the name of their record where a pointer rests on them.

    Args:
        answer: Fragility of a frame that yields, with the peaks under each record at rising
            intensity. Of other structures nothing is drawn.
    """
    if not answer.increments:
        return None
    # Limits of the same peak share its panel, for they share its curves.
    demands = answer.limits_by_demand
    figure, panels = style.panels(0.6 + 1.9 * len(demands), len(demands), sharex=True)
    for axes, (peak, names) in zip(panels, demands.items(), strict=True):
        draw_demands(axes, answer, names)
        limits = [answer.limits[name] for name in names]
        for limit in limits:
            axes.axhline(limit.limit, **LIMIT)
            place: Look = {"xycoords": ("axes fraction", "data"), "ha": "right", "va": "bottom"}
            axes.annotate(limit.value_words, (1, limit.limit), fontsize=8, color=ORANGE, **place)
        # Peaks far beyond the limits are cut off: frames that have nearly collapsed would hide
        # everything else.
        values = [limit.limit for limit in limits]
        axes.set_xlim(0.0, max(limit.measure[-1] for limit in limits))
        axes.set_ylim(0.0, max(3 * min(values), 1.5 * max(values)))
        shown = limits[0].stated_unit
        style.prefix_axis(axes, f"peak of {peak}", limits[0].unit, shown=shown)
    style.prefix_axis(axes, answer.measure, answer.unit, across=True)
    panels[0].set_title(f"{len(answer.increments)} records; limits dashed")
    style.alpha_legend(panels[0], answer.alpha)
    return figure


def draw_demands(axes: Axes, answer: Fragility, names: Sequence[str]) -> None:
    """Draw the bands of a peak over the intensity measure, one for each record and level.

    Args:
        axes: Axes that are drawn on.
        answer: Fragility of a frame that yields, with the peaks under each record.
        names: Names of limits of one and the same peak, whose bounds are then the same.
    """
    for record, increment in answer.increments.items():
        high, low = answer.demand_curve(names[0], record)  # shape (levels, measures) each
        for level, shade in enumerate(style.colours(answer.alpha)):
            band: Look = {"color": shade, "lw": 0, "alpha": 0.7}
            filled = axes.fill_between(increment.measure, low[level], high[level], **band)
            # In the SVG file the name of the record is shown where a pointer rests on the band.
            filled.set_gid(f"{style.HOVER}{record}")
        (line,) = axes.plot(increment.measure, high[-1], color=INK, lw=0.7)
        line.set_gid(f"{style.HOVER}{record}")


def draw_response_spectrum(answer: SpectrumResponse) -> Figure:
    """Draw the spectrum, and on it the modes at the nominal inputs.

    The area of a mode's point is proportional to the fraction of the mass that it moves.
    """
    spectrum = answer.method.spectrum
    periods = answer.modes.periods[0]
    fractions = answer.modes.mass_fractions[0]
    figure, axes = plt.subplots()
    first = float(spectrum.periods[0])
    last = float(spectrum.periods[-1])
    # At 600 periods a curve of this width is smooth; the corners are added.
    grid = np.linspace(first, min(last, max(1.5 * float(periods[0]), 1.0)), 600)
    corners = np.concatenate([spectrum.periods, spectrum.falls_from])
    grid = np.union1d(grid, corners[corners < grid[-1]])
    axes.plot(grid, spectrum(grid) / STANDARD_GRAVITY, color=INK, lw=1.2)
    sizes = 10 + 190 * fractions
    axes.scatter(periods, spectrum(periods) / STANDARD_GRAVITY, s=sizes, color=BLUE, alpha=0.7)
    # The largest point must not be cut.
    axes.set_ylim(0.0, 1.1 * float(spectrum(grid).max()) / STANDARD_GRAVITY)
    axes.set_xlabel("period T (s); points: the modes, by the mass that they move")
    axes.set_ylabel("spectral acceleration (g)")
    return figure


def draw_accuracy(answer: SpectrumAccuracy) -> Figure:
    """Draw the error of the response-spectrum method under each record, a row for each output."""
    figure, (axes,) = style.panels(0.9 + 0.36 * len(answer.outputs))
    rows = style.rows_of(axes, answer.outputs)
    for row, errors in zip(rows, 100 * answer.errors.mean(axis=-1).T, strict=True):
        axes.plot(errors, np.full_like(errors, row), "o", color=BLUE, alpha=0.6, ms=5)
    axes.axvline(0.0, color=INK, lw=0.8)
    axes.set_ylim(-0.6, rows[0] + 0.6)
    axes.set_xlabel("combined peak over the peak under the record, less 1 [%]")
    return figure


def draw_static(answer: StaticBounds) -> Figure:
    """Draw the bounds of outputs at rest, a panel for each unit and a row for each output.

    Nominal displacements of the floors of a frame are joined by a line, the deflected shape, with
    the ground floor below.
    """
    by_unit: dict[str, list[int]] = {}
    for j, unit in enumerate(answer.units):
        by_unit.setdefault(unit, []).append(j)
    figure, panels = style.panels(1.0 + 0.36 * len(answer.outputs), columns=len(by_unit))
    for axes, (unit, outputs) in zip(panels, by_unit.items(), strict=True):
        names = [answer.outputs[j] for j in outputs]
        is_shape = all(re.fullmatch(r"q\d+", name) for name in names)
        if is_shape:  # from the ground up
            outputs, names = outputs[::-1], names[::-1]
        rows = style.rows_of(axes, names)
        for level, shade in enumerate(style.colours(answer.alpha)):
            ends = answer.bounds[level, outputs]
            axes.barh(rows, ends[:, 1] - ends[:, 0], 0.6, ends[:, 0], color=shade)
        for end in answer.attained[0, outputs].T:
            axes.plot(end, rows, ".", color=INK, ms=4)
        line = "-" if is_shape else "none"
        axes.plot(answer.nominal[outputs], rows, "|", ls=line, color=INK, lw=0.8, ms=9)
        axes.margins(x=0.05)
        axes.axvline(0.0, color=GREY, lw=0.8)
        style.prefix_axis(axes, "at rest", unit, across=True)
    style.alpha_legend(panels[-1], answer.alpha)
    return figure
