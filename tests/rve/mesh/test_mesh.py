"""Plane meshes, periodic, on their outline and sound wherever they slide; prisms, all of which arrive."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("alphacut.rve.fenicsx")

import basix

from alphacut.fuzzy import FailedError, RefusedError
from alphacut.rve import Ellipse, MeshModel
from alphacut.rve.mesh import square
from alphacut.rve.mesh.columns import extrude, grid_of
from alphacut.rve.mesh.curved import curved_nodes, jacobian_ratios, plane_mesh
from alphacut.rve.mesh.periodicity import unknowns
from alphacut.rve.mesh.prism_grid import Prisms, nodes_at_radii, reference_radius
from alphacut.rve.mesh.wedge import prism_rule, wedge
from alphacut.stochastic import HermiteMap
from tests.refused import refuses

CIRCLE = Ellipse(1.0)


def flower(angle):
    """A star with four leaves."""
    return 1 + 0.15 * np.cos(4 * angle)


OUTLINES = [CIRCLE, Ellipse(2.0), Ellipse(0.7), flower]


def areas(points, triangles):
    a, b, c = points[triangles[:, :3]].transpose(1, 0, 2)
    return ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2


@pytest.mark.parametrize("outline", OUTLINES)
def test_sliding_keeps_triangles_sound_and_the_interface_on_its_outline(outline):
    mesh = extrude(size=0.2, radius=0.5, outline=outline, layers=1).plane
    signs = np.sign(areas(mesh.points, mesh.triangles))
    area = np.pi * np.mean(outline(np.linspace(0, 2 * np.pi, 720, endpoint=False)) ** 2)
    for radius in (0.05, 0.3, 0.65):
        points = nodes_at_radii(mesh, np.array([radius]))[0]
        assert (areas(points, mesh.triangles) * signs > 0).all()
        x, y = points[mesh.arc].T
        assert np.hypot(x, y) == pytest.approx(radius * outline(np.arctan2(y, x)), rel=1e-12)
        sides = abs(mesh.points) > 1 - 1e-12
        assert points[sides] == pytest.approx(mesh.points[sides], abs=1e-14)
        inside = abs(areas(points, mesh.triangles)[mesh.inside]).sum()
        assert inside == pytest.approx(radius**2 * area, rel=0.04)


def test_opposite_nodes_are_one_unknown_and_all_corners_none():
    plane = extrude(size=0.3, radius=0.6, layers=1).plane
    pairs = zip(plane.points, unknowns(plane.points), strict=True)
    keys = {tuple(np.round(p, 7)): u for p, u in pairs}
    for (x, y), u in keys.items():
        if abs(x) == abs(y) == 1:
            assert u == -1
        elif abs(x) == 1:
            assert u == keys[-x, y]
        elif abs(y) == 1:
            assert u == keys[x, -y]
    inner = [u for (x, y), u in keys.items() if max(abs(x), abs(y)) < 1]
    assert len(set(inner)) == len(inner)


def test_gmsh_meshes_a_cell_again_only_if_its_file_is_not_there_whole(tmp_path, monkeypatch):
    monkeypatch.setenv("ALPHACUT_CACHE", str(tmp_path))
    meshed, gmsh_triangles = [], square.gmsh_triangles
    monkeypatch.setattr(
        square, "gmsh_triangles", lambda *cell: meshed.append(cell) or gmsh_triangles(*cell)
    )

    def has_meshed(outline, refinement=0.0):
        """Whether Gmsh was asked for a cell, which is the same either way."""
        before = len(meshed)
        cell = square.triangles(0.5, 0.4, outline, refinement=refinement)
        others = square.triangles(0.5, 0.4, outline, refinement=refinement)
        fresh = gmsh_triangles(*meshed[-1])
        for array, other, right in zip(cell, others, fresh, strict=True):
            np.testing.assert_array_equal(array, right)
            np.testing.assert_array_equal(other, right)
        return len(meshed) > before

    assert [has_meshed(Ellipse(1.5)) for _ in range(2)] == [True, False]
    (file,) = (tmp_path / "meshes").iterdir()
    whole = file.read_bytes()
    assert [has_meshed(Ellipse(1.5, 1.0)), has_meshed(Ellipse(1.5), 1.1)] == [True, True]
    others = sorted(x for x in (tmp_path / "meshes").iterdir() if x != file)
    changed = bytearray(whole)
    changed[len(whole) // 2] ^= 255
    for content in (b"", whole[:-30], bytes(changed), others[0].read_bytes(), b"no file of arrays"):
        file.write_bytes(content)
        assert (has_meshed(Ellipse(1.5)), file.read_bytes()) == (True, whole)
    assert {x.suffix for x in (tmp_path / "meshes").iterdir()} == {".npz"}
    (tmp_path / "meshes").chmod(0o777)  # another user could write there
    assert [has_meshed(CIRCLE) for _ in range(2)] == [True, True]


def test_a_gmsh_that_is_open_already_is_not_mixed_with(gmsh):
    gmsh.model.add("of the user")
    with pytest.raises(FailedError, match=r"open in this process already; call gmsh.finalize"):
        square.gmsh_triangles(0.5, 0.4, CIRCLE, None)
    assert gmsh.model.getCurrent() == "of the user"


def test_a_node_without_a_partner_is_refused():
    plane = extrude(size=0.4, radius=0.5, layers=1).plane
    points = plane.points.copy()
    side = np.flatnonzero((points[:, 0] == 1) & (abs(points[:, 1]) < 0.9))
    points[side[0], 1] += 1e-3
    with pytest.raises(FailedError, match=r"node at \(-?1, .*\) of a side has no partner"):
        unknowns(points)
    with pytest.raises(FailedError, match="has no partner"):
        unknowns(np.delete(plane.points, side[1], axis=0))


def test_partners_are_found_where_noise_straddles_a_tie_of_rounding():
    """Gmsh's coordinates of opposite nodes differ by 3e-13; at half a unit of any rounding too."""
    points = np.array(
        [[-1, 0.5], [1, 0.5], [0.3, -1], [0.3, 1], [-1, -1], [1, -1], [1, 1], [-1, 1]]
    )
    for tie in 10.0 ** -np.arange(2, 16):
        nearly = points + 3e-13 * np.array([[0, -1], [0, 1], [-1, 0], [1, 0], *[[0, 0]] * 4])
        nearly[:4] += tie / 2 * np.array([[0, 1], [0, 1], [1, 0], [1, 0]])
        assert unknowns(nearly).tolist() == [0, 0, 1, 1, -1, -1, -1, -1]


@pytest.mark.parametrize("outline", OUTLINES)
@pytest.mark.parametrize("order", [2, 3, 4])
def test_curved_elements_lie_on_the_outline(outline, order):
    mesh = plane_mesh(0.6, size=0.4, outline=outline)
    points, cells = curved_nodes(mesh, order)
    inside, outside = (set(cells[mesh.inside == flag].ravel()) for flag in (True, False))
    shared = sorted(inside & outside)
    x, y = points[shared].T
    assert np.hypot(x, y) == pytest.approx(0.6 * outline(np.arctan2(y, x)), abs=1e-9)
    edges = sum(np.isin(t, shared).sum() == 2 for t in mesh.triangles[mesh.inside])
    assert len(shared) == order * edges


SHARP = [
    (Ellipse(3.3849, 30.0), 0.2),
    (lambda angle: 1 + 0.15 * np.cos(7 * angle), 0.4),
    (lambda angle: 1 + 0.3 * np.cos(7 * angle), 0.4),
    (lambda angle: 1 + 0.3 * np.cos(3 * angle) ** 9, 0.6),
]


@pytest.mark.parametrize(("outline", "size"), SHARP)
@pytest.mark.parametrize("radius", [0.05, 0.3])
def test_curved_elements_about_a_sharp_outline_are_sound(outline, size, radius):
    """Without regard to its bends, order 4 inverts 2 of 596 triangles at the ellipse's ends."""
    mesh = plane_mesh(radius, size=size, outline=outline)
    for order in (2, 3, 4, 5):
        assert jacobian_ratios(*curved_nodes(mesh, order), order).min() > 0.2


def test_the_ratio_of_jacobians_is_that_of_the_map():
    """x = ξ + t ξ², y = η: det J is 1 + 2 t ξ, its mean 1 + 2 t / 3."""
    corners = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0.5], [0, 0.5], [0.5, 0]])
    for stretch in (-0.8, -0.3, 0.0):
        nodes = corners + stretch * corners[:, :1] ** 2 * [1, 0]
        points = basix.make_quadrature(basix.CellType.triangle, 5)[0]
        right = (1 + 2 * stretch * points[:, 0]).min() / (1 + 2 * stretch / 3)
        ratio = jacobian_ratios(nodes, np.arange(6)[None], 2)
        assert ratio == pytest.approx([right], abs=1e-12)


def test_a_corner_that_no_edge_length_makes_sound_is_refused():
    with refuses("outline"):
        plane_mesh(0.4, size=0.3, outline=lambda angle: 1 + 0.4 * (angle % 2 > 1))


@pytest.mark.parametrize(
    ("outline", "radius"), [(CIRCLE, 0.9996), (Ellipse(4.0), 0.51), (lambda a: np.cos(a), 0.5)]
)
def test_what_does_not_fit_into_the_cell_is_refused(outline, radius):
    with pytest.raises(RefusedError, match="allowed"):
        plane_mesh(radius, size=0.3, outline=outline)


def test_the_reference_radius_leaves_room_for_the_outline():
    wide = HermiteMap(0.3, 0, 0.6, 0)
    assert reference_radius(wide) == 0.45
    assert reference_radius(HermiteMap(0.6, 0, 0.7, 0), Ellipse(2.0)) == pytest.approx(0.9 / 2**0.5)
    with refuses("radius"):
        reference_radius(HermiteMap(0.3, 0, 0.8, 0), Ellipse(2.0))


# prisms


def prisms_of(outline):
    """Three layers, θ from 0 to 1, about a particle that stays as it is in the mesh."""
    grid = extrude(size=0.5, radius=0.4, outline=outline, layers=3)
    points = replace(grid, conforming=False).positions(HermiteMap(0.4, 0, 0.4, 0))
    points[:, 2] = (points[:, 2] + 3) / 6
    return Prisms(points, grid.cells, grid.phase, grid.names)


def volumes(points, cells):
    """Of prisms of 15 nodes in Basix's order, by quadrature, shape (m,)."""
    at, weights = prism_rule()
    slopes = wedge(1).tabulate(1, at)[1:].reshape(3, len(at), 15)
    jacobians = np.einsum("dqn,mnx->mqdx", slopes, points[cells])
    return np.linalg.det(jacobians) @ weights


@pytest.mark.parametrize("outline", [CIRCLE, Ellipse(2.0, 30.0)])
def test_a_prism_that_gmsh_does_not_return_is_missed_by_its_volume(outline):
    prisms = prisms_of(outline)
    each = volumes(prisms.points, prisms.cells)
    assert (each > 0).all()
    assert each.sum() == pytest.approx(4.0, rel=1e-12)  # 2 × 2 × 1
    kept = np.arange(len(each)) != 17
    rest = replace(prisms, cells=prisms.cells[kept], phase=prisms.phase[kept])
    lost = 4.0 - volumes(rest.points, rest.cells).sum()
    assert lost == pytest.approx(each[17], rel=1e-10)
    with pytest.raises(FailedError, match=r"layers of prisms differ|do not pass all levels"):
        grid_of(rest)


def test_the_order_of_prisms_does_not_matter(rng):
    prisms = prisms_of(CIRCLE)
    cells, nodes = rng.permutation(len(prisms.cells)), rng.permutation(len(prisms.points))
    place = np.argsort(nodes)
    mixed = replace(
        prisms,
        points=prisms.points[nodes],
        cells=place[prisms.cells[cells]],
        phase=prisms.phase[cells],
    )
    expected = volumes(prisms.points, prisms.cells)[prisms.phase == 1].sum()
    assert 0.4 < expected < np.pi * 0.4**2  # of straight-sided triangles
    for grid in (grid_of(mixed), grid_of(prisms)):
        each = volumes(grid.fixed, grid.cells)
        assert each.sum() == pytest.approx(4.0, rel=1e-12)
        assert each[grid.phase == 1].sum() == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("version", "is_binary"), [(2.2, 0), (2.2, 1), (4.1, 0), (4.1, 1)])
def test_a_volume_without_a_name_of_other_elements_or_in_parts_is_refused(
    tmp_path, gmsh, version, is_binary
):
    def read():
        gmsh.write(str(tmp_path / "cell.msh"))
        return MeshModel(tmp_path / "cell.msh").cached_problem()

    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.option.setNumber("Mesh.Binary", is_binary)
    gmsh.option.setNumber("Mesh.SaveAll", 1)
    gmsh.model.geo.extrude([(2, square.surfaces(0.5, 0.0, CIRCLE)[0])], 0, 0, 1)
    gmsh.model.geo.synchronize()
    gmsh.model.mesh.generate(3)
    with pytest.raises(FailedError, match="volume 1 has no physical group"):
        read()
    gmsh.option.setNumber("Mesh.SaveAll", 0)
    gmsh.model.addPhysicalGroup(3, [1], name="clay")
    with pytest.raises(FailedError, match="'clay' holds Tetrahedron 4"):
        read()
    gmsh.model.mesh.partition(2)
    with pytest.raises(FailedError, match="partitioned into 2 parts; write the mesh before"):
        read()


def test_the_rule_of_prisms_prints_in_full_since_forms_are_told_apart_by_that():
    points, weights = prism_rule()
    assert "..." not in f"{points} {weights}"
    assert len(np.unique(points.round(7), axis=0)) == len(points)  # eight digits are printed


@pytest.mark.parametrize("version", [2.2, 4.1])
def test_a_volume_in_two_groups_is_refused_from_each_version_of_msh(tmp_path, gmsh, version):
    surfaces = [(2, square.surfaces(1.0, 0.0, CIRCLE)[0])]
    gmsh.model.geo.extrude(surfaces, 0, 0, 1, numElements=[1], recombine=True)
    gmsh.model.geo.synchronize()
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
    gmsh.model.mesh.generate(3)
    for name in ("clay", "all"):
        gmsh.model.addPhysicalGroup(3, [1], name=name)
    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.write(str(tmp_path / "cell.msh"))
    with pytest.raises(FailedError, match="group 'all' are in another one too; give each"):
        MeshModel(tmp_path / "cell.msh").cached_problem()
