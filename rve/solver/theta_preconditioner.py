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

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy.sparse as sp

from alphacut.base.arrays import Array, Ints
from alphacut.rve.fenicsx import MPI, PETSc, aij, cholesky, columns
from alphacut.rve.solver.numbering import LevelNumbering
from alphacut.stochastic import ThetaDistribution
from alphacut.stochastic.theta.quadrature import level_rule

Fields = tuple[Array, Array]  # hats and bubbles
PREFIX, LEVEL = "rve_", "level_"  # of PETSc options, and after it of the levels' solvers


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


def theta_mass(law: ThetaDistribution, levels: Array) -> ThetaMass:
    """Masses along θ, weighted by the density, of hats at the levels and bubbles between them."""
    layers, points = len(levels) - 1, 3
    t = (np.polynomial.legendre.leggauss(points)[0] + 1) / 2  # the points of a layer
    shapes = np.array([1 - t, t, 4 * t * (1 - t)])  # lower hat, upper hat, bubble of a layer
    density = level_rule(law, levels, points=points).weights.reshape(layers, points)
    layer_mass = np.einsum("lq,iq,jq->lij", density, shapes, shapes)
    k = np.arange(layers)
    number = np.stack([k, k + 1, k + layers + 1], axis=1)
    mass = np.zeros((2 * layers + 1,) * 2)
    np.add.at(mass, (number[:, :, None], number[:, None, :]), layer_mass)
    hats, bubbles = mass[: layers + 1, : layers + 1], mass[layers + 1 :, layers + 1 :]
    coupling = mass[: layers + 1, layers + 1 :]  # M_hb
    projection: Array = np.asarray(np.linalg.solve(hats, coupling), float)
    orthogonal_mass = bubbles - coupling.T @ projection  # G
    roots = _inverse_root(hats), _inverse_root(orthogonal_mass)
    return ThetaMass(hats.diagonal(), bubbles.diagonal(), *roots, projection)


def _inverse_root(matrix: Array) -> Array:
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors / np.sqrt(values)) @ vectors.T)


def precondition(
    mass: ThetaMass,
    injection: sp.csr_matrix,
    residual: Fields,
    solve: Callable[[Array, Array], Fields],
) -> Fields:
    """P⁻¹ r in hats, (…, layers + 1, n), and bubbles, (…, layers, v), as at the head of the file.

    `injection` is J, (n, v), and `solve` gives diag(K_k⁻¹) and diag(K_b⁻¹) times such values.
    """
    hats, bubbles = residual
    hat_root, bubble_root = mass.inverse_root, mass.bubble_inverse_root  # M^-½, G^-½
    projected = columnwise(injection.T, bubble_root @ mass.projection.T @ hats)
    hats, bubbles = solve(hat_root @ hats, bubble_root @ bubbles - projected)
    bubbles = bubble_root @ bubbles
    return hat_root @ hats - mass.projection @ columnwise(injection, bubbles), bubbles


def columnwise(matrix: sp.csr_matrix, values: Array) -> Array:
    """Product of a matrix, (m, n), with the last axis of values, (…, n); shape (…, m)."""
    product = matrix @ values.reshape(-1, values.shape[-1]).T
    return np.ascontiguousarray(product.T).reshape(*values.shape[:-1], -1)


class ThetaPreconditioner:
    """P⁻¹ of reduced stiffnesses of one numbering; a context of PETSc's ``pc_type python``."""

    def __init__(self, numbering: LevelNumbering, comm: MPI.Intracomm) -> None:
        self._numbering, self._comm = numbering, comm
        self._injection, self._nodal_values = injection(numbering), numbering.nodal_values()
        self._rank_levels = numbering.levels, numbering.mid_levels
        self._solvers: list[PlaneSolver] = []

    def set_up(
        self, law: ThetaDistribution, blocks: Iterable[sp.csr_matrix]
    ) -> ThetaPreconditioner:
        """Factorise the blocks of this rank's levels, then mid-levels; return the preconditioner.

        The blocks, in hats and bubbles and with sorted indices, keep their pattern from one call to
        the next.
        """
        numbering = self._numbering
        self._mass = theta_mass(law, numbering.grid.level_thetas(law))
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
        forces = self._gathered(residual.array_r).reshape(-1, self._numbering.size)
        fields = self._numbering.split((self._nodal_values.T @ forces.T).T)
        fields = precondition(self._mass, self._injection, fields, self._solve)
        flat = np.concatenate([x.reshape(len(forces), -1) for x in fields], axis=1)
        values = self._nodal_values @ flat.T
        result.array[:] = values[self._numbering.rows.start : self._numbering.rows.stop].T.ravel()

    def _solve(self, *loads: Array) -> Fields:
        """Solutions of all levels and of all mid-levels, of which each rank solves its own."""
        solvers, solutions = iter(self._solvers), []
        for load, rows in zip(loads, self._rank_levels, strict=True):
            solution = np.empty((len(load), len(rows), load.shape[-1]))
            for k, level in enumerate(rows):
                solution[:, k] = next(solvers).solve(load[:, level])
            solutions.append(self._gathered(solution, axis=1))
        hats, bubbles = solutions
        return hats, bubbles

    def _gathered(self, part: Array, *, axis: int = 0) -> Array:
        """Return the parts of all ranks, one after another along an axis."""
        if self._comm.size == 1:
            return part
        return np.concatenate(self._comm.allgather(part), axis=axis)

    def view(self, _pc: PETSc.PC, viewer: PETSc.Viewer) -> None:
        """Print the number of levels and the first one's solver, for ``-rve_ksp_view``."""
        levels, mid_levels = map(len, self._rank_levels)
        count = f"{levels} levels and {mid_levels} mid-levels on the first rank"
        viewer.printfASCII(f"    preconditioner along θ, {count}, each solved by\n")
        rank_viewer = viewer.getSubViewer(PETSc.COMM_SELF)
        if 0 in self._rank_levels[0]:  # on the rank that has it
            self._solvers[0].ksp.view(rank_viewer)
        viewer.restoreSubViewer(rank_viewer)


class PlaneSolver:
    """Solver of a level's block over its mass along θ, by default a Cholesky factor.

    The symbolic factor of the pattern, whose indices are sorted, is kept.
    """

    def __init__(self, pattern: sp.csr_matrix) -> None:
        self._values = np.ones(pattern.nnz)  # PETSc's matrix has its values here
        csr = self._values, pattern.indices, pattern.indptr
        self._matrix = aij(sp.csr_matrix(csr, pattern.shape))
        self.ksp = cholesky(self._matrix, PREFIX + LEVEL)

    def factorise(self, values: Array) -> None:
        """Factorise the matrix of the pattern with these values, in the order of CSR."""
        self._values[:] = values
        self._matrix.assemble()
        self.ksp.setOperators(self._matrix)
        self.ksp.setFromOptions()  # so that PETSc knows them as used
        self.ksp.setUp()

    def solve(self, loads: Array) -> Array:
        """Return the solutions for some loads, shape (loads, size)."""
        solutions = np.empty(loads.shape)
        self.ksp.matSolve(columns(loads), columns(solutions))
        return solutions


def level_blocks(matrix: PETSc.Mat, numbering: LevelNumbering) -> Iterator[sp.csr_matrix]:
    """Diagonal blocks of this rank's levels, then of its mid-levels, in hats and bubbles, sorted.

    `matrix` is an assembled reduced stiffness.
    """
    rows = numbering.rows
    # unknowns of other ranks are those of the mid-level below the first level alone
    first = max(0, rows.start - numbering.mid_level_size)
    span = PETSc.IS().createStride(rows.stop - first, first, 1, comm=PETSc.COMM_SELF)
    starts, columns, values = matrix.createSubMatrices(span)[0].getValuesCSR()
    stiffness = sp.csr_matrix((values, columns, starts), (rows.stop - first,) * 2)
    all_hats, all_bubbles = numbering.split(np.arange(numbering.size))
    hats, bubbles = all_hats[numbering.levels], all_bubbles[numbering.mid_levels]
    T = numbering.nodal_values()[first : rows.stop][:, np.append(hats, bubbles)]
    products = T.T.tocsr() @ stiffness @ T
    for start, stop in pairwise(np.cumsum([0, *map(len, hats), *map(len, bubbles)])):
        yield products[start:stop, start:stop].sorted_indices()


def injection(numbering: LevelNumbering) -> sp.csr_matrix:
    """Matrix J from linear to quadratic triangles; midpoints get the mean of their vertices."""
    ends = interpolated_vertices(numbering)
    node, end = np.nonzero(ends >= 0)  # not of fixed vertices
    halves = np.full(len(node), 0.5), (node, ends[node, end])
    shape = len(ends), numbering.mid_level_size // 2
    return sp.kron(sp.csr_matrix(halves, shape), sp.eye(2), "csr")


def interpolated_vertices(numbering: LevelNumbering) -> Ints:
    """Return the two vertices whose mean each free node of a plane gets, −1 for a fixed one.

    Shape (nodes, 2), in numbers of the unknown pairs. A vertex has itself twice.
    """
    plane, unknown = numbering.grid.plane, numbering.planar
    vertices = np.arange(numbering.mid_level_size // 2)
    first = np.unique(unknown[plane.vertices :], return_index=True)[1]  # node of each midpoint's
    return np.concatenate([np.stack([vertices, vertices], axis=1), unknown[plane.ends[first]]])
