"""Fields of meshes and level sets of one's own, and of a solution of one's own law."""

import numpy as np
import pytest

pytest.importorskip("alphacut.rve.fenicsx")

import ufl
from dolfinx import fem

from alphacut.rve import LevelSetModel, MeshModel, Phase, PrismModel, ProductSpace
from alphacut.stochastic import HermiteMap, TruncatedNormal
from tests.refused import refuses
from tests.rve.prism.test_own_mesh import MESHES

LAW, SOFT, HARD = TruncatedNormal(-3, 3), Phase(20e9), Phase(80e9)
RADIUS = HermiteMap(0.3, 0, 0.6, 0)


def test_a_mesh_of_ones_own_has_the_fields_of_the_model_that_wrote_it():
    radius, phases = HermiteMap(0.1337, 0.1, 0.8663, 0.1692), {"inclusion": HARD, "matrix": SOFT}
    mesh = MeshModel(MESHES / "paper-coarse.msh").fields(LAW, phases)
    right = PrismModel(0.5, 4, stiffness=True).fields(radius, SOFT, [HARD])
    assert mesh.stress.shape == right.stress.shape
    for name in ("displacement", "stress"):
        ours, theirs = getattr(mesh, name), getattr(right, name)
        assert np.sort(ours, axis=0) == pytest.approx(
            np.sort(theirs, axis=0), rel=1e-5, abs=1e-5 * abs(theirs).max()
        )


def test_a_level_set_has_stress_by_its_sign_at_each_node(tmp_path):
    """A laminate under strain along its layers: each phase has its own stiffness times it."""
    model = LevelSetModel(lambda x, y, t: np.abs(y) - 0.5 + 0 * t, 0.25, 2)
    fields = model.fields(LAW, {"matrix": SOFT, "inclusion": HARD})
    inside = np.abs(fields.points[:, 1]) < 0.5 - 1e-9
    assert fields.names == ("matrix", "inclusion")
    along = 0  # the load ε11 = ε22 comes first
    ratio = fields.stress[inside, 0, along].mean() / fields.stress[~inside, 0, along].mean()
    assert ratio > 2
    assert fields.write(tmp_path / "cell.vtu") > 0


def test_a_solution_of_ones_own_law_has_the_fields_of_the_linear_model(tmp_path):
    model, load = PrismModel(0.5, 2, stiffness=True), np.array([0.01, -0.01, 0.0])
    cell = ProductSpace(model, RADIUS)
    u = fem.Function(cell.space)
    test, trial = ufl.TestFunction(cell.space), ufl.TrialFunction(cell.space)
    stiffness = {
        name: ufl.as_matrix(phase.stiffness.tolist())
        for name, phase in (("matrix", SOFT), ("inclusion", HARD))
    }
    uniform = ufl.as_vector(load.tolist())
    form = sum(
        cell.density * ufl.inner(C * cell.strain(trial), cell.strain(test)) * cell.dx[name]
        for name, C in stiffness.items()
    )
    forces = sum(
        -cell.density * ufl.inner(C * uniform, cell.strain(test)) * cell.dx[name]
        for name, C in stiffness.items()
    )
    solved = cell.solve(cell.assemble_matrix(form), [cell.assemble_vector(forces)])
    cell.assign(u, solved.vectors[0])
    stress = {name: C * (uniform + cell.strain(u)) for name, C in stiffness.items()}
    fields = cell.fields(u, stress, load)
    right = model.fields(RADIUS, SOFT, [HARD])
    column = 2  # of the load (0.01, -0.01, 0)
    scale = abs(right.stress[..., column]).max()
    assert fields.stress[..., 0] == pytest.approx(right.stress[..., column], abs=1e-6 * scale)
    assert fields.displacement[..., 0] == pytest.approx(right.displacement[..., column], abs=1e-9)
    with refuses("stress of phases"):
        cell.fields(u, {"matrix": stress["matrix"]}, load)
    with refuses("shape of the stress of matrix"):
        cell.fields(u, {**stress, "matrix": ufl.as_matrix([[1.0]])}, load)


@pytest.mark.parametrize("ending", ["vtu", "xdmf"])
def test_a_scalar_of_the_user_is_written_and_read_back(ending, tmp_path):
    """A polynomial of the place at each node, and a field that jumps between phases."""
    meshio = pytest.importorskip("meshio")
    cell = ProductSpace(MeshModel(MESHES / "two-particles.msh"), LAW)
    x1, x2, theta = ufl.SpatialCoordinate(cell.space.mesh)
    u = fem.Function(cell.space)
    u.interpolate(lambda x: np.array([x[0] ** 2, x[1]]))
    stress = dict.fromkeys(cell.dx, cell.strain(u))
    scalars = {"rising": x1 + 2 * x2 * theta, "dilatation": cell.strain(u)[0] + cell.strain(u)[1]}
    fields = cell.fields(u, stress, (0.0, 0.0, 0.0), scalars)
    path = tmp_path / f"cell.{ending}"
    written = fields.write(path)
    mesh = meshio.read(path)
    count = len(fields.points)
    assert len(mesh.points) == written > count
    a, b, c = mesh.points[:count].T
    assert mesh.point_data["rising"][:count] == pytest.approx(a + 2 * b * c, abs=1e-12)
    # its curved elements represent x1² only nearly
    assert mesh.point_data["dilatation"][:count] == pytest.approx(2 * a + 1, abs=0.05)
    assert cell.fields(u, stress, (0, 0, 0)).write(tmp_path / "cell.msh") > 0
    with refuses("shape of the scalar strain"):
        cell.fields(u, stress, (0, 0, 0), {"strain": cell.strain(u)})
    with refuses("shape of the scalar number"):
        cell.fields(u, stress, (0, 0, 0), {"number": 1.0})
