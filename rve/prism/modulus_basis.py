"""Galerkin's projection of a map's samples on solutions at two moduli of the particle.

Stiffness and loads are affine in the particle's modulus E, and so known at all E from two: with
those at E_a and E_b, K(E) = (1 − s) K_a + s K_b with s = (E − E_a) / (E_b − E_a), and f(E) alike.
The energy is stationary, so that the error of projected moduli is the square of that of the
displacements. Stresses at a single θ are not stationary: s11(θ) is good to 4e-5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from alphacut.base.arrays import Array
from alphacut.rve.cell.cell import AREA, AnyPhase, Phase
from alphacut.rve.fenicsx import PETSc
from alphacut.rve.prism.problem import SliceStrains, Solved
from alphacut.rve.prism.slices import SliceProblem, repeated
from alphacut.rve.solver.krylov import SolverOptions, solve

TOLERANCE = 2e-10  # of the energy that is left out; E is off by half of it at most
_CHEBYSHEV = np.array([0.5 - 0.125**0.5, 0.5 + 0.125**0.5])  # nodes in [0, 1]
_LOOSER = 100.0  # tolerance of the residuals over a sample's; the error of a modulus is its square
ROUND_OFF = 1e-14  # energy over the largest, below which a direction is left out


@dataclass(frozen=True)
class ModulusBasis:
    """Solutions of one map at two moduli inside a range.

    Args:
        moduli: E_a and E_b, in Pa.
        stiffness: K_a and K_b, projected, shape (2, fields, fields).
        loads: f_a and f_b, projected, shape (2, fields, loads).
        strains: Of the macroscopic strains alone, then of the solutions.
        iterations: Of the solutions.
        error: Energy of the residual, the larger at the ends, over that of the affine field.
    """

    moduli: Array
    stiffness: Array
    loads: Array
    strains: SliceStrains
    iterations: tuple[int, ...]
    error: float = np.nan

    def project(self, modulus: float) -> Solved:
        """Mean strains of the slices with a modulus of the particle between the ends, in Pa."""
        coefficients = self.coefficients(modulus)
        combination = np.concatenate([np.eye(coefficients.shape[1]), coefficients])
        return Solved(self.strains.combined(combination), self.iterations, self.error)

    def coefficients(self, modulus: float) -> Array:
        """Of the solutions for each load, shape (fields, loads)."""
        system, loads = self.at(modulus, self.stiffness), self.at(modulus, self.loads)
        # solutions at two moduli are nearly parallel, and equal to round-off in a narrow range
        return np.asarray(np.linalg.lstsq(system, loads, rcond=ROUND_OFF)[0])

    def at(self, modulus: float, values: Array) -> Array:
        """Return what is affine in the modulus from its values at E_a and E_b."""
        (low, high), (first, second) = self.moduli, values
        return np.asarray(first + (modulus - low) / (high - low) * (second - first))


def modulus_basis(
    problem: SliceProblem,
    matrix: AnyPhase,
    *,
    poisson: float,
    ends: tuple[float, float],
    strains: Array,
    options: SolverOptions,
) -> ModulusBasis:
    """Reduced basis of the solutions at two Chebyshev moduli of the particle, with its error.

    Args:
        problem: Moved to the map.
        matrix: Its material.
        poisson: Poisson's ratio of the particle.
        ends: Least and greatest modulus of the particle in Pa, not equal.
        strains: Macroscopic ones, shape (loads, 3).
        options: Of the solver.
    """
    moduli = ends[0] + _CHEBYSHEV * (ends[1] - ends[0])
    phases = [(matrix.stiffness, Phase(modulus, poisson).stiffness) for modulus in moduli]
    matrices, loads = [], []
    for stiffness in phases:
        matrices.append(problem.assemble(stiffness))
        loads.append(problem.loads(strains))
    ksp = problem.solver(options, matrices[0], loads=len(strains))  # its factors serve both
    ksp.setTolerances(rtol=_LOOSER * ksp.getTolerances()[0])
    first = solve(ksp, loads[0])
    ksp.setOperators(repeated(matrices[1], len(strains)))
    second = solve(ksp, loads[1], guesses=first.vectors)

    solutions = first.vectors + second.vectors
    products = [  # K_a x, then K_b x of all solutions
        first.products + [_product(matrices[0], x) for x in second.vectors],
        [_product(matrices[1], x) for x in first.vectors] + second.products,
    ]
    fields, images, forces = (_arrays(vectors) for vectors in (solutions, products, loads))
    uniform = np.concatenate([strains, np.zeros((len(fields), 3))])
    basis = ModulusBasis(
        moduli,
        stiffness=fields @ images.swapaxes(1, 2),
        loads=fields @ forces.swapaxes(1, 2),
        strains=problem.slice_strains(uniform, [None] * len(strains) + solutions),
        iterations=first.iterations + second.iterations,
    )
    # the error is largest at the ends of the range, since the nodes are those of Chebyshev
    energies = np.empty((2, len(strains)))
    for end, modulus in enumerate(ends):
        projected = basis.coefficients(modulus).T @ basis.at(modulus, images)
        residuals = basis.at(modulus, forces) - projected
        energies[end] = _energies(ksp.pc, residuals)
    affine_energies = AREA * np.einsum("li,ij,lj->l", strains, matrix.stiffness, strains)
    return replace(basis, error=float((energies / affine_energies).max()))


def _product(matrix: PETSc.Mat, vector: PETSc.Vec) -> PETSc.Vec:
    """Return K x."""
    result = matrix.createVecLeft()
    matrix.mult(vector, result)
    return result


def _arrays(vectors: Sequence[Any]) -> Array:
    """Return vectors, or nested lists of them, as one array."""
    if isinstance(vectors, PETSc.Vec):
        return np.asarray(vectors.array_r)
    return np.array([_arrays(vector) for vector in vectors])


def _energies(preconditioner: PETSc.PC, residuals: Array) -> Array:
    """Return rᵀ P⁻¹ r of residuals (loads, size), about the energies of the errors, (loads,)."""
    r = PETSc.Vec().createWithArray(residuals.ravel(), comm=PETSc.COMM_SELF)
    corrections = r.duplicate()
    preconditioner.apply(r, corrections)
    return np.asarray((residuals * corrections.array_r.reshape(residuals.shape)).sum(axis=1))
