"""Random radius and fuzzy modulus (Figs. 13, 14, 16 to 19), and the proved modulus of an image."""

from __future__ import annotations

import itertools
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from alphacut.base.arrays import Array
from alphacut.base.number_text import axis_prefix
from alphacut.case.material import RadiusMapSection
from alphacut.figures import style
from alphacut.figures.style import BLUE, GREY, HEIGHT, INK, ORANGE, PURPLE, WIDTH
from alphacut.fuzzy import FuzzyNumber
from alphacut.stages.cell import GPA
from alphacut.stages.modulus import ModulusResult
from alphacut.stages.store import StageResult
from alphacut.stochastic import HermiteMap

SHOWN_LEVEL = 0.5


def distribution(radius: HermiteMap, at: Array) -> Array:
    """Probabilities P(r ≤ at) of the radius under the law of θ, in the shape of `at`."""
    law = radius.distribution
    theta = np.linspace(law.lower, law.upper, 4001)
    radii, mass = radius((theta[1:] + theta[:-1]) / 2), np.diff(law.cdf(theta))  # of each piece
    order = np.argsort(radii, kind="stable")  # the map need not rise
    cdf = np.cumsum(mass[order]) - mass[order] / 2
    return np.asarray(np.interp(at, radii[order], cdf, left=0.0, right=1.0))


def p_box(section: RadiusMapSection) -> Figure:
    """Fig. 13: p-box of the reduced radius, between the maps at the corners of the supports."""
    figure, axes = plt.subplots()
    corners = itertools.product(*(set(number.support) for number in section.numbers.values()))
    maps = [section.at(dict(zip(section.numbers, corner, strict=True))) for corner in corners]
    lowest, highest = np.array([radius.extremes() for radius in maps]).T
    at = np.asarray(np.linspace(lowest.min(), highest.max(), 600), float)
    family = np.array([distribution(radius, at) for radius in maps])
    ends, shade = (family.min(0), family.max(0)), "p-box, α = 0"
    axes.fill_between(at, *ends, color=PURPLE, alpha=0.15, lw=0, label=shade)
    axes.plot(at, np.transpose(ends), color=INK, lw=1)
    nominal = distribution(section.nominal, at)
    axes.plot(at, nominal, color=PURPLE, lw=1.8, label="nominal map")
    axes.set(xlabel="reduced radius r$_n$ = r/a", ylabel="cumulative distribution", ylim=(0, 1.02))
    axes.legend(loc="lower right")
    return figure


def cone(section: RadiusMapSection) -> Figure:
    """Fig. 14: the particle in the product domain, of radius r(θ) at every θ."""
    figure = plt.figure(figsize=(5.0, 5.4))
    axes: Any = figure.add_subplot(projection="3d")
    radius = section.nominal
    theta, angle = np.linspace(*section.theta, 80)[:, None], np.linspace(0, 2 * np.pi, 80)
    x, y = radius(theta) * np.cos(angle), radius(theta) * np.sin(angle)
    axes.plot_surface(x, y, np.broadcast_to(theta, (80, 80)), color=PURPLE, alpha=0.65, lw=0)
    low, high = section.theta
    for level in np.linspace(low, high, 5):
        axes.plot([-1, 1, 1, -1, -1], [-1, -1, 1, 1, -1], level, color=GREY, lw=0.8)
        x, y = radius(level) * np.cos(angle), radius(level) * np.sin(angle)
        axes.plot(x, y, level, color=INK, lw=0.8)
    for x, y in itertools.product((-1, 1), (-1, 1)):
        axes.plot([x, x], [y, y], [low, high], color=GREY, lw=0.8)
    axes.set(xlabel="x$_1$/a", ylabel="x$_2$/a", zlabel="θ", xticks=[-1, 0, 1], yticks=[-1, 0, 1])
    axes.set_box_aspect((1, 1, 1.3), zoom=0.88)
    axes.view_init(elev=18, azim=-55)
    return figure


def levels_of_samples(dataset: xarray.Dataset) -> Array:
    """Membership of each sample: the highest level whose cuts hold all its inputs, (samples,)."""
    points, alpha = dataset["point"].values, dataset["alpha"].values
    extreme_points = dataset["E_at"].values  # (alpha, bound, parameter)
    low, high = extreme_points.min(axis=1), extreme_points.max(axis=1)  # (alpha, parameter)
    slack = 1e-9 * np.maximum(high[0] - low[0], 1e-300)
    levels = np.full(len(points), alpha[0])
    for level, lower, upper in zip(alpha, low, high, strict=True):
        levels[((points >= lower - slack) & (points <= upper + slack)).all(axis=1)] = level
    return levels


def stress_curves(dataset: xarray.Dataset) -> Figure:
    """Fig. 16: homogenised stress σ₁₁ over θ, one curve a sample, coloured by its membership."""
    figure, axes = plt.subplots()
    alpha = dataset["alpha"].values
    shades = dict(zip(alpha, [*style.colours(alpha)[:-1], INK], strict=True))
    membership = levels_of_samples(dataset)
    theta, stress_GPa = dataset["theta"].values, dataset["curve11"].values / GPA
    for sample in np.argsort(membership, kind="stable"):  # high memberships on top
        axes.plot(theta, stress_GPa[sample], color=shades[membership[sample]], lw=0.8)
    label = "homogenised σ$_{11}$(ε$^{(1)}$) (GPa)"
    axes.set(xlabel="θ", ylabel=label, title=f"{len(stress_GPa)} samples")
    style.alpha_legend(axes, alpha)
    return figure


def mean_stress(dataset: xarray.Dataset) -> Figure:
    """Fig. 17: mean homogenised stress σ₁₁ of each sample at its membership, and its α-cuts."""
    figure, axes = plt.subplots()
    means, levels = dataset["s11_sample"].values / GPA, levels_of_samples(dataset)
    axes.plot(means, levels, ".", color=ORANGE, ms=4, zorder=4, label="samples")
    style.shaded_cuts(axes, dataset["alpha"].values, *(dataset["s11"].values / GPA).T)
    style.membership_axes(axes, "mean homogenised σ$_{11}$(ε$^{(1)}$) (GPa)")
    axes.legend(loc="upper left")
    return figure


def fuzzy_modulus(result: StageResult[ModulusResult], stated: FuzzyNumber | None) -> Figure:
    """Fig. 18: fuzzy Young's modulus, with the one that the case states, and Poisson's ratio ν."""
    size = (WIDTH, 1.75 * HEIGHT)
    figure, (axes, below) = plt.subplots(2, 1, figsize=size, height_ratios=(3, 2))
    dataset, average = result.arrays, result.numbers.average
    alpha, modulus_GPa = dataset["alpha"].values, dataset["E"].values / GPA
    style.shaded_cuts(axes, alpha, *modulus_GPa.T)
    if stated is not None:
        cuts = np.array([stated.cut(level) for level in (0.0, 1.0)]) / GPA
        line: style.Look = {"color": BLUE, "lw": 1.2, "ls": "--", "label": "quoted in the case"}
        axes.plot(style.outline(*cuts.T), [0, 1, 1, 0], **line)
        axes.plot([], [], color=INK, marker="o", ms=3.5, lw=1.2, label="computed here")
        axes.legend(loc="upper left")
    style.membership_axes(axes, f"effective Young's modulus E, {average} (GPa)")
    style.shaded_cuts(below, alpha, *dataset["nu"].transpose("bound", "alpha").values)
    style.membership_axes(below, "effective Poisson's ratio ν of the same")
    return figure


def membership(dataset: xarray.Dataset) -> Figure:
    """Fig. 19: membership function of a convex fuzzy parameter and one of its α-cuts."""
    figure, axes = plt.subplots()
    alpha, (left, right) = dataset["alpha"].values, dataset["E"].values.T / GPA
    lower, upper = (float(np.interp(SHOWN_LEVEL, alpha, side)) for side in (left, right))
    axes.plot(style.outline(left, right), style.outline(alpha, alpha), color=INK, lw=1.5)
    axes.plot([lower, upper], [SHOWN_LEVEL] * 2, color=ORANGE, lw=3, solid_capstyle="butt")
    axes.vlines([lower, upper], 0, SHOWN_LEVEL, color=ORANGE, lw=0.8, ls=":")
    words, spot = f"α-cut at {SHOWN_LEVEL:g}: {lower:.2f} … {upper:.2f}", (lower + upper) / 2
    axes.annotate(words, (spot, SHOWN_LEVEL + 0.03), ha="center", color=ORANGE)
    beside: style.Look = {"xytext": (8, -2), "textcoords": "offset points", "va": "center"}
    axes.annotate("core", ((left[-1] + right[-1]) / 2, 1.0), **beside)
    style.membership_axes(axes, "fuzzy parameter, here E (GPa)")
    return figure


def image(dataset: xarray.Dataset) -> Figure:
    """Phases of an image, or of a volume on three planes in its middle, and the α-cuts of E.

    Pixels and voxels whose phase the fuzzy threshold leaves open on the lowest level are orange.
    """
    phase, is_open = dataset["phase"], dataset["is_open"]
    lengths = dict(zip(phase.dims, dataset.attrs["lengths"], strict=True))
    factor, unit = axis_prefix(max(phase.sizes[axis] * lengths[axis] for axis in phase.dims), "m")
    # by the axis across each picture, None of an image
    planes = [*phase.dims[::-1]] if phase.ndim == 3 else [None]
    mosaic: Any = [[*map(str, planes)], ["E"] * 3] if phase.ndim == 3 else [["None", "E"]]
    size = (WIDTH, 5.6) if phase.ndim == 3 else (WIDTH, 3.8)
    figure = plt.figure(figsize=size)
    axes = figure.subplot_mosaic(mosaic)
    for across in planes:
        place = {} if across is None else {across: phase.sizes[across] // 2}
        picture, (up, right) = axes[str(across)], phase.isel(place).dims
        ends = [factor * lengths[axis] * phase.sizes[axis] for axis in (right, up)]
        look: style.Look = {"origin": "lower", "extent": (0, ends[0], 0, ends[1])}
        look["interpolation"] = "nearest"
        greys = ListedColormap(_phase_greys(dataset))
        shown = phase.isel(place).values
        picture.imshow(shown, cmap=greys, vmin=-0.5, vmax=greys.N - 0.5, **look)
        mask = np.where(is_open.isel(place).values, 1.0, np.nan)
        picture.imshow(mask, cmap=ListedColormap([ORANGE]), **look)
        picture.set(xlabel=f"{right} ({unit})", ylabel=f"{up} ({unit})")
        picture.grid(visible=False)
        if across is not None:
            picture.set_title(f"{across} = {factor * lengths[across] * place[across]:.4g} {unit}")
    patches = [
        Patch(facecolor=grey, edgecolor=INK, lw=0.5, label=name)
        for grey, name in zip(_phase_greys(dataset), _phase_names(dataset), strict=True)
    ]
    if is_open.values.any():
        level, kind = dataset["alpha"].values[0], "voxels" if phase.ndim == 3 else "pixels"
        label = f"open at α = {level:g}: {float(is_open.mean()):.2%} of the {kind}"
        patches.append(Patch(facecolor=ORANGE, label=label))
    figure.legend(handles=patches, loc="outside lower left", ncols=len(patches))
    lower, upper = dataset["E"].transpose("bound", "alpha").values / GPA
    style.shaded_cuts(axes["E"], dataset["alpha"].values, lower, upper)
    where = ", plane strain" if phase.ndim == 2 else ""
    style.membership_axes(axes["E"], f"Young's modulus E{where} (GPa)")
    return figure


def _phase_names(dataset: xarray.Dataset) -> list[str]:
    """Names of the phases, dark first; a file holds one name as a text."""
    return [*np.atleast_1d(dataset.attrs["phases"])]


def _phase_greys(dataset: xarray.Dataset) -> list[tuple[float, float, float]]:
    """Grey of each phase, from dark to light, apart from the white of the paper."""
    return [(x, x, x) for x in np.linspace(0.45, 0.95, len(_phase_names(dataset)))]
