"""Trial fields of one side with their energies by phase: a bound for any moduli of the phases.

The energy of a field is linear in the moduli of the phases, so the products of the fields' modes
over each phase, summed once, give a proved bound at any moduli by the algebra of a few fields.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.rve.image.fields.energy import SAFETY, UNIT, Energies, energies
from alphacut.rve.image.fields.side import UNIT_LOADS, Side


@dataclass(frozen=True, eq=False)
class ReducedSide:
    """Trial fields of one side with their energies by phase; the first three uniform.

    Args:
        side: The space.
        aspect: Height of a pixel over its width.
        labels: Phase of each pixel, shape (rows, columns).
        phases: Number of phases.
        fields: Fluctuations, shape (n, unknowns, rows, columns).
        energies: Of the uniform fields and the fluctuations, by trace and deviator of phase 0, of
            phase 1, …
    """

    side: Side
    aspect: float
    labels: Rows
    phases: int
    fields: Array
    energies: Energies

    @classmethod
    def of(cls, side: Side, aspect: float, labels: Rows, phases: int, fields: Array) -> ReducedSide:
        """The side with the energies of these fields."""
        element = side.element(aspect)
        whole = np.concatenate([np.zeros((3, *fields.shape[1:])), fields])
        means = np.zeros((len(element.modes), len(whole)))
        means[:, :3] = element.mean_modes(UNIT_LOADS)
        weights = [(p, (labels == k) * 1.0) for k in range(phases) for p in element.parts]
        return cls(side, aspect, labels, phases, fields, energies(element, whole, means, weights))

    def coefficients(self, bulk: Array, shear: Array) -> Array:
        """Coefficients of the energies, shape (m, 2 phases), from moduli of shape (m, phases)."""
        return np.stack(self.side.coefficients(bulk, shear), axis=-1).reshape(len(bulk), -1)

    def combination(self, coefficients: Array) -> Array:
        """Shares of the fields under the three loads, shape (m, 3 + n, 3).

        They need not be good for the bound to hold, so single precision does.
        """
        count = len(self.fields)
        shares = np.zeros((len(coefficients), 3 + count, 3))
        shares[:, :3] = np.eye(3)
        if count:
            lower = self.energies.value[:, 3:].astype(np.float32)
            relative = (coefficients / coefficients.max(axis=1, keepdims=True)).astype(np.float32)
            rows = (relative @ lower.reshape(len(lower), -1)).reshape(-1, count, 3 + count)
            rows[:, np.arange(count), 3 + np.arange(count)] *= 1 + 1e-6
            shares[:, 3:] = -np.linalg.solve(rows[:, :, 3:], rows[:, :, :3])
        return shares

    def energy_above(self, coefficients: Array) -> Array:
        """Matrices above the least mean energies, shape (m, 3, 3), rounding included."""
        shares, number = self.combination(coefficients), len(self.energies.value)
        flat = self.energies.value.reshape(number, -1)
        whole = (coefficients @ flat).reshape(-1, *self.energies.value.shape[1:])
        value = np.swapaxes(shares, 1, 2) @ (whole @ shares)
        sizes, errors = (
            np.swapaxes(np.abs(shares), 1, 2) @ norm.T
            for norm in (self.energies.size + self.energies.error, self.energies.error)
        )
        terms = self.energies.summed + (2 * len(flat[0]) ** 0.5 + number + 20) * UNIT
        weighted = coefficients[:, None] * sizes
        mixed = weighted @ np.swapaxes(errors, 1, 2)
        small = (coefficients[:, None] * errors) @ np.swapaxes(errors, 1, 2)
        summed = terms * (weighted @ np.swapaxes(sizes, 1, 2))
        rounding = SAFETY**2 * (mixed + np.swapaxes(mixed, 1, 2) + small + summed)
        symmetric = (value + np.swapaxes(value, 1, 2)) / 2
        return np.asarray(symmetric + rounding.sum(axis=2)[..., None] * np.eye(3))
