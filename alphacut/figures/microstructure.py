"""Figures of a radius map that was fitted to particles: its p-box, the map, circles of an image."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure

from alphacut.base.arrays import Array
from alphacut.case.microstructure import MicrostructureSection
from alphacut.figures import style
from alphacut.figures.style import BLUE, GREY, INK, ORANGE, PALE
from alphacut.stochastic import FittedRadiusMap, Particles
from alphacut.stochastic.particles.measured import section_picture

REDUCED = "reduced radius $r_n$ = r/a"
"""Name of an axis."""


def draw(fitted: FittedRadiusMap, folder: Path, section: MicrostructureSection) -> None:
    """Write the figures of a radius map into a folder, each as SVG and PNG.

    They are "pbox", the distribution of the radius with its bounds; "radius_map", the map itself;
    and "image_circles", the circles found in an image, if the particles come from one.

    Args:
        fitted: The fitted map and the particles.
        folder: The folder, which is made if it is missing.
        section: Section of the case, which names the file of the image.

    Raises:
        OSError: A file cannot be read or written.
    """
    with style.figure_style():
        style.save(draw_pbox(fitted), folder / "pbox")
        style.save(draw_map(fitted), folder / "radius_map")
        if section.image is not None:
            picture = section_picture(section.image.file)
            overlay = draw_overlay(picture, fitted.sections[0].particles)
            style.save(overlay, folder / "image_circles")


def draw_pbox(fitted: FittedRadiusMap) -> Figure:
    """Draw the distribution of the reduced radius r_n, and the p-box of the fuzzy map.

    r_n is the radius divided by half the side of a square or cube as large as the cell of a
    particle. The lower panel shows the same curves less the distribution of the fit, in per cent.

    Args:
        fitted: The radius map, and the sample that it was fitted to.
    """
    # Both distributions differ by a per cent or so, which is the width of a line above: the lower
    # panel shows it.
    size = (6.4, 5.6)
    ratios = (3, 1.4)
    figure, (axes, residual_axes) = plt.subplots(
        2, 1, figsize=size, height_ratios=ratios, sharex=True
    )
    table = fitted.to_dataset()
    draw_distribution(axes, fitted, base=np.zeros(len(table["cdf"])), scale=1.0)
    draw_distribution(residual_axes, fitted, base=table["fitted"].values, scale=100.0)
    axes.set(ylabel=f"{fitted.shape.cells}-weighted fraction", ylim=(0, 1.02))
    residual_axes.set(xlabel=REDUCED, ylabel="less the fit [%]")
    axes.legend(loc="upper left")
    return figure


def draw_distribution(axes: Axes, fitted: FittedRadiusMap, *, base: Array, scale: float) -> None:
    """Draw distribution, bootstrap band and p-box, less `base` and times `scale`.

    Args:
        axes: Axes that are drawn on.
        fitted: The radius map and the sample that it was fitted to.
        base: Distribution that is subtracted, at the radii of the dataset of `fitted`.
        scale: Factor of what is left.
    """
    table = fitted.to_dataset()
    radius = table["r_n"].values
    cdf = table["cdf"].values
    # A distribution function lies between 0 and 1: the band is cut off there before `base` is
    # subtracted.
    low = scale * (np.maximum(cdf - fitted.band, 0) - base)
    high = scale * (np.minimum(cdf + fitted.band, 1) - base)
    axes.fill_between(radius, low, high, fc=PALE, label=f"band of ± {fitted.band:.2g}")
    cells = f"{len(fitted.truncated.values)} cells"
    axes.plot(radius, scale * (cdf - base), color=BLUE, label=cells)
    # One entry in the legend stands for both bounds.
    axes.plot(radius, scale * (table["pbox_upper"] - base), color=INK, lw=1, label="p-box")
    axes.plot(radius, scale * (table["pbox_lower"] - base), color=INK, lw=1)


def draw_map(fitted: FittedRadiusMap) -> Figure:
    """Draw the radius map from the random variable θ to the reduced radius r_n.

    Shown are the quantiles of the sample, the fitted cubic at its nominal slopes, and the bounds of
    all maps with slopes in the supports of the fuzzy a2 and a4.

    Args:
        fitted: The radius map, and the sample that it was fitted to.
    """
    figure, axes = plt.subplots()
    box = fitted.pbox
    distribution = fitted.pbox.fit.distribution
    # The exact map is r(θ) = F⁻¹(F_Θ(θ)): the quantile of the sample at the probability of θ.
    theta = np.asarray(np.linspace(distribution.lower, distribution.upper, 601), float)
    axes.step(theta, fitted.truncated.quantile(distribution.cdf(theta)), color=BLUE, label="sample")
    nominal = box.fit.map((box.a2.nominal, box.a4.nominal))
    label = f"$a_2$ = {nominal.a2:.4f}, $a_4$ = {nominal.a4:.4f}"
    axes.plot(theta, nominal(theta), color=ORANGE, ls="--", label=label)
    lower, upper = box.bounds(theta)
    fuzzy = "fuzzy $a_2$, $a_4$"
    axes.fill_between(theta, lower, upper, color=GREY, alpha=0.4, lw=0, label=fuzzy)
    axes.set(xlabel="θ, standard deviations", ylabel=REDUCED, ylim=(0, 1))
    axes.legend()
    return figure


def draw_circles(
    axes: Axes, centres: Array, radii: Array, **look: str | float | Sequence[str]
) -> None:
    """Draw circles on axes in mm.

    Args:
        axes: Axes that are drawn on.
        centres: Shape (n, 2), in m.
        radii: Shape (n,), in m.
        look: Keyword arguments of Matplotlib's collections, such as `facecolors`.
    """
    diameters = 2e3 * radii  # in mm
    position = {"offsets": 1e3 * centres, "offset_transform": axes.transData}
    angles = np.zeros_like(diameters)
    axes.add_collection(
        EllipseCollection(diameters, diameters, angles, units="xy", **position, **look)
    )


def set_view(axes: Axes, low: Array, high: Array) -> None:
    """Set the limits of axes, given in m as (x, y), to mm of equal scale, without grid."""
    left, bottom = 1e3 * low
    right, top = 1e3 * high
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    axes.set(xlabel="x [mm]", ylabel="y [mm]")
    axes.grid(visible=False)


def draw_overlay(picture: Array, discs: Particles) -> Figure:
    """Draw the grey image of a section, with the outline of every circle found in it.

    Args:
        picture: Grey values, shape (rows, columns), the first row on top.
        discs: The circles, and the size of the section in m.
    """
    width, height = 1e3 * discs.size
    # Very long or high sections would have room for nothing else on a page.
    aspect = float(np.clip(height / width, 0.5, 1.6))
    figure, axes = plt.subplots(figsize=(6.4, 6.4 * aspect))
    axes.imshow(picture, cmap="gray", extent=(0, width, 0, height), interpolation="none")
    look = {"facecolors": "none", "edgecolors": ORANGE}
    draw_circles(axes, discs.centres, discs.radii, linewidths=1.0, **look)
    set_view(axes, np.zeros(2), discs.size)
    axes.set_title(f"{len(discs)} circles; what has no outline was left out")
    return figure
