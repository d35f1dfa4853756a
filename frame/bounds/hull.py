"""Hull of the bounds over all boxes of a branch and bound, and the largest values reached."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alphacut.frame.bounds.box_proof import BoxBounds
from alphacut.frame.boxes import UnitFlow
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.envelope import Ends, Envelope
from alphacut.fuzzy.arrays import Array, Mask
from alphacut.fuzzy.refused import FailedError
from alphacut.fuzzy.result import Nature

ADDED = ("boxes", "evaluations")
"""Facts of boxes that are added; of the others the largest counts."""


class Hull:
    """Bounds of (−output, output) on A levels, at T nodes, of m outputs, from those of boxes.

    Attributes:
        closed: Proved upper bounds of closed boxes, shape (A, T, m, 2).
        inner: Largest reached values, the same shape.
        at: Their inputs, shape (A, T, m, 2, n), in SI units.
        least: Lower bound of each output's least peak, shape (A, m).
        facts: Numbers by name.
    """

    def __init__(self, problem: UnitFlow, flow: LinearFlow) -> None:
        self.problem, self.flow, names = problem, flow, problem.boxes.names
        levels, outputs = len(problem.boxes.alpha), len(flow.outputs)
        shape = (levels, len(flow.time), outputs, 2)
        self.closed, self.inner = np.full((2, *shape), -np.inf)
        self.at = np.zeros((*shape, len(names)))
        self.between, self.attained_error = np.zeros((2, *shape[1:3]))
        self.least, self.least_reached = np.full((2, levels, outputs), np.inf)
        self.facts: dict[str, float] = {"parts": 0}

    def incumbent(self, level: int) -> Array:
        """Return the largest reached value of (−output, output) on a level, (m, 2); 0 at least."""
        return np.asarray(np.maximum(self.inner[level:].max((0, 1)), 0.0))

    def close(self, level: int, peaks: Mask, outer: Array) -> None:
        """Raise the bounds of some peaks (m, 2) at all nodes to those of a box, (T, m, 2)."""
        self.closed[level][:, peaks] = np.maximum(self.closed[level][:, peaks], outer[:, peaks])

    def close_least(self, level: int, least: Array) -> None:
        """Lower the bounds of the least peaks to those of a box, shape (m,)."""
        self.least[level] = np.minimum(self.least[level], least)

    def take(self, level: int, bounds: BoxBounds) -> None:
        """Take over what motions of a box reach, errors and facts."""
        better = bounds.inner > self.inner[level]
        self.inner[level][better], self.at[level][better] = bounds.inner[better], bounds.at[better]
        self.between = np.maximum(self.between, bounds.between)
        if bounds.attained_error is not None:
            self.attained_error = np.maximum(self.attained_error, bounds.attained_error)
        if bounds.least_peaks is not None:
            reached = np.minimum(self.least_reached[level], bounds.least_peaks.upper)
            self.least_reached[level] = reached
        for name, value in bounds.facts.items():
            earlier = self.facts.get(name, value)
            is_sum = name in ADDED and name in self.facts
            self.facts[name] = earlier + value if is_sum else max(earlier, value)

    def envelope(self, method: str, seconds: float, notes: Sequence[str]) -> Envelope:
        """Return the guaranteed envelope; raise if a reached bound lies outside a proved one."""
        # what holds in a wider cut holds in a narrower one, whose motions are in the wider one too
        outer, inner, at = np.minimum.accumulate(self.closed, axis=0), self.inner, self.at
        for level in reversed(range(len(inner) - 1)):
            better = inner[level + 1] > inner[level]
            inner[level][better], at[level][better] = (
                inner[level + 1][better],
                at[level + 1][better],
            )
        is_wrong = ~(inner <= outer)  # also where one is NaN
        if is_wrong.any():
            output = self.flow.outputs[int(np.argwhere(is_wrong)[0, 2])]
            excess = np.nanmax(np.where(is_wrong, inner - outer, np.nan))
            what = f"attained bounds of {output} lie outside the proved ones by {excess:.3g}"
            raise FailedError(f"the proof is wrong: {what}", "keep the case and report it")
        least_reached = self._least_reached(outer)
        error = (outer - inner).max(-1)
        largest = np.maximum(np.abs(outer).max((1, 3)), 1e-300)
        # the gap of an output at rest is judged by what the motion's energy allows
        largest = np.where(self.problem.at_rest, self.problem.peak, largest)
        facts = {
            **self.facts,
            "gap": float((error / self.problem.scale).max()),
            "gap_of_peaks": float(((outer.max(1) - inner.max(1)).max(-1) / largest).max()),
        }
        return Envelope(
            alpha=self.problem.boxes.alpha,
            time=self.flow.time,
            outputs=self.flow.outputs,
            inputs=self.problem.boxes.inputs,
            lower=-outer[..., 0],
            upper=outer[..., 1],
            lower_at=at[..., 0, :],
            upper_at=at[..., 1, :],
            error=error,
            nature=Nature.GUARANTEED,
            method=method,
            units=self.problem.units,
            basis=("the equations of motion hold",),
            inner=Ends(-inner[..., 0], inner[..., 1]),
            between=self.between,
            least_peaks=Ends(
                np.maximum.accumulate(self.least, axis=0),
                np.minimum.accumulate(least_reached[::-1], axis=0)[::-1],
            ),
            attained_error=self.attained_error if self.attained_error.any() else None,
            evaluations=int(facts.pop("evaluations", inner.size)),
            seconds=seconds,
            facts=facts,
            notes=(*notes,),
        )

    def _least_reached(self, outer: Array) -> Array:
        """Peak over time of a motion of each level that peaks low, shape (A, m)."""
        reached = self.least_reached
        for level, output in np.argwhere(~np.isfinite(reached)):
            # without a better one: the motion that is smallest where all motions are largest
            node, side = divmod(int(outer[level, :, output].argmin()), 2)
            motion = self.flow.values(self.at[level, node, output, side][None])[0, :, output]
            size = np.abs(motion) + self.attained_error[:, output]
            within_steps = np.maximum(size[1:], size[:-1]) + self.between[1:, output]
            reached[level, output] = max(size[0], within_steps.max(initial=0.0))
        return reached
