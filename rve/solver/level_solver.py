"""Conjugate gradients for all loads at once, preconditioned along θ, on one rank.

The preconditioner is that of `theta_preconditioner`, in hats and bubbles throughout. All its blocks
are one block-diagonal matrix, whose symbolic factor is kept from map to map.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

from alphacut.base.arrays import Array, Ints
from alphacut.rve.fenicsx import PETSc, cholesky
from alphacut.rve.interruption import uninterrupted
from alphacut.rve.solver.krylov import MAX_ITERATIONS, ConvergenceError
from alphacut.rve.solver.numbering import LevelNumbering
from alphacut.rve.solver.theta_preconditioner import (
    LEVEL,
    PREFIX,
    Fields,
    ThetaMass,
    injection,
    interpolated_vertices,
    precondition,
)

LOG = logging.getLogger(__name__)
Operator = Callable[[Array], Array]


@uninterrupted(second_ends=True)
def conjugate_gradients(
    operator: Operator, preconditioner: LevelSolver, loads: Array, rtol: float
) -> tuple[Array, tuple[int, ...]]:
    """Solutions of A x = b for loads b, (loads, size), and the number of iterations of each.

    Preconditioned conjugate gradients with the names of Saad, Iterative Methods, algorithm 9.1;
    loads share no more than the calls of operator and preconditioner. A load ends at |r| ≤ rtol |b|
    of the forces on nodes.

    Raises:
        ConvergenceError: A load does not end within `MAX_ITERATIONS`.
    """
    x, r = np.zeros_like(loads), loads.copy()
    bounds = rtol * preconditioner.norms(loads)
    p, rz, iterations = np.zeros_like(loads), np.ones(len(loads)), np.zeros(len(loads), int)
    while (is_open := ~(preconditioner.norms(r) <= bounds)).any():
        if iterations.max() >= MAX_ITERATIONS or not np.isfinite(r).all():
            raise ConvergenceError(
                f"cg with the preconditioner along θ stopped after {iterations.max()} iterations"
                " without reaching its tolerance",
                "take more layers, or another solver by PETSc's options",
            )
        z = preconditioner(r)
        rz, rz_before = (r * z).sum(axis=1), rz
        p = z + np.where(iterations > 0, rz / rz_before, 0.0)[:, None] * p
        Ap = operator(p)
        with np.errstate(divide="ignore", invalid="ignore"):  # of a load that has ended with r = 0
            alpha = np.where(is_open, rz / (p * Ap).sum(axis=1), 0.0)[:, None]
        x += alpha * p
        r -= alpha * Ap
        iterations += is_open
    LOG.debug("cg with theta: %s iterations", iterations)
    return x, tuple(map(int, iterations))


class LevelSolver:
    """P⁻¹ of `theta_preconditioner` for many fields at once.

    Fields are split into hats and bubbles by the numbering.

    Args:
        numbering: Unknowns.
        indptr: Start of each node's neighbours in `indices`, of the pattern of a plane cell.
        indices: Neighbours of the nodes, one after another.
    """

    def __init__(self, numbering: LevelNumbering, indptr: Ints, indices: Ints) -> None:
        self._numbering, self._indptr, self._indices = numbering, indptr, indices
        self.injection = injection(numbering)
        self._find_reduced_pattern()
        self._ksp: PETSc.KSP | None = None

    def _find_reduced_pattern(self) -> None:
        """Find the pattern of Jᵀ K J, and the matrix that gives its entries from those of K.

        The entries are (Jᵀ K J)_ij = Σ_ab J_ai K_ab J_bj with J_ai = 1/2 for each of the two
        vertices i of node a. SciPy's product Jᵀ K J would leave out sums that are zero by chance,
        so that its pattern depends on the stiffness.
        """
        ends, pairs = interpolated_vertices(self._numbering), len(self._indices)
        vertices = self._numbering.mid_level_size // 2
        nodes = np.repeat(np.arange(len(ends)), np.diff(self._indptr))
        row, column = ends[nodes][:, :, None], ends[self._indices][:, None, :]
        is_free = (row >= 0) & (column >= 0)
        keys, place = np.unique((row * vertices + column)[is_free], return_inverse=True)
        pair = np.broadcast_to(np.arange(pairs)[:, None, None], is_free.shape)[is_free]
        quarters = np.full(len(place), 0.25), (place, pair)
        self._reduction = sp.csr_matrix(quarters, (len(keys), pairs))
        self._reduced_indptr = np.searchsorted(keys, np.arange(vertices + 1) * vertices)
        self._reduced_indices = keys % vertices

    def factorise(self, hats: Array, bubbles: Array, mass: ThetaMass) -> None:
        """Factorise the blocks of levels, (layers + 1, 4 node pairs), and of mid-levels.

        Those of mid-levels are in all nodes, shape (layers, 4 node pairs).
        """
        self._mass, blocks = mass, self._blocks(hats, bubbles, mass)
        if self._ksp is None:
            diagonal = sp.block_diag(blocks, "csr")
            starts, columns = (x.astype(PETSc.IntType) for x in (diagonal.indptr, diagonal.indices))
            self._values = diagonal.data
            self._matrix = PETSc.Mat().createAIJWithArrays(
                diagonal.shape, (starts, columns, self._values), comm=PETSc.COMM_SELF
            )
            self._ksp = cholesky(self._matrix, PREFIX + LEVEL)
        np.concatenate([block.data for block in blocks], out=self._values)
        del blocks  # before the factors take their memory
        self._matrix.assemble()  # says that the values are new; the pattern and its analysis stay
        self._ksp.setOperators(self._matrix)
        self._ksp.setUp()

    def _blocks(self, hats: Array, bubbles: Array, mass: ThetaMass) -> list[sp.csr_matrix]:
        """Return diag(K_k) and diag(K_b), sorted; those of bubbles are Jᵀ K J."""
        levels = stacked(hats / mass.hats[:, None], self._indptr, self._indices)
        pairs = (bubbles / mass.bubbles[:, None]).reshape(len(bubbles), -1, 4)
        entries = np.array([self._reduction @ layer for layer in pairs])
        reduced = stacked(entries, self._reduced_indptr, self._reduced_indices)
        return [levels.tocsr(), reduced.tocsr()]

    def __call__(self, residual: Array) -> Array:
        """P⁻¹ r of residuals, shape (fields, size)."""
        return joined(
            *precondition(self._mass, self.injection, self._numbering.split(residual), self._solve)
        )

    def _solve(self, hats: Array, bubbles: Array) -> Fields:
        load = joined(hats, bubbles)
        solution = np.empty_like(load)
        columns = [
            PETSc.Mat().createDense(x.T.shape, array=x.T, comm=PETSc.COMM_SELF)
            for x in (load, solution)
        ]
        for matrix in columns:
            matrix.assemble()
        assert self._ksp is not None
        self._ksp.matSolve(*columns)
        return self._numbering.split(solution)

    def norms(self, forces: Array) -> Array:
        """Norms of the forces on nodes, shape (fields,), of those on hats and bubbles."""
        hats, bubbles = self._numbering.split(forces)
        on_levels = hats.copy()
        for levels in (on_levels[:, :-1], on_levels[:, 1:]):
            levels[..., : self._numbering.mid_level_size] -= bubbles / 2
        return np.asarray(np.sqrt((on_levels**2).sum(axis=(1, 2)) + (bubbles**2).sum(axis=(1, 2))))


def stacked(entries: Array, indptr: Ints, indices: Ints) -> sp.bsr_matrix:
    """Block-diagonal matrix of blocks of one pattern, from entries (blocks, 4 node pairs)."""
    count, nodes = len(entries), len(indptr) - 1
    number = np.arange(count)[:, None]
    starts = np.append(0, (number * len(indices) + indptr[1:]).ravel())
    columns = (number * nodes + indices).ravel()
    return sp.bsr_matrix((entries.reshape(-1, 2, 2), columns, starts), (2 * count * nodes,) * 2)


def joined(hats: Array, bubbles: Array) -> Array:
    """Fields, (fields, size), of their hats and bubbles."""
    return np.concatenate([x.reshape(len(x), -1) for x in (hats, bubbles)], axis=1)
