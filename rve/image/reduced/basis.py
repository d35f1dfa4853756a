"""Few fields whose best combination gives a proved bound for any moduli."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.rve.image.fields.energy import SAFETY, UNIT
from alphacut.rve.image.fields.side import UNIT_LOADS, Side
from alphacut.rve.image.reduced.gram import Gram, gram
from alphacut.stochastic.theta.truncated_normal import Array


@dataclass(frozen=True)
class ReducedSide:
    """Trial fields of one side with their energies by phase; the first three uniform.

    Args:
        side: The space.
        aspect: Height of a pixel over its width.
        labels: Phase of each pixel, shape (rows, columns).
        phases: Number of phases.
        fields: Fluctuations, shape (n, types, rows, columns).
        energies: Of the uniform fields and the fluctuations.
    """

    side: Side
    aspect: float
    labels: Array
    phases: int
    fields: Array
    energies: Gram

    @classmethod
    def of(
        cls, side: Side, aspect: float, labels: Array, phases: int, fields: Array
    ) -> ReducedSide:
        """The side with the energies of these fields."""
        element = side.element(aspect)
        whole = np.concatenate([np.zeros((3, *fields.shape[1:])), fields])
        means = np.zeros((len(element.modes), len(whole)))
        means[:, :3] = element.mean_modes(UNIT_LOADS)
        energies = gram(element, labels, phases, whole, means)
        return cls(side, aspect, labels, phases, fields, energies)

    def coefficients(self, bulk: Array, shear: Array) -> Array:
        """Coefficients of the energies, shape (m, 2 phases), from moduli of shape (m, phases)."""
        pairs = np.stack(self.side.coefficients(bulk, shear), axis=-1)
        return pairs.reshape(len(bulk), -1)

    def combination(self, coefficients: Array) -> Array:
        """Shares of the fields under the three loads, shape (m, 3 + n, 3)."""
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
        shares = self.combination(coefficients)
        size, error = self.energies.size, self.energies.error
        flat = self.energies.value.reshape(len(size), -1)
        whole = (coefficients @ flat).reshape(-1, *self.energies.value.shape[1:])
        value = np.swapaxes(shares, 1, 2) @ (whole @ shares)
        value = (value + np.swapaxes(value, 1, 2)) / 2
        sizes, errors = (np.swapaxes(np.abs(shares), 1, 2) @ norm.T for norm in (size, error))
        terms = self.energies.summed + (2 * len(flat[0]) ** 0.5 + len(size) + 20) * UNIT
        weighted = coefficients[:, None] * sizes
        mixed = weighted @ np.swapaxes(errors, 1, 2)
        small = (coefficients[:, None] * errors) @ np.swapaxes(errors, 1, 2)
        summed = terms * (weighted @ np.swapaxes(sizes, 1, 2))
        rounding = SAFETY**2 * (mixed + np.swapaxes(mixed, 1, 2) + small + summed)
        return np.asarray(value + rounding.sum(axis=2)[..., None] * np.eye(3))
