"""All figures of a microstructure.

Here are distributions of radii (Fig. 11), neighbours (Figs. 6, 7) and r_n (Figs. 12, 13); pictures
of discs are in `cells`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.stochastic.figures.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    LIGHT,
    ORANGE,
    PALE,
    figure_style,
    save,
    two_panels,
)
from alphacut.stochastic.microstructure import Microstructure, to_dataset
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
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

REDUCED = "reduced radius $r_n$ = r/a"
"""Name of the axis."""


def draw(result: Microstructure, folder: Path) -> dict[str, list[Path]]:
    """Write every figure of a microstructure as SVG and PNG; return the files of each name.

    Figures of direct neighbours show discs of one size at the same area fraction, as in the paper.
    """
    first, source = result.sections[0], result.study.source
    law = source.packing.radii if isinstance(source, Simulated) else None
    figures: dict[str, Callable[[], Figure]] = {
        "11_radii": lambda: draw_radii(result, law),
        "12_areas": lambda: draw_areas(result),
        "13_pbox": lambda: draw_pbox(result),
        "radius_map": lambda: draw_map(result),
    }
    if result.study.shape == DISCS:
        generator = np.random.default_rng(result.study.seed)
        few_equal, many_equal = _equal_discs(result, 120), _equal_discs(result, 4000)
        figures |= {
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
    with figure_style():
        return {name: save(draw(), folder / name) for name, draw in sorted(figures.items())}


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


CORNER_DISCS = 120  # of a larger section a corner with so many discs is drawn
EQUAL = "{} equal discs of the same area fraction, not those of the section"


def _circles(axes: Axes, centres: Array, radii: Array, **look: Any) -> None:
    """Draw circles by centres, shape (n, 2), and radii, shape (n,), in m, on axes in mm."""
    from matplotlib.collections import EllipseCollection

    width = 2e3 * radii
    position = {"offsets": 1e3 * centres, "offset_transform": axes.transData}
    axes.add_collection(EllipseCollection(width, width, 0 * width, units="xy", **position, **look))


def _view(axes: Axes, low: Array, high: Array) -> None:
    """Set the axes' limits, given in m, to mm of equal scale, without grid."""
    axes.set(xlim=1e3 * np.array([low[0], high[0]]), ylim=1e3 * np.array([low[1], high[1]]))
    axes.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
    axes.grid(visible=False)


def plot_discs(axes: Axes, discs: Particles, colour: str, view: Array | None = None) -> None:
    """Draw discs and their periodic images in the rectangle, or in its corner `view` (m), in mm."""
    view, shifts = discs.size if view is None else view, _shifts(discs)
    centres = np.concatenate([discs.centres + shift for shift in shifts])
    radii = np.tile(discs.radii, len(shifts))
    is_seen = ((centres > -radii[:, None]) & (centres < view + radii[:, None])).all(axis=1)
    _circles(axes, centres[is_seen], radii[is_seen], color=colour, lw=0)
    _view(axes, 0 * view, view)


def plot_cells(axes: Axes, diagram: Apollonius, view: Array | None = None) -> None:
    """Draw the curved walls of the cells, with images, in the rectangle or its corner `view`."""
    from matplotlib.collections import LineCollection

    discs = diagram.discs
    view = discs.size if view is None else view
    angle, rho = diagram.walls(24)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    points = discs.centres[diagram.cell] + rho[..., None] * direction
    walls = np.concatenate([points + shift for shift in _shifts(discs)], axis=1)
    is_seen = ((walls.max(axis=0) > 0) & (walls.min(axis=0) < view)).all(axis=1)
    lines = list(1e3 * walls[:, is_seen].swapaxes(0, 1))
    axes.add_collection(LineCollection(lines, colors=INK, linewidths=0.8))


def _shifts(discs: Particles) -> list[Array]:
    """Return the shifts of all periodic images of a section, in m; only zero in a window."""
    tiles = (-1, 0, 1) if discs.periodic else (0,)
    return [discs.size * (i, j) for i in tiles for j in tiles]


def draw_cells(diagram: Apollonius) -> Figure:
    """Draw Voronoi cells, whose walls cut discs, beside Apollonius cells (Fig. 10)."""
    discs = diagram.discs
    view = discs.size * min(1.0, float(np.sqrt(CORNER_DISCS / len(discs))))
    width, height = 1e3 * discs.size
    title = f"one section of {width:.4g} × {height:.4g} mm with {len(discs)} discs"
    title = title if (view == discs.size).all() else f"a corner of {title}"
    figure, (left, right) = two_panels(title, "Voronoi cells", "Apollonius cells")
    points = Particles(discs.centres, np.zeros(len(discs)), discs.size, discs.periodic)
    for axes, shown, colour in ((left, apollonius(points), PALE), (right, diagram, LIGHT)):
        plot_discs(axes, discs, colour, view)
        plot_cells(axes, shown, view)
    return figure


def draw_neighbours(discs: Particles) -> Figure:
    """Draw the Delaunay triangulation of equal discs beside their Voronoi cells (Figs. 5, 8)."""
    from matplotlib.collections import LineCollection

    titles = "Delaunay triangulation: the direct neighbours", "Voronoi cells, its dual"
    figure, (left, right) = two_panels(EQUAL.format(len(discs)), *titles)
    direct = neighbours(discs)
    start = discs.centres[direct.first]
    edges = list(1e3 * np.stack([start, start + direct.offset], axis=1))
    for axes in (left, right):
        plot_discs(axes, discs, LIGHT)
    left.add_collection(LineCollection(edges, colors=ORANGE, linewidths=0.8))
    plot_cells(right, apollonius(discs))
    return figure


def draw_two_point(discs: Particles, generator: np.random.Generator) -> Figure:
    """Draw why the distribution of pair distances does not describe a packing (Figs. 3, 4).

    Left others drawn independently with the packing's pair distances: they overlap. Right the true
    discs within the same distance; only direct neighbours (green) touch the centre's cell.
    """
    reach, radius = 3.5 * discs.spacing, float(discs.radii[0])
    centre = int(np.argmin(np.hypot(*(discs.centres - discs.size / 2).T)))
    indices = np.arange(len(discs), dtype=np.intp)
    offset = discs.separation(np.full(len(discs), centre, np.intp), indices)
    near = offset[(np.hypot(*offset.T) < reach) & (indices != centre)]
    direct = neighbours(discs)
    direct_offsets = {tuple(np.round(v, 12)) for v in direct.offset[direct.first == centre]}
    colours = [GREEN if tuple(np.round(v, 12)) in direct_offsets else LIGHT for v in near]
    drawn = _from_pair_distances(discs, len(near), reach, generator)
    figure, panels = two_panels(
        EQUAL.format(len(discs)),
        f"pair distances alone: {_overlaps(drawn, radius)} of {len(drawn)} overlap",
        f"the packing: {colours.count(GREEN)} of {len(near)} are direct neighbours",
    )
    limit = np.full(2, reach + radius)
    for axes, centres, colour in zip(panels, (drawn, near), (LIGHT, colours), strict=True):
        _circles(axes, np.zeros((1, 2)), np.array([radius]), color=ORANGE)
        radii = np.full(len(centres), radius)
        _circles(axes, centres, radii, facecolor=colour, edgecolor=GREY, alpha=0.8)
        _view(axes, -limit, limit)
    return figure


def _from_pair_distances(
    discs: Particles, number: int, reach: float, generator: np.random.Generator
) -> Array:
    """Return points (number, 2), in m, at random angles and pair distances of the discs."""
    from scipy.spatial import KDTree

    tree = KDTree(discs.centres, boxsize=discs.size)
    pairs = tree.query_pairs(reach, output_type="ndarray")
    offset = discs.separation(pairs[:, 0], pairs[:, 1])
    distance = generator.choice(np.hypot(offset[:, 0], offset[:, 1]), number)
    angle = 2 * np.pi * generator.random(number)
    return np.asarray(distance[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))


def _overlaps(places: Array, radius: float) -> int:
    """Return the number of discs of equal `radius` at centres (n, 2) that overlap another one."""
    distance = np.hypot(*np.moveaxis(places[:, None] - places[None], -1, 0))
    np.fill_diagonal(distance, np.inf)
    return int((distance.min(axis=1) < 2 * radius).sum())


def draw_overlay(picture: Array, discs: Particles) -> Figure:
    """Draw the grey image (rows, columns) with the outline of every circle found in it."""
    import matplotlib.pyplot as plt

    width, height = 1e3 * discs.size
    figure, axes = plt.subplots(figsize=(6.4, 6.4 * float(np.clip(height / width, 0.5, 1.6))))
    axes.imshow(picture, cmap="gray", extent=(0, width, 0, height), interpolation="none")
    outline = {"facecolors": "none", "edgecolors": ORANGE, "linewidths": 1.0}
    _circles(axes, discs.centres, discs.radii, **outline)
    _view(axes, 0 * discs.size, discs.size)
    axes.set_title(f"{len(discs)} circles; what has no outline was left out", fontsize="medium")
    return figure
