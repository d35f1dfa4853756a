"""All figures of a microstructure.

Here are distributions of radii (Fig. 11), neighbours (Figs. 6, 7) and r_n (Figs. 12, 13); pictures
of discs are in `cells`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from alphacut.stochastic.figures.cells import (
    EQUAL,
    draw_cells,
    draw_neighbours,
    draw_overlay,
    draw_two_point,
)
from alphacut.stochastic.figures.style import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    PALE,
    figure_style,
    save,
    two_panels,
)
from alphacut.stochastic.microstructure import Microstructure
from alphacut.stochastic.microstructure_summary import to_dataset
from alphacut.stochastic.particles.measured import SectionImage
from alphacut.stochastic.particles.packing import Packing
from alphacut.stochastic.particles.particles import DISCS, Particles
from alphacut.stochastic.particles.radius_laws import LogNormalRadii, RadiusLaw
from alphacut.stochastic.sections import Simulated
from alphacut.stochastic.tessellation.apollonius import (
    Apollonius,
    apollonius,
    neighbouring_values,
    neighbours,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REDUCED = "reduced radius $r_n$ = r/a"
"""Name of the axis."""
Figures = dict[str, Callable[[], "Figure"]]


def draw(result: Microstructure, folder: Path) -> dict[str, list[Path]]:
    """Write every figure of a microstructure as SVG and PNG; return the files of each name."""
    figures = map_figures(result)
    if result.study.shape == DISCS:
        figures |= disc_figures(result)
    with figure_style():
        return {name: save(draw(), folder / name) for name, draw in sorted(figures.items())}


def map_figures(result: Microstructure) -> Figures:
    """Functions that draw radii, cell areas, p-box and radius map, by figure name."""
    source = result.study.source
    law = source.packing.radii if isinstance(source, Simulated) else None
    return {
        "11_radii": lambda: draw_radii(result, law),
        "12_areas": lambda: draw_areas(result),
        "13_pbox": lambda: draw_pbox(result),
        "radius_map": lambda: draw_map(result),
    }


def disc_figures(result: Microstructure) -> Figures:
    """Functions that draw the figures of discs and their cells, by figure name.

    Figures of direct neighbours show discs of one size at the same area fraction, as in the paper.
    """
    first, source = result.sections[0], result.study.source
    generator = np.random.default_rng(result.study.seed)
    few_equal, many_equal = _equal_discs(result, 120), _equal_discs(result, 4000)
    figures: Figures = {
        "03-04_two_point": lambda: draw_two_point(many_equal, generator),
        "05-08_neighbours": lambda: draw_neighbours(few_equal),
        "06-07_neighbour_statistics": lambda: draw_neighbour_statistics(many_equal),
        "09_correlation": lambda: draw_correlation(result, apollonius(many_equal)),
    }
    if (diagram := first.diagram) is not None:
        figures["10_cells"] = lambda: draw_cells(diagram)
    if isinstance(source, SectionImage):
        picture = source.picture()
        figures["image_circles"] = lambda: draw_overlay(picture, first.particles)
    return figures


def _equal_discs(result: Microstructure, number: int) -> Particles:
    """Return a packing of equal discs with the sections' area fraction and mean disc area."""
    discs = [section.particles for section in result.sections]
    radius = float(np.sqrt(np.mean(np.concatenate([packing.radii for packing in discs]) ** 2)))
    fraction = float(np.mean([packing.fraction for packing in discs]))
    packing = Packing(number, min(fraction, DISCS.densest), LogNormalRadii(radius, radius))
    return packing.make(np.random.default_rng([result.study.seed, number]))


def draw_radii(result: Microstructure, law: RadiusLaw | None) -> Figure:
    """Draw the distribution function of the radii, and their law if there is one (Fig. 11)."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 3.8))
    particles = result.study.shape.particles
    values = 1e3 * np.concatenate([section.particles.radii for section in result.sections])
    axes.ecdf(values, color=BLUE, label=f"{len(values)} {particles}")
    if law is not None and law.smallest < law.largest:
        grid = np.linspace(law.smallest, law.largest, 400)
        axes.plot(1e3 * grid, law.cdf(grid), color=ORANGE, ls="--", label=law.label)
    axes.set(xlabel="radius [mm]", ylabel=f"share of {particles}", ylim=(0, 1.02))
    axes.legend()
    return figure


def draw_neighbour_statistics(discs: Particles) -> Figure:
    """Draw distances (Fig. 6) and number (Fig. 7) of direct neighbours of equal discs."""
    figure, (left, right) = two_panels(EQUAL.format(len(discs)))
    direct = neighbours(discs)
    distance, number = direct.distances / (2 * float(discs.radii[0])), direct.number
    left.hist(distance, bins=80, density=True, color=BLUE)
    left.axvline(1, color=ORANGE, label="one diameter")
    left.set(xlabel="distance of direct neighbours / diameter", ylabel="density")
    left.set(xlim=(0.8, np.quantile(distance, 0.999)))
    left.legend()
    counts = np.bincount(number)
    right.bar(np.arange(len(counts)), counts / counts.sum(), color=BLUE)
    right.axvline(number.mean(), color=ORANGE, label=f"mean {number.mean():.4g}")
    right.set(xlabel="number of direct neighbours", ylabel="share of discs")
    right.set(xlim=(2.3, number.max() + 0.7))
    right.legend()
    return figure


def draw_correlation(result: Microstructure, equal: Apollonius) -> Figure:
    """Draw r_n of pairs of cells that share a wall, beside those of equal discs (Fig. 9)."""
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, 2, figsize=(9.6, 4.4))
    diagrams = [section.diagram for section in result.sections if section.diagram]
    titles = "the sections", "equal discs"
    for axes, shown, title in zip(panels, (diagrams, [equal]), titles, strict=True):
        all_pairs = [neighbouring_values(diagram, diagram.reduced_radii) for diagram in shown]
        pairs = np.concatenate(all_pairs, axis=1)
        limits = np.quantile(pairs, (0.0005, 0.9995))  # without outliers
        axes.hist2d(*pairs, bins=80, cmap="Blues", range=[limits, limits])
        axes.set(xlabel="reduced radius of a cell", ylabel="that of a neighbour", aspect="equal")
        axes.set_title(f"{title}: correlation {np.corrcoef(pairs)[0, 1]:+.3f}")
        axes.grid(visible=False)
    return figure


def draw_areas(result: Microstructure) -> Figure:
    """Draw the area or volume of each cell over its reduced radius r_n (Fig. 12).

    Lines show the limits of r_n, a hatched band where a particle would leave its cell.
    """
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 3.8))
    shape, (low, high) = result.study.shape, result.limits
    for section in result.sections:
        radius, measure = section.reduced_radii, 1e3**shape.dimensions * section.cells
        inside = (radius >= low) & (radius <= high)
        for part, size, colour in ((inside, 1.5, GREY), (~inside, 4, BLUE)):
            axes.plot(radius[part], measure[part], ".", ms=size, color=colour, rasterized=True)
    for limit in result.limits:
        axes.axvline(limit, color=BLUE, lw=1)
    bound, unit = shape.largest, {2: "mm²", 3: "mm³"}[shape.dimensions]
    axes.axvspan(bound, bound + 0.07, facecolor="none", edgecolor=GREY, hatch="///", lw=0)
    text = f"{shape.particles[:-1]} larger\nthan its cell "
    axes.text(bound, axes.get_ylim()[1], text, ha="right", va="top", color=GREY)
    axes.set(xlabel=REDUCED, ylabel=f"{shape.cells} of the cell [{unit}]", xlim=(0, bound + 0.07))
    share = f"{100 * result.share_within:.2f} % of the {shape.cells}"
    axes.set_title(f"limits {low:.4g} and {high:.4g} contain {share}")
    return figure


def draw_pbox(result: Microstructure) -> Figure:
    """Draw the distribution function of r_n, its bootstrap band and the p-box (Fig. 13).

    The lower panel shows the differences from the fitted map.
    """
    import matplotlib.pyplot as plt

    figure, (axes, residual_axes) = plt.subplots(
        2, 1, figsize=(6.4, 5.6), height_ratios=(3, 1.4), sharex=True
    )
    table = to_dataset(result)
    radius, cdf = table["r_n"].values, table["cdf"].values
    low, high = np.maximum(cdf - result.band, 0), np.minimum(cdf + result.band, 1)
    band_label = f"band of ± {result.band:.2g}"
    cells_label = f"{len(result.truncated.values)} cells"
    for panel, base in ((axes, 0 * cdf), (residual_axes, table["fitted"].values)):
        scale = 1 if panel is axes else 100
        edges = scale * (low - base), scale * (high - base)
        panel.fill_between(radius, *edges, fc=PALE, label=band_label)
        panel.plot(radius, scale * (cdf - base), color=BLUE, label=cells_label)
        panel.plot(radius, scale * (table["pbox_upper"] - base), color=INK, lw=1, label="p-box")
        panel.plot(radius, scale * (table["pbox_lower"] - base), color=INK, lw=1)
    axes.set(ylabel=f"{result.study.shape.cells}-weighted share", ylim=(0, 1.02))
    residual_axes.set(xlabel=REDUCED, ylabel="less the fit [%]")
    axes.legend(loc="upper left")
    return figure


def draw_map(result: Microstructure) -> Figure:
    """Draw the radius map θ ↦ r_n: quantiles of the sample, fitted cubic, fuzzy bounds (eq. 12)."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 3.8))
    fit, box = result.pbox.fit, result.pbox
    law = fit.distribution
    theta = np.asarray(np.linspace(law.lower, law.upper, 601), float)
    quantiles = result.truncated.quantile(law.cdf(theta))
    axes.step(theta, quantiles, color=BLUE, label="sample")
    fitted = fit.map((box.a2[1], box.a4[1]))
    label = f"$a_2$ = {fitted.a2:.4f}, $a_4$ = {fitted.a4:.4f}"
    axes.plot(theta, fitted(theta), color=ORANGE, ls="--", label=label)
    low, high = box.bounds(theta)
    axes.fill_between(theta, low, high, color=GREY, alpha=0.4, lw=0, label="fuzzy $a_2$, $a_4$")
    axes.set(xlabel="θ, standard deviations", ylabel=REDUCED, ylim=(0, 1))
    axes.legend()
    return figure
