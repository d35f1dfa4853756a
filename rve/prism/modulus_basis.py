"""Galerkin's projection of a map's samples on solutions at two moduli of the particle.

Stiffness and loads are affine in the modulus E: K_0 + t K_1 and f_0 + t f_1, where K_1 is of the
particle alone at the range's upper end and t is E over that. The energy is stationary, so the error
of projected moduli is the square of that of the displacements.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import orth

from alphacut.base.arrays import Array
from alphacut.rve.cell.cell import AREA, Phase
from alphacut.rve.prism.problem import SliceStrains
from alphacut.rve.prism.slices import SliceProblem
from alphacut.rve.solver.level_solver import conjugate_gradients

TOLERANCE = 2e-10  # of the energy that is left out; E is off by half of it at most
_CHEBYSHEV = (0.5 - 0.125**0.5, 0.5 + 0.125**0.5)  # nodes in [0, 1]
_LOOSE = 1e-6  # tolerance of the residuals; the error of a modulus is its square
ROUND_OFF = 1e-9  # singular value over the largest, below which a direction is left out


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
    problem: SliceProblem, matrix: Phase, poisson: float, ends: tuple[float, float], strains: Array
) -> ModulusBasis:
    """Reduced basis of the solutions at two Chebyshev moduli of the particle, with its error.

    `ends` are the particle's least and greatest modulus in Pa, not equal, `poisson` its ratio,
    `strains` macroscopic ones, shape (loads, 3).
    """
    low, high = ends
    nothing, particle = np.zeros((3, 3)), Phase(high, poisson).stiffness
    phases = [(matrix.stiffness, nothing), (nothing, particle)]
    parts = [problem.entries(stiffness) for stiffness in phases]
    forces = np.array([problem.forces(stiffness, strains) for stiffness in phases])
    factors = [(low + node * (high - low)) / high for node in _CHEBYSHEV]
    systems = [parts[0] + factor * parts[1] for factor in factors]
    operators = [problem.operator(system) for system in systems]
    problem.factorise(systems[0])  # the factors serve both

    def multiply(fields: Array) -> Array:
        halves = np.split(fields, 2)
        return np.concatenate([by(half) for by, half in zip(operators, halves, strict=True)])

    loads = np.concatenate([forces[0] + factor * forces[1] for factor in factors])
    solutions, iterations = conjugate_gradients(multiply, problem.solver, loads, _LOOSE)
    fields = np.ascontiguousarray(orth(solutions.T, rcond=ROUND_OFF).T)
    images = np.array([problem.operator(part)(fields) for part in parts])  # K_0 v and K_1 v
    means = problem.slice_strains(strains, fields)
    projected = fields @ images.swapaxes(1, 2), fields @ forces.swapaxes(1, 2)
    basis = ModulusBasis(*projected, means, iterations, ends)
    # the error is largest at the ends of the range, since the nodes are those of Chebyshev
    residuals = np.concatenate(
        [
            forces[0] + t * forces[1] - basis.coefficients(t * high).T @ (images[0] + t * images[1])
            for t in (low / high, 1.0)
        ]
    )
    energies = (residuals * problem.solver(residuals)).sum(axis=1)  # rᵀ P⁻¹ r
    affine_energies = AREA * np.einsum("li,ij,lj->l", strains, matrix.stiffness, strains)
    return replace(basis, error=float((energies.reshape(2, -1) / affine_energies).max()))
