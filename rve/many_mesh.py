"""Conforming periodic meshes of cells with many discs, by Gmsh: quadratic triangles, their edges bent onto the circles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gmsh
import numpy as np

from stochastic.contacts import smallest_gap
from stochastic.discs import Discs

if TYPE_CHECKING:
    from stochastic.truncated_normal import Array


def many_mesh(discs: Discs, *, size: float, around: int = 12) -> tuple[Any, Array]:
    """Mesh the periodic box of `discs`, scaled to the unit square.

    The box is shifted so that no circle grazes a side: the moduli do not depend on where a periodic box begins.

    Args:
        discs: Non-overlapping discs in a periodic square, with gaps.
        size: Wanted edge length in the matrix, over the mean spacing of the discs √(area/n).
        around: Edges around each circle, at least.

    Returns:
        The DOLFINx mesh and whether each of its cells lies in a disc, shape (m,).

    Raises:
        ValueError: The discs touch or overlap, or the box is not a periodic square.
        RuntimeError: Gmsh made no valid mesh.
    """
    from dolfinx.io import gmshio
    from mpi4py import MPI

    if not discs.periodic or discs.size[0] != discs.size[1]:
        raise ValueError("the cell must be a periodic square")
    if smallest_gap(discs) <= 0:
        raise ValueError("discs of the cell touch or overlap; pack them with a gap, so that they can be meshed")
    side = float(discs.size[0])
    centres, radii = _off_the_sides(discs) / side, discs.radii / side
    gmsh.initialize(["", "-v", "1"], readConfigFiles=False, interruptible=False)
    try:
        inside = _geometry(centres, radii)
        _periodic_sides()
        gmsh.option.setNumber("General.NumThreads", 1)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size / np.sqrt(len(discs)))
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", around)
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 1)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(2)
        surfaces = [tag for _, tag in gmsh.model.getEntities(2)]
        gmsh.model.addPhysicalGroup(2, [tag for tag in surfaces if tag not in inside], 1)
        gmsh.model.addPhysicalGroup(2, [tag for tag in surfaces if tag in inside], 2)
        mesh, tags, _ = gmshio.model_to_mesh(gmsh.model, MPI.COMM_SELF, 0, gdim=2)
    finally:
        gmsh.finalize()
    values = np.empty(mesh.topology.index_map(2).size_local, int)
    values[tags.indices] = tags.values
    return mesh, values == 2


def _off_the_sides(discs: Discs) -> Array:
    """Centres in a box that begins where circles keep farthest from grazing its sides or corners."""
    best, centres = -1.0, discs.centres
    for shift in np.random.default_rng(0).random((400, 2)):
        moved = np.mod(discs.centres + shift * discs.size, discs.size)
        beyond = moved - discs.size * np.round(moved / discs.size)
        side = np.abs(np.abs(beyond) - discs.radii[:, None]).min()
        corner = np.abs(np.hypot(*beyond.T) - discs.radii).min()
        if min(side, corner) > best:
            best, centres = min(side, corner), moved
    return centres


def _geometry(centres: Array, radii: Array) -> set[int]:
    """Unit square cut by the circles and their images; the tags of the surfaces inside discs."""
    occ = gmsh.model.occ
    square = occ.addRectangle(0, 0, 0, 1, 1)
    circles = []
    for x, y, r in np.column_stack([centres, radii]):
        for i in (-1, 0, 1):
            for j in (-1, 0, 1):
                u, v = x + i, y + j
                if np.hypot(u - np.clip(u, 0, 1), v - np.clip(v, 0, 1)) < r:
                    circles.append((2, occ.addDisk(float(u), float(v), 0, float(r), float(r))))
    parts, _ = occ.intersect(circles, [(2, square)], removeTool=False)
    _, pieces = occ.fragment([(2, square)], parts)
    occ.synchronize()
    return {tag for piece in pieces[1:] for _, tag in piece}


def _periodic_sides() -> None:
    """Bind each curve of the sides x = 1 and y = 1 to its partner at 0."""
    boxes = {tag: gmsh.model.getBoundingBox(1, tag) for _, tag in gmsh.model.getEntities(1)}
    for axis in (0, 1):
        sides = []
        for value in (0.0, 1.0):
            on = [tag for tag, box in boxes.items() if max(abs(box[axis] - value), abs(box[axis + 3] - value)) < 1e-6]
            sides.append(sorted(on, key=lambda tag: boxes[tag][1 - axis] + boxes[tag][4 - axis]))
        if len(sides[0]) != len(sides[1]):
            raise RuntimeError("opposite sides of the cell are cut by circles differently; a circle grazes a side")
        shift = np.eye(4)
        shift[axis, 3] = 1
        gmsh.model.mesh.setPeriodic(1, sides[1], sides[0], shift.ravel().tolist())
