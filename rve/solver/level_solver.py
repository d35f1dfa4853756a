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
from alphacut.rve.solver.theta_preconditioner import (
    LEVEL,
    PREFIX,
    ThetaMass,
    injection,
    vertices_beside,
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

    A field is the hats of all levels, then the bubbles of all mid-levels: shape (fields, size).

    Args:
        numbering: Unknowns.
        indptr: Start of each node's neighbours in `indices`, of the pattern of a plane cell.
        indices: Neighbours of the nodes, one after another.
    """

    def __init__(self, numbering: LevelNumbering, indptr: Ints, indices: Ints) -> None:
        self._numbering, self._half_size = numbering, numbering.mid_level_size
        self._layers = numbering.grid.layers
        self._hats_size = (self._layers + 1) * numbering.level_size
        self._indptr, self._indices, self._injection = indptr, indices, injection(numbering)
        patterns = (indptr, indices), self._find_bubble_pattern()
        blocks, self._orders = zip(*(_compressed(*pattern) for pattern in patterns), strict=True)
        counts = self._layers + 1, self._layers
        matrix = sp.block_diag(
            [block for block, count in zip(blocks, counts, strict=True) for _ in range(count)],
            "csr",
        )
        starts, columns = (x.astype(PETSc.IntType) for x in (matrix.indptr, matrix.indices))
        self._values = matrix.data
        self._matrix = PETSc.Mat().createAIJWithArrays(
            matrix.shape, (starts, columns, self._values), comm=PETSc.COMM_SELF
        )
        self._ksp = cholesky(self._matrix, PREFIX + LEVEL)

    def _find_bubble_pattern(self) -> tuple[Ints, Ints]:
        """Pattern of Jᵀ K_s J, whose entries `_bubble_sums` adds from those of K_s."""
        ends, count = vertices_beside(self._numbering), self._numbering.periodicity.vertices
        row = ends[np.repeat(np.arange(len(ends)), np.diff(self._indptr))][:, :, None]
        column = ends[self._indices][:, None]
        is_free = (row >= 0) & (column >= 0)
        entries, entry_of = np.unique((row * count + column)[is_free], return_inverse=True)
        pair, quarters = (
            np.nonzero(is_free)[0],
            np.full(len(entry_of), 0.25),
        )  # J has ½ at both ends
        shape = len(entries), len(self._indices)
        self._bubble_sums = sp.csr_matrix((quarters, (entry_of, pair)), shape)
        return np.searchsorted(entries, np.arange(count + 1) * count), entries % count

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
        on_levels, on_mid_levels = np.split(self._values, [hats.size])  # views
        levels, mid_levels = on_levels.reshape(hats.shape), on_mid_levels.reshape(self._layers, -1)
        for k, diagonal in enumerate(mass.hats):
            levels[k] = hats[k, self._orders[0]] / diagonal
        for k, diagonal in enumerate(mass.bubbles):
            of_vertices = (self._bubble_sums @ bubbles[k].reshape(-1, 4)).ravel()
            mid_levels[k] = of_vertices[self._orders[1]] / diagonal
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


def _compressed(indptr: Ints, indices: Ints) -> tuple[sp.csr_matrix, Ints]:
    """Matrix of one block by rows, and the order of its entries in (node pairs, 4)."""
    numbers = np.arange(1, 4 * len(indices) + 1).astype(float)  # 0 would be no entry
    matrix = stacked(numbers[None], indptr, indices).tocsr()
    matrix.sort_indices()
    return matrix, matrix.data.astype(int) - 1
