"""The product space by its slices: plane cells at the Gauss points of the layers.

The form has no derivative along θ, so that eq. 7 is a sum over slices s at θ_s,

    a(u, v) = Σ_s ∫ w_s C ε(u) : ε(v) dx,    w_s = f_Θ(θ_s) dθ,

which DOLFINx assembles on plane triangles. Its mesh is the slices of one layer and moves from layer
to layer; `LayerConstraint` says what displacements of the prisms are there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.rve.cell.cell import AREA
from alphacut.rve.fenicsx import MPI, PETSc, basix, fem, mesh_of, ufl
from alphacut.rve.mesh.prism_grid import PrismGrid
from alphacut.rve.mesh.wedge import (
    POINTS_PER_SLICE,
    SLICES_PER_LAYER,
    prism_rule,
    slice_weights,
)
from alphacut.rve.prism.problem import (
    SliceStrains,
    positive_density,
    require_valid_elements,
)
from alphacut.rve.solver.form import CellForm, PointStrains
from alphacut.rve.solver.krylov import SolverOptions, krylov_solver
from alphacut.rve.solver.layers import LayerConstraint, LayerMatrix, layer_interpolation
from alphacut.rve.solver.numbering import LevelNumbering
from alphacut.rve.solver.theta_preconditioner import ThetaPreconditioner
from alphacut.stochastic import RadiusMap
from alphacut.stochastic.theta.quadrature import level_rule

BASIX_ORDER = [0, 1, 2, 5, 4, 3]
"""Nodes of `Triangulation.triangles` in Basix's order, whose edge k lies opposite vertex k."""


class SliceProblem:
    """The product-space problem of one mesh on one rank, moved to one map after another.

    Args:
        grid: Prisms whose nodes follow the interface.

    Attributes:
        numbering: Reduced unknowns, in the order of those of `PrismProblem`.
        map: The radius map.
    """

    def __init__(self, grid: PrismGrid) -> None:
        self.grid, self.numbering = grid, LevelNumbering(grid, MPI.COMM_SELF)
        self._preconditioner = ThetaPreconditioner(self.numbering, MPI.COMM_SELF)
        self._options: SolverOptions | None = None  # of this preconditioner
        # mesh: the slices of a layer, one after another
        plane, triangles = grid.plane, grid.plane.triangles[:, BASIX_ORDER]
        nodes = SLICES_PER_LAYER * len(plane.points)
        first_nodes = np.arange(0, nodes, len(plane.points))
        cells = (first_nodes[:, None, None] + triangles).reshape(-1, 6)
        element = basix.ufl.element("P", "triangle", 2, shape=(2,))
        self.mesh = mesh_of(MPI.COMM_SELF, cells, nodes, element)
        self._cell: Ints = np.asarray(self.mesh.topology.original_cell_index)
        self._cell_slice, triangle = np.divmod(self._cell, len(triangles))
        self._phase = grid.phase[triangle]
        # form
        self.space = fem.functionspace(self.mesh, element)
        self._weight = fem.Function(fem.functionspace(self.mesh, ("DG", 0)))
        stiffness_space = fem.functionspace(self.mesh, ("DG", 0, (3, 3)))
        dx = ufl.Measure("dx", self.mesh, metadata={"quadrature_degree": 4})
        self._form = CellForm(self.space, stiffness_space, dx, self._weight)
        self._matrix = fem.create_matrix(self._form.bilinear)  # of a layer
        points = basix.make_quadrature(basix.CellType.triangle, 4)[0]
        self._strains = PointStrains(self.space, points)
        # constraint
        geometry_nodes = self.mesh.geometry.input_global_indices
        space_nodes: Ints = np.empty(nodes, int)
        space_nodes[self.space.dofmap.list] = geometry_nodes[self.mesh.geometry.dofmap]
        heights = prism_rule()[0][::POINTS_PER_SLICE, 2]
        self._interpolation = layer_interpolation(plane, heights)[geometry_nodes]
        self._constraint = LayerConstraint(
            self.numbering, heights, space_nodes, self._matrix.to_scipy()
        )

    def move(self, radius_map: RadiusMap) -> None:
        """Move the slices to the interface r(θ) of a map.

        Raises:
            FoldedMeshError: An element is inverted.
            RefusedError: The density of θ is not positive at a quadrature point.
        """
        grid, law, self.map = self.grid, radius_map.distribution, radius_map
        self._rule = level_rule(law, grid.level_thetas(law), points=SLICES_PER_LAYER)
        positive_density(law, self._rule.nodes)
        levels, mid_levels = grid.positions_by_level(radius_map)
        by_layer = np.concatenate([levels[:-1], mid_levels, levels[1:]], axis=1)
        self._positions = [self._interpolation @ positions for positions in by_layer]
        determinants = np.array([self._strains.determinants() for _ in self._layers()])
        self._areas = determinants * slice_weights()[0]  # (layers, cells, points)
        sorted_areas = self._areas[:, np.argsort(self._cell)]
        by_slice = sorted_areas.reshape(grid.layers, SLICES_PER_LAYER, -1, POINTS_PER_SLICE)
        of_prisms = by_slice.swapaxes(1, 2).reshape(-1, SLICES_PER_LAYER, POINTS_PER_SLICE)
        require_valid_elements(grid, of_prisms)

    def _layers(self) -> Iterator[int]:
        """Move mesh and weights w_s to each layer in turn, and yield its number."""
        for layer, positions in enumerate(self._positions):
            self.mesh.geometry.x[:, :2] = positions
            self._weight.x.array[:] = self._rule.weights[self._slices(layer)]
            yield layer

    def _slices(self, layer: int) -> Ints:
        """Return the number of each cell's slice among those of all layers."""
        return np.asarray(layer * SLICES_PER_LAYER + self._cell_slice)

    def assemble(self, stiffness: Sequence[Array]) -> PETSc.Mat:
        """Return the reduced stiffness of eq. 7 for the stiffness of the phases, in Pa."""
        self._form.stiffness.x.array[:] = np.array(stiffness)[self._phase].ravel()
        values = self._constraint.empty_values()
        for layer in self._layers():
            self._matrix.set_value(0.0)
            fem.assemble_matrix(self._matrix, self._form.bilinear)
            self._constraint.set_layer(values[layer], self._matrix.data)
        context, size = LayerMatrix(self._constraint, values), self.numbering.size
        return PETSc.Mat().createPython((size, size), context, comm=PETSc.COMM_SELF)

    def loads(self, strains: Array) -> list[PETSc.Vec]:
        """Reduced forces −⟨Bᵀ C ε̄⟩ of macroscopic strains (loads, 3), for the phases as set."""
        by_layer = [[self._form.load(strain) for strain in strains] for _ in self._layers()]
        Q, loads = self._constraint.matrix, []
        for forces in np.array(by_layer).swapaxes(0, 1):
            on_slices, load = Q.createVecLeft(), Q.createVecRight()
            on_slices.array[:] = forces.ravel()
            Q.multTranspose(on_slices, load)
            loads.append(load)
        return loads

    def solver(self, options: SolverOptions, matrix: PETSc.Mat, *, loads: int) -> PETSc.KSP:
        """Return PETSc's solver of an assembled stiffness for some loads at once.

        That of an earlier stiffness is spent. The solver's tolerance is that of each load: where
        all have norm 1, |r_j| ≤ |r| ≤ rtol / √n · √n for the residual r of n loads together.
        """
        if options != self._options:
            self._preconditioner = ThetaPreconditioner(self.numbering, MPI.COMM_SELF)
            self._options = options
        blocks = matrix.getPythonContext().level_blocks()
        law, preconditioner = self.map.distribution, self._preconditioner
        ksp = krylov_solver(
            repeated(matrix, loads), options, lambda: preconditioner.set_up(law, blocks)
        )
        ksp.setTolerances(rtol=ksp.getTolerances()[0] / loads**0.5)
        return ksp

    def slice_strains(
        self, strains: Array, fluctuations: Sequence[PETSc.Vec | None]
    ) -> SliceStrains:
        """Return integrals over the slices of fields ε̄ + ε(u): n of ε̄, (n, 3), and n of u.

        None is no u.
        """
        rule, count, Q = self._rule, len(strains), self._constraint.matrix
        on_slices = np.zeros((count, self.grid.layers, Q.size[0] // self.grid.layers))
        for k, vector in enumerate(fluctuations):
            if vector is not None:
                u = Q.createVecLeft()
                Q.mult(vector, u)
                on_slices[k] = u.array.reshape(on_slices.shape[1:])
        is_phase = np.equal.outer(np.arange(len(self.grid.names)), self._phase)[..., None]
        integrals = SliceStrains.zeros(rule, phases=len(is_phase), fields=count)
        values = np.empty((len(self._cell), POINTS_PER_SLICE, 3, count))
        for layer in self._layers():
            for k, vector in enumerate(fluctuations):
                values[..., k] = strains[k]
                if vector is not None:
                    values[..., k] += self._strains(on_slices[k, layer])
            areas = is_phase * self._areas[layer] / AREA
            integrals.add(values, areas, self._slices(layer))
        return integrals


def repeated(matrix: PETSc.Mat, times: int) -> PETSc.Mat:
    """Return a stiffness as operator on several fields, one after another in a vector."""
    size = times * matrix.size[0]
    return PETSc.Mat().createPython((size, size), matrix.getPythonContext(), comm=PETSc.COMM_SELF)
