"""The product space by its slices: plane cells at the Gauss points of the layers.

At height ζ of layer k a displacement of the prisms is one of six-node triangles,

    u(·, ζ) = (1 − ζ) U_k + ζ U_k+1 + 4 ζ (1 − ζ) J b_k,

with the hats U of the levels, the bubbles b of the mid-levels, and J from linear to quadratic
triangles, as in `theta_preconditioner`. The form has no derivative along θ, so that eq. 7 is

    K = Σ_s T_sᵀ K_s T_s,    K_s[ic, jd] = Σ_αβ C[cα, dβ] ∫ f_Θ ∂_α N_i ∂_β N_j,

with T_s from hats and bubbles to the nodes of slice s, and the stiffness C of each phase. All K_s
have one pattern, found once for a mesh; a map moves the nodes alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from alphacut.base.arrays import Array, Ints
from alphacut.rve.cell.cell import AREA
from alphacut.rve.fenicsx import MPI
from alphacut.rve.mesh.prism_grid import PrismGrid
from alphacut.rve.mesh.wedge import (
    POINTS_PER_SLICE,
    SLICES_PER_LAYER,
    TRIANGLE_NODES,
    prism_rule,
    slice_weights,
    wedge,
)
from alphacut.rve.prism.problem import SliceStrains, positive_density, require_valid_elements
from alphacut.rve.solver.form import strain_products
from alphacut.rve.solver.krylov import DEFAULTS
from alphacut.rve.solver.level_solver import LevelSolver, Operator, conjugate_gradients, stacked
from alphacut.rve.solver.numbering import LevelNumbering
from alphacut.rve.solver.theta_preconditioner import columnwise, theta_mass
from alphacut.stochastic import RadiusMap
from alphacut.stochastic.theta.quadrature import level_rule

VOIGT = np.array([[0, 2], [2, 1]])  # index [c, α] of the strain that ∂_α u_c adds to
RTOL = float(DEFAULTS["ksp_rtol"])


def is_homogeneous(stiffness: Sequence[Array]) -> bool:
    """True where all phases are the same."""
    return all(np.array_equal(phase, stiffness[0]) for phase in stiffness)


def solve_sample(
    problem: SliceProblem, stiffness: Sequence[Array], strains: Array
) -> tuple[SliceStrains, tuple[int, ...], float]:
    """Solve eq. 7 for the phases' stiffness in Pa, at the map to which the problem was moved.

    Returns:
        Mean strains of the slices under macroscopic strains (loads, 3); iterations of each load;
        the largest relative residual.

    Raises:
        ConvergenceError: The tolerance of the residual, relative to the load, was not reached.
    """
    entries, loads = problem.entries(stiffness), problem.forces(stiffness, strains)
    if is_homogeneous(stiffness):  # without fluctuation
        loads[:] = 0.0
    operator = problem.operator(entries)
    problem.factorise(entries)
    fluctuations, iterations = conjugate_gradients(operator, problem.solver, loads, RTOL)  # K U = F
    residuals = problem.solver.norms(loads - operator(fluctuations))
    load_norms = problem.solver.norms(loads)
    residual = float((residuals / np.where(load_norms > 0, load_norms, 1.0)).max())
    fields = problem.slice_strains(strains, fluctuations)
    totals = fields.combined(np.tile(np.eye(len(strains)), (2, 1)))  # ε̄ + ε(u) of each load
    return totals, iterations, residual


class SliceProblem:
    """The product-space problem of one mesh on one rank, moved to one map after another.

    Args:
        grid: Prisms whose nodes follow the interface.

    Attributes:
        numbering: Unknowns.
        solver: Preconditioner, and the order of the unknowns of a field.
        map: The radius map.
    """

    def __init__(self, grid: PrismGrid) -> None:
        self.grid, self.numbering = grid, LevelNumbering(grid, MPI.COMM_SELF)
        points = prism_rule()[0]
        zeta = points[::POINTS_PER_SLICE, 2]
        self._shapes = np.array([1 - zeta, zeta, 4 * zeta * (1 - zeta)])  # of both hats, the bubble
        self._prism_slopes = np.array(wedge(1).tabulate(1, points))[1:3].reshape(2, -1, 15)
        on_base = np.array(wedge(1).tabulate(1, points[:POINTS_PER_SLICE] * [1, 1, 0]))[1:3]
        slopes = on_base.reshape(2, POINTS_PER_SLICE, 15)[..., TRIANGLE_NODES]
        self._slopes = slopes.swapaxes(1, 2)  # ∂N_i/∂ξ_β of a six-node triangle, [β, i, point]
        phase = grid.phase[: len(grid.plane.triangles)]
        self._phase = [np.flatnonzero(phase == k) for k in range(len(grid.names))]
        self._unknown = self.numbering.planar[grid.plane.triangles]  # pairs, (triangles, 6)
        self._find_pattern(phase, self.numbering.level_size // 2)
        self.solver: LevelSolver = LevelSolver(self.numbering, self._indptr, self._indices)

    def _find_pattern(self, phase: Ints, count: int) -> None:
        """Pattern of node pairs, and matrices that sum, by phase, what stands in triangles."""
        unknown, phases = self._unknown, len(self._phase)
        row, column = unknown[:, :, None], unknown[:, None]
        is_free = (row >= 0) & (column >= 0)
        keys, pair = np.unique((row * count + column)[is_free], return_inverse=True)
        self._indptr = np.searchsorted(keys, np.arange(count + 1) * count)
        self._indices = keys % count
        places = pair * phases + np.broadcast_to(phase[:, None, None], is_free.shape)[is_free]
        # entries [iα, jβ] of a triangle's matrix, (12, 12)
        entries = np.arange(4 * is_free.size).reshape(-1, 6, 2, 6, 2).swapaxes(2, 3)
        self._to_pairs = _summation(places, entries[is_free], len(keys) * phases, entries.size)
        is_free, entries = unknown >= 0, np.arange(2 * unknown.size).reshape(-1, 6, 2)
        places = (unknown * phases + phase[:, None])[is_free]
        self._to_nodes = _summation(places, entries[is_free], count * phases, entries.size)

    def move(self, radius_map: RadiusMap) -> None:
        """Move the nodes to a map, and integrate over the slices what no stiffness changes.

        Raises:
            FoldedMeshError: An element is inverted.
            RefusedError: The density of θ is not positive at a quadrature point.
        """
        grid, law, self.map = self.grid, radius_map.distribution, radius_map
        levels = grid.level_thetas(law)
        self._rule = level_rule(law, levels, points=SLICES_PER_LAYER)
        positive_density(law, self._rule.nodes)
        self._mass = theta_mass(law, levels)
        self._set_jacobian(grid.positions(radius_map)[:, :2])
        slices = len(self._areas)
        self._products = np.empty((slices, self._to_pairs.shape[0]))
        self._sums = np.empty((slices, self._to_nodes.shape[0]))
        for s, weight in enumerate(self._rule.weights):  # in turn, which takes less memory
            x, y = self._inverse[:, :, s, :, None]
            gradients = x * self._slopes[0] + y * self._slopes[1]  # ∂_α N_i
            gradients = gradients.transpose(1, 2, 0, 3).reshape(len(self._unknown), 12, -1)
            weighted = weight * self._areas[s][:, None] * gradients
            products = weighted @ gradients.swapaxes(-1, -2)  # ∫ f_Θ ∂_α N_i ∂_β N_j: [iα, jβ]
            self._products[s] = self._to_pairs @ products.ravel()
            self._sums[s] = self._to_nodes @ weighted.sum(axis=-1).ravel()  # ∫ f_Θ ∂_α N_i

    def _set_jacobian(self, positions: Array) -> None:
        """Areas of the points, (slices, triangles, 6), and ∂ξ_β/∂x_α, [β, α] of the same shape."""
        grid = self.grid
        corners = positions[grid.cells].reshape(grid.layers, -1, 15, 2)
        jacobian = np.einsum("bqn,ltna->abltq", self._prism_slopes, corners, optimize=True)
        jacobian = jacobian.reshape(*jacobian.shape[:-1], SLICES_PER_LAYER, POINTS_PER_SLICE)
        (a, b), (c, d) = jacobian  # ∂x_α/∂ξ_β, (layers, triangles, 3, 6)
        determinants = a * d - b * c
        areas = determinants * slice_weights()
        require_valid_elements(grid, areas.reshape(-1, SLICES_PER_LAYER, POINTS_PER_SLICE))
        inverse = np.array([[d, -b], [-c, a]]) / determinants
        shape = len(self._rule.weights), -1, POINTS_PER_SLICE
        self._areas = areas.swapaxes(1, 2).reshape(shape)
        self._inverse = inverse.swapaxes(3, 4).reshape(2, 2, *shape)

    def entries(self, stiffness: Sequence[Array]) -> Array:
        """Entries [c, d] of all K_s, (slices, node pairs, 4), for the stiffness of the phases."""
        coefficients = np.array(stiffness)[:, VOIGT[:, :, None, None], VOIGT]  # [c, α, d, β]
        by_products = coefficients.transpose(0, 2, 4, 1, 3).reshape(-1, 4)
        return self._products.reshape(len(self._areas), -1, len(by_products)) @ by_products

    def forces(self, stiffness: Sequence[Array], strains: Array) -> Array:
        """−⟨Bᵀ C ε̄⟩ under macroscopic strains (loads, 3), shape (loads, size)."""
        stress = (strains @ np.array(stiffness))[..., VOIGT]  # σ[phase, load, c, α]
        sums = self._sums.reshape(len(self._areas), -1, len(stiffness), 2)  # [slice, i, phase, α]
        return self._to_fields(-np.einsum("pfca,sipa->fsic", stress, sums, optimize=True))

    def operator(self, entries: Array) -> Operator:
        """The map x ↦ K x of fields (fields, size) for the entries of all K_s."""
        matrix = stacked(entries, self._indptr, self._indices)

        def multiply(fields: Array) -> Array:
            columns = self._to_slices(fields).reshape(len(fields), -1)
            return self._to_fields(np.array([matrix @ column for column in columns]))

        return multiply

    def factorise(self, entries: Array) -> None:
        """Factorise the blocks of hats and of bubbles over their masses in `solver`."""
        by_layer = entries.reshape(self.grid.layers, SLICES_PER_LAYER, -1)
        lower, upper, bubble = self._shapes**2
        hats = np.zeros((self.grid.layers + 1, by_layer.shape[-1]))
        hats[:-1] += lower @ by_layer
        hats[1:] += upper @ by_layer
        self.solver.factorise(hats, bubble @ by_layer, self._mass)

    def _to_slices(self, fields: Array) -> Array:
        """T_s x of all slices s, shape (fields, slices, 2 nodes)."""
        hats, bubbles = self.numbering.split(fields)
        lower, upper, bubble = self._shapes[:, :, None]
        on_slices = lower * hats[:, :-1, None] + upper * hats[:, 1:, None]
        on_slices += bubble * columnwise(self.solver.injection, bubbles)[:, :, None]
        return np.asarray(on_slices.reshape(len(fields), -1, hats.shape[-1]))

    def _to_fields(self, on_slices: Array) -> Array:
        """Σ_s T_sᵀ r_s, shape (fields, size), of values on the nodes of the slices."""
        fields = np.zeros((len(on_slices), self.numbering.size))
        hats, bubbles = self.numbering.split(fields)
        by_layer = on_slices.reshape(*bubbles.shape[:2], SLICES_PER_LAYER, -1)
        below, above, bubble = np.moveaxis(self._shapes @ by_layer, 2, 0)
        hats[:, :-1] += below
        hats[:, 1:] += above
        bubbles[:] = columnwise(self.solver.injection.T, bubble)
        return fields

    def slice_strains(self, strains: Array, fields: Array) -> SliceStrains:
        """Those of macroscopic strains alone, (loads, 3), then of fields alone, (n, size)."""
        count, slices, phases = len(fields), len(self._areas), len(self._phase)
        nodal = np.moveaxis(self._to_slices(fields).reshape(count, slices, -1, 2), 0, 2)
        nodal = np.append(nodal, np.zeros((slices, 1, count, 2)), axis=1)  # number −1: fixed nodes
        strain = np.empty((len(self._unknown), POINTS_PER_SLICE, 3, len(strains) + count))
        affine, fluctuation = np.split(strain, [len(strains)], axis=-1)  # views
        affine[:] = strains.T
        means, fractions = np.empty((phases, slices, *strain.shape[2:])), np.empty((phases, slices))
        products = np.zeros((phases, *strain.shape[2:], *strain.shape[2:]))
        for s, weight in enumerate(self._rule.weights):
            corners = nodal[s, self._unknown].reshape(len(self._unknown), 6, -1)
            along_xi, along_eta = self._slopes.swapaxes(1, 2)[:, None] @ corners  # ∂u_c/∂ξ_β
            x, y = self._inverse[:, :, s, ..., None]
            gradients = (x * along_xi + y * along_eta).reshape(2, *strain.shape[:2], count, 2)
            fluctuation[..., 0, :] = gradients[0, ..., 0]
            fluctuation[..., 1, :] = gradients[1, ..., 1]
            np.add(gradients[0, ..., 1], gradients[1, ..., 0], out=fluctuation[..., 2, :])
            for phase, triangles in enumerate(self._phase):
                areas = self._areas[s, triangles].ravel() / AREA
                of_phase = strain[triangles].reshape(len(areas), *strain.shape[2:])
                means[phase, s] = np.tensordot(areas, of_phase, axes=1)
                fractions[phase, s] = areas.sum()
                products[phase] += strain_products(of_phase, weight * areas[None])[0]
        return SliceStrains(self._rule.nodes, self._rule.weights, means, fractions, products)


def _summation(places: Ints, entries: Ints, num_places: int, num_entries: int) -> sp.csr_matrix:
    """Matrix that adds entries, (n, …), to the components of their places, (n,)."""
    columns = entries.reshape(len(places), -1)
    components = columns.shape[1]
    rows = components * places[:, None] + np.arange(components)
    shape = components * num_places, num_entries
    return sp.csr_matrix((np.ones(rows.size), (rows.ravel(), columns.ravel())), shape)
