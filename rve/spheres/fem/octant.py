"""A sphere's cell and one eighth of it as curved tetrahedra of second order, by Gmsh."""

from __future__ import annotations

from itertools import product

import gmsh
import numpy as np
from mpi4py import MPI

from alphacut.fuzzy.arrays import Array
from alphacut.rve.interruption import uninterrupted
from alphacut.rve.mesh.curved import TouchingError
from alphacut.rve.settings import require_mesh_size, require_radius

with uninterrupted():
    try:
        from dolfinx.io import gmsh as gmshio  # from 0.10 on
    except ImportError:
        from dolfinx.io import gmshio

_CLOSEST = 0.97
_FINER = (1.0, 0.8, 0.65, 0.5, 0.4, 0.3, 0.2)
_SOUND = 0.1  # least scaled Jacobian of an element
MATRIX, SPHERE = 1, 2
_REFLECTED = [0, 1, 3, 2, 4, 6, 5, 8, 7, 9]  # nodes of a tetrahedron, third vertex for fourth


class CurvedMeshError(RuntimeError):
    """Curved elements that overlap themselves."""


def octant(radius: float, *, size: float, comm: MPI.Intracomm = MPI.COMM_SELF) -> gmshio.MeshData:
    """Mesh of [0, 1]³ with the sphere about the origin, cell tags `MATRIX` and `SPHERE`.

    Args:
        radius: Radius over half the cell's side, in (0, 0.97].
        size: Wanted edge length, in halves of the cell's side, in (0, 1].
        comm: Ranks that share the mesh.

    Raises:
        ValueError: A value out of range.
        TouchingError: Spheres nearly touch.
        CurvedMeshError: Curved elements stay folded however fine the mesh is.
    """
    require_radius(radius)
    require_mesh_size(size)
    if radius > _CLOSEST:
        raise TouchingError(
            f"the radius is {radius:.6g} and meshes of spheres end at {_CLOSEST:g}: the gap between"
            " spheres would need elements without end; lower the radius"
        )
    gmsh.initialize(["", "-v", "1"], readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.NumThreads", 1)
        gmsh.option.setNumber("General.Terminal", 0)  # errors are raised, the rest is not for here
        if comm.rank == 0:
            _generate_sound(radius, size)
        return gmshio.model_to_mesh(gmsh.model, comm, 0, gdim=3)
    finally:
        gmsh.finalize()


def whole_cell(radius: float, *, size: float) -> tuple[Array, Array, Array]:
    """The octant with its seven images: the periodic cell [-1, 1]³, the sphere about the origin.

    Args:
        radius: As of `octant`.
        size: As of `octant`.

    Returns:
        Points, shape (n, 3), in halves of the cell's side; their numbers for each tetrahedron,
        shape (m, 10), in Basix's order and of positive volume; whether it is the sphere, shape
        (m,). Opposite faces have the same nodes, exactly.

    Raises:
        ValueError: As by `octant`.
        TouchingError: As by `octant`.
        CurvedMeshError: As by `octant`.
    """
    mesh, tags = octant(radius, size=size)[:2]
    cells = mesh.geometry.dofmap
    inside = np.isin(np.arange(len(cells)), tags.find(SPHERE))
    eighth = np.where(abs(mesh.geometry.x) < 1e-9, 0.0, mesh.geometry.x)  # Gmsh's 1e-14
    signs = np.array(list(product((1.0, -1.0), repeat=3)))
    images = (signs[:, None] * eighth + 0.0).reshape(-1, 3)
    points, places = np.unique(images, axis=0, return_inverse=True)
    whole = [
        numbers[cells if sign.prod() > 0 else cells[:, _REFLECTED]]
        for sign, numbers in zip(signs, places.reshape(len(signs), -1), strict=True)
    ]
    return points, np.concatenate(whole), np.tile(inside, len(signs))


def _generate_sound(radius: float, size: float) -> None:
    """The mesh, finer than asked for where curved elements would fold."""
    for finer in _FINER:
        gmsh.clear()
        _generate(radius, finer * size)
        elements = gmsh.model.mesh.getElements(3)[1][0]
        if min(gmsh.model.mesh.getElementQualities(elements, "minSJ")) > _SOUND:
            return
    raise CurvedMeshError(
        f"curved elements fold at radius {radius:.6g} and mesh size {size:.3g}: take another mesh"
        " size"
    )


def _generate(radius: float, size: float) -> None:
    """Box and ball fragmented, meshed, and curved."""
    occ = gmsh.model.occ
    ball = occ.addSphere(0, 0, 0, radius)
    box = occ.addBox(0, 0, 0, 1, 1, 1)
    part = occ.intersect([(3, box)], [(3, ball)], removeObject=False)[0]
    occ.fragment([(3, box)], part)
    occ.synchronize()
    volumes = [tag for _, tag in gmsh.model.getEntities(3)]
    inner = min(volumes, key=lambda tag: float(occ.getCenterOfMass(3, tag)[0]))
    gmsh.model.addPhysicalGroup(3, [tag for tag in volumes if tag != inner], MATRIX)
    gmsh.model.addPhysicalGroup(3, [inner], SPHERE)
    gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)
    gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
    gmsh.model.mesh.setSizeCallback(
        lambda dim, tag, x, y, z, lc: size * _grading((x, y, z), radius)
    )
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    gmsh.option.setNumber("Mesh.HighOrderOptimize", 4)
    gmsh.model.mesh.generate(3)


def _grading(spot: tuple[float, float, float], radius: float) -> float:
    """Local edge length over the nominal one, less at a small sphere and in gaps between two."""
    square: float = sum(c * c for c in spot)
    contact: float = min(
        max(square - 2 * c + 1, 0.0) ** 0.5 for c in spot
    )  # from (1, 0, 0) and its likes
    small: float = 1.5 * radius + abs(square**0.5 - radius)
    return min(1.0, small, 4 * (1 - radius) + contact)
