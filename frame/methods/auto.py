"""Auto: what is best known of an envelope, by the proof that is forecast to be the cheaper one.

1. Up to six fuzzy inputs the branch and bound is a proof, for any number the dual bound is. The one
   with less forecast work comes first, the other where it refuses or leaves a wide gap. The branch
   and bound is first tried on the box as it is, and on parts of it where nothing else is left.
2. A guarantee with a gap of more than a tenth of a peak is not the only answer: at the nodes that
   may hold the peak a search looks for motions that attain more. Where a named tolerance is not
   proved, the search estimates the envelope, and proved bounds stand outside it.
3. Without a proof the search remains; where there are no oscillating modes, the follower.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from alphacut.frame.bounds.box_proof import refusing
from alphacut.frame.bounds.remainder import MOST_PARAMETERS
from alphacut.frame.boxes import DEFAULT_TOLERANCE, UnitFlow
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import LinearFlow, exact_flow
from alphacut.frame.envelope import Ends, Envelope
from alphacut.frame.methods.dual import DualProof
from alphacut.frame.methods.improved_follower import ImprovedFollower
from alphacut.frame.methods.proof import Proof
from alphacut.frame.methods.search import Search
from alphacut.frame.numbers import WIDE
from alphacut.frame.structures.modes import ModalError
from alphacut.fuzzy.arrays import Array, Rows
from alphacut.fuzzy.progress_bar import Progress
from alphacut.fuzzy.refused import checked_number

LOG = logging.getLogger(__name__)

BOXES = 1000
"""Boxes that a proof may look at for each bound, on average."""
FEW_INPUTS = 4
"""Inputs up to which the dual bound closes the gaps of peaks to the usual tolerance."""
FINEST = 1e-4
"""Gap of peaks, as a share of each, below which the dual bound takes too long."""
ROUNDING = 1e-9
"""Share of a peak by which a searched motion may be off."""


@dataclass(frozen=True)
class Auto:
    """The method and its options.

    Args:
        tolerance: Error wanted, as a share of each output's peak or, where the envelope is not
            relative, in m or the unit of the first output; 1e-3 of each peak unless given.
        seed: Of the search and the follower.
        workers: Threads of the proof, which do not change the result; all cores unless given.
        peaks: Whether the error is that of the peaks, and a proof with a wider gap is kept.
        magnitudes: Whether nothing is read off bounds below the peaks, which may be wide then.

    Raises:
        RefusedError: The tolerance is not positive.

    Example:
        >>> from alphacut.frame import StoreyFrame, envelope
        >>> from alphacut.fuzzy import Triangular
        >>> frame = StoreyFrame(masses=[1e3], stiffness=[4e4], q0=[0.1])
        >>> inputs = {"m1": Triangular(900, 1000, 1100)}
        >>> str(envelope(frame, inputs, Auto(), duration=0.5, step=0.1).nature)
        'guaranteed'
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

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Return the envelope on all levels, by a proof if possible; its first note says why.

        Where the gap is too wide, a search attains larger values inside the proved bounds, or
        estimates the envelope; without oscillating modes the follower does.
        """
        follower = ImprovedFollower(0.7 * flow.tolerance(self.tolerance), seed=self.seed)
        if not isinstance(flow.flow, LinearFlow):
            return _noted(follower.run(flow, progress), "improved-graph-follower: not linear")
        reasons: list[str] = []
        proved: Envelope | None = None
        for proof in self._proofs(flow, reasons):
            try:
                found = proof.run(flow, progress)
            except (UnprovedError, ModalError) as error:
                reasons.append(f"{proof.name}: {error}")
                continue
            proved = found if proved is None or _gap(found, flow) < _gap(proved, flow) else proved
            if self._is_close(found, flow):
                return _noted(found, "; ".join([f"{proof.name} succeeded", *reasons]))
            reasons.append(f"{proof.name}: its gap is wider than the tolerance")
        # a tolerance that holds for all bounds, not for the peaks alone
        needs_tolerance = self.tolerance is not None and not self.peaks
        if proved is not None and not needs_tolerance and _gap(proved, flow) <= WIDE:
            return _noted(proved, "; ".join([f"{proved.method} succeeded", *reasons]))
        search = Search(self.tolerance, seed=self.seed)
        try:
            if proved is not None and not needs_tolerance:
                nodes = _possible_peaks(proved)
                searched = search.attained(flow, nodes, progress)
                return _noted(
                    with_attained(proved, flow, nodes, *searched), f"{proved.method} and search"
                )
            estimate = search.run(flow, progress)
        except ModalError as error:
            reasons.append(f"no search: {error}")
            if proved is None:
                why = f"improved-graph-follower; unproved: {'; '.join(reasons)}"
                return _noted(follower.run(flow, progress), why)
            return _noted(proved, "; ".join([f"{proved.method} succeeded", *reasons]))
        outer = None if proved is None else proved.proved
        why = f"search; unproved: {'; '.join(reasons)}"
        return _noted(replace(estimate, outer=outer), why)

    def _proofs(self, flow: UnitFlow, reasons: list[str]) -> Iterator[Proof | DualProof]:
        """Yield the proofs to try, by rising forecast work; refusals are appended to `reasons`.

        Branch and bound (`Proof`) comes first if a tolerance holds at all nodes, not only at peaks.
        If the dual bound can be tried, too, branch and bound is tried on the undivided box, and if
        it was the first, again with the box in parts at the end.
        """
        tolerance, inputs = self.tolerance or DEFAULT_TOLERANCE, len(flow.boxes.names)
        proof = Proof(None, self.tolerance, BOXES, workers=self.workers)
        dual = DualProof(workers=self.workers)
        if self.magnitudes:  # nothing is read off bounds below the peaks
            dual = replace(dual, below=1.0)
        if self.tolerance and not self.peaks:
            pass  # the dual bound leaves wide gaps below the peaks in any case
        elif flow.relative and inputs <= (MOST_PARAMETERS if self.tolerance else FEW_INPUTS):
            dual = replace(dual, gap=max(tolerance, FINEST), peaks=max(tolerance, FINEST))
        elif self.tolerance:
            dual = replace(dual, peaks=WIDE)
        works = list[tuple[float, Proof | DualProof]]()  # forecast work of each method
        for method in (proof, dual) if inputs <= MOST_PARAMETERS else (dual,):
            try:
                with refusing():
                    works.append((method.forecast(exact_flow(flow.flow), flow.boxes), method))
            except UnprovedError as error:
                reasons.append(f"{method.name}: {error}")
        if self.tolerance and not self.peaks and len(works) == 2:
            works = [(0.0, proof), works[1]]  # first, since it has the same gap at all nodes
        works.sort(key=lambda pair: pair[0])
        methods = [method for _, method in works]
        without_parts = replace(proof, parts=1)
        for method in methods:
            yield without_parts if method is proof and len(methods) == 2 else method
        if len(methods) == 2 and methods[0] is proof:
            yield proof

    def _is_close(self, proved: Envelope, flow: UnitFlow) -> bool:
        """Return whether the gap of a proof is as narrow as asked for.

        A tolerance for all bounds must be met by all. Else the gap at the peaks counts: at most
        twice a tolerance that is meant for peaks and for few inputs, or `WIDE`.
        """
        if self.tolerance is not None and not self.peaks:
            return bool((proved.error <= self._allowed(flow)).all())
        if self.tolerance is not None and flow.relative and len(flow.boxes.names) <= FEW_INPUTS:
            return _gap(proved, flow) <= 2 * self.tolerance
        return _gap(proved, flow) <= WIDE

    def _allowed(self, flow: UnitFlow) -> Array:
        """Error allowed of each output, shape (m,), in its unit; a little more for rounding."""
        return (1 + 1e-9) * flow.tolerance(self.tolerance) * flow.scale


def with_attained(
    proved: Envelope, flow: UnitFlow, nodes: Rows, values: Array, at: Array
) -> Envelope:
    """Return a guaranteed envelope with larger attained values inside it.

    Args:
        proved: The guaranteed envelope.
        flow: The motion and its boxes.
        nodes: Nodes with attained values, shape (J,).
        values: Attained values of (−output, output), shape (A, J, m, 2).
        at: Unit coordinates that attain them, shape (A, J, m, 2, d).

    Returns:
        The envelope with tighter inner bounds and errors, and a note on both peaks.
    """
    assert proved.inner is not None
    physical = flow.boxes.to_physical(at)
    values = values - ROUNDING * np.abs(values).max((0, 1, 3))[:, None]
    ends, inputs = [], []  # lower ones, then upper ones
    for index, (sign, name) in enumerate(((-1, "lower"), (1, "upper"))):
        inner, inputs_at = getattr(proved.inner, name).copy(), getattr(proved, f"{name}_at").copy()
        better = values[..., index] > sign * inner[:, nodes]
        inner[:, nodes] = np.where(better, sign * values[..., index], inner[:, nodes])
        better_inputs = physical[..., index, :]
        inputs_at[:, nodes] = np.where(better[..., None], better_inputs, inputs_at[:, nodes])
        ends.append(inner)
        inputs.append(inputs_at)
    combined = replace(
        proved,
        inner=Ends(*ends),
        lower_at=inputs[0],
        upper_at=inputs[1],
        error=np.maximum(proved.upper - ends[1], ends[0] - proved.lower),
    )
    facts = {**combined.facts, "gap_of_peaks": _gap(combined, flow)}
    return replace(combined, facts=facts, notes=(combined.peak_words, *combined.notes))


def _possible_peaks(proved: Envelope) -> Rows:
    """Return the nodes at which a proved bound lies above the attained peak, shape (J,)."""
    assert proved.inner is not None
    ends = ((proved.upper, proved.inner.upper), (-proved.lower, -proved.inner.lower))
    above = [outer > inner.max(1, keepdims=True) for outer, inner in ends]
    return np.flatnonzero(np.logical_or(*above).any((0, 2)))


def _gap(proved: Envelope, flow: UnitFlow) -> float:
    """Return the largest gap between proved and attained peak, as a fraction of the peak."""
    assert proved.inner is not None
    ends = ((proved.upper, proved.inner.upper), (-proved.lower, -proved.inner.lower))
    peak = np.maximum(*(outer.max(1) for outer, _ in ends))  # (A, m), as of the gaps
    peak = np.where(flow.at_rest, flow.peak, peak)
    gaps = [outer.max(1) - inner.max(1) for outer, inner in ends]
    return float((np.maximum(*gaps) / np.maximum(peak, 1e-300)).max())


def _noted(envelope: Envelope, why: str) -> Envelope:
    """Return the envelope with a text as its first note, which is logged as well."""
    LOG.info("envelope: %s", why)
    return replace(envelope, notes=(why, *envelope.notes))
