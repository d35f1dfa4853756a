"""The solver of the product space: exact where it should be, honest where it stops, orderly."""

import numpy as np
import pytest
import scipy.sparse as sp

pytest.importorskip("alphacut.rve.fenicsx")

from petsc4py import PETSc

from alphacut.rve import Phase, PrismModel
from alphacut.rve.fenicsx import MPI, option_is_used
from alphacut.rve.solver.numbering import Elimination
from alphacut.stochastic import HermiteMap
from tests.refused import refuses

CRISP = HermiteMap(0.5, 0, 0.5, 0)
PHASES = Phase(20e9).stiffness, Phase(80e9).stiffness


def problem_of(size, layers, radius_map):
    one = PrismModel(size, layers).problem(radius_map)
    one.assemble(PHASES)
    return one


def options(**petsc):
    return PrismModel(petsc=petsc).options


@pytest.fixture(scope="module")
def problem():
    return problem_of(0.5, 3, CRISP)


def dense(matrix):
    starts, columns, values = matrix.getValuesCSR()
    return sp.csr_matrix((values, columns, starts), matrix.size).toarray()


def test_the_preconditioner_is_exact_where_nothing_changes_with_theta(problem, rng):
    inverse = problem.preconditioner(problem.matrix)
    solution, load = problem.matrix.createVecs()
    # bubbles have linear triangles only: exact on hats, and on linear triangles
    solution.array[:] = rng.standard_normal(len(solution.array))
    problem.matrix.mult(solution, load)
    answer = load.duplicate()
    inverse.apply(None, load, answer)
    assert answer.array == pytest.approx(solution.array, abs=1e-8)


def test_the_preconditioner_is_symmetric_and_definite_where_the_radius_changes():
    one = problem_of(0.7, 2, HermiteMap(0.2, 0.3, 0.8, 0.9))
    context = one.preconditioner(one.matrix)
    unit, column = one.matrix.createVecs()
    inverse = np.empty((len(unit.array), len(unit.array)))
    for k in range(len(inverse)):
        unit.array[:] = np.eye(len(inverse))[k]
        context.apply(None, unit, column)
        inverse[k] = column.array
    assert abs(inverse - inverse.T).max() < 1e-12 * abs(inverse).max()
    values = np.linalg.eigvals(inverse @ dense(one.matrix)).real
    assert 0.3 < values.min() < 1 < values.max() < 3


def test_options_leave_no_trace_in_the_database(problem):
    problem.solver(options(ksp_rtol="1e-6", level_pc_type="lu"), problem.matrix)
    assert not [name for name in PETSc.Options().getAll() if name.startswith("rve_")]


def test_options_of_the_caller_hold_and_stay(problem):
    database = PETSc.Options()
    database["rve_ksp_rtol"] = "1e-13"
    try:
        ksp = problem.solver(options(ksp_max_it="99"), problem.matrix)
        assert ksp.getTolerances()[0] == 1e-13
        assert ksp.getTolerances()[3] == 99
        assert database.getString("rve_ksp_rtol") == "1e-13"
        # as PETSC_OPTIONS puts them: named with the result, and not called unused at the end
        database["rve_pc_type"] = "jacobi"
        loose = options(ksp_rtol="1e-9")
        assert problem.solver(loose, problem.matrix).pc.getType() == "jacobi"
        assert str(loose) == "-rve_ksp_rtol 1e-9 -rve_pc_type jacobi"
        assert option_is_used("rve_ksp_rtol")
        assert option_is_used("rve_pc_type")
    finally:
        database.delValue("rve_ksp_rtol")
        database.delValue("rve_pc_type")


@pytest.mark.parametrize(
    ("name", "value", "key"),
    [("ksp_tpye", "gmres", "-rve_ksp_tpye"), ("ksp_rtol", None, "value of -rve_ksp_rtol")],
)
@pytest.mark.parametrize("by_environment", [True, False])
def test_options_that_petsc_does_not_use_or_that_lack_a_value_are_refused(
    name, value, key, by_environment, problem
):
    """Where PETSC_OPTIONS puts them as on the command line."""
    database = PETSc.Options()
    if by_environment:
        database[f"rve_{name}"] = value
    chosen = {} if by_environment else {name: value or ""}
    try:
        with refuses(key):
            problem.solver(options(**chosen), problem.matrix)
        assert database.hasName(f"rve_{name}") == by_environment
    finally:
        database.delValue(f"rve_{name}")


def test_an_option_may_be_a_flag_without_a_value(problem):
    ksp = problem.solver(options(ksp_error_if_not_converged=""), problem.matrix)
    assert ksp.getErrorIfNotConverged()


def test_a_matrix_refuses_a_place_outside_of_its_pattern():
    pairs = np.array([[0, 1], [2, 3]])  # two cells without a common unknown
    matrix = Elimination(np.arange(4), pairs, range(8), 8, MPI.COMM_SELF).matrix
    matrix.setValue(0, 3, 1.0)
    matrix.assemble()
    with pytest.raises(PETSc.Error):
        matrix.setValue(0, 7, 1.0)
