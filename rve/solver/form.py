"""The elasticity form of the cell, written once for all elements (eq. 1 to 7).

DOLFINx assembles it over prisms of the product space, over their slices, and over the triangles of
a plane cell. div and D act on x alone, so that the form has no derivative along θ.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from alphacut.base.arrays import Array
from alphacut.rve.cell.cell import AnyPhase
from alphacut.rve.fenicsx import PETSc, at_points, compiled, fem, petsc, ufl


def strain(u: Any) -> Any:
    """In-plane strain (ε11, ε22, 2 ε12) of displacements; θ is not differentiated (eq. 5)."""
    gradient = ufl.grad(u)
    return ufl.as_vector([gradient[0, 0], gradient[1, 1], gradient[0, 1] + gradient[1, 0]])


def virtual_work(stiffness: Any, strain_of_u: Any, v: Any, weight: Any) -> Any:
    """Return the integrand of eq. 7: the work of the stress C ε in ε(v), times a weight.

    It is Galerkin's projection (eq. 4) of −div σ (eq. 2) in the inner product of eq. 1, whose
    weight is the density f_Θ, or over a slice at θ_s the weight w_s of its quadrature along θ.
    """
    stress = stiffness * strain_of_u  # eq. 6: σ = C ε in Voigt order
    return weight * ufl.dot(stress, strain(v))


class CellForm:
    """Stiffness and loads of a fluctuation, by the stiffness of the material at each point.

    Args:
        space: Displacements of two components.
        points: Matrices (3, 3) in cells or at quadrature points.
        dx: Measure of the cells.
        weight: f_Θ of eq. 1 at the points, or w_s of a slice; 1 where there is no θ.

    Attributes:
        stiffness: Voigt matrix C of the material, in Pa; to be set.
        bilinear: a(u, v) = ∫ f_Θ C ε(u) : ε(v), compiled.
    """

    def __init__(
        self, space: fem.FunctionSpace, points: fem.FunctionSpace, dx: Any, weight: Any = 1.0
    ) -> None:
        self.stiffness = fem.Function(points)
        self._uniform = fem.Constant(space.mesh, np.zeros(3))
        u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
        # eq. 7 with the strain ε̄ + ε(u): a(u, v) = −∫ f_Θ C ε̄ : ε(v) for all v
        self.bilinear = compiled(virtual_work(self.stiffness, strain(u), v, weight) * dx)
        self._load = compiled(-virtual_work(self.stiffness, self._uniform, v, weight) * dx)

    def assemble(self, matrix: PETSc.Mat) -> None:
        """Set a matrix, whose local-to-global map reduces it, to the stiffness of eq. 7."""
        matrix.zeroEntries()
        petsc.assemble_matrix(matrix, self.bilinear)
        matrix.assemble()

    def load(self, uniform: Array) -> Array:
        """Forces −⟨Bᵀ C ε̄⟩ of a macroscopic strain (3,) on this rank's nodes, (nodes · 2,)."""
        self._uniform.value[:] = uniform
        return np.asarray(fem.assemble_vector(self._load).array)


class PointStrains:
    """Strains and det J at quadrature points (n, dimension) of this rank's cells."""

    def __init__(self, space: fem.FunctionSpace, points: Array) -> None:
        mesh = space.mesh
        self._mesh, self._cells = mesh, np.arange(len(mesh.geometry.dofmap), dtype=np.int32)
        self._u = fem.Function(space)
        self._strain = at_points(strain(self._u), points)
        self._determinant = at_points(ufl.JacobianDeterminant(mesh), points)

    def __call__(self, displacement: Array) -> Array:
        """(ε11, ε22, 2 ε12), shape (cells, points, 3), of displacements of nodes, (nodes, 2)."""
        self._u.x.array[:] = displacement.ravel()
        values = np.asarray(self._strain.eval(self._mesh, self._cells))
        return values.reshape(len(self._cells), -1, 3)

    def determinants(self) -> Array:
        """Determinants of J at the points, shape (cells, points)."""
        values = np.asarray(self._determinant.eval(self._mesh, self._cells))
        return values.reshape(len(self._cells), -1)


def strain_products(strains: Array, weights: Array) -> Array:
    """Integral of ε_a ⊗ ε_b over each phase, (phases, 3, fields, 3, fields).

    From strains at n points, (n, 3, fields), and weights in each phase, (phases, n).
    """
    fields = strains.shape[-1]
    flat = strains.reshape(-1, 3 * fields)
    products = np.array([flat.T @ (phase[:, None] * flat) for phase in weights])
    return products.reshape(-1, 3, fields, 3, fields)


def total_energy(products: Array, stiffness: Sequence[Array]) -> Array:
    """Mean of σ_a : ε_b over all phases, shape (fields, fields), in Pa, from `strain_products`."""
    return np.asarray(np.einsum("pij,piajb->ab", np.array(stiffness), products))


def energies_by_phase(products: Array, phases: Sequence[AnyPhase], loads: Array) -> Array:
    """Σ ε : C_X ε of X = K, G of each phase in the three moduli, (phases, 2, 3), in Pa.

    C_X is what X gives to the phase's stiffness; `loads` are the fields' macroscopic strains,
    `LOADS` or `THREE_LOADS`; without the third, parts of C11 − C12 are nan.
    """
    parts = np.array([phase.stiffness_parts for phase in phases])
    energies = np.einsum("pxij,piaja->pxa", parts, products)
    moduli = np.full((*energies.shape[:-1], 3), np.nan)
    columns = [0, 2, 1][: len(loads)]  # what the equibiaxial, shear and deviatoric load give
    moduli[..., columns] = energies / (loads**2).sum(axis=1)
    return moduli
