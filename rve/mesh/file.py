"""The user's mesh: prisms of the product space in a file of Gmsh, as they are.

The file is the geometry at its own θ: levels may be uneven, columns bent and phases any number.
Gmsh's 15-node prisms ("Prism 15") have Basix's order of nodes; physical groups name phases.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import RefusedError, require
from alphacut.base.memory import require_text
from alphacut.rve.mesh import square
from alphacut.rve.mesh.columns import grid_of
from alphacut.rve.mesh.msh import REWRITE, DamagedMeshError, MshFile, element_name, parse_msh
from alphacut.rve.mesh.periodicity import SAME_PLACE, MeshError, unknowns
from alphacut.rve.mesh.prism_grid import PrismGrid, Prisms
from alphacut.rve.mesh.wedge import prism_rule, vertices_and_midpoints, wedge

PRISM_15 = 18  # Gmsh's type of the element
MESH_FILES = "meshes in Gmsh's format MSH with 15-node prisms"
PRISM_15_BY_GMSH = "extrude with recombine, Mesh.SecondOrderIncomplete = 1, order 2"
EXTRUDE = f"make prisms of the triangles along θ: {PRISM_15_BY_GMSH}, a physical group a phase"
COMMENTS, END_OF_COMMENTS = b"$Comments", b"$EndComments"
FILLED = 1e-6  # of the cell that prisms may leave or take twice


def read_grid(path: Path | str) -> PrismGrid:
    """Extruded prisms of a Gmsh file, where they are, numbered by level; MeshError if no cell."""
    try:
        mesh = parse_msh(mesh_content(path))
    except DamagedMeshError as error:
        cure = "" if REWRITE in str(error) else "copy the file anew, or write it anew by Gmsh"
        raise RefusedError("mesh.file", f"{path}, {error}", MESH_FILES, cure) from None
    prisms = read_prisms(mesh)
    _require_theta_last(prisms.points)
    _require_square(prisms.points[:, :2], "the cell")
    grid = grid_of(orient(prisms))
    _require_filled(grid)
    _require_periodic_square(grid)
    _require_joined_columns(grid)
    return grid


def mesh_content(path: Path | str) -> bytes:
    """Return a file in Gmsh's format MSH from its section $MeshFormat on.

    A file that begins otherwise may be a script of Gmsh, whose commands Gmsh would run; here Gmsh
    reads no file at all. Sections $Comments before $MeshFormat are left out.

    Raises:
        RefusedError: The file cannot be read, or begins otherwise.
    """
    try:
        require_text(Path(path))
        content = Path(path).read_bytes()
    except OSError as error:
        raise RefusedError("mesh.file", path, MESH_FILES, error.strerror or str(error)) from None
    while content.startswith(COMMENTS):
        _, _, content = content.partition(END_OF_COMMENTS)
        content = content.lstrip()
    is_mesh = re.match(rb"\$MeshFormat\s", content) is not None
    cure = 'write it by gmsh.write("NAME.msh") or `gmsh -save`; a .geo script is no mesh'
    require(is_mesh, "mesh.file", f"{path}, without $MeshFormat at its start", MESH_FILES, cure)
    return content


def read_prisms(mesh: MshFile) -> Prisms:
    """All prisms of a file, each physical group of volumes a phase, by rising number of the group.

    Raises:
        MeshError: A volume is in no physical group or in two, or has other elements.
    """
    if mesh.partitions:
        cure = "write the mesh before it is divided among processes"
        raise MeshError(f"the mesh is partitioned into {mesh.partitions} parts", cure)
    if not mesh.volumes and not mesh.elements:
        raise MeshError("the mesh is plane: it has no volumes, and prisms are wanted", EXTRUDE)
    names: list[str] = []
    cells: list[Ints] = []
    phases: list[Ints] = []
    grouped: set[int] = set()
    for group in sorted(mesh.groups):
        name = mesh.names.get(group) or f"group {group}"
        volumes = sorted(mesh.groups[group])
        if grouped & set(volumes):
            cure = "give each volume one physical group alone"
            raise MeshError(f"prisms of the physical group {name!r} are in another one too", cure)
        grouped |= set(volumes)
        for volume in volumes:
            cells.append(_cells_of(mesh, volume, name))
            phases.append(np.full(len(cells[-1]), len(names)))
        names.append(name)
    ungrouped = sorted(mesh.volumes - grouped)
    if ungrouped or not names:
        what = f"volume {ungrouped[0]}" if ungrouped else "the mesh"
        cure = 'name each phase: gmsh.model.addPhysicalGroup(3, volumes, name="matrix")'
        raise MeshError(f"{what} has no physical group that names its phase", cure)
    # nodes of curves and surfaces alone belong to no prism
    used, compact = np.unique(np.concatenate(cells), return_inverse=True)
    return Prisms(mesh.points[used], compact.reshape(-1, 15), np.concatenate(phases), tuple(names))


def _cells_of(mesh: MshFile, volume: int, name: str) -> Ints:
    """Indices of the nodes of the prisms of a volume, shape (m, 15), in Basix's order."""
    kinds = [kind for entity, kind in mesh.elements if entity == volume]
    if kinds != [PRISM_15]:
        found = ", ".join(element_name(kind) for kind in kinds)
        raise MeshError(
            f"the physical group {name!r} holds {found or 'no elements'}",
            f"mesh with Prism 15: {PRISM_15_BY_GMSH}",
        )
    return mesh.elements[volume, PRISM_15]


def refined(grid: PrismGrid) -> PrismGrid:
    """Split each prism of a mesh from a file into eight, in the place of its own curved shape.

    The eight span all polynomials of the one, so that the displacements of the coarser mesh are
    among those of the finer one, whose stiffness is therefore nowhere larger.

    Raises:
        MeshError: Middles of vertical edges lie at θ of their own, so that there is no mid-level.
    """
    assert grid.fixed is not None
    # Nodes of the eight in the reference prism: those of four triangles, each at two heights.
    parts = np.repeat(_quarters(), 2, axis=0)  # (8, 3, 2)
    starts = np.tile([0.0, 0.5], len(parts) // 2)
    x, y, z = vertices_and_midpoints().T
    barycentric = np.stack([1 - x - y, x, y], axis=1)
    planar = barycentric @ parts  # (8, 15, 2)
    heights = starts[:, np.newaxis] + z / 2
    at = np.concatenate([planar, heights[..., np.newaxis]], axis=-1).reshape(-1, 3)
    shapes = np.asarray(wedge(1).tabulate(0, at)[0]).reshape(len(at), -1)

    # A node that prisms share has the same weights of the vertices that they share. They are
    # sixteenths, so that vertex and weight make one whole number.
    across = np.stack([1 - at[:, 0] - at[:, 1], at[:, 0], at[:, 1]], axis=1)
    weights = np.hstack([across * (1 - at[:, 2:]), across * at[:, 2:]])
    sixteenths = np.rint(16 * weights).astype(int)
    keys = np.where(sixteenths > 0, grid.cells[:, np.newaxis, :6] * 17 + sixteenths, -1)
    keys = np.sort(keys.reshape(-1, 6), axis=1)
    _, first, nodes = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    points = (shapes @ grid.fixed[grid.cells]).reshape(-1, 3)[first]
    phase = np.repeat(grid.phase, len(parts))
    return grid_of(Prisms(points, nodes.reshape(-1, len(z)), phase, grid.names))


def _quarters() -> Array:
    """Return the vertices of the four triangles that halve the edges of the reference triangle.

    Shape (4, 3, 2).
    """
    a, b, c = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    ab = (a + b) / 2
    bc = (b + c) / 2
    ca = (c + a) / 2
    return np.array([[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]])


UPSIDE_DOWN = [3, 4, 5, 0, 1, 2, 12, 13, 8, 14, 10, 11, 6, 7, 9]
"""Order of a prism's nodes that puts its upper triangle first."""
MIRRORED = [0, 2, 1, 3, 5, 4, 7, 6, 8, 9, 11, 10, 13, 12, 14]
"""Order of a prism's nodes that exchanges two vertices of its triangles."""


def orient(prisms: Prisms) -> Prisms:
    """Reorder the nodes of prisms so that the first triangle is the lower one, counterclockwise."""
    cells = prisms.cells.copy()
    points = prisms.points
    is_falling = points[cells[:, 3], 2] < points[cells[:, 0], 2]
    cells[is_falling] = cells[is_falling][:, UPSIDE_DOWN]
    first = points[cells[:, 0], :2]
    a = points[cells[:, 1], :2] - first
    b = points[cells[:, 2], :2] - first
    is_clockwise = a[:, 0] * b[:, 1] < a[:, 1] * b[:, 0]
    cells[is_clockwise] = cells[is_clockwise][:, MIRRORED]
    return replace(prisms, cells=cells)


def _require_filled(grid: PrismGrid) -> None:
    """Refuse voids, overlaps and folded prisms, by det J at the quadrature points."""
    assert grid.fixed is not None
    points, weights = prism_rule()
    slopes = np.array(wedge(1).tabulate(1, points)[1:]).reshape(3, len(points), -1)
    prisms = grid.fixed[grid.cells]
    determinants = np.linalg.det(np.einsum("aqn,cnb->cqab", slopes, prisms))
    if (determinants <= 0).any():
        x, y, theta = prisms[np.argmin(determinants.min(axis=1)), 0]
        what = f"the prism at ({x:.4g}, {y:.4g}, θ = {theta:.4g}) is folded"
        cure = "put middle nodes near the middles of their edges: Mesh.HighOrderOptimize = 2"
        raise MeshError(what, cure)
    low, high = grid.fixed.min(axis=0), grid.fixed.max(axis=0)
    filled = float((determinants @ weights).sum() / np.prod(high - low))
    if abs(filled - 1) > FILLED:
        cure = "give holes a phase of their own, soft as air"
        if filled > 1:
            cure = "split surfaces that lie on one another: occ.fragment, both objects removed"
        raise MeshError(f"the prisms fill {filled:.2%} of the cell, not 100 %", cure)


def _require_joined_columns(grid: PrismGrid) -> None:
    """Refuse slits, and columns of prisms whose phase changes along θ."""
    triangles, points = grid.plane.triangles[:, :3], grid.plane.points
    ends, edges, _ = square.edges(triangles, grid.plane.inside)
    middles = points[ends].mean(axis=1)
    is_inside = abs(middles).max(axis=1) < 1 - SAME_PLACE
    is_open = (np.bincount(edges.ravel()) == 1) & is_inside
    if is_open.any():
        x, y = middles[np.argmax(is_open)]
        what = f"the edge at ({x:.4g}, {y:.4g}) has a prism on one side alone: a slit"
        raise MeshError(what, "let both surfaces share their curve: occ.fragment, or Coherence")
    phase = grid.phase.reshape(grid.layers, -1)
    changes = phase[1:] != phase[:-1]
    if changes.any():
        layer, column = np.argwhere(changes)[0]
        x, y = points[triangles[column]].mean(axis=0)
        below, above = (grid.names[phase[k, column]] for k in (layer, layer + 1))
        raise MeshError(
            f"the column at ({x:.4g}, {y:.4g}) is {below} in a layer of θ and {above} in the next",
            "extrude each phase through all layers; a cell that changes at a level is two meshes,"
            " averaged by the weights of θ",
        )


def _require_theta_last(points: Array) -> None:
    """Refuse points, shape (n, 3), of a cell whose third coordinate is not the one along θ.

    The cell spans −1 … 1 in two coordinates. If it does so in the third one and in only one of the
    others, θ was taken along the remaining one.
    """
    ends = np.array([points.min(axis=0), points.max(axis=0)])
    is_side = (np.abs(ends - [[-1], [1]]) <= SAME_PLACE).all(axis=0)
    if is_side[2] and is_side.sum() == 2:
        axis = int(np.argmin(is_side))
        low, high = ends[:, axis]
        raise MeshError(
            f"the cell spans {low:.6g} … {high:.6g} along x{axis + 1} and −1 … 1 along x3",
            f"turn the axes: exchange x{axis + 1} and x3, so that θ is the third coordinate",
        )


def _require_square(xy: Array, what: str) -> None:
    """Refuse points (n, 2) whose box is not the cell's."""
    box = np.array([xy.min(axis=0), xy.max(axis=0)])
    if abs(box - [[-1, -1], [1, 1]]).max() > SAME_PLACE:
        shown = " × ".join(f"{low:.6g} … {high:.6g}" for low, high in box.T)
        size, other = box[1] - box[0]
        cure = "the cell is a square, not a rectangle: mesh the square −1 … 1 × −1 … 1 anew"
        if abs(size - other) <= SAME_PLACE * size:
            x, y = box.mean(axis=0)
            cure = f"scale and move the mesh: 2 (x − {x:g}) / {size:g}, 2 (y − {y:g}) / {size:g}"
        raise MeshError(f"{what} spans {shown}, not −1 … 1 × −1 … 1", cure)


def _require_periodic_square(grid: PrismGrid) -> None:
    """Refuse levels that do not fill [−1, 1]², or whose opposite sides do not match."""
    assert grid.fixed is not None
    per_level = len(grid.plane.points)
    lowest: Ints | None = None  # unknowns of its nodes, which partners have in common
    for level in range(grid.layers + 1):
        points = grid.fixed[level * per_level : (level + 1) * per_level]
        xy, theta = points[:, :2], points[0, 2]
        _require_square(xy, f"the level θ = {theta:.4g}")
        try:
            unknown = unknowns(xy)
        except MeshError as error:
            raise MeshError(f"{error.what}, on the level θ = {theta:.4g}", error.cure) from None
        if lowest is not None and not np.array_equal(unknown, lowest):
            raise MeshError(f"a column changes its partner at the level θ = {theta:.4g}")
        lowest = unknown


def write(
    path: Path | str,
    points: Array,
    cells: Ints,
    phase: Ints,
    names: Sequence[str],
    fields: Mapping[str, Array] | None = None,
) -> None:
    """Write prisms to a binary file of Gmsh, each phase a physical group.

    Args:
        path: A name that ends in .msh.
        points: (x1, x2, θ), shape (n, 3).
        cells: Nodes in Basix's order, shape (m, 15).
        phase: Index in `names` of each prism's phase, shape (m,).
        names: Names of the phases.
        fields: Values at the nodes of the prisms by name, shape (m, 15, components).
    """
    with square.model() as gmsh:
        gmsh.option.setNumber("Mesh.Binary", 1)
        gmsh.model.add("cell")
        model = gmsh.model.getCurrent()
        tags = np.arange(1, len(points) + 1)
        volumes = [gmsh.model.addDiscreteEntity(3) for _ in names]
        gmsh.model.mesh.addNodes(3, volumes[0], tags, points.ravel())
        for k, (volume, name) in enumerate(zip(volumes, names, strict=True)):
            prisms = np.flatnonzero(phase == k)
            gmsh.model.mesh.addElementsByType(
                volume, PRISM_15, prisms + 1, (cells[prisms] + 1).ravel()
            )
            gmsh.model.addPhysicalGroup(3, [volume], name=name)
        gmsh.write(str(path))
        for name, values in (fields or {}).items():
            view, elements = gmsh.view.add(name), np.arange(1, len(values) + 1)
            data = view, 0, model, "ElementNodeData", elements, values.ravel()
            gmsh.view.addHomogeneousModelData(*data, numComponents=values.shape[-1])
            gmsh.option.setNumber("PostProcessing.SaveMesh", 0)
            gmsh.view.write(view, str(path), append=True)
