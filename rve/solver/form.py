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
    """Return the integrand of eq. 7: the work of the stress C ε in the strain of v, times a weight.

    It is Galerkin's projection (eq. 4) of −div σ (eq. 2) in the inner product of eq. 1, whose
    weight is the density f_Θ of the random number θ, or over a slice at θ_s the weight w_s of its
    quadrature along θ.

    Args:
        stiffness: UFL matrix C of shape (3, 3) in Voigt order (11, 22, 12 with 2 ε12), in Pa.
        strain_of_u: UFL vector ε = (ε11, ε22, 2 ε12) of the trial function, or a constant strain.
        v: Test function of two components.
        weight: UFL scalar or number.

    Returns:
        UFL scalar weight · (C ε) · ε(v), to be multiplied by a measure.
    """
    stress = stiffness * strain_of_u  # eq. 6: σ = C ε in Voigt order
    return weight * ufl.dot(stress, strain(v))


class CellForm:
    """Stiffness and loads of a fluctuation, by the stiffness of the material at each point.

    Args:
        space: Displacements of two components.
        points: Space of matrices (3, 3) in cells or at quadrature points.
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
        u = ufl.TrialFunction(space)
        v = ufl.TestFunction(space)
        # eq. 7 with the strain ε̄ + ε(u): a(u, v) = −∫ f_Θ C ε̄ : ε(v) for all v
        self.bilinear = compiled(virtual_work(self.stiffness, strain(u), v, weight) * dx)
        self._load = compiled(-virtual_work(self.stiffness, self._uniform, v, weight) * dx)

    def assemble(self, matrix: PETSc.Mat) -> None:
        """Set a matrix, whose local-to-global map reduces it, to the stiffness of eq. 7."""
        matrix.zeroEntries()
        petsc.assemble_matrix(matrix, self.bilinear)
        matrix.assemble()

    def load(self, uniform: Array) -> Array:
        """Return the forces of a macroscopic strain on this rank's nodes, shape (2 nodes,).

        They are the right-hand side −∫ f_Θ C ε̄ : ε(v) of eq. 7 for each nodal displacement v; the
        two entries of a node follow one another. The stiffness C is the one that is set.

        Args:
            uniform: Macroscopic strain ε̄ = (ε11, ε22, 2 ε12), shape (3,).
        """
        self._uniform.value[:] = uniform
        return np.asarray(fem.assemble_vector(self._load).array)


class PointStrains:
    """Strains and det J at points of this rank's cells.

    Args:
        space: Displacements of two components.
        points: Points of the reference cell, shape (points, dimension).
    """

    def __init__(self, space: fem.FunctionSpace, points: Array) -> None:
        self._mesh = space.mesh
        self._cells = np.arange(len(self._mesh.geometry.dofmap), dtype=np.int32)
        self._u = fem.Function(space)
        self._strain = at_points(strain(self._u), points)
        self._determinant = at_points(ufl.JacobianDeterminant(self._mesh), points)

    def __call__(self, displacement: Array) -> Array:
        """Return (ε11, ε22, 2 ε12) at the points of each cell, shape (cells, points, 3).

        Args:
            displacement: Displacements of this rank's nodes, shape (nodes, 2) or (2 nodes,), in
                DOLFINx's order.
        """
        self._u.x.array[:] = displacement.ravel()
        values = np.asarray(self._strain.eval(self._mesh, self._cells))
        return values.reshape(len(self._cells), -1, 3)

    def determinants(self) -> Array:
        """Return the determinants of J at the points, shape (cells, points)."""
        values = np.asarray(self._determinant.eval(self._mesh, self._cells))
        return values.reshape(len(self._cells), -1)


def strain_products(strains: Array, weights: Array) -> Array:
    """Return the integral of ε_a ⊗ ε_b over each phase for all pairs of fields a, b.

    Args:
        strains: Strains (ε11, ε22, 2 ε12) at n points, shape (n, 3, fields).
        weights: Quadrature weights of the points in each phase, shape (phases, n).

    Returns:
        Integrals, shape (phases, 3, fields, 3, fields). The axes are phase, component of ε_a, a,
        component of ε_b, b. Without points they are zero.
    """
    fields = strains.shape[-1]
    flat = strains.reshape(-1, 3 * fields)
    products = np.array([flat.T @ (phase[:, np.newaxis] * flat) for phase in weights])
    return products.reshape(-1, 3, fields, 3, fields)


def total_energy(products: Array, stiffness: Sequence[Array]) -> Array:
    """Return the mean of σ_a : ε_b over all phases for all pairs of fields, in Pa.

    Args:
        products: Means of ε_a ⊗ ε_b, shape (phases, 3, fields, 3, fields). The axes are phase,
            component (11, 22, 12 with 2 ε12) of ε_a, a, component of ε_b, b.
        stiffness: Stiffness of each phase in the same order of components, (3, 3), in Pa.

    Returns:
        Energies, shape (fields a, fields b), symmetric but for round-off.
    """
    return np.asarray(np.einsum("pij,piajb->ab", np.array(stiffness), products))


def energies_by_phase(products: Array, phases: Sequence[AnyPhase], loads: Array) -> Array:
    """Return the parts X ∂c/∂X of X = K, G of each phase in the three moduli c of the cell.

    By Hill and Mandel's lemma they are the energies ε : C_X ε over the squared macroscopic strain,
    where C_X is what the bulk modulus K or the shear modulus G gives to the stiffness of its phase.

    Args:
        products: Means of ε_a ⊗ ε_b under the loads a and b, shape (phases, 3, loads, 3, loads).
            The axes are phase, component of ε_a, a, component of ε_b, b.
        phases: Materials, in the order of the first axis of `products`. A phase with any stiffness
            has all its energy in the place of G.
        loads: Macroscopic strains (ε11, ε22, 2 ε12): (s, s, 0), (0, 0, 2 s) and, if there are
            three, (s, −s, 0), for any s; shape (2 or 3, 3).

    Returns:
        Energies in Pa, shape (phases, 2, 3): of K and G, in C11 + C12, C11 − C12 and C33. Those in
        C11 − C12 are NaN without the third load.
    """
    parts = np.array([phase.stiffness_parts for phase in phases])
    energies = np.einsum("pxij,piaja->pxa", parts, products)
    moduli = np.full((len(phases), 2, 3), np.nan)
    # The loads give C11 + C12, C33 and C11 − C12 in this order. Energy over |load|² is the modulus:
    # 2 s² (C11 + C12) over 2 s² for (s, s, 0), 4 s² C33 over 4 s² for (0, 0, 2 s), and 2 s² (C11 −
    # C12) over 2 s² for (s, −s, 0).
    columns = [0, 2, 1][: len(loads)]
    moduli[..., columns] = energies / (loads**2).sum(axis=1)
    return moduli
