"""A preconditioner that is exact where the cell does not change with θ.

On a prism mesh the stiffness is nearly a Kronecker product M ⊗ K of the mass matrix along θ,
M_jk = ∫ f_Θ φ_j φ_k dθ, and the stiffness K of a planar cell, which drifts with the radius from
level to level. A prism carries linear functions of θ (hats) on all nodes of its triangles and
quadratic ones on vertices. Take hats and bubbles of θ for a basis; the nodal value on a mid-level
(half-way between two levels) is then the bubble plus the mean of the hats at its ends. With

    K_k   the block of the hats of level k over M_kk,
    K_b   the block of the bubbles between two levels over theirs, that of linear triangles,
    G  =  M_bb − M_bh M⁻¹ M_hb,  the mass of bubbles made orthogonal to the hats,
    Z  =  (−M⁻¹ M_hb; 1),  what makes them so,
    J     the injection of linear into quadratic triangles,

the inverse for constant K is (M⁻¹ ⊗ K⁻¹) + Z G⁻¹ Zᵀ ⊗ J K_b⁻¹ Jᵀ. Symmetric square roots put the
drifting blocks in the middle:

    P⁻¹ = (M^-½ ⊗ 1) diag(K_k⁻¹) (M^-½ ⊗ 1) + Z J (G^-½ ⊗ 1) diag(K_b⁻¹) (G^-½ ⊗ 1) Jᵀ Zᵀ.

Both summands are positive semidefinite, their sum is definite; P is off by the second difference of
K between levels, so the number of iterations depends on neither mesh size nor contrast and falls
with more layers. Any symmetric PETSc preconditioner solves the levels (prefix ``rve_level_``).

Each rank solves for its own levels. M^-½ and G^-½ are full, so that all ranks gather the residuals
and the solutions of all levels.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy.sparse as sp

from alphacut.base.arrays import Array, Ints
from alphacut.rve.fenicsx import MPI, PETSc, aij, cholesky, columns
from alphacut.rve.solver.numbering import LevelNumbering
from alphacut.stochastic import ThetaDistribution
from alphacut.stochastic.theta.quadrature import level_rule

Fields = tuple[Array, Array]
"""Hats, shape (…, layers + 1, n), and bubbles, shape (…, layers, v), of n and v unknowns."""
PREFIX = "rve_"
"""Prefix of PETSc options of the whole system."""
LEVEL = "level_"
"""Prefix, after `PREFIX`, of options of the levels' solvers."""


@dataclass(frozen=True)
class ThetaMass:
    """Masses of hats and bubbles along θ.

    Args:
        hats: Diagonal of M, shape (layers + 1,).
        bubbles: Diagonal of M_bb, shape (layers,).
        inverse_root: M^-½, shape (layers + 1, layers + 1).
        bubble_inverse_root: G^-½, shape (layers, layers).
        projection: M⁻¹ M_hb, bubbles to hats, shape (layers + 1, layers).
    """

    hats: Array
    bubbles: Array
    inverse_root: Array
    bubble_inverse_root: Array
    projection: Array


def theta_mass(distribution: ThetaDistribution, levels: Array) -> ThetaMass:
    """Return the masses along θ of hats at the levels and of bubbles between them.

    Args:
        distribution: Distribution of θ, whose density is the weight.
        levels: θ of the levels, rising, shape (layers + 1,).
    """
    layers = len(levels) - 1
    points = 3  # of Gauss in a layer, exact for products of bubbles
    t = (np.polynomial.legendre.leggauss(points)[0] + 1) / 2
    shapes = np.array([1 - t, t, 4 * t * (1 - t)])  # lower hat, upper hat and bubble of a layer
    weights = level_rule(distribution, levels, points=points).weights.reshape(layers, points)
    layer_mass = np.einsum("lq,iq,jq->lij", weights, shapes, shapes)

    # Add up the layers: hats are numbered first, then bubbles.
    layer = np.arange(layers)
    number = np.stack([layer, layer + 1, layer + layers + 1], axis=1)
    size = 2 * layers + 1
    mass = np.zeros((size, size))
    np.add.at(mass, (number[:, :, np.newaxis], number[:, np.newaxis, :]), layer_mass)
    hats = mass[: layers + 1, : layers + 1]
    bubbles = mass[layers + 1 :, layers + 1 :]
    coupling = mass[: layers + 1, layers + 1 :]  # M_hb
    projection: Array = np.asarray(np.linalg.solve(hats, coupling), float)
    orthogonal_mass = bubbles - coupling.T @ projection  # G
    return ThetaMass(
        hats=hats.diagonal(),
        bubbles=bubbles.diagonal(),
        inverse_root=_inverse_root(hats),
        bubble_inverse_root=_inverse_root(orthogonal_mass),
        projection=projection,
    )


def _inverse_root(matrix: Array) -> Array:
    """Return the symmetric A^-½ of a symmetric positive definite matrix."""
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors / np.sqrt(values)) @ vectors.T)


def precondition(
    mass: ThetaMass,
    injection: sp.csr_matrix,
    residual: Fields,
    solve: Callable[[Array, Array], Fields],
) -> Fields:
    """Return P⁻¹ r in hats and bubbles, by the formula at the head of this file.

    Args:
        mass: Masses along θ.
        injection: J from linear to quadratic triangles, shape (n, v).
        residual: Hats and bubbles of r.
        solve: Function that returns diag(K_k⁻¹) and diag(K_b⁻¹) times hats and bubbles.
    """
    hats, bubbles = residual
    hat_root = mass.inverse_root  # M^-½
    bubble_root = mass.bubble_inverse_root  # G^-½
    projected = columnwise(injection.T, bubble_root @ mass.projection.T @ hats)
    hats, bubbles = solve(hat_root @ hats, bubble_root @ bubbles - projected)
    bubbles = bubble_root @ bubbles
    return hat_root @ hats - mass.projection @ columnwise(injection, bubbles), bubbles


def columnwise(matrix: sp.csr_matrix, values: Array) -> Array:
    """Return the product of a matrix, (m, n), with the last axis of values, (…, n): (…, m)."""
    product = matrix @ values.reshape(-1, values.shape[-1]).T
    return np.ascontiguousarray(product.T).reshape(*values.shape[:-1], -1)


class ThetaPreconditioner:
    """P⁻¹ of reduced stiffnesses of one numbering; a context of PETSc's ``pc_type python``.

    Args:
        numbering: Numbering of the unknowns.
        comm: Communicator.
    """

    def __init__(self, numbering: LevelNumbering, comm: MPI.Intracomm) -> None:
        self._numbering = numbering
        self._comm = comm
        self._injection = injection(numbering)
        self._nodal_values = numbering.nodal_values()
        self._solvers: list[PlaneSolver] = []

    def set_up(
        self, distribution: ThetaDistribution, blocks: Iterable[sp.csr_matrix]
    ) -> ThetaPreconditioner:
        """Factorise the blocks of this rank's levels, then mid-levels; return the preconditioner.

        Args:
            distribution: Distribution of θ.
            blocks: Diagonal blocks of the stiffness in hats and bubbles, with sorted indices. They
                keep their pattern from one call to the next.
        """
        numbering = self._numbering
        self._mass = theta_mass(distribution, numbering.grid.level_thetas(distribution))
        masses = [*self._mass.hats[numbering.levels], *self._mass.bubbles[numbering.mid_levels]]
        for number, (block, mass) in enumerate(zip(blocks, masses, strict=True)):
            if number == len(self._solvers):
                self._solvers.append(PlaneSolver(block))
            self._solvers[number].factorise(block.data / mass)
        return self

    def apply(self, _pc: PETSc.PC | None, residual: PETSc.Vec, result: PETSc.Vec) -> None:
        """Set the result to P⁻¹ residual; called by PETSc.

        On one rank several residuals may stand one after another in a vector.
        """
        numbering = self._numbering
        forces = self._gathered(residual.array_r).reshape(-1, numbering.size)
        fields = numbering.split((self._nodal_values.T @ forces.T).T)
        hats, bubbles = precondition(self._mass, self._injection, fields, self._solve)
        count = len(forces)
        flat = np.concatenate([hats.reshape(count, -1), bubbles.reshape(count, -1)], axis=1)
        values = self._nodal_values @ flat.T
        result.array[:] = values[numbering.rows.start : numbering.rows.stop].T.ravel()

    def _solve(self, hat_loads: Array, bubble_loads: Array) -> Fields:
        """Return the solutions of all levels and mid-levels, of which each rank solves its own."""
        num_levels = len(self._numbering.levels)
        hats = self._solve_own(self._solvers[:num_levels], hat_loads, self._numbering.levels)
        bubbles = self._solve_own(
            self._solvers[num_levels:], bubble_loads, self._numbering.mid_levels
        )
        return hats, bubbles

    def _solve_own(self, solvers: Sequence[PlaneSolver], loads: Array, levels: range) -> Array:
        """Return the solutions of all ranks, each by its solvers of its levels.

        Args:
            solvers: Solver of each of this rank's levels.
            loads: Right-hand sides, shape (fields, all levels, unknowns of a level).
            levels: This rank's levels.
        """
        solutions = np.empty((len(loads), len(levels), loads.shape[-1]))
        for k, (solver, level) in enumerate(zip(solvers, levels, strict=True)):
            solutions[:, k] = solver.solve(loads[:, level])
        return self._gathered(solutions, axis=1)

    def _gathered(self, part: Array, *, axis: int = 0) -> Array:
        """Return the parts of all ranks, one after another along an axis."""
        if self._comm.size == 1:
            return part
        return np.concatenate(self._comm.allgather(part), axis=axis)

    def view(self, _pc: PETSc.PC, viewer: PETSc.Viewer) -> None:
        """Print the number of levels and the first one's solver, for ``-rve_ksp_view``."""
        levels = self._numbering.levels
        mid_levels = self._numbering.mid_levels
        count = f"{len(levels)} levels and {len(mid_levels)} mid-levels on the first rank"
        viewer.printfASCII(f"    preconditioner along θ, {count}, each solved by\n")
        rank_viewer = viewer.getSubViewer(PETSc.COMM_SELF)
        if 0 in levels:  # on the rank that has it
            self._solvers[0].ksp.view(rank_viewer)
        viewer.restoreSubViewer(rank_viewer)


class PlaneSolver:
    """Solver of a level's block over its mass along θ, by default a Cholesky factor.

    Args:
        pattern: Matrix with the pattern of all blocks, whose indices are sorted. The symbolic
            factor of it is kept.
    """

    def __init__(self, pattern: sp.csr_matrix) -> None:
        self._values = np.ones(pattern.nnz)  # PETSc's matrix has its values in this array
        csr = self._values, pattern.indices, pattern.indptr
        self._matrix = aij(sp.csr_matrix(csr, pattern.shape))
        self.ksp = cholesky(self._matrix, PREFIX + LEVEL)

    def factorise(self, values: Array) -> None:
        """Factorise the matrix of the pattern with these values, in the order of CSR."""
        self._values[:] = values
        self._matrix.assemble()
        self.ksp.setOperators(self._matrix)
        self.ksp.setFromOptions()  # so that PETSc knows the options as used
        self.ksp.setUp()

    def solve(self, loads: Array) -> Array:
        """Return the solutions for some loads, shape (loads, size)."""
        solutions = np.empty(loads.shape)
        self.ksp.matSolve(columns(loads), columns(solutions))
        return solutions


def level_blocks(matrix: PETSc.Mat, numbering: LevelNumbering) -> Iterator[sp.csr_matrix]:
    """Yield the diagonal blocks of this rank's levels, then of its mid-levels, in hats and bubbles.

    Their indices are sorted.

    Args:
        matrix: Assembled reduced stiffness.
        numbering: Numbering of its unknowns.
    """
    # A hat has half of its value on the mid-level below too. Below the first level of this rank
    # that mid-level belongs to another rank, so that its unknowns are taken as well.
    rows = numbering.rows
    first = max(0, rows.start - numbering.mid_level_size)
    size = rows.stop - first
    span = PETSc.IS().createStride(size, first, 1, comm=PETSc.COMM_SELF)
    indptr, indices, values = matrix.createSubMatrices(span)[0].getValuesCSR()
    stiffness = sp.csr_matrix((values, indices, indptr), (size, size))
    hats, bubbles = numbering.split(np.arange(numbering.size))
    own = [*hats[numbering.levels], *bubbles[numbering.mid_levels]]
    T = numbering.nodal_values()[first : rows.stop][:, np.concatenate([np.empty(0, int), *own])]
    products = T.T.tocsr() @ stiffness @ T
    ends = np.cumsum([0, *map(len, own)])
    for start, stop in pairwise(ends):
        yield products[start:stop, start:stop].sorted_indices()


def injection(numbering: LevelNumbering) -> sp.csr_matrix:
    """Return the matrix J from linear to quadratic triangles.

    A midpoint gets the mean of the vertices of its edge.
    """
    ends = interpolated_vertices(numbering)
    node, end = np.nonzero(ends >= 0)  # not of fixed vertices
    halves = np.full(len(node), 0.5)
    shape = len(ends), numbering.mid_level_size // 2
    scalar = sp.csr_matrix((halves, (node, ends[node, end])), shape)
    return sp.kron(scalar, sp.eye(2), "csr")


def interpolated_vertices(numbering: LevelNumbering) -> Ints:
    """Return the two vertices whose mean each free node of a plane gets, −1 for a fixed one.

    Shape (nodes, 2), in numbers of the unknown pairs. A vertex has itself twice.
    """
    plane = numbering.grid.plane
    unknown = numbering.planar
    vertices = np.arange(numbering.mid_level_size // 2)
    _, first = np.unique(unknown[plane.vertices :], return_index=True)  # a midpoint of each pair
    return np.concatenate([np.stack([vertices, vertices], axis=1), unknown[plane.ends[first]]])
