"""Moduli of the cell of a sphere extrapolated over its meshes, with what they may be off by.

Moduli of curved quadratic tetrahedra err by a power of the edge length, 3.7 by measurement (`python
-m benchmarks.rve.sphere_elements`), so that two meshes tell most of the error of the finer one
(Richardson 1911). Gmsh's meshes are no refinements of one another, so the rest is not of a higher
order: the error declared is 1.5 times what was taken off, by a third mesh if that says more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from alphacut.rve.cell import Phase
from alphacut.rve.spheres.fem.modulus_basis import ModulusBasis
from alphacut.rve.spheres.fem.stiffness import RTOL, OctantCell

# isort: split
import numpy as np
from mpi4py import MPI

from alphacut.stochastic.theta.truncated_normal import Array

COARSER = 1.5  # edge length of a mesh over that of the next
ORDER = 3.4  # of the moduli in the edge length; a little less than measured takes more off
_APART = 1.3  # least ratio of the edge lengths that the unknowns of two meshes tell
_SAFETY = 1.5
_ROUND_OFF = 10 * RTOL**2  # of an energy


@dataclass(frozen=True)
class Extrapolated:
    """Moduli of one radius and several spheres.

    Args:
        moduli: K, (C11 − C12)/2 and C44 in Pa, shape (m, 3).
        errors: Declared relative errors of them, shape (m, 3).
        iterations: Of conjugate gradients on the finest mesh, one number a load.
    """

    moduli: Array
    errors: Array
    iterations: tuple[int, ...]


class Meshes:
    """Meshes of one radius, ever finer, and the moduli that were solved on them.

    Args:
        radius: Radius over half the cell's side, in (0, 0.97].
        matrix: Material outside the sphere.
        size: Edge length of the first in halves of the cell's side, in (0, 1]; two coarser ones
            stand before it.
        basis: Spheres of one Poisson's ratio that are solved for in place of those asked for, which
            are combined from them; none: each is solved for.
        comm: Ranks that share each mesh.

    Attributes:
        size: Edge length of the finest mesh, as asked for.
        systems: Linear systems solved.

    Raises:
        ValueError: A value out of range.
        TouchingError: Spheres nearly touch.
    """

    def __init__(
        self,
        radius: float,
        matrix: Phase,
        *,
        size: float,
        basis: Sequence[Phase] = (),
        comm: MPI.Intracomm = MPI.COMM_SELF,
    ) -> None:
        self._radius, self._matrix, self._basis, self._comm = radius, matrix, basis, comm
        self._cells = [OctantCell(radius, size=size, comm=comm)]
        for coarser in (COARSER, COARSER**2):
            self._cells.insert(0, OctantCell(radius, size=min(1.0, coarser * size), comm=comm))
        self._known: dict[tuple[int, Phase], tuple[Array, tuple[int, ...]]] = {}
        self._bases: dict[int, ModulusBasis] = {}
        self.size, self.systems = size, 0

    @property
    def unknowns(self) -> int:
        """Displacements of the finest mesh."""
        return self._cells[-1].unknowns

    def refine(self, size: float) -> None:
        """Another mesh, finer than all before; one between where it would be much finer."""
        steps = (size,) if COARSER**2 * size > self.size else (COARSER * size, size)
        self._cells += [OctantCell(self._radius, size=h, comm=self._comm) for h in steps]
        self.size = size

    def judged(self, inclusions: Sequence[Phase]) -> Extrapolated:
        """Moduli of several spheres from the finest mesh and the two next that differ from it.

        Where Gmsh had to refine others until fewer than two differ by a factor of 1.3 in the edge
        length, a finer mesh is made.

        Raises:
            ConvergenceError: An iteration does not converge.
        """
        edges = [cell.unknowns ** (-1 / 3) for cell in self._cells]
        last = len(edges) - 1
        others = [k for k in range(last - 1, -1, -1) if edges[k] >= _APART * edges[last]][:2]
        if len(others) < 2:
            self.refine(self.size / COARSER)
            return self.judged(inclusions)
        fine, *coarse = (
            np.array([self._solved(k, phase)[0] for phase in inclusions]) for k in (last, *others)
        )
        excess = np.array(
            [
                (moduli / fine - 1) / ((edges[k] / edges[last]) ** ORDER - 1)
                for k, moduli in zip(others, coarse, strict=True)
            ]
        )
        error = _SAFETY * np.abs(excess).max(axis=(0, 2))[:, None] + _ROUND_OFF
        steps = [self._solved(last, phase)[1] for phase in inclusions]
        return Extrapolated(
            fine * (1 - excess[0]), np.broadcast_to(error, fine.shape), tuple(np.concatenate(steps))
        )

    def _solved(self, mesh: int, inclusion: Phase) -> tuple[Array, tuple[int, ...]]:
        """Moduli and iterations on one mesh; solved once."""
        if self._basis:
            return self._based(mesh).moduli(inclusion.modulus), self._based(mesh).iterations
        if (mesh, inclusion) not in self._known:
            found = self._cells[mesh].solve(self._matrix, inclusion)
            self._known[mesh, inclusion] = found.moduli, found.iterations
            self.systems += len(found.iterations)
        return self._known[mesh, inclusion]

    def _based(self, mesh: int) -> ModulusBasis:
        """Solutions on one mesh that the others are combined from."""
        if mesh not in self._bases:
            self._bases[mesh] = ModulusBasis(self._cells[mesh], self._matrix, self._basis)
            self.systems += len(self._bases[mesh].iterations)
        return self._bases[mesh]
