"""Proved envelopes of linear structures with many fuzzy inputs: the dual bound as a method.

1. A linear structure with classical modes answers as Σ_k F_k(z_k): z_k are few intervening
   variables of mode k (section 7), its frequency, its decay and its shares, F_k the exact
   response of one oscillator. They bend little over the box: z = Z u + quadratic terms + R, |R|
   proved (`blocks`, `intervening`). The F_k stand in tables of proved error (`waves`).
2. For any multipliers μ

       max Σ_k F_k(z_k(u)) ≤ Σ_k max (F_k − μ_k·z_k) + max μ·(z − R)(u) + |μ|·R,

by Lagrangian relaxation (Geoffrion 1974; Lemaréchal 2001), so that nothing rests on how μ is
found. The cost is one of modes, tables and nodes, and hardly one of inputs (`dual_function`).
3. Where the modes' own maxima lie too far from one u, their ranges are halved: slabs of few z,
   not boxes of many u. Near the peaks, that is; elsewhere a wider gap is left.
4. What the maxima name leads to inputs whose exact motion is the other end of the gap (`box`).
5. The few nodes whose bounds are still too far above a peak are bounded over parts of the box
   (`alphacut.frame.bounds.spatial_branch_and_bound`), after its ends are pruned (`pruning`).
6. The same bounds, over ranges of the leading mode, tell how low a peak can be (`least_peaks`).
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from alphacut.frame.bounds.box import Box
from alphacut.frame.bounds.box_proof import BoxBounds, Goal
from alphacut.frame.bounds.least_peaks import least_peak
from alphacut.frame.bounds.level import OutputBounds
from alphacut.frame.bounds.pruning import prune_ends, remainder
from alphacut.frame.bounds.spatial_branch_and_bound import halvings, prove
from alphacut.frame.boxes import Boxes, UnitFlow
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.envelope import Ends, Envelope
from alphacut.frame.numbers import WIDE
from alphacut.frame.structures.linear import frequencies
from alphacut.fuzzy.arrays import Array, Rows
from alphacut.fuzzy.progress_bar import Progress
from alphacut.fuzzy.refused import RefusedError

PEAK_SLABS, PEAK_STEPS = 240, 40
"""Most slabs of a bound above a peak over a part, and evaluations for each."""
DRIFT = 1e-6
"""Lowest frequency over the highest at which rounding of the stiffness may hide a drift."""
NEAR = 1e-3
"""Share of the box about the nominal inputs over which modes are enclosed if any part of the box
can be proved."""

CORNERS = 3
"""Corners of the box that a descent to the smallest peak visits."""
TRUNCATION = 0.1
"""Share of a gap that modes may take which are not enclosed."""


@dataclass(frozen=True)
class DualProof:
    """The method and its options.

    Args:
        gap: Distance of proved and attained bounds that suffices, as a share of each output's peak;
            what the remainders leave may be more.
        peaks: The same of the bounds above a peak, above which the box of inputs is parted.
        below: Gap that suffices below a peak, as a share of how far; at 1 peaks alone are bounded.
        slabs: Most parts of the modes' ranges for a bound.
        steps: Most evaluations of the dual function for each of them.
        parts: Most parts of the box that a peak is worth, and that are refused.
        workers: Threads, which do not change the result; all cores unless given.

    Raises:
        RefusedError: A value is not positive.

    Example:
        >>> from alphacut.frame import StoreyFrame, envelope
        >>> from alphacut.fuzzy import Triangular
        >>> frame = StoreyFrame(masses=[1e3], stiffness=[4e4], q0=[0.1])
        >>> inputs = {"m1": Triangular(900, 1000, 1100)}
        >>> str(envelope(frame, inputs, DualProof(), duration=0.5, step=0.1).nature)
        'guaranteed'
    """

    name: ClassVar[str] = "dual"
    gap: float = 2e-3
    peaks: float = 0.019
    below: float = 0.1
    slabs: int = 24
    steps: int = 40
    parts: int = 32
    workers: int | None = None

    def __post_init__(self) -> None:
        for key in ("gap", "peaks", "below", "slabs", "steps", "parts"):
            if not getattr(self, key) > 0:
                raise RefusedError(key, getattr(self, key), "a positive number")

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Guaranteed envelope of all outputs on all levels.

        Raises:
            UnprovedError: The structure has no classical modes that can be enclosed, or the motion
                is not the exact one.
        """
        return prove(self, flow, progress)

    def peak_gap(self, scale: Array, peak: Array) -> Array:
        """Gap at peaks that suffices, shape (m,)."""
        del scale
        return self.peaks * peak

    def forecast(self, flow: LinearFlow, boxes: Boxes) -> float:
        """Expected work on the box: evaluations of the dual function for a bound, at most.

        A small part of the box is bounded first, so that what no part can mend is refused at once.

        Raises:
            UnprovedError: No mode of the structure can be enclosed, however narrow a part is.
        """
        rates = frequencies(flow.system)
        if rates[0] <= DRIFT * rates[-1]:
            what = "a mode does not oscillate: the stiffness lets the structure drift"
            raise UnprovedError(what, "take improved-graph-follower")
        ends = np.stack([boxes.lower[0], boxes.upper[0]])
        near = boxes.modal + NEAR * (ends - boxes.modal)
        if (near[1] > near[0]).any():
            Box(flow.system, boxes.names, flow.time, *near).level(
                np.arange(2), np.full(len(flow.outputs), np.inf)
            )
        return float(self.slabs * self.steps)

    def bounds(self, flow: LinearFlow, boxes: Boxes, goal: Goal) -> list[BoxBounds | UnprovedError]:
        """Bounds on each level of a part, or the error of one whose modes are not enclosed."""
        found: list[BoxBounds | UnprovedError] = []
        for k in range(len(boxes.alpha)):
            try:
                found.append(self._of_level(flow, boxes, goal, k))
            except UnprovedError as refusal:
                found.append(refusal)
        return found

    def _of_level(self, flow: LinearFlow, boxes: Boxes, goal: Goal, k: int) -> BoxBounds:
        """Bounds on level k of a part; those of the exact motion where no input has a width."""
        low, high = boxes.lower[k], boxes.upper[k]
        box = Box(flow.system, boxes.names, flow.time, low, high)
        if (high > low).any():
            return _Bounding(self, flow, box, goal, k).bounds()
        value, error, deviation = box.centre_motion()
        sides, margin = np.stack([-value, value], -1), error[..., None]
        return BoxBounds(
            outer=sides + margin,
            inner=sides - margin,
            at=np.broadcast_to(low, (*sides.shape, len(low))).copy(),
            between=deviation,
            shares=np.zeros((*sides.shape[1:], len(low))),
            attained_error=2 * error,
            least_peaks=Ends((np.abs(value) - error).max(0), box.peak_over_time(np.zeros(0))),
        )


class _Bounding:
    """Bounds over one level of a part.

    Attributes:
        needed: Bounds that are asked for, shape (T, m, 2).
        nodes: Nodes of these, shape (J,).
        outputs: Outputs of these, rising.
        level: Models of the motion at these.
        outer: Upper bounds of (−output, output) at all nodes, shape (T, m, 2).
        unit: Coordinates of the best inputs, shape (T, m, 2, d).
        shares: Share of each input in the gap at each peak, shape (m, 2, d).
    """

    def __init__(self, proof: DualProof, flow: LinearFlow, box: Box, goal: Goal, k: int) -> None:
        self.proof, self.flow, self.box, self.goal = proof, flow, box, goal
        self.needed, self.outer = goal.needed[k], goal.outer[k].copy()
        self.incumbent = goal.incumbent[k].copy()
        self.nodes: Rows = np.flatnonzero(self.needed.any((1, 2)))
        gap = proof.gap if self.needed.all() else proof.peaks
        self.outputs: Rows = np.flatnonzero(self.needed.any((0, 2)))
        allowed = TRUNCATION * gap * goal.peak[self.outputs]
        self.level = box.level(self.nodes, allowed, self.outputs)
        d = len(box.active)
        self.unit = np.zeros((*self.outer.shape, d))
        self.shares = np.zeros((*self.outer.shape[1:], d))

    def bounds(self) -> BoxBounds:
        """Proved and attained bounds that are asked for, with the part pruned near peaks."""
        if self.needed.all():
            self._require_narrow()
            proof, goal = self.proof, self.goal
            bounds, self.unit = self.level.bounds(
                proof.gap * goal.peak,
                proof.below,
                proof.slabs,
                proof.steps,
                goal.workers,
                goal.tick,
            )
            self.outer = np.minimum(self.outer, bounds)
        else:
            self._at_peaks(self._bound)
        inner = np.full(self.outer.shape, -np.inf)
        node, output, side = np.nonzero(self.needed)
        value, error = self.box.attained_with_error(self.unit[self.needed], node, output)
        inner[self.needed] = np.where(side, value, -value) - error
        attained_error = np.zeros(self.outer.shape[:2])
        np.maximum.at(attained_error, (node, output), 2 * error)
        self.incumbent = np.maximum(self.incumbent, inner.max(0))
        n, active = len(self.box.low), self.box.active
        self.remaining = np.empty((2, *self.incumbent.shape, n))
        self.remaining[:] = np.stack([self.box.low, self.box.high])[:, None, None]
        self.pruned = np.full(self.outer.shape, -np.inf)
        self._at_peaks(self._prune)
        least = self._least_peaks() if self.needed.all() else None
        shares = np.zeros((*self.incumbent.shape, n))
        shares[..., active] = self.shares
        between = np.zeros(self.outer.shape[:2])
        between[self.nodes] = self.level.line_deviation() if self.needed.all() else 0.0
        return BoxBounds(
            outer=self.outer,
            inner=inner,
            at=self.box.inputs(self.unit),
            between=between,
            shares=shares,
            attained_error=attained_error,
            remaining=self.remaining,
            pruned=self.pruned,
            least_peaks=least,
            facts={"single_modes": len(self.level.oscillators)},
        )

    def _least_peaks(self) -> Ends:
        """Proved lower bound of each output's smallest peak, and a small one that is reached."""
        outputs = range(len(self.incumbent))
        with ThreadPoolExecutor(self.goal.workers) as pool:
            bounds, units = zip(*pool.map(partial(least_peak, self.level), outputs), strict=True)
        return Ends(np.array(bounds), self._least_peak_bounds(np.stack(units)))

    def _least_peak_bounds(self, unit: Array) -> Array:
        """Upper bound of each output's least peak over the box, shape (m,).

        Steepest descent over corners, one coordinate at a time, by the peaks at the nodes; at the
        corner that it finds the peak is bounded between nodes, too.

        Args:
            unit: Coordinates near each output's smallest peak, shape (m, d).
        """
        d = unit.shape[-1]
        moves = 1 - 2 * np.eye(d + 1, d)  # one coordinate changes its sign, or none
        for _ in range(CORNERS):
            tried = np.unique((unit[:, None] * moves).reshape(-1, d), axis=0)
            peaks = np.abs(self.flow.values(self.box.inputs(tried))).max(1)
            unit = tried[peaks.argmin(0)]
        return np.array([self.box.peak_over_time(unit[o])[o] for o in range(len(unit))])

    def _require_narrow(self) -> None:
        """Refuse a part whose Taylor remainders exceed `WIDE` of a peak, if bisections help.

        Nothing is refused where the part cannot be bisected any more.

        Raises:
            UnprovedError: They do.
        """
        if self.goal.last:
            return
        for o, s in np.ndindex(self.incumbent.shape):
            bounds = self._initial_bounds(o, s, 0.0, 0.0)
            bounds.run(np.arange(len(self.nodes)), 1, 1, 0.0, 0.0)
            node, shares = int(bounds.out[1].argmax()), np.zeros(len(self.box.low))
            addition, shares[self.box.active] = remainder(bounds, node)
            if addition > WIDE * self.goal.peak[o] and halvings(shares, self.proof.parts) >= 1:
                what = (
                    f"the remainders of the modes are {addition / self.goal.peak[o]:.2g} of a peak"
                )
                raise UnprovedError(what, "take narrower inputs", int(shares.argmax()))

    def _at_peaks(self, improve: Callable[[int, int], None]) -> None:
        """Call `improve(output, side)` for each pair with a bound above what suffices."""
        enough = self.proof.peaks * self.goal.peak[:, None]
        above = self.needed & (self.outer > self.incumbent + enough)
        with ThreadPoolExecutor(self.goal.workers) as pool:
            for job in [pool.submit(improve, *peak) for peak in np.argwhere(above.any(0))]:
                job.result()

    def _open_bounds(self, o: int, s: int) -> tuple[OutputBounds, Rows]:
        """Bounds of output o on side s so far, and places of nodes where they do not suffice."""
        wanted_gap, attained = self.proof.peaks * float(self.goal.peak[o]), self.incumbent[o, s]
        bounds = self._initial_bounds(o, s, wanted_gap, float(attained))
        bounds.out[0] = self.outer[self.nodes, o, s]
        above = self.needed[self.nodes, o, s] & (bounds.out[0] > attained + wanted_gap)
        return bounds, np.flatnonzero(above)

    def _initial_bounds(self, o: int, s: int, enough: float, top: float) -> OutputBounds:
        """Infinite bounds of output o on side s (0 for −output, 1 for the output)."""
        return OutputBounds.initial(
            self.level, int(np.searchsorted(self.outputs, o)), s, enough, top
        )

    def _bound(self, o: int, s: int) -> None:
        """Improve the bounds of output o on side s at the nodes where they exceed its peak."""
        bounds, above = self._open_bounds(o, s)
        bounds.run(above, PEAK_SLABS, PEAK_STEPS, 1.0, 0.0)
        nodes = self.nodes[above]
        self.outer[nodes, o, s], self.unit[nodes, o, s] = bounds.out[0, above], bounds.at[above]

    def _prune(self, o: int, s: int) -> None:
        """Prune the ends of the part's box that hold no higher peak of output o on side s.

        Written are the inputs' shares in the gap, what remains, and bounds over what is pruned.
        """
        bounds, above = self._open_bounds(o, s)
        nodes = self.nodes[above]
        bounds.at[above] = self.unit[nodes, o, s]
        highest_node = int(above[bounds.out[0, above].argmax()])
        self.shares[o, s] = remainder(bounds, highest_node)[1]
        best = self.unit[nodes, o, s][self.outer[nodes, o, s].argmax()]
        index = int(np.searchsorted(self.outputs, o)), s
        low, high, pruned = prune_ends(self.level, bounds, index, above, best)
        self.remaining[:, o, s] = self.box.inputs(np.stack([low, high]))
        self.pruned[nodes, o, s] = pruned
