"""Contradiction: samples that refute a statement about a model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from alphacut.fuzzy.knowledge.known import Signs
from alphacut.fuzzy.sets.numbers import Array

ROUND_OFF = 1e-11  # of the range and of the largest value: less is no contradiction
_COMPARED = 400  # samples of an output that are compared pair by pair at most
_PAIRS = 2e7  # pairs that are compared over all outputs, about


class Contradiction(NamedTuple):
    """Two samples, (inputs,) each; the second should have the larger output and has not."""

    lesser: Array
    greater: Array
    values: tuple[float, float]

    def told(self, output: str, names: Sequence[str]) -> str:
        """The contradiction in one sentence."""
        places = [
            ", ".join(f"{name} = {x:.6g}" for name, x in zip(names, point, strict=True))
            for point in (self.lesser, self.greater)
        ]
        seen = (
            f"it falls from {self.values[0]:.6g} at {places[0]} to {self.values[1]:.6g} at"
            f" {places[1]}"
        )
        return f"the samples contradict the signs stated of output {output}: {seen}"


def negligible(values: Array) -> Array:
    """Differences of outputs, shape (outputs,), that round-off explains."""
    return np.asarray(ROUND_OFF * (np.ptp(values, axis=0) + np.abs(values).max(axis=0)))


def contradictions(points: Array, values: Array, signs: Signs) -> dict[int, Contradiction]:
    """The two samples that contradict stated signs the most, for each output with some.

    Args:
        points: Samples, shape (n, inputs); of more than 400 some that are spread over the values
            are compared.
        values: Outputs at the samples, shape (n, outputs).
        signs: +1, −1, or 0 where nothing is stated, shape (outputs, inputs); inputs without a sign
            must be equal in both samples.
    """
    stated = np.flatnonzero((signs != 0).any(axis=1)) if len(points) > 1 else np.empty(0, int)
    most = min(_COMPARED, max(16, int((_PAIRS / max(len(stated), 1)) ** 0.5)))
    found = {
        int(column): _contradiction(points, values[:, column], signs[column], most)
        for column in stated
    }
    return {column: against for column, against in found.items() if against}


def _contradiction(points: Array, values: Array, signs: Signs, most: int) -> Contradiction | None:
    rows = np.argsort(values)
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), most)).astype(int))]
    signed = points[rows][:, signs != 0] * signs[signs != 0]
    ordered = values[rows]
    free = points[rows][:, signs == 0]
    below = np.ones((len(rows),) * 2, bool)
    for column in signed.T:
        below &= column[:, None] <= column[None]
    for column in free.T:
        below &= column[:, None] == column[None]
    fall = np.where(below, ordered[:, None] - ordered[None], 0.0)
    worst = np.unravel_index(fall.argmax(), fall.shape)
    if fall[worst] <= negligible(values[:, None])[0]:
        return None
    one, other = rows[worst[0]], rows[worst[1]]
    return Contradiction(points[one], points[other], (float(values[one]), float(values[other])))
