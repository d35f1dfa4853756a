"""Galerkin's projection of a map's samples on solutions at two moduli of the particle.

Stiffness and loads are affine in the modulus E: K_0 + t K_1 and f_0 + t f_1, where K_1 is of the
particle alone at the range's upper end and t is E over that. The energy is stationary, so the error
of projected moduli is the square of that of the displacements.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import AREA, Phase
from alphacut.rve.fenicsx import PETSc
from alphacut.rve.prism.problem import PrismProblem, SliceStrains
from alphacut.rve.solver.krylov import solve
from alphacut.rve.solver.options import SolverOptions

TOLERANCE = 2e-10  # of the energy that is left out; E is off by half of it at most
_CHEBYSHEV = (0.5 - 0.125**0.5, 0.5 + 0.125**0.5)
_SAME = PETSc.Mat.Structure.SAME_NONZERO_PATTERN
_PHASES = slice(0, 1), slice(1, 2)  # parts of the mesh
_LOOSE = SolverOptions(overrides={"ksp_rtol": "1e-6"})  # its square is what a modulus is off by
ROUND_OFF = 1e-9  # of a solution that the others carry already


@dataclass(frozen=True)
class ModulusBasis:
    """Solutions of one map at two moduli inside a range.

    Args:
        stiffness: K_0 and K_1, projected, shape (2, fields, fields).
        loads: f_0 and f_1, projected, shape (2, fields, loads).
        strains: Of the macroscopic strains alone, then of the solutions.
        iterations: Of the solutions.
        ends: Least and greatest modulus, in Pa; K_1 is of the latter.
        error: Energy of the residual, the larger at the ends, over that of the affine field.
    """

    stiffness: Array
    loads: Array
    strains: SliceStrains
    iterations: tuple[int, ...]
    ends: tuple[float, float]
    error: float = np.nan

    def project(self, modulus: float) -> SliceStrains:
        """Mean strains of the slices with a modulus of the particle between the ends, in Pa."""
        coefficients = self.coefficients(modulus)
        return self.strains.combined(np.concatenate([np.eye(coefficients.shape[1]), coefficients]))

    def coefficients(self, modulus: float) -> Array:
        """Of the solutions for each load, shape (fields, loads)."""
        system, loads = (
            parts[0] + modulus / self.ends[1] * parts[1] for parts in (self.stiffness, self.loads)
        )
        return np.asarray(np.linalg.solve(system, loads))


def modulus_basis(
    problem: PrismProblem, matrix: Phase, poisson: float, ends: tuple[float, float], strains: Array
) -> ModulusBasis:
    """The basis of the map that the problem was moved to.

    Args:
        problem: Mesh and form.
        matrix: Phase outside the particle.
        poisson: Of the particle.
        ends: Least and greatest modulus of the particle, in Pa, apart.
        strains: Macroscopic strains, shape (loads, 3).

    Raises:
        ConvergenceError: A linear solve stopped early.
    """
    phases = matrix.stiffness, Phase(ends[1], poisson).stiffness
    systems = [problem.assemble(phases, phase).copy() for phase in _PHASES]
    forces = [problem.loads(strains, phase) for phase in _PHASES]
    ksp, solved = None, []
    for share in _CHEBYSHEV:
        part = (ends[0] + share * (ends[1] - ends[0])) / ends[1]
        systems[0].copy(problem.matrix, _SAME)
        problem.matrix.axpy(part, systems[1], _SAME)
        ksp = ksp or problem.solver(_LOOSE)  # its factors serve both
        loads = [_sum(first, second, part) for first, second in zip(*forces, strict=True)]
        solved.append(solve(ksp, loads))
    assert ksp is not None
    vectors = _orthonormal([v for solutions in solved for v in solutions.vectors])
    images = [[system * v for v in vectors] for system in systems]
    stiffness, projected = (
        np.array([[[v.dot(w) for w in side] for v in vectors] for side in sides])
        for sides in (images, forces)
    )
    none: Array = np.zeros(3)
    means = problem.slice_strains(
        [(strain, None) for strain in strains] + [(none, problem.field(v)) for v in vectors]
    )
    iterations = sum((solutions.iterations for solutions in solved), ())
    basis = ModulusBasis(stiffness, projected, means, iterations, ends)
    scale = AREA * np.einsum("li,ij,lj->l", strains, matrix.stiffness, strains)
    # half-way it is as large as at the ends or less: the nodes are those of Chebyshev
    left = [_left_out(basis, modulus, images, forces, ksp.pc) for modulus in ends]
    return replace(basis, error=float((np.array(left) / scale).max()))


def _left_out(
    basis: ModulusBasis,
    modulus: float,
    images: list[list[PETSc.Vec]],
    forces: list[list[PETSc.Vec]],
    preconditioner: PETSc.PC,
) -> Array:
    """Energy of the residual at a modulus, by the preconditioner, shape (loads,)."""
    part, energies = modulus / basis.ends[1], []
    for k, column in enumerate(basis.coefficients(modulus).T):
        residual = _sum(forces[0][k], forces[1][k], part)
        shares = np.concatenate([-column, -part * column])
        residual.maxpy(shares.tolist(), images[0] + images[1])
        answer = residual.duplicate()
        preconditioner.apply(residual, answer)
        energies.append(residual.dot(answer))
    return np.array(energies)


def _sum(matrix: PETSc.Vec, particle: PETSc.Vec, part: float) -> PETSc.Vec:
    """The load with the particle's scaled."""
    total = matrix.copy()
    total.axpy(part, particle)
    return total


def _orthonormal(vectors: list[PETSc.Vec]) -> list[PETSc.Vec]:
    """Vectors of the same span, without those that others carry (Gram and Schmidt, twice)."""
    basis: list[PETSc.Vec] = []
    for vector in vectors:
        size = vector.norm()
        for direction in [*basis, *basis]:
            vector.axpy(-vector.dot(direction), direction)
        if vector.norm() > ROUND_OFF * size:
            vector.normalize()
            basis.append(vector)
    return basis
