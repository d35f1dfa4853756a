"""The elasticity form of the cell, for triangles and for prisms of the product space (eq. 1 to 7).

div and D act on x alone: on the product space, whose mesh is three-dimensional, the form has no
derivative along θ.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from alphacut.fuzzy.arrays import Array, Ints
from alphacut.rve.cell.cell import AnyPhase
from alphacut.rve.fenicsx import PETSc, at_points, compiled, fem, petsc, ufl
from alphacut.rve.result.moduli import moduli_of_energies


def measure_of(mesh: Any, cells: Ints, metadata: dict[str, Any]) -> Any:
    """Measure of some cells of this rank; forms over any of them are compiled once."""
    part = [(0, np.asarray(cells, np.int32))]
    return ufl.Measure("dx", mesh, metadata=metadata, subdomain_data=part)(0)


def strain(u: Any) -> Any:
    """In-plane strain (ε11, ε22, 2 ε12) of displacements; θ is not differentiated (eq. 5)."""
    gradient = ufl.grad(u)
    return ufl.as_vector([gradient[0, 0], gradient[1, 1], gradient[0, 1] + gradient[1, 0]])


class CellForm:
    """Stiffness and loads of a fluctuation in n phases; what stands in them is set anew.

    Args:
        space: Displacements of two components.
        points: Values at quadrature points, or in cells.
        parts: Measures of the phases in their order; with `mixed` one measure of all.
        mixed: Whether `in_particle` tells the phase of points, where a mesh ignores the interface.

    Attributes:
        density: f_Θ of eq. 1 at the points; 1 where there is no θ.
        in_particle: Indicator of the particle at the points, 0 or 1 (eq. 13), if mixed.
    """

    def __init__(
        self,
        space: fem.FunctionSpace,
        points: fem.FunctionSpace,
        parts: Sequence[Any],
        *,
        mixed: bool = False,
    ) -> None:
        mesh, count = space.mesh, 2 if mixed else len(parts)
        self.density, self.in_particle = fem.Function(points), fem.Function(points)
        self._phases = [fem.Constant(mesh, np.zeros((3, 3))) for _ in range(count)]
        self._uniform = fem.Constant(mesh, np.zeros(3))
        u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
        density, of_parts = self.density, list[Any](self._phases)
        if mixed:
            matrix, inclusion = self._phases
            of_parts = [matrix + self.in_particle * (inclusion - matrix)]  # eq. 13
        self._stiffness, self._load = [], []
        for stiffness, dx in zip(of_parts, parts, strict=True):
            stress = stiffness * strain(u)  # eq. 6
            # eq. 7: Galerkin's projection (eq. 4) of −div σ (eq. 2), weighted by f_Θ (eq. 1)
            left = density * ufl.dot(stress, strain(v))
            right = -density * ufl.dot(stiffness * self._uniform, strain(v))
            self._stiffness.append(compiled(left * dx))
            self._load.append(compiled(right * dx))

    def set_phases(self, stiffness: Sequence[Array]) -> None:
        """Take the Voigt matrices of the phases in their order, in Pa."""
        for constant, value in zip(self._phases, stiffness, strict=True):
            constant.value[:] = value

    def add_stiffness(self, matrix: PETSc.Mat) -> None:
        """Add the stiffness of eq. 7 to a matrix, whose local-to-global map reduces it."""
        for form in self._stiffness:
            petsc.assemble_matrix(matrix, form)
        matrix.assemble()

    def load(self, uniform: Array) -> Array:
        """Forces −⟨Bᵀ C ε̄⟩ of a macroscopic strain (3,) on this rank's nodes, (nodes · 2,)."""
        self._uniform.value[:] = uniform
        vectors = [fem.assemble_vector(form).array for form in self._load]
        return np.asarray(np.sum(vectors, axis=0))


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

    C_X is what X gives to the phase's stiffness; `loads` are the fields' macroscopic strains.
    """
    parts = np.array([phase.stiffness_parts for phase in phases])
    return moduli_of_energies(np.einsum("pxij,piaja->pxa", parts, products), loads)
