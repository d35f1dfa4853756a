"""Auto: the best known method for an envelope, chosen by the forecast work of the proofs.

1. Up to six fuzzy inputs, branch and bound is a proof; for any number of inputs, the dual bound is.
   The one with less forecast work is tried first, and the other one if the first fails or leaves a
   wide gap. Branch and bound is tried on the whole box first, and on sub-boxes if nothing else
   remains.
2. If the gap of a guarantee is more than a tenth of a peak, the improved follower looks for
   responses that attain more. If a stated tolerance is not proved, the follower estimates the
   envelope, and guaranteed bounds stand outside it.
3. Without a proof the follower remains.
4. If columns yield, so that there are no derivatives, the peaks of one storey are proved for up to
   three inputs, and else they are searched.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import checked_number
from alphacut.base.progress_bar import Progress, subprogress
from alphacut.frame.bounds.box_proof import gap_of_peaks, refusing
from alphacut.frame.boxes import DEFAULT_TOLERANCE, MAX_PARAMETERS, UnitFlow
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import LinearFlow, exact_flow
from alphacut.frame.dynamics.yielding import YieldingFlow
from alphacut.frame.methods.improved_follower import ImprovedFollower, PassBounds
from alphacut.frame.methods.method import Method
from alphacut.frame.methods.sampled import PeakSearch
from alphacut.frame.numbers import WIDE
from alphacut.frame.result import Ends, Envelope

if TYPE_CHECKING:
    from alphacut.frame.methods.dual import DualProof
    from alphacut.frame.methods.proof import Proof
    from alphacut.frame.threshold import Threshold

# The proofs are imported where they are made: that takes .05 s, which a check of a case spares.
LOG = logging.getLogger(__name__)

FEW_INPUTS = 4
"""Inputs up to which the dual bound closes the gaps of peaks to the usual tolerance (tuned)."""


@dataclass(frozen=True)
class Auto(Method):
    """The automatic choice of a method, and its options.

    Args:
        tolerance: Wanted error, as a fraction of the peak of each output, or in the unit of the
            first displacement (of the first output if there is none) if the envelope is not
            relative; 1e-3 of each peak by default.
        seed: Seed of the follower.
        workers: Number of threads of the proof, which does not change the result; by default all
            cores.
        peaks: Whether the error is that of the peaks, so that a proof with a wider gap is kept.
        magnitudes: Whether nothing is read off bounds below the peaks, which may be wide then.
        dual_first: Whether the dual bound is tried first in any case, which bounds peaks sooner
            than branch and bound, but no closer than asked.
        thresholds: Limits of peaks where columns yield. With them the effort goes to the question
            whether they hold, and not to the error.

    Raises:
        RefusedError: The tolerance is not positive.
    """

    name: ClassVar[str] = "auto"
    takes_kinks: ClassVar[bool] = True
    is_exact: ClassVar[bool] = True
    tolerance: float | None = None
    seed: int = 0
    workers: int | None = None
    peaks: bool = False
    magnitudes: bool = False
    dual_first: bool = False
    thresholds: tuple[Threshold, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        if self.tolerance is not None:
            checked_number("tolerance", self.tolerance, positive=True)

    @property
    def is_for_all_nodes(self) -> bool:
        """Whether a stated tolerance holds for all bounds, and not for the peaks alone."""
        return self.tolerance is not None and not self.peaks

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Return the envelope on all levels, by a proof if possible.

        Columns that yield take a proof for one storey or a search of peaks, and systems that are
        not linear take the improved follower. For linear structures the proofs are tried in turn,
        until one has a gap that suffices. If none has, the narrowest guarantee is kept, completed
        by attained values of the follower if it is wider than a tenth of a peak. If a tolerance was
        stated for all time nodes, or if there is no proof, the estimated envelope of the follower
        is returned, with the guaranteed bounds as its `outer`.

        Args:
            flow: The response over the boxes of the inputs.
            progress: Called with the completed fraction.

        Returns:
            The envelope; its first note says which method was chosen, and why.

        Raises:
            FailedError: A time step did not converge, or a proof contradicts attained values.
            RefusedError: A response does not exist.
        """
        tolerance = flow.tolerance(self.tolerance)
        if isinstance(flow.flow, YieldingFlow):
            return self._of_yielding_columns(flow, progress)
        if not isinstance(flow.flow, LinearFlow):
            # Twice the predicted gain and the difference of two passes are part of the error of a
            # follower.
            follower = ImprovedFollower(0.7 * tolerance, seed=self.seed)
            return _noted(follower.run(flow, progress), f"{follower.name}: not linear")

        reasons: list[str] = []
        proved: list[Envelope] = []
        # It is not known beforehand whether the first proof is enough; it usually is.
        of_proofs = subprogress(progress, 0.0, 0.8)
        of_follower = subprogress(progress, 0.8, 1.0)
        for proof in self._proofs(flow, reasons):
            try:
                found = proof.run(flow, of_proofs)
            except UnprovedError as error:
                reasons.append(f"{proof.name}: {error}")
                continue
            if self._is_close(found, flow):
                return _noted(found, "; ".join([f"{proof.name} succeeded", *reasons]))
            proved.append(found)
            reasons.append(f"{proof.name}: its gap is wider than the tolerance")

        # The error of a follower is up to seven times the gain that is worth a graph (measured).
        follower = ImprovedFollower(0.15 * tolerance, seed=self.seed)
        # A wide guarantee is better than none, unless a stated tolerance is meant for all nodes.
        best = min(proved, key=lambda found: found.facts["gap_of_peaks"], default=None)
        if best is not None and not self.is_for_all_nodes:
            if best.facts["gap_of_peaks"] <= WIDE:
                return _noted(best, "; ".join([f"{best.method} succeeded", *reasons]))
            # Responses are worth computing where bounds lie above the attained peak; elsewhere
            # they cannot raise it.
            outer, inner = _sides(best)
            asked = outer > inner.max(axis=1, keepdims=True)
            followed = follower.run_pass(flow, of_follower, asked)
            return _noted(_with_reached(best, flow, followed), f"{best.method} and {follower.name}")
        found = follower.run(flow, of_follower)
        if best is not None:
            found = replace(found, outer=best.proved)
        return _noted(found, f"{follower.name}; unproved: {'; '.join(reasons)}")

    def _of_yielding_columns(self, flow: UnitFlow, progress: Progress | None) -> Envelope:
        """Return the guaranteed envelope of a yielding storey, or that of a search of peaks.

        The search follows if the proof is refused, or if it leaves a gap of more than a tenth of a
        peak. Then the guaranteed bounds stand outside its envelope. Where limits are asked about,
        a gap has no meaning.
        """
        from alphacut.frame.methods.proof import Proof

        # At most 1000 sub-boxes take a minute or two (tuned: more hardly close gaps).
        proof = Proof(None, self.tolerance, boxes=1000, thresholds=self.thresholds)
        outer = None
        try:
            proved = proof.run(flow, subprogress(progress, 0.0, 0.8))
        except UnprovedError as error:
            reason = str(error)
        else:
            if self.thresholds or proved.facts["gap_of_peaks"] <= WIDE:
                return _noted(proved, f"{proof.name} succeeded")
            outer = proved.proved
            reason = "its gap is wider than the tolerance"
        found = replace(PeakSearch().run(flow, subprogress(progress, 0.8, 1.0)), outer=outer)
        return _noted(found, f"{PeakSearch.name}; unproved: {reason}")

    def _proofs(self, flow: UnitFlow, reasons: list[str]) -> Iterator[Proof | DualProof]:
        """Yield the proofs to try on a linear structure, in their order.

        There are two: branch and bound over the inputs, on the whole box or on sub-boxes, for up to
        six inputs; and the dual bound. The one with less forecast work comes first; branch and
        bound also if a tolerance is stated for all time nodes. The work of the dual bound is
        forecast by a part of the box, which is spared where branch and bound takes less than the
        least that it may be.

        Args:
            flow: The response over the boxes of the inputs.
            reasons: Reasons why a proof is not possible are appended to this list, in place.
        """
        from alphacut.frame.methods.dual import DualProof
        from alphacut.frame.methods.proof import Proof

        # A proof looks at 1000 boxes for each bound on average (tuned: more hardly close gaps).
        proof = Proof(None, self.tolerance, boxes=1000, workers=self.workers)
        if len(flow.boxes.names) > MAX_PARAMETERS:
            yield self._dual(flow)
            return
        exact = exact_flow(flow.flow)
        method: Proof | DualProof = proof
        # Branch and bound closes the gap at all nodes alike, the dual bound only at peaks.
        is_first = self.is_for_all_nodes
        try:
            with refusing():
                work = proof.forecast(exact, flow.boxes)
                is_first = is_first or work <= DualProof.slabs * DualProof.steps
                if not is_first:
                    method = self._dual(flow)
                    is_first = work <= method.forecast(exact, flow.boxes)
        except UnprovedError as error:
            # If only one proof is possible, there is no choice.
            reasons.append(f"{method.name}: {error}")
            yield self._dual(flow) if method is proof else proof
            return
        undivided = replace(proof, parts=1)
        if is_first and not self.dual_first:
            yield undivided
        yield self._dual(flow)
        if not is_first or self.dual_first:
            yield undivided
        # Branch and bound on sub-boxes comes last, because each one costs as much as the whole box.
        if is_first:
            yield proof

    def _dual(self, flow: UnitFlow) -> DualProof:
        """Return the dual bound with gaps that fit the tolerance.

        Its gaps keep their defaults if a tolerance is stated for all time nodes. Otherwise, if the
        tolerance is a fraction of the peaks and there are at most four inputs (six if it is
        stated), the gap of nodes and that of peaks are the tolerance, but at least 1e-4. In all
        other cases a stated tolerance sets the gap of peaks to a tenth, and without one the
        defaults stay. If magnitudes alone count, bounds below peaks get no effort.

        Args:
            flow: The response over the boxes of the inputs.
        """
        from alphacut.frame.methods.dual import DualProof

        dual = DualProof(workers=self.workers)
        if self.magnitudes:
            dual = replace(dual, below=1.0)
        if self.is_for_all_nodes:
            return dual  # gaps below the peaks stay wide in any case
        max_inputs = FEW_INPUTS
        if self.tolerance:
            max_inputs = MAX_PARAMETERS
        if flow.relative and len(flow.boxes.names) <= max_inputs:
            # With a smaller gap of peaks than 1e-4 the dual bound takes too long (tuned).
            gap = max(self.tolerance or DEFAULT_TOLERANCE, 1e-4)
            return replace(dual, gap=gap, peaks=gap)
        if self.tolerance is not None:
            return replace(dual, peaks=WIDE)
        return dual

    def _is_close(self, proved: Envelope, flow: UnitFlow) -> bool:
        """Return whether the gap of a guaranteed envelope suffices, so that no proof follows.

        If a tolerance is stated for all time nodes, each gap must be within it. Otherwise the gaps
        of peaks count, which may be a tenth of each peak; or twice the tolerance, if it is stated
        as a fraction of the peaks and there are at most four inputs.

        Args:
            proved: The envelope, whose `error` is the gap at each time node.
            flow: The response over the boxes of the inputs.
        """
        if self.is_for_all_nodes:
            allowed = flow.tolerance(self.tolerance) * flow.scale * (1 + 1e-9)  # rounding
            return bool((proved.error <= allowed).all())
        allowed_gap = WIDE
        if self.tolerance and flow.relative and len(flow.boxes.names) <= FEW_INPUTS:
            allowed_gap = 2 * self.tolerance
        return proved.facts["gap_of_peaks"] <= allowed_gap


def _with_reached(proved: Envelope, flow: UnitFlow, followed: PassBounds) -> Envelope:
    """Return a copy of a guaranteed envelope with the larger values that a follower attains.

    The guaranteed bounds stay. Where a follower's trajectory goes farther than the attained value
    that is known, it replaces this value and its inputs; the gap, which is the envelope's error,
    and the number "gap_of_peaks" of its facts become smaller.

    Args:
        proved: The guaranteed envelope, with attained bounds.
        flow: The response over the boxes of the inputs, for which both were computed.
        followed: Attained bounds of the same problem: upper bounds of (-output, output), shape
            (levels, times, outputs, 2), and the unit coordinates that attain them, with a further
            axis of the inputs.
    """
    # The attained values of a proof are reduced by a bound of their rounding, those of a follower
    # are not. Rounding of its trajectories stays below a 1e-9th of the peak.
    rounding = 1e-9 * np.abs(followed.bounds).max(axis=(0, 1, 3))[:, np.newaxis]
    values = followed.bounds - rounding
    outer, inner = _sides(proved)
    better = values > inner
    inner = np.where(better, values, inner)
    at = np.stack([proved.lower_at, proved.upper_at], axis=-2)
    at = np.where(better[..., np.newaxis], flow.boxes.to_physical(followed.points), at)
    return replace(
        proved,
        inner=Ends(-inner[..., 0], inner[..., 1]),
        lower_at=at[..., 0, :],
        upper_at=at[..., 1, :],
        error=(outer - inner).max(axis=-1),
        facts={**proved.facts, "gap_of_peaks": gap_of_peaks(flow, outer, inner)},
    )


def _sides(proved: Envelope) -> tuple[Array, Array]:
    """Return guaranteed and attained upper bounds of both sides of the outputs of an envelope.

    Args:
        proved: A guaranteed envelope with attained bounds.

    Returns:
        Guaranteed bounds and attained values, shape (levels, times, outputs, 2) each: on the last
        axis first of the output with its sign changed, then of the output.
    """
    assert proved.inner is not None
    outer = np.stack([-proved.lower, proved.upper], axis=-1)
    inner = np.stack([-proved.inner.lower, proved.inner.upper], axis=-1)
    return outer, inner


def _noted(envelope: Envelope, why: str) -> Envelope:
    """Return the envelope with a text as its first note; the text is logged, too."""
    LOG.info("envelope: %s", why)
    return replace(envelope, notes=(why, *envelope.notes))
