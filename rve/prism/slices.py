"""The product space by its slices: plane cells at the Gauss points of the layers.

At height ζ of layer k a displacement of the prisms is one of six-node triangles,

    u(·, ζ) = (1 − ζ) U_k + ζ U_k+1 + 4 ζ (1 − ζ) J b_k,

with the hats U of the levels, the bubbles b of the mid-levels, and J from linear to quadratic
triangles, as in `theta_preconditioner`. The form has no derivative along θ, so that eq. 7 is

    K = Σ_s T_sᵀ K_s T_s,    K_s[ic, jd] = Σ_αβ C[cα, dβ] ∫ f_Θ ∂_α N_i ∂_β N_j,

with T_s from hats and bubbles to the nodes of slice s and the stiffness C of each phase. All K_s
have one pattern, found once for a mesh; a map moves the nodes alone. Fields are arrays of shape
(fields, size): hats of level 0, bubbles above them, hats of level 1, …, two unknowns a node.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy.sparse as sp

from alphacut.fuzzy.arrays import Array, Ints
from alphacut.rve.cell.cell import AREA
from alphacut.rve.fenicsx import MPI, basix
from alphacut.rve.mesh.prism_grid import PrismGrid
from alphacut.rve.mesh.wedge import (
    POINTS_PER_SLICE,
    SLICES_PER_LAYER,
    prism_rule,
    slice_weights,
    wedge,
)
from alphacut.rve.prism.problem import SliceStrains, positive_density, require_valid_elements
from alphacut.rve.solver.form import strain_products
from alphacut.rve.solver.level_solver import LevelSolver, conjugate_gradients
from alphacut.rve.solver.numbering import LevelNumbering
from alphacut.stochastic import RadiusMap
from alphacut.stochastic.theta.quadrature import level_rule

VOIGT = np.array([[0, 2], [2, 1]])  # index of the strain that ∂_α u_c adds to


class SliceProblem:
    """The product-space problem of one mesh on one rank, moved to one map after another.

    Args:
        grid: Prisms whose nodes follow the interface.

    Attributes:
        numbering: Unknowns.
        map: The radius map.
    """

    def __init__(self, grid: PrismGrid) -> None:
        self.grid, self.numbering = grid, LevelNumbering(grid, MPI.COMM_SELF)
        self.pattern = _Pattern(grid, self.numbering)
        points, weights = prism_rule()
        zeta = points[::POINTS_PER_SLICE, 2]
        self._line_weights = weights.reshape(SLICES_PER_LAYER, -1).sum(axis=1) * 2
        self._hats_and_bubble = np.array([1 - zeta, zeta, 4 * zeta * (1 - zeta)])

    def move(self, radius_map: RadiusMap) -> None:
        """Move the nodes to a map and integrate over the slices what no stiffness changes.

        Raises:
            FoldedMeshError: An element is inverted.
            RefusedError: The density of θ is not positive at a quadrature point.
        """
        grid, law, self.map = self.grid, radius_map.distribution, radius_map
        levels = grid.level_thetas(law)
        self._rule = level_rule(law, levels, points=SLICES_PER_LAYER)
        density = positive_density(law, self._rule.nodes)
        corners = self._slice_nodes(grid.positions(radius_map)[:, :2])[:, grid.plane.triangles]
        determinants, self._gradients = _gradients(corners)
        self._areas = determinants * slice_weights()[0]
        cells = self._areas.reshape(grid.layers, SLICES_PER_LAYER, -1, POINTS_PER_SLICE)
        require_valid_elements(grid, cells.swapaxes(1, 2).reshape(-1, *cells.shape[1::2]))
        heights = np.diff(levels)[:, None]
        masses = (heights * self._line_weights).ravel() * density  # f_Θ dθ of the slices
        weights = self._areas * masses[:, None, None]
        flat = self._gradients.reshape(*weights.shape[:2], -1, POINTS_PER_SLICE)  # of 6 nodes × α
        products = (flat * weights[:, :, None]) @ flat.swapaxes(-1, -2)
        self._products = self.pattern.sum_products(products)
        self._sums = self.pattern.sum_gradients((flat @ weights[..., None])[..., 0])

    def _slice_nodes(self, positions: Array) -> Array:
        """Positions of the plane nodes on all slices, (slices, nodes, 2), of those of the grid."""
        plane, layers = self.grid.plane, self.grid.layers
        on_levels, on_mid_levels = np.split(positions, [(layers + 1) * len(plane.points)])
        on_levels = on_levels.reshape(layers + 1, -1, 2)
        bubbles = on_mid_levels.reshape(layers, -1, 2)
        bubbles = bubbles - (on_levels[:-1] + on_levels[1:])[:, : plane.vertices] / 2
        bubbles = np.concatenate([bubbles, bubbles[:, plane.ends].mean(axis=2)], axis=1)
        parts = np.stack([on_levels[:-1], on_levels[1:], bubbles], axis=1)
        return np.einsum("hs,lhnc->lsnc", self._hats_and_bubble, parts).reshape(-1, *on_levels.shape[1:])

    def entries(self, phase: int, stiffness: Array) -> Array:
        """Entries of all K_s of a phase in the pattern, (slices, node pairs, 4), C in Pa."""
        coefficients = stiffness[VOIGT[:, :, None, None], VOIGT]  # C[c, α, d, β]
        return self._products[phase] @ coefficients.transpose(1, 3, 0, 2).reshape(4, 4)

    def forces(self, phase: int, stiffness: Array, strains: Array) -> Array:
        """−⟨Bᵀ C ε̄⟩ of a phase under macroscopic strains (loads, 3), shape (loads, size)."""
        stress = (strains @ stiffness)[:, VOIGT]  # σ[load, c, α]
        return self._to_fields(-np.einsum("fca,sna->fsnc", stress, self._sums[phase]))

    def operator(self, entries: Array) -> Callable[[Array], Array]:
        """The product K x of fields x, (fields, size), with the stiffness of all slices."""
        matrix = self.pattern.block_matrix(entries)

        def product(x: Array) -> Array:
            slices = self._to_slices(x).reshape(len(x), -1)
            return self._to_fields(np.array([matrix @ column for column in slices]))

        return product

    def solve(
        self, entries: Array, loads: Array, rtol: float
    )

    def _to_slices(self, fields: Array) -> Array:
        """T_s x of all slices s, shape (fields, slices, nodes, 2)."""
        hats, bubbles = self.numbering.hats_and_bubbles(fields)
        a, b, c = self._hats_and_bubble[:, :, None]
        inner = hats[:, :-1, None] * a + hats[:, 1:, None] * b
