"""What proofs of bounds over a box of inputs are asked for and answer, and the hull of that."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import ClassVar, Protocol

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import FailedError
from alphacut.frame.boxes import Boxes, UnitFlow
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.envelope import Ends, Envelope, within_steps
from alphacut.fuzzy.result import Nature

ADDED = ("boxes", "evaluations")
"""Facts of boxes that are added; of the others the largest counts."""


@dataclass(frozen=True, eq=False)
class Goal:
    """Bounds that a proof is asked for over a box of L levels, and what is known there."""

    scale: Array  # units of the tolerances of each output, (m,)
    peak: Array  # peak of each output at the nominal inputs and the probes, (m,)
    needed: Mask  # bounds of (−output, output) that are asked for, (L, T, m, 2)
    outer: Array  # upper bounds that are known, the same shape; infinite where none is
    incumbent: Array  # largest reached values of (−output, output), (L, m, 2)
    workers: int  # number of threads
    last: bool  # whether a refusal ends the proof, so that wide bounds are better than none
    tick: Callable[[float], None]  # called with the completed fraction


@dataclass(frozen=True, eq=False)
class BoxBounds:
    """Bounds of (−output, output) over one level of a box of n inputs."""

    outer: Array  # proved upper bounds, (T, m, 2); at nodes not asked for any valid bound
    inner: Array  # values that motions reach, less rounding; −inf where none is known
    at: Array  # inputs of these motions, (T, m, 2, n), in SI units
    # largest deviation of an output from a straight line in the step before each node, (T, m)
    between: Array
    shares: Array  # fraction of each input in the gap at each peak, (m, 2, n)
    # what the exact motion at `at` may exceed `inner` by, (T, m)
    attained_error: Array | float = 0.0
    # lower and upper ends of the box that may contain each peak, (2, m, 2, n), in SI units; None
    # for all of the box
    remaining: Array | None = None
    # upper bounds over the rest of the box for each peak, (T, m, 2); None if all of the box
    # remains
    pruned: Array | None = None
    # lower bound of each output's least peak over time, and the peak of a motion that peaks low,
    # between nodes too, (m,) each; None for what the bounds at nodes say
    least_peaks: Ends | None = None
    facts: Mapping[str, float] = field(default_factory=dict)  # further numbers by name


class BisectionError(UnprovedError):
    """Bounds are not proved, and bisections would not help enough."""


Answer = BoxBounds | UnprovedError


class BoxProof(Protocol):
    """A proof of bounds over any box of the inputs."""

    name: ClassVar[str]

    @property
    def parts(self) -> int:
        """Most boxes that a peak of an output is worth, and that may be refused."""

    @property
    def workers(self) -> int | None:
        """Threads; all cores unless given."""

    def forecast(self, flow: LinearFlow, boxes: Boxes) -> float:
        """Return the expected work on the box, in evaluations of a mode's motion at a node.

        Raises:
            UnprovedError: No part of the box can be proved.
        """

    def peak_gap(self, flow: UnitFlow) -> Array:
        """Return the wanted gap of the outputs' peaks, shape (m,), in their units."""

    def call_kernels(self) -> None:
        """Call the compiled kernels of `bounds` that take tuples once; see `KernelThreads`."""

    def bounds(self, flow: LinearFlow, boxes: Boxes, goal: Goal) -> Sequence[Answer]:
        """Return bounds on each level of a box, or the refusal of that level.

        Raises:
            UnprovedError: All levels are refused.
        """


@contextmanager
def refusing() -> Iterator[None]:
    """Context manager that turns errors of matrices into a proof's refusal.

    Raises:
        UnprovedError: A matrix is singular.
    """
    try:
        yield
    except np.linalg.LinAlgError as error:
        what = f"a matrix is singular ({str(error).lower()})"
        raise UnprovedError(what, "take improved-graph-follower") from None


class Hull:
    """Bounds of (−output, output) on A levels, at T nodes, of m outputs, from those of boxes."""

    def __init__(self, problem: UnitFlow, flow: LinearFlow) -> None:
        self.problem, self.flow, names = problem, flow, problem.boxes.names
        levels, outputs = len(problem.boxes.alpha), len(flow.outputs)
        shape = (levels, len(flow.time), outputs, 2)
        # proved upper bounds of closed boxes, largest reached values, and their inputs, in SI units
        self.closed, self.inner = np.full((2, *shape), -np.inf)
        self.at = np.zeros((*shape, len(names)))
        self.between, self.attained_error = np.zeros((2, *shape[1:3]))
        # of each output's least peak over time a lower bound, and the peak of a motion that is low
        self.least_lower, self.least_upper = np.full((2, levels, outputs), np.inf)
        self.facts: dict[str, float] = {"parts": 0}

    def incumbent(self, level: int) -> Array:
        """Return the largest reached value of (−output, output) on a level, (m, 2); 0 at least."""
        return np.asarray(np.maximum(self.inner[level:].max((0, 1)), 0.0))

    def close(self, level: int, peaks: Mask, outer: Array) -> None:
        """Raise the bounds of some peaks (m, 2) at all nodes to those of a box, (T, m, 2)."""
        self.closed[level][:, peaks] = np.maximum(self.closed[level][:, peaks], outer[:, peaks])

    def take(self, level: int, bounds: BoxBounds) -> None:
        """Take over what motions of a box reach, errors and facts."""
        better = bounds.inner > self.inner[level]
        self.inner[level][better], self.at[level][better] = bounds.inner[better], bounds.at[better]
        self.between = np.maximum(self.between, bounds.between)
        self.attained_error = np.maximum(self.attained_error, bounds.attained_error)
        if bounds.least_peaks is not None:
            self.least_upper[level] = np.minimum(self.least_upper[level], bounds.least_peaks.upper)
        for name, value in bounds.facts.items():
            earlier = self.facts.get(name, 0)
            self.facts[name] = earlier + value if name in ADDED else max(earlier, value)

    def envelope(self, method: str, notes: Iterable[str]) -> Envelope:
        """Return the guaranteed envelope; raise if a reached bound lies outside a proved one."""
        # what holds in a wider cut holds in a narrower one, whose motions are in the wider one too
        outer, inner, at = np.minimum.accumulate(self.closed, axis=0), self.inner, self.at
        for level in reversed(range(len(inner) - 1)):
            better = inner[level + 1] > inner[level]
            inner[level][better] = inner[level + 1][better]
            at[level][better] = at[level + 1][better]
        is_wrong = ~(inner <= outer)  # also where one is NaN
        if is_wrong.any():
            output = self.flow.outputs[int(np.argwhere(is_wrong)[0, 2])]
            excess = np.nanmax(np.where(is_wrong, inner - outer, np.nan))
            what = f"attained bounds of {output} lie outside the proved ones by {excess:.3g}"
            raise FailedError(f"the proof is wrong: {what}", "keep the case and report it")
        least_upper = self._least_upper(outer)
        error = (outer - inner).max(-1)
        largest = np.maximum(np.abs(outer).max((1, 3)), 1e-300)
        # the gap of an output at rest is judged by what the motion's energy allows
        largest = np.where(self.problem.at_rest, self.problem.peak, largest)
        facts = {
            **self.facts,
            "gap": float((error / self.problem.scale).max()),
            "gap_of_peaks": float(((outer.max(1) - inner.max(1)).max(-1) / largest).max()),
        }
        return self.problem.envelope(
            outer,
            at,
            error,
            nature=Nature.GUARANTEED,
            method=method,
            basis=("the equations of motion hold",),
            inner=Ends(-inner[..., 0], inner[..., 1]),
            between=self.between,
            least_peaks=Ends(
                np.maximum.accumulate(self.least_lower, axis=0),
                np.minimum.accumulate(least_upper[::-1], axis=0)[::-1],
            ),
            attained_error=self.attained_error if self.attained_error.any() else None,
            evaluations=int(facts.pop("evaluations", inner.size)),
            facts=facts,
            notes=(*notes,),
        )

    def _least_upper(self, outer: Array) -> Array:
        """Peak over time of a motion of each level that peaks low, shape (A, m)."""
        reached = self.least_upper
        for level, output in np.argwhere(~np.isfinite(reached)):
            # without a better one: the motion that is smallest where all motions are largest
            node, side = divmod(int(outer[level, :, output].argmin()), 2)
            motion = self.flow.values(self.at[level, node, output, side][None])[0, :, output]
            size = np.abs(motion) + self.attained_error[:, output]
            reached[level, output] = within_steps(size, self.between[:, output]).max()
        return reached
