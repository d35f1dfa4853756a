"""The product-space cell problem of one grid: form, constraints, solutions, means over slices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import FailedError, RefusedError
from alphacut.rve.cell.cell import AREA
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
        """Return integrals over no part of the cell, to which `add` adds."""
        slices, shape = len(rule.nodes), (phases, 3, fields)
        strain = np.zeros((phases, slices, 3, fields))
        products = np.zeros((*shape, 3, fields))
        return cls(rule.nodes, rule.weights, strain, np.zeros((phases, slices)), products)

    def add(self, strain: Array, areas: Array, slices: Ints) -> None:
        """Add the integrals over some triangles of the slices.

        Args:
            strain: At the points of the triangles, shape (triangles, points, 3, fields).
            areas: Weights of the points in each phase, over the area of the cell, shape (phases,
                triangles, points).
            slices: Number of each triangle's slice, shape (triangles,).
        """
        for phase in range(len(areas)):
            phase_areas: Array = areas[phase]
            has_phase = phase_areas.any(axis=1)
            points = strain[has_phase]
            weights = phase_areas[has_phase]
            number = slices[has_phase]
            of_triangles = np.einsum("tp,tpif->tif", weights, points)
            np.add.at(self.strain[phase], number, of_triangles)
            np.add.at(self.fractions[phase], number, weights.sum(axis=1))
            theta_weights = self.weights[number, np.newaxis] * weights
            all_points = points.reshape(-1, *points.shape[2:])
            self.products[phase] += strain_products(all_points, theta_weights.reshape(1, -1))[0]

    def combined(self, coefficients: Array) -> SliceStrains:
        """Those of sums of the fields, coefficients (fields, loads)."""
        products = np.einsum("piajb,ak,bl->pikjl", self.products, coefficients, coefficients)
        return replace(self, strain=self.strain @ coefficients, products=products)

    def stress(self, stiffness: Sequence[Array]) -> Array:
        """Homogenised (σ11, σ22, σ12), shape (n, 3, fields), in Pa, for the phases' stiffness."""
        stresses = [matrix @ strain for matrix, strain in zip(stiffness, self.strain, strict=True)]
        return np.asarray(sum(stresses))


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


def positive_density(law: ThetaDistribution, theta: Array) -> Array:
    """Density of θ at quadrature points (n,), or a refusal where it is not positive."""
    density = np.asarray(law.pdf(theta))
    if not (density > 0).all():
        key = f"density of θ at {theta[~(density > 0)][0]:.4g}"
        cure = "shorten the support, or take the series"
        raise RefusedError(key, f"{density.min():g}", "positive densities", cure)
    return density


def require_valid_elements(
    grid: PrismGrid, areas: Array, comm: MPI.Intracomm | None = None
) -> None:
    """Refuse inverted elements, and nearly inverted ones about outlines that are not round.

    `areas` are the weights of the points of prisms in their slices, (prisms, 3, points), of the
    ranks of `comm` together.
    """
    determinants = areas / slice_weights()
    means = determinants.mean(axis=(1, 2), keepdims=True)
    least_ratio = 0.0 if is_round(grid.plane.outline) else MIN_JACOBIAN_RATIO
    is_folded = bool(((means <= 0) | (determinants <= least_ratio * means)).any())
    if comm.allreduce(int(is_folded)) if comm else is_folded:
        where = f"where it follows the radius through {grid.layers} layers in θ"
        cure = "take more layers or a smaller mesh size"
        raise FoldedMeshError(f"the mesh folds over {where}", cure)


class PrismProblem:
    """The product-space problem of one grid; map and phases are set anew for each sample.

    Args:
        grid: Topology; the ranks divide its prisms and its levels among them.
        comm: Communicator.

    Attributes:
        mesh: DOLFINx's.
        space: Displacements, two at each node of a prism.
        node: Number in the grid of each of this rank's nodes, shape (n,).
        wedge: Number in the grid of each of this rank's prisms, shape (m,).
        layer: Layer of each of these prisms, shape (m,).
        dx: Measure of each phase by its name, with the rule of the prisms, for forms of the user.
        density: f_Θ at the points.
        areas: Weights of the points in their slice, shape (cells, 3, points); a slice's sum is 4.
        numbering: Reduced unknowns.
        map: The radius map.
        matrix: The reduced stiffness.
        elimination: From forces on nodes to reduced ones, and from unknowns to displacements.
    """

    def __init__(self, grid: PrismGrid, comm: MPI.Intracomm) -> None:
        self.grid, self.comm = grid, comm
        self.mesh = mesh_of(comm, grid.cells, grid.nodes, wedge(3))
        self.space = fem.functionspace(self.mesh, wedge(2))
        self.wedge: Ints = np.asarray(self.mesh.topology.original_cell_index)
        self.layer = self.wedge // len(grid.plane.triangles)
        sizes, geometry = self.space.dofmap.index_map, self.mesh.geometry
        self.node: Ints = np.empty(sizes.size_local + sizes.num_ghosts, np.int64)
        self.node[self.space.dofmap.list] = geometry.input_global_indices[geometry.dofmap]
        self._compile_forms()
        self.numbering = LevelNumbering(grid, comm)
        pairs, rows = self.numbering.pairs, self.numbering.rows
        layers = grid.cells.reshape(grid.layers, -1, grid.cells.shape[1])
        cells = layers[self.numbering.layers].reshape(-1, layers.shape[-1])
        self.elimination = Elimination(
            pairs[self.node], pairs[cells], rows, self.numbering.size, comm
        )
        self.matrix = self.elimination.matrix

    def _compile_forms(self) -> None:
        points, weights = prism_rule()
        metadata = {
            "quadrature_rule": "custom",
            "quadrature_points": points,
            "quadrature_weights": weights,
        }
        phase, num_phases = self.grid.phase[self.wedge], len(self.grid.names)
        cells = [(k, np.flatnonzero(phase == k).astype(np.int32)) for k in range(num_phases)]
        dx = ufl.Measure("dx", self.mesh, metadata=metadata, subdomain_data=cells)
        self.dx = {name: dx(k) for k, name in enumerate(self.grid.names)}

        def at_points(*shape: int) -> fem.FunctionSpace:
            rule = {"points": points, "weights": weights}
            element = basix.ufl.quadrature_element("prism", value_shape=shape, **rule)
            return fem.functionspace(self.mesh, element)

        self.density = fem.Function(at_points())
        self._phases = np.equal.outer(np.arange(num_phases), phase)[..., None, None]
        if self.grid.conforming:
            stiffness_space = fem.functionspace(self.mesh, ("DG", 0, (3, 3)))
        else:
            stiffness_space = at_points(3, 3)
        self._elastic = CellForm(self.space, stiffness_space, dx, self.density)
        self._strains = PointStrains(self.space, points)

    def move(self, radius_map: RadiusMap) -> None:
        """Move the nodes to the interface r(θ) of a map and mark the particle (eq. 13, 14).

        After an error it is to be moved again before use.

        Raises:
            FoldedMeshError: An element is inverted.
            RefusedError: The density of θ is not positive at a quadrature point.
        """
        self.map = radius_map
        positions, geometry = self.grid.positions(radius_map), self.mesh.geometry
        geometry.x[:] = positions[geometry.input_global_indices]
        law = radius_map.distribution
        levels = self.grid.level_thetas(law)
        self._rule = level_rule(law, levels, points=SLICES_PER_LAYER)
        density = positive_density(law, self._rule.nodes).reshape(-1, SLICES_PER_LAYER)
        volume = self._strains.determinants().reshape(len(self.wedge), SLICES_PER_LAYER, -1)
        self.areas: Array = volume / np.diff(levels)[self.layer, None, None] * slice_weights()
        require_valid_elements(self.grid, self.areas, self.comm)
        self.density.x.array[:] = np.repeat(density[self.layer], POINTS_PER_SLICE)
        if isinstance(radius_map, LevelSet):
            shapes: Array = wedge(1).tabulate(0, prism_rule()[0])[0].reshape(-1, 15)
            corners = positions[self.grid.cells[self.wedge]]
            values = radius_map.values(np.einsum("qn,cnd->cqd", shapes, corners))
            lowest = self.comm.allreduce(float(values.min(initial=np.inf)), MPI.MIN)
            highest = self.comm.allreduce(float(values.max(initial=-np.inf)), MPI.MAX)
            radius_map.require_both_signs(lowest, highest)
            inside = values < 0  # eq. 14
            self._phases = np.array([~inside, inside]).reshape(2, *self.areas.shape)

    def assemble(self, stiffness: Sequence[Array]) -> PETSc.Mat:
        """Assemble the reduced stiffness of eq. 7 and return it."""
        at_points = np.tensordot(self._phases, np.array(stiffness), axes=(0, 0))  # eq. 13
        self._elastic.stiffness.x.array[:] = at_points.ravel()
        self._elastic.assemble(self.matrix)
        return self.matrix

    def loads(self, strains: Array) -> list[PETSc.Vec]:
        """Reduced forces −⟨Bᵀ C ε̄⟩ of macroscopic strains (loads, 3), for the phases as set."""
        return [self.elimination.forces(self._elastic.load(strain)) for strain in strains]

    def solver(self, options: SolverOptions, matrix: PETSc.Mat) -> PETSc.KSP:
        """Return PETSc's solver of a reduced symmetric operator, for loads one after another."""
        return krylov_solver(matrix, options, lambda: self.preconditioner(matrix))

    def preconditioner(self, matrix: PETSc.Mat) -> ThetaPreconditioner:
        """Preconditioner along θ of a reduced operator, assembled."""
        law, blocks = self.map.distribution, level_blocks(matrix, self.numbering)
        return ThetaPreconditioner(self.numbering, self.comm).set_up(law, blocks)

    def assemble_operator(self, form: fem.Form) -> PETSc.Mat:
        """Reduced matrix Pᵀ A P of a bilinear form of the user on `space`."""
        matrix = self.matrix.duplicate()
        for option in (PETSc.Mat.Option.SPD, PETSc.Mat.Option.SYMMETRIC):  # not known of this form
            matrix.setOption(option, False)
        petsc.assemble_matrix(matrix, form)
        matrix.assemble()
        return matrix

    def slice_strains(self, strains: Array, fluctuations: Sequence[PETSc.Vec]) -> SliceStrains:
        """Return integrals over the slices of fields ε̄ + ε(u), summed over the ranks.

        The fields are n of ε̄, shape (n, 3), and n of u in reduced unknowns.
        """
        prisms, count, rule = len(self.wedge), len(strains), self._rule
        values = np.empty((prisms * SLICES_PER_LAYER, POINTS_PER_SLICE, 3, count))
        for k, (strain, vector) in enumerate(zip(strains, fluctuations, strict=True)):
            u = self.elimination.displacements(vector)
            values[..., k] = self._strains(u).reshape(values.shape[:-1]) + strain
        areas = self._phases * self.areas / AREA  # (phases, prisms, slices, points)
        slices = self.layer[:, None] * SLICES_PER_LAYER + np.arange(SLICES_PER_LAYER)
        integrals = SliceStrains.zeros(rule, phases=len(areas), fields=count)
        integrals.add(values, areas.reshape(len(areas), -1, POINTS_PER_SLICE), slices.ravel())
        for part in (integrals.strain, integrals.fractions, integrals.products):
            self.comm.Allreduce(MPI.IN_PLACE, part)
        return integrals


def solve_over_prisms(
    problem: PrismProblem, stiffness: Sequence[Array], strains: Array, *, options: SolverOptions
) -> Solved:
    """Solve eq. 7 over prisms under some macroscopic strains, and average over slices.

    It is for several MPI ranks, meshes from files, level sets and preconditioners that need a
    matrix with entries; `slices.solve_sample` is the default, and shows the whole way.

    Args:
        problem: Mesh, constraint and form, moved to the map.
        stiffness: Stiffness of each phase, (3, 3) each, in Pa.
        strains: Macroscopic strains ε̄ = (ε11, ε22, 2 ε12), shape (loads, 3).
        options: PETSc's options, with those of the default solver.

    Raises:
        ConvergenceError: The tolerance of the residual, relative to the load, was not reached.
    """
    matrix = problem.assemble(stiffness)
    loads = problem.loads(strains)
    solutions = solve(problem.solver(options, matrix), loads)
    means = problem.slice_strains(strains, solutions.vectors)
    return Solved(means, solutions.iterations, solutions.residual, problem.numbering.size)
