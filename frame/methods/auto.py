"""The cheapest method that keeps a wanted error, with the estimate and the reason."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.jet import Array
from alphacut.frame.checks.step_error import source, step_error
from alphacut.frame.envelope import Envelope
from alphacut.frame.methods.batch_graph_follower import BatchFollower
from alphacut.frame.methods.modal import FINE, GapError, Modal, guaranteed
from alphacut.frame.methods.plan import Candidate, candidates
from alphacut.frame.modal.fitting import MANY
from alphacut.frame.structures.modes import ModalError
from alphacut.frame.structures.polynomial_dependence import UnprovedError
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.progress_bar import Progress, Stages, stage

TOLERANCE = 1e-4
"""Wanted error unless one is given, in m."""
SHARE = 1e-3
"""Wanted error where no output is a displacement, as a share of each output's peak."""
GAPS = (0.1, 1.0)
"""Gaps of a proof, as shares of the wanted error, of which the second is tried where the error of
the modes forbids the first.
"""
UNPROVED = "unproved"
"""Name under which the reason is kept why no proof was found."""
CANDIDATES = ("modal", "improved-graph-follower")
AGREED = 0.25
"""Share of the wanted error by which two passes that share no starting points may differ."""
UNSEEN = 2.0
"""Factor on that difference, for what neither has seen."""


class ToleranceError(RuntimeError):
    """No method left reaches the wanted error."""


@dataclass(frozen=True)
class Auto:
    """Envelope whose error, all of it, stays below a tolerance; of linear structures guaranteed.

    Up to six parameters are proved, unless something forbids it, which the fact "unproved" names.
    Modal intervening variables come first, since tens of eigen-analyses cost less than any number
    of trajectories; where their error estimate is too large, the Graph Follower in rounds, made
    stricter until a second pass from other points agrees with it.

    Args:
        tolerance: Wanted envelope error, in units of the first displacement, else of the first
            output; unless given `TOLERANCE`, or where no output is a displacement `SHARE`.
        exclude: Methods that must not be taken, out of `CANDIDATES`.
        budget: Most trajectories of the Graph Follower.
        seconds: Largest estimate of a method that is started.
        seed: Of the searches where nothing is proved.
        workers: Threads of the proof, which is the same for any number; None for all cores.

    Raises:
        ValueError: An excluded name is unknown, or the tolerance is not positive.
    """

    tolerance: float | None = None
    exclude: Sequence[str] = ()
    budget: int = 20000
    seconds: float = 3600.0
    seed: int = 0
    workers: int | None = None

    def __post_init__(self) -> None:
        for name in self.exclude:
            if name not in CANDIDATES:
                raise ValueError(
                    f"exclude: '{name}' is unknown; allowed are {', '.join(CANDIDATES)}"
                )
        if not self.seconds > 0:
            raise ValueError(f"seconds: {self.seconds:g} is not allowed; it must be positive")
        if self.tolerance is not None and not self.tolerance > 0:
            raise ValueError(f"tolerance: {self.tolerance:g} is not allowed; it must be positive")

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Envelope of all outputs on all levels.

        Raises:
            ToleranceError: No method left reaches the tolerance.
        """
        left, (flow, tolerance) = self.left(flow, step_error(flow)), self.wanted(flow)
        progress, begun = progress and Stages(progress), time.perf_counter()
        cure = "allow more methods, a larger budget or tolerance"
        tried, refused = self._tried(flow)
        if "modal" in tried:
            found, why = self._by_modes(flow, left, progress)
            if found is not None and _estimate(found, flow) <= left:
                return _reported(found, flow, begun, why)
            refused.append(why)
            if found is not None and len(flow.boxes.names) > MANY and "bounds" in found.facts:
                tried = []  # the Graph Follower begins from fewer points, at a higher price
                cure = "take fewer or narrower inputs, a larger tolerance, or the method modal,"
                cure += " which gives these bounds with their error"
        if "improved-graph-follower" in tried:
            followed = _followed(flow, left, self.budget, progress, self.seed)
            if followed is not None:
                why = "; ".join(refused) or "the system is not linear"
                return _reported(followed, flow, begun, f"improved-graph-follower, since {why}")
            refused.append(f"improved-graph-follower needs more than {self.budget} trajectories")
        why = f"no method reaches {flow.told(tolerance)} ({'; '.join(refused)})"
        raise ToleranceError(f"auto: {why}; {cure}")

    def left(self, flow: UnitFlow, steps: Array) -> float:
        """What of the tolerance errors of time stepping (T, m) leave.

        Raises:
            ToleranceError: They leave nothing.
        """
        flow, tolerance = self.wanted(flow)
        reached = float((steps / flow.scale).max())
        if reached >= tolerance:
            what, cure = source(flow.flow)
            raise ToleranceError(
                f"auto: the error of {what}, {flow.told(reached)}, is above the tolerance"
                f" {flow.told(tolerance)}; {cure}, or a larger tolerance"
            )
        return tolerance - reached

    def _tried(self, flow: UnitFlow) -> tuple[list[str], list[str]]:
        """Methods that are affordable, and why the others are not begun."""
        plan, refused = self.plan(flow), [f"{name} excluded" for name in self.exclude]
        dear = [candidate for candidate in plan if candidate.seconds > self.seconds]
        refused += [f"{candidate.name} not started: {candidate}" for candidate in dear]
        return [candidate.name for candidate in plan if candidate not in dear], refused

    def _by_modes(
        self, flow: UnitFlow, left: float, progress: Progress | None
    ) -> tuple[Envelope | None, str]:
        """Proved bounds or a search, and why it is taken or does not suffice."""
        try:
            proof, unproved = _proved_once(flow, left, progress, self.workers)
            if proof is not None:
                return proof, "modal: polynomials of the modes, whose bounds are proved"
            stage(progress, f"search (unproved: {unproved})")
            found = Modal(tolerance=left / FINE, seed=self.seed).run(flow, progress)
        except ModalError as error:
            return None, str(error)
        found = replace(found, facts={**found.facts, "unproved": unproved})
        missed = _estimate(found, flow) > left
        return found, f"modal estimates {flow.told(_estimate(found, flow))}" * missed or _why(found)

    def plan(self, flow: UnitFlow) -> tuple[Candidate, ...]:
        """What would be tried, one after the other, with the seconds expected."""
        found = candidates(flow, self.budget)
        return tuple(candidate for candidate in found if candidate.name not in self.exclude)

    def wanted(self, flow: UnitFlow) -> tuple[UnitFlow, float]:
        """The flow with the scale of the tolerance, and the tolerance."""
        if self.tolerance is not None:
            return flow, self.tolerance
        if flow.relative or any(Output(name).unit == "m" for name in flow.outputs):
            return flow, TOLERANCE
        return replace(flow, relative=True), SHARE


def _proved_once(
    flow: UnitFlow, wanted: float, progress: Progress | None, workers: int | None
) -> tuple[Envelope | None, str]:
    """As `_proved`; a reason that was found before the same call was stopped is not sought anew."""
    old = flow.kept.load(UNPROVED) if flow.kept is not None else None
    if old is not None:
        return None, str(old["reason"])
    found, reason = _proved(flow, wanted, progress, workers)
    if found is None and flow.kept is not None:
        flow.kept.save(UNPROVED, {"reason": np.array(reason)})
    return found, reason


def _proved(
    flow: UnitFlow, wanted: float, progress: Progress | None, workers: int | None
) -> tuple[Envelope | None, str]:
    """A guaranteed envelope within the wanted error, or None and the reason why there is none."""
    reason = ""
    for share in GAPS:
        stage(progress, f"proof up to {flow.told(share * wanted)}")
        try:
            found = guaranteed(flow, share * wanted, progress, workers)
        except GapError as error:
            reason = str(error)
            continue
        except UnprovedError as error:
            return None, str(error)
        reached = _estimate(found, flow)
        if reached <= wanted:
            return found, ""
        left = f"the boxes that a proof may look at left a gap of {flow.told(reached)}"
        return None, f"{left}; envelope.certify allows more, fewer or narrower inputs need fewer"
    return None, reason


def _followed(
    flow: UnitFlow, tolerance: float, budget: int, progress: Progress | None, seed: int
) -> Envelope | None:
    """The Graph Follower, begun with more points until one that shares none with it agrees."""
    spread, strict, used = 256, tolerance / 4, 0
    for attempt in range(4):
        method = BatchFollower(strict, budget, spread, contests=3, seed=seed + 2 * attempt)
        stage(progress, f"Graph Follower, pass {2 * attempt + 1}")
        first = method.run(flow, progress)
        used += first.trajectories
        if "reason" in first.facts:
            return None
        stage(progress, f"Graph Follower, pass {2 * attempt + 2}")
        second = replace(method, seed=method.seed + 1).run(flow, progress)
        used += second.trajectories
        apart = distance(first, second, flow)
        if apart <= AGREED * tolerance and "reason" not in second.facts:
            error = np.full_like(first.lower, 1.0) * flow.scale * (strict + UNSEEN * apart)
            facts = {**first.facts, "second_pass": apart}
            return replace(outer(first, second), trajectories=used, error=error, facts=facts)
        spread, strict = 4 * spread, strict / 2
    return None


def distance(first: Envelope, second: Envelope, flow: UnitFlow) -> float:
    """Largest distance of the bounds of two envelopes, in units of the tolerance."""
    off = np.maximum(np.abs(first.lower - second.lower), np.abs(first.upper - second.upper))
    return float((off / flow.scale).max())


def outer(first: Envelope, second: Envelope) -> Envelope:
    """The first envelope with the bounds of the second where these lie further out."""
    below, above = second.lower < first.lower, second.upper > first.upper
    return replace(
        first,
        lower=np.where(below, second.lower, first.lower),
        upper=np.where(above, second.upper, first.upper),
        lower_at=np.where(below[..., None], second.lower_at, first.lower_at),
        upper_at=np.where(above[..., None], second.upper_at, first.upper_at),
    )


def _why(found: Envelope) -> str:
    """The reason for modal intervening variables."""
    if "bounds" in found.facts:
        return "modal: polynomials of the modes lead exact trajectories to the tolerance"
    return "modal: polynomials of the modes reach the tolerance with the fewest eigen-analyses"


def _estimate(found: Envelope, flow: UnitFlow) -> float:
    assert found.error is not None
    return float((found.error / flow.scale).max())


def _reported(found: Envelope, flow: UnitFlow, begun: float, reason: str) -> Envelope:
    facts = {**found.facts, "estimated_error": _estimate(found, flow), "reason": reason}
    return replace(found, facts=facts, seconds=time.perf_counter() - begun)
