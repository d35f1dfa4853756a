"""Auto: a proof; where there is none, the search; where there is none either, the follower.

Up to six fuzzy inputs the branch and bound is tried, up to three or four if no tolerance is named
or only the peaks are to keep it. The dual bound follows, which takes any number of inputs and
states its gap. A gap above a named tolerance leads to the search, but not of the peaks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.certificate.remainder import MOST_PARAMETERS
from alphacut.frame.dual.proof import DualProof
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.envelope import Envelope
from alphacut.frame.methods.improved_follower import ImprovedFollower
from alphacut.frame.methods.proof import Proof
from alphacut.frame.methods.search import Search
from alphacut.frame.structures.modes import ModalError
from alphacut.frame.structures.polynomial_dependence import UnprovedError
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.progress_bar import Progress
from alphacut.fuzzy.refused import real

BOXES = 1000
"""Boxes that a proof may look at for each bound, on average."""
FEW = 4
"""Inputs up to which the branch and bound is worth its time where peaks count most."""
BRANCHED = 1e-4, 5e-3
"""Gaps of peaks, from one to below the other, with which it is so; else up to one input less
(`benchmarks.frame.many_inputs --few`)."""

WIDE = 0.1
"""Gap of a peak with many inputs up to which the box is not parted where envelopes are many."""


@dataclass(frozen=True)
class Auto:
    """The method and its options.

    Args:
        tolerance: Error wanted, in m, or in the unit of the first output where none is a
            displacement; 1e-4 unless given.
        seed: Of the search and the follower.
        workers: Threads of the proof; all cores unless given.
        peaks: Whether the error is that of the peaks, and a proof with a wider gap is kept.

    Raises:
        RefusedError: The tolerance is not positive.
    """

    name: ClassVar[str] = "auto"
    tolerance: float | None = None
    seed: int = 0
    workers: int | None = None
    peaks: bool = False

    def __post_init__(self) -> None:
        if self.tolerance is not None:
            real("tolerance", self.tolerance, positive=True)

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Envelope of all outputs on all levels, whose first note says why its method was taken."""
        follower = ImprovedFollower(0.7 * flow.tolerance(self.tolerance), seed=self.seed)
        if not isinstance(flow.flow, LinearFlow):
            return _noted(follower.run(flow, progress), "improved-graph-follower: not linear")
        reasons: list[str] = []
        held: Envelope | None = None
        named = None if self.peaks else self.tolerance
        for proof in self._proofs(flow):
            try:
                proved = proof.run(flow, progress)
            except (UnprovedError, ModalError) as error:
                reasons.append(f"{proof.name}: {error}")
                continue
            held = proved if held is None or _gap(proved) < _gap(held) else held
            if self._close(proved, flow):
                return _noted(proved, "; ".join([f"{proof.name} succeeded", *reasons]))
            reasons.append(f"{proof.name}: its gap is wider than the tolerance")
        if held is not None and named is None:
            return _noted(held, "; ".join([f"{held.method} succeeded", *reasons]))
        why = f"unproved: {'; '.join(reasons)}"
        try:
            search = Search(self.tolerance, seed=self.seed)
            return _noted(search.run(flow, progress), f"search; {why}")
        except ModalError as error:
            why = f"{why}; no search: {error}"
        return _noted(follower.run(flow, progress), f"improved-graph-follower; {why}")

    def _proofs(self, flow: UnitFlow) -> tuple[Proof | DualProof, ...]:
        """Proofs to try, in order; the branch and bound where it is the cheaper one."""
        inputs, dual = len(flow.boxes.names), DualProof(workers=self.workers)
        proof = Proof(tolerance=self.tolerance, boxes=BOXES, workers=self.workers)
        share, few = self.tolerance or 0.0, FEW
        if share and not self.peaks:
            few = MOST_PARAMETERS
        elif share and inputs > MOST_PARAMETERS:
            dual = replace(dual, peaks=WIDE)
        elif share and flow.relative:
            dual = replace(dual, gap=share, peaks=share)
            few = FEW if BRANCHED[0] <= share < BRANCHED[1] else FEW - 1
        both = (proof, dual) if inputs <= few else (dual, proof)
        return both if inputs <= max(few, FEW) else (dual,)

    def _close(self, proved: Envelope, flow: UnitFlow) -> bool:
        """True where a gap is as narrow as asked, and of peaks with many inputs."""
        if self.tolerance is None:
            return True
        if not self.peaks:
            return bool((proved.error <= self._allowed(flow)).all())
        few = flow.relative and len(flow.boxes.names) <= FEW
        return not few or _gap(proved) <= 2 * self.tolerance

    def _allowed(self, flow: UnitFlow) -> Array:
        """Error allowed of each output, shape (m,), in its unit; a little more for rounding."""
        return (1 + 1e-9) * flow.tolerance(self.tolerance) * flow.scale


def _gap(proved: Envelope) -> float:
    """Greatest gap of a peak, as a share of it."""
    assert proved.inner is not None
    ends = ((proved.upper, proved.inner.upper), (-proved.lower, -proved.inner.lower))
    most = np.maximum(*(outer.max(1) for outer, _ in ends))
    gaps = [outer.max(1) - inner.max(1) for outer, inner in ends]
    return float((np.maximum(*gaps) / np.maximum(most, 1e-300)).max())


def _noted(envelope: Envelope, why: str) -> Envelope:
    return replace(envelope, notes=(why, *envelope.notes))
