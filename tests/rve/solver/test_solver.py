"""The solver of the product space: exact where it should be, honest where it stops, orderly."""

import numpy as np
import pytest
import scipy.sparse as sp

pytest.importorskip("alphacut.rve.fenicsx")

from alphacut.rve import Phase
from alphacut.rve.fenicsx import MPI, PETSc, option_is_used
from alphacut.rve.mesh.columns import extrude
from alphacut.rve.prism.problem import PrismProblem
from alphacut.rve.solver.krylov import SolverOptions
from alphacut.stochastic import HermiteMap

CRISP = HermiteMap(0.5, 0, 0.5, 0)
PHASES = Phase(20e9).stiffness, Phase(80e9).stiffness


@pytest.fixture(scope="module")
def problem():
    one = PrismProblem(extrude(size=0.5, radius=0.5, layers=3), MPI.COMM_SELF)
    one.move(CRISP)
    one.assemble(PHASES)
    return one


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
    one = PrismProblem(extrude(size=0.7, radius=0.5, layers=2), MPI.COMM_SELF)
    cone = HermiteMap(0.2, 0.3, 0.8, 0.9)
    one.move(cone)
    one.assemble(PHASES)
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
    problem.solver(SolverOptions({"ksp_rtol": "1e-6", "level_pc_type": "lu"}), problem.matrix)
    assert not [name for name in PETSc.Options().getAll() if name.startswith("rve_")]


def test_options_of_the_caller_hold_and_stay(problem):
    database = PETSc.Options()
    database["rve_ksp_rtol"] = "1e-13"
    try:
        ksp = problem.solver(SolverOptions({"ksp_max_it": "99"}), problem.matrix)
        assert ksp.getTolerances()[0] == 1e-13
        assert ksp.getTolerances()[3] == 99
        assert database.getString("rve_ksp_rtol") == "1e-13"
        # as PETSC_OPTIONS puts them: named with the result, and not called unused at the end
        database["rve_pc_type"] = "jacobi"
        options = SolverOptions({"ksp_rtol": "1e-9"})
        assert problem.solver(options, problem.matrix).pc.getType() == "jacobi"
        assert str(options) == "-rve_ksp_rtol 1e-9 -rve_pc_type jacobi"
        assert option_is_used("rve_ksp_rtol")
        assert option_is_used("rve_pc_type")
    finally:
        database.delValue("rve_ksp_rtol")
        database.delValue("rve_pc_type")
