"""The product-space cell problem of one grid: form, constraints, solutions, means over slices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import FailedError, RefusedError
from alphacut.rve.cell.outline import is_round
from alphacut.rve.fenicsx import MPI, PETSc, basix, fem, mesh_of, petsc, ufl
from alphacut.rve.mesh.curved import MIN_JACOBIAN_RATIO
from alphacut.rve.mesh.prism_grid import LevelSet, PrismGrid
from alphacut.rve.mesh.wedge import (
    POINTS_PER_SLICE,
    SLICES_PER_LAYER,
    prism_rule,
    slice_weights,
    wedge,
)
from alphacut.rve.solver.form import CellForm, PointStrains, strain_products
from alphacut.rve.solver.krylov import SolverOptions, krylov_solver, solve
from alphacut.rve.solver.numbering import Elimination, LevelNumbering
from alphacut.rve.solver.theta_preconditioner import ThetaPreconditioner, level_blocks
from alphacut.stochastic import RadiusMap, ThetaDistribution
from alphacut.stochastic.theta.quadrature import ThetaRule, level_rule


class FoldedMeshError(FailedError):
    """The mesh folds over where it follows a map."""


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

    @classmethod
    def zeros(cls, rule: ThetaRule, *, phases: int, fields: int) -> SliceStrains:
        """Return integrals over no part of the cell, to which `add` adds those over triangles.

        Args:
            rule: Nodes and weights in θ; a slice is the plane cell at one node.
            phases: Number of phases.
            fields: Number of strain fields.

        Returns:
            θ and weights of the slices, and zeros for mean strains, area fractions and products.
        """
        slices = len(rule.nodes)
        return cls(
            rule.nodes,
            rule.weights,
            strain=np.zeros((phases, slices, 3, fields)),
            fractions=np.zeros((phases, slices)),
            products=np.zeros((phases, 3, fields, 3, fields)),
        )

    def add(self, strain: Array, areas: Array, slices: Ints) -> None:
        """Add the integrals over some triangles of the slices, the plane cells at fixed θ.

        `strain`, `fractions` and `products` are changed in place.

        Args:
            strain: (ε11, ε22, 2 ε12) at the quadrature points of the triangles, shape (triangles,
                points, 3, fields).
            areas: Weights of the points in each phase, divided by the area of the cell, shape
                (phases, triangles, points); 0 where a point is in another phase.
            slices: Number of each triangle's slice, an index of the rule in θ, shape (triangles,).
        """
        for phase in range(len(areas)):
            phase_areas: Array = areas[phase]
            # Only triangles with a part in this phase are used. Most triangles lie in one phase, so
            # they are used once and not once for each phase.
            has_phase = phase_areas.any(axis=1)
            points = strain[has_phase]
            weights = phase_areas[has_phase]
            slice_number = slices[has_phase]
            of_triangles = np.einsum("tp,tpif->tif", weights, points)
            np.add.at(self.strain[phase], slice_number, of_triangles)
            np.add.at(self.fractions[phase], slice_number, weights.sum(axis=1))
            theta_weights = self.weights[slice_number, np.newaxis] * weights
            all_points = points.reshape(-1, 3, points.shape[-1])
            self.products[phase] += strain_products(all_points, theta_weights.reshape(1, -1))[0]

    def combined(self, coefficients: Array) -> SliceStrains:
        """Return the strains of sums of the fields, with coefficients of shape (fields, loads)."""
        # Products are quadratic in the fields, so that the coefficients enter twice.
        products = np.einsum("piajb,ak,bl->pikjl", self.products, coefficients, coefficients)
        return replace(self, strain=self.strain @ coefficients, products=products)

    def stress(self, stiffness: Sequence[Array]) -> Array:
        """Return the homogenised (σ11, σ22, σ12) of each slice, shape (n, 3, fields), in Pa.

        `stiffness` is that of each phase, (3, 3), in Pa.
        """
        return np.asarray(np.einsum("pij,pnjf->nif", np.array(stiffness), self.strain))


class Solved(NamedTuple):
    """Solutions of a cell under some loads, as mean strains.

    Args:
        strains: Mean strains under each load.
        iterations: Iterations of the linear solver for each load.
        residual: Largest relative residual.
        unknowns: Number of unknowns of the linear system.
        curve_error: Declared relative error of stresses at a single θ, beside that of their means.
    """

    strains: SliceStrains
    iterations: tuple[int, ...]
    residual: float
    unknowns: int
    curve_error: float = 0.0


def positive_density(distribution: ThetaDistribution, theta: Array) -> Array:
    """Return the probability density of θ at quadrature points, shape (n,).

    Args:
        distribution: Distribution of the random number θ.
        theta: Points inside its support, shape (n,).

    Raises:
        RefusedError: The density is zero, negative or NaN at a point. Slices with weight 0 have no
            stiffness, so the system would be singular.
    """
    density = np.asarray(distribution.pdf(theta))
    if not (density > 0).all():
        key = f"density of θ at {theta[~(density > 0)][0]:.4g}"
        cure = "shorten the support, or take the series"
        raise RefusedError(key, f"{density.min():g}", "positive densities", cure)
    return density


def require_valid_elements(
    grid: PrismGrid, areas: Array, comm: MPI.Intracomm | None = None
) -> None:
    """Raise if elements are inverted, or nearly inverted around an outline that is not a circle.

    The determinant of the Jacobian at each quadrature point must exceed 0, or 0.2 of its mean over
    the element where the outline is no circle: there edges are curved and refined.

    Args:
        grid: The prisms.
        areas: Weights of the quadrature points of the prisms in their slices, with the sign of the
            determinant, shape (prisms, 3 slices, 6 points).
        comm: MPI ranks that have some of the prisms each, all of which must call; None for this
            process alone.

    Raises:
        FoldedMeshError: An element of any rank is inverted, or nearly so around such an outline.
            The error is raised on all ranks.
    """
    determinants = areas / slice_weights()
    means = determinants.mean(axis=(1, 2), keepdims=True)
    least_ratio = 0.0 if is_round(grid.plane.outline) else MIN_JACOBIAN_RATIO
    is_folded = bool(((means <= 0) | (determinants <= least_ratio * means)).any())
    if comm is not None:
        is_folded = bool(comm.allreduce(int(is_folded)))
    if is_folded:
        where = f"where it follows the radius through {grid.layers} layers in θ"
        cure = "take more layers or a smaller mesh size"
        raise FoldedMeshError(f"the mesh folds over {where}", cure)


class PrismProblem:
    """The product-space problem over the prisms of one grid; map and phases are set anew.

    Args:
        grid: Topology; the ranks divide its prisms and its levels among them.
        comm: Communicator.

    Attributes:
        mesh: DOLFINx's mesh.
        space: Displacements, two at each node of a prism.
        node: Number in the grid of each of this rank's nodes, shape (n,).
        wedge: Number in the grid of each of this rank's prisms, shape (m,).
        layer: Layer of each of these prisms, shape (m,).
        dx: Measure of each phase by its name, with the rule of the prisms, for forms of the user.
        density: f_Θ at the quadrature points.
        areas: Weights of the points in their slice, shape (m, 3, points); a slice's sum is the
            area of the cell.
        numbering: Reduced unknowns.
        map: The radius map.
        matrix: The reduced stiffness.
        elimination: From forces on nodes to reduced ones, and from unknowns to displacements.
    """

    def __init__(self, grid: PrismGrid, comm: MPI.Intracomm) -> None:
        self.grid = grid
        self.comm = comm
        self.mesh = mesh_of(comm, grid.cells, grid.nodes, wedge(3))
        self.space = fem.functionspace(self.mesh, wedge(2))
        self.wedge: Ints = np.asarray(self.mesh.topology.original_cell_index)
        self.layer = self.wedge // len(grid.plane.triangles)
        sizes = self.space.dofmap.index_map
        geometry = self.mesh.geometry
        self.node: Ints = np.empty(sizes.size_local + sizes.num_ghosts, np.int64)
        # DOLFINx numbers nodes of the geometry and of the space each in its own way. Both lists of
        # a cell's nodes are in Basix's order, so they are the same nodes entry by entry.
        self.node[self.space.dofmap.list] = geometry.input_global_indices[geometry.dofmap]
        self._compile_forms()

        # The rows of this rank need the prisms of all layers that touch them.
        self.numbering = LevelNumbering(grid, comm)
        pairs = self.numbering.pairs
        by_layer = grid.cells.reshape(grid.layers, -1, grid.cells.shape[1])
        cells = by_layer[self.numbering.layers].reshape(-1, by_layer.shape[-1])
        self.elimination = Elimination(
            pairs[self.node],
            cells=pairs[cells],
            rows=self.numbering.rows,
            size=self.numbering.size,
            comm=comm,
        )
        self.matrix = self.elimination.matrix

    def _compile_forms(self) -> None:
        """Make measures, density, the form of elasticity and strains at the quadrature points.

        They set the attributes `dx`, `density`, `_phases`, `_elastic` and `_strains`. `_phases`
        says whether a phase is at a point, shape (phases, prisms, 1, 1), for prisms of one phase
        each. The values of density and stiffness are set later, by `move` and `assemble`. DOLFINx
        compiles the forms, or takes them from its cache.
        """
        points, weights = prism_rule()
        metadata = {
            "quadrature_rule": "custom",
            "quadrature_points": points,
            "quadrature_weights": weights,
        }
        phase = self.grid.phase[self.wedge]
        numbers = range(len(self.grid.names))
        cells = [(number, np.flatnonzero(phase == number).astype(np.int32)) for number in numbers]
        dx = ufl.Measure("dx", self.mesh, metadata=metadata, subdomain_data=cells)
        self.dx = {name: dx(number) for number, name in enumerate(self.grid.names)}

        def at_points(*shape: int) -> fem.FunctionSpace:
            """Return the space of values, of a shape, at the quadrature points."""
            element = basix.ufl.quadrature_element(
                "prism", value_shape=shape, points=points, weights=weights
            )
            return fem.functionspace(self.mesh, element)

        self.density = fem.Function(at_points())
        self._phases = np.equal.outer(numbers, phase)[..., np.newaxis, np.newaxis]
        # A prism of one phase has one stiffness. One that a level set cuts has two, so that each
        # quadrature point needs its own.
        if self.grid.conforming:
            stiffness_space = fem.functionspace(self.mesh, ("DG", 0, (3, 3)))
        else:
            stiffness_space = at_points(3, 3)
        self._elastic = CellForm(self.space, stiffness_space, dx, self.density)
        self._strains = PointStrains(self.space, points)

    def move(self, radius_map: RadiusMap) -> None:
        """Move the nodes to the interface r(θ) of a map, or mark the particles of a level set.

        It sets `map`, `density` (that of θ at the quadrature points) and `areas` (weights of these
        points in their slice). For a level set z it also sets the phase of each quadrature point,
        which is in the inclusion where z < 0 (eq. 14). After an error the object must be moved
        again before use.

        Args:
            radius_map: Radius of the particle over θ with the distribution of θ, or a level set
                with it. A mesh from a file stays where it is.

        Raises:
            FoldedMeshError: An element is inverted.
            RefusedError: The density of θ is not positive at a quadrature point, or a level set
                does not give numbers or has one sign in the whole cell.
        """
        self.map = radius_map
        positions = self.grid.positions(radius_map)
        geometry = self.mesh.geometry
        geometry.x[:] = positions[geometry.input_global_indices]
        distribution = radius_map.distribution
        levels = self.grid.level_thetas(distribution)
        self._rule = level_rule(distribution, levels, points=SLICES_PER_LAYER)
        density = positive_density(distribution, self._rule.nodes).reshape(-1, SLICES_PER_LAYER)
        self.density.x.array[:] = np.repeat(density[self.layer], POINTS_PER_SLICE)

        # det J of a prism is the determinant of its slice times the height of its layer.
        determinants = self._strains.determinants().reshape(len(self.wedge), SLICES_PER_LAYER, -1)
        heights = np.diff(levels)[self.layer, np.newaxis, np.newaxis]
        self.areas: Array = determinants / heights * slice_weights()
        require_valid_elements(self.grid, self.areas, self.comm)
        if isinstance(radius_map, LevelSet):
            inside = self._sign_of(radius_map, positions) < 0  # eq. 14
            shape = 2, len(inside), SLICES_PER_LAYER, POINTS_PER_SLICE
            self._phases = np.array([~inside, inside]).reshape(shape)

    def _sign_of(self, level_set: LevelSet, positions: Array) -> Array:
        """Return a level set's function at the points of this rank's prisms, shape (prisms, 18).

        Args:
            level_set: The function z(x1, x2, θ), negative in the particles.
            positions: Positions (x1, x2, θ) of all nodes of the grid, shape (nodes, 3).

        Raises:
            RefusedError: It does not give a number at each point, or has one sign at all points of
                all ranks.
        """
        points, _ = prism_rule()
        shapes: Array = wedge(1).tabulate(0, points)[0].reshape(-1, 15)
        nodes = positions[self.grid.cells[self.wedge]]
        values = level_set.values(np.einsum("qn,cnd->cqd", shapes, nodes))
        # A rank may have no prisms, or prisms of one phase alone.
        lowest = self.comm.allreduce(float(values.min(initial=np.inf)), MPI.MIN)
        highest = self.comm.allreduce(float(values.max(initial=-np.inf)), MPI.MAX)
        level_set.require_both_signs(lowest, highest)
        return values

    def assemble(self, stiffness: Sequence[Array]) -> PETSc.Mat:
        """Assemble the reduced stiffness Pᵀ A P of a(u, v) = ∫ f_Θ C ε(u) : ε(v) dx dθ.

        P leads from the unknowns (periodic, zero at one corner) to displacements of nodes; f_Θ is
        the density of θ. Each call overwrites and returns the same matrix. The stiffness of the
        phases stays set in the form, where `loads` takes it from.

        Args:
            stiffness: Stiffness C of each phase in Voigt order (11, 22, 12 with 2 ε12), (3, 3)
                each, in Pa, in the order of the grid's names (of a level set matrix, inclusion).
        """
        # `_phases` is 1 in the phase and 0 else, shape (phases, prisms, 1, 1), or of a level set
        # (phases, prisms, slices, points). The sum picks the phase's stiffness (eq. 13).
        at_points = np.tensordot(self._phases, np.array(stiffness), axes=(0, 0))
        self._elastic.stiffness.x.array[:] = at_points.ravel()
        self._elastic.assemble(self.matrix)
        return self.matrix

    def loads(self, strains: Array) -> list[PETSc.Vec]:
        """Return the reduced forces of macroscopic strains, (loads, 3), for the phases as set."""
        return [self.elimination.forces(self._elastic.load(strain)) for strain in strains]

    def solver(self, options: SolverOptions, matrix: PETSc.Mat) -> PETSc.KSP:
        """Return PETSc's solver of a reduced symmetric operator, for loads one after another."""
        return krylov_solver(matrix, options, lambda: self.preconditioner(matrix))

    def preconditioner(self, matrix: PETSc.Mat) -> ThetaPreconditioner:
        """Return the preconditioner along θ of an assembled reduced operator."""
        preconditioner = ThetaPreconditioner(self.numbering, self.comm)
        return preconditioner.set_up(self.map.distribution, level_blocks(matrix, self.numbering))

    def assemble_operator(self, form: fem.Form) -> PETSc.Mat:
        """Assemble a bilinear form of the user on `space`, and return the reduced matrix Pᵀ A P.

        P leads from the reduced unknowns (periodic, zero at one corner) to displacements of all
        nodes.

        Args:
            form: Compiled form with a test and a trial function in `space`; this is not checked.

        Returns:
            A new matrix, which need not be symmetric.
        """
        matrix = self.matrix.duplicate()
        # The pattern is that of the stiffness, but these properties are not known of this form.
        matrix.setOption(PETSc.Mat.Option.SPD, False)
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, False)
        petsc.assemble_matrix(matrix, form)
        matrix.assemble()
        return matrix

    def slice_strains(self, strains: Array, fluctuations: Sequence[PETSc.Vec]) -> SliceStrains:
        """Return integrals over the slices of fields ε̄ + ε(u), summed over the ranks.

        All ranks must call, and get the same values.

        Args:
            strains: Macroscopic strain ε̄ = (ε11, ε22, 2 ε12) of each field, shape (fields, 3).
            fluctuations: Reduced unknowns of u of each field, as many as there are strains.

        Returns:
            Mean strains, area fractions and means of products of strains by phase, divided by the
            area of the cell.
        """
        num_prisms = len(self.wedge)
        shape = num_prisms * SLICES_PER_LAYER, POINTS_PER_SLICE, 3, len(strains)
        values = np.empty(shape)
        for field, vector in enumerate(fluctuations):
            u = self.elimination.displacements(vector)
            values[..., field] = self._strains(u).reshape(shape[:-1]) + strains[field]
        # Shape (phases, prisms, slices, points).
        areas: Array = np.asarray(self._phases * self.areas / self.grid.plane.lattice.area, float)
        slices = self.layer[:, np.newaxis] * SLICES_PER_LAYER + np.arange(SLICES_PER_LAYER)
        integrals = SliceStrains.zeros(self._rule, phases=len(areas), fields=len(strains))
        of_slices: Array = areas.reshape(len(areas), -1, POINTS_PER_SLICE)
        integrals.add(values, of_slices, slices.ravel())
        # Sums in place; θ and the weights are the same on all ranks.
        for part in (integrals.strain, integrals.fractions, integrals.products):
            self.comm.Allreduce(MPI.IN_PLACE, part)
        return integrals


def solve_over_prisms(
    problem: PrismProblem, stiffness: Sequence[Array], strains: Array, *, options: SolverOptions
) -> Solved:
    """Solve the cell problem over prisms under some macroscopic strains, and average over slices.

    Sought is the periodic u, zero at one corner, with ∫ f_Θ C (ε̄ + ε(u)) : ε(v) dx dθ = 0 for all
    such v (eq. 7), f_Θ the density of θ. A slice is the plane cell at one quadrature point of θ.
    The function is for several MPI ranks, meshes from files, level sets and preconditioners that
    need a matrix with entries; else assembly over slices (`slices.solve_sample`) is the default.

    Args:
        problem: Mesh, constraint and form, moved to the radius map. Its stiffness matrix is
            overwritten.
        stiffness: Stiffness of each phase in Voigt order (11, 22, 12 with 2 ε12), (3, 3) each, in
            Pa.
        strains: Macroscopic strains ε̄ = (ε11, ε22, 2 ε12), shape (loads, 3).
        options: PETSc's options, the ones of the default solver included.

    Returns:
        Mean strains of each phase on each slice for each load, iterations for each load, the
        largest relative residual, and the number of unknowns.

    Raises:
        ConvergenceError: The tolerance of the residual, relative to the load, was not reached.
        RefusedError: PETSc does not use one of the options.
    """
    matrix = problem.assemble(stiffness)
    loads = problem.loads(strains)
    solutions = solve(problem.solver(options, matrix), loads)
    means = problem.slice_strains(strains, solutions.vectors)
    return Solved(means, solutions.iterations, solutions.residual, problem.numbering.size)
