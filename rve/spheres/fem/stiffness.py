"""Cubic stiffness of the cell of a sphere by finite elements on one eighth of it.

Reflections turn the periodic cell into Dirichlet problems on [0, 1]³, see `faces`. The energy of
the solution is the modulus, from above, up to the geometry: curved tetrahedra of second order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from time import perf_counter

import alphacut.rve.fenicsx  # noqa: F401
from alphacut.rve.interruption import uninterrupted

with uninterrupted():
    from dolfinx import fem
    from dolfinx.fem import petsc

import numpy as np
import ufl
from mpi4py import MPI
from petsc4py import PETSc

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Phase
from alphacut.rve.spheres.bounds import bulk_and_shear
from alphacut.rve.spheres.fem.faces import LOADS, Faces, Load, on_faces
from alphacut.rve.spheres.fem.multigrid import TwoSpaces
from alphacut.rve.spheres.fem.octant import MATRIX, SPHERE, octant

RTOL = 1e-7  # of the residual; what is left of the energy is of the order of its square


@dataclass(frozen=True)
class OctantSolution:
    """Moduli of one mesh.

    Args:
        moduli: K, (C11 − C12)/2 and C44 in Pa, shape (3,).
        unknowns: Displacements of the mesh.
        iterations: Of conjugate gradients, one number a load.
        seconds: Wall time by stage: assemble, setup, solve.
        displacements: This rank's part of the solutions, one a load; empty unless asked for.
    """

    moduli: Array
    unknowns: int
    iterations: tuple[int, ...]
    seconds: dict[str, float] = field(default_factory=dict)
    displacements: tuple[Array, ...] = ()


class OctantCell:
    """One mesh with its quadratic and linear elements, for any materials.

    Args:
        radius: Radius over half the cell's side, in (0, 0.97].
        size: Edge length in halves of the cell's side, in (0, 1].
        comm: Ranks that share the mesh.

    Raises:
        ValueError: A value out of range.
        TouchingError: Spheres nearly touch.
    """

    def __init__(self, radius: float, *, size: float, comm: MPI.Intracomm = MPI.COMM_SELF) -> None:
        self.mesh, self._tags = octant(radius, size=size, comm=comm)[:2]
        self.fine, self.coarse = (
            fem.functionspace(self.mesh, ("Lagrange", degree, (3,))) for degree in (2, 1)
        )
        constant = fem.functionspace(self.mesh, ("DG", 0))
        self._lame, self._shear = fem.Function(constant), fem.Function(constant)
        self._displacement = fem.Function(self.fine)
        self._energy = fem.form(self._form(self._displacement, self._displacement))
        self._forms = [
            fem.form(self._form(ufl.TrialFunction(space), ufl.TestFunction(space)))
            for space in (self.fine, self.coarse)
        ]
        self._prolongation = petsc.interpolation_matrix(self.coarse, self.fine)
        self._prolongation.assemble()

    @property
    def unknowns(self) -> int:
        """Displacements of the quadratic elements, on all ranks."""
        return int(3 * self.fine.dofmap.index_map.size_global)

    def _form(self, u: ufl.core.expr.Expr, v: ufl.core.expr.Expr) -> ufl.Form:
        """Twice the energy, of stiffness over that of the matrix."""
        dx = ufl.Measure("dx", self.mesh, metadata={"quadrature_degree": 4})
        strain, other = ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))
        stretch = self._lame * ufl.div(u) * ufl.div(v)
        return (2 * self._shear * ufl.inner(strain, other) + stretch) * dx

    def solve(
        self, matrix: Phase, inclusion: Phase, *, rtol: float = RTOL, keep: bool = False
    ) -> OctantSolution:
        """The three moduli for one pair of materials.

        Args:
            matrix: Material outside the sphere.
            inclusion: Material of the sphere.
            rtol: Relative residual at which the iteration ends.
            keep: Whether the displacements are part of the answer.

        Raises:
            ConvergenceError: An iteration does not converge.
        """
        self._set(matrix, inclusion)
        started = perf_counter()
        stiffness = [petsc.assemble_matrix(form) for form in self._forms]
        for one in stiffness:
            one.assemble()
        seconds = {"assemble": perf_counter() - started, "setup": 0.0, "solve": 0.0}
        moduli, iterations, fields = [], [], []
        for faces, loads in LOADS:
            for value, steps, field_of in self._under(faces, loads, stiffness, rtol, seconds):
                moduli.append(matrix.modulus * value)
                iterations.append(steps)
                fields += [field_of] if keep else []
        for one in stiffness:
            one.destroy()
        return OctantSolution(
            np.array(moduli), self.unknowns, tuple(iterations), seconds, tuple(fields)
        )

    def energies(self, matrix: Phase, inclusion: Phase, fields: Array) -> Array:
        """Twice the energy of displacements with one another, over Young's modulus of the matrix.

        Args:
            matrix: Material outside the sphere.
            inclusion: Material of the sphere.
            fields: This rank's displacements, shape (loads, k, n).

        Returns:
            Shape (loads, k, k).
        """
        self._set(matrix, inclusion)
        stiffness = petsc.assemble_matrix(self._forms[0])
        stiffness.assemble()
        vector, image = stiffness.createVecs()
        found = np.empty((*fields.shape[:2], fields.shape[1]))
        for load, k in np.ndindex(fields.shape[:2]):
            vector.array[:] = fields[load, k]
            stiffness.mult(vector, image)
            found[load, k] = fields[load] @ image.array
        for item in (stiffness, vector, image):
            item.destroy()
        return np.asarray(self.mesh.comm.allreduce(found))

    def _set(self, matrix: Phase, inclusion: Phase) -> None:
        """Lamé's constants of the cells, over Young's modulus of the matrix."""
        for tag, phase in ((MATRIX, matrix), (SPHERE, inclusion)):
            bulk, shear = (value / matrix.modulus for value in bulk_and_shear(phase))
            cells = self._tags.find(tag)
            self._lame.x.array[cells], self._shear.x.array[cells] = bulk - 2 / 3 * shear, shear

    def _under(
        self,
        faces: Faces,
        loads: Sequence[Load],
        stiffness: Sequence[PETSc.Mat],
        rtol: float,
        seconds: dict[str, float],
    ) -> list[tuple[float, int, Array]]:
        """Modulus over that of the matrix, iterations, and displacements of each load on faces."""
        started = perf_counter()
        fine, coarse = (matrix.copy() for matrix in stiffness)
        between = self._prolongation.copy()
        fixed = [on_faces(space, faces)[0] for space in (self.fine, self.coarse)]
        free = [_without(matrix, dofs) for matrix, dofs in zip((fine, coarse), fixed, strict=True)]
        between.diagonalScale(*free)
        nodes = self.coarse.tabulate_dof_coordinates()[: self.coarse.dofmap.index_map.size_local]
        solver = TwoSpaces(fine, coarse, prolongation=between, nodes=nodes, rtol=rtol)
        seconds["setup"] += perf_counter() - started
        started = perf_counter()
        found = [self._solved(load, faces, stiffness[0], free[0], solver) for load in loads]
        seconds["solve"] += perf_counter() - started
        for item in (solver, fine, coarse, between, *free):
            item.destroy()
        return found

    def _solved(
        self, load: Load, faces: Faces, stiffness: PETSc.Mat, free: PETSc.Vec, solver: TwoSpaces
    ) -> tuple[float, int, Array]:
        """Modulus, iterations and displacements of one load."""
        given = fem.Function(self.fine)
        dofs, values = on_faces(self.fine, faces, load.strain)
        given.x.array[dofs] = values
        right, whole = stiffness.createVecLeft(), self._displacement.x.petsc_vec
        stiffness.mult(given.x.petsc_vec, right)
        right.pointwiseMult(right, free)
        right.scale(-1)
        whole.set(0.0)
        steps = solver.solve(right, whole)
        whole.axpy(1.0, given.x.petsc_vec)
        self._displacement.x.scatter_forward()
        right.destroy()
        energy = self.mesh.comm.allreduce(fem.assemble_scalar(self._energy))
        return float(energy / load.unit), steps, whole.array.copy()


def _without(matrix: PETSc.Mat, dofs: Array) -> PETSc.Vec:
    """Rows and columns of given displacements made those of the identity; 1 at the free ones."""
    first, last = matrix.getOwnershipRange()
    own = dofs[dofs < last - first]
    matrix.zeroRowsColumns((first + own).astype(np.int32))
    free = matrix.createVecLeft()
    free.set(1.0)
    free.array[own] = 0.0
    return free
