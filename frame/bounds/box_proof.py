"""What a proof of bounds over one sub-box of the inputs takes and returns, and the hull of these.

A proof bounds −q and q from above for every output q, at all time nodes and on several α-levels.
Arrays of such bounds have a last axis of two sides, in this order: −q, q. A "peak" is the largest
value of one side of one output over the time nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple, Protocol

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import FailedError
from alphacut.frame.boxes import Boxes, UnitFlow
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.result import Ends, Envelope, within_steps
from alphacut.fuzzy.result import Nature

ROUNDING_MARGIN = 1e-9
"""Margin of bounds and attained values for rounding, as a fraction of the peak of each output."""


@dataclass(frozen=True, eq=False)
class Goal:
    """Bounds that a proof is asked for over a sub-box of L levels, and what is known there.

    There are T time nodes and m outputs.
    """

    scale: Array  # units of the tolerances of each output, (m,)
    peak: Array  # peak magnitude of each output at the nominal inputs and the probes, (m,)
    needed: Mask  # bounds that are asked for, (L, T, m, 2)
    known_upper: Array  # upper bounds that are known, (L, T, m, 2); infinite where none is
    incumbent: Array  # largest values over time that exact trajectories attain, (L, m, 2)
    workers: int  # number of threads
    is_last: bool  # whether a refusal ends the proof, so that wide bounds are better than none
    tick: Callable[[float], None]  # called with the completed fraction


class PrunedPeaks(NamedTuple):
    """What pruning leaves of a sub-box of n inputs for each peak, and bounds over all else."""

    # lower and upper ends of the part that may contain each peak, (2, m, 2, n), in SI units
    remaining: Array
    # upper bounds over what is not `remaining`, for each peak, (T, m, 2)
    upper: Array


@dataclass(frozen=True, eq=False)
class BoxBounds:
    """Bounds of (−q, q) over one level of a sub-box of n inputs."""

    # guaranteed upper bounds, (T, m, 2); at nodes that were not asked for, any valid bound
    upper: Array
    # values that exact trajectories attain, less their rounding, (T, m, 2); −inf where none is
    # known
    attained: Array
    attained_at: Array  # inputs of these trajectories, (T, m, 2, n), in SI units
    # guaranteed bound of the distance of an output from the straight line between its values at the
    # ends of the step before each node, (T, m)
    between_nodes: Array
    # fraction of the gap of each peak that each input accounts for, (m, 2, n)
    gap_fractions: Array
    # what the exact trajectory at `attained_at` may exceed `attained` by, (T, m)
    attained_error: Array | float = 0.0
    pruned: PrunedPeaks | None = None  # None if nothing is pruned
    # For each output q, a lower bound of the smallest max |q| over time in the sub-box, and the
    # max |q| of one trajectory that has a small one, (m,) each, between nodes too. None for what
    # the bounds at nodes say.
    least_peaks: Ends | None = None
    facts: Mapping[str, float] = field(default_factory=dict)  # further numbers by name


class BisectionError(UnprovedError):
    """Bounds are not proved, and bisections would not help enough."""


Answer = BoxBounds | UnprovedError


class BoxProof(Protocol):
    """A proof of bounds over any sub-box of the inputs."""

    name: ClassVar[str]

    @property
    def parts(self) -> int:
        """Most sub-boxes that a peak of an output is worth, and that may be refused."""

    @property
    def workers(self) -> int | None:
        """Threads; all cores unless given."""

    def forecast(self, flow: LinearFlow, boxes: Boxes) -> float:
        """Return the expected work on the box, in evaluations of a mode's response at a node.

        Raises:
            UnprovedError: No sub-box can be proved.
        """

    def peak_gap(self, flow: UnitFlow) -> Array:
        """Return the wanted gap of the outputs' peaks, shape (m,), in their units."""

    def bounds(self, flow: LinearFlow, boxes: Boxes, goal: Goal) -> Sequence[Answer]:
        """Return the bounds on each level of a sub-box, or the refusal of that level.

        Raises:
            UnprovedError: All levels are refused.
        """


@contextmanager
def refusing() -> Iterator[None]:
    """Return a context manager that turns NumPy's errors of singular matrices into `UnprovedError`.

    Other exceptions of the block pass unchanged.

    Raises:
        UnprovedError: The block has raised numpy.linalg.LinAlgError; the message quotes it.
    """
    try:
        yield
    except np.linalg.LinAlgError as error:
        what = f"a matrix is singular ({str(error).lower()})"
        raise UnprovedError(what, "take improved-graph-follower") from None


def take_larger(values: Array, at: Array, new_values: Array, new_at: Array) -> None:
    """Replace values by larger ones, in place, together with the inputs that attain them.

    Args:
        values: Attained values, of any shape.
        at: Inputs that attain them, with a further axis.
        new_values: Other attained values, in the shape of `values`.
        new_at: Inputs that attain these.
    """
    is_larger = new_values > values
    values[is_larger] = new_values[is_larger]
    at[is_larger] = new_at[is_larger]


def gap_of_peaks(problem: UnitFlow, upper: Array, attained: Array) -> float:
    """Return the largest gap between guaranteed and attained peak, as a fraction of the peak.

    A peak is the largest value over time of an output or of the output with its sign changed. The
    larger gap of both is divided by the larger guaranteed peak; for an output at rest, whose peak
    is rounding, by the amplitude that the energy of the response permits.

    Args:
        problem: The response over the boxes, which tells the outputs at rest.
        upper: Guaranteed upper bounds of (−q, q), shape (levels, times, outputs, 2).
        attained: Attained values with the same axes.
    """
    peaks = upper.max(axis=1)
    largest = np.where(problem.at_rest, problem.peak, peaks.max(axis=-1))
    gaps = (peaks - attained.max(axis=1)).max(axis=-1)
    return float((gaps / np.maximum(largest, 1e-300)).max())


class Hull:
    """Bounds of (−q, q) over the whole box on A levels, collected from those of its sub-boxes.

    Every point of the box lies in a sub-box that is closed in the end. So the largest bound over
    all closed sub-boxes holds for the whole box.
    """

    def __init__(self, problem: UnitFlow, flow: LinearFlow, margin: Array) -> None:
        self.problem = problem
        self.flow = flow
        levels = len(problem.boxes.alpha)
        outputs = len(flow.outputs)
        shape = (levels, len(flow.time), outputs, 2)
        # guaranteed upper bounds over closed sub-boxes, and the largest attained values
        self.upper = np.full(shape, -np.inf)
        self.attained = np.full(shape, -np.inf)
        self.attained_at = np.zeros((*shape, len(problem.boxes.names)))  # inputs, in SI units
        self.between_nodes = np.zeros(shape[1:3])
        self.attained_error = np.zeros(shape[1:3])
        # for each output a lower bound of the smallest max |q| over time, and the smallest max |q|
        # of a known trajectory
        self.min_peak_lower = np.full((levels, outputs), np.inf)
        self.min_peak_upper = np.full((levels, outputs), np.inf)
        self.facts: dict[str, float] = {"parts": 0}
        self.margin = margin  # what covers rounding of bounds and attained values, (m,)

    def incumbent(self, level: int) -> Array:
        """Return the largest attained value of each side over a level, shape (m, 2); 0 at least.

        A trajectory of a higher level lies in this level too, since the α-cuts are nested.
        """
        largest = self.attained[level:].max(axis=(0, 1))
        return np.asarray(np.maximum(largest, 0.0))

    def close(self, level: int, peaks: Mask, upper: Array) -> None:
        """Take over the bounds of some peaks in one more sub-box, in place, where they are higher.

        A peak is the largest value over time of one side, −q or q, of one output q. The bounds over
        the whole box, `self.upper`, are the largest over all sub-boxes that have been closed so
        far.

        Args:
            level: Row of the α-cut, 0 for the widest.
            peaks: Which peaks are closed, shape (m, 2): outputs, then sides −q, q. Others are
                untouched.
            upper: Guaranteed upper bounds of the sides over the sub-box, shape (T, m, 2) for T time
                nodes.
        """
        hull = self.upper[level]
        hull[:, peaks] = np.maximum(hull[:, peaks], upper[:, peaks])

    def add_attained(self, level: int, bounds: BoxBounds) -> None:
        """Add, in place, what trajectories of a sub-box attain, their errors, and work counts.

        Upper bounds are not added; `close` does this when the sub-box needs no further bisection.

        Args:
            level: Row of the α-cut, 0 for the widest.
            bounds: Results over the sub-box. For T time nodes, m outputs q and the sides −q, q:
                `attained` of shape (T, m, 2) replaces smaller values together with the inputs
                `attained_at`; `between_nodes` and `attained_error`, shape (T, m), raise the largest
                ones so far, of all levels; the upper ends of `least_peaks`, shape (m,), lower the
                smallest known max |q| over time, unless it is None; and `facts` are merged by name.
        """
        own = self.attained[level], self.attained_at[level]
        take_larger(*own, bounds.attained, bounds.attained_at)
        self.between_nodes = np.maximum(self.between_nodes, bounds.between_nodes)
        self.attained_error = np.maximum(self.attained_error, bounds.attained_error)
        if bounds.least_peaks is not None:
            known = self.min_peak_upper[level]
            self.min_peak_upper[level] = np.minimum(known, bounds.least_peaks.upper)
        for name, value in bounds.facts.items():
            earlier = self.facts.get(name, 0)
            # Counts of sub-boxes add up; of any other fact the largest value stands.
            is_count = name in ("boxes", "evaluations")
            self.facts[name] = earlier + value if is_count else max(earlier, value)

    def envelope(self, method: str) -> Envelope:
        """Return the guaranteed envelope over the whole box, once all sub-boxes are closed.

        Attained values, and the inputs that attain them, are raised in place to those of narrower
        α-cuts.

        Args:
            method: Name of the proof.

        Returns:
            Lower and upper bounds of each output q at all levels and time nodes, `inner` bounds
            that trajectories attain, bounds of how far outputs leave straight lines `between` the
            nodes, and of the smallest max |q| over time (`least_peaks`). `error` is the distance of
            a bound from the attained value, the larger one of both sides. The facts "gap" and
            "gap_of_peaks" are the largest errors in comparison with the scale of tolerances and
            with the peaks.

        Raises:
            FailedError: An attained value exceeds a guaranteed bound or is NaN, so the proof is
                wrong.
            RefusedError: A trajectory that is chosen as one of a small peak does not exist, or is
                not finite.
        """
        # The α-cuts are nested. A bound over a wider cut holds over a narrower one, and a
        # trajectory of a narrower cut is one of the wider cut.
        upper = np.minimum.accumulate(self.upper, axis=0)
        for level in reversed(range(len(upper) - 1)):
            own = self.attained[level], self.attained_at[level]
            take_larger(*own, self.attained[level + 1], self.attained_at[level + 1])
        min_peak_upper = self._min_peak_upper_bounds(upper) + self.margin
        min_peak_lower = np.maximum(self.min_peak_lower - self.margin, 0.0)
        upper = upper + self.margin[:, np.newaxis]
        attained = self.attained - self.margin[:, np.newaxis]
        self._require_consistent(upper, attained)
        error = (upper - attained).max(axis=-1)
        facts = {
            **self.facts,
            "gap": float((error / self.problem.scale).max()),
            "gap_of_peaks": gap_of_peaks(self.problem, upper, attained),
        }
        return self.problem.envelope(
            upper,
            self.attained_at,
            error,
            nature=Nature.GUARANTEED,
            method=method,
            basis=("the equations of motion hold",),
            inner=Ends(-attained[..., 0], attained[..., 1]),
            between=self.between_nodes,
            least_peaks=Ends(
                np.maximum.accumulate(min_peak_lower, axis=0),
                np.minimum.accumulate(min_peak_upper[::-1], axis=0)[::-1],
            ),
            attained_error=self.attained_error + 2 * self.margin,
            evaluations=int(facts.pop("evaluations", attained.size)),
            facts=facts,
        )

    def _require_consistent(self, upper: Array, attained: Array) -> None:
        """Raise FailedError where an attained value exceeds its guaranteed bound, or either is NaN.

        Args:
            upper: Guaranteed upper bounds, shape (A, T, m, 2): levels, time nodes, outputs q, and
                the sides −q, q.
            attained: Attained values with the same axes; both are in the units of the outputs.

        Raises:
            FailedError: The message names the output of the first contradiction and the largest
                excess.
        """
        is_wrong = ~(attained <= upper)  # true also where one of both is NaN
        if not is_wrong.any():
            return
        output = self.flow.outputs[int(np.argwhere(is_wrong)[0, 2])]
        excess = np.nanmax(np.where(is_wrong, attained - upper, np.nan))
        what = f"attained bounds of {output} lie outside the proved ones by {excess:.3g}"
        raise FailedError(f"the proof is wrong: {what}", "keep the case and report it")

    def _min_peak_upper_bounds(self, upper: Array) -> Array:
        """Return an upper bound of the smallest max |q| over time on each level, shape (A, m).

        The largest |q| over time of any trajectory of a level is such a bound. Where the proof has
        named no trajectory, one is chosen here from those that attain the largest values of −q and
        of q, whose inputs `self.attained_at`, shape (A, T, m, 2, n), must be known.

        Args:
            upper: Guaranteed upper bounds, shape (A, T, m, 2): levels, time nodes, outputs q, and
                the sides −q, q.

        Returns:
            The array `self.min_peak_upper`, whose infinite entries have been replaced in place.

        Raises:
            RefusedError: The chosen trajectory does not exist, or is not finite.
            StepError: A time step of it did not converge.
        """
        bounds = self.min_peak_upper
        for level, output in np.argwhere(~np.isfinite(bounds)):
            # Any trajectory gives a valid bound, and one with a small peak gives a good one. Where
            # the upper bound of −q or q is most negative, all trajectories are far from zero, and
            # the one that attains the largest value of that side is the closest to zero.
            of_output = upper[level, :, output]  # (T, 2)
            node, side = np.unravel_index(of_output.argmin(), of_output.shape)
            inputs = self.attained_at[level, node, output, side]
            trajectory = self.flow.values(inputs[np.newaxis])[0, :, output]
            # The exact trajectory may exceed the computed one by `attained_error` at a node, and
            # both ends of a step by `between_nodes` within it.
            magnitude = np.abs(trajectory) + self.attained_error[:, output]
            bounds[level, output] = within_steps(magnitude, self.between_nodes[:, output]).max()
        return bounds
