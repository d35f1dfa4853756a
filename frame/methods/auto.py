"""Auto: the proof; where there is none, the search; where there is none either, the follower.

With more than six fuzzy inputs the proof is the dual bound, whose gap is what it states.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

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
from alphacut.fuzzy.progress_bar import Progress, stage
from alphacut.fuzzy.refused import RefusedError

BOXES = 1000
"""Boxes that a proof may look at for each bound, on average."""


@dataclass(frozen=True)
class Auto:
    """The method and its options.

    Args:
        tolerance: Error wanted, in m, or in the unit of the first output where none is a
            displacement; 1e-4 unless given.
        seed: Of the search and the follower.
        workers: Threads of the proof; all cores unless given.

    Raises:
        RefusedError: The tolerance is not positive.
    """

    name: ClassVar[str] = "auto"
    tolerance: float | None = None
    seed: int = 0
    workers: int | None = None

    def __post_init__(self) -> None:
        if self.tolerance is not None and not self.tolerance > 0:
            raise RefusedError("tolerance", self.tolerance, "a positive number")

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Envelope of all outputs on all levels, whose first note says why its method was taken."""
        follower = ImprovedFollower(0.7 * flow.tolerance(self.tolerance), seed=self.seed)
        if not isinstance(flow.flow, LinearFlow):
            return _noted(follower.run(flow, progress), "improved-graph-follower: not linear")
        stage(progress, "proof")
        many = len(flow.boxes.names) > MOST_PARAMETERS
        proof: Proof | DualProof = DualProof(workers=self.workers)
        if not many:
            proof = Proof(tolerance=self.tolerance, boxes=BOXES, workers=self.workers)
        try:
            why = "dual: many inputs" if many else "proof: the structure is linear"
            return _noted(proof.run(flow, progress), why)
        except (UnprovedError, ModalError) as error:
            why = f"unproved: {error}"
        stage(progress, f"search ({why})")
        try:
            search = Search(self.tolerance, seed=self.seed)
            return _noted(search.run(flow, progress), f"search; {why}")
        except ModalError as error:
            why = f"{why}; no search: {error}"
        return _noted(follower.run(flow, progress), f"improved-graph-follower; {why}")


def _noted(envelope: Envelope, why: str) -> Envelope:
    return replace(envelope, notes=(why, *envelope.notes))
