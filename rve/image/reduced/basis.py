"""Few fields whose best combination, by its energies in each phase, bounds any moduli."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from alphacut.rve.image.fields.element import Element
from alphacut.rve.image.fields.energy import SAFETY, UNIT, modes_of
from alphacut.rve.image.fields.side import UNIT_LOADS, Side
from alphacut.stochastic.theta.truncated_normal import Array


@dataclass(frozen=True)
class Gram:
    """Mean products of the modes of fields over each phase, of the trace and of the deviator.

    Args:
        value: Shape (2 phases, fields, fields): trace of phase 0, deviator of phase 0, trace of
            phase 1, …
        error: Norm of the rounding error of each field's modes, shape (2 phases, fields).
        summed: Relative rounding of the sums.
    """

    value: Array
    error: Array
    summed: float

    @property
    def size(self) -> Array:
        """Norm of each field, shape (2 phases, fields)."""
        squares = np.diagonal(self.value, axis1=1, axis2=2)
        return np.asarray(np.sqrt(np.maximum(squares, 0) * SAFETY) + self.error)


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
        return np.stack(self.side.coefficients(bulk, shear), axis=-1).reshape(len(bulk), -1)

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


def gram(element: Element, labels: Array, count: int, fields: Array, mean_modes: Array) -> Gram:
    """Energies of fields plus uniform ones, phase by phase.

    Args:
        element: Unknowns and modes of a pixel.
        labels: Phase of each pixel, shape (rows, columns), 0 … count − 1.
        count: Number of phases.
        fields: Shape (fields, types, rows, columns).
        mean_modes: Modes of the uniform fields, shape (mode rows, fields).
    """
    number, split = len(fields), element.bulk_rows
    parts: list[list[Array]] = [[] for _ in range(2 * count)]
    error = np.zeros((2 * count, number))
    longest = 0
    for _, lines, modes, rounding in modes_of(element, fields[None], mean_modes):
        for phase in range(count):
            here = labels[lines] == phase
            for kind, rows in enumerate((slice(0, split), slice(split, None))):
                chosen = np.swapaxes(modes[rows, 0][:, :, here], 0, 1).reshape(number, -1)
                wrong = rounding[rows, 0][:, :, here]
                parts[2 * phase + kind].append(chosen @ chosen.T)
                error[2 * phase + kind] += np.einsum("rfp,rfp->f", wrong, wrong)
                longest = max(longest, chosen.shape[1])
    value = np.empty((2 * count, number, number))
    for place in np.ndindex(*value.shape):
        value[place] = math.fsum(part[place[1:]] for part in parts[place[0]]) / labels.size
    return Gram(value, np.sqrt(SAFETY * error / labels.size), SAFETY * (longest + 16) * UNIT)
