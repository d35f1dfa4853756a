"""Figures 3 to 12 of the paper: packed discs, their neighbours, cells and reduced radii.

    ./enter python -m benchmarks.stochastic.packing_figures [CASE] [--out FOLDER]

The packings are those of the case, cases/concrete.toml unless named.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from scipy.spatial import KDTree

from alphacut.base.arrays import Array
from alphacut.case.content import load
from alphacut.figures import style
from alphacut.figures.microstructure import REDUCED, draw_circles, set_view
from alphacut.figures.style import BLUE, GREEN, GREY, INK, LIGHT, ORANGE, PALE
from alphacut.stochastic import FittedRadiusMap, LogNormalRadii, Particles, fit_radius_map
from alphacut.stochastic.particles.packing import Packing
from alphacut.stochastic.particles.packings import Packings
from alphacut.stochastic.particles.shapes import DISCS
from alphacut.stochastic.tessellation.apollonius import (
    Apollonius,
    apollonius,
    neighbouring_values,
    neighbours,
)

RESULTS = Path(__file__).parents[1] / "results"
CORNER_DISCS = 120  # of a larger section a corner with so many discs is drawn
N_EQUAL = 4000  # equal discs whose direct neighbours are counted
EQUAL = "{} equal discs of the same area fraction, not those of the section"


def draw(packings: Packings, fitted: FittedRadiusMap, folder: Path) -> list[Path]:
    """Write every figure as SVG and PNG; return the files."""
    diagram = fitted.sections[0].diagram
    assert diagram is not None  # of discs
    generator, equal = np.random.default_rng(fitted.seed), _equal_discs(fitted)
    with style.figure_style():
        figures = {
            "03-04-two-point": draw_two_point(equal, generator),
            "05-08-neighbours": draw_neighbours(diagram.discs),
            "06-07-neighbour-statistics": draw_neighbour_statistics(equal),
            "09-correlation": draw_correlation(fitted, apollonius(equal)),
            "10-cells": draw_cells(diagram),
            "11-radii": draw_radii(packings),
            "12-areas": draw_areas(fitted),
        }
        files = [style.save(figure, folder / f"fig{name}") for name, figure in figures.items()]
    return [path for paths in files for path in paths]


def _equal_discs(fitted: FittedRadiusMap) -> Particles:
    """Return a packing of equal discs with the sections' area fraction and mean disc area."""
    discs = [section.particles for section in fitted.sections]
    radius = float(np.sqrt(np.mean(np.concatenate([packing.radii for packing in discs]) ** 2)))
    fraction = float(np.mean([packing.fraction for packing in discs]))
    packing = Packing(N_EQUAL, min(fraction, DISCS.densest), LogNormalRadii(radius, radius))
    return packing.make(np.random.default_rng([fitted.seed, N_EQUAL]))


def draw_radii(packings: Packings) -> Figure:
    """Draw the distribution function of the radii, and their law (Fig. 11)."""
    figure, axes = plt.subplots()
    law = packings.packing.radii
    values = 1e3 * np.concatenate([particles.radii for particles in packings])
    axes.ecdf(values, color=BLUE, label=f"{len(values)} discs")
    if law.smallest < law.largest:
        grid = np.linspace(law.smallest, law.largest, 400)
        if isinstance(law, LogNormalRadii):
            label = f"log-normal, σ$_r$ = {law.sigma:.4f}"
        else:
            label = f"{len(law.values)} values of {law.source}"
        axes.plot(1e3 * grid, law.cdf(grid), color=ORANGE, ls="--", label=label)
    axes.set(xlabel="radius [mm]", ylabel="share of discs", ylim=(0, 1.02))
    axes.legend()
    return figure


def draw_neighbour_statistics(discs: Particles) -> Figure:
    """Draw distances (Fig. 6) and number (Fig. 7) of direct neighbours of equal discs."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 4.0))
    figure.suptitle(EQUAL.format(len(discs)))
    direct = neighbours(discs)
    distance, number = direct.distances / (2 * float(discs.radii[0])), direct.number
    left.hist(distance, bins=80, density=True, color=BLUE)
    left.axvline(1, color=ORANGE, label="one diameter")
    label, farthest = "distance of direct neighbours / diameter", np.quantile(distance, 0.999)
    left.set(xlabel=label, ylabel="density", xlim=(0.8, farthest))
    counts = np.bincount(number)
    right.bar(np.arange(len(counts)), counts / counts.sum(), color=BLUE)
    right.axvline(number.mean(), color=ORANGE, label=f"mean {number.mean():.4g}")
    label, end = "number of direct neighbours", number.max() + 0.7
    right.set(xlabel=label, ylabel="share of discs", xlim=(2.3, end))
    for axes in (left, right):
        axes.legend()
    return figure


def draw_correlation(fitted: FittedRadiusMap, equal: Apollonius) -> Figure:
    """Draw r_n of pairs of cells that share a wall, beside those of equal discs (Fig. 9)."""
    figure, panels = plt.subplots(1, 2, figsize=(9.6, 4.4))
    diagrams = [section.diagram for section in fitted.sections if section.diagram]
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


def draw_areas(fitted: FittedRadiusMap) -> Figure:
    """Draw the size of each cell over its reduced radius r_n, and its limits (Fig. 12)."""
    figure, axes = plt.subplots()
    shape, (low, high) = fitted.shape, fitted.limits
    for section in fitted.sections:
        radius, measure = section.reduced_radii, 1e3**shape.dimensions * section.cells
        inside = (radius >= low) & (radius <= high)
        for part, size, colour in ((inside, 1.5, GREY), (~inside, 4, BLUE)):
            axes.plot(radius[part], measure[part], ".", ms=size, color=colour, rasterized=True)
    for limit in (low, high):
        axes.axvline(limit, color=BLUE, lw=1)
    bound, unit = shape.largest, {2: "mm²", 3: "mm³"}[shape.dimensions]
    axes.axvspan(bound, bound + 0.07, facecolor="none", edgecolor=GREY, hatch="///", lw=0)
    text, top = f"{shape.particles[:-1]} larger\nthan its cell ", axes.get_ylim()[1]
    axes.text(bound, top, text, ha="right", va="top", color=GREY)
    axes.set(xlabel=REDUCED, ylabel=f"{shape.cells} of the cell [{unit}]", xlim=(0, bound + 0.07))
    share = f"{100 * fitted.fraction_within:.2f} % of the {shape.cells}"
    axes.set_title(f"limits {low:.4g} and {high:.4g} contain {share}")
    return figure


def plot_discs(axes: Axes, discs: Particles, colour: str, view: Array) -> None:
    """Draw discs and their periodic images in the corner `view` (m) of the rectangle, in mm."""
    shifts = _shifts(discs)
    centres = np.concatenate([discs.centres + shift for shift in shifts])
    radii = np.tile(discs.radii, len(shifts))
    is_seen = ((centres > -radii[:, None]) & (centres < view + radii[:, None])).all(axis=1)
    draw_circles(axes, centres[is_seen], radii[is_seen], color=colour, lw=0)
    set_view(axes, 0 * view, view)


def plot_cells(axes: Axes, diagram: Apollonius, view: Array) -> None:
    """Draw the curved walls of the cells, with images, in the corner `view` (m), in mm."""
    angle, rho = diagram.walls(24)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    points = diagram.discs.centres[diagram.cell] + rho[..., None] * direction
    walls = np.concatenate([points + shift for shift in _shifts(diagram.discs)], axis=1)
    is_seen = ((walls.max(axis=0) > 0) & (walls.min(axis=0) < view)).all(axis=1)
    lines = list(1e3 * walls[:, is_seen].swapaxes(0, 1))
    axes.add_collection(LineCollection(lines, colors=INK, linewidths=0.8))


def _shifts(discs: Particles) -> list[Array]:
    """Return the shifts of all periodic images of a section, in m; only zero in a window."""
    tiles = (-1, 0, 1) if discs.periodic else (0,)
    return [discs.size * (i, j) for i in tiles for j in tiles]


def _corner_panels(discs: Particles, *titles: str) -> tuple[Figure, list[Axes], Array]:
    """Return a figure with two panels, its axes, and the corner of the section to draw, in m."""
    view = discs.size * min(1.0, float(np.sqrt(CORNER_DISCS / len(discs))))
    width, height = 1e3 * discs.size
    title = f"one section of {width:.4g} × {height:.4g} mm with {len(discs)} discs"
    title = title if (view == discs.size).all() else f"a corner of {title}"
    return *_titled_panels(title, *titles), view


def _titled_panels(title: str, *titles: str) -> tuple[Figure, list[Axes]]:
    figure, panels = plt.subplots(1, 2, figsize=(9.6, 5.0))
    figure.suptitle(title)
    for axes, panel_title in zip(panels, titles, strict=True):
        axes.set_title(panel_title)
    return figure, list(panels)


def draw_cells(diagram: Apollonius) -> Figure:
    """Draw Voronoi cells, whose walls cut discs, beside Apollonius cells (Fig. 10)."""
    discs = diagram.discs
    figure, panels, view = _corner_panels(discs, "Voronoi cells", "Apollonius cells")
    for axes, cells, colour in zip(panels, (_voronoi(discs), diagram), (PALE, LIGHT), strict=True):
        plot_discs(axes, discs, colour, view)
        plot_cells(axes, cells, view)
    return figure


def _voronoi(discs: Particles) -> Apollonius:
    return apollonius(replace(discs, radii=np.zeros(len(discs))))


def draw_neighbours(discs: Particles) -> Figure:
    """Draw the Delaunay triangulation of discs' centres beside their Voronoi cells (Figs. 5, 8)."""
    titles = "Delaunay triangulation: direct neighbours", "Voronoi cells of the centres, its dual"
    figure, panels, view = _corner_panels(discs, *titles)
    direct = neighbours(discs)
    start = discs.centres[direct.first]
    edges = np.stack([start, start + direct.offset], axis=1)
    edges = np.concatenate([edges + shift for shift in _shifts(discs)])
    is_seen = ((edges.max(axis=1) > 0) & (edges.min(axis=1) < view)).all(axis=1)
    for axes in panels:
        plot_discs(axes, discs, LIGHT, view)
    lines = list(1e3 * edges[is_seen])
    panels[0].add_collection(LineCollection(lines, colors=ORANGE, linewidths=0.8))
    plot_cells(panels[1], _voronoi(discs), view)
    return figure


def draw_two_point(discs: Particles, generator: np.random.Generator) -> Figure:
    """Draw why the distribution of pair distances does not describe a packing (Figs. 3, 4)."""
    # left discs drawn independently with the packing's pair distances: they overlap; right its own
    # discs within the same distance, of which only direct neighbours (green) touch the central cell
    reach, radius = 3.5 * discs.spacing, float(discs.radii[0])
    centre = int(np.argmin(np.hypot(*(discs.centres - discs.size / 2).T)))
    indices = np.arange(len(discs), dtype=np.intp)
    offset = discs.separation(np.full(len(discs), centre, np.intp), indices)
    near = offset[(np.hypot(*offset.T) < reach) & (indices != centre)]
    direct = neighbours(discs)
    direct_offsets = {tuple(np.round(v, 12)) for v in direct.offset[direct.first == centre]}
    colours = [GREEN if tuple(np.round(v, 12)) in direct_offsets else LIGHT for v in near]
    pairs = KDTree(discs.centres, boxsize=discs.size).query_pairs(reach, output_type="ndarray")
    pair_distances = np.hypot(*discs.separation(pairs[:, 0], pairs[:, 1]).T)
    radial = generator.choice(pair_distances, len(near))
    angle = 2 * np.pi * generator.random(len(near))
    drawn = radial[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    distance = np.hypot(*np.moveaxis(drawn[:, None] - drawn[None], -1, 0))
    np.fill_diagonal(distance, np.inf)
    n_overlaps = int((distance.min(axis=1) < 2 * radius).sum())
    figure, panels = _titled_panels(
        EQUAL.format(len(discs)),
        f"pair distances alone: {n_overlaps} of {len(drawn)} overlap",
        f"the packing: {colours.count(GREEN)} of {len(near)} are direct neighbours",
    )
    limit = np.full(2, reach + radius)
    for axes, centres, colour in zip(panels, (drawn, near), (LIGHT, colours), strict=True):
        draw_circles(axes, np.zeros((1, 2)), np.array([radius]), color=ORANGE)
        radii = np.full(len(centres), radius)
        draw_circles(axes, centres, radii, facecolor=colour, edgecolor=GREY, alpha=0.8)
        set_view(axes, -limit, limit)
    return figure


def main(arguments: Sequence[str] | None = None) -> None:
    """Packs, fits, draws, and prints the files."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("case", nargs="?", default="cases/concrete.toml", help="case file")
    parser.add_argument("--workers", type=int, default=1, help="processes (1)")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder of the figures")
    options = parser.parse_args(arguments)
    section = load(options.case).content.microstructure
    if section is None or section.packing is None:
        parser.error(f"{options.case} has no [microstructure.packing]")
    packings = section.packing.pack(spheres=False, seed=section.seed, workers=options.workers)
    fitted = fit_radius_map(
        packings, limits=section.limits, seed=section.seed, workers=options.workers
    )
    for path in draw(packings, fitted, options.out):
        print(path)


if __name__ == "__main__":
    main()
