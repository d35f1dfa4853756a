"""The whole periodic cell by dolfinx_mpc, on the mirror images of the eighth's mesh.

The periodic solution has the cell's reflections, and so has the mesh: both give the same moduli up
to the solvers' residuals, from eight times the unknowns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from alphacut.rve.cell import Phase
from alphacut.stochastic.theta.truncated_normal import Array

STRAINS = (
    (np.eye(3), 9.0),
    (np.diag([-1.0, -1.0, 2.0]), 12.0),
    (np.array([[0.0, 0.5, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 0.0]]), 1.0),
)
"""Strains of K, (C11 − C12)/2 and C44, and twice their energy density over the modulus."""
VOLUME = 8.0


@dataclass(frozen=True)
class Peer:
    """Moduli by dolfinx_mpc and their cost.

    Args:
        moduli: K, (C11 − C12)/2 and C44 in Pa, shape (3,).
        unknowns: Of the whole cell.
        iterations: Of conjugate gradients, one number a load.
        seconds: Wall time by stage: constraint, assemble, solve.
    """

    moduli: Array
    unknowns: int
    iterations: tuple[int, ...]
    seconds: dict[str, float]


def whole_mesh(radius: float, *, size: float) -> tuple[Any, Array]:
    """The whole cell as a mesh of dolfinx, and whether each of its tetrahedra is the sphere."""
    from basix.ufl import element
    from dolfinx.mesh import create_mesh
    from mpi4py import MPI

    from alphacut.rve.spheres.fem.octant import whole_cell

    points, cells, inside = whole_cell(radius, size=size)
    curved = element("Lagrange", "tetrahedron", 2, shape=(3,))
    whole = create_mesh(MPI.COMM_SELF, cells.astype(np.int64), points, curved)
    return whole, inside[whole.topology.original_cell_index]


def mpc_stiffness(radius: float, phases: Sequence[Phase], *, size: float, rtol: float) -> Peer:
    """The three moduli by dolfinx_mpc, conjugate gradients and GAMG with rigid body motions."""
    import dolfinx_mpc
    from dolfinx import fem

    mesh, inside = whole_mesh(radius, size=size)
    space = fem.functionspace(mesh, ("Lagrange", 2, (3,)))
    forms = _forms(mesh, inside, space, phases)
    started = perf_counter()
    constraint, fixed = _periodic(space)
    seconds = {"constraint": perf_counter() - started}
    started = perf_counter()
    matrix = dolfinx_mpc.assemble_matrix(forms["stiffness"], constraint, bcs=[fixed])
    seconds["assemble"] = perf_counter() - started
    started = perf_counter()
    solver = _solver(matrix, constraint.function_space, rtol)
    moduli, iterations = [], []
    for strain, unit in STRAINS:
        forms["strain"].value[:] = strain
        right = dolfinx_mpc.assemble_vector(forms["load"], constraint)
        dolfinx_mpc.apply_lifting(right, [forms["stiffness"]], [[fixed]], constraint)
        fem.petsc.set_bc(right, [fixed])
        found = fem.Function(constraint.function_space)
        solver.solve(right, found.x.petsc_vec)
        found.x.scatter_forward()
        constraint.backsubstitution(found)
        forms["displacement"].x.array[:] = found.x.array[: forms["displacement"].x.array.size]
        moduli.append(fem.assemble_scalar(forms["energy"]) / (unit * VOLUME))
        iterations.append(int(solver.getIterationNumber()))
    seconds["solve"] = perf_counter() - started
    unknowns = int(3 * space.dofmap.index_map.size_global)
    return Peer(phases[0].modulus * np.array(moduli), unknowns, tuple(iterations), seconds)


def _forms(mesh: Any, inside: Array, space: Any, phases: Sequence[Phase]) -> dict[str, Any]:
    """Stiffness and load, energy of strain plus fluctuation, and what they are evaluated at."""
    import ufl
    from dolfinx import fem

    from alphacut.rve.spheres.bounds import bulk_and_shear

    constant = fem.functionspace(mesh, ("DG", 0))
    bulk, shear = fem.Function(constant), fem.Function(constant)
    unit = phases[0].modulus
    for phase, cells in zip(phases, (~inside, inside), strict=True):
        k, g = bulk_and_shear(phase)
        bulk.x.array[cells], shear.x.array[cells] = k / unit, g / unit
    dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": 4})
    strain = fem.Constant(mesh, np.zeros((3, 3)))

    def energy(e: Any, other: Any) -> Any:
        lame = bulk - 2 / 3 * shear
        return (2 * shear * ufl.inner(e, other) + lame * ufl.tr(e) * ufl.tr(other)) * dx

    def of(u: Any) -> Any:
        return ufl.sym(ufl.grad(u))

    trial, test = ufl.TrialFunction(space), ufl.TestFunction(space)
    displacement = fem.Function(space)
    total = strain + of(displacement)
    return {
        "stiffness": fem.form(energy(of(trial), of(test))),
        "load": fem.form(-energy(strain, of(test))),
        "energy": fem.form(energy(total, total)),
        "strain": strain,
        "displacement": displacement,
    }


def _periodic(space: Any) -> tuple[Any, Any]:
    """Opposite faces tied at once, edges to one edge, and the corners fixed."""
    import dolfinx_mpc
    from dolfinx import fem

    def upper(x: Array) -> Array:
        return np.asarray(np.isclose(x, 1.0).any(axis=0))

    def partner(x: Array) -> Array:
        return np.where(np.isclose(x, 1.0), x - 2, x)

    corners = fem.locate_dofs_geometrical(space, lambda x: np.isclose(np.abs(x), 1.0).all(axis=0))
    fixed = fem.dirichletbc(np.zeros(3), corners, space)
    constraint = dolfinx_mpc.MultiPointConstraint(space)
    constraint.create_periodic_constraint_geometrical(space, upper, partner, [fixed])
    constraint.finalize()
    return constraint, fixed


def _solver(matrix: Any, space: Any, rtol: float) -> Any:
    """Conjugate gradients with GAMG, as dolfinx_mpc's demonstrations of elasticity."""
    from dolfinx_mpc.utils import rigid_motions_nullspace
    from petsc4py import PETSc

    matrix.setNearNullSpace(rigid_motions_nullspace(space))
    solver = PETSc.KSP().create(matrix.comm)
    solver.setOperators(matrix)
    solver.setType("cg")
    solver.getPC().setType("gamg")
    solver.setTolerances(rtol=rtol, max_it=1000)
    solver.setErrorIfNotConverged(True)
    solver.setUp()
    return solver
