"""Gmsh's prisms: all of them arrive, numbered level by level, with their names."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("alphacut.rve.fenicsx")

from alphacut.rve import Ellipse
from alphacut.rve.cell.outline import circle
from alphacut.rve.mesh import square
from alphacut.rve.mesh.columns import extrude, grid_of
from alphacut.rve.mesh.file import read_prisms
from alphacut.rve.mesh.msh import parse_msh
from alphacut.rve.mesh.periodicity import MeshError
from alphacut.rve.mesh.prism_grid import Prisms
from alphacut.rve.mesh.wedge import prism_rule, wedge
from alphacut.stochastic import HermiteMap


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


@pytest.mark.parametrize("outline", [circle, Ellipse(2.0, 30.0)])
def test_a_prism_that_gmsh_does_not_return_is_missed_by_its_volume(outline):
    prisms = prisms_of(outline)
    each = volumes(prisms.points, prisms.cells)
    assert (each > 0).all()
    assert each.sum() == pytest.approx(4.0, rel=1e-12)  # 2 × 2 × 1
    kept = np.arange(len(each)) != 17
    rest = replace(prisms, cells=prisms.cells[kept], phase=prisms.phase[kept])
    lost = 4.0 - volumes(rest.points, rest.cells).sum()
    assert lost == pytest.approx(each[17], rel=1e-10)
    with pytest.raises(MeshError, match=r"layers of prisms differ|do not pass all levels"):
        grid_of(rest)


def test_the_order_of_prisms_does_not_matter(rng):
    prisms = prisms_of(circle)
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
    tmp_path, version, is_binary
):
    def read():
        gmsh.write(str(tmp_path / "cell.msh"))
        return read_prisms(parse_msh((tmp_path / "cell.msh").read_bytes()))

    with square.open_gmsh() as gmsh:
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", is_binary)
        gmsh.option.setNumber("Mesh.SaveAll", 1)
        gmsh.model.geo.extrude([(2, square.surfaces(0.5, 0.0, circle)[0])], 0, 0, 1)
        gmsh.model.geo.synchronize()
        gmsh.model.mesh.generate(3)
        with pytest.raises(MeshError, match="volume 1 has no physical group"):
            read()
        gmsh.option.setNumber("Mesh.SaveAll", 0)
        gmsh.model.addPhysicalGroup(3, [1], name="clay")
        with pytest.raises(MeshError, match="'clay' holds Tetrahedron 4"):
            read()
        gmsh.model.mesh.partition(2)
        with pytest.raises(MeshError, match="partitioned into 2 parts; write the mesh before"):
            read()


def test_a_mesh_of_plane_triangles_is_told_to_make_prisms(tmp_path):
    with square.open_gmsh() as gmsh:
        surface = square.surfaces(0.5, 0.0, circle)[0]
        gmsh.model.addPhysicalGroup(2, [surface], name="matrix")
        gmsh.model.mesh.generate(2)
        gmsh.write(str(tmp_path / "cell.msh"))
    with pytest.raises(MeshError, match=r"the mesh is plane: .*; make prisms of the triangles"):
        read_prisms(parse_msh((tmp_path / "cell.msh").read_bytes()))


def test_the_rule_of_prisms_prints_in_full_since_forms_are_told_apart_by_that():
    points, weights = prism_rule()
    assert "..." not in f"{points} {weights}"
    assert len(np.unique(points.round(7), axis=0)) == len(points)  # eight digits are printed


@pytest.mark.parametrize("version", [2.2, 4.1])
def test_a_volume_in_two_groups_is_refused_from_each_version_of_msh(tmp_path, version):
    with square.open_gmsh() as gmsh:
        surfaces = [(2, square.surfaces(1.0, 0.0, circle)[0])]
        gmsh.model.geo.extrude(surfaces, 0, 0, 1, numElements=[1], recombine=True)
        gmsh.model.geo.synchronize()
        gmsh.option.setNumber("Mesh.ElementOrder", 2)
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
        gmsh.model.mesh.generate(3)
        for name in ("clay", "all"):
            gmsh.model.addPhysicalGroup(3, [1], name=name)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.write(str(tmp_path / "cell.msh"))
    with pytest.raises(MeshError, match="group 'all' are in another one too; give each"):
        read_prisms(parse_msh((tmp_path / "cell.msh").read_bytes()))
