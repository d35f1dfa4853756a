"""Auto: what is best known of an envelope, by the proof that is forecast to be the cheaper one.

1. Up to six fuzzy inputs the branch and bound is a proof, for any number the dual bound is. The one
   with less forecast work comes first, the other where it refuses or leaves a wide gap. The branch
   and bound is first tried on the box as it is, and on parts of it where nothing else remains.
2. A guarantee with a gap of more than a tenth of a peak is not the only answer: the improved
   follower looks for motions that reach more. Where a named tolerance is not proved, it estimates
   the envelope, and proved bounds stand outside it.
3. Without a proof the follower remains, and without derivatives, where columns yield, a search of
   peaks.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import checked_number
from alphacut.base.progress_bar import Progress, subprogress
from alphacut.frame.bounds.box_proof import refusing
from alphacut.frame.bounds.model_error import MAX_PARAMETERS
from alphacut.frame.boxes import DEFAULT_TOLERANCE, UnitFlow
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import LinearFlow, exact_flow
from alphacut.frame.dynamics.yielding import YieldingFlow
from alphacut.frame.envelope import Ends, Envelope
from alphacut.frame.methods.dual import DualProof
from alphacut.frame.methods.improved_follower import ImprovedFollower, PassBounds
from alphacut.frame.methods.proof import Proof
from alphacut.frame.methods.sampled import PeakSearch
from alphacut.frame.numbers import WIDE

LOG = logging.getLogger(__name__)

BOXES = 1000
"""Boxes that a proof may look at for each bound, on average."""
FEW_INPUTS = 4
"""Inputs up to which the dual bound closes the gaps of peaks to the usual tolerance."""
FINEST = 1e-4
"""Gap of peaks, as a fraction of each, below which the dual bound takes too long."""
FOLLOWED = 0.15
"""Fraction of the tolerance that is worth a graph: a follower's error is up to seven times it."""
SHOWN_OF_REST = 0.8
"""Fraction of the progress left that the next method takes; one method is usually enough."""
ROUNDING = 1e-9
"""Fraction of a peak by which a motion that is followed may be off."""


@dataclass(frozen=True)
class Auto:
    """The method and its options.

    Args:
        tolerance: Error wanted, as a fraction of each output's peak or, where the envelope is not
            relative, in m or the unit of the first output; 1e-3 of each peak unless given.
        seed: Of the follower.
        workers: Threads of the proof, which do not change the result; all cores unless given.
        peaks: Whether the error is that of the peaks, and a proof with a wider gap is kept.
        magnitudes: Whether nothing is read off bounds below the peaks, which may be wide then.

    Raises:
        RefusedError: The tolerance is not positive.
    """

    name: ClassVar[str] = "auto"
    tolerance: float | None = None
    seed: int = 0
    workers: int | None = None
    peaks: bool = False
    magnitudes: bool = False

    def __post_init__(self) -> None:
        if self.tolerance is not None:
            checked_number("tolerance", self.tolerance, positive=True)

    @property
    def is_for_all_nodes(self) -> bool:
        """Whether a tolerance holds for all bounds, and not for the peaks alone."""
        return self.tolerance is not None and not self.peaks

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Return the envelope on all levels, by a proof if possible; its first note says why."""
        tolerance = flow.tolerance(self.tolerance)
        if isinstance(flow.flow, YieldingFlow):
            found = PeakSearch().run(flow, progress)
            return _noted(found, f"{PeakSearch.name}: motions of columns that yield have kinks")
        if not isinstance(flow.flow, LinearFlow):
            follower = ImprovedFollower(0.7 * tolerance, seed=self.seed)
            return _noted(follower.run(flow, progress), f"{follower.name}: not linear")
        follower = ImprovedFollower(FOLLOWED * tolerance, seed=self.seed)
        reasons, proved = list[str](), list[Envelope]()
        for attempt, proof in enumerate(self._proofs(flow, reasons)):
            try:
                proved.append(proof.run(flow, _of_attempt(progress, attempt)))
            except UnprovedError as error:
                reasons.append(f"{proof.name}: {error}")
                continue
            if self._is_close(proved[-1], flow):
                return _noted(proved[-1], "; ".join([f"{proof.name} succeeded", *reasons]))
            reasons.append(f"{proof.name}: its gap is wider than the tolerance")
        best = min(proved, key=lambda found: _gap(found, flow), default=None)
        if best is not None and not self.is_for_all_nodes:
            if _gap(best, flow) <= WIDE:
                return _noted(best, "; ".join([f"{best.method} succeeded", *reasons]))
            outer, inner = _sides(best)  # bounds above the reached peak are worth motions
            asked = outer > inner.max(1, keepdims=True)
            followed = follower.run_pass(flow, _of_attempt(progress, len(reasons)), asked)
            return _noted(_with_reached(best, flow, followed), f"{best.method} and {follower.name}")
        found = follower.run(flow, _of_attempt(progress, len(reasons)))
        found = replace(found, outer=best.proved if best else None)
        return _noted(found, f"{follower.name}; unproved: {'; '.join(reasons)}")

    def _proofs(self, flow: UnitFlow, reasons: list[str]) -> list[Proof | DualProof]:
        """Return the proofs to try, in their order; refusals are appended to `reasons`."""
        proof, dual = Proof(None, self.tolerance, BOXES, workers=self.workers), self._dual(flow)
        if len(flow.boxes.names) > MAX_PARAMETERS:
            return [dual]  # which itself refuses what cannot be proved
        works = list[float]()  # that are forecast
        methods = list[Proof | DualProof]()
        for method in (proof, dual):
            try:
                with refusing():
                    works.append(method.forecast(exact_flow(flow.flow), flow.boxes))
                methods.append(method)
            except UnprovedError as error:
                reasons.append(f"{method.name}: {error}")
        if len(methods) < 2:
            return methods
        undivided = replace(proof, parts=1)
        # the branch and bound has the same gap at all nodes
        if self.is_for_all_nodes or works[0] <= works[1]:
            return [undivided, dual, proof]
        return [dual, undivided]

    def _dual(self, flow: UnitFlow) -> DualProof:
        tolerance, inputs = max(self.tolerance or DEFAULT_TOLERANCE, FINEST), len(flow.boxes.names)
        dual = DualProof(workers=self.workers, below=1.0 if self.magnitudes else DualProof.below)
        if self.is_for_all_nodes:  # gaps below the peaks stay wide in any case
            return dual
        if flow.relative and inputs <= (MAX_PARAMETERS if self.tolerance else FEW_INPUTS):
            return replace(dual, gap=tolerance, peaks=tolerance)
        return dual if self.tolerance is None else replace(dual, peaks=WIDE)

    def _is_close(self, proved: Envelope, flow: UnitFlow) -> bool:
        if self.is_for_all_nodes:  # a little more for rounding
            allowed = (1 + 1e-9) * flow.tolerance(self.tolerance) * flow.scale
            return bool((proved.error <= allowed).all())
        is_of_few_inputs = flow.relative and len(flow.boxes.names) <= FEW_INPUTS
        peak_gap = 2 * self.tolerance if self.tolerance and is_of_few_inputs else WIDE
        return _gap(proved, flow) <= peak_gap


def _of_attempt(progress: Progress | None, number: int) -> Progress | None:
    """Return the progress of a method that is tried after `number` others.

    Whether more methods are needed is not known beforehand: each is shown as most of what is left.
    """
    left = 1 - SHOWN_OF_REST
    return progress and subprogress(progress, 1 - left**number, 1 - left ** (number + 1))


def _with_reached(proved: Envelope, flow: UnitFlow, followed: PassBounds) -> Envelope:
    """Return a guaranteed envelope with larger values inside it that graphs reach."""
    values = followed.bounds - ROUNDING * np.abs(followed.bounds).max((0, 1, 3))[:, None]
    outer, inner = _sides(proved)
    better, at = values > inner, np.stack([proved.lower_at, proved.upper_at], -2)
    inner = np.where(better, values, inner)
    at = np.where(better[..., None], flow.boxes.to_physical(followed.points), at)
    combined = replace(
        proved,
        inner=Ends(-inner[..., 0], inner[..., 1]),
        lower_at=at[..., 0, :],
        upper_at=at[..., 1, :],
        error=(outer - inner).max(-1),
    )
    return replace(combined, facts={**combined.facts, "gap_of_peaks": _gap(combined, flow)})


def _sides(proved: Envelope) -> tuple[Array, Array]:
    """Return proved and reached upper bounds of (−output, output), shape (A, T, m, 2) each."""
    assert proved.inner is not None
    outer = np.stack([-proved.lower, proved.upper], -1)
    return outer, np.stack([-proved.inner.lower, proved.inner.upper], -1)


def _gap(proved: Envelope, flow: UnitFlow) -> float:
    """Return the largest gap between proved and reached peak, as a fraction of the peak."""
    outer, inner = (bounds.max(1) for bounds in _sides(proved))  # (A, m, 2)
    peak = np.where(flow.at_rest, flow.peak, outer.max(-1))
    return float(((outer - inner).max(-1) / np.maximum(peak, 1e-300)).max())


def _noted(envelope: Envelope, why: str) -> Envelope:
    """Return the envelope with a text as its first note, which is logged as well."""
    LOG.info("envelope: %s", why)
    return replace(envelope, notes=(why, *envelope.notes))
