"""Additive block preconditioner with one exact Cholesky factor for each θ-level."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from alphacut.rve.solver.constraints import LevelNumbering


class LevelBlocks:
    """Solves with the diagonal blocks of the reduced stiffness, for comparison.

    Args:
        numbering: Unknowns level by level.
        matrix: The reduced stiffness.

    Raises:
        ValueError: More than one rank (PETSc's own Cholesky is sequential).
    """

    def __init__(self, numbering: LevelNumbering, matrix: PETSc.Mat) -> None:
        if matrix.comm.size > 1:
            raise ValueError(
                f"the solver blocks runs on one MPI rank, not on {matrix.comm.size}: take theta,"
                " mumps or gamg"
            )
        planar, between = 2 * numbering.periodicity.count, 2 * numbering.periodicity.vertices
        ends = np.cumsum([planar, between] * numbering.grid.layers + [planar])
        self.slices = [
            slice(stop - size, stop)
            for size, stop in zip(np.diff(ends, prepend=0), ends, strict=True)
        ]
        self.solvers = [self._factor(matrix, part) for part in self.slices]

    @staticmethod
    def _factor(matrix: PETSc.Mat, part: slice) -> PETSc.KSP:
        rows = PETSc.IS().createStride(part.stop - part.start, part.start, 1, comm=PETSc.COMM_SELF)
        block = matrix.createSubMatrix(rows, rows)
        block.setOption(PETSc.Mat.Option.SPD, True)
        solver = PETSc.KSP().create(PETSc.COMM_SELF)
        solver.setType("preonly")
        solver.setOperators(block)
        solver.pc.setType("cholesky")
        solver.pc.setFactorOrdering("nd")
        solver.setUp()
        return solver

    def apply(self, _pc: PETSc.PC, residual: PETSc.Vec, result: PETSc.Vec) -> None:
        """Result = Σ Rᵀ K_k⁻¹ R residual, called by PETSc."""
        for part, solver in zip(self.slices, self.solvers, strict=True):
            source = PETSc.Vec().createWithArray(
                residual.array_r[part].copy(), comm=PETSc.COMM_SELF
            )
            target = source.duplicate()
            solver.solve(source, target)
            result.array[part] = target.array_r
