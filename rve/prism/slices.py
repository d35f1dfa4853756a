"""The product space by its slices: plane cells at the Gauss points of the layers.

The form has no derivative along θ, so that eq. 7 is a sum over slices s at θ_s,

    a(u, v) = Σ_s ∫ w_s C ε(u) : ε(v) dx,    w_s = f_Θ(θ_s) dθ,

which DOLFINx assembles on plane triangles. Its mesh is the slices of one layer and moves from layer
to layer; `LayerConstraint` says which displacements of the prisms are possible there.

`solve_sample` is the whole way from the mesh to the mean strains.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.rve.fenicsx import MPI, PETSc, basix, fem, mesh_of, ufl
from alphacut.rve.mesh.prism_grid import NAMES, PrismGrid
from alphacut.rve.mesh.wedge import (
    POINTS_PER_SLICE,
    SLICES_PER_LAYER,
    prism_rule,
    slice_weights,
)
from alphacut.rve.prism.problem import (
    SliceStrains,
    Solved,
    positive_density,
    require_valid_elements,
)
from alphacut.rve.solver.form import CellForm, PointStrains
from alphacut.rve.solver.krylov import SolverOptions, krylov_solver, solve
from alphacut.rve.solver.layers import (
    LayerConstraint,
    LayerMatrix,
    LayerPattern,
    layer_interpolation,
)
from alphacut.rve.solver.numbering import LevelNumbering
from alphacut.rve.solver.theta_preconditioner import ThetaPreconditioner
from alphacut.stochastic import RadiusMap
from alphacut.stochastic.theta.quadrature import level_rule

INCLUSION = NAMES.index("inclusion")
"""Index of the inclusion among the phases."""


def solve_sample(
    grid: PrismGrid,
    radius_map: RadiusMap,
    stiffness: Sequence[Array],
    strains: Array,
    *,
    options: SolverOptions,
) -> Solved:
    """Homogenise one cell: solve eq. 7 under some macroscopic strains, and average over slices.

    Eq. 7 is Σ_s ∫ w_s C (ε̄ + ε(u)) : ε(v) dx = 0 for all v, a sum over slices at fixed θ_s. u and
    v are displacements of prisms on cell × θ, periodic and zero at one corner. Mesh, constraint and
    form depend on the grid alone and are kept for the next sample.

    Args:
        grid: Prisms whose nodes follow the interface.
        radius_map: Radius of the particle over θ, with the distribution of θ.
        stiffness: Stiffness C of each phase (matrix, inclusion) in Voigt order (11, 22, 12 with 2
            ε12), (3, 3) each, in Pa.
        strains: Macroscopic strains ε̄ = (ε11, ε22, 2 ε12), shape (loads, 3).
        options: PETSc's options, the ones of the default solver included.

    Returns:
        Mean strains of each phase on each slice, the iterations for each load, the largest relative
        residual, and the number of unknowns.

    Raises:
        FoldedMeshError: An element is inverted where the mesh follows the map.
        RefusedError: The density of θ is not positive, or PETSc does not use an option.
        ConvergenceError: The tolerance of the residual, relative to the load, was not reached.
    """
    mesh = slice_mesh(grid)
    mesh.move(radius_map)
    constraint = layer_constraint(mesh)  # u = Q x: periodic, zero at one corner
    form = slice_form(mesh)  # a(u, v) = Σ_s ∫ w_s C ε(u) : ε(v) dx
    problem = SliceProblem(mesh, constraint, form)

    matrix = problem.matrix(problem.blocks(form, stiffness))  # K = Qᵀ A Q of a(u, v)
    loads = problem.loads(form, strains)  # F = Qᵀ f of −Σ_s ∫ w_s C ε̄ : ε(v) dx

    solver = problem.solver(options, matrix, loads=len(loads))
    solutions = solve(solver, loads)  # K x = F

    means = problem.slice_strains(strains, solutions.vectors)  # of ε̄ + ε(Q x)
    return Solved(means, solutions.iterations, solutions.residual, problem.numbering.size)


class SliceMesh:
    """DOLFINx's mesh of the slices of one layer, moved to a map and from layer to layer.

    Args:
        grid: Prisms whose nodes follow the interface.

    Attributes:
        grid: The prisms.
        numbering: Reduced unknowns, in the order of those of `PrismProblem`.
        map: The radius map of the last call of `move`.
        mesh: DOLFINx's mesh of six-node triangles, slice after slice.
        space: Displacements of two components on the mesh.
        stiffness_space: Matrices (3, 3) in the cells.
        dx: Measure of all cells; its part `INCLUSION` is that of the inclusion.
        point_strains: Strains at the quadrature points of the cells.
        weight: w_s of eq. 7 in the cells, for the layer where the mesh is.
        phase: Index of the phase of each cell, shape (cells,).
        heights: Height ζ of each slice in its layer, inside (0, 1), shape (3,).
        node: Number of each node of `space`: slice after slice, and within each as in the plane
            mesh; shape (nodes,).
        interpolation: Matrix from nodal values of a layer of prisms to those at the nodes of
            `space`.
        rule: Nodes θ_s and weights w_s of the slices of all layers.
        areas: Quadrature weights of the points of the triangles in their slice, whose sum is the
            area of the cell, shape (layers, triangles, points).
    """

    def __init__(self, grid: PrismGrid) -> None:
        self.grid = grid
        self.numbering = LevelNumbering(grid, MPI.COMM_SELF)
        plane = grid.plane
        # Basix numbers the edges of a triangle by the opposite vertex; `Triangulation.triangles`
        # has the midpoints of edges (0, 1), (0, 2), (1, 2).
        triangles = plane.triangles[:, [0, 1, 2, 5, 4, 3]]
        num_nodes = SLICES_PER_LAYER * len(plane.points)
        first_of_slice = np.arange(0, num_nodes, len(plane.points))
        cells = first_of_slice[:, np.newaxis, np.newaxis] + triangles
        element = basix.ufl.element("P", "triangle", 2, shape=(2,))
        self.mesh = mesh_of(MPI.COMM_SELF, cells.reshape(-1, 6), num_nodes, element)
        self._cell: Ints = np.asarray(self.mesh.topology.original_cell_index)
        self._cell_slice, triangle = np.divmod(self._cell, len(triangles))
        self.phase = grid.phase[triangle]

        self.space = fem.functionspace(self.mesh, element)
        self.weight = fem.Function(fem.functionspace(self.mesh, ("DG", 0)))
        self.stiffness_space = fem.functionspace(self.mesh, ("DG", 0, (3, 3)))
        # A rule of degree 4 has the six points of a slice of the prisms' rule. It is exact for
        # products of two strains, of degree 1 each on straight triangles, with some reserve for
        # curved ones.
        degree = 4
        inclusion_cells = np.flatnonzero(self.phase == INCLUSION).astype(np.int32)
        self.dx = ufl.Measure(
            "dx",
            self.mesh,
            subdomain_data=[(INCLUSION, inclusion_cells)],
            metadata={"quadrature_degree": degree},
        )
        points, _ = basix.make_quadrature(basix.CellType.triangle, degree)
        self.point_strains = PointStrains(self.space, points)

        geometry = self.mesh.geometry
        self.heights = prism_rule()[0][::POINTS_PER_SLICE, 2]
        interpolation = layer_interpolation(plane, self.heights)
        self._geometry_interpolation = interpolation[geometry.input_global_indices]
        self.node: Ints = np.empty(num_nodes, int)
        # Both lists of a cell's nodes are in Basix's order, that of the space and the geometry's.
        self.node[self.space.dofmap.list] = geometry.input_global_indices[geometry.dofmap]
        self.interpolation = interpolation[self.node]

    def move(self, radius_map: RadiusMap) -> None:
        """Move the slices of all layers to the interface r(θ) of a radius map.

        It sets `map`, `rule` (nodes and weights in θ) and `areas`. After an error the mesh must be
        moved again before use.

        Args:
            radius_map: Radius of the particle over θ, with the distribution of θ.

        Raises:
            FoldedMeshError: An element is inverted.
            RefusedError: The density of θ is not positive at a quadrature point.
        """
        grid = self.grid
        distribution = radius_map.distribution
        self.map = radius_map
        self.rule = level_rule(
            distribution, grid.level_thetas(distribution), points=SLICES_PER_LAYER
        )
        positive_density(distribution, self.rule.nodes)
        levels, mid_levels = grid.positions_by_level(radius_map)
        # Nodes of each layer of prisms: of the level below, of the mid-level, of the level above.
        # The interpolation leads from them to the nodes of the layer's slices.
        by_layer = np.concatenate([levels[:-1], mid_levels, levels[1:]], axis=1)
        self._positions = [self._geometry_interpolation @ positions for positions in by_layer]
        determinants = [self.point_strains.determinants() for _ in self.layers()]
        self.areas = np.array(determinants) * slice_weights()[0]
        # DOLFINx reorders cells; `_cell` undoes it. Then areas are sorted by prism: (prisms,
        # slices, points).
        sorted_areas = self.areas[:, np.argsort(self._cell)]
        by_slice = sorted_areas.reshape(grid.layers, SLICES_PER_LAYER, -1, POINTS_PER_SLICE)
        by_prism = by_slice.swapaxes(1, 2).reshape(-1, SLICES_PER_LAYER, POINTS_PER_SLICE)
        require_valid_elements(grid, by_prism)

    def layers(self) -> Iterator[int]:
        """Move the mesh and `weight` to each layer in turn, and yield the number of the layer."""
        for layer, positions in enumerate(self._positions):
            self.mesh.geometry.x[:, :2] = positions
            self.weight.x.array[:] = self.rule.weights[self.slices(layer)]
            yield layer

    def slices(self, layer: int) -> Ints:
        """Return the number of each cell's slice among those of all layers, shape (cells,)."""
        return np.asarray(layer * SLICES_PER_LAYER + self._cell_slice)


@lru_cache(maxsize=2)
def slice_mesh(grid: PrismGrid) -> SliceMesh:
    """Return the mesh of the slices of a layer; that of the last two grids is kept."""
    return SliceMesh(grid)


@lru_cache(maxsize=2)
def layer_constraint(mesh: SliceMesh) -> LayerConstraint:
    """Return the constraint of displacements on the slices of a layer, kept with the mesh."""
    return LayerConstraint(mesh.numbering, mesh.heights, mesh.interpolation, mesh.node)


@lru_cache(maxsize=2)
def slice_form(mesh: SliceMesh) -> CellForm:
    """Return the form of eq. 7 on the slices of a layer, kept with the mesh."""
    return CellForm(mesh.space, mesh.stiffness_space, mesh.dx, mesh.weight)


@lru_cache(maxsize=2)
def inclusion_form(mesh: SliceMesh) -> CellForm:
    """Return the integrals of `slice_form` over the inclusion alone, kept with the mesh."""
    return CellForm(mesh.space, mesh.stiffness_space, mesh.dx(INCLUSION), mesh.weight)


@lru_cache(maxsize=2)
def _layer_matrix(
    constraint: LayerConstraint, form: CellForm
) -> tuple[fem.MatrixCSR, LayerPattern]:
    """Return DOLFINx's matrix of a layer, and its pattern."""
    matrix = fem.create_matrix(form.bilinear)
    return matrix, LayerPattern(constraint, matrix.to_scipy())


@lru_cache(maxsize=2)
def _preconditioner(numbering: LevelNumbering, _options: str) -> ThetaPreconditioner:
    """Return a preconditioner, which keeps its symbolic factors while the options are the same."""
    return ThetaPreconditioner(numbering, MPI.COMM_SELF)


@dataclass(frozen=True, eq=False)
class SliceProblem:
    """The discrete problem of eq. 7 over slices.

    Args:
        mesh: The slices, moved to a map.
        constraint: Which displacements of the slices the unknowns x of the prisms have.
        form: The form on the slices of a layer.
    """

    mesh: SliceMesh
    constraint: LayerConstraint
    form: CellForm

    @classmethod
    def of_grid(cls, grid: PrismGrid) -> SliceProblem:
        """Return the problem of a grid, whose mesh is still to be moved."""
        mesh = slice_mesh(grid)
        return cls(mesh, layer_constraint(mesh), slice_form(mesh))

    @property
    def numbering(self) -> LevelNumbering:
        """The reduced unknowns."""
        return self.mesh.numbering

    def blocks(self, form: CellForm, stiffness: Sequence[Array]) -> Array:
        """Return the blocks of 2 × 2 entries that DOLFINx assembles over the slices of each layer.

        Args:
            form: The form of this problem, or `inclusion_form` of its mesh, which has the same
                pattern. The stiffness stays set in it, for `loads`.
            stiffness: Stiffness of the phases (matrix, inclusion) in Voigt order, (3, 3) each, in
                Pa.

        Returns:
            Blocks of the matrices of the layers, row by row, shape (layers, blocks, 4). Which nodes
            a block couples is the pattern of DOLFINx's matrix, the same for all layers.
        """
        form.stiffness.x.array[:] = np.array(stiffness)[self.mesh.phase].ravel()
        layer_matrix, pattern = _layer_matrix(self.constraint, self.form)
        blocks = np.empty((self.mesh.grid.layers, pattern.num_blocks, 4))
        for layer in self.mesh.layers():
            layer_matrix.set_value(0.0)
            fem.assemble_matrix(layer_matrix, form.bilinear)
            blocks[layer] = layer_matrix.data.reshape(-1, 4)
        return blocks

    def matrix(self, blocks: Array) -> PETSc.Mat:
        """Return the reduced stiffness K = Σ Qᵀ A_k Q, an operator, from the blocks of A_k."""
        _, pattern = _layer_matrix(self.constraint, self.form)
        size = self.numbering.size
        context = LayerMatrix(pattern, blocks)
        return PETSc.Mat().createPython((size, size), context, comm=PETSc.COMM_SELF)

    def loads(self, form: CellForm, strains: Array) -> list[PETSc.Vec]:
        """Return the reduced forces of macroscopic strains, one vector for each.

        Args:
            form: The form of this problem or `inclusion_form`, with the stiffness that was set
                last.
            strains: Macroscopic strains (ε11, ε22, 2 ε12), shape (loads, 3).
        """
        by_layer = [[form.load(strain) for strain in strains] for _ in self.mesh.layers()]
        forces = self.constraint.forces(np.array(by_layer).swapaxes(0, 1))
        return [PETSc.Vec().createWithArray(load, comm=PETSc.COMM_SELF) for load in forces]

    def solver(self, options: SolverOptions, matrix: PETSc.Mat, *, loads: int) -> PETSc.KSP:
        """Return PETSc's solver of an assembled stiffness for some loads at once.

        The preconditioner is shared by all solvers for the same grid and options, and is factorised
        anew here. So a solver that was made before can no longer be used.

        Args:
            options: PETSc's options, the ones of the default solver included.
            matrix: Stiffness, as `matrix` of this problem returns it.
            loads: Number of loads; vectors of the solver hold them one after another.

        Raises:
            RefusedError: PETSc does not use one of the options.
            ConvergenceError: A factorisation failed though no option overrides the default.
        """
        preconditioner = _preconditioner(self.numbering, str(options))
        blocks = matrix.getPythonContext().level_blocks()
        distribution = self.mesh.map.distribution
        ksp = krylov_solver(
            repeated(matrix, loads), options, lambda: preconditioner.set_up(distribution, blocks)
        )
        # The tolerance rtol must hold for each load j of n that are solved together. Each load has
        # norm 1, all together √n. So with rtol / √n the residual is |r_j| ≤ |r| ≤ (rtol / √n) · √n
        # = rtol.
        ksp.setTolerances(rtol=ksp.getTolerances()[0] / loads**0.5)
        return ksp

    def slice_strains(
        self, strains: Array, fluctuations: Sequence[PETSc.Vec | None]
    ) -> SliceStrains:
        """Return integrals over the slices of the strains ε̄ + ε(u) of some fields.

        Args:
            strains: Macroscopic strain ε̄ = (ε11, ε22, 2 ε12) of each field, shape (fields, 3).
            fluctuations: Reduced unknowns of u of each field; None where u is zero. At least one is
                not None.

        Returns:
            Mean strains, area fractions and means of products of strains by phase (matrix,
            inclusion), divided by the area of the cell.
        """
        mesh = self.mesh
        count = len(strains)
        vectors = {field: u for field, u in enumerate(fluctuations) if u is not None}
        unknowns = np.array([vector.array_r for vector in vectors.values()])
        displacements = self.constraint.displacements(unknowns)
        phases = np.arange(len(mesh.grid.names))
        is_phase = np.equal.outer(phases, mesh.phase)[..., np.newaxis]
        integrals = SliceStrains.zeros(mesh.rule, phases=len(phases), fields=count)
        for layer in mesh.layers():
            values: Array = np.empty((*mesh.areas.shape[1:], 3, count))
            # The macroscopic strain is the same everywhere; fields without u have it alone.
            values[:] = strains.T
            for number, field in enumerate(vectors):
                values[..., field] += mesh.point_strains(displacements[number, layer])
            areas = is_phase * mesh.areas[layer] / mesh.grid.plane.lattice.area
            integrals.add(values, areas, mesh.slices(layer))
        return integrals


def repeated(matrix: PETSc.Mat, times: int) -> PETSc.Mat:
    """Return a stiffness as operator on several fields, one after another in a vector."""
    # The matrix has no entries but a Python object that multiplies, which takes as many fields as
    # the vector holds; only the sizes must fit.
    size = times * matrix.size[0]
    return PETSc.Mat().createPython((size, size), matrix.getPythonContext(), comm=PETSc.COMM_SELF)
