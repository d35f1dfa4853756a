"""Picture of a plane section through spheres and their cells, and the bounds of their radii."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.stochastic.figures.cells import corner, plot_discs
from alphacut.stochastic.figures.style import BLUE, GREY, INK, ORANGE
from alphacut.stochastic.particles.discs import Discs
from alphacut.stochastic.spheres.spheres import Spheres
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from alphacut.stochastic.spheres.microstructure import SphereMicrostructure

PIXELS = 500  # along an edge of the view
NEAREST = 24  # spheres among which the cell of a point is sought
SPHERES = 60  # circles in the view, about


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


def draw_radii_bounds(found: SphereMicrostructure) -> Figure:
    """Bounds of the spheres' radii by volume that the section leaves, and the packings' own."""
    import matplotlib.pyplot as plt

    box = found.source.section
    assert box is not None
    drawn, axes = plt.subplots(figsize=(6.4, 3.8))
    axes.fill_between(
        1e3 * box.edges,
        box.lower,
        box.upper,
        color=GREY,
        alpha=0.4,
        lw=0,
        label=f"bounds at {100 * box.level:g} %",
    )
    for number, packed in enumerate(found.packed):
        radii = np.sort(np.concatenate([one.radii for one in packed.packings]))
        share = np.cumsum(radii**3) / (radii**3).sum()
        colour, wide = (BLUE, 1.6) if number == 0 else (ORANGE, 0.8)
        label = ("packed", "possible laws")[number] if number < 2 else None
        axes.step(1e3 * radii, share, color=colour, lw=wide, where="post", label=label)
    axes.set(xlabel="radius of the spheres [mm]", ylabel="share of their volume", ylim=(0, 1.02))
    axes.set_title(
        f"spheres below {1e3 * box.edges[0]:.3g} mm: the section does not tell", fontsize=10
    )
    axes.legend(loc="upper left")
    return drawn
