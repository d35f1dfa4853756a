"""Fuzzy modulus and stress: curves (Fig. 16), means (17), E (18, 19), mapping (20), p-boxes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.case.structures import Frame
from alphacut.figures import style as look
from alphacut.frame.structures.quantities import Output
from alphacut.stages.cell import GPA
from alphacut.stages.results import Results
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
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


AVERAGE = {
    "cylinders": "eq. 16",
    "isotropic": "isotropic average",
    "spheres": "Hill's isotropic average",
}


def fuzzy_modulus(dataset: xarray.Dataset, frame: Frame | None) -> Figure:
    """Fig. 18: the fuzzy modulus, beside the modulus that the case quotes, and below it fuzzy ν."""
    import matplotlib.pyplot as plt

    drawn, (axes, below) = plt.subplots(
        2, 1, figsize=(look.WIDTH, 1.75 * look.HEIGHT), height_ratios=(3, 2), layout="constrained"
    )
    alpha, ends = dataset["alpha"].values, dataset["E"].values / GPA
    look.shaded_cuts(axes, alpha, ends[:, 0], ends[:, 1])
    quoted = frame.modulus if frame else None
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


SHOWN_LEVEL = 0.5


def membership(dataset: xarray.Dataset) -> Figure:
    """Fig. 19: membership function of a convex fuzzy parameter and one of its α-cuts."""
    drawn, axes = look.figure()
    alpha, ends = dataset["alpha"].values, dataset["E"].values / GPA
    lower, upper = (float(np.interp(SHOWN_LEVEL, alpha, ends[:, side])) for side in (0, 1))
    axes.plot(
        np.concatenate([ends[:, 0], ends[::-1, 1]]),
        np.concatenate([alpha, alpha[::-1]]),
        color=look.INK,
        lw=1.5,
    )
    axes.plot([lower, upper], [SHOWN_LEVEL] * 2, color=look.ORANGE, lw=3, solid_capstyle="butt")
    axes.vlines([lower, upper], 0, SHOWN_LEVEL, color=look.ORANGE, lw=0.8, ls=":")
    axes.annotate(
        f"α-cut at {SHOWN_LEVEL:g}: {lower:.2f} … {upper:.2f}",
        ((lower + upper) / 2, SHOWN_LEVEL + 0.03),
        ha="center",
        color=look.ORANGE,
    )
    axes.annotate(
        "modal value" if np.ptp(ends[-1]) <= 1e-9 * ends[-1].max() else "core",
        (ends[-1].mean(), 1.0),
        xytext=(8, -2),
        textcoords="offset points",
        va="center",
    )
    look.membership_axes(axes, "fuzzy parameter, here E in GPa")
    return drawn


def mapping(results: Results, *, count: int = 40, duration: float = 5.0) -> Figure:
    """Fig. 20: trajectories for parameters inside an α-cut, and the envelope that encloses them."""
    study = next((s for s in results.tasks if len(s.fuzzy) > 1), results.tasks[0])
    dataset = results.envelopes[study.name].isel(alpha=0)
    output = str(dataset["output"].values[-1 if "q" in str(dataset["output"].values[-1]) else 0])
    wanted = results.structure
    assert wanted is not None
    inputs = wanted.inputs(study.fuzzy)
    end = min(duration, study.duration)
    end = round(end / study.section.step) * study.section.step
    scheme = study.section.integrator or ("exact" if wanted.linear else None)
    flow = wanted.flow(tuple(inputs), end, study.section.step, scheme)
    ends = np.array([number.cut(float(dataset["alpha"])) for number in inputs.values()])
    points = np.random.default_rng(0).uniform(ends[:, 0], ends[:, 1], (count, len(ends)))
    curves = flow.values(points)[:, :, list(flow.outputs).index(output)]
    drawn, axes = look.figure()
    axes.plot(flow.time, curves.T, color=look.BLUE, lw=0.5, alpha=0.5)
    axes.plot([], [], color=look.BLUE, lw=0.8, label=f"{count} random trajectories")
    shown = dataset.sel(output=output).isel(time=slice(0, len(flow.time)))
    for side in ("lower", "upper"):
        axes.plot(
            flow.time,
            shown[side],
            color=look.INK,
            lw=1.3,
            label="envelope" if side == "lower" else None,
        )
    rest = f", the first {end:g} of {study.duration:g}"
    axes.set_xlabel("time t, s" + rest * bool(end < study.duration))
    look.prefix_axis(axes, output, Output(output).unit)
    axes.set_title(
        f"Fuzzy mapping of {output} at α = {float(dataset['alpha']):g}", loc="left", fontsize=10
    )
    axes.legend(
        loc="lower left", bbox_to_anchor=(0.45, 1.0), ncols=2, fontsize=8, borderaxespad=0.2
    )
    return drawn


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
        colour, words = MARKS[number % len(MARKS)], f"{probability:g}"
        axes.plot(line, grade, color=colour, lw=1.3, marker="o", ms=3, label=words)
