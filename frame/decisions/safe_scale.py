"""Largest scaling of tolerances for which a storey frame provably keeps its limits over time.

A search finds the least scaled box that holds a motion beyond a limit, confirmed by the exact
propagator. A branch and bound on the polynomials of the modes then proves a box a little smaller,
node by node, with the error of the polynomials on the safe side. Nodes that resist are proved at a
smaller scale alone, since a box holds the smaller ones.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.decisions.limit_search import LEAST, TIE, LimitSearch, Reach, Unproved, unproved
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.structures.storey import StoreyFrame
from alphacut.fuzzy.progress_bar import Progress, Stages, stage, told
from alphacut.fuzzy.sets.given import finite_by_name, positive

GAP = 1e-3
"""Share of the limits that the model of the motion and the proof may take, at most."""
FINE = 0.01
"""The same as a share of what the nominal motion leaves of the limits."""
EASY = (1.0, 0.3)
"""The same as shares of that, tried first: they serve where the largest box is far from limits."""
SHRINK = (0.004, 0.008, 0.015, 0.03, 0.06, 0.12, 0.25, 0.5, 0.75)
"""By how much the box to be proved is smaller than the refuted one, until all is proved."""
CLOSE = (0.1,)
"""The same between a scale that is proved and one that is not."""
LOOSE, HALVINGS = 0.9, 4
"""Share of the unproved scale below which a greater one is looked for, and in how many steps."""
HALVED = 0.5 ** np.arange(6)
"""Shares of the largest box that are tried while neither a proof nor a broken limit is found."""


@dataclass(frozen=True, eq=False)
class SafeScale:
    """Scaling of tolerances that keeps all limits.

    Args:
        names: Parameters, d of them.
        nominal: Their nominal values, shape (d,), in SI units.
        safe: Largest scale proved safe, 0 where the nominal motion reaches a limit; None where it
            exceeds one.
        lower: Lower ends of the safe box, shape (d,).
        upper: Upper ends.
        unsafe: Scale of the least box that holds the witness; infinite without one.
        witness: Parameters whose motion breaks a limit, shape (d,), or None.
        share: Largest |output| / limit of the witness.
        nominal_share: The same at the nominal values.
        nature: "guaranteed", or "verified by sampling" where the model's error is only sampled.
        reason: Why the error is not proved; empty where it is.
        boxes: Boxes of parameters that the proof looked at.
        seconds: Wall time.
    """

    names: tuple[str, ...]
    nominal: Array
    safe: float | None
    lower: Array
    upper: Array
    unsafe: float
    witness: Array | None
    share: float
    nominal_share: float
    nature: str
    reason: str
    boxes: int
    seconds: float

    @property
    def gap(self) -> float:
        """Distance of the witness beyond the safe scale, as a share of it; infinite without one."""
        return self.unsafe / self.safe - 1 if self.safe else float("inf")


def safe_scale(
    frame: StoreyFrame,
    nominal: Mapping[str, float],
    reach: Reach,
    limits: Mapping[str, float],
    *,
    duration: float,
    step: float,
    most: float = 2.0,
    precision: float = 1e-3,
    budget: float = 100,
    workers: int = 1,
    progress: Progress | bool | None = None,
    failed: Unproved | None = None,
) -> SafeScale:
    """Largest scale of a family of boxes in which every |output| stays at most at its limit.

    Args:
        frame: The structure with its ground motion and initial state.
        nominal: Nominal values of the uncertain parameters by name, in SI units.
        reach: Lower and upper ends (d,) of the box of a scale, in SI units: nested, growing from
            the nominal values at scale 0. `scaled` gives the usual one.
        limits: Largest magnitude allowed by output, in SI units, at the nodes of the step.
        duration: Length of the motion, in s.
        step: Distance of nodes, in s.
        most: Largest scale that is asked for.
        precision: Relative precision of the refuted scale.
        budget: Most boxes per node on average at each scale that is tried.
        workers: Processes of the proof.
        progress: As for `envelope`.
        failed: Boxes that other limits were not proved on, which saves trying again; is added to.

    Raises:
        ValueError: A limit is not positive, or the largest box reaches values without a meaning.
        ModalError: The structure has no smooth oscillating modes over the box.
    """
    _require(limits, most)
    begun, names = time.perf_counter(), tuple(nominal)
    search = limit_search(frame, nominal, reach, limits, duration, step, failed)
    centre = search.nominal
    nominal_share = search.share(centre)
    if search.exceeded(centre):
        seconds = time.perf_counter() - begun
        box, shares = (centre, centre), (nominal_share, nominal_share)
        worth = ("guaranteed", "")
        return SafeScale(names, centre, None, *box, 0.0, centre, *shares, *worth, 0, seconds)
    with told(progress) as whole:
        tell = whole and Stages(whole)
        if nominal_share > 1 - TIE:  # nothing is left for a proof
            search.gap = GAP
            safe, reason, boxes, (unsafe, witness) = 0.0, "", 0, _refuted(search, most, precision)
        else:
            left = 1 - nominal_share
            told_of = _scales(search, left, most, precision, budget, workers, tell)
            safe, reason, boxes, (unsafe, witness) = told_of
    share = 0.0 if witness is None else search.share(witness)
    worth = ("verified by sampling" if reason else "guaranteed", reason)
    seconds = time.perf_counter() - begun
    box, shares = reach(safe), (share, nominal_share)
    return SafeScale(names, centre, safe, *box, unsafe, witness, *shares, *worth, boxes, seconds)


def _scales(
    search: LimitSearch,
    left: float,
    most: float,
    precision: float,
    budget: float,
    workers: int,
    tell: Progress | None,
) -> tuple[float, str, int, tuple[float, Array | None]]:
    """The safe scale, why it is only sampled, boxes, and the refuted scale with its witness."""
    boxes = 0
    for size in most * HALVED:
        stage(tell, f"scales up to {size:.3g}")
        unsafe, witness = np.inf, None
        done, looked = _easily(search, left, size, budget, workers)
        boxes, safe = boxes + looked, size if done else 0.0
        if done:
            break
        search.gap = min(GAP, FINE * left)
        refuted = _refuted(search, size, precision)
        safe, unsafe, witness, looked = _proved(search, refuted, size, budget, workers, tell)
        boxes += looked
        if safe or witness is not None:
            break
    reason = search.reason
    low, high = 0.0 if reason else safe, min(unsafe, 2 * size, most)
    if low < LOOSE * high:
        stage(tell, "scales between a proof and a broken limit")
        low, broken, looked = _closer(search, left, low, high, budget, workers)
        boxes += looked
        safe, reason = (low, "") if low else (safe, reason)
        unsafe, witness = broken or (unsafe, witness)
    return safe, reason, boxes, (unsafe, witness)


def _require(limits: Mapping[str, float], most: float) -> None:
    for name, limit in finite_by_name("limits", limits, "{'q1': 0.1}").items():
        positive(f"limits: that of {name}", limit)
    positive("most, the largest scale,", most)


def _closer(
    search: LimitSearch, left: float, low: float, high: float, budget: float, workers: int
) -> tuple[float, tuple[float, Array] | None, int]:
    """A greater scale proved between two, by halving; a broken one with its witness; boxes."""
    boxes, broken = 0, None
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        done, looked = _easily(search, left, middle, budget, workers, CLOSE)
        boxes += looked
        low, high = (middle, high) if done else (low, middle)
        of_middle = search.size == middle and not (done or search.reason)
        if of_middle and (found := search.witness(middle)) is not None:
            high = search.size_of(found)
            broken = high, found
    return low, broken, boxes


def _easily(
    search: LimitSearch,
    left: float,
    most: float,
    budget: float,
    workers: int,
    gaps: Sequence[float] = EASY,
) -> tuple[bool, int]:
    """Whether a rough model, cheaper to bound, proves the largest box, and boxes looked at."""
    pending: Array = np.arange(2 * len(search.flow.time) * len(search.flow.outputs))
    boxes = 0
    for search.gap in (share * left for share in gaps):
        if search.hopeless(most):
            break
        search.fit(most)
        if search.reason or search.witness(most) is not None:
            break
        pending, _, looked = unproved(search, most, pending, budget, workers)
        boxes += looked
        if not len(pending):
            return True, boxes
    return False, boxes


def _refuted(search: LimitSearch, most: float, precision: float) -> tuple[float, Array | None]:
    """Least scale that is refuted, and its witness, with a model fitted to about that scale."""
    search.fit(most)
    unsafe, witness = search.refuted(precision)
    if LEAST * most < unsafe < 0.9 * most:
        search.fit(unsafe)
    return unsafe, witness


def _proved(
    search: LimitSearch,
    refuted: tuple[float, Array | None],
    most: float,
    budget: float,
    workers: int,
    progress: Progress | None,
) -> tuple[float, float, Array | None, int]:
    """Scale proved safe, the refuted scale and its witness, smaller where met, and boxes."""
    unsafe, witness = refuted
    pending: Array = np.arange(2 * len(search.flow.time) * len(search.flow.outputs))
    shrinks, boxes = (0.0, *SHRINK) if witness is None else SHRINK, 0
    for done, shrink in enumerate(shrinks if unsafe > LEAST * most else ()):
        size = (1 - shrink) * min(unsafe, most)
        pending, beyond, looked = unproved(search, size, pending, budget, workers)
        boxes += looked
        if progress:
            progress((1 + done) / (1 + len(SHRINK)))
        if beyond is not None and (found := search.size_of(beyond)) < unsafe:
            unsafe, witness = found, beyond
        if not len(pending):
            return size, unsafe, witness, boxes
    return 0.0, unsafe, witness, boxes


def limit_search(
    frame: StoreyFrame,
    nominal: Mapping[str, float],
    reach: Reach,
    limits: Mapping[str, float],
    duration: float,
    step: float,
    failed: Unproved | None = None,
) -> LimitSearch:
    """The exact motion of the limited outputs, and the boxes, as for `safe_scale`."""
    limited = replace(frame, outputs=tuple(limits))
    flow = LinearFlow(limited, tuple(nominal), duration, step, Exact())
    sizes, centre = np.array([*limits.values()], float), np.array([*nominal.values()], float)
    return LimitSearch(flow, reach, sizes, centre, GAP, [] if failed is None else failed)


def scaled(nominal: Array, below: Array, above: Array) -> Reach:
    """Boxes nominal − scale · below … nominal + scale · above, all of shape (d,)."""
    return lambda size: (nominal - size * below, nominal + size * above)
