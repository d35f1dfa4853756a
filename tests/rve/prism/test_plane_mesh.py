"""Plane triangles, from a file of Gmsh or of DOLFINx, are solved as the prisms above them are."""

import importlib

import numpy as np
import pytest

pytest.importorskip("alphacut.rve.fenicsx")

from alphacut.fuzzy import FailedError
from alphacut.rve import MeshModel, Phase, ProductSpace, VoigtPhase
from alphacut.rve.fenicsx import MPI, dolfinx
from alphacut.rve.mesh.file import write
from alphacut.rve.mesh.square import open_gmsh
from alphacut.stochastic import TruncatedNormal
from tests.refused import refuses

LAW = TruncatedNormal(-3, 2)
PHASES = {
    "matrix": Phase(20e9),
    "hard": Phase(80e9),
    "turned": VoigtPhase(1e9 * np.array([[90, 20, 5], [20, 40, 0], [5, 0, 25.0]])),
}
EXACT = {"ksp_rtol": "1e-12"}


@pytest.fixture
def gmsh():
    with open_gmsh() as opened:
        opened.option.setNumber("General.Verbosity", 1)
        yield opened


def draw(gmsh, order, size=0.4):
    """Mesh a square with three particles of two phases; groups have the numbers 3, 7 and 5."""
    occ = gmsh.model.occ
    plate = occ.addRectangle(-1, -1, 0, 2, 2)
    discs = [
        occ.addDisk(x, y, 0, radius, radius)
        for x, y, radius in ((-0.5, -0.5, 0.3), (0.5, -0.4, 0.35), (0.1, 0.5, 0.3))
    ]
    occ.fragment([(2, plate)], [(2, disc) for disc in discs])
    occ.synchronize()
    surfaces = [tag for _, tag in gmsh.model.getEntities(2)]
    [matrix] = set(surfaces) - set(discs)
    for group, tags, name in (
        (3, [matrix], "matrix"),
        (7, discs[:2], "hard"),
        (5, discs[2:], "turned"),
    ):
        gmsh.model.addPhysicalGroup(2, tags, group, name=name)
    sides = [gmsh.model.getEntitiesInBoundingBox(*box, 1) for box in boxes()]
    for axis, (first, second) in enumerate((sides[:2], sides[2:])):
        shift = np.eye(4)
        shift[axis, 3] = 2
        gmsh.model.mesh.setPeriodic(1, [second[0][1]], [first[0][1]], shift.ravel().tolist())
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.ElementOrder", order)
    gmsh.model.mesh.generate(2)


def boxes(near=1e-3):
    """Yield boxes around the left, right, lower and upper side of the square."""
    for axis in (0, 1):
        for end in (-1, 1):
            low, high = np.array([-1.0, -1, 0]), np.array([1.0, 1, 0])
            low[axis] = high[axis] = end
            yield *(low - near), *(high + near)


def of_dolfinx(gmsh, **options):
    """Return the model of Gmsh's mesh, as DOLFINx reads it."""
    name = "gmsh" if importlib.util.find_spec("dolfinx.io.gmsh") else "gmshio"
    reader = importlib.import_module(f"dolfinx.io.{name}")
    mesh, cell_tags = reader.model_to_mesh(gmsh.model, MPI.COMM_SELF, 0, gdim=2)[:2]
    names = {3: "matrix", 7: "hard", 5: "turned"}
    return MeshModel.from_dolfinx(mesh, cell_tags, names, **options)


@pytest.mark.parametrize(("order", "binary", "version"), [(1, 0, 4.1), (2, 1, 2.2)])
def test_triangles_are_solved_as_the_prisms_above_them(order, binary, version, tmp_path):
    with open_gmsh() as gmsh:
        draw(gmsh, order)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.write(str(tmp_path / "plane.msh"))
        tagged = of_dolfinx(gmsh, petsc=EXACT)
    plane = MeshModel(tmp_path / "plane.msh", petsc=EXACT)
    grid = plane.moved_problem(LAW).grid
    assert set(grid.names) == set(PHASES)
    write(tmp_path / "prisms.msh", grid.fixed, grid.cells, grid.phase, grid.names)
    prisms = MeshModel(tmp_path / "prisms.msh", petsc=EXACT)
    [right] = prisms.solve(LAW, PHASES)
    bounds = prisms.bounds(LAW, PHASES)
    assert np.allclose(right.stiffness, right.stiffness.T)
    for model in (plane, tagged):
        [found] = model.solve(LAW, PHASES)
        assert found.modulus == pytest.approx(right.modulus, rel=1e-12)
        assert found.stiffness == pytest.approx(right.stiffness, rel=1e-11)
        own = model.bounds(LAW, PHASES)
        largest = abs(bounds.upper).max()
        assert own.lower == pytest.approx(bounds.lower, abs=1e-10 * largest)
        assert own.upper == pytest.approx(bounds.upper, abs=1e-10 * largest)


def area_of(model, names):
    """Return the mean fraction of phases over a law of its own, by the forms of the user."""
    space = ProductSpace(model, TruncatedNormal(-1, 4))
    return sum(space.mean(space.density * space.dx[name]) for name in names)


def test_triangles_of_three_nodes_keep_straight_sides_and_six_are_curved(gmsh):
    """A regular polygon within a disc is smaller by a fifth; that of six-node arcs is not."""
    draw(gmsh, 1)
    discs = np.pi * (2 * 0.3**2 + 0.35**2) / 4
    assert 0.8 < area_of(of_dolfinx(gmsh), ("hard", "turned")) / discs < 0.97
    gmsh.model.mesh.setOrder(2)
    assert area_of(of_dolfinx(gmsh), ("hard", "turned")) == pytest.approx(discs, rel=2e-3)


def test_a_refined_plane_mesh_declares_an_error(gmsh):
    draw(gmsh, 1)
    [result] = of_dolfinx(gmsh, refine=True).solve(LAW, PHASES)
    assert 0 < result.estimated_error < 0.05


def test_what_is_no_plane_cell_is_refused(gmsh, tmp_path):
    """Each with its cause: other elements, a surface in space, no group."""
    path = tmp_path / "plane.msh"

    def reason(match):
        gmsh.write(str(path))
        with pytest.raises(FailedError, match=match):
            MeshModel(path).cached_problem()

    draw(gmsh, 3)
    reason("holds Triangle 10; mesh with triangles of order 1 or 2")
    gmsh.model.mesh.setOrder(1)
    gmsh.model.mesh.affineTransform([1, 0, 0, 0, 0, 1, 0, 0, 0.5, 0, 1, 0])
    reason("the plane mesh spans 1 along x3; mesh the cell in the plane")
    gmsh.model.removePhysicalGroups([(2, 7)])
    gmsh.option.setNumber("Mesh.SaveAll", 1)
    reason(r"surface \d has no physical group that names its phase; .*addPhysicalGroup\(2, s")


def test_meshes_of_dolfinx_that_do_not_fit_are_refused():
    square = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 2, 2)
    cells = np.arange(8, dtype=np.int32)
    tags = dolfinx.mesh.meshtags(square, 2, cells, cells // 4)
    cube = dolfinx.mesh.create_unit_cube(MPI.COMM_SELF, 1, 1, 1)
    with refuses("cells of the mesh"):
        MeshModel.from_dolfinx(cube, tags)
    with refuses("mesh"):
        MeshModel.from_dolfinx("plane.msh", tags)
    with refuses("cell_tags"):
        MeshModel.from_dolfinx(square, cells)
    with refuses("tagged cells"):
        MeshModel.from_dolfinx(square, dolfinx.mesh.meshtags(square, 2, cells[1:], cells[1:]))
    with refuses("tagged cells"):
        MeshModel.from_dolfinx(square, dolfinx.mesh.meshtags(square, 1, cells, cells))
    with refuses("tag of a name"):
        MeshModel.from_dolfinx(square, tags, {2: "matrix"})
    assert MeshModel.from_dolfinx(square, tags, {1: "hard"}).file.names == ("group 0", "hard")
