"""Files of a cell read back by their own programs' conventions: phases, volumes, fields."""

import re
from functools import cache

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from alphacut.export.cell_files import FORMATS, write_cell
from alphacut.fuzzy.refused import RefusedError
from alphacut.rve import MeshModel, Phase, PrismModel
from alphacut.rve.mesh import square
from alphacut.rve.mesh.file import read_grid
from alphacut.rve.mesh.gmsh_prisms import MESHIO_ORDER, VTK_OF_MESHIO
from alphacut.rve.prism.fields import cell_fields
from alphacut.stochastic import HermiteMap
from tests.rve.mesh.test_prisms import volumes

MAP, SOFT, HARD = HermiteMap(0.3, 0, 0.6, 0), Phase(20e9), Phase(80e9)
VOLUME = 24.0  # 2 × 2 × 6


@cache
def fields():
    return cell_fields(PrismModel(0.5, 3), MAP, SOFT, HARD)


@pytest.fixture
def written(tmp_path, request):
    path = tmp_path / f"cell{request.param}"
    write_cell(fields(), path)
    return path


def particle_volume():
    of = fields()
    return volumes(of.points, of.cells)[of.phase == of.names.index("inclusion")].sum()


@pytest.mark.parametrize("written", [".msh"], indirect=True)
def test_gmsh_reads_its_jacobians_groups_and_fields(written):
    with square.model() as gmsh:
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


@pytest.mark.parametrize("written", [".vtu"], indirect=True)
def test_vtk_reads_wedges_of_positive_volume(written):
    pyvista = pytest.importorskip("pyvista")
    grid = pyvista.read(written)
    sizes = grid.compute_cell_sizes(length=False, area=False)["Volume"]
    assert (sizes > 0).all()
    assert sizes.sum() == pytest.approx(VOLUME, rel=1e-3)  # VTK takes wedges as straight pieces
    assert sizes[grid.cell_data["phase"] == 1].sum() == pytest.approx(particle_volume(), rel=0.04)
    assert "displacement_1_in_half_sides" in grid.point_data


@pytest.mark.parametrize("written", [".xdmf", ".inp"], indirect=True)
def test_meshio_reads_xdmf_mirrored_and_abaqus_not(written):
    import meshio
    from meshio._mesh import topological_dimension

    topological_dimension.setdefault("wedge15", 3)
    mesh = meshio.read(written)
    (block,) = mesh.cells
    assert block.type == "wedge15"
    order = (
        np.array(MESHIO_ORDER)[VTK_OF_MESHIO]
        if written.suffix == ".xdmf"
        else np.array(MESHIO_ORDER)
    )
    each = volumes(mesh.points, block.data[:, np.argsort(order)])
    assert (each > 0).all()
    assert each.sum() == pytest.approx(VOLUME, rel=1e-10)
    if written.suffix == ".xdmf":
        inside = mesh.cell_data["phase"][0] == 1
        assert "stress_2_12_Pa" in mesh.point_data
    else:
        (inside,) = mesh.cell_sets["inclusion"]
    assert each[inside].sum() == pytest.approx(particle_volume(), rel=1e-10)


def test_abaqus_is_the_first_format_that_a_process_writes(tmp_path, monkeypatch):
    from meshio import _mesh

    known = {kind: x for kind, x in _mesh.topological_dimension.items() if kind != "wedge15"}
    monkeypatch.setattr(_mesh, "topological_dimension", known)
    assert write_cell(fields(), tmp_path / "cell.inp")


@pytest.mark.parametrize("written", [".msh"], indirect=True)
def test_what_gmsh_was_given_is_a_mesh_of_ones_own(written):
    grid = read_grid(written)
    assert grid.names == fields().names
    right = PrismModel(0.5, 3, stiffness=True, estimate=False).solve(MAP, SOFT, [HARD])[0]
    phases = {"matrix": SOFT, "inclusion": HARD}
    own = MeshModel(written).solve(MAP.distribution, phases)[0]
    assert own.modulus == pytest.approx(right.modulus, rel=1e-12)


def test_other_endings_are_refused(tmp_path):
    with pytest.raises(RefusedError, match=re.escape(", ".join(FORMATS))):
        write_cell(fields(), tmp_path / "cell.stl")
