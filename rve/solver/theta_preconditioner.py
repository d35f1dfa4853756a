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

Each rank solves for its own levels and forms its own rows of the products along θ. M^-½ and G^-½
are full, so that these need the vectors of all levels, which PETSc scatters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from alphacut.fuzzy.arrays import Array, Ints
from alphacut.rve.fenicsx import PETSc, cholesky
from alphacut.rve.solver.numbering import LevelNumbering
from alphacut.stochastic import ThetaLaw

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


def theta_mass(law: ThetaLaw, levels: Array) -> ThetaMass:
    """Masses along θ, weighted by the density, of hats at the levels and bubbles between them."""
    layers, heights = len(levels) - 1, np.diff(levels)[:, None]
    abscissae, gauss_weights = np.polynomial.legendre.leggauss(3)  # on [−1, 1]
    t, w = (abscissae + 1) / 2, gauss_weights / 2
    shapes = np.array([1 - t, t, 4 * t * (1 - t)])  # lower hat, upper hat, bubble of a layer
    density = heights * w * law.pdf(levels[:-1, None] + heights * t)
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
    """Inverse square root of a symmetric positive definite matrix."""
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors / np.sqrt(values)) @ vectors.T)


def plane_solver(block: PETSc.Mat, mass: float) -> PETSc.KSP:
    """Solver of one level's block over its mass along θ, by default a Cholesky factor."""
    block.scale(1 / mass)
    ksp = cholesky(block, PREFIX + LEVEL)
    ksp.setUp()
    return ksp


class ThetaPreconditioner:
    """P⁻¹ of a reduced stiffness; a context of PETSc's ``pc_type python``."""

    def __init__(self, matrix: PETSc.Mat, numbering: LevelNumbering, law: ThetaLaw) -> None:
        self.numbering = numbering
        self.mass = theta_mass(law, numbering.grid.level_thetas(law))
        self.injection = injection(numbering)
        self.rank_vector = matrix.createVecLeft()
        self.scatter, self.full_vector = PETSc.Scatter.toAll(self.rank_vector)
        sizes, layers = (numbering.level_size, numbering.mid_level_size), numbering.grid.layers
        blocks = self._blocks(matrix)
        self.levels = [
            plane_solver(
                block.PtAP(_hats(*sizes, below=k > 0, above=k < layers)), self.mass.hats[k]
            )
            for k, block in zip(numbering.levels, blocks, strict=False)
        ]
        self.mid_levels = [
            plane_solver(block, self.mass.bubbles[k])
            for k, block in zip(numbering.mid_levels, blocks[len(self.levels) :], strict=True)
        ]

    def _blocks(self, matrix: PETSc.Mat) -> list[PETSc.Mat]:
        """Diagonal blocks of each level with the mid-levels beside it, then of each mid-level."""
        numbering = self.numbering
        n, v, stride = numbering.level_size, numbering.mid_level_size, numbering.stride
        spans = [
            (max(0, k * stride - v), min(k * stride + n + v, numbering.size))
            for k in numbering.levels
        ]
        spans += [(k * stride + n, (k + 1) * stride) for k in numbering.mid_levels]
        # only the first span reaches into another rank, from which PETSc fetches slowly
        first, start = [_index_range(*span) for span in spans[:1]], numbering.rows.start
        others = [_index_range(a - start, b - start) for a, b in spans[1:]]
        rank_matrix = matrix.getDiagonalBlock()
        return [*matrix.createSubMatrices(first), *rank_matrix.createSubMatrices(others)]

    def apply(self, _pc: PETSc.PC, residual: PETSc.Vec, result: PETSc.Vec) -> None:
        """Set the result to P⁻¹ residual; called by PETSc."""
        numbering, v = self.numbering, self.numbering.mid_level_size
        # from nodal values to hats and bubbles (transposed), and back: see the head of the file
        hats, bubbles = numbering.split_levels(self._gather(residual))
        hats[:-1, :v] += bubbles / 2
        hats[1:, :v] += bubbles / 2
        self.rank_vector.array[:] = self._solve_levels(hats, bubbles)
        hats, bubbles = numbering.split_levels(self._gather(self.rank_vector))
        hats, bubbles = self._multiply_theta(hats, bubbles)
        layers = len(bubbles)
        bubbles += (hats[:layers, :v] + hats[1 : layers + 1, :v]) / 2
        result.array[:] = numbering.join_levels(hats[: len(self.levels)], bubbles)

    def _solve_levels(self, hats: Array, bubbles: Array) -> Array:
        """This rank's rows of diag(K⁻¹) (M^-½ ⊗ 1; (G^-½ ⊗ 1) Jᵀ Zᵀ) times hats and bubbles."""
        mass, numbering = self.mass, self.numbering
        root = mass.inverse_root[list(numbering.levels)]
        bubble_root = mass.bubble_inverse_root[list(numbering.mid_levels)]
        projected = (bubble_root @ mass.projection.T @ hats) @ self.injection  # Jᵀ
        on_levels = self._solve_rows(self.levels, root @ hats)
        on_mid_levels = self._solve_rows(self.mid_levels, bubble_root @ bubbles - projected)
        return numbering.join_levels(on_levels, on_mid_levels)

    def _multiply_theta(self, hats: Array, bubbles: Array) -> tuple[Array, Array]:
        """This rank's rows of (M^-½ ⊗ 1; Z J (G^-½ ⊗ 1)) times hats and bubbles."""
        mass, numbering = self.mass, self.numbering
        start = numbering.levels.start
        rows = slice(start, start + len(numbering.mid_levels) + 1)
        projected = mass.projection[rows] @ mass.bubble_inverse_root @ bubbles
        rank_hats = mass.inverse_root[rows] @ hats - projected @ self.injection.T  # J
        return rank_hats, mass.bubble_inverse_root[list(numbering.mid_levels)] @ bubbles

    def view(self, _pc: PETSc.PC, viewer: PETSc.Viewer) -> None:
        """Print the number of levels and the first one's solver, for ``-rve_ksp_view``."""
        count = f"{len(self.levels)} levels and {len(self.mid_levels)} mid-levels on the first rank"
        viewer.printfASCII(f"    preconditioner along θ, {count}, each solved by\n")
        rank_viewer = viewer.getSubViewer(PETSc.COMM_SELF)
        if 0 in self.numbering.levels:  # on the rank that has it
            self.levels[0].view(rank_viewer)
        viewer.restoreSubViewer(rank_viewer)

    def _gather(self, vector: PETSc.Vec) -> Array:
        self.scatter.scatter(vector, self.full_vector)
        return np.asarray(self.full_vector.array_r)

    @staticmethod
    def _solve_rows(solvers: list[PETSc.KSP], rows: Array) -> Array:
        """Solutions of this rank's blocks, one for each row."""
        solutions = np.empty_like(rows)
        for ksp, *arrays in zip(solvers, rows, solutions, strict=True):
            ksp.solve(*(PETSc.Vec().createWithArray(x, comm=PETSc.COMM_SELF) for x in arrays))
        return solutions


def _index_range(first: int, last: int) -> PETSc.IS:
    """Indices of this rank from `first` to below `last`."""
    return PETSc.IS().createStride(last - first, first, 1, comm=PETSc.COMM_SELF)


def _hats(level_size: int, half_size: int, *, below: bool, above: bool) -> PETSc.Mat:
    """Matrix from a level's unknowns to nodal values: 1 on it, ½ on mid-levels beside it."""
    half, level = sp.eye(half_size, level_size) / 2, sp.eye(level_size)
    stacked = sp.vstack([half] * below + [level] + [half] * above, "csr")
    csr = stacked.indptr.astype(PETSc.IntType), stacked.indices.astype(PETSc.IntType)
    return PETSc.Mat().createAIJ(stacked.shape, csr=(*csr, stacked.data), comm=PETSc.COMM_SELF)


def vertices_beside(numbering: LevelNumbering) -> Ints:
    """Vertices at both ends of each node's edge, itself twice if it is one, −1 where fixed."""
    periodicity = numbering.periodicity
    vertices = np.repeat(np.arange(periodicity.vertices), 2).reshape(-1, 2)
    return np.concatenate([vertices, periodicity.ends(numbering.grid.plane)])


def injection(numbering: LevelNumbering) -> sp.csr_matrix:
    """Matrix J from linear to quadratic triangles; midpoints get the mean of their vertices."""
    ends, vertices = vertices_beside(numbering), numbering.periodicity.vertices
    node, end = np.nonzero(ends >= 0)
    halves = np.full(len(node), 0.5), (node, ends[node, end])
    return sp.kron(sp.csr_matrix(halves, (len(ends), vertices)), sp.eye(2), "csr")
