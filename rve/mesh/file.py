"""The user's mesh in a file of Gmsh: prisms of the product space as they are, or plane triangles.

A file of prisms is the geometry at its own θ: levels may be uneven, columns bent and phases any
number. Plane triangles are extruded along θ. Gmsh's 15-node prisms ("Prism 15") have Basix's order
of nodes; physical groups name phases.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import RefusedError, require
from alphacut.base.extras import MissingLibraryError
from alphacut.base.memory import require_text
from alphacut.base.units import mentions
from alphacut.rve.cell.lattice import SQUARE, Lattice
from alphacut.rve.mesh import square
from alphacut.rve.mesh.columns import grid_of
from alphacut.rve.mesh.msh import SURFACE, MshFile, read_msh
from alphacut.rve.mesh.periodicity import SAME_PLACE, MeshError, unknowns
from alphacut.rve.mesh.plane import PlaneMesh
from alphacut.rve.mesh.prism_grid import Elements, PrismGrid, Prisms
from alphacut.rve.mesh.wedge import prism_rule, vertices_and_midpoints, wedge

PRISM_15 = 18  # Gmsh's number of the type "Prism 15", in its table of MSH file elements
TRIANGLE_3 = 2
"""Gmsh's number of the type "Triangle 3"."""
TRIANGLE_6 = 9
"""Gmsh's number of the type "Triangle 6"."""
MESH_FILES = "meshes in Gmsh's format MSH with 15-node prisms or plane triangles"
PRISM_15_BY_GMSH = "extrude with recombine, Mesh.SecondOrderIncomplete = 1, order 2"
T = TypeVar("T", bound=Elements)


def read_grid(path: Path | str, theta: tuple[float, float] = (0.0, 1.0)) -> PrismGrid:
    """Read a mesh of the cell from a file in Gmsh's format MSH and check it.

    The mesh consists of 15-node prisms (Gmsh's "Prism 15") that stand in columns on a
    parallelogram or a regular hexagon, with the random number θ as third coordinate. Each physical
    group of volumes is a material. A file without volumes has plane triangles of three or six
    nodes, whose materials are physical groups of surfaces; they are extruded along θ.

    Args:
        path: The file, of any version of MSH, text or binary.
        theta: Lowest and highest level of θ of extruded triangles.

    Returns:
        The prisms where the file has them (`fixed`), with nodes numbered level by level of θ.

    Raises:
        RefusedError: The file cannot be read, is not in that format, or contradicts itself.
        MeshError: It is no mesh of a cell, as `checked_grid` says, or has other elements, or a
            volume or surface without a group or in two.
    """
    content = mesh_content(path)
    try:
        mesh = read_msh(content)
    except MissingLibraryError:
        raise
    except RefusedError as error:
        cure = error.cure or "write it anew by Gmsh"
        raise RefusedError("mesh.file", f"{error.value}, of {path}", MESH_FILES, cure) from None
    is_plane = mesh.dimension == SURFACE
    for comment in re.findall(rb"(?s)\$Comments(.*?)\$EndComments", content):
        text = comment.decode("utf-8", "replace")
        _require_one_unit(f"mesh.file, {path}", text, is_plane=is_plane)
    prisms = read_plane(mesh).prisms(theta) if is_plane else read_prisms(mesh)
    return checked_grid(prisms)


def checked_grid(prisms: Prisms) -> PrismGrid:
    """Order prisms of the user into levels and columns, and check that they are a cell.

    Args:
        prisms: Prisms in any order, whose nodes have any numbers; each stands upright or upside
            down.

    Returns:
        The prisms where they are (`fixed`), with nodes numbered level by level of θ.

    Raises:
        MeshError: It is no mesh of a cell: θ along another axis, no parallelogram or hexagon, no
            columns, edges without a middle node of their own, folded prisms, voids or overlaps,
            opposite sides that do not match, slits, or a material that changes along θ.
    """
    grid = grid_of(orient(prisms))
    plane = grid.plane
    _require_one_middle_for_each_edge(plane.triangles, plane.points)
    grid = replace(grid, plane=replace(plane, lattice=lattice_of(plane.points)))
    _require_unfolded_and_filled(grid)
    _require_periodic(grid)
    _require_joined_columns(grid)
    return grid


def mesh_content(path: Path | str) -> bytes:
    """Return the bytes of a file in Gmsh's format MSH.

    A file that begins neither with $MeshFormat nor with sections $Comments before it may be a
    script of Gmsh, and is refused. What follows $MeshFormat is not checked.

    Args:
        path: The file, text or binary; its name may have any ending.

    Raises:
        RefusedError: The file does not exist, is a pipe or a device, is too large for the free
            memory, is empty, or begins with neither $MeshFormat nor $Comments.
    """
    try:
        require_text(Path(path))
        content = Path(path).read_bytes()
    except OSError as error:
        raise RefusedError("mesh.file", path, MESH_FILES, error.strerror or str(error)) from None
    # A section of comments that does not end leaves nothing, which is refused below.
    rest = content
    while rest.startswith(b"$Comments"):
        _, _, rest = rest.partition(b"$EndComments")
        rest = rest.lstrip()
    is_mesh = re.match(rb"\$MeshFormat\s", rest) is not None
    cure = 'write it by gmsh.write("NAME.msh") or `gmsh -save`; a .geo script is no mesh'
    require(is_mesh, "mesh.file", f"without $MeshFormat at its start, {path}", MESH_FILES, cure)
    return content


def _require_one_unit(name: str, comment: str, *, is_plane: bool) -> None:
    """Raise RefusedError where a comment states two units, or of prisms that z is a length."""
    units: dict[float, str] = {}
    for line in re.split(r"[\n;]", comment):
        for one in mentions(line):
            is_of_axes = re.search(r"(?i)\b(?:in|units?(?:\s+of)?)\W*$", one.before) is not None
            if one.dimension == "m" and (is_of_axes or not one.numbers):
                units[(one.values or (one.unit.factor,))[0]] = one.shown
                is_theta = re.search(r"(?i)theta|θ|random", line) is not None
                has_z = re.search(r"(?i)\bz\b", one.before) is not None
                allowed = "the random number θ along z"
                is_right = is_plane or is_theta or not has_z
                require(is_right, name, f"of z in {one.shown}, a length", allowed)
    cure = "scale x and y to one unit, and mend the comment"
    shown = " and ".join(units.values())
    require(len(units) < 2, name, f"of lengths in {shown}", "one unit of x and y", cure)


def read_prisms(mesh: MshFile) -> Prisms:
    """Collect all prisms of a file; see `_elements`."""
    # Gmsh's order of the nodes of "Prism 15" is Basix's: vertices, then midpoints of edges.
    return _elements(mesh, Prisms, PRISM_15, f"mesh with Prism 15: {PRISM_15_BY_GMSH}")


def read_plane(mesh: MshFile) -> PlaneMesh:
    """Collect all triangles of a file without volumes, all of three nodes or all of six.

    See `_elements`.
    """
    is_quadratic = any(kind == TRIANGLE_6 for _, kind in mesh.elements)
    kind = TRIANGLE_6 if is_quadratic else TRIANGLE_3
    cure = "mesh with triangles of order 1 or 2, all alike"
    plane = _elements(mesh, PlaneMesh, kind, cure)
    # Gmsh has the middles of the edges 01, 12 and 02 behind the vertices.
    return replace(plane, cells=plane.cells[:, [0, 1, 2, 3, 5, 4]]) if is_quadratic else plane


def _elements(mesh: MshFile, made: type[T], kind: int, cure: str) -> T:
    """Collect the elements of a file; each physical group becomes a phase.

    Args:
        mesh: What the file says: points, elements by entity and type, groups and names.
        made: Class of what is returned.
        kind: Gmsh's number of the only type that is allowed.
        cure: Says how to mesh with that type.

    Returns:
        The elements, and points that belong to one of them. A group without a name is "group
        NUMBER".

    Raises:
        MeshError: The mesh is divided into partitions; a volume (or surface) is in no physical
            group or in two; or it has no elements or others than those of `kind`.
    """
    entity = "surface" if mesh.dimension == SURFACE else "volume"
    if mesh.partitions:
        whole = "write the mesh before it is divided among processes"
        raise MeshError(f"the mesh is partitioned into {mesh.partitions} parts", whole)
    names: list[str] = []
    cells: list[Ints] = []
    phases: list[Ints] = []
    grouped: set[int] = set()
    for group in sorted(mesh.groups):
        name = mesh.names.get(group) or f"group {group}"
        tags = sorted(mesh.groups[group])
        if grouped & set(tags):
            alone = f"give each {entity} one physical group alone"
            raise MeshError(
                f"{entity}s of the physical group {name!r} are in another one too", alone
            )
        grouped |= set(tags)
        for tag in tags:
            kinds = [of_element for place, of_element in mesh.elements if place == tag]
            if kinds != [kind]:
                listed = ", ".join(mesh.kinds[k] for k in kinds) or "no elements"
                raise MeshError(f"the physical group {name!r} holds {listed}", cure)
            cells.append(mesh.elements[tag, kind])
            phases.append(np.full(len(cells[-1]), len(names)))
        names.append(name)
    ungrouped = sorted(mesh.entities - grouped)
    if ungrouped or not names:
        what = f"{entity} {ungrouped[0]}" if ungrouped else "the mesh"
        name_it = f'gmsh.model.addPhysicalGroup({mesh.dimension}, {entity}s, name="matrix")'
        raise MeshError(
            f"{what} has no physical group that names its phase", f"name each phase: {name_it}"
        )
    # Nodes of curves and surfaces alone belong to no element; they would be unknowns without
    # stiffness.
    all_cells = np.concatenate(cells)
    used, compact = np.unique(all_cells, return_inverse=True)
    compact = compact.reshape(all_cells.shape)
    return made(mesh.points[used], compact, np.concatenate(phases), tuple(names))


def refined(grid: PrismGrid) -> PrismGrid:
    """Split each prism of a mesh from a file into eight, which together have its curved shape.

    A prism is halved along θ, and its triangle is split into four at the midpoints of the edges.
    The eight can represent each displacement of the one, so the finer mesh is nowhere stiffer than
    the coarser one.

    Args:
        grid: A mesh with the positions `fixed` of all nodes; without them an AssertionError is
            raised.

    Returns:
        A new grid with twice the layers and four times the triangles, and the phases of the old
        one.

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

    # A new node may lie in several prisms. Its key tells that it is the same node: the vertices of
    # the prism with the node's trilinear weights, which are 0 for all vertices that these prisms do
    # not share. (Positions would need a tolerance.) Barycentric coordinates and heights are
    # quarters, so weights are sixteenths, 0 to 16, and 17 · vertex + weight holds both in one whole
    # number. Vertices of weight 0 become −1.
    across = np.stack([1 - at[:, 0] - at[:, 1], at[:, 0], at[:, 1]], axis=1)  # of the triangle
    weights = np.hstack([across * (1 - at[:, 2:]), across * at[:, 2:]])
    sixteenths = np.rint(16 * weights).astype(int)
    keys = np.where(sixteenths > 0, grid.cells[:, np.newaxis, :6] * 17 + sixteenths, -1)
    keys = np.sort(keys.reshape(-1, 6), axis=1)
    _, first, nodes = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    points = (shapes @ grid.fixed[grid.cells]).reshape(-1, 3)[first]
    phase = np.repeat(grid.phase, len(parts))
    fine = grid_of(Prisms(points, nodes.reshape(-1, len(z)), phase, grid.names))
    return replace(fine, plane=replace(fine.plane, lattice=grid.plane.lattice))


def _quarters() -> Array:
    """Return the vertices of the four triangles that halve the edges of the reference triangle.

    The reference triangle has the vertices (0, 0), (1, 0) and (0, 1). The first three triangles lie
    at these vertices, the last in the middle. All are counterclockwise.

    Returns:
        Coordinates, shape (4, 3, 2): triangles, vertices, x and y.
    """
    a, b, c = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    ab = (a + b) / 2
    bc = (b + c) / 2
    ca = (c + a) / 2
    return np.array([[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]])


def orient(prisms: Prisms) -> Prisms:
    """Reorder the nodes of prisms so that the first triangle is the lower one, counterclockwise.

    "Lower" is by θ, the third coordinate; the turn is seen in the plane of the first two. Only
    vertices are looked at. Prisms that are in order already, and those without height or area, keep
    their nodes.

    Args:
        prisms: Prisms with 15 nodes each in Basix's order.

    Returns:
        New prisms with reordered `cells`; points, phases and names are those of `prisms`.
    """
    # Orders of a prism's nodes in which the upper triangle comes first, and in which the second and
    # the third vertex of both triangles are exchanged.
    upside_down = [3, 4, 5, 0, 1, 2, 12, 13, 8, 14, 10, 11, 6, 7, 9]
    mirrored = [0, 2, 1, 3, 5, 4, 7, 6, 8, 9, 11, 10, 13, 12, 14]
    cells = prisms.cells.copy()
    points = prisms.points
    is_falling = points[cells[:, 3], 2] < points[cells[:, 0], 2]
    cells[is_falling] = cells[is_falling][:, upside_down]
    first = points[cells[:, 0], :2]
    a = points[cells[:, 1], :2] - first
    b = points[cells[:, 2], :2] - first
    is_clockwise = a[:, 0] * b[:, 1] < a[:, 1] * b[:, 0]
    cells[is_clockwise] = cells[is_clockwise][:, mirrored]
    return replace(prisms, cells=cells)


def _require_unfolded_and_filled(grid: PrismGrid) -> None:
    """Raise unless the prisms of a mesh from a file fill the cell, by det J at quadrature points.

    J is the Jacobian matrix of the map from the reference prism. The sum of its determinants times
    the weights is the volume of the prisms; it is compared with the volume of the cell.

    Args:
        grid: A mesh with its lattice and the positions `fixed` of all nodes; without them an
            AssertionError is raised.

    Raises:
        MeshError: A determinant is zero or negative, so that a prism is folded; or the volume
            differs from that of the cell by more than a millionth (voids, prisms that overlap).
    """
    assert grid.fixed is not None
    points, weights = prism_rule()
    slopes = np.array(wedge(1).tabulate(1, points)[1:]).reshape(3, len(points), -1)
    prisms = grid.fixed[grid.cells]
    determinants = np.linalg.det(np.einsum("aqn,cnb->cqab", slopes, prisms))
    if (determinants <= 0).any():
        x, y, theta = prisms[np.argmin(determinants.min(axis=1)), 0]
        what = f"the prism at ({x:.4g}, {y:.4g}, θ = {theta:.4g}) is folded"
        cure = "move corners of prisms back, and middle nodes near the middles of their edges"
        cure += " (Mesh.HighOrderOptimize = 2)"
        raise MeshError(what, cure)
    volume = grid.plane.lattice.area * np.ptp(grid.fixed[:, 2])
    filled = float((determinants @ weights).sum() / volume)
    # Round-off of the volume is far below 1e-6, and a single missing prism of any usable mesh is
    # far above it.
    if abs(filled - 1) > 1e-6:
        cure = "give holes a phase of their own, soft as air"
        if filled > 1:
            cure = "split surfaces that lie on one another: occ.fragment, both objects removed"
        raise MeshError(f"the prisms fill {filled:.2%} of the cell, not 100 %", cure)


def _require_joined_columns(grid: PrismGrid) -> None:
    """Raise if a mesh has slits, or columns of prisms whose phase changes along θ.

    A slit is an edge inside the cell that belongs to one triangle alone: surfaces that touch
    without common nodes.

    Args:
        grid: Prisms sorted layer by layer and, in each layer, by the triangle of the plane mesh.

    Raises:
        MeshError: There is a slit, or a prism and the one above it have different phases.
    """
    triangles, points = grid.plane.triangles[:, :3], grid.plane.points
    ends, edges, _ = square.edges(triangles, grid.plane.inside)
    middles = points[ends].mean(axis=1)
    reaches = abs(grid.plane.lattice.side_coordinates(middles)).max(axis=1)
    is_inside = reaches < 1 - SAME_PLACE
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


def lattice_of(xy: Array) -> Lattice:
    """Return the parallelogram or regular hexagon whose corners are among points, as a cell.

    The first vector of the lattice is the one nearer to the x1 axis, and the next one stands
    counterclockwise from it. Other points may lie outside of a parallelogram.

    Args:
        xy: Points, shape (n, 2), at least three of them not on a line.

    Returns:
        The cell; exactly the square [−1, 1]² where the corners are within 1e-8 of its corners.
    """
    # A parallelogram has the centre of its box, a corner farthest from there, and the other two
    # corners farthest from the line through that corner and the centre.
    centre = (xy.min(axis=0) + xy.max(axis=0)) / 2
    offsets = xy - centre
    diagonal = offsets[np.argmax(np.hypot(offsets[:, 0], offsets[:, 1]))]
    hexagon = _hexagon(offsets, diagonal)
    if hexagon is not None:
        return replace(hexagon, centre=(float(centre[0]), float(centre[1])))
    distances = diagonal[0] * offsets[:, 1] - diagonal[1] * offsets[:, 0]
    other = offsets[np.argmax(abs(distances))]
    half_vectors = np.array([diagonal - other, diagonal + other]) / 2
    # The sine of the angle with the x1 axis orders the two.
    sines = abs(half_vectors[:, 1]) / np.hypot(half_vectors[:, 0], half_vectors[:, 1])
    half_vectors = half_vectors[np.argsort(sines)]
    half_vectors[0] *= np.copysign(1, half_vectors[0, 0])
    half_vectors[1] *= np.sign(np.linalg.det(half_vectors))
    found = np.vstack([half_vectors, centre])
    if abs(found - [[1, 0], [0, 1], [0, 0]]).max() <= SAME_PLACE:
        return SQUARE
    first, second, middle = [(float(x), float(y)) for x, y in found]
    return Lattice((first, second), middle)


def _hexagon(offsets: Array, corner: Array) -> Lattice | None:
    """Return the regular hexagon about 0 with a corner, None unless its other corners are there.

    Args:
        offsets: Points, shape (n, 2).
        corner: One of them, (x1, x2), farthest from 0.
    """
    # Complex factors that turn the plane by 30°, 90° and 150°, and by −60° and 60°.
    turns = np.exp(1j * np.pi * np.array([1, 3, 5]) / 6)
    points = offsets[:, 0] + 1j * offsets[:, 1]
    first = complex(*corner)
    others = first * np.exp(1j * np.pi * np.array([-1, 1]) / 3)
    if abs(points - others[:, np.newaxis]).min(axis=1).max() > SAME_PLACE * abs(first):
        return None
    # Half vectors stand at right angles to the sides, whose distance is cos 30° of the corners'.
    half_vectors = first * np.cos(np.pi / 6) * turns
    # Turned by whole 60°, the first one is the nearest to the x1 axis.
    half_vectors *= np.exp(-1j * np.pi / 3 * np.round(np.angle(half_vectors[0]) * 3 / np.pi))
    return Lattice(tuple((float(vector.real), float(vector.imag)) for vector in half_vectors))


def _require_periodic(grid: PrismGrid) -> None:
    """Raise unless each level of θ fills the same cell and its opposite sides match.

    So must the nodes half-way between two levels.

    Args:
        grid: A mesh with the positions `fixed` of all nodes (else an AssertionError is raised),
            which are numbered level by level, and with the lattice of its lowest level.

    Raises:
        MeshError: The nodes of a level reach out of the cell or do not reach its sides, the middle
            node of an edge on a side is off it, a node on a side has no partner on the opposite
            side, or nodes are partners on one level and not on another.
    """
    assert grid.fixed is not None
    lattice = grid.plane.lattice
    first_middle = (grid.layers + 1) * len(grid.plane.points)
    levels = np.split(grid.fixed[:first_middle], grid.layers + 1)
    middles = np.split(grid.fixed[first_middle:], grid.layers)
    for points in levels + middles:
        xy, theta = points[:, :2], points[0, 2]
        reaches = abs(lattice.side_coordinates(xy)).max(axis=0)
        if abs(reaches - 1).max() > SAME_PLACE:
            vectors = " and ".join(f"({2 * x:.6g}, {2 * y:.6g})" for x, y in lattice.half_vectors)
            shape = "parallelogram" if len(lattice.half_vectors) == 2 else "hexagon"
            what = f"the level θ = {theta:.4g} is not the {shape} of the vectors {vectors}"
            what += " of the lowest level"
            cure = "mesh a parallelogram or regular hexagon, alike at all θ"
            raise MeshError(what, cure)
        if len(points) == len(grid.plane.points):
            _require_middles_on_sides(grid, xy)
        try:
            partners = unknowns(xy, lattice)
        except MeshError as error:
            raise MeshError(f"{error.what}, on the level θ = {theta:.4g}", error.cure) from None
        # Vertices, which middles have alone, are the first nodes of a level.
        if not np.array_equal(partners, unknowns(levels[0][: len(xy), :2], lattice)):
            raise MeshError(f"a column changes its partner at the level θ = {theta:.4g}")


def _require_middles_on_sides(grid: PrismGrid, xy: Array) -> None:
    """Raise MeshError where an edge's ends lie on a side of the cell and its middle node does not.

    Such a node would have no partner on the opposite side, where the field would jump.

    Args:
        grid: A mesh with its lattice, which tells the ends of each middle node's edge.
        xy: Positions of the nodes of a level, shape (nodes, 2), vertices before middle nodes.
    """
    plane = grid.plane
    coordinates = plane.lattice.side_coordinates(xy)
    # −1 on the first side of each pair, 1 on the second one, and 0 inside.
    sides = np.where(abs(abs(coordinates) - 1) <= SAME_PLACE, np.sign(coordinates), 0)
    first = sides[plane.ends[:, 0]]
    is_along_side = (first != 0) & (first == sides[plane.ends[:, 1]])
    is_off = (is_along_side & (sides[plane.vertices :] != first)).any(axis=1)
    if is_off.any():
        x, y = xy[plane.vertices + np.argmax(is_off)]
        what = f"the middle node at ({x:.8g}, {y:.8g}) of an edge on a side of the cell is off it"
        raise MeshError(what, "put it onto the side, as straight sides do")


def _require_one_middle_for_each_edge(triangles: Ints, points: Array) -> None:
    """Raise MeshError where triangles that share an edge have different middle nodes on it.

    Neither may a node be the middle of two edges.

    Args:
        triangles: Nodes of six-node triangles: vertices, then middles of edges 01, 02, 12, shape
            (triangles, 6).
        points: Positions of the nodes, shape (n, 2).
    """
    _, edges, _ = square.edges(triangles[:, :3], np.zeros(len(triangles), bool))
    # Edges of a triangle are in the order 12, 02, 01.
    pairs = np.unique(np.stack([edges.ravel(), triangles[:, [5, 4, 3]].ravel()]), axis=1)
    for row, what in ((0, "an edge has two middle nodes"), (1, "two edges have one middle node")):
        values, counts = np.unique(pairs[row], return_counts=True)
        if (counts > 1).any():
            middle = pairs[1, pairs[row] == values[np.argmax(counts > 1)]][0]
            x, y = points[middle]
            cure = "remove duplicate nodes, and let surfaces share their curves: occ.fragment"
            raise MeshError(f"{what}, at ({x:.6g}, {y:.6g})", cure)


def write(
    path: Path | str,
    points: Array,
    cells: Ints,
    phase: Ints,
    names: Sequence[str],
    fields: Mapping[str, Array] | None = None,
) -> None:
    """Write prisms to a binary file in Gmsh's format MSH, each phase a physical group of volumes.

    A file that exists is replaced.

    Args:
        path: A name that ends in .msh; Gmsh tells the format by the ending.
        points: Coordinates (x1, x2, θ), shape (n, 3).
        cells: Indices of the nodes of each prism in `points`, in Basix's order (which is Gmsh's),
            shape (m, 15).
        phase: Index in `names` of each prism's phase, shape (m,).
        names: Names of the phases, which become those of the physical groups; at least one.
        fields: Values at the nodes of the prisms by name, shape (m, 15, components). Each becomes a
            view behind the mesh. Element k of a view is the k-th prism.

    Raises:
        MissingLibraryError: Gmsh is not installed.
        Exception: Whatever Gmsh raises, such as of a file that cannot be written.
    """
    with square.open_gmsh() as gmsh:
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
            view = gmsh.view.add(name)
            gmsh.view.addHomogeneousModelData(
                view,
                step=0,
                modelName=model,
                dataType="ElementNodeData",
                tags=np.arange(1, len(values) + 1),
                data=values.ravel(),
                numComponents=values.shape[-1],
            )
            # Else each view would bring the whole mesh into the file once more.
            gmsh.option.setNumber("PostProcessing.SaveMesh", 0)
            gmsh.view.write(view, str(path), append=True)
