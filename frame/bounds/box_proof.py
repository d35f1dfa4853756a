"""What a proof of bounds over a box of inputs is asked for, and what it answers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import ClassVar, Protocol

import numpy as np

from alphacut.frame.boxes import Boxes
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.fuzzy.arrays import Array, Mask
from alphacut.fuzzy.result import Ends


@dataclass(frozen=True, eq=False)
class Goal:
    """Bounds that a proof is asked for over a box of L levels, and what is known there.

    Args:
        scale: Units of the tolerances of each output, shape (m,).
        peak: Peak of each output at the nominal inputs and the probes, shape (m,).
        needed: Bounds of (−output, output) that are asked for, shape (L, T, m, 2).
        outer: Upper bounds that are known, the same shape; infinite where none is.
        incumbent: Largest reached values of (−output, output), shape (L, m, 2).
        workers: Number of threads.
        last: Whether a refusal ends the proof, so that wide bounds are better than none.
        tick: Called with the completed fraction.
    """

    scale: Array
    peak: Array
    needed: Mask
    outer: Array
    incumbent: Array
    workers: int
    last: bool
    tick: Callable[[float], None]


@dataclass(frozen=True, eq=False)
class BoxBounds:
    """Bounds of (−output, output) over one level of a box of n inputs.

    Args:
        outer: Proved upper bounds, shape (T, m, 2); at nodes not asked for any valid bound.
        inner: Values that motions reach, less rounding; −inf where none is known.
        at: Inputs of these motions, shape (T, m, 2, n), in SI units.
        between: Largest deviation of an output from a straight line in the step before each node,
            shape (T, m).
        shares: Fraction of each input in the gap at each peak, shape (m, 2, n).
        attained_error: What the exact motion at `at` may exceed `inner` by, shape (T, m); None for
            rounding alone.
        remaining: Lower and upper ends of the box that may contain each peak, shape (2, m, 2, n),
            in SI units; None for all of the box.
        pruned: Upper bounds over the rest of the box for each peak, shape (T, m, 2); None if all of
            the box remains.
        least_peaks: Lower bound of each output's least peak over time, and the peak of a motion
            that peaks low, between nodes too, (m,) each; None for what the bounds at nodes say.
        facts: Further numbers by name.
    """

    outer: Array
    inner: Array
    at: Array
    between: Array
    shares: Array
    attained_error: Array | None = None
    remaining: Array | None = None
    pruned: Array | None = None
    least_peaks: Ends | None = None
    facts: Mapping[str, float] = field(default_factory=dict)


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

    def peak_gap(self, scale: Array, peak: Array) -> Array:
        """Return the wanted gap of the outputs' peaks, shape (m,), in their units; see `Goal`."""

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
