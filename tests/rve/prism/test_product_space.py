"""Doors for laws of the user: what they assemble, what they refuse, and that they stay as they are."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("alphacut.rve.fenicsx")

import ufl
from dolfinx import fem
from petsc4py import PETSc

from alphacut.rve import LOADS, LevelSetModel, MeshModel, Phase, PrismModel, ProductSpace
from alphacut.stochastic import HermiteMap, TruncatedNormal
from tests.refused import refuses

MESHES = Path(__file__).parents[3] / "meshes"

CONE = HermiteMap(0.2, 0.1, 0.7, 0.2)
MODEL = PrismModel(0.7, 4, estimate=False)
PHASES = Phase(20e9), Phase(80e9)


@pytest.fixture(scope="module")
def cell():
    return ProductSpace(MODEL, CONE)


@pytest.fixture(scope="module")
def elastic(cell):
    u, v = ufl.TrialFunction(cell.space), ufl.TestFunction(cell.space)
    constants = [fem.Constant(cell.space.mesh, phase.stiffness) for phase in PHASES]
    return sum(
        cell.density * ufl.dot(c * cell.strain(u), cell.strain(v)) * dx
        for dx, c in zip((cell.dx["matrix"], cell.dx["inclusion"]), constants, strict=True)
    )


def test_a_form_of_the_user_gives_the_matrix_and_the_solutions_of_the_model(cell, elastic):
    problem = MODEL.problem(CONE)
    by_name = dict(zip(("matrix", "inclusion"), PHASES, strict=True))
    expected = problem.assemble([by_name[name].stiffness for name in problem.grid.names])
    matrix = cell.assemble_matrix(elastic)
    gap = matrix.copy()
    gap.axpy(-1, expected)
    assert gap.norm() < 1e-12 * expected.norm()
    loads = problem.loads(LOADS)
    ksp = problem.solver(MODEL.options, expected)
    for load, found in zip(loads, cell.solve(matrix, loads).vectors, strict=True):
        right = load.duplicate()
        ksp.solve(load, right)
        assert found.array == pytest.approx(right.array, rel=1e-7, abs=1e-9)


def test_functions_take_reduced_unknowns_and_means_are_over_area_and_law(cell, elastic, rng):
    load, solution = cell.assemble_matrix(elastic).createVecs()
    solution.array[:] = rng.standard_normal(len(solution.array))
    u = fem.Function(cell.space)
    cell.assign(u, solution)
    energy = ufl.replace(elastic, dict(zip(elastic.arguments(), (u, u), strict=True)))
    cell.assemble_matrix(elastic).mult(solution, load)
    assert cell.mean(energy) == pytest.approx(load.dot(solution) / 4, rel=1e-4)
    theta = ufl.SpatialCoordinate(cell.space.mesh)[2]
    exact = CONE.distribution.pdf
    points, weights = np.polynomial.legendre.leggauss(80)
    variance = 3 * weights @ ((3 * points) ** 2 * exact(3 * points))
    assert sum(cell.mean(theta**2 * cell.density * dx) for dx in cell.dx.values()) == pytest.approx(
        variance, rel=1e-3
    )
    fraction = cell.mean(cell.density * cell.dx["inclusion"])
    radius = 3 * weights @ (np.pi * CONE(3 * points) ** 2 / 4 * exact(3 * points))
    assert fraction == pytest.approx(radius, rel=1e-3)


@pytest.mark.parametrize(
    ("method", "allowed"),
    [("mean", "scalar"), ("assemble_vector", "linear"), ("assemble_matrix", "bilinear")],
)
def test_a_form_that_would_be_written_beyond_arrays_is_refused(cell, elastic, method, allowed):
    v, dx = ufl.TestFunction(cell.space), cell.dx["matrix"]
    forms = {"scalar": cell.density * dx, "linear": cell.density * v[0] * dx}
    forms["bilinear"] = elastic
    for arity, form in forms.items():
        for _ in range(2):  # also where another method has compiled it
            if arity != allowed:
                with refuses("form"):
                    getattr(cell, method)(form)
            else:
                getattr(cell, method)(form)
    with refuses("form"):
        getattr(cell, method)(1.0)


def test_a_form_on_another_space_or_mesh_is_refused(cell):
    other = ProductSpace(MODEL, CONE)
    w = ufl.TestFunction(fem.functionspace(cell.space.mesh, ("DG", 0)))
    with refuses("form"):
        cell.assemble_vector(cell.density * w * cell.dx["matrix"])
    with refuses("form"):
        cell.assemble_vector(other.density * ufl.TestFunction(other.space)[0] * other.dx["matrix"])
    with refuses("form"):
        cell.mean(other.density * other.dx["matrix"])


def test_a_model_whose_mesh_does_not_follow_particles_is_refused():
    level_set = LevelSetModel(lambda x, y, t: np.hypot(x, y) - 0.5, 0.7, 2)
    with refuses("model"):
        ProductSpace(level_set, TruncatedNormal())


def test_an_operator_without_symmetry_is_refused_and_not_solved_wrongly(cell, elastic):
    matrix = cell.assemble_matrix(elastic)
    columns, values = matrix.getRow(0)
    matrix.setValue(0, columns[1], values[1] + 1e-3 * values[0])
    matrix.assemble()
    with refuses("asymmetry of the matrix"):
        cell.solve(matrix, [matrix.createVecLeft()])


def test_options_in_a_text_are_refused_with_the_table_that_they_mean(cell, elastic):
    matrix = cell.assemble_matrix(elastic)
    with refuses("petsc"):
        cell.solve(matrix, [matrix.createVecLeft()], "-ksp_type gmres")


def test_the_preconditioner_serves_a_solver_of_the_user(cell, elastic, rng):
    matrix = cell.assemble_matrix(elastic)
    load, solution = matrix.createVecs()
    load.array[:] = rng.standard_normal(len(load.array))
    ksp = PETSc.KSP().create(matrix.comm)
    ksp.setOperators(matrix)
    ksp.setType("minres")
    ksp.setTolerances(rtol=1e-10)
    ksp.pc.setType("python")
    ksp.pc.setPythonContext(cell.preconditioner(matrix))
    ksp.solve(load, solution)
    assert ksp.getConvergedReason() > 0
    assert ksp.getIterationNumber() < 30


def test_a_later_map_of_the_model_does_not_move_the_mesh(cell):
    before = cell.space.mesh.geometry.x.copy()
    steeper = HermiteMap(0.2, 0.3, 0.7, 0.4)
    assert MODEL.problem(steeper) is MODEL.problem(CONE)  # the model keeps one for both
    MODEL.solve(steeper, PHASES[0], [PHASES[1]])
    ProductSpace(MODEL, steeper)
    assert (cell.space.mesh.geometry.x == before).all()


def test_a_mesh_from_a_file_has_its_measures_by_the_names_of_its_groups():
    model = MeshModel(MESHES / "two-particles.msh")
    cell = ProductSpace(model, TruncatedNormal())
    share = 1 - cell.mean(cell.density * cell.dx["matrix"])
    assert share == pytest.approx(np.pi * (0.35**2 + 0.40**2) / 4, rel=1e-3)
    with refuses("law of θ"):
        ProductSpace(model, TruncatedNormal(-2, 2))
