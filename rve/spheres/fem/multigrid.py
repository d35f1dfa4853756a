"""Conjugate gradients for quadratic tetrahedra, preconditioned over their linear ones.

A multigrid cycle of two spaces on one mesh: Chebyshev's polynomials smooth on the quadratic one,
where sums of rows bound the eigenvalues, and the linear one, an eighth of the unknowns, is left to
smoothed aggregation with the rigid body motions as its near-null space. As the linear functions are
quadratic ones too, its stiffness is Galerkin's.
"""

from __future__ import annotations

from alphacut.fuzzy.arrays import Array
from alphacut.rve.fenicsx import PETSc
from alphacut.rve.solver.krylov import ConvergenceError
from alphacut.rve.solver.options import PREFIX

SOLVER = "cg, multigrid quadratic–linear–gamg"
_MOST = 200
_OPTIONS = {
    "pc_type": "mg",
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_ksp_max_it": "2",
    "mg_levels_pc_type": "jacobi",
    "mg_levels_pc_jacobi_type": "rowl1",  # sums of the rows: by Gershgorin no eigenvalue passes 1
    "mg_levels_ksp_chebyshev_eigenvalues": "0.1,1",
    "mg_coarse_ksp_type": "preonly",
    "mg_coarse_pc_type": "gamg",
    "mg_coarse_mg_levels_ksp_max_it": "4",
}


class TwoSpaces:
    """Solver for one stiffness in both spaces.

    Args:
        fine: Stiffness of quadratic elements, rows of given displacements those of the identity.
        coarse: Of linear elements, likewise.
        prolongation: From linear to quadratic, zero where displacements are given.
        nodes: Coordinates of this rank's linear nodes, shape (n, 3).
        rtol: Relative preconditioned residual at which the iteration ends.
    """

    def __init__(
        self,
        fine: PETSc.Mat,
        coarse: PETSc.Mat,
        *,
        prolongation: PETSc.Mat,
        nodes: Array,
        rtol: float,
    ) -> None:
        krylov = PETSc.KSP().create(fine.comm)
        krylov.setOptionsPrefix(PREFIX)
        krylov.setOperators(fine)
        krylov.setType("cg")
        krylov.setTolerances(rtol=rtol, max_it=_MOST)
        cycle = krylov.pc
        cycle.setType("mg")
        cycle.setMGLevels(2)
        cycle.setMGInterpolation(1, prolongation)
        cycle.getMGSmoother(1).setOperators(fine)
        inner = cycle.getMGCoarseSolve()
        inner.setOperators(coarse)
        inner.pc.setType("gamg")
        inner.pc.setCoordinates(nodes)
        database = PETSc.Options(PREFIX)
        for name, value in _OPTIONS.items():
            database[name] = value
        krylov.setFromOptions()
        krylov.setUp()
        for name in _OPTIONS:
            database.delValue(name)
        self._krylov = krylov

    def solve(self, right: PETSc.Vec, solution: PETSc.Vec) -> int:
        """Solution of one load in place; the number of iterations.

        Raises:
            ConvergenceError: The tolerance was not reached.
        """
        self._krylov.solve(right, solution)
        steps = int(self._krylov.getIterationNumber())
        if self._krylov.getConvergedReason() <= 0:
            raise ConvergenceError(
                f"conjugate gradients end after {steps} iterations with reason"
                f" {self._krylov.getConvergedReason()}: take --method series (modulus.method)"
            )
        return steps

    def destroy(self) -> None:
        """Give the memory of PETSc back."""
        self._krylov.destroy()
