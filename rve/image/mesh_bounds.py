"""Guaranteed bounds of the stiffness of a mesh of prisms, by images of its slices.

The support of θ is divided into slabs. In each, a pixel may be of every phase whose prisms touch it
at some θ of the slab. The image of the softest of these phases is softer than the cell at each of
these θ, that of the stiffest is stiffer; so the mean of the bounds of the images, with the
probabilities of the slabs, bounds the mean stiffness of the mesh's own, curved geometry.

A prism is a polynomial of second degree in each of its coordinates. In the form of Bernstein and
Bézier it lies in the convex hull of its control points, and so does each part of it, whose control
points are values of its polar form (blossom).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise, product

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.errors import checked_number, require
from alphacut.base.kernels import kernel
from alphacut.rve.cell.cell import Phase
from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.model import ImageModel, ImageSolution
from alphacut.rve.image.phases import ModuliImages, PhaseModuli
from alphacut.rve.mesh.prism_grid import PrismGrid
from alphacut.stochastic import ThetaDistribution

EDGES = ((0, 1), (0, 2), (1, 2))
"""Vertices of the edges of a triangle, in the order of their midpoints."""
BELOW = (0, 1, 2, 6, 7, 9)
"""Nodes of a prism in Basix's order on its lower level: vertices and midpoints of `EDGES`."""
ABOVE = (3, 4, 5, 12, 13, 14)
"""Nodes on its upper level."""
UPRIGHT = (8, 10, 11)
"""Nodes half-way between the levels, above the vertices 0, 1 and 2."""
PARTS = 4
"""Parts of the edges of a triangle (tuned): hulls of its 16 parts are 1/16 as thick."""
TILT = 1e-9
"""Largest distance of the sides from the axes, in halves of the side, that is taken as rounding."""
SLACK = 1e-9
"""Distance in halves of the cell's side by which hulls are enlarged, above any rounding."""


def mesh_bounds(
    grid: PrismGrid,
    points: Array,
    law: ThetaDistribution,
    phases: Sequence[Phase],
    *,
    pixels: int,
    slabs: int,
) -> StiffnessBounds:
    """Return guaranteed bounds of the mean stiffness over θ of a mesh of prisms, in plane strain.

    They hold for the geometry of the mesh, whose levels are planes of constant θ.

    Args:
        grid: Prisms in columns on a square or rectangle with sides along the axes.
        points: Positions (x1, x2, θ) of their nodes, shape (nodes, 3).
        law: Distribution of θ on the range of the mesh.
        phases: Isotropic materials in the order of `grid.phase`.
        pixels: Pixels along each side of the square.
        slabs: Number of slabs of θ at least; each layer of prisms has as many.

    Raises:
        RefusedError: A number is no positive whole number, a modulus is not allowed, or the cell is
            no such rectangle.
        FailedError: The solver does not converge.
    """
    checked_number("pixels", pixels, positive=True, whole=True)
    checked_number("slabs", slabs, positive=True, whole=True)
    moduli = [PhaseModuli.of_young(phase.modulus, phase.poisson) for phase in phases]
    values = np.array([(phase.bulk, phase.shear) for phase in moduli])
    half_vectors = np.array(grid.plane.lattice.half_vectors)
    half_sides = np.diagonal(half_vectors)
    tilt = np.inf
    if len(half_vectors) == 2:
        tilt = float(abs(half_vectors - np.diag(half_sides)).max())
    cure = "the bounds of other cells are not known; solve gives the stiffness"
    allowed = "a rectangle along the axes"
    require(tilt <= TILT, "cell of the mesh", "a parallelogram or hexagon", allowed, cure)
    # In units of its half sides the rectangle is the square [−1, 1]².
    unit = np.array(points)
    unit[:, :2] = grid.plane.lattice.side_coordinates(points[:, :2])
    sides = (float(half_sides[1] / half_sides[0]), 1.0)
    model = ImageModel(sides, division=1, solver=ConjugateGradient(accuracy=1e-5))
    lower = np.zeros((3, 3))
    upper = np.zeros((3, 3))
    solution: ImageSolution[StiffnessBounds] | None = None
    per_layer = -(-slabs // grid.layers)
    for ends, touched in _slabs(grid, unit, len(phases), pixels=pixels, per_layer=per_layer):
        low, high = law.cdf(np.array(ends))
        if high <= low:
            continue
        is_possible = touched[:, np.newaxis]  # (phases, 1, y, x)
        by_phase = values[:, :, np.newaxis, np.newaxis]
        softest = np.where(is_possible, by_phase, np.inf).min(axis=0)
        stiffest = np.where(is_possible, by_phase, 0.0).max(axis=0)
        solution = model.solve(ModuliImages(softest, stiffest), solution)
        lower += (high - low) * solution.bounds.lower
        upper += (high - low) * solution.bounds.upper
    # A tilt of the sides, and the rounding of probabilities and sums, are far below the width.
    rounding = 10 * TILT
    return StiffnessBounds(lower * (1 - rounding), upper * (1 + rounding))


def _slabs(
    grid: PrismGrid, points: Array, n_phases: int, *, pixels: int, per_layer: int
) -> Iterator[tuple[tuple[float, float], Mask]]:
    """Yield the ends in θ of each slab, and whether each phase touches each pixel in it.

    Yields:
        Ends, and an array of shape (phases, y, x).
    """
    layers = grid.cells.reshape(grid.layers, -1, 15)
    phase = grid.phase.reshape(grid.layers, -1)
    cuts = [float(cut) for cut in np.linspace(0.0, 1.0, per_layer + 1)]
    of_parts = _part_matrices()
    for cells, phase_of_cells in zip(layers, phase, strict=True):
        nodes = points[cells]  # (prisms, 15, 3)
        bottom = float(nodes[:, BELOW, 2].mean())
        top = float(nodes[:, ABOVE, 2].mean())
        control = _control_points(nodes[..., :2])
        for start, end in pairwise(cuts):
            pairs = (start, start), (start, end), (end, end)
            of_slab = np.stack([_blossom(control, a, b) for a, b in pairs], axis=1)
            # (prisms, parts, 3 along θ, 6 of a triangle, 2)
            nets = np.einsum("pij,mtjx->mptix", of_parts, of_slab)
            hulls = nets.reshape(-1, 18, 2)
            touched: Mask = np.zeros((n_phases, pixels, pixels), bool)
            _mark(hulls, np.repeat(phase_of_cells, len(of_parts)), SLACK, touched)
            ends = bottom + start * (top - bottom), bottom + end * (top - bottom)
            yield ends, touched


def _control_points(nodes: Array) -> Array:
    """Return the control points of prisms, from their nodes in Basix's order.

    Args:
        nodes: Positions, shape (prisms, 15, 2).

    Returns:
        Shape (prisms, 3 along θ, 6 of a triangle, 2): vertices, then edges in the order of `EDGES`.
    """
    below = nodes[:, BELOW]
    above = nodes[:, ABOVE]
    # The centre of an upright side of a serendipity prism: half of the midpoints of its edges less
    # a quarter of its corners, summed.
    centres = []
    for edge, (a, b) in enumerate(EDGES):
        corners = below[:, a] + below[:, b] + above[:, a] + above[:, b]
        middles = below[:, 3 + edge] + above[:, 3 + edge]
        middles = middles + nodes[:, UPRIGHT[a]] + nodes[:, UPRIGHT[b]]
        centres.append(middles / 2 - corners / 4)
    middle = np.concatenate([nodes[:, UPRIGHT], np.stack(centres, axis=1)], axis=1)
    levels = np.stack([below, 2 * middle - (below + above) / 2, above], axis=1)
    control = levels.copy()
    for edge, (a, b) in enumerate(EDGES):
        ends = levels[:, :, a] + levels[:, :, b]
        control[:, :, 3 + edge] = 2 * levels[:, :, 3 + edge] - ends / 2
    return control


def _blossom(control: Array, a: float, b: float) -> Array:
    """Return the polar form along θ at two places in [0, 1], shape (prisms, 6, 2).

    At (a, a), (a, b) and (b, b) it gives the control points of the part from a to b.
    """
    below, middle, above = np.moveaxis(control, 1, 0)
    weight = a * (1 - b) + b * (1 - a)
    return np.asarray((1 - a) * (1 - b) * below + weight * middle + a * b * above)


def _part_matrices() -> Array:
    """Return the matrices from the control points of a triangle to those of its parts.

    Returns:
        Shape (parts, 6, 6): the `PARTS`² similar parts of a triangle.
    """
    matrices = []
    for i, j in product(range(PARTS), repeat=2):
        # the corner of the part in barycentric coordinates, and steps along two edges; parts
        # beyond the third edge point the other way
        corner = np.array([i, j])
        step = 1
        if i + j >= PARTS:
            corner = PARTS - corner
            step = -1
        steps = step * np.array([[0, 0], [1, 0], [0, 1]])
        corners = (corner + steps) / PARTS
        places = np.column_stack([1 - corners.sum(axis=1), corners])  # barycentric
        pairs = [(k, k) for k in range(3)] + list(EDGES)
        matrix = np.empty((6, 6))
        for row, (k, m) in enumerate(pairs):
            u = places[k]
            v = places[m]
            matrix[row, :3] = u * v
            matrix[row, 3:] = [u[a] * v[b] + u[b] * v[a] for a, b in EDGES]
        matrices.append(matrix)
    return np.array(matrices)


@kernel()
def _mark(hulls: Array, phase: Ints, slack: float, touched: Mask) -> None:
    """Mark each pixel of the square [−1, 1]² that a convex hull may touch, for its phase.

    A pixel is left out only if an axis separates it from the hull: x, y, or the normal of a side of
    the triangle.

    Args:
        hulls: Control points, shape (hulls, 18, 2): three times the vertices 0, 1, 2 and the edges
            of a triangle.
        phase: Phase of each hull, shape (hulls,).
        slack: Distance by which hulls are enlarged.
        touched: Shape (phases, y, x); entries that are touched become True.
    """
    n = touched.shape[1]
    half = 1.0 / n
    for k in range(len(hulls)):
        hull = hulls[k]
        low_x = hull[:, 0].min() - slack
        high_x = hull[:, 0].max() + slack
        low_y = hull[:, 1].min() - slack
        high_y = hull[:, 1].max() + slack
        first_x = int(np.floor((low_x + 1) / 2 * n))
        last_x = int(np.floor((high_x + 1) / 2 * n))
        first_y = int(np.floor((low_y + 1) / 2 * n))
        last_y = int(np.floor((high_y + 1) / 2 * n))
        normals = np.empty((3, 2))
        ends = np.empty((3, 2))
        for side in range(3):
            a = hull[6 + side]
            b = hull[6 + (side + 1) % 3]
            length = np.hypot(b[0] - a[0], b[1] - a[1])
            normals[side, 0] = (b[1] - a[1]) / length
            normals[side, 1] = (a[0] - b[0]) / length
            along = hull[:, 0] * normals[side, 0] + hull[:, 1] * normals[side, 1]
            ends[side, 0] = along.min() - slack
            ends[side, 1] = along.max() + slack
        for iy in range(first_y, last_y + 1):
            for ix in range(first_x, last_x + 1):
                x = (2 * ix + 1) * half - 1
                y = (2 * iy + 1) * half - 1
                is_apart = False
                for side in range(3):
                    centre = x * normals[side, 0] + y * normals[side, 1]
                    reach = half * (abs(normals[side, 0]) + abs(normals[side, 1]))
                    if centre + reach < ends[side, 0] or centre - reach > ends[side, 1]:
                        is_apart = True
                if not is_apart:
                    touched[phase[k], iy % n, ix % n] = True
