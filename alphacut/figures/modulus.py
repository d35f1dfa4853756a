"""Fuzzy modulus: stress curves (Fig. 16), mean stress (Fig. 17), E (Fig. 18)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.case.case import Case
from alphacut.figures import style as look
from alphacut.stages.material.cell import GPA
from alphacut.stages.material.modulus import AVERAGE
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


def levels_of_samples(dataset: xarray.Dataset) -> Array:
    """Membership of each sample: the least membership of its inputs, shape (samples,).

    The α-cut of each input is read from where the bounds are reached, which is at its ends; the
    case itself is not needed.
    """
    points, alpha = dataset["point"].values, dataset["alpha"].values
    places = dataset["E_at"].values
    low, high = places.min(axis=1), places.max(axis=1)  # (alpha, parameter)
    width = np.maximum(high[0] - low[0], 1e-300)
    found = np.full(len(points), alpha[0])
    for level, lower, upper in zip(alpha, low, high, strict=True):
        inside = ((points >= lower - 1e-9 * width) & (points <= upper + 1e-9 * width)).all(axis=1)
        found[inside] = level
    return found


def stress_curves(dataset: xarray.Dataset) -> Figure:
    """Fig. 16: homogenised stress 11 over θ, a curve for each fuzzy sample."""
    drawn, axes = look.figure()
    alpha = dataset["alpha"].values
    shades = dict(zip(alpha, look.colours(alpha), strict=True))
    membership = levels_of_samples(dataset)
    theta, curves = dataset["theta"].values, dataset["curve11"].values / GPA
    for sample in np.argsort(membership, kind="stable"):
        top = membership[sample] == alpha[-1]
        axes.plot(
            theta,
            curves[sample],
            color=look.INK if top else shades[membership[sample]],
            lw=1.2 if top else 0.7,
        )
    axes.set_xlabel("θ")
    axes.set_ylabel("homogenised σ$_{11}$(ε$^{(1)}$), GPa")
    axes.set_title(f"{len(curves)} samples", loc="left", fontsize=10)
    look.alpha_legend(
        axes, alpha, loc="upper left" if curves[0, -1] > curves[0, 0] else "lower left"
    )
    return drawn


def mean_stress(dataset: xarray.Dataset) -> Figure:
    """Fig. 17: mean homogenised stress 11 of every sample, rearranged into α-cuts."""
    drawn, axes = look.figure()
    alpha, ends = dataset["alpha"].values, dataset["s11"].values / GPA
    axes.plot(
        dataset["s11_sample"].values / GPA,
        levels_of_samples(dataset),
        ".",
        color=look.ORANGE,
        ms=4,
        zorder=4,
        label="samples",
    )
    look.shaded_cuts(axes, alpha, ends[:, 0], ends[:, 1])
    look.membership_axes(axes, "mean homogenised σ$_{11}$(ε$^{(1)}$), GPa")
    axes.legend(loc="upper left")
    return drawn


def fuzzy_modulus(dataset: xarray.Dataset, case: Case) -> Figure:
    """Fig. 18: the fuzzy modulus, beside the modulus that the case quotes, and below it fuzzy ν."""
    import matplotlib.pyplot as plt

    drawn, (axes, below) = plt.subplots(
        2, 1, figsize=(look.WIDTH, 1.75 * look.HEIGHT), height_ratios=(3, 2), layout="constrained"
    )
    alpha, ends = dataset["alpha"].values, dataset["E"].values / GPA
    look.shaded_cuts(axes, alpha, ends[:, 0], ends[:, 1])
    quoted = case.frame.modulus if case.sections.frame else None
    if quoted is not None:
        left, right = zip(*(quoted.cut(level) for level in (0.0, 1.0)), strict=True)
        x = np.array([*left, *right[::-1]]) / GPA
        axes.plot(x, [0, 1, 1, 0], color=look.BLUE, lw=1.2, ls="--", label="quoted in the case")
        axes.plot([], [], color=look.INK, marker="o", ms=3.5, lw=1.2, label="computed here")
        axes.legend(loc="upper left")
    meaning = dataset.attrs.get("average", dataset.attrs.get("particles", "cylinders"))
    look.membership_axes(axes, f"effective Young's modulus E ({AVERAGE[meaning]}), GPa")
    look.shaded_cuts(below, alpha, *dataset["nu"].transpose("bound", "alpha").values)
    look.membership_axes(below, "effective Poisson's ratio ν of the same")
    return drawn
