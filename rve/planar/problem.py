"""Planar cell problem: one mesh, any materials, three loads at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from time import perf_counter

import numpy as np

from alphacut.rve.cell import Phase
from alphacut.rve.mesh.planar import PlanarMesh, curved_nodes
from alphacut.rve.mesh.triangulation import Integers
from alphacut.rve.planar.system import Cholesky, ModulusBasis, Pencil
from alphacut.rve.solver.c_loops import WEDGES, c_loops
from alphacut.rve.solver.integrals import triangle_integral
from alphacut.rve.solver.level_stiffness import LevelPattern, with_components
from alphacut.stochastic.theta.truncated_normal import Array


@dataclass
class PlanarCell:
    """Lagrange triangles of `order`, isoparametric, periodic by elimination.

    Args:
        mesh: Triangles of the cell.
        order: Polynomial degree of field and geometry, 1 to 4.
        seconds: Filled with the wall time of mesh, jit and assemble.
        factorisations: Counts those made.

    Raises:
        ValueError: `order` out of range.
    """

    mesh: PlanarMesh
    order: int
    seconds: dict[str, float] = field(default_factory=dict)
    factorisations: int = 0

    def __post_init__(self) -> None:
        if not 1 <= self.order <= 4:
            raise ValueError(
                f"the order of the planar elements is {self.order}; it must be 1, 2, 3 or 4"
            )
        started = perf_counter()
        self.coordinates, self.cells = curved_nodes(self.mesh, self.order)  # (n, 2), (m, nodes)
        self.pattern = LevelPattern(with_components(self.unknown[self.cells]))
        meshed = perf_counter()
        self._integral = triangle_integral(self.order)
        self.seconds = {"mesh": meshed - started, "jit": perf_counter() - meshed}

    @cached_property
    def unknown(self) -> Integers:
        """Pair of unknowns of each node, (n,): those at 1 follow those at −1, the corner is −1."""
        wrapped = np.where(self.coordinates > 1 - 1e-9, -1.0, self.coordinates)
        across, along = np.round((wrapped + 1) * 1e8).astype(np.int64).T
        return np.asarray(np.unique(across * 10**9 + along, return_inverse=True)[1] - 1)

    @cached_property
    def affine(self) -> Array:
        """Displacements of the three unit strains (11, 22, 12 with 2 ε12 = 1), shape (n, 2, 3)."""
        x, y = self.coordinates.T
        zero = np.zeros_like(x)
        return np.stack(
            [np.stack([x, zero, y / 2], axis=-1), np.stack([zero, y, x / 2], axis=-1)], axis=1
        )

    @cached_property
    def _factor(self) -> Cholesky:
        return Cholesky(self.pattern)

    def stiffness(
        self, matrix: Phase, inclusions: Sequence[Phase], *, share: bool = False
    ) -> Array:
        """Homogenised stiffness of m inclusions in Pa, shape (m, 3, 3).

        Args:
            matrix: Material outside the particle.
            inclusions: Materials of the particle; those of one Poisson's ratio share assembly and
                ordering.
            share: Whether many of them share a few full solutions too (`ModulusBasis`): faster, but
                the last digits of one then depend on which others come along.
        """
        found = np.empty((len(inclusions), 3, 3))
        for poisson in dict.fromkeys(p.poisson for p in inclusions):
            places = [k for k, p in enumerate(inclusions) if p.poisson == poisson]
            pencil = self._pencil(matrix, poisson)
            moduli = np.array([inclusions[k].modulus for k in places])
            if share and moduli.size > 2:
                basis = ModulusBasis(pencil)
                found[places] = basis.stiffness(moduli)
                self.factorisations += basis.size
            else:
                found[places] = [pencil.solve(float(e))[1] for e in moduli]
                self.factorisations += moduli.size
        return found

    def displacement(self, matrix: Phase, inclusion: Phase) -> Array:
        """Displacements under the three unit strains at the nodes, shape (2n, 3)."""
        found = self._pencil(matrix, inclusion.poisson).solve(inclusion.modulus)[0]
        fixed = np.concatenate([found.reshape(-1, 2, 3), np.zeros((1, 2, 3))])  # −1: the last
        return np.asarray((self.affine - fixed[self.unknown]).reshape(-1, 3))

    def _pencil(self, matrix: Phase, poisson: float) -> Pencil:
        """The cell's stiffness as an affine function of the particle's modulus."""
        started = perf_counter()
        elements = self.elements(matrix.poisson, poisson)
        moved = self.affine[self.cells].reshape(*elements.shape[:2], 3)
        forces, kept = elements @ moved, self.pattern.unknowns >= 0
        values, loads, uniform = [], [], []
        for scales in (np.where(self.mesh.inside, 0.0, matrix.modulus), 1.0 * self.mesh.inside):
            own = scales[:, None, None] * forces
            values.append(self.pattern.values(elements, scales))
            sums = (
                np.bincount(self.pattern.unknowns[kept], part[kept])
                for part in np.moveaxis(own, 2, 0)
            )
            loads.append(np.stack(list(sums), axis=1))
            uniform.append(np.einsum("mia,mib->ab", moved, own))
        self.seconds["assemble"] = self.seconds.get("assemble", 0.0) + perf_counter() - started
        return Pencil(self._factor, tuple(values), tuple(loads), tuple(uniform))

    def elements(self, *poissons: float) -> Array:
        """Stiffness of the triangles for 1 Pa and Poisson's ratios of both phases, (m, 2k, 2k)."""
        units = [Phase(1.0, poisson).stiffness for poisson in poissons]
        constants = np.array([[c[0, 0], c[0, 1], c[2, 2]] for c in units])
        (m, k), inside = self.cells.shape, self.mesh.inside.astype(np.uint8)
        places, found = np.zeros((m, k, 3)), np.empty((m, 2 * k, 2 * k))
        places[:, :, :2] = self.coordinates[self.cells]
        c_loops(WEDGES).integrate_triangles(
            self._integral, m, k, places.ctypes, constants.ctypes, inside.ctypes, found.ctypes
        )
        return found

    @property
    def unknowns(self) -> int:
        """Unknowns after elimination."""
        return self.pattern.size
