"""A preconditioner that is exact where the cell does not change with θ.

On a prism mesh the stiffness is nearly a Kronecker product, M ⊗ K with the mass matrix M along θ
and the planar stiffness K; only the planar factor drifts from level to level with the radius. With
Cholesky factors K(θ_k) = L_k L_kᵀ in one common order the matrix

    L (M ⊗ I) Lᵀ,   L = diag(L_0, L_1, …)

has the blocks M_jk L_j L_kᵀ, which differ from the true ones by the second difference of K between
neighbouring levels. Its inverse costs one forward and one backward substitution per level, the same
as a block-diagonal preconditioner, and leaves an iteration count that depends neither on the mesh
size nor on the contrast and falls with more layers.

A serendipity wedge carries quadratic functions of θ on vertices and linear ones on edge midpoints.
For constant K the inverse is then

    M_lin⁻¹ ⊗ K⁻¹  +  (M_quad⁻¹ − M_lin⁻¹) ⊗ J K_1⁻¹ Jᵀ

with K_1 = Jᵀ K J the stiffness of linear triangles; both summands are positive (semi)definite, so
their level-wise version is too.

Nearly incompressible triangles have mean pressures besides, hats along θ. Each level's matrix is
then a saddle point, L_k J L_kᵀ with signs J, and the middle factor above becomes M ⊗ J. L_k stays
bounded as the compressibility vanishes, so the count does not depend on Poisson's ratio either.
The second summand has no part in the pressures.

Each rank factorises its own levels. Products along θ want all levels: the vectors are turned about,
each rank then having all levels of some planar unknowns, and back. Ranks of the same level share
the loads.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from alphacut.rve.mesh.periodicity import Periodicity
from alphacut.rve.mesh.triangulation import Integers, Triangulation
from alphacut.rve.petsc import PETSc
from alphacut.rve.ranks import Ranks
from alphacut.rve.solver.c_loops import WEDGES, c_loops
from alphacut.rve.solver.constraints import LevelNumbering, Overlap
from alphacut.rve.solver.level_factors import LevelFactors, saddle_factors
from alphacut.rve.solver.level_stiffness import LevelPattern, with_components
from alphacut.stochastic.theta.law import Array, ThetaLaw


@dataclass(frozen=True)
class ThetaMass:
    """Inverse mass matrices of the two one-dimensional spaces inside a serendipity wedge.

    Edge midpoints carry piecewise linear functions of θ, vertices piecewise quadratic ones.

    Args:
        linear: Inverse mass matrix of the hats, shape (layers + 1, layers + 1).
        excess: Inverse mass matrix of hats and bubbles less `linear` padded with zeros, positive
            semidefinite, shape (2·layers + 1, 2·layers + 1), hats before bubbles.
    """

    linear: Array
    excess: Array


def theta_mass(law: ThetaLaw, levels: Array) -> ThetaMass:
    """The mass matrices on the given levels, shape (layers + 1,)."""
    layers = len(levels) - 1
    abscissae, double = np.polynomial.legendre.leggauss(3)  # as the stiffness is integrated
    t, w = (abscissae + 1) / 2, double / 2
    shapes = np.array([1 - t, t, 4 * t * (1 - t)])
    theta = levels[:-1, None] + np.diff(levels)[:, None] * t
    local = np.einsum(
        "lq,iq,jq->lij", w * np.diff(levels)[:, None] * law.pdf(theta), shapes, shapes
    )
    number = np.stack(
        [np.arange(layers), np.arange(1, layers + 1), layers + 1 + np.arange(layers)], axis=1
    )
    mass = np.zeros((2 * layers + 1, 2 * layers + 1))
    np.add.at(mass, (number[:, :, None], number[:, None, :]), local)
    linear = np.linalg.inv(mass[: layers + 1, : layers + 1])
    excess = np.linalg.inv(mass)
    excess[: layers + 1, : layers + 1] -= linear
    return ThetaMass(linear, (excess + excess.T) / 2)


# a linear field on six nodes
_LINEAR = np.kron(np.vstack([np.eye(3), [[0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]]]), np.eye(2))


@lru_cache(maxsize=4)
def _patterns(periodicity: Periodicity, plane: Triangulation) -> tuple[LevelPattern, LevelPattern]:
    """Of a level's matrices on quadratic and on linear triangles."""
    nodes = plane.triangles, plane.triangles[:, :3]
    quadratic, linear = (with_components(periodicity.unknown[own]) for own in nodes)
    middles = plane.points[plane.triangles[:, :3]].mean(axis=1)
    return LevelPattern(quadratic, middles), LevelPattern(linear, middles)


@dataclass(frozen=True)
class LevelPressures:
    """Mean pressures of some triangles on the levels of one rank.

    Args:
        triangles: Those with a pressure, shape (p,).
        flux: For each level integrals of the divergence, shape (p, 12).
        compliance: For each level area over bulk modulus, shape (p,).
    """

    triangles: Integers
    flux: Sequence[Array]
    compliance: Sequence[Array]

    def saddles(self, stiffness: Sequence[Array]) -> list[Array]:
        """Element matrices with the pressure as 13th unknown, from those without."""
        found: list[Array] = []
        for one, flux, compliance in zip(stiffness, self.flux, self.compliance, strict=True):
            whole: Array = np.zeros((len(one), 13, 13))
            whole[:, :12, :12] = one
            whole[self.triangles, 12, :12] = whole[self.triangles, :12, 12] = flux
            whole[self.triangles, 12, 12] = -compliance
            found.append(whole)
        return found


class ThetaPreconditioner:
    """Applies the inverse above to a residual of the reduced product-space system.

    Args:
        numbering: Unknowns level by level.
        on: Element matrices on this rank's levels, shape (m, 12, 12) each.
        between: The same half-way between levels.
        law: Law of θ.
        ranks: Each factorises its own levels.
        pressures: Mean pressures of nearly incompressible triangles.
    """

    def __init__(
        self,
        numbering: LevelNumbering,
        on: Iterable[Array],
        between: Iterable[Array],
        law: ThetaLaw,
        ranks: Ranks,
        pressures: LevelPressures | None = None,
    ) -> None:
        self.numbering, self.ranks = numbering, ranks
        grid, periodicity = numbering.grid, numbering.periodicity
        self.mass = theta_mass(law, grid.levels(law))
        shares = numbering.shares(ranks.size)
        self.levels = shares[ranks.rank].levels
        tops = [min(share.levels.stop, grid.layers) for share in shares]
        self.middles = [list(range(s.levels.start, t)) for s, t in zip(shares, tops, strict=True)]
        self.overlap = Overlap(
            ranks, numbering.owned(ranks.size), [numbering.beside(s.levels) for s in shares], shares
        )
        self.ends = periodicity.ends(grid.plane)
        quadratic, linear = _patterns(periodicity, grid.plane)
        self.pressures = 0 if pressures is None else len(pressures.triangles)
        self.pressed = numbering.on_levels(self.pressures, ranks)

        def reduced(elements: Array) -> Array:
            return linear.values(_LINEAR.T @ elements @ _LINEAR)

        def both(elements: Array) -> tuple[Array, Array]:
            return quadratic.values(elements), reduced(elements)

        if pressures is None:  # elements are large: one level after another
            levels = list(map(both, on))
            self.quadratic = LevelFactors(quadratic, [entries for entries, _ in levels])
            coarse = [entries for _, entries in levels]
        else:
            whole = list(on)
            self.quadratic = saddle_factors(
                quadratic, pressures.triangles, pressures.saddles(whole)
            )
            coarse = [reduced(one) for one in whole]
        self.linear = LevelFactors(linear, [*coarse, *map(reduced, between)])

    def apply(self, _pc: PETSc.PC, residual: PETSc.Vec, result: PETSc.Vec) -> None:
        """Result = P⁻¹ residual, called by PETSc; several loads side by side."""
        rows = len(self.overlap.own) + len(self.pressed.own)
        result.array[:] = self.solve(residual.array_r.reshape(rows, -1)).ravel()

    def solve(self, vectors: Array) -> Array:
        """P⁻¹ times this rank's part of vectors, shape (unknowns, loads)."""
        cut, loads = len(self.overlap.own), vectors.shape[1]
        before, level, middle = self._split(self.overlap.fetch(vectors[:cut]))
        vertices, planar = 2 * self.numbering.periodicity.vertices, level.shape[1]
        # from nodal values half-way to bubbles on top of the hats
        level[: len(middle), :vertices] += middle / 2
        level[1:, :vertices] += middle[: len(level) - 1] / 2
        level[: len(before), :vertices] += before / 2
        both = level
        if self.pressures:
            pressure = self.pressed.fetch(vectors[cut:])
            shape = len(level), self.pressures, level.shape[2]
            both = np.concatenate([level, pressure.reshape(shape)], axis=1)
        rows = [list(share.levels) for share in self.overlap.shares]
        lifted = self.quadratic.forward(both)
        solved = self.quadratic.backward(self._along_theta(self.mass.linear, lifted, rows, loads))
        corners = np.zeros((len(level), vertices, level.shape[2]))
        self._inject(level, corners, 1)
        correction, bubbles = self._excess(corners, middle, rows, loads)
        hats = np.ascontiguousarray(solved[:, :planar])
        self._inject(hats, correction, 0)
        ends = hats[: len(middle), :vertices].copy()
        ends[: len(level) - 1] += hats[1 : len(middle) + 1, :vertices]
        joined = self._join(hats[: len(before), :vertices] / 2, hats, bubbles + ends / 2)
        result = self.overlap.give(joined, loads)
        if not self.pressures:
            return result
        rest = solved[:, planar:].reshape(len(level) * self.pressures, level.shape[2])
        return np.concatenate([result, self.pressed.give(rest, loads)])

    def _inject(self, nodes: Array, corners: Array, back: int) -> None:
        """Add J times vectors on vertices to those on all nodes, or `back` by its transpose."""
        count, vertices = len(nodes), len(corners[0]) // 2
        c_loops(WEDGES).inject(
            count, vertices, len(self.ends), 2 * nodes.shape[2], self.ends.ctypes,
            nodes.ctypes, corners.ctypes, back,
        )  # fmt: skip

    def _excess(
        self, level: Array, middle: Array, rows: list[list[int]], loads: int
    ) -> tuple[Array, Array]:
        """(M_quad⁻¹ − M_lin⁻¹) ⊗ K_1⁻¹ on this rank's vertices, on and between levels."""
        lifted = self.linear.forward(np.concatenate([level, middle]))
        layers = self.numbering.grid.layers
        every = [
            [*on, *(layers + 1 + k for k in between)]
            for on, between in zip(rows, self.middles, strict=True)
        ]
        solved = self.linear.backward(self._along_theta(self.mass.excess, lifted, every, loads))
        return solved[: len(level)], solved[len(level) :]

    def _along_theta(
        self, matrix: Array, vectors: Array, rows: list[list[int]], loads: int
    ) -> Array:
        """Matrix (l, l) times vectors (l, size, loads); of both this rank has its rows."""
        size, ranks = vectors.shape[1], self.ranks.size
        if ranks == 1:
            return np.asarray((matrix @ vectors.reshape(len(vectors), -1)).reshape(vectors.shape))
        bounds = [size * k // ranks for k in range(ranks + 1)]
        columns = [self.overlap.columns(k, loads) for k in range(ranks)]
        turned = self.ranks.swap([vectors[:, slice(*pair)] for pair in pairwise(bounds)])
        whole = np.empty((len(matrix), len(turned[0][0]), loads))
        for row, column, piece in zip(rows, columns, turned, strict=True):
            whole[row, :, column] = piece
        product = (matrix @ whole.reshape(len(matrix), -1)).reshape(whole.shape)
        pieces = [product[row][:, :, part] for row, part in zip(rows, columns, strict=True)]
        return np.concatenate(self.ranks.swap(pieces), axis=1)

    def _split(self, vectors: Array) -> tuple[Array, Array, Array]:
        """Values half-way below the first level, on the levels, and half-way above them."""
        stride, planar = self.numbering.stride, 2 * self.numbering.periodicity.count
        between, columns = len(self.middles[self.ranks.rank]), vectors.shape[1]
        last, below = len(self.levels) - between, int(self.levels.start > 0)
        before, rest = np.split(vectors, [below * (stride - planar)])
        table = rest[: between * stride].reshape(between, stride, columns)
        top = rest[between * stride :].reshape(last, planar, columns)
        before = before.reshape(below, stride - planar, columns)
        return before, np.concatenate([table[:, :planar], top]), table[:, planar:]

    @staticmethod
    def _join(before: Array, level: Array, middle: Array) -> Array:
        """The vectors from what `_split` makes of them."""
        columns = level.shape[2]
        paired = np.concatenate([level[: len(middle)], middle], axis=1)
        parts = before, paired, level[len(middle) :]
        return np.concatenate([part.reshape(len(part) * part.shape[1], columns) for part in parts])
