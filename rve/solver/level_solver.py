"""Conjugate gradients for all loads at once, preconditioned along θ, on one rank.

The preconditioner is that of `theta_preconditioner`, in hats and bubbles throughout. All its blocks
are one block-diagonal matrix, whose symbolic factor is kept from map to map.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

from alphacut.fuzzy.arrays import Array, Ints
from alphacut.rve.fenicsx import PETSc, cholesky
from alphacut.rve.interruption import uninterrupted
from alphacut.rve.solver.krylov import MAX_ITERATIONS, ConvergenceError
from alphacut.rve.solver.numbering import LevelNumbering
from alphacut.rve.solver.theta_preconditioner import LEVEL, PREFIX, ThetaMass, injection

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

    A field is the hats of all levels, then the bubbles of all mid-levels: shape (fields, size).

    Args:
        numbering: Unknowns.
        indptr: Start of each node's neighbours in `indices`, of the pattern of a plane cell.
        indices: Neighbours of the nodes, one after another.
    """

    def __init__(self, numbering: LevelNumbering, indptr: Ints, indices: Ints) -> None:
        self._layers, self._half_size = numbering.grid.layers, numbering.mid_level_size
        self._hats_size = (self._layers + 1) * numbering.level_size
        self._indptr, self._indices, self._injection = indptr, indices, injection(numbering)
        bubble_pattern = self._find_bubble_pattern()
        counts = 4 * len(indices) * (self._layers + 1), 4 * len(bubble_pattern[1]) * self._layers
        # every entry of all blocks by its number from 1 on, to find its place in the whole matrix
        numbers = np.asarray(np.arange(1, sum(counts) + 1), float)
        levels = numbers[: counts[0]].reshape(self._layers + 1, -1)
        mid_levels = numbers[counts[0] :].reshape(self._layers, -1)
        stacks = stacked(levels, indptr, indices), stacked(mid_levels, *bubble_pattern)
        blocks = sp.block_diag([stack.tocsr() for stack in stacks], "csr")
        blocks.sort_indices()
        self._order = blocks.data.astype(int) - 1
        starts, columns = (x.astype(PETSc.IntType) for x in (blocks.indptr, blocks.indices))
        self._values = np.zeros(len(self._order))
        self._matrix = PETSc.Mat().createAIJWithArrays(
            blocks.shape, (starts, columns, self._values), comm=PETSc.COMM_SELF
        )
        self._ksp = cholesky(self._matrix, PREFIX + LEVEL)

    def _find_bubble_pattern(self) -> tuple[Ints, Ints]:
        """Pattern of Jᵀ K_s J, whose entries `_bubble_sums` adds from those of K_s."""
        J = self._injection[::2, ::2]  # of nodes; a row has two entries at most
        slots = J.indptr[:-1, None] + np.arange(2)
        weights = np.where(slots < J.indptr[1:, None], np.append(J.data, 0.0)[slots], 0.0)
        vertices = np.append(J.indices, 0)[np.minimum(slots, J.nnz)]
        row, column = np.repeat(np.arange(J.shape[0]), np.diff(self._indptr)), self._indices
        products = weights[row][:, :, None] * weights[column][:, None]
        keys = vertices[row][:, :, None] * J.shape[1] + vertices[column][:, None]
        pair, a, b = np.nonzero(products)
        found, place = np.unique(keys[pair, a, b], return_inverse=True)
        shape = len(found), len(row)
        self._bubble_sums = sp.csr_matrix((products[pair, a, b], (place, pair)), shape)
        starts = np.searchsorted(found, np.arange(J.shape[1] + 1) * J.shape[1])
        return starts, found % J.shape[1]

    def split(self, fields: Array) -> tuple[Array, Array]:
        """Views of the hats, (fields, layers + 1, n), and the bubbles, (fields, layers, v)."""
        hats, bubbles = fields[:, : self._hats_size], fields[:, self._hats_size :]
        shapes = (len(fields), self._layers + 1, -1), (len(fields), self._layers, -1)
        return hats.reshape(shapes[0]), bubbles.reshape(shapes[1])

    def inject(self, bubbles: Array) -> Array:
        """J b, shape (…, n), of bubbles (…, v)."""
        flat = self._injection @ bubbles.reshape(-1, bubbles.shape[-1]).T
        return np.ascontiguousarray(flat.T).reshape(*bubbles.shape[:-1], -1)

    def restrict(self, values: Array) -> Array:
        """Jᵀ r, shape (…, v), of values (…, n)."""
        flat = self._injection.T @ values.reshape(-1, values.shape[-1]).T
        return np.ascontiguousarray(flat.T).reshape(*values.shape[:-1], -1)

    def factorise(self, hats: Array, bubbles: Array, mass: ThetaMass) -> None:
        """Factorise the blocks of levels, (layers + 1, 4 node pairs), and of mid-levels.

        Those of mid-levels are in all nodes, shape (layers, 4 node pairs).
        """
        self._mass = mass
        of_vertices = [self._bubble_sums @ block.reshape(-1, 4) for block in bubbles]
        scaled = np.array(of_vertices) / mass.bubbles[:, None, None]
        values = (hats / mass.hats[:, None]).ravel(), scaled.ravel()
        self._values[:] = np.concatenate(values)[self._order]
        del values, of_vertices, scaled  # before the factors take their memory
        self._matrix.assemble()  # says that the values are new; the pattern and its analysis stay
        self._ksp.setOperators(self._matrix)
        self._ksp.setUp()

    def __call__(self, residual: Array) -> Array:
        """P⁻¹ r of residuals (fields, size): see the head of `theta_preconditioner`."""
        mass, (hats, bubbles) = self._mass, self.split(residual)
        load, solution = np.empty_like(residual), np.empty_like(residual)
        level_loads, mid_level_loads = self.split(load)
        projected = mass.bubble_inverse_root @ mass.projection.T @ hats
        level_loads[:] = mass.inverse_root @ hats
        mid_level_loads[:] = mass.bubble_inverse_root @ bubbles - self.restrict(projected)
        columns = [
            PETSc.Mat().createDense(x.T.shape, array=x.T, comm=PETSc.COMM_SELF)
            for x in (load, solution)
        ]
        for matrix in columns:
            matrix.assemble()
        self._ksp.matSolve(*columns)
        hats, bubbles = self.split(solution)
        bubbles[:] = mass.bubble_inverse_root @ bubbles
        hats[:] = mass.inverse_root @ hats - mass.projection @ self.inject(bubbles)
        return solution

    def norms(self, forces: Array) -> Array:
        """Norms of the forces on nodes, shape (fields,), of those on hats and bubbles."""
        hats, bubbles = self.split(forces)
        on_levels = hats.copy()
        for levels in (on_levels[:, :-1], on_levels[:, 1:]):
            levels[..., : self._half_size] -= bubbles / 2
        return np.asarray(np.sqrt((on_levels**2).sum(axis=(1, 2)) + (bubbles**2).sum(axis=(1, 2))))


def stacked(entries: Array, indptr: Ints, indices: Ints) -> sp.bsr_matrix:
    """Block-diagonal matrix of blocks of one pattern, from entries (blocks, 4 node pairs)."""
    count, nodes = len(entries), len(indptr) - 1
    number = np.arange(count)[:, None]
    starts = np.append(0, (number * len(indices) + indptr[1:]).ravel())
    columns = (number * nodes + indices).ravel()
    return sp.bsr_matrix((entries.reshape(-1, 2, 2), columns, starts), (2 * count * nodes,) * 2)
