"""Galerkin's projection of a map's samples on solutions at two moduli of the particle.

Stiffness and loads are affine in the modulus E: K_0 + t K_1 and f_0 + t f_1, where K_1 is of the
particle alone at the range's upper end and t is E over that. The energy is stationary, so the error
of projected moduli is the square of that of the displacements.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell.cell import AREA, Phase
from alphacut.rve.fenicsx import PETSc
from alphacut.rve.prism.problem import PrismProblem, SliceStrains
from alphacut.rve.solver.krylov import SolverOptions, solve

TOLERANCE = 2e-10  # of the energy that is left out; E is off by half of it at most
_CHEBYSHEV = (0.5 - 0.125**0.5, 0.5 + 0.125**0.5)  # nodes in [0, 1]
_SAME = PETSc.Mat.Structure.SAME_NONZERO_PATTERN
_MATRIX_AND_PARTICLE = slice(0, 1), slice(1, 2)  # parts of the mesh
_LOOSE = SolverOptions(overrides={"ksp_rtol": "1e-6"})  # the error of a modulus is its square
ROUND_OFF = 1e-9  # relative norm of what is new in a solution, below which it is left out


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
    """Reduced basis of the solutions at two Chebyshev moduli of the particle, with its error.

    `ends` are the particle's least and greatest modulus in Pa, not equal, `poisson` its ratio,
    `strains` macroscopic ones, shape (loads, 3).
    """
    low, high = ends
    phases = matrix.stiffness, Phase(high, poisson).stiffness
    systems = [problem.assemble(phases, part).copy() for part in _MATRIX_AND_PARTICLE]
    forces = [problem.loads(strains, part) for part in _MATRIX_AND_PARTICLE]
    ksp, solved = None, []
    for node in _CHEBYSHEV:
        factor = (low + node * (high - low)) / high
        systems[0].copy(problem.matrix, _SAME)
        problem.matrix.axpy(factor, systems[1], _SAME)
        ksp = ksp or problem.solver(_LOOSE)  # its factors serve both
        loads = [_scaled_sum(f0, f1, factor) for f0, f1 in zip(*forces, strict=True)]
        solved.append(solve(ksp, loads))
    assert ksp is not None
    vectors = _orthonormal_basis([v for solutions in solved for v in solutions.vectors])
    images = [[system * v for v in vectors] for system in systems]
    stiffness = np.array([[[v.dot(w) for w in image] for v in vectors] for image in images])
    projected_loads = np.array([[[v.dot(f) for f in force] for v in vectors] for force in forces])
    no_strain: Array = np.zeros(3)
    means = problem.slice_strains(
        [(strain, None) for strain in strains] + [(no_strain, problem.field(v)) for v in vectors]
    )
    iterations = sum((solutions.iterations for solutions in solved), ())
    basis = ModulusBasis(stiffness, projected_loads, means, iterations, ends)
    affine_energy = AREA * np.einsum("li,ij,lj->l", strains, matrix.stiffness, strains)
    # the error is largest at the ends of the range, since the nodes are those of Chebyshev
    errors = [_residual_energy(basis, modulus, images, forces, ksp.pc) for modulus in ends]
    return replace(basis, error=float((np.array(errors) / affine_energy).max()))


def _residual_energy(
    basis: ModulusBasis,
    modulus: float,
    images: list[list[PETSc.Vec]],
    forces: list[list[PETSc.Vec]],
    preconditioner: PETSc.PC,
) -> Array:
    """Energy rᵀ P⁻¹ r of the residual of projected solutions at a modulus in Pa, shape (loads,)."""
    factor, energies = modulus / basis.ends[1], []
    for k, column in enumerate(basis.coefficients(modulus).T):
        residual = _scaled_sum(forces[0][k], forces[1][k], factor)
        coefficients = np.concatenate([-column, -factor * column])
        residual.maxpy(coefficients.tolist(), images[0] + images[1])
        preconditioned = residual.duplicate()
        preconditioner.apply(residual, preconditioned)
        energies.append(residual.dot(preconditioned))
    return np.array(energies)


def _scaled_sum(matrix: PETSc.Vec, particle: PETSc.Vec, factor: float) -> PETSc.Vec:
    """The load f_0 + factor · f_1."""
    total = matrix.copy()
    total.axpy(factor, particle)
    return total


def _orthonormal_basis(vectors: list[PETSc.Vec]) -> list[PETSc.Vec]:
    """Orthonormal vectors of the same span by the Gram–Schmidt process, done twice for rounding."""
    basis: list[PETSc.Vec] = []
    for vector in vectors:
        size = vector.norm()
        for direction in [*basis, *basis]:
            vector.axpy(-vector.dot(direction), direction)
        is_new = vector.norm() > ROUND_OFF * size
        if is_new:
            vector.normalize()
            basis.append(vector)
    return basis
