"""Galerkin's projection of a map's samples on solutions at two moduli of the particle.

Stiffness and loads are affine in the modulus, so both ends of a range tell all between. The energy
is stationary, so the error of projected moduli is the square of that of the displacements.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Phase
from alphacut.rve.fenicsx import PETSc
from alphacut.rve.prism.problem import CELL_AREA, PrismProblem, SliceStrains
from alphacut.rve.solver.krylov import LinearSolver
from alphacut.rve.solver.options import SolverOptions

TOLERANCE = 2e-10  # of the energy that is left out; E is off by half of it at most
_CHEBYSHEV = (0.5 - 0.125**0.5, 0.5 + 0.125**0.5)
ROUND_OFF = 1e-9  # of a solution that the others carry already


@dataclass(frozen=True)
class ModulusBasis:
    """Solutions of one map at two moduli inside a range.

    Args:
        nodes: The moduli, in Pa.
        stiffness: The system at the nodes, projected, shape (2, fields, fields).
        loads: The loads at the nodes, projected, shape (2, fields, loads).
        strains: Of the macroscopic strains alone, then of the solutions.
        iterations: Of the solutions.
        error: Energy of the residual, the largest at the ends and half-way between them, over that
            of the affine field.
    """

    nodes: tuple[float, float]
    stiffness: Array
    loads: Array
    strains: SliceStrains
    iterations: tuple[int, ...]
    error: float = np.nan

    def project(self, modulus: float) -> SliceStrains:
        """Mean strains of the slices with this modulus of the particle, in Pa."""
        coefficients = self.coefficients(modulus)
        return self.strains.combined(np.concatenate([np.eye(coefficients.shape[1]), coefficients]))

    def coefficients(self, modulus: float) -> Array:
        """Of the solutions for each load, shape (fields, loads)."""
        low, high = self.shares(modulus)
        system, loads = (low * a + high * b for a, b in (self.stiffness, self.loads))
        return np.asarray(np.linalg.solve(system, loads))

    def shares(self, modulus: float) -> tuple[float, float]:
        """Of the system at the nodes in that at a modulus."""
        share = (modulus - self.nodes[0]) / (self.nodes[1] - self.nodes[0])
        return 1 - share, share


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
    systems, forces, solved = [], [], []
    solver: LinearSolver | None = None
    nodes = tuple(ends[0] + share * (ends[1] - ends[0]) for share in _CHEBYSHEV)
    for modulus in nodes:
        problem.assemble((matrix.stiffness, Phase(modulus, poisson).stiffness))
        systems.append(problem.matrix.copy())
        forces.append(problem.loads(strains))
        solver = solver or problem.solver(SolverOptions())  # its factors serve both
        solved.append(solver.solve(forces[-1], systems[-1]))
    vectors = _orthonormal([v for solutions in solved for v in solutions.vectors])
    images = [[_product(system, v) for v in vectors] for system in systems]
    stiffness, loads = (
        np.array([[[v.dot(w) for w in side] for v in vectors] for side in sides])
        for sides in (images, forces)
    )
    rest: Array = np.zeros((len(problem.form.node), 2))
    none: Array = np.zeros(3)
    fields = [(strain, rest) for strain in strains]
    fields += [(none, problem.field(v)) for v in vectors]
    means = problem.slice_strains(fields)
    iterations = sum((solutions.iterations for solutions in solved), ())
    basis = ModulusBasis((nodes[0], nodes[1]), stiffness, loads, means, iterations)
    scale = CELL_AREA * np.einsum("li,ij,lj->l", strains, matrix.stiffness, strains)
    assert solver is not None
    left = [_left_out(basis, e, images, forces, solver) for e in (ends[0], sum(ends) / 2, ends[1])]
    return replace(basis, error=float((np.array(left) / scale).max()))


def _left_out(
    basis: ModulusBasis,
    modulus: float,
    images: list[list[PETSc.Vec]],
    forces: list[list[PETSc.Vec]],
    solver: LinearSolver,
) -> Array:
    """Energy of the residual at a modulus, by the preconditioner, shape (loads,)."""
    coefficients, energies = basis.coefficients(modulus), []
    low, high = basis.shares(modulus)
    for k, column in enumerate(coefficients.T):
        residual = low * forces[0][k] + high * forces[1][k]
        shares = np.concatenate([-low * column, -high * column])
        residual.maxpy(shares.tolist(), images[0] + images[1])
        answer = residual.duplicate()
        solver.ksp.pc.apply(residual, answer)
        energies.append(residual.dot(answer))
    return np.array(energies)


def _orthonormal(vectors: list[PETSc.Vec]) -> list[PETSc.Vec]:
    """Vectors of the same span, without those that others carry (Gram and Schmidt, twice)."""
    basis: list[PETSc.Vec] = []
    for vector in vectors:
        size = vector.norm()
        for one in [*basis, *basis]:
            vector.axpy(-vector.dot(one), one)
        if vector.norm() > ROUND_OFF * size:
            vector.normalize()
            basis.append(vector)
    return basis


def _product(matrix: PETSc.Mat, vector: PETSc.Vec) -> PETSc.Vec:
    product = vector.duplicate()
    matrix.mult(vector, product)
    return product
