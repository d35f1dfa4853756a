"""Random and fuzzy stress of the cell: distribution bounds and quantiles by level."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.figures import style as look
from alphacut.stages.material.cell import GPA

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKS = (look.BLUE, look.ORANGE, look.PURPLE, look.INK)
UNSEEN = 0.004  # width of a band, in probability, that hides behind the line of the highest level
NAMES = {"s11": "σ$_{11}$(ε$^{(1)}$)", "s12": "σ$_{12}$(ε$^{(2)}$)"}


def response(found: xarray.Dataset) -> Figure:
    """p-boxes to the left, membership functions of the quantiles to the right."""
    import matplotlib.pyplot as plt

    drawn, (left, right) = plt.subplots(1, 2, figsize=(1.5 * look.WIDTH, 3.6))
    name = NAMES[str(found.attrs["quantity"])]
    boxes(left, found)
    left.set_xlabel(f"homogenised {name}, GPa")
    quantiles(right, found)
    look.membership_axes(right, f"quantile of {name}, GPa")
    right.legend(
        title="probability",
        fontsize=8,
        title_fontsize=8,
        loc="upper left",
        bbox_to_anchor=(1.0, 1.0),
    )
    return drawn


def boxes(axes: Axes, found: xarray.Dataset) -> None:
    """The distribution function between its bounds, each level inside the one below."""
    alpha, stress = found["alpha"].values, found["stress"].values / GPA
    cdf = found["cdf"].transpose("alpha", "bound", "stress").values
    for (lower, upper), shade in zip(cdf[:-1], look.colours(alpha), strict=False):
        axes.fill_between(stress, lower, upper, color=shade, lw=0)
    axes.plot(stress, cdf[-1].T, color=look.INK, lw=1)
    if "exceedance" in found:
        limit = found["exceedance"].attrs["limit"] / GPA
        axes.axvline(limit, color=look.ORANGE, lw=1.2, ls="--")
        place = axes.get_xaxis_transform()  # above the axes, where no curve goes
        axes.text(
            limit,
            1.02,
            f"limit {limit:g} GPa",
            color=look.ORANGE,
            fontsize=8,
            ha="center",
            transform=place,
        )
    axes.set_ylabel("distribution function")
    axes.set_ylim(0, 1)
    seen = np.append((cdf[:-1, 1] - cdf[:-1, 0]).max(axis=1) > UNSEEN, True)
    look.alpha_legend(axes, alpha[seen], loc="lower right", bbox_to_anchor=(1.0, 0.12))


def quantiles(axes: Axes, found: xarray.Dataset) -> None:
    """One membership function for each probability."""
    alpha = found["alpha"].values
    for number, probability in enumerate(found["probability"].values):
        lower, upper = (
            found["quantile"].sel(probability=probability).transpose("bound", "alpha").values / GPA
        )
        line, grade = np.concatenate([lower, upper[::-1]]), np.concatenate([alpha, alpha[::-1]])
        axes.plot(
            line,
            grade,
            color=MARKS[number % len(MARKS)],
            lw=1.3,
            marker="o",
            ms=3,
            label=f"{probability:g}",
        )
