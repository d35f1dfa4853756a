"""The fuzzy probability that an output's magnitude exceeds a limit, over the limit."""

from __future__ import annotations

from typing import TYPE_CHECKING

from alphacut.figures.style import INK, ORANGE, alpha_legend, colours, figure
from alphacut.io.units import MINUS, axis_prefix, engineering

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


def exceedance(found: xarray.Dataset) -> Figure:
    """The probability between its bounds on each level, and the case's limit."""
    from alphacut.frame.outputs import output_unit

    drawn, axes = figure(7.2, 3.6)
    alpha, limits = found["alpha"].values, found["limit"].values
    curves = found["curve"].transpose("alpha", "bound", "limit").values
    for (lower, upper), shade in zip(curves[:-1], colours(alpha), strict=False):
        axes.fill_between(limits, lower, upper, color=shade, lw=0)
    axes.plot(limits, curves[-1].T, color=INK, lw=1)
    limit, unit = float(found.attrs["limit"]), output_unit(found.attrs["output"])
    if limit <= 2 * limits[-1]:
        axes.axvline(limit, color=ORANGE, lw=1.2, ls="--")
    axes.set_title(
        (
            f"limit {engineering(limit, unit)} (dashed)"
            if limit <= 2 * limits[-1]
            else f"limit {engineering(limit, unit)}, far off"
        ),
        loc="left",
        fontsize=10,
    )
    factor, prefixed = axis_prefix(max(limits[-1], limit if limit <= 2 * limits[-1] else 0.0), unit)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value * factor:.10g}".replace("-", MINUS))
    axes.set_xlabel(f"limit of |{found.attrs['output']}|, {prefixed}")
    axes.set_ylabel("probability of exceeding it")
    axes.set_ylim(0, 1.02)
    alpha_legend(axes, alpha, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return drawn
