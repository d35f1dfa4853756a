"""Files of a cell read back by their own programs' conventions: phases, volumes, fields."""

import re
from dataclasses import replace
from functools import cache
from importlib import import_module
from importlib.util import find_spec

import numpy as np
import pytest

pytest.importorskip("alphacut.rve.fenicsx")

from alphacut.fuzzy import RefusedError
from alphacut.rve import Phase, PrismModel
from alphacut.stochastic import HermiteMap
from tests.rve.mesh.test_mesh import volumes

MAP, SOFT, HARD = HermiteMap(0.3, 0, 0.6, 0), Phase(20e9), Phase(80e9)
VOLUME = 24.0  # 2 × 2 × 6


@cache
def fields():
    return PrismModel(0.5, 3).fields(MAP, SOFT, [HARD])


@pytest.fixture
def written(tmp_path, request):
    path = tmp_path / f"cell{request.param}"
    fields().write(path)
    return path


def particle_volume():
    of = fields()
    return volumes(of.points, of.cells)[of.phase == of.names.index("inclusion")].sum()


@pytest.mark.parametrize("written", [".msh"], indirect=True)
def test_gmsh_reads_its_jacobians_groups_and_fields(written, gmsh):
    gmsh.open(str(written))
    points, weights = gmsh.model.mesh.getIntegrationPoints(18, "Gauss4")
    sums = {}
    for _, group in gmsh.model.getPhysicalGroups(3):
        (volume,) = gmsh.model.getEntitiesForPhysicalGroup(3, group)
        _, determinants, _ = gmsh.model.mesh.getJacobians(18, points, volume)
        assert (determinants > 0).all()
        sums[gmsh.model.getPhysicalName(3, group)] = (
            determinants.reshape(-1, len(weights)) @ weights
        ).sum()
    assert sum(sums.values()) == pytest.approx(VOLUME, rel=1e-10)
    assert sums["inclusion"] == pytest.approx(particle_volume(), rel=1e-6)
    names = {}
    for view in gmsh.view.getTags():
        index = gmsh.view.getIndex(view)
        names[gmsh.option.getString(f"View[{index}].Name")] = view
    kind, _, data, _, _ = gmsh.view.getModelData(names["stress_1_11_Pa"], 0)
    assert kind == "ElementNodeData"
    expected = fields().stress[:, 0, 0][fields().cells]
    assert np.array(data).reshape(-1, 15) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("ending", ["vtu", "xdmf"])
def test_vtk_and_meshio_read_positive_volumes(ending, tmp_path):
    meshio, pyvista = pytest.importorskip("meshio"), pytest.importorskip("pyvista")
    path = tmp_path / f"cell.{ending}"
    assert fields().write(path) > len(fields().points)
    mesh = meshio.read(path)
    grid = pyvista.UnstructuredGrid({24: mesh.cells_dict["tetra10"]}, mesh.points)
    if ending == "vtu":
        assert (pyvista.read(path).cells == grid.cells).all()
    elif find_spec("vtkmodules.vtkIOXdmf2"):  # wheels have it, Debian not
        reader = import_module("vtkmodules.vtkIOXdmf2").vtkXdmfReader()
        reader.SetFileName(path)
        reader.Update()
        read = pyvista.wrap(reader.GetOutputDataObject(0))
        assert (read.cells == grid.cells).all()
    sizes = grid.compute_cell_sizes(length=False, area=False)["Volume"]
    assert (sizes > 0).all()
    assert sizes.sum() == pytest.approx(VOLUME, rel=1e-12)
    inside = mesh.cell_data["phase"][0] == 1
    assert sizes[inside].sum() == pytest.approx(particle_volume(), rel=0.03)
    grid["x"] = grid.points[:, 0]
    points = grid.cell_centers().points
    found = pyvista.PolyData(points).sample(grid)
    assert found["vtkValidPointMask"].all()  # VTK finds no points in curved wedges
    assert found["x"] == pytest.approx(points[:, 0], abs=2e-3)
    surface = grid.extract_surface(nonlinear_subdivision=0).triangulate()
    assert surface.n_open_edges == 0  # neighbours have the same diagonals
    assert surface.volume == pytest.approx(VOLUME, rel=1e-6)
    stress = mesh.point_data["stress_2_12_Pa"][: len(fields().points)]
    assert stress == pytest.approx(fields().stress[:, 2, 1])
    assert "displacement_1_in_half_sides" in mesh.point_data


def test_centres_of_sides_take_the_value_of_the_prism():
    fine, count = fields().in_tetrahedra(), len(fields().points)
    square = fields().points[:, :2, None] ** 2  # which a prism with straight edges interpolates
    values = replace(fields(), displacement=square).in_tetrahedra().displacement[..., 0]
    centres = np.arange(len(fine.points)) >= count
    flat = np.isclose(abs(fine.points[:, :2]), 1).any(axis=1)  # on sides of the cell
    assert (fine.node[centres] == -1).all()
    assert (flat & centres).sum() > 20
    assert values[flat] == pytest.approx(fine.points[flat, :2] ** 2)


def test_other_endings_are_refused(tmp_path):
    with pytest.raises(RefusedError, match=re.escape(".msh, .vtu, .xdmf")):
        fields().write(tmp_path / "cell.stl")
