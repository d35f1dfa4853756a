"""Moduli of one mesh for any modulus of the sphere, from solutions at a few.

The stiffness is linear in the sphere's modulus, and all solutions under one load take the same
displacements on the faces. Least energy over their affine combinations is therefore a modulus from
above, and its error is the square of that of the displacements (as `rve.prism.modulus_basis` does).
"""

from __future__ import annotations

from collections.abc import Sequence

from alphacut.rve.cell import Phase
from alphacut.rve.spheres.fem.faces import LOADS
from alphacut.rve.spheres.fem.stiffness import OctantCell

# isort: split
import numpy as np

from alphacut.stochastic.theta.truncated_normal import Array

_MOST = 8  # solutions
_SAME = 1e-9  # share of energy below which differences of solutions tell of residuals alone
_TINY = 1e-300
_UNITS = [load.unit for _, loads in LOADS for load in loads]


class BasisError(RuntimeError):
    """A few solutions do not carry the others."""


def nodes_between(low: float, high: float, count: int) -> Array:
    """Moduli at Chebyshev's points of the logarithm, rising, shape (count,)."""
    share = 0.5 - 0.5 * np.cos((np.arange(count) + 0.5) * np.pi / count)
    return np.asarray(low * (high / low) ** share)


class ModulusBasis:
    """Solutions of one mesh at moduli of the sphere, of one Poisson's ratio.

    Args:
        cell: The mesh.
        matrix: Material outside the sphere.
        inclusions: Materials of the sphere that are solved for, one or more.

    Attributes:
        iterations: Of conjugate gradients, one number a load.

    Raises:
        ConvergenceError: An iteration does not converge.
    """

    def __init__(self, cell: OctantCell, matrix: Phase, inclusions: Sequence[Phase]) -> None:
        self._cell, self._matrix, self._ends = cell, matrix, (inclusions[0], inclusions[-1])
        self.iterations: tuple[int, ...] = ()
        solved = [cell.solve(matrix, one, keep=True) for one in inclusions]
        for one in solved:
            self.iterations += one.iterations
        first, *others = (np.array(one.displacements) for one in solved)
        self._own = solved[0].moduli
        spread = [other - first for other in others]
        fields = np.stack([first, *spread], axis=1)  # loads, solutions, displacements
        self._energies = (
            [cell.energies(matrix, end, fields) for end in self._ends] if others else []
        )

    def moduli(self, modulus: float) -> Array:
        """K, (C11 − C12)/2 and C44 in Pa, shape (3,), at a modulus of the sphere in Pa."""
        if not self._energies:
            return self._own
        low, high = (end.modulus for end in self._ends)
        share = (modulus - low) / (high - low)
        energy = (1 - share) * self._energies[0] + share * self._energies[1]
        mixed, inner = energy[:, 1:, 0], energy[:, 1:, 1:]
        size = np.sqrt(np.maximum(np.einsum("lkk->lk", inner), _TINY))
        inner, mixed = inner / (size[:, :, None] * size[:, None]), mixed / size
        inverse = np.linalg.pinv(inner, rcond=_SAME, hermitian=True)
        least = energy[:, 0, 0] - np.einsum("lj,ljk,lk->l", mixed, inverse, mixed)
        return np.asarray(self._matrix.modulus * least / _UNITS)


def basis_between(
    cell: OctantCell, matrix: Phase, ends: tuple[Phase, Phase], *, error: float
) -> tuple[list[Phase], float]:
    """Spheres whose solutions carry those of all moduli between two, and what they miss.

    Judged by solutions at the ends and between the nodes. What is missed hardly depends on the
    mesh, so a coarse one at the greatest radius tells.

    Args:
        cell: A coarse mesh.
        matrix: Material outside the sphere.
        ends: Spheres of the least and the greatest modulus and one Poisson's ratio.
        error: Relative error of the moduli allowed.

    Returns:
        The spheres to solve for, and twice the largest relative error that was seen.

    Raises:
        BasisError: The range is too wide for a few solutions.
    """
    low, high = (end.modulus for end in ends)
    if high <= low * (1 + 1e-12):
        return [ends[0]], 0.0
    missed = np.inf
    for count in range(2, _MOST + 1):
        nodes = nodes_between(low, high, count)
        chosen = [Phase(float(e), ends[0].poisson) for e in nodes]
        basis = ModulusBasis(cell, matrix, chosen)
        places = [low, *np.sqrt(nodes[1:] * nodes[:-1]), high]
        solved = [cell.solve(matrix, Phase(float(e), ends[0].poisson)).moduli for e in places]
        pairs = zip(places, solved, strict=True)
        missed = 2 * max(float(np.abs(basis.moduli(e) / own - 1).max()) for e, own in pairs)
        if missed <= error:
            return chosen, missed
    raise BasisError(
        f"{_MOST} solutions leave a relative error of {missed:.1e} between moduli of {low:.3g} and"
        f" {high:.3g} Pa: allow a larger error, or cover less"
    )
