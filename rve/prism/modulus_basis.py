"""Galerkin's projection of a map's samples on solutions at two moduli of the particle.

Stiffness and loads are affine in the particle's modulus E, and so known at all E from two: with
those at E_a and E_b, K(E) = (1 − s) K_a + s K_b with s = (E − E_a) / (E_b − E_a), and F(E) alike.
The energy is stationary, so that the error of projected moduli is the square of that of the
displacements. Stresses at a single θ are not stationary: see `ModulusBasis.curve_error`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from alphacut.base.arrays import Array
from alphacut.rve.cell.cell import AnyPhase, Phase
from alphacut.rve.fenicsx import PETSc
from alphacut.rve.mesh.prism_grid import PrismGrid
from alphacut.rve.prism.problem import SliceStrains, Solved
from alphacut.rve.prism.slices import SliceProblem, inclusion_form, repeated
from alphacut.rve.solver.krylov import SolverOptions, solve
from alphacut.rve.solver.theta_preconditioner import ThetaPreconditioner
from alphacut.stochastic import RadiusMap


@dataclass(frozen=True)
class ModulusBasis:
    """Solutions of one map at two moduli inside a range.

    Args:
        moduli: E_a and E_b, in Pa.
        stiffness: K_a and K_b, projected, shape (2, fields, fields).
        loads: F_a and F_b, projected, shape (2, fields, loads).
        strains: Mean strains of the macroscopic strains alone, then of the solutions.
        iterations: Iterations of the solutions.
        unknowns: Number of unknowns of the linear system that was projected.
        error: Energy of the residual over that of the affine field, the larger of those at both
            ends of the range.
    """

    curve_error: ClassVar[float] = 4e-5
    """Declared relative error of s11 and s12 at a single θ by projection. It is measured: the
    largest one of the paper's campaign, where the energy is off by 2e-10."""

    moduli: Array
    stiffness: Array
    loads: Array
    strains: SliceStrains
    iterations: tuple[int, ...]
    unknowns: int
    error: float = np.nan

    def project(self, modulus: float) -> Solved:
        """Return mean strains of the slices with a modulus of the particle in the range, in Pa."""
        coefficients = self.coefficients(modulus)
        # The strain of each load is its macroscopic strain and the combination of the solutions.
        combination = np.concatenate([np.eye(coefficients.shape[1]), coefficients])
        strains = self.strains.combined(combination)
        return Solved(strains, self.iterations, self.error, self.unknowns, self.curve_error)

    def coefficients(self, modulus: float) -> Array:
        """Return the coefficients of the stored solutions that make up the solution for each load.

        They solve the projected system (Galerkin): K(E) c = F(E), with K and F interpolated in E.

        Args:
            modulus: Young's modulus E of the particle, in Pa, inside the range of the basis;
                outside it the result is extrapolated.

        Returns:
            Coefficients, shape (stored solutions, loads).
        """
        system = self.at(modulus, self.stiffness)
        loads = self.at(modulus, self.loads)
        # Solutions at two moduli are nearly parallel, and equal to round-off in a narrow range.
        # Directions with less than this part of the largest energy are left out, which plain
        # elimination would blow up.
        round_off = 1e-14
        return np.asarray(np.linalg.lstsq(system, loads, rcond=round_off)[0])

    def at(self, modulus: float, values: Array) -> Array:
        """Return what is affine in the modulus from its values at E_a and E_b, shape (2, …)."""
        low, high = self.moduli
        at_low, at_high = values
        return np.asarray(at_low + (modulus - low) / (high - low) * (at_high - at_low))


def modulus_basis(
    grid: PrismGrid,
    radius_map: RadiusMap,
    matrix: AnyPhase,
    *,
    poisson: float,
    ends: tuple[float, float],
    strains: Array,
    options: SolverOptions,
) -> ModulusBasis:
    """Return the reduced basis of the solutions at two Chebyshev moduli of the particle.

    Args:
        grid: Prisms whose nodes follow the interface.
        radius_map: Radius of the particle over θ.
        matrix: Material outside the particle.
        poisson: Poisson's ratio of the particle.
        ends: Smallest and largest modulus of the particle in Pa, not equal.
        strains: Macroscopic strains, shape (loads, 3).
        options: Options of the solver.
    """
    problem = SliceProblem.of_grid(grid)
    problem.mesh.move(radius_map)
    nodes = np.array([0.5 - 0.125**0.5, 0.5 + 0.125**0.5])  # of Chebyshev, in [0, 1]
    moduli = ends[0] + nodes * (ends[1] - ends[0])
    low, high = (Phase(modulus, poisson).stiffness for modulus in moduli)
    blocks = problem.blocks(problem.form, [matrix.stiffness, low])
    low_loads = problem.loads(problem.form, strains)
    # What the higher modulus adds to stiffness and loads comes from the inclusion alone.
    inclusion = inclusion_form(problem.mesh)
    added_blocks = problem.blocks(inclusion, [np.zeros((3, 3)), high - low])
    added_loads = problem.loads(inclusion, strains)
    matrices = [problem.matrix(blocks), problem.matrix(blocks + added_blocks)]
    high_loads = [one + other for one, other in zip(low_loads, added_loads, strict=True)]

    # The factors of the preconditioner at the lower modulus serve both.
    ksp = problem.solver(options, matrices[0], loads=len(strains))
    # The residuals may be larger than those of a sample by this factor, since the error of a
    # modulus is the square of that of the displacements.
    ksp.setTolerances(rtol=100.0 * ksp.getTolerances()[0])
    first = solve(ksp, low_loads)
    ksp.setOperators(repeated(matrices[1], len(strains)))
    second = solve(ksp, high_loads, guesses=first.vectors)

    # The projections of K_a and K_b need K_a x and K_b x of all solutions x.
    solutions = first.vectors + second.vectors
    fields = _arrays(solutions)
    images = np.array([_products(one, fields) for one in matrices])
    forces = np.array([_arrays(low_loads), _arrays(high_loads)])
    affine_and_solutions = np.concatenate([strains, np.zeros((len(fields), 3))])
    basis = ModulusBasis(
        moduli,
        stiffness=fields @ images.swapaxes(1, 2),
        loads=fields @ forces.swapaxes(1, 2),
        strains=problem.slice_strains(affine_and_solutions, [None] * len(strains) + solutions),
        iterations=first.iterations + second.iterations,
        unknowns=problem.numbering.size,
    )

    # The error is largest at the ends of the range, since the moduli are Chebyshev's nodes.
    residuals = []
    for modulus in ends:
        projected = basis.coefficients(modulus).T @ basis.at(modulus, images)
        residuals.append(basis.at(modulus, forces) - projected)
    energies = _energies(ksp.pc.getPythonContext(), np.concatenate(residuals)).reshape(
        2, len(strains)
    )
    # They are compared with the energy of the affine field in a cell of matrix alone: the scale of
    # the problem, which needs no solution.
    affine_energies = grid.plane.lattice.area * np.einsum(
        "li,ij,lj->l", strains, matrix.stiffness, strains
    )
    return replace(basis, error=float((energies / affine_energies).max()))


def _arrays(vectors: Sequence[PETSc.Vec]) -> Array:
    """Return vectors as the rows of an array."""
    return np.array([vector.array_r for vector in vectors])


def _products(matrix: PETSc.Mat, fields: Array) -> Array:
    """Return K x of several fields x, shape (fields, unknowns)."""
    x = PETSc.Vec().createWithArray(fields.ravel(), comm=PETSc.COMM_SELF)
    product = x.duplicate()
    repeated(matrix, len(fields)).mult(x, product)
    return np.array(product.array_r).reshape(fields.shape)


def _energies(preconditioner: ThetaPreconditioner, residuals: Array) -> Array:
    """Return estimates rᵀ P⁻¹ r of the energy of the errors that residuals r show, shape (fields,).

    Args:
        preconditioner: P⁻¹, set up; it is near the inverse K⁻¹ of the stiffness.
        residuals: Residuals, shape (fields, unknowns).
    """
    # The error of a field is K⁻¹ r, and its energy rᵀ K⁻¹ r, for which K would have to be solved.
    # The preconditioner takes vectors of several fields, one after another.
    r = PETSc.Vec().createWithArray(residuals.ravel(), comm=PETSc.COMM_SELF)
    corrections = r.duplicate()
    preconditioner.apply(None, r, corrections)
    products = residuals * corrections.array_r.reshape(residuals.shape)
    return np.asarray(products.sum(axis=1))
