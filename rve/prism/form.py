"""Stiffness of each phase on wedges (eq. 7).

The form has no derivative along θ: div and D act on x alone. So a wedge is integrated slice by
slice, at the Gauss points along θ; a slice is a triangle of six nodes, whose integral FFCx makes. A
loop in C carries slices to wedges and adds them up.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from alphacut.rve.cell import Phase
from alphacut.rve.mesh import wedge
from alphacut.rve.mesh.prism_grid import PrismGrid
from alphacut.rve.petsc import PETSc, block_values
from alphacut.rve.solver.c_loops import WEDGES, c_loops
from alphacut.rve.solver.integrals import triangle_integral
from alphacut.stochastic import RadiusMap, ThetaLaw
from alphacut.stochastic.theta.law import Array


@dataclass
class PrismForm:
    """Integrals over the wedges of one grid; positions and phases are set anew for every map.

    On several ranks each adds up what the wedges around its rows give to these.

    Args:
        grid: Topology of those wedges.
        pairs: Unknown pair of each of their nodes, −1 where fixed, shape (wedges, 15).
        rows: The unknowns of the rank.
        places: Where blocks stand in matrices, shape (wedges, 15, 15); see `LevelNumbering.matrix`.
    """

    grid: PrismGrid
    pairs: NDArray[np.int32]
    rows: range
    places: NDArray[np.int32]

    def __post_init__(self) -> None:
        self.points, self.weights = wedge.slab_rule()
        self.shapes = wedge.tabulate(self.points)
        started = perf_counter()
        self._integral = triangle_integral(2, weighted=True)
        self.jit_seconds = perf_counter() - started
        slices = self.points.reshape(3, -1, 3)[:, 0, 2]
        self._along = np.column_stack([1 - slices, slices, 4 * slices * (1 - slices)])
        self._heights = 2 * self.weights.reshape(3, -1).sum(axis=1)
        first, stop = self.rows.start // 2, self.rows.stop // 2
        own = (self.pairs >= first) & (self.pairs < stop)
        self._pairs = np.where(own, self.pairs - first, -1).astype(np.int32)
        self._giving = np.flatnonzero(own.any(axis=1)).astype(np.int32)
        self._forces: dict[int, Array] = {}

    def place(self, radius: RadiusMap) -> Array:
        """Move the nodes to the cone of `radius`; returns their positions, shape (nodes, 3).

        Raises:
            ValueError: The density of θ is not positive at a quadrature point.
        """
        positions = self.grid.positions(radius)
        self._nodes = positions[self.grid.cells]
        self._weigh(radius.distribution)
        return positions

    def _weigh(self, law: ThetaLaw) -> None:
        """Set the density of θ at the quadrature points, f_Θ of eq. 1."""
        levels = self.grid.levels(law)
        theta = levels[:-1, None] + np.diff(levels)[:, None] * self.points[:, 2]
        density = law.pdf(theta)
        if not (density > 0).all():
            place = theta[~(density > 0)][0]
            raise ValueError(
                f"the density of θ is {law.pdf(place):g} at {place:.4g}, and every layer of the"
                " product space needs probability: shorten the support, or take the series or a"
                " table"
            )
        self._density = density[np.array(self.grid.own) // len(self.grid.plane.triangles)]

    def mark(self, share: Array) -> None:
        """Set the particle's share at the quadrature points, shape (cells, points)."""
        self._share = share

    def set_poisson(self, phases: tuple[Phase, Phase]) -> None:
        """Take the phases' Poisson's ratios; Young's moduli stay 1."""
        units = [Phase(1.0, phase.poisson).stiffness for phase in phases]
        self._constants = [np.array([c[0, 0], c[0, 1], c[2, 2]]) for c in units]

    def add_stiffness(self, phase: int, matrix: PETSc.Mat, modulus: float = 1.0) -> None:
        """Add K_m (phase 0) or K_i (phase 1) of eq. 7, times a modulus, and keep its loads."""
        own, weights = self._giving, modulus * self._density
        if self.grid.conforming:
            own = own[self.grid.inside[own] == bool(phase)]
        else:
            weights = weights * (self._share if phase else 1 - self._share)
        weights, forces = weights[own], np.zeros((len(self.rows), 3))
        c_loops(WEDGES).add_wedges(
            self._integral, self._along.ctypes, self._heights.ctypes, len(own), own.ctypes,
            weights.ctypes, self._nodes.ctypes, self._constants[phase].ctypes, self._pairs.ctypes,
            self.places.ctypes, *block_values(matrix), forces.ctypes,
        )  # fmt: skip
        self._forces[phase] = forces / modulus

    def load(self, phase: int, strain: Array) -> Array:
        """Forces −⟨Bᵀ E ε̄⟩ of one phase for a unit modulus, on the unknowns of the rank.

        They are what its stiffness, which is added before, makes of the displacements ε̄x.

        Args:
            phase: 0 the matrix, 1 the particle.
            strain: Macroscopic strain (ε11, ε22, 2 ε12).
        """
        return np.asarray(self._forces[phase] @ strain)
