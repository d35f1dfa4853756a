"""Pictures of discs, in their image too, and their cells (Figs. 3, 4, 5, 8, 9, 10)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.stochastic.figures.style import BLUE, GREEN, GREY, INK, ORANGE, PALE
from alphacut.stochastic.particles.particles import Particles
from alphacut.stochastic.tessellation.apollonius import Apollonius, apollonius
from alphacut.stochastic.tessellation.delaunay import neighbours

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def plot_discs(axes: Axes, discs: Particles, colour: str = BLUE, view: Array | None = None) -> None:
    """Particles in their rectangle, or in its corner `view` (m), with their images, in mm."""
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
    angle = np.asarray(np.linspace(diagram.start, diagram.end, 24), float)
    rho = diagram.radius_at(np.arange(len(diagram.cell), dtype=np.intp), angle)
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


def _shifts(discs: Particles) -> list[Array]:
    """Shifts of the images of a section, in m; none but zero where it does not repeat."""
    return (
        [discs.size * (i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        if discs.periodic
        else [np.zeros(2)]
    )


def corner(discs: Particles, number: int = 120) -> Array:
    """Width and height, in m, of a corner of the section that holds about `number` discs."""
    return np.asarray(discs.size * min(1.0, float(np.sqrt(number / len(discs)))))


def draw_cells(diagram: Apollonius) -> Figure:
    """Voronoi cells, whose walls cut discs, beside Apollonius cells (Fig. 10)."""
    import matplotlib.pyplot as plt

    discs = diagram.discs
    view = corner(discs)
    drawn, both = plt.subplots(1, 2, figsize=(9.6, 5.0))
    bare = apollonius(Particles(discs.centres, np.zeros(len(discs)), discs.size, discs.periodic))
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


def draw_neighbours(discs: Particles) -> Figure:
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


def draw_two_point(discs: Particles, generator: np.random.Generator) -> Figure:
    """Why distances in pairs do not describe a packing (Figs. 3, 4).

    Left: around one disc, others drawn independently with the packing's own pair distances: they
    overlap each other. Right: the true discs within the same distance; only the direct neighbours
    (green) touch the centre's cell.
    """
    import matplotlib.pyplot as plt

    reach = 3.5 * discs.spacing
    centre = int(np.argmin(np.hypot(*(discs.centres - discs.size / 2).T)))
    every = np.arange(len(discs), dtype=np.intp)
    apart = discs.separation(np.full(len(discs), centre, np.intp), every)
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
    discs: Particles, number: int, reach: float, generator: np.random.Generator
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
    """Particles of one radius around a centre, in mm."""
    from matplotlib.patches import Circle

    axes.add_patch(Circle((0, 0), 1e3 * radius, color=ORANGE))
    for x, y, colour in zip(places[:, 0], places[:, 1], colours, strict=True):
        axes.add_patch(
            Circle((1e3 * x, 1e3 * y), 1e3 * radius, facecolor=colour, edgecolor=GREY, alpha=0.8)
        )
    limit = 1e3 * (reach + radius)
    axes.set(
        xlim=(-limit, limit), ylim=(-limit, limit), aspect="equal", xlabel="x [mm]", ylabel="y [mm]"
    )
    axes.grid(visible=False)


def draw_overlay(picture: Array, discs: Particles) -> Figure:
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
