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
from functools import reduce
from operator import iadd

import numpy as np
import scipy.sparse as sp

from alphacut.fuzzy.arrays import Array, Ints
from alphacut.rve.cell.cell import AREA
from alphacut.rve.fenicsx import MPI
from alphacut.rve.mesh.prism_grid import PrismGrid
from alphacut.rve.mesh.wedge import POINTS_PER_SLICE, SLICES_PER_LAYER, prism_rule, slice_weights
from alphacut.rve.prism.problem import SliceStrains, positive_density, require_valid_elements
from alphacut.rve.solver.form import strain_products
from alphacut.rve.solver.krylov import DEFAULTS
from alphacut.rve.solver.level_solver import LevelSolver, Operator, conjugate_gradients, stacked
from alphacut.rve.solver.numbering import LevelNumbering
from alphacut.rve.solver.theta_preconditioner import theta_mass
from alphacut.stochastic import RadiusMap
from alphacut.stochastic.theta.quadrature import level_rule

VOIGT = np.array([[0, 2], [2, 1]])  # index [c, α] of the strain that ∂_α u_c adds to
RTOL = float(DEFAULTS["ksp_rtol"])
EDGES = ((0, 1), (0, 2), (1, 2))  # of a triangle, by their vertices


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
    phases = list(enumerate(stiffness))
    # added in place: of fine meshes the entries take hundreds of MB
    entries = reduce(iadd, (problem.entries(k, matrix) for k, matrix in phases))
    loads = reduce(iadd, (problem.forces(k, matrix, strains) for k, matrix in phases))
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
        points, weights = prism_rule()
        zeta = points[::POINTS_PER_SLICE, 2]
        self._line_weights = 2 * weights.reshape(SLICES_PER_LAYER, -1).sum(axis=1)
        self._shapes = np.array([1 - zeta, zeta, 4 * zeta * (1 - zeta)])  # of both hats, the bubble
        self._slopes = _slopes(points[:POINTS_PER_SLICE, :2])
        phases, periodicity = grid.phase[: len(grid.plane.triangles)], self.numbering.periodicity
        self._phase = [np.flatnonzero(phases == k) for k in range(len(grid.names))]
        self._unknown = periodicity.unknown[grid.plane.triangles]  # pairs, (triangles, 6)
        self._find_pattern(periodicity.count)
        self.solver: LevelSolver = LevelSolver(self.numbering, self._indptr, self._indices)

    def _find_pattern(self, count: int) -> None:
        """Pattern of node pairs, and matrices that sum what stands in triangles into it."""
        unknown, shape = self._unknown, (*self._unknown.shape, 6)
        row, column = (np.broadcast_to(x, shape) for x in (unknown[..., None], unknown[:, None]))
        is_free, numbers = (row >= 0) & (column >= 0), np.arange(row.size * 4).reshape(-1, 12, 12)
        keys = np.unique((row * count + column)[is_free])
        self._indptr = np.searchsorted(keys, np.arange(count + 1) * count)
        self._indices = keys % count
        self._to_pattern, self._to_nodes = [], []
        for triangles in self._phase:
            chosen = np.zeros(shape, bool)
            chosen[triangles] = True
            chosen &= is_free
            pair = np.searchsorted(keys, (row * count + column)[chosen])
            # entries [iα, jβ] of a triangle's matrix, (12, 12)
            entries = numbers.reshape(-1, 6, 2, 6, 2).swapaxes(2, 3)[chosen].reshape(-1, 4)
            places = 4 * pair[:, None] + np.arange(4)
            self._to_pattern.append(_summation(places, entries, 4 * len(keys), numbers.size))
            i, free = 12 * triangles[:, None] + 2 * np.arange(6), unknown[triangles] >= 0
            places = 2 * unknown[triangles][free][:, None] + np.arange(2)
            entries = i[free][:, None] + np.arange(2)
            self._to_nodes.append(_summation(places, entries, 2 * count, 12 * len(unknown)))

    def move(self, radius_map: RadiusMap) -> None:
        """Move the nodes to a map, and integrate over the slices what no stiffness changes.

        Raises:
            FoldedMeshError: An element is inverted.
            RefusedError: The density of θ is not positive at a quadrature point.
        """
        grid, law, self.map = self.grid, radius_map.distribution, radius_map
        levels = grid.level_thetas(law)
        self._rule = level_rule(law, levels, points=SLICES_PER_LAYER)
        density = positive_density(law, self._rule.nodes)
        self._mass = theta_mass(law, levels)
        nodes = self._slice_nodes(grid.positions(radius_map)[:, :2])
        determinants, gradients = self._gradients_of(nodes[:, grid.plane.triangles])
        self._gradients, self._areas = gradients, determinants * slice_weights()[0]
        by_layer = self._areas.reshape(grid.layers, SLICES_PER_LAYER, -1, POINTS_PER_SLICE)
        prisms = by_layer.swapaxes(1, 2).reshape(-1, SLICES_PER_LAYER, POINTS_PER_SLICE)
        require_valid_elements(grid, prisms)
        masses = (np.diff(levels)[:, None] * self._line_weights).ravel() * density  # f_Θ dθ
        weights = self._areas * masses[:, None, None]
        self._products, self._sums = (
            [np.empty((len(masses), matrix.shape[0])) for matrix in by_phase]
            for by_phase in (self._to_pattern, self._to_nodes)
        )
        for k in range(len(masses)):  # one slice after another, which takes less memory
            weighted = gradients[k] * weights[k][:, None]
            products = weighted @ gradients[k].swapaxes(-1, -2)  # ∫ f_Θ ∂_α N_i ∂_β N_j: [iα, jβ]
            sums = weighted.sum(axis=-1)  # ∫ f_Θ ∂_α N_i
            for phase in range(len(self._phase)):
                self._products[phase][k] = self._to_pattern[phase] @ products.ravel()
                self._sums[phase][k] = self._to_nodes[phase] @ sums.ravel()

    def _slice_nodes(self, positions: Array) -> Array:
        """Positions of the plane nodes on the slices, (slices, nodes, 2), of those of the grid."""
        plane, layers = self.grid.plane, self.grid.layers
        on_levels, on_mid_levels = np.split(positions, [(layers + 1) * len(plane.points)])
        hats = on_levels.reshape(layers + 1, -1, 2)
        means = (hats[:-1] + hats[1:])[:, : plane.vertices] / 2
        bubbles = on_mid_levels.reshape(layers, -1, 2) - means
        bubbles = np.concatenate([bubbles, bubbles[:, plane.ends].mean(axis=2)], axis=1)
        lower, upper, bubble = self._shapes[:, :, None, None]
        slices = lower * hats[:-1, None] + upper * hats[1:, None] + bubble * bubbles[:, None]
        return np.asarray(slices.reshape(-1, *hats.shape[1:]))

    def _gradients_of(self, nodes: Array) -> tuple[Array, Array]:
        """Determinants of J at the points, (slices, triangles, 6), and ∂_α N_i, (…, iα, 6).

        `nodes` are those of the triangles, (slices, triangles, 6, 2).
        """
        jacobian = np.swapaxes(nodes, -1, -2) @ self._slopes.reshape(6, -1)
        (a, b), (c, d) = np.moveaxis(jacobian.reshape(*nodes.shape[:2], 2, 2, -1), (2, 3), (0, 1))
        determinants = a * d - b * c
        inverse = np.array([[d, -b], [-c, a]]) / determinants  # [β, α], of ∂ξ_β/∂x_α
        first, second = self._slopes.swapaxes(0, 1)  # ∂N_i/∂ξ_β, (6, points)
        gradients = np.empty((*nodes.shape, determinants.shape[-1]))
        for alpha in range(2):
            x, y = inverse[:, alpha, :, :, None]
            gradients[:, :, :, alpha] = x * first + y * second
        return determinants, gradients.reshape(*nodes.shape[:2], 12, -1)

    def entries(self, phase: int, stiffness: Array) -> Array:
        """Entries [c, d] of all K_s by a phase, (slices, node pairs, 4), for its stiffness."""
        coefficients = stiffness[VOIGT[:, :, None, None], VOIGT]  # C[c, α, d, β]
        products = self._products[phase].reshape(len(self._areas), -1, 4)
        return np.asarray(products @ coefficients.transpose(1, 3, 0, 2).reshape(4, 4))

    def forces(self, phase: int, stiffness: Array, strains: Array) -> Array:
        """−⟨Bᵀ C ε̄⟩ of a phase under macroscopic strains (loads, 3), shape (loads, size)."""
        stress = (strains @ stiffness)[:, VOIGT]  # σ[load, c, α]
        sums = self._sums[phase].reshape(len(self._areas), -1, 2)  # [slice, i, α]
        return self._to_fields(-np.einsum("fca,sia->fsic", stress, sums))

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
        hats, bubbles = self.solver.split(fields)
        lower, upper, bubble = self._shapes[:, :, None]
        on_slices = lower * hats[:, :-1, None] + upper * hats[:, 1:, None]
        on_slices += bubble * self.solver.inject(bubbles)[:, :, None]
        return np.asarray(on_slices.reshape(len(fields), -1, hats.shape[-1]))

    def _to_fields(self, on_slices: Array) -> Array:
        """Σ_s T_sᵀ r_s, shape (fields, size), of values on the nodes of the slices."""
        fields = np.zeros((len(on_slices), self.numbering.size))
        hats, bubbles = self.solver.split(fields)
        by_layer = on_slices.reshape(*bubbles.shape[:2], SLICES_PER_LAYER, -1)
        below, above, bubble = np.moveaxis(self._shapes @ by_layer, 2, 0)
        hats[:, :-1] += below
        hats[:, 1:] += above
        bubbles[:] = self.solver.restrict(bubble)
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
        for k, weight in enumerate(self._rule.weights):
            corners = nodal[k, self._unknown].reshape(*self._unknown.shape, -1)
            slopes = self._gradients[k].reshape(*self._unknown.shape, -1)  # [α, point]
            gradients = slopes.swapaxes(-1, -2) @ corners
            along = gradients.reshape(len(corners), 2, POINTS_PER_SLICE, count, 2).swapaxes(0, 1)
            fluctuation[..., 0, :], fluctuation[..., 1, :] = along[0, ..., 0], along[1, ..., 1]
            np.add(along[1, ..., 0], along[0, ..., 1], out=fluctuation[..., 2, :])
            for phase, triangles in enumerate(self._phase):
                areas = self._areas[k, triangles].ravel() / AREA
                of_phase = strain[triangles].reshape(len(areas), *strain.shape[2:])
                means[phase, k] = np.tensordot(areas, of_phase, axes=1)
                fractions[phase, k] = areas.sum()
                products[phase] += strain_products(of_phase, weight * areas[None])[0]
        return SliceStrains(self._rule.nodes, self._rule.weights, means, fractions, products)


def _slopes(points: Array) -> Array:
    """∂N_i/∂ξ_β of a six-node triangle, (6, 2, points), at points (n, 2)."""
    x, y = points.T
    corner, slope = np.array([1 - x - y, x, y]), np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    vertices = [(4 * corner[i] - 1) * slope[i][:, None] for i in range(3)]
    middles = [
        4 * (corner[i] * slope[j][:, None] + corner[j] * slope[i][:, None]) for i, j in EDGES
    ]
    return np.array(vertices + middles)


def _summation(places: Ints, entries: Ints, num_places: int, num_entries: int) -> sp.csr_matrix:
    """Matrix that adds each of some entries to its place."""
    ones = np.ones(places.size)
    return sp.csr_matrix((ones, (places.ravel(), entries.ravel())), (num_places, num_entries))
