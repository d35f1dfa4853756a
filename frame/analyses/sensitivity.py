"""Sensitivity: by how much the width of a peak shrinks if one input alone is fixed.

The width is the distance between the largest and the smallest peak that steepest ascents over the
ends and the nominal values of the inputs attain. Exact responses attain both, so that no proof is
needed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, cast

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.number_text import percent_text
from alphacut.frame.analyses.answer import Answer, Row
from alphacut.frame.dynamics.flow import Flow
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.structures.model import StructureModel
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.propagation import width_fractions
from alphacut.fuzzy.result import Nature


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivity(Answer):
    """Fraction of the width of results that is lost if an input is fixed.

    The effects of the inputs overlap, so that the fractions need not add up to 1.

    Args:
        shares: Fraction of the width by result, such as "the peak of q2", and by input.
    """

    key = "shares"
    title = "What drives the width?"
    shares: dict[str, dict[str, float]]

    def text_rows(self) -> Iterator[Row]:
        """Yield a row for each result and input.

        A row says by which percentage fixing the input narrows the result. The inputs of a result
        stand in falling order of this effect.
        """
        for row in self.number_rows():
            yield {
                "fixing": row["input"],
                "narrows": row["width of"],
                "nature": str(Nature.ATTAINED),
                "by": percent_text(cast("float", row["share"])),
            }

    def number_rows(self) -> Iterator[Row]:
        """Yield a row for each result and input, with the largest fraction of a result first."""
        for result, fractions in self.shares.items():
            for name in sorted(fractions, key=lambda name: -fractions[name]):
                yield {"width of": result, "input": name, "share": fractions[name]}

    def words(self) -> str:
        """Return a sentence that defines the fractions."""
        return (
            "The fraction of the width that is lost if an input is fixed at its nominal value. The"
            " width of a peak is the distance between its largest and smallest attained values."
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
        model: The structure with the outputs of interest.
        inputs: Two or more fuzzy parameters by name, in SI units.
        duration: Length of the responses, in s.
        step: Distance of the time nodes at which peaks are read, in s.
        level: Level α of the cuts.
        groups: Inputs that are fixed together, by the name of their group; by default each input is
            a group.
        reached_at: By output, inputs at which the peak of the output is known to be large. The
            search begins there, or at the nominal values where nothing is given.

    Returns:
        Sensitivity, with the fractions of the width in `shares`, by result and input.

    Example:
        >>> from alphacut.frame import StoreyFrame
        >>> from alphacut.fuzzy import Interval
        >>> frame = StoreyFrame(masses=[1e3], stiffness=[4e4], v0=[1.0], outputs=("q1",))
        >>> inputs = {"k1": Interval(36e3, 44e3), "m1": Interval(990, 1010)}
        >>> found = sensitivity(frame, inputs, duration=1.0, step=0.02)
        >>> effects = found.shares["the peak of q1"]
        >>> effects["k1"] > effects["m1"]
        True
    """
    outputs = list(map(str, model.outputs))
    flow = make_flow(model, tuple(inputs), duration, step)
    start = np.empty((len(outputs), len(inputs)))
    for row, output in zip(start, outputs, strict=True):
        known = (reached_at or {}).get(output, {})
        # The attained peak of a proof is a good start: it is often the largest one.
        row[:] = [known.get(name, number.nominal) for name, number in inputs.items()]
    # Inputs of the largest and the smallest peak of each output when all inputs are fuzzy, shape
    # (2, outputs, inputs); filled by the first call of `bounds`.
    found: list[Array] = []

    def bounds(numbers: Mapping[str, FuzzyNumber]) -> tuple[Array, Array]:
        """Return the smallest and the largest peak magnitude of each output that ascents find.

        The first call must be with all inputs fuzzy. It begins its search for each output at the
        row of `start` and keeps its optima in `found`. Later calls, with the inputs of a group
        fixed, begin their searches there.

        Args:
            numbers: Inputs by name, in the order of `inputs`; those of a fixed group are crisp.

        Returns:
            The smallest and the largest peak over the cuts at `level`, shape (outputs,) each.
        """
        ends = np.array([number.cut(level) for number in numbers.values()], float)
        nominal = [number.nominal for number in numbers.values()]
        values: Array = np.column_stack([ends, nominal])
        # The search of a largest peak begins at `start`, that of a smallest peak at the opposite
        # point of the box. With a group fixed, both begin where they ended with all inputs, moved
        # to the nominal values of the group.
        opposite = ends.sum(axis=1) - start
        starts: Array = np.clip(found or [start, opposite], ends[:, 0], ends[:, 1])
        largest = [
            _steepest_ascent(flow, values, point, output=k, sign=1.0)
            for k, point in enumerate(starts[0])
        ]
        smallest = [
            _steepest_ascent(flow, values, point, output=k, sign=-1.0)
            for k, point in enumerate(starts[1])
        ]
        if not found:
            found.extend(np.array([x.point for x in side]) for side in (largest, smallest))
        return np.array([x.peak for x in smallest]), np.array([x.peak for x in largest])

    # The width with a group fixed is compared with the width with all inputs fuzzy.
    fractions = width_fractions(bounds, inputs, groups=groups)
    by_output = {}
    for k, output in enumerate(outputs):
        column = map(float, fractions.fraction[:, k])
        by_output[f"the peak of {output}"] = dict(zip(fractions.names, column, strict=True))
    return Sensitivity(by_output)


class AttainedPeak(NamedTuple):
    """A peak, and the inputs of the response that has it, shape (inputs,)."""

    peak: float
    point: Array


def _steepest_ascent(
    flow: Flow, values: Array, point: Array, *, output: int, sign: float
) -> AttainedPeak:
    """Return the largest or smallest peak of an output that steepest ascent finds.

    The peak is the largest magnitude of the output at the time nodes. Each step changes one input
    to that of its values which raises or lowers the peak most; the search ends when no such change
    does. The result is attained, but another point may have a more extreme peak.

    Args:
        flow: Response as a function of the inputs in SI units.
        values: Values that each input may take: lower end, upper end and nominal value, shape
            (inputs, 3).
        point: Inputs at which the search begins, shape (inputs,); it is not changed.
        output: Index of the output.
        sign: 1 for the largest peak, -1 for the smallest peak.

    Raises:
        RefusedError: A response does not exist or is not finite.
        StepError: A time step of a response did not converge.
    """
    best = -np.inf
    # There are finitely many points, and each step improves the peak, so that the loop ends.
    while True:
        tried = np.tile(point, (1 + values.size, 1))
        # Besides the point itself: three points for each input, one for each of its values.
        for k in range(len(values)):
            tried[1 + 3 * k : 4 + 3 * k, k] = values[k]
        tried = np.unique(tried, axis=0)
        peaks = sign * np.abs(flow.values(tried)[..., output]).max(axis=1)
        if peaks.max() <= best:
            return AttainedPeak(sign * best, point)
        best = float(peaks.max())
        point = tried[peaks.argmax()]
