"""Stress in planar slices of the product space at the wedges' Gauss points.

θ depends on the wedge's third coordinate alone, so derivatives at fixed θ need the planar part of
the Jacobian only.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from alphacut.rve.mesh.prism_grid import PrismGrid
from alphacut.rve.mesh.triangulation import Integers
from alphacut.rve.mesh.wedge import tabulate
from alphacut.rve.solver.c_loops import WEDGES, c_loops
from alphacut.stochastic.theta.truncated_normal import Array

CELL_AREA = 4.0
_AT_ONCE = 500  # wedges


@dataclass(frozen=True)
class LayerStress:
    """Stresses at the quadrature points of wedges of one layer.

    Args:
        stress: (σ11, σ22, σ12) for each load, shape (triangles, slices, points, 3, loads), in Pa.
        strain: (ε11, ε22, 2 ε12), same shape.
        area: Planar quadrature weights, shape (triangles, slices, points); of a whole layer they
            sum to 4 in each slice.
    """

    stress: Array
    strain: Array
    area: Array

    def of(self, triangles: NDArray[np.bool_]) -> LayerStress:
        """The part of these triangles, given as a mask."""
        return LayerStress(self.stress[triangles], self.strain[triangles], self.area[triangles])

    @property
    def mean(self) -> Array:
        """Part in the homogenised stress of each slice, shape (slices, 3, loads)."""
        return np.asarray((self.area[..., None, None] * self.stress).sum(axis=(0, 2)) / CELL_AREA)

    @property
    def energy(self) -> Array:
        """Part in the mean of σ_a : ε_b over each slice, shape (slices, loads, loads)."""
        slices, loads = self.area.shape[1], self.stress.shape[-1]
        weighted = self.area[..., None, None] * self.stress
        left, right = (
            field.swapaxes(0, 1).reshape(slices, -1, loads) for field in (weighted, self.strain)
        )
        return np.asarray(left.swapaxes(1, 2) @ right / CELL_AREA)


@dataclass(frozen=True)
class SliceStress:
    """Evaluates stresses from displacements on one grid with given positions.

    Args:
        grid: Topology.
        positions: (x1, x2, θ) of the nodes, shape (nodes, 3).
        points: Quadrature points of the reference prism, ordered by ζ first, shape (q, 3).
        weights: Their weights, shape (q,).
        slices: Number of distinct ζ among the points.
    """

    grid: PrismGrid
    positions: Array
    points: Array
    weights: Array
    slices: int = 3

    def layers(
        self, displacement: Array, stiffness: Array
    ) -> Iterator[tuple[int, slice, LayerStress]]:
        """The grid's layers, some wedges after others: layer, which of the grid's, what they have.

        Args:
            displacement: Total displacement of the nodes for each load, shape (nodes, 2, loads).
            stiffness: Voigt stiffness at the quadrature points, shape (cells, q or 1, 3, 3).
        """
        for layer in self.grid.span:
            part = self.grid.within(layer)[1]
            for some in _split(part):
                yield layer, some, self._layer(self.grid.cells[some], displacement, stiffness[some])

    def _layer(self, cells: Integers, displacement: Array, stiffness: Array) -> LayerStress:
        strain, determinant = self.strain(cells, displacement, self.points)
        in_slices = (len(cells), self.slices, len(self.points) // self.slices)
        weight = self.weights.reshape(self.slices, -1)
        area = determinant * (weight / weight.sum(axis=1, keepdims=True) / 2).ravel()
        return LayerStress(
            (stiffness @ strain).reshape(*in_slices, 3, -1),
            strain.reshape(*in_slices, 3, -1),
            area.reshape(in_slices),
        )

    def strain(self, cells: Integers, displacement: Array, points: Array) -> tuple[Array, Array]:
        """In-plane strain at fixed θ and the planar Jacobian's determinant.

        Args:
            cells: Nodes of the wedges to look at, shape (m, 15).
            displacement: Of all nodes for each load, shape (nodes, 2, loads).
            points: On the reference prism, shape (q, 3).

        Returns:
            (ε11, ε22, 2 ε12) for each load, shape (m, q, 3, loads), and determinants, shape (m, q).
        """
        table = np.ascontiguousarray(tabulate(points, derivatives=True)[:2].transpose(1, 0, 2))
        loads = displacement.shape[2]
        places, values = self.positions[cells], displacement[cells]
        found = np.empty((len(cells), len(points), 3, loads))
        determinant = np.empty((len(cells), len(points)))
        c_loops(WEDGES).strains(
            len(cells), len(points), loads, table.ctypes, places.ctypes, values.ctypes,
            found.ctypes, determinant.ctypes,
        )  # fmt: skip
        return found, determinant

    def determinants(self) -> Array:
        """Planar Jacobian's determinant at all quadrature points, shape (cells, q)."""
        nothing, cells = np.empty((len(self.positions), 2, 0)), self.grid.cells
        parts = _split(slice(0, len(cells)))
        return np.concatenate([self.strain(cells[some], nothing, self.points)[1] for some in parts])


def _split(part: slice) -> list[slice]:
    """The wedges of a part so many at a time that what is found of them stays in the cache."""
    stops = range(part.start + _AT_ONCE, part.stop + _AT_ONCE, _AT_ONCE)
    return [slice(stop - _AT_ONCE, min(stop, part.stop)) for stop in stops]
