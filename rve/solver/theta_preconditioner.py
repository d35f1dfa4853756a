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
    """Return the masses along θ of hat functions at levels and of bubble functions between them.

    A hat is linear in each layer, 1 at its level and 0 at all others. A bubble is 4 t (1 − t) in
    its layer, with t from 0 to 1. A mass is the integral of the product of two of them times the
    density of θ.

    Args:
        distribution: Distribution of θ, whose density is the weight; it must be positive at some
            quadrature points of each layer, else the masses are singular.
        levels: θ of the levels, rising, shape (layers + 1,).

    Returns:
        `hats` and `bubbles`, the diagonals of their masses, shape (layers + 1,) and (layers,);
        `inverse_root`, the symmetric M^-½ of the mass M of the hats; `bubble_inverse_root`, G^-½ of
        the mass G of the bubbles made orthogonal to the hats; and `projection`, M⁻¹ M_hb, of
        bubbles on hats, shape (layers + 1, layers).

    Raises:
        numpy.linalg.LinAlgError: The mass of the hats is singular.
    """
    layers = len(levels) - 1
    # Three points of Gauss in a layer are exact for products of two bubbles, of degree 4, where the
    # density is constant. The stiffness uses the same points, so that both have the same error.
    points = 3
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
    """Apply the preconditioner to residuals in hat and bubble functions of θ.

    M is the mass of the hats along θ, G the mass of the bubbles made orthogonal to the hats, and W
    = M⁻¹ M_hb the projection of bubbles on hats. J is the injection of linear into quadratic
    triangles. K_k and K_b are the diagonal blocks of the stiffness for hats and bubbles, each
    divided by its mass. The preconditioner is

        P⁻¹ = (M^-½ ⊗ 1) diag(K_k⁻¹) (M^-½ ⊗ 1) + Z J (G^-½ ⊗ 1) diag(K_b⁻¹) (G^-½ ⊗ 1) Jᵀ Zᵀ,

    where Z = (−W; 1) makes bubbles orthogonal to the hats.

    Args:
        mass: Masses along θ.
        injection: J, shape (n, v) for n unknowns of a plane and v of its vertices.
        residual: Hats, shape (…, layers + 1, n), and bubbles, shape (…, layers, v), of the
            residuals.
        solve: Function that returns diag(K_k⁻¹) and diag(K_b⁻¹) times hats and bubbles of these
            shapes. It is called once.

    Returns:
        Hats and bubbles of the corrections, in the shapes of `residual`.
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
        """Factorise the blocks of this rank's levels, then of its mid-levels; return this object.

        A mid-level is half-way between two levels of θ. Factors of an earlier call are replaced;
        its symbolic factors are kept.

        Args:
            distribution: Distribution of the random number θ.
            blocks: Diagonal blocks of the stiffness in hats (one at each level) and then in bubbles
                (one in each layer) of θ, with sorted indices. They keep their pattern from one call
                to the next.

        Raises:
            ValueError: There are more or fewer blocks than levels and mid-levels of this rank.
            numpy.linalg.LinAlgError: The mass of the hats along θ is singular, since the density
                is zero at too many points.
            PETSc.Error: A block cannot be factorised.
        """
        numbering = self._numbering
        self._mass = theta_mass(distribution, numbering.grid.level_thetas(distribution))
        hat_masses = self._mass.hats[numbering.levels]
        bubble_masses = self._mass.bubbles[numbering.mid_levels]
        masses = np.concatenate([hat_masses, bubble_masses])
        for number, (block, mass) in enumerate(zip(blocks, masses, strict=True)):
            if number == len(self._solvers):
                self._solvers.append(PlaneSolver(block))
            self._solvers[number].factorise(block.data / mass)
        return self

    def apply(self, _pc: PETSc.PC | None, residual: PETSc.Vec, result: PETSc.Vec) -> None:
        """Set the result to P⁻¹ residual; called by PETSc, after `set_up`.

        On one rank several residuals may stand one after another in a vector. On several ranks all
        must call.

        Args:
            residual: Residuals in nodal values, level by level: unknowns of level 0, of the
                mid-level above it, of level 1, and so on. This rank's part.
            result: Vector of the same layout, which is overwritten.
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
        """Solve the systems of all levels and mid-levels, of which each rank solves its own.

        There is one system, a diagonal block of the preconditioner, for each level of θ and for
        each mid-level, half-way between two levels.

        Args:
            hat_loads: Right-hand sides of the hats, shape (loads, levels, unknowns of a plane).
            bubble_loads: Right-hand sides of the bubbles, shape (loads, mid-levels, unknowns of
                vertices).

        Returns:
            The solutions on all ranks, in the shapes of the right-hand sides.
        """
        num_levels = len(self._numbering.levels)
        hats = self._solve_own(self._solvers[:num_levels], hat_loads, self._numbering.levels)
        bubbles = self._solve_own(
            self._solvers[num_levels:], bubble_loads, self._numbering.mid_levels
        )
        return hats, bubbles

    def _solve_own(self, solvers: Sequence[PlaneSolver], loads: Array, levels: range) -> Array:
        """Solve the systems of this rank's levels, and return the solutions of all ranks.

        Args:
            solvers: Solver of each of this rank's levels.
            loads: Right-hand sides, shape (fields, all levels, unknowns of a level).
            levels: This rank's levels, as many as solvers; the ranks have theirs one after another.

        Returns:
            Solutions on all levels, in the shape of `loads`.
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
        """Print the number of levels and the first one's solver, for ``-rve_ksp_view``.

        Args:
            viewer: PETSc's viewer of all ranks. Rank 0, which has level 0, prints its solver.
        """
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
        self.ksp = cholesky(self._matrix, PREFIX + "level_")

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
    """Yield the diagonal blocks of a stiffness in hat and bubble functions of θ, for this rank.

    First come the blocks of the hats at this rank's levels of θ, then those of the bubbles at its
    mid-levels, each half-way between two levels. A block is Tᵀ K T. T has a column for each unknown
    of a plane, with the values of the block's function of θ at its nodes on all levels and
    mid-levels. All ranks must take their first block together.

    Args:
        matrix: Assembled reduced stiffness K, with the unknowns level by level.
        numbering: Numbering of its unknowns.

    Yields:
        Sparse matrix with sorted indices, of the unknowns of a level or, for bubbles, of those of
        its vertices.
    """
    # The hat of a level also has values on the mid-level below it. Below the first level of this
    # rank that mid-level belongs to another rank, so its unknowns are fetched as well. Then this
    # rank has all entries that its products Tᵀ K T need.
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
    """Return the matrix J from displacements of vertices to those of all nodes of triangles.

    A vertex keeps its own displacement, a midpoint gets the mean of the vertices of its edge, where
    a held vertex counts as zero.

    Args:
        numbering: Numbers of the unknowns of a plane, with its six-node triangles.

    Returns:
        Sparse matrix from the unknowns of the vertices of a plane to those of all its nodes, two at
        each.
    """
    ends = interpolated_vertices(numbering)
    node, end = np.nonzero(ends >= 0)  # not of fixed vertices
    halves = np.full(len(node), 0.5)
    shape = len(ends), numbering.mid_level_size // 2
    scalar = sp.csr_matrix((halves, (node, ends[node, end])), shape)
    return sp.kron(scalar, sp.eye(2), "csr")


def interpolated_vertices(numbering: LevelNumbering) -> Ints:
    """Return the two vertices whose mean each free node of a plane gets, shape (free nodes, 2).

    Vertices and nodes are given by the numbers of their pairs of unknowns, under which vertices
    come first. For a vertex both are the vertex itself. For a midpoint of an edge they are the two
    ends of the edge, with −1 for an end that is held.

    Args:
        numbering: Numbers of the unknowns of a plane, with its six-node triangles.
    """
    plane = numbering.grid.plane
    unknown = numbering.planar
    vertices = np.arange(numbering.mid_level_size // 2)
    _, first = np.unique(unknown[plane.vertices :], return_index=True)  # a midpoint of each pair
    return np.concatenate([np.stack([vertices, vertices], axis=1), unknown[plane.ends[first]]])
