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
    """Writes the figures of a radius map as SVG and PNG."""
    with style.figure_style():
        style.save(draw_pbox(fitted), folder / "pbox")
        style.save(draw_map(fitted), folder / "radius_map")
        if section.image is not None:
            picture = section_picture(section.image.file)
            overlay = draw_overlay(picture, fitted.sections[0].particles)
            style.save(overlay, folder / "image_circles")


def draw_pbox(fitted: FittedRadiusMap) -> Figure:
    """Draws the distribution of r_n, its bootstrap band and p-box, also less the fit (Fig. 13)."""
    size, ratios = (6.4, 5.6), (3, 1.4)
    figure, panels = plt.subplots(2, 1, figsize=size, height_ratios=ratios, sharex=True)
    axes, residual_axes = panels
    table = fitted.to_dataset()
    radius, cdf = table["r_n"].values, table["cdf"].values
    low, high = np.maximum(cdf - fitted.band, 0), np.minimum(cdf + fitted.band, 1)
    cells, band_label = len(fitted.truncated.values), f"band of ± {fitted.band:.2g}"
    for panel, base in ((axes, 0 * cdf), (residual_axes, table["fitted"].values)):
        scale = 1 if panel is axes else 100
        edges = scale * (low - base), scale * (high - base)
        panel.fill_between(radius, *edges, fc=PALE, label=band_label)
        panel.plot(radius, scale * (cdf - base), color=BLUE, label=f"{cells} cells")
        for name, label in (("pbox_upper", "p-box"), ("pbox_lower", None)):
            panel.plot(radius, scale * (table[name] - base), color=INK, lw=1, label=label)
    axes.set(ylabel=f"{fitted.shape.cells}-weighted share", ylim=(0, 1.02))
    residual_axes.set(xlabel=REDUCED, ylabel="less the fit [%]")
    axes.legend(loc="upper left")
    return figure


def draw_map(fitted: FittedRadiusMap) -> Figure:
    """Draws the radius map θ ↦ r_n: quantiles of the sample, fitted cubic and fuzzy bounds."""
    figure, axes = plt.subplots()
    box, law = fitted.pbox, fitted.pbox.fit.distribution
    theta = np.asarray(np.linspace(law.lower, law.upper, 601), float)
    axes.step(theta, fitted.truncated.quantile(law.cdf(theta)), color=BLUE, label="sample")
    nominal = box.fit.map((box.a2[1], box.a4[1]))
    label, of_box = f"$a_2$ = {nominal.a2:.4f}, $a_4$ = {nominal.a4:.4f}", "fuzzy $a_2$, $a_4$"
    axes.plot(theta, nominal(theta), color=ORANGE, ls="--", label=label)
    axes.fill_between(theta, *box.bounds(theta), color=GREY, alpha=0.4, lw=0, label=of_box)
    axes.set(xlabel="θ, standard deviations", ylabel=REDUCED, ylim=(0, 1))
    axes.legend()
    return figure


def draw_circles(
    axes: Axes, centres: Array, radii: Array, **look: str | float | Sequence[str]
) -> None:
    """Draws circles, of centres (n, 2) and radii (n,) in m, on axes in mm."""
    width = 2e3 * radii
    position = {"offsets": 1e3 * centres, "offset_transform": axes.transData}
    axes.add_collection(EllipseCollection(width, width, 0 * width, units="xy", **position, **look))


def set_view(axes: Axes, low: Array, high: Array) -> None:
    """Sets the axes' limits, given in m, to mm of equal scale, without grid."""
    axes.set(xlim=1e3 * np.array([low[0], high[0]]), ylim=1e3 * np.array([low[1], high[1]]))
    axes.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
    axes.grid(visible=False)


def draw_overlay(picture: Array, discs: Particles) -> Figure:
    """Draws the grey image (rows, columns) with the outline of every circle found in it."""
    width, height = 1e3 * discs.size
    figure, axes = plt.subplots(figsize=(6.4, 6.4 * float(np.clip(height / width, 0.5, 1.6))))
    axes.imshow(picture, cmap="gray", extent=(0, width, 0, height), interpolation="none")
    look = {"facecolors": "none", "edgecolors": ORANGE}
    draw_circles(axes, discs.centres, discs.radii, linewidths=1.0, **look)
    set_view(axes, 0 * discs.size, discs.size)
    axes.set_title(f"{len(discs)} circles; what has no outline was left out")
    return figure
