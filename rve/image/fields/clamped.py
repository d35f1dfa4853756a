"""Fields that vanish on the edge of every tile: KUBC or SUBC of a window.

The periodic preconditioner becomes exact for the clamped tile of one material by the forces that
hold its edge (capacitance matrix): z − M E (Eᵀ M E)⁻¹ Eᵀ z with z = M r and E the unknowns of the
edge.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from alphacut.rve.image.fields.element import Element
from alphacut.rve.image.fields.operator import Operator
from alphacut.rve.image.fields.preconditioner import FourierPreconditioner
from alphacut.stochastic.theta.truncated_normal import Array

# what a uniform field yields, over what the longest wave yields, so that the edge can hold it
HOLD = 1e4


@dataclass(frozen=True)
class ClampedOperator:
    """The operator on fields that vanish on the edge.

    Args:
        operator: On all fields.
        free: 0 on the edge, 1 elsewhere, shape (types, rows, columns).
    """

    operator: Operator
    free: Array

    def apply(self, fields: Array) -> Array:
        """Forces on the free unknowns."""
        result = self.operator.apply(fields)
        result *= self.free
        return result

    def load(self, mean_modes: Array) -> Array:
        """Right-hand sides on the free unknowns."""
        return self.operator.load(mean_modes) * self.free


@dataclass(frozen=True)
class ClampedPreconditioner:
    """Exact inverse for one material in a clamped tile.

    Args:
        periodic: Inverse without the clamping, uniform fields included.
        free: 0 on the edge, 1 elsewhere, shape (types, rows, columns).
        factor: Cholesky factor of the capacitance matrix.
    """

    periodic: FourierPreconditioner
    free: Array
    factor: tuple[Array, bool]

    @classmethod
    def of(
        cls, element: Element, bulk: float, shear: float, shape: tuple[int, int]
    ) -> ClampedPreconditioner:
        """The preconditioner for a material of coefficients `bulk` and `shear`."""
        free = free_unknowns(element, shape)
        periodic = _grounded(FourierPreconditioner.of(element, bulk, shear, shape))
        impulses = np.zeros((element.types, element.types, *shape))
        impulses[range(element.types), range(element.types), 0, 0] = 1
        response = periodic.apply(impulses)  # unknown that is pushed, type, row, column
        kind, row, column = np.nonzero(free == 0)
        capacitance = response[
            kind,
            kind[:, None],
            (row[:, None] - row) % shape[0],
            (column[:, None] - column) % shape[1],
        ]
        factor, lower = cho_factor((capacitance + capacitance.T) / 2)
        return cls(periodic, free, (factor, bool(lower)))

    def apply(self, fields: Array) -> Array:
        """The inverse on fields that vanish on the edge."""
        edge = self.free == 0
        result = self.periodic.apply(fields)
        holding = np.zeros_like(fields)
        held = result[..., edge]
        forces = cho_solve(self.factor, held.reshape(-1, held.shape[-1]).T).T
        holding[..., edge] = forces.reshape(held.shape)
        result -= self.periodic.apply(holding)
        result *= self.free
        return result


def free_unknowns(element: Element, shape: tuple[int, int]) -> Array:
    """0 for unknowns on the lower and the left edge of the tile, 1 elsewhere."""
    free = np.ones((element.types, *shape))
    for kind, (_, y, x, _, _) in enumerate(element.functionals):
        if y == 0:
            free[kind, 0] = 0
        if x == 0:
            free[kind, :, 0] = 0
    return free


def _grounded(periodic: FourierPreconditioner) -> FourierPreconditioner:
    """The inverse with uniform fields as soft as a longer wave would be."""
    inverse = periodic.inverse.copy()
    values, vectors = np.linalg.eigh(inverse[0, :, :, 0])
    longest = max(float(np.abs(inverse[0, :, :, 1:2]).max(initial=0)), float(np.abs(values).max()))
    uniform = vectors[:, np.abs(values) < 1e-9 * np.abs(values).max()]
    inverse[0, :, :, 0] += HOLD * longest * uniform @ uniform.T
    return replace(periodic, inverse=inverse)
