"""A preconditioner that is exact where the cell does not change with θ.

On a prism mesh the stiffness is nearly a Kronecker product M ⊗ K of the mass matrix along θ,
M_jk = ∫ f_Θ φ_j φ_k dθ, and the stiffness K of a planar cell, which drifts with the radius from
level to level. A prism carries linear functions of θ (hats) on all nodes of its triangles and
quadratic ones on vertices. Take hats and bubbles of θ for a basis; the nodal value half-way is then
the bubble plus the mean of the hats at its ends. With

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

from alphacut.fuzzy.arrays import Array
from alphacut.rve.fenicsx import PETSc, cholesky
from alphacut.rve.solver.numbering import LevelNumbering
from alphacut.rve.solver.options import LEVEL, PREFIX
from alphacut.stochastic import ThetaLaw


@dataclass(frozen=True)
class ThetaMass:
    """Masses of hats and bubbles along θ.

    Args:
        hats: Diagonal of M, shape (layers + 1,).
        bubbles: Diagonal of M_bb, shape (layers,).
        root: M^-½, shape (layers + 1, layers + 1).
        excess: G^-½, shape (layers, layers).
        shift: M⁻¹ M_hb, shape (layers + 1, layers).
    """

    hats: Array
    bubbles: Array
    root: Array
    excess: Array
    shift: Array


def theta_mass(law: ThetaLaw, levels: Array) -> ThetaMass:
    """The masses on the levels θ_k, shape (layers + 1,), by the rule of the prisms."""
    layers, heights = len(levels) - 1, np.diff(levels)[:, None]
    abscissae, double = np.polynomial.legendre.leggauss(3)
    t, w = (abscissae + 1) / 2, double / 2
    shapes = np.array([1 - t, t, 4 * t * (1 - t)])
    density = heights * w * law.pdf(levels[:-1, None] + heights * t)
    local = np.einsum("lq,iq,jq->lij", density, shapes, shapes)
    k = np.arange(layers)
    number = np.stack([k, k + 1, k + layers + 1], axis=1)
    mass = np.zeros((2 * layers + 1,) * 2)
    np.add.at(mass, (number[:, :, None], number[:, None, :]), local)
    hats, between, bubbles = (
        mass[: layers + 1, : layers + 1],
        mass[: layers + 1, layers + 1 :],
        mass[layers + 1 :, layers + 1 :],
    )
    shift: Array = np.asarray(np.linalg.solve(hats, between), float)
    root, excess = _inverse_root(hats), _inverse_root(bubbles - between.T @ shift)
    return ThetaMass(hats.diagonal(), bubbles.diagonal(), root, excess, shift)


def _inverse_root(matrix: Array) -> Array:
    """The symmetric positive definite matrix to the power −½."""
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors / np.sqrt(values)) @ vectors.T)


class PlaneSolver:
    """A solver of one level, by default a Cholesky factor.

    Args:
        block: The level's block.
        mass: Its mass along θ, by which it is divided.
    """

    def __init__(self, block: PETSc.Mat, mass: float) -> None:
        block.scale(1 / mass)
        self._ksp = cholesky(block, PREFIX + LEVEL)
        self._ksp.setUp()
        self._solution, self._load = block.createVecs()

    def __call__(self, load: Array) -> Array:
        """Solution for a load, shape (n,)."""
        self._load.array[:] = load
        self._ksp.solve(self._load, self._solution)
        return np.array(self._solution.array_r)

    def view(self, viewer: PETSc.Viewer) -> None:
        """Show the solver."""
        self._ksp.view(viewer)


class ThetaPreconditioner:
    """P⁻¹ of a reduced stiffness; a context of PETSc's ``pc_type python``.

    Args:
        matrix: The reduced stiffness.
        numbering: Its unknowns.
        law: Law of θ.
    """

    def __init__(self, matrix: PETSc.Mat, numbering: LevelNumbering, law: ThetaLaw) -> None:
        self.numbering = numbering
        self.mass = theta_mass(law, numbering.grid.levels(law))
        self.injection = _injection(numbering)
        self.own = matrix.createVecLeft()
        self.scatter, self.whole = PETSc.Scatter.toAll(self.own)
        n, v, layers = numbering.planar, numbering.between, numbering.grid.layers
        parts = self._blocks(matrix)
        self.levels = [
            PlaneSolver(part.PtAP(_hat(n, v, below=k > 0, above=k < layers)), self.mass.hats[k])
            for k, part in zip(numbering.levels, parts, strict=False)
        ]
        self.middles = [
            PlaneSolver(part, self.mass.bubbles[k])
            for k, part in zip(numbering.middles, parts[len(self.levels) :], strict=True)
        ]

    def _blocks(self, matrix: PETSc.Mat) -> list[PETSc.Mat]:
        """Blocks of this rank's levels with what is half-way beside them, and of that alone."""
        numbering = self.numbering
        n, v, stride = numbering.planar, numbering.between, numbering.stride
        spans = [
            (max(0, k * stride - v), min(k * stride + n + v, numbering.size))
            for k in numbering.levels
        ]
        spans += [(k * stride + n, (k + 1) * stride) for k in numbering.middles]
        # the first level alone has a part on another rank, and what PETSc fetches is slow
        first, start = [_stride(*span) for span in spans[:1]], numbering.rows.start
        others = [_stride(a - start, b - start) for a, b in spans[1:]]
        own = matrix.getDiagonalBlock()
        return [*matrix.createSubMatrices(first), *own.createSubMatrices(others)]

    def apply(self, _pc: PETSc.PC, residual: PETSc.Vec, result: PETSc.Vec) -> None:
        """Result = P⁻¹ residual, called by PETSc."""
        numbering, corners = self.numbering, self.numbering.between
        hats, bubbles = numbering.by_level(self._of_all_ranks(residual))
        hats[:-1, :corners] += bubbles / 2
        hats[1:, :corners] += bubbles / 2
        self.own.array[:] = self._solved_levels(hats, bubbles)
        hats, bubbles = numbering.by_level(self._of_all_ranks(self.own))
        hats, bubbles = self._own_rows(hats, bubbles)
        half = len(bubbles)
        bubbles += (hats[:half, :corners] + hats[1 : half + 1, :corners]) / 2
        result.array[:] = numbering.from_levels(hats[: len(self.levels)], bubbles)

    def _solved_levels(self, hats: Array, bubbles: Array) -> Array:
        """This rank's part of diag(K⁻¹) (M^-½ ⊗ 1; (G^-½ ⊗ 1) Jᵀ Zᵀ) on hats and bubbles."""
        mass = self.mass
        root, excess = (
            mass.root[list(self.numbering.levels)],
            mass.excess[list(self.numbering.middles)],
        )
        orthogonal = excess @ bubbles - (excess @ mass.shift.T @ hats) @ self.injection  # Jᵀ
        return self.numbering.from_levels(
            self._solved(self.levels, root @ hats), self._solved(self.middles, orthogonal)
        )

    def _own_rows(self, hats: Array, bubbles: Array) -> tuple[Array, Array]:
        """(M^-½ ⊗ 1; Z J (G^-½ ⊗ 1)) on this rank's levels, with the one above, and half-way."""
        numbering, mass = self.numbering, self.mass
        reach = len(numbering.middles) + 1  # the level above takes part in the values half-way
        rows = slice(numbering.levels.start, numbering.levels.start + reach)
        shifted = (mass.shift[rows] @ mass.excess @ bubbles) @ self.injection.T  # J
        return mass.root[rows] @ hats - shifted, mass.excess[list(numbering.middles)] @ bubbles

    def view(self, _pc: PETSc.PC, viewer: PETSc.Viewer) -> None:
        """Show the solver of a level, called by PETSc for ``-rve_ksp_view``."""
        count = f"{len(self.levels)} levels and {len(self.middles)} half-way on the first rank"
        viewer.printfASCII(f"    preconditioner along θ, {count}, each solved by\n")
        of_rank = viewer.getSubViewer(PETSc.COMM_SELF)
        if 0 in self.numbering.levels:  # like all others
            self.levels[0].view(of_rank)
        viewer.restoreSubViewer(of_rank)

    def _of_all_ranks(self, vector: PETSc.Vec) -> Array:
        self.scatter.scatter(vector, self.whole)
        return np.asarray(self.whole.array_r)

    @staticmethod
    def _solved(solvers: list[PlaneSolver], rows: Array) -> Array:
        """Solutions of this rank's blocks, one for each row."""
        solutions = [solver(rows[k]) for k, solver in enumerate(solvers)]
        return np.array(solutions).reshape(rows.shape)


def _stride(first: int, last: int) -> PETSc.IS:
    """Indices of this rank from `first` to below `last`."""
    return PETSc.IS().createStride(last - first, first, 1, comm=PETSc.COMM_SELF)


def _hat(planar: int, corners: int, *, below: bool, above: bool) -> PETSc.Mat:
    """Nodal values of a level's hats: half on the vertices half-way below and above."""
    half, level = sp.eye(corners, planar) / 2, sp.eye(planar)
    stacked = sp.vstack([half] * below + [level] + [half] * above, "csr")
    csr = stacked.indptr.astype(PETSc.IntType), stacked.indices.astype(PETSc.IntType)
    return PETSc.Mat().createAIJ(stacked.shape, csr=(*csr, stacked.data), comm=PETSc.COMM_SELF)


def _injection(numbering: LevelNumbering) -> sp.csr_matrix:
    """J: a linear field on vertices, carried on to edge midpoints, shape (planar, between)."""
    corners, ends = numbering.periodicity.vertices, numbering.periodicity.ends(numbering.grid.plane)
    rows, is_free = np.arange(corners, numbering.periodicity.count), ends >= 0
    middle = sp.csr_matrix(
        (np.full(is_free.sum(), 0.5), (np.repeat(rows, 2).reshape(-1, 2)[is_free], ends[is_free])),
        (numbering.periodicity.count, corners),
    )
    linear = middle + sp.eye(numbering.periodicity.count, corners)
    return sp.kron(linear, sp.eye(2), "csr")
