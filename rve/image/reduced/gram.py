"""Energies of given fields phase by phase: what a bound for any moduli of the phases is made of."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from alphacut.rve.image.fields.element import Element
from alphacut.rve.image.fields.energy import SAFETY, UNIT, modes_of
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
