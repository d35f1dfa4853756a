"""Periodic cells with many discs, homogenised directly (section 4.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from alphacut.rve.cell import Phase
from alphacut.stochastic.particles.discs import Discs

if TYPE_CHECKING:
    from alphacut.stochastic.theta.truncated_normal import Array


def many_particles(
    discs: Discs, matrix: Phase, inclusion: Phase, *, size: float = 0.35, around: int = 12
) -> Array:
    """Plane-strain stiffness (11, 22, 12 with 2 ε12) of a cell of discs, shape (3, 3), in Pa.

    Quadratic triangles with curved edges that conform to the circles; periodicity by elimination;
    three loads.

    Args:
        discs: Non-overlapping discs in a periodic square, with gaps.
        matrix: Material between them.
        inclusion: Material of the discs.
        size: Wanted edge length in the matrix, over the mean spacing of the discs.
        around: Edges around each circle, at least.

    Raises:
        ValueError: The discs touch, or the box is not a periodic square.
        RuntimeError: The mesh is not periodic, or the linear solver failed.
    """
    from benchmarks.stochastic.representative.mesh import many_mesh

    mesh, inside = many_mesh(discs, size=size, around=around)
    stiffness, nodes = _stiffness(mesh, inside, matrix, inclusion)
    affine = _affine(nodes)
    injection = _injection(nodes)
    reduced = (injection.T @ stiffness @ injection).tocsr()
    fluctuation = _solve(reduced, -(injection.T @ (stiffness @ affine)))
    motion = affine + injection @ fluctuation
    effective = motion.T @ (stiffness @ motion)  # Hill–Mandel: the box has unit area
    return np.asarray((effective + effective.T) / 2)


def _stiffness(
    mesh: Any, inside: Array, matrix: Phase, inclusion: Phase
) -> tuple[sp.csr_matrix, Array]:
    """Stiffness matrix before periodicity, and the positions of its nodes, shape (n, 2)."""
    import ufl
    from dolfinx import fem

    lame = fem.functionspace(mesh, ("DG", 0, (2,)))
    constants = fem.Function(lame)
    table = np.array(
        [[phase.stiffness[0, 1], phase.stiffness[2, 2]] for phase in (matrix, inclusion)]
    )
    constants.x.array[:] = table[inside.astype(int)].ravel()
    space = fem.functionspace(mesh, ("Lagrange", 2, (2,)))
    trial, test = ufl.TrialFunction(space), ufl.TestFunction(space)
    density = constants[0] * ufl.div(trial) * ufl.div(test)
    # eq. 7
    density += 2 * constants[1] * ufl.inner(ufl.sym(ufl.grad(trial)), ufl.sym(ufl.grad(test)))
    form = fem.form(density * ufl.dx(metadata={"quadrature_degree": 4}))
    return fem.assemble_matrix(form).to_scipy().tocsr(), np.asarray(
        space.tabulate_dof_coordinates()[:, :2]
    )


def _affine(nodes: Array) -> Array:
    """Displacements of unit strains ε11, ε22, 2 ε12, shape (2 n, 3)."""
    x, y = nodes.T
    motion = np.zeros((len(nodes), 2, 3))
    motion[:, 0, 0], motion[:, 1, 1] = x, y
    motion[:, 0, 2], motion[:, 1, 2] = y / 2, x / 2
    return motion.reshape(-1, 3)


def _injection(nodes: Array) -> sp.csr_matrix:
    """Periodic injection with the corner fixed, shape (2 n, unknowns)."""
    keys = np.round(nodes * 1e7).astype(np.int64)
    on_side = (keys == 0) | (keys == 10**7)
    _, first, label = np.unique(
        np.where(keys == 10**7, 0, keys), axis=0, return_index=True, return_inverse=True
    )
    label = label.ravel()
    if (np.bincount(label)[label] != 2 ** on_side.sum(axis=1)).any():
        raise RuntimeError(
            "the mesh is not periodic: a node on one side of the cell has no partner on the"
            " opposite side"
        )
    free = np.flatnonzero(~(keys[first] % 10**7 == 0).all(axis=1))
    number = np.full(len(first), -1)
    number[free] = np.arange(len(free))
    rows = np.flatnonzero(number[label] >= 0)
    one = sp.csr_matrix(
        (np.ones(len(rows)), (rows, number[label[rows]])), shape=(len(nodes), len(free))
    )
    return sp.kron(one, sp.identity(2), format="csr")


def _solve(matrix: sp.csr_matrix, loads: Array) -> Array:
    """Solve for all loads by one Cholesky factorisation."""
    from alphacut.rve.petsc import PETSc

    operator = PETSc.Mat().createAIJ(
        matrix.shape, csr=(matrix.indptr, matrix.indices, matrix.data), comm=PETSc.COMM_SELF
    )
    operator.setOption(PETSc.Mat.Option.SPD, True)
    solver = PETSc.KSP().create(PETSc.COMM_SELF)
    solver.setOperators(operator)
    solver.setType("preonly")
    solver.getPC().setType("cholesky")
    solver.getPC().setFactorSolverType("mumps")
    solver.setErrorIfNotConverged(True)
    solution, right = operator.createVecs()
    columns = []
    for load in loads.T:
        right.setArray(load)
        solver.solve(right, solution)
        columns.append(solution.getArray().copy())
    for thing in (solver, operator, solution, right):
        thing.destroy()
    return np.stack(columns, axis=1)
