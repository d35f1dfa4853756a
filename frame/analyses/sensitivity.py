"""Sensitivity: by how much the width of a peak shrinks when one input alone is fixed.

The width is that between the greatest and the least peak that steepest ascents over the ends and
the nominal values of the inputs reach. Exact motions reach both, which needs no proof.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.number_text import Table, percent_text
from alphacut.frame.analyses.answer import Answer, Record
from alphacut.frame.dynamics.flow import Flow
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.structures.model import StructureModel
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.propagation import width_shares
from alphacut.fuzzy.result import Nature


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivity(Answer):
    """Fraction of the width of each result, such as "the peak of q2", by which an input widens it.

    The effects of inputs overlap, so that the fractions need not add up to 1.
    """

    key = "shares"
    title = "What drives the width?"
    shares: dict[str, dict[str, float]]

    def _rows(self) -> list[tuple[str, str, float]]:
        """Return result, input and fraction, those of a result with the largest first."""
        rows = []
        for result, values in self.shares.items():
            ordered = sorted(values.items(), key=lambda pair: -pair[1])
            rows += [(result, name, share) for name, share in ordered]
        return rows

    def table(self) -> Table:
        """Return a row for each result and input."""
        head = ("fixing", "narrows", "nature", "by")
        rows = [(x, what, Nature.ATTAINED, percent_text(y)) for what, x, y in self._rows()]
        return Table(head, [tuple(map(str, row)) for row in rows])

    def records(self) -> list[Record]:
        """Return a row for each result and input."""
        return [{"width of": what, "input": x, "share": y} for what, x, y in self._rows()]

    def words(self) -> str:
        """Return what the fractions are."""
        return (
            "Share of the width, of peaks between those that motions reach, that is lost when an"
            " input is fixed at its nominal value."
        )


def sensitivity(
    model: StructureModel,
    inputs: Mapping[str, FuzzyNumber],
    *,
    duration: float,
    step: float,
    level: float = 0.0,
    groups: Mapping[str, Sequence[str]] | None = None,
    reached_at: Mapping[str, Mapping[str, float]] | None = None,
) -> Sensitivity:
    """Return by how much each input widens the peak of each output on one level.

    Args:
        model: The structure, whose outputs are looked at.
        inputs: Fuzzy parameters by name, in SI units; two or more.
        duration: Length of the motions, in s.
        step: Distance of the nodes at which peaks are read, in s.
        level: α of the cuts.
        groups: Inputs that are fixed together, by the name of their group; each one by itself if
            not given.
        reached_at: Inputs by name at which the peak of an output is known to be large, by output:
            where its search begins. It begins at the nominal values if not given.
    """
    outputs, known = [*map(str, model.outputs)], reached_at or {}
    flow = make_flow(model, tuple(inputs), duration, step)
    greatest = np.array(
        [[known.get(x, {}).get(y, number.nominal) for y, number in inputs.items()] for x in outputs]
    )
    found: list[Array] = []  # points of greatest and least peaks with all inputs fuzzy, (2, m, n)

    def bounds(numbers: Mapping[str, FuzzyNumber]) -> tuple[Array, Array]:
        """Return the least and the greatest peak of each output, shape (outputs,) each."""
        ends = np.array([x.cut(level) for x in numbers.values()], float)
        values: Array = np.column_stack([ends, [x.nominal for x in numbers.values()]])
        opposite = values[:, 0] + values[:, 1] - greatest
        # with a group fixed: what was found with all inputs, moved to the group's nominal values
        starts: Array = np.clip(found or [greatest, opposite], values[:, 0], values[:, 1])
        reached: list[list[Reached]] = []
        for side, sign in enumerate((1.0, -1.0)):
            ascents = [
                _steepest_ascent(flow, values, starts[side, k], output=k, sign=sign)
                for k in range(len(outputs))
            ]
            reached.append(ascents)
        if not found:
            found.extend(np.array([x.point for x in row]) for row in reached)
        largest, smallest = (np.array([x.peak for x in row]) for row in reached)
        return smallest, largest

    shares = width_shares(bounds, inputs, groups=groups)
    by_output = {}
    for k, output in enumerate(outputs):
        column = map(float, shares.share[:, k])
        by_output[f"the peak of {output}"] = dict(zip(shares.names, column, strict=True))
    return Sensitivity(by_output)


class Reached(NamedTuple):
    """A peak, and the inputs (n,) of the motion that has it."""

    peak: float
    point: Array


def _steepest_ascent(
    flow: Flow, values: Array, point: Array, *, output: int, sign: float
) -> Reached:
    """Return the largest `sign` times the peak of an output that steepest ascent reaches.

    Each step moves one input to one of its `values` (inputs, 3); it begins at `point` (inputs,).
    """
    n_inputs, best = len(values), -np.inf
    while True:
        tried = np.tile(point, (1 + values.size, 1))
        for k in range(n_inputs):
            tried[1 + 3 * k : 4 + 3 * k, k] = values[k]
        tried = np.unique(tried, axis=0)
        peaks = sign * np.abs(flow.values(tried)[..., output]).max(1)
        if peaks.max() <= best:
            return Reached(sign * best, point)
        best, point = float(peaks.max()), tried[peaks.argmax()]
