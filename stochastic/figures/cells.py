"""Pictures of discs, in their image too, of spheres, and their cells (Figs. 3, 4, 5, 8, 9, 10)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.stochastic.figures.style import BLUE, GREEN, GREY, INK, ORANGE, PALE
from alphacut.stochastic.particles.discs import Discs
from alphacut.stochastic.spheres.spheres import Spheres
from alphacut.stochastic.tessellation.apollonius import Apollonius, apollonius
from alphacut.stochastic.tessellation.delaunay import neighbours
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PIXELS = 500  # along an edge of the view
NEAREST = 24  # spheres among which the cell of a point is sought
SPHERES = 60  # circles in the view, about


def plot_discs(axes: Axes, discs: Discs, colour: str = BLUE, view: Array | None = None) -> None:
    """Discs in their rectangle, or in its corner `view` (m), with their images, in mm."""
    from matplotlib.collections import EllipseCollection

    view = discs.size if view is None else view
    centres = np.concatenate([discs.centres + shift for shift in _shifts(discs)])
    radii = np.tile(discs.radii, len(_shifts(discs)))
    seen = ((centres > -radii[:, None]) & (centres < view + radii[:, None])).all(axis=1)
    centres, width = centres[seen], 2e3 * radii[seen]
    place = {"offsets": 1e3 * centres, "offset_transform": axes.transData}
    axes.add_collection(
        EllipseCollection(width, width, 0 * width, units="xy", color=colour, lw=0, **place)
    )
    axes.set(
        xlim=(0, 1e3 * view[0]),
        ylim=(0, 1e3 * view[1]),
        aspect="equal",
        xlabel="x [mm]",
        ylabel="y [mm]",
    )
    axes.grid(visible=False)


def plot_cells(
    axes: Axes, diagram: Apollonius, colour: str = INK, view: Array | None = None
) -> None:
    """Curved walls of the cells, with their images, in the rectangle or its corner `view` (m)."""
    from matplotlib.collections import LineCollection

    discs = diagram.discs
    angle = np.linspace(diagram.start, diagram.end, 24)
    rho = diagram.radius_at(np.arange(len(diagram.cell)), angle)
    points = discs.centres[diagram.cell] + rho[..., None] * np.stack(
        [np.cos(angle), np.sin(angle)], axis=-1
    )
    walls = np.concatenate([points + shift for shift in _shifts(discs)], axis=1)
    seen = (
        (walls.max(axis=0) > 0) & (walls.min(axis=0) < (discs.size if view is None else view))
    ).all(axis=1)
    axes.add_collection(
        LineCollection(list(1e3 * walls[:, seen].swapaxes(0, 1)), colors=colour, linewidths=0.8)
    )


def _shifts(discs: Discs) -> list[Array]:
    """Shifts of the images of a section, in m; none but zero where it does not repeat."""
    return (
        [discs.size * (i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        if discs.periodic
        else [np.zeros(2)]
    )


def corner(discs: Discs, number: int = 120) -> Array:
    """Width and height, in m, of a corner of the section that holds about `number` discs."""
    return np.asarray(discs.size * min(1.0, float(np.sqrt(number / len(discs)))))


def draw_cells(diagram: Apollonius) -> Figure:
    """Voronoi cells, whose walls cut discs, beside Apollonius cells (Fig. 10)."""
    import matplotlib.pyplot as plt

    discs = diagram.discs
    view = corner(discs)
    drawn, both = plt.subplots(1, 2, figsize=(9.6, 5.0))
    bare = apollonius(Discs(discs.centres, np.zeros(len(discs)), discs.size, discs.periodic))
    for axes, shown, title in zip(
        both, (bare, diagram), ("Voronoi cells", "Apollonius cells"), strict=True
    ):
        plot_discs(axes, discs, PALE if title.startswith("V") else "#9ecae1", view)
        plot_cells(axes, shown, view=view)
        axes.set_title(title)
    width, height = 1e3 * discs.size
    whole = f"one section of {width:.4g} × {height:.4g} mm with {len(discs)} discs"
    drawn.suptitle(whole if (view == discs.size).all() else f"a corner of {whole}", fontsize=10)
    return drawn


def draw_neighbours(discs: Discs) -> Figure:
    """Delaunay triangulation of equal discs beside their Voronoi cells (Figs. 5, 8)."""
    import matplotlib.pyplot as plt
    from matplotlib.collections import LineCollection

    drawn, (left, right) = plt.subplots(1, 2, figsize=(9.6, 5.0))
    direct = neighbours(discs)
    start = discs.centres[direct.first]
    for axes in (left, right):
        plot_discs(axes, discs, "#9ecae1")
    left.add_collection(
        LineCollection(
            list(1e3 * np.stack([start, start + direct.apart], axis=1)),
            colors=ORANGE,
            linewidths=0.8,
        )
    )
    drawn.suptitle(
        f"{len(discs)} equal discs of the same area fraction, not those of the section", fontsize=10
    )
    left.set_title("Delaunay triangulation: the direct neighbours")
    plot_cells(right, apollonius(discs))
    right.set_title("Voronoi cells, its dual")
    return drawn


def draw_two_point(discs: Discs, generator: np.random.Generator) -> Figure:
    """Why distances in pairs do not describe a packing (Figs. 3, 4).

    Left: around one disc, others drawn independently with the packing's own pair distances: they
    overlap each other. Right: the true discs within the same distance; only the direct neighbours
    (green) touch the centre's cell.
    """
    import matplotlib.pyplot as plt

    reach = 3.5 * float(np.sqrt(discs.area / len(discs)))
    centre = int(np.argmin(np.hypot(*(discs.centres - discs.size / 2).T)))
    apart = discs.separation(np.full(len(discs), centre), np.arange(len(discs)))
    near = np.flatnonzero((np.hypot(*apart.T) < reach) & (np.arange(len(discs)) != centre))
    direct = neighbours(discs)
    touching = {tuple(np.round(v, 12)) for v in direct.apart[direct.first == centre]}
    drawn, (left, right) = plt.subplots(1, 2, figsize=(9.6, 5.0))
    drawn.suptitle(
        f"{len(discs)} equal discs of the same area fraction, not those of the section", fontsize=10
    )
    fake = _from_pair_distances(discs, len(near), reach, generator)
    _around(left, fake, float(discs.radii[centre]), reach, ["#9ecae1"] * len(fake))
    left.set_title(
        f"pair distances alone: {_overlaps(fake, discs.radii[centre])} of {len(fake)} overlap"
    )
    is_direct = [tuple(np.round(apart[k], 12)) in touching for k in near]
    _around(
        right,
        apart[near],
        float(discs.radii[centre]),
        reach,
        [GREEN if yes else "#9ecae1" for yes in is_direct],
    )
    right.set_title(f"the packing: {sum(is_direct)} of {len(near)} are direct neighbours")
    return drawn


def _from_pair_distances(
    discs: Discs, number: int, reach: float, generator: np.random.Generator
) -> Array:
    """Places drawn from the distances between all discs, shape (number, 2), in m."""
    from scipy.spatial import KDTree

    tree = KDTree(discs.centres, boxsize=discs.size)
    pairs = tree.query_pairs(reach, output_type="ndarray")
    all_apart = discs.separation(pairs[:, 0], pairs[:, 1])
    distance = generator.choice(np.hypot(all_apart[:, 0], all_apart[:, 1]), number)
    angle = 2 * np.pi * generator.random(number)
    return np.asarray(distance[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))


def _overlaps(places: Array, radius: float) -> int:
    apart = np.hypot(*np.moveaxis(places[:, None] - places[None], -1, 0))
    np.fill_diagonal(apart, np.inf)
    return int((apart.min(axis=1) < 2 * radius).sum())


def _around(axes: Axes, places: Array, radius: float, reach: float, colours: list[str]) -> None:
    """Discs of one radius around a centre, in mm."""
    from matplotlib.patches import Circle

    axes.add_patch(Circle((0, 0), 1e3 * radius, color=ORANGE))
    for (x, y), colour in zip(places, colours, strict=True):
        axes.add_patch(
            Circle((1e3 * x, 1e3 * y), 1e3 * radius, facecolor=colour, edgecolor=GREY, alpha=0.8)
        )
    limit = 1e3 * (reach + radius)
    axes.set(
        xlim=(-limit, limit), ylim=(-limit, limit), aspect="equal", xlabel="x [mm]", ylabel="y [mm]"
    )
    axes.grid(visible=False)


def draw_overlay(picture: Array, discs: Discs) -> Figure:
    """The grey image with the outline of every circle that was taken from it.

    Args:
        picture: Grey values, shape (rows, columns).
        discs: Circles in the same window; y points up from the lower edge.
    """
    import matplotlib.pyplot as plt
    from matplotlib.collections import EllipseCollection

    width, height = 1e3 * discs.size
    drawn, axes = plt.subplots(figsize=(6.4, 6.4 * float(np.clip(height / width, 0.5, 1.6))))
    axes.imshow(picture, cmap="gray", extent=(0, width, 0, height), interpolation="none")
    across = 2e3 * discs.radii
    place = {"offsets": 1e3 * discs.centres, "offset_transform": axes.transData}
    outline = {"facecolors": "none", "edgecolors": ORANGE, "linewidths": 1.0}
    axes.add_collection(
        EllipseCollection(across, across, 0 * across, units="xy", **place, **outline)
    )
    axes.set(xlim=(0, width), ylim=(0, height), xlabel="x [mm]", ylabel="y [mm]")
    axes.set_title(f"{len(discs)} circles; what has no outline was left out", fontsize="medium")
    axes.grid(visible=False)
    return drawn


def draw_section(spheres: Spheres) -> Figure:
    """Circles and walls in the plane through the middle of the cube (Fig. 10, in space)."""
    import matplotlib.pyplot as plt

    height = spheres.side / 2
    above = spheres.centres[:, 2] - height
    above -= spheres.side * np.round(above / spheres.side)
    cut = np.abs(above) < spheres.radii
    radii = np.sqrt(spheres.radii[cut] ** 2 - above[cut] ** 2)
    circles = Discs(spheres.centres[cut, :2], radii, np.full(2, spheres.side))
    view = corner(circles, SPHERES)
    drawn, axes = plt.subplots(figsize=(5.6, 5.6))
    plot_discs(axes, circles, "#9ecae1", view)
    wall = wall_distance(spheres, height, float(view[0]))
    width = 1e3 * float(view[0])
    ink = np.zeros((*wall.shape, 4))
    ink[..., :3] = [int(INK[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    ink[..., 3] = np.clip(1.5 - wall * PIXELS / view[0], 0, 1)
    axes.imshow(ink, extent=(0, width, 0, width), origin="lower", zorder=3)
    side = 1e3 * spheres.side
    what = "a corner of a" if view[0] < spheres.side else "a"
    axes.set_title(
        f"{what} section of {side:.4g} × {side:.4g} mm: {len(radii)} of {len(spheres.radii)}"
        " spheres are cut",
        fontsize=10,
    )
    return drawn


def wall_distance(spheres: Spheres, height: float, width: float) -> Array:
    """Distance in m, in the plane, to the nearest wall of a power cell, about, at points of it.

    Args:
        spheres: Spheres in a periodic cube.
        height: Third coordinate of the plane, in m.
        width: Edge of the square in the plane's corner, in m.

    Returns:
        Shape (PIXELS, PIXELS), the second coordinate along the first axis.
    """
    from scipy.spatial import cKDTree

    along = (np.arange(PIXELS) + 0.5) * width / PIXELS
    x, y = np.meshgrid(along, along)
    points = np.stack([x, y, np.full_like(x, height)], axis=-1).reshape(-1, 3)
    tree = cKDTree(np.mod(spheres.centres, spheres.side), boxsize=spheres.side)
    # the power distance never exceeds the squared one: the nearest centres hold the cell's own
    count = min(NEAREST, len(spheres.radii))
    apart, near = tree.query(np.mod(points, spheres.side), k=count)
    power = apart**2 - spheres.radii[near] ** 2
    first, second = np.argsort(power, axis=1)[:, :2].T
    row = np.arange(len(points))
    step = spheres.centres[near[row, first]] - spheres.centres[near[row, second]]
    step -= spheres.side * np.round(step / spheres.side)
    gap = power[row, second] - power[row, first]
    distance = gap / np.maximum(2 * np.linalg.norm(step[:, :2], axis=1), 1e-300)
    return np.asarray(distance.reshape(PIXELS, PIXELS))
