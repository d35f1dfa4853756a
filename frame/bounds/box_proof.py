"""What a proof of bounds over a box of inputs is asked for, and what it answers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import ClassVar, Protocol

import numpy as np

from alphacut.frame.boxes import Boxes
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.structures.modes import ModalError
from alphacut.fuzzy.arrays import Array, Mask
from alphacut.fuzzy.progress_bar import Progress
from alphacut.fuzzy.result import Ends


@dataclass(frozen=True, eq=False)
class Goal:
    """Requested accuracy and known bounds of a part of the box, on its L levels.

    Args:
        scale: Units of the tolerances of each output, shape (m,).
        peak: Peak of each output at the nominal inputs and the probes, shape (m,).
        needed: Bounds of (−output, output) that are asked for, shape (L, T, m, 2).
        outer: Bounds that are known, the same shape; infinite where none is.
        incumbent: Largest attained value of (−output, output), shape (L, m, 2).
        workers: Threads.
        last: Whether the part is not bisected any more, so that wide bounds are better than none.
        tick: Called with the completed fraction of the part.
    """

    scale: Array
    peak: Array
    needed: Mask
    outer: Array
    incumbent: Array
    workers: int
    last: bool
    tick: Progress


@dataclass(frozen=True, eq=False)
class PartBounds:
    """Upper bounds of (−output, output) over one level of a part of the box, n inputs.

    Args:
        outer: Proved, shape (T, m, 2).
        inner: Attained, less rounding; −inf where nothing is.
        at: Inputs that attain `inner`, shape (T, m, 2, n), in SI units.
        between: Largest deviation of an output from a straight line in the step before each node,
            shape (T, m).
        shares: Fraction of each input in the gap at each peak, shape (m, 2, n).
        attained_error: What the exact motion at `at` may exceed `inner` by, shape (T, m); None for
            rounding alone.
        remaining: Lower and upper ends of the box that may contain each peak, shape (2, m, 2, n),
            in SI units; None for all of the part.
        pruned: Upper bounds over the remainder of the part, for the nodes asked for; None if
            nothing was pruned.
        least_peaks: Lower bound of each output's smallest peak, and one that some motion does not
            exceed, between nodes too, shapes (m,); None where not all nodes are bounded.
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


@contextmanager
def refusing() -> Iterator[None]:
    """Context manager that turns errors of modes and matrices into a proof's refusal.

    Raises:
        UnprovedError: The modes do not allow the proof, or a matrix is singular.
    """
    try:
        yield
    except ModalError as error:
        raise UnprovedError(error.what, error.cure) from None
    except np.linalg.LinAlgError as error:
        what = f"a matrix is singular ({str(error).lower()})"
        raise UnprovedError(what, "take improved-graph-follower") from None


class BoxProof(Protocol):
    """A proof of bounds over any box of the inputs."""

    name: ClassVar[str]

    @property
    def parts(self) -> int:
        """Most parts that a box, or a peak of an output, is worth."""

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

    def bounds(
        self, flow: LinearFlow, boxes: Boxes, goal: Goal
    ) -> Sequence[PartBounds | UnprovedError]:
        """Return bounds on each level of a part of the box, or the refusal of that level.

        Raises:
            UnprovedError: All levels are refused.
            ModalError: The structure has no smooth oscillating modes over the part.
        """
