"""Cubic stiffness of the cell of a sphere by finite elements on one eighth of it.

Reflections turn the periodic cell into Dirichlet problems on [0, 1]³: under axial strains the
normal displacement of each face is given, under ε12 what the reflection leaves. The energy of the
solution is the modulus, from above, up to the geometry: curved tetrahedra of second order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import alphacut.rve.petsc  # noqa: F401

# isort: split
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc
from mpi4py import MPI
from petsc4py import PETSc

from alphacut.rve.cell import Phase
from alphacut.rve.spheres.bounds import bulk_and_shear
from alphacut.rve.spheres.fem.octant import MATRIX, SPHERE, octant
from alphacut.stochastic.theta.truncated_normal import Array

COARSER = 1.5  # edge length of the second mesh over the first
_SAFETY = 1.5
# faces (axis, side) → displacement components given there, and their value at unit strain
AXIAL = {(axis, side): {axis: float(side)} for axis in range(3) for side in (0, 1)}
SHEAR = {
    **{(0, side): {1: side / 2, 2: 0.0} for side in (0, 1)},
    **{(1, side): {0: side / 2, 2: 0.0} for side in (0, 1)},
    **{(2, side): {2: 0.0} for side in (0, 1)},
}


@dataclass(frozen=True)
class OctantSolution:
    """Moduli of one mesh.

    Args:
        moduli: K, (C11 − C12)/2 and C44 in Pa, shape (3,).
        unknowns: Displacements of the mesh.
        iterations: Of conjugate gradients, one number a load.
    """

    moduli: Array
    unknowns: int
    iterations: tuple[int, ...]


def octant_stiffness(
    radius: float,
    matrix: Phase,
    inclusion: Phase,
    *,
    size: float = 0.2,
    comm: MPI.Comm = MPI.COMM_SELF,
    rtol: float = 1e-10,
) -> OctantSolution:
    """The three moduli of one cell on one mesh.

    Args:
        radius: Radius over half the cell's side, in (0, 0.97].
        matrix: Material outside the sphere.
        inclusion: Material of the sphere.
        size: Edge length in halves of the cell's side.
        comm: Ranks that share the mesh.
        rtol: Relative residual at which the iteration ends.

    Raises:
        RuntimeError: The iteration does not converge.
    """
    mesh, tags = octant(radius, size=size, comm=comm)[:2]
    space = fem.functionspace(mesh, ("Lagrange", 2, (3,)))
    trial, test = ufl.TrialFunction(space), ufl.TestFunction(space)
    dx = ufl.Measure("dx", mesh, subdomain_data=tags, metadata={"quadrature_degree": 4})

    def energy(u: ufl.core.expr.Expr, v: ufl.core.expr.Expr) -> ufl.Form:
        total = 0
        for tag, phase in ((MATRIX, matrix), (SPHERE, inclusion)):
            bulk, shear = bulk_and_shear(phase)
            strain, other = ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))
            stress = 2 * shear * strain + (bulk - 2 / 3 * shear) * ufl.tr(strain) * ufl.Identity(3)
            total += ufl.inner(stress, other) * dx(tag)
        return total

    form = fem.form(energy(trial, test))
    found, iterations = [], []
    loads = ((AXIAL, (1, 1, 1), 9.0), (AXIAL, (-1, -1, 2), 12.0), (SHEAR, (1, 1, 1), 1.0))
    for faces, strain, unit in loads:
        given = [
            _given(space, axis, side, component, value * strain[component])
            for (axis, side), values in faces.items()
            for component, value in values.items()
        ]
        solution, steps = _solved(form, space, given, rtol)
        value = fem.assemble_scalar(fem.form(energy(solution, solution)))
        found.append(comm.allreduce(value) / unit)
        iterations.append(steps)
    unknowns = space.dofmap.index_map.size_global * 3
    return OctantSolution(np.array(found), unknowns, tuple(iterations))


def cubic_stiffness_by_elements(
    radius: float, matrix: Phase, inclusion: Phase, *, size: float = 0.2
) -> tuple[Array, Array]:
    """The moduli on the finer of two meshes, and their declared relative errors, shape (3,) each.

    The meshes' edge lengths differ by a factor of 1.5; the largest distance of any modulus, times
    1.5, is the error of each, for one alone may be near by chance.
    """
    fine, coarse = (
        octant_stiffness(radius, matrix, inclusion, size=h).moduli for h in (size, COARSER * size)
    )
    return fine, np.full(3, _SAFETY * np.abs(coarse / fine - 1).max())


def _given(
    space: fem.FunctionSpace, axis: int, side: int, component: int, value: float
) -> fem.DirichletBC:
    """One displacement component on one face of the cube."""
    part, _ = space.sub(component).collapse()
    dofs = fem.locate_dofs_geometrical(
        (space.sub(component), part), lambda x: np.isclose(x[axis], side, atol=1e-9)
    )
    constant = fem.Function(part)
    constant.x.array[:] = value
    return fem.dirichletbc(constant, dofs, space.sub(component))


def _solved(
    form: fem.Form, space: fem.FunctionSpace, given: Sequence[fem.DirichletBC], rtol: float
) -> tuple[fem.Function, int]:
    """Displacement under given faces, by conjugate gradients with algebraic multigrid."""
    matrix = petsc.assemble_matrix(form, bcs=list(given))
    matrix.assemble()
    zero = fem.Function(space)
    right = petsc.create_vector(fem.form(ufl.inner(zero, ufl.TestFunction(space)) * ufl.dx))
    petsc.apply_lifting(right, [form], bcs=[list(given)])
    right.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    petsc.set_bc(right, list(given))
    coordinates = space.tabulate_dof_coordinates()[: space.dofmap.index_map.size_local]
    solver = PETSc.KSP().create(matrix.comm)
    solver.setOperators(matrix)
    solver.setType("cg")
    solver.getPC().setType("gamg")
    solver.getPC().setCoordinates(coordinates)
    solver.setTolerances(rtol=rtol, max_it=2000)
    solver.setErrorIfNotConverged(True)
    solver.setFromOptions()
    solution = fem.Function(space)
    try:
        solver.solve(right, solution.x.petsc_vec)
    except PETSc.Error:
        raise RuntimeError(
            f"conjugate gradients end after {solver.getIterationNumber()} iterations with reason"
            f" {solver.getConvergedReason()}: take a coarser mesh or a lower contrast"
        ) from None
    solution.x.scatter_forward()
    steps = solver.getIterationNumber()
    for item in (solver, matrix, right):
        item.destroy()
    return solution, steps
