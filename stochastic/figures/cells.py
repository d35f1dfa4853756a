"""Pictures of discs, in their image too, and their cells (Figs. 3, 4, 5, 8, 9, 10)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.stochastic.figures.style import GREEN, GREY, INK, LIGHT, ORANGE, PALE, two_panels
from alphacut.stochastic.particles.particles import Particles
from alphacut.stochastic.tessellation.apollonius import Apollonius, apollonius, neighbours

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

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
