"""The product-space cell problem of one grid: constraints, solutions, and means over slices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import AREA
from alphacut.rve.fenicsx import MPI, PETSc, fem, petsc
from alphacut.rve.form import ALL_PARTS
from alphacut.rve.mesh.prism_grid import PrismGrid
from alphacut.rve.mesh.wedge import POINTS_PER_SLICE, SLICES_PER_LAYER
from alphacut.rve.prism.form import PrismForm
from alphacut.rve.solver.krylov import krylov_solver
from alphacut.rve.solver.numbering import (
    LevelNumbering,
    NodeScatter,
    map_of,
    reduced_vector,
    zero_matrix,
)
from alphacut.rve.solver.options import SolverOptions
from alphacut.stochastic import RadiusMap


@dataclass(frozen=True)
class SliceStrains:
    """Mean strains of the slices at the Gauss points of the layers, apart by phase.

    Args:
        theta: θ of the slices, shape (n,).
        weights: Weights of the slices, sum 1, shape (n,).
        strain: ⟨(ε11, ε22, 2 ε12)⟩ over the parts of the cell that the phases take, in the area of
            the cell, shape (phases, n, 3, fields).
        fractions: Area fractions of the phases, shape (phases, n).
        products: Mean of ε_a ⊗ ε_b over the phases and θ, shape (phases, 3, fields, 3, fields).
    """

    theta: Array
    weights: Array
    strain: Array
    fractions: Array
    products: Array

    def combined(self, coefficients: Array) -> SliceStrains:
        """Those of sums of the fields, coefficients (fields, loads)."""
        products = np.einsum("piajb,ak,bl->pikjl", self.products, coefficients, coefficients)
        return SliceStrains(
            self.theta, self.weights, self.strain @ coefficients, self.fractions, products
        )

    def stress(self, stiffness: Sequence[Array]) -> Array:
        """Homogenised (σ11, σ22, σ12), shape (n, 3, fields), in Pa, for the phases' stiffness."""
        stresses = [matrix @ strain for matrix, strain in zip(stiffness, self.strain, strict=True)]
        return np.asarray(sum(stresses))

    def energy(self, stiffness: Sequence[Array]) -> Array:
        """Mean of σ_a : ε_b over cell and θ, shape (fields, fields), in Pa."""
        return np.asarray(np.einsum("pij,piajb->ab", np.array(stiffness), self.products))

    def energy_parts(self, stiffness_parts: Sequence[Array]) -> Array:
        """Mean of σ_a : ε_a by K and G of each phase, shape (phases, 2, fields), in Pa.

        Args:
            stiffness_parts: What K and G give to the phases' stiffness, (2, 3, 3) each.
        """
        parts = np.array(stiffness_parts)
        return np.asarray(np.einsum("pxij,piaja->pxa", parts, self.products))


class PrismProblem:
    """The product-space problem of one grid; map and phases are set anew for each sample.

    Args:
        grid: Topology.
        comm: Communicator; its ranks share the prisms and the levels.

    Attributes:
        form: Mesh and form.
        numbering: Reduced unknowns.
        map: The radius map.
        matrix: The reduced stiffness.
        local_map: Nodes of this rank to pairs of reduced unknowns.
    """

    def __init__(self, grid: PrismGrid, comm: MPI.Intracomm) -> None:
        self.comm = comm
        self.form = PrismForm(grid, comm)
        self.numbering = LevelNumbering(grid, comm)
        pairs, rows = self.numbering.pairs, self.numbering.rows
        self.local_map = map_of(pairs[self.form.node], comm)
        layers = grid.cells.reshape(grid.layers, -1, grid.cells.shape[1])
        cells = layers[self.numbering.layers].reshape(-1, layers.shape[-1])
        self.matrix = zero_matrix(pairs[cells], self.local_map, rows, self.numbering.size)
        self._to_nodes = NodeScatter(pairs[self.form.node], self.matrix.createVecRight())

    def move(self, radius_map: RadiusMap, thickness: float = 0.0) -> None:
        """Move the nodes to the interface r(θ) of a map and mark the particle (eq. 13, 14).

        Args:
            radius_map: Radius of the particle over θ.
            thickness: Of the interphase, of a grid that has one.

        Raises:
            FoldedMeshError: An element is inverted.
            RefusedError: The density of θ is not positive everywhere.
        """
        self.map, self.thickness = radius_map, thickness
        self.form.move_to(radius_map, thickness)

    def assemble(self, stiffness: Sequence[Array], parts: slice = ALL_PARTS) -> PETSc.Mat:
        """Assemble the reduced stiffness of eq. 7 into `self.matrix`, which is returned.

        Args:
            stiffness: Of the phases in the order of the grid, (3, 3) each.
            parts: Of the mesh: all, or one phase alone.
        """
        self.form.elastic.set_phases(stiffness)
        self.matrix.zeroEntries()
        self.form.elastic.add_stiffness(self.matrix, parts)
        return self.matrix

    def loads(self, strains: Array, parts: slice = ALL_PARTS) -> list[PETSc.Vec]:
        """Reduced forces −⟨Bᵀ C ε̄⟩ of macroscopic strains (loads, 3), for the phases as set."""
        num_rows, size = len(self.numbering.rows), self.numbering.size
        forces = [self.form.elastic.load(strain, parts) for strain in strains]
        return [reduced_vector(force, self.local_map, num_rows, size) for force in forces]

    def solver(self, options: SolverOptions, matrix: PETSc.Mat | None = None) -> PETSc.KSP:
        """PETSc solver of the assembled stiffness, or of another symmetric operator.

        Args:
            options: PETSc options.
            matrix: Reduced operator from `assemble_operator`.
        """
        operator = self.matrix if matrix is None else matrix
        return krylov_solver(operator, self.numbering, self.map.distribution, options)

    def assemble_operator(self, form: fem.Form) -> PETSc.Mat:
        """Reduced matrix Pᵀ A P of a bilinear form of the user on `form.space`."""
        matrix = self.matrix.duplicate()
        for option in (PETSc.Mat.Option.SPD, PETSc.Mat.Option.SYMMETRIC):  # not known of this form
            matrix.setOption(option, False)
        petsc.assemble_matrix(matrix, form)
        matrix.assemble()
        return matrix

    def assemble_forces(self, form: fem.Form) -> PETSc.Vec:
        """Reduced vector Pᵀ b of a linear form of the user on `form.space`."""
        values, numbering = fem.assemble_vector(form).array, self.numbering
        return reduced_vector(values, self.local_map, len(numbering.rows), numbering.size)

    def field(self, vector: PETSc.Vec) -> Array:
        """Displacements of this rank's nodes, shape (nodes, 2), from reduced unknowns."""
        return self._to_nodes(vector)

    def slice_strains(self, fields: Sequence[tuple[Array, Array | None]]) -> SliceStrains:
        """Mean strains of slices by phase, area fractions and mean products, summed over ranks.

        Args:
            fields: Macroscopic strain (3,) and fluctuation (nodes, 2) of each; None is no
                fluctuation.
        """
        form, count = self.form, len(fields)
        strain = np.empty((len(form.wedge), SLICES_PER_LAYER, POINTS_PER_SLICE, 3, count))
        for k, (uniform, u) in enumerate(fields):
            strain[..., k] = uniform if u is None else form.strains(u) + uniform
        areas = form.phase_areas() / AREA  # (phases, cells, 3, points)
        prism_means = np.einsum("pmsq,msqif->pmsif", areas, strain)
        means = np.stack([form.sum_by_layer(phase_means) for phase_means in prism_means])
        fractions = np.stack([form.sum_by_layer(phase.sum(axis=-1)) for phase in areas])
        theta, weights = form.slice_rule()
        point_weights = form.at_prisms(weights)[None, :, :, None] * areas
        flat = strain.reshape(-1, 3 * count)
        products = np.array([flat.T @ (phase.reshape(-1, 1) * flat) for phase in point_weights])
        means, fractions, products = map(self.comm.allreduce, (means, fractions, products))
        phases = len(areas)
        return SliceStrains(
            theta=theta,
            weights=weights,
            strain=means.reshape(phases, -1, 3, count),
            fractions=fractions.reshape(phases, -1),
            products=products.reshape(phases, 3, count, 3, count),
        )
