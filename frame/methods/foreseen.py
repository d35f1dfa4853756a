"""Seconds of proofs, by those that they take on some of the nodes."""

from __future__ import annotations

import time
from dataclasses import replace

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.threads import threads
from alphacut.frame.certificate.certificate import certify
from alphacut.frame.certificate.remainder import MOST_PARAMETERS
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.methods import modal
from alphacut.frame.methods.auto import GAPS, Auto
from alphacut.frame.methods.judged import sample
from alphacut.frame.methods.plan import Candidate, planned
from alphacut.frame.modal.fitting import MANY
from alphacut.frame.structures.modes import ModalError

NODES = 40  # on which a proof is timed
DENSE = 0.6  # cost of a node among all beside that among so few, which share less


def foreseen(name: str, method: object, flow: UnitFlow) -> tuple[Candidate, ...]:
    """What a method would do as `planned`, its proof timed on some nodes, its judges counted."""
    found = planned(name, method, flow)
    if name.endswith("graph-follower") and not isinstance(flow.flow, LinearFlow):
        runs = len(sample(len(flow.boxes.names), 0)) * len(flow.boxes.alpha)
        return (replace(found[0], words=f"{found[0].words}, and {runs} without that judge them"),)
    if not isinstance(flow.flow, LinearFlow) or found[0].name != "modal":
        return found
    if len(flow.boxes.names) > min(MANY, MOST_PARAMETERS):
        return found
    first = found[0]
    try:
        if isinstance(method, Auto):
            first = _by_auto(first, *method.wanted(flow))
        elif isinstance(method, modal.Modal) and method.certify is not None:
            seconds, worth = _proof(flow, method, method.certify, patient=True)
            first = replace(first, seconds=seconds, words=f"{first.words}; {worth}")
    except ModalError:
        return found
    return (first, *found[1:])


def _by_auto(first: Candidate, flow: UnitFlow, wanted: float) -> Candidate:
    """What auto takes: the proof, and the search where none is found."""
    size, spent, worth = 2 * len(flow.outputs) * len(flow.time), 0.0, ""
    for share in GAPS:
        method = modal.Modal(boxes=min(modal.BOXES, modal.MOST_BOXES / size), workers=threads())
        seconds, worth = _proof(flow, method, share * wanted, patient=False)
        spent += seconds
        if worth == PROVED:
            return replace(first, seconds=spent, words=f"{first.words}; {worth}")
        if not worth.startswith(modal.TOO_WIDE):
            break
    parts = [float(f"{x:.1g}") for x in (spent, first.seconds)]
    words = (
        f"{first.words}: some {parts[0]:g} s for a proof that is expected to fail and {parts[1]:g}"
        " s for a search then; certify with a gap wider than the tolerance, as 2 mm, may be proved"
        " sooner"
    )
    return replace(first, seconds=spent + first.seconds, words=words)


PROVED = "a proof is expected"


def _proof(flow: UnitFlow, way: modal.Modal, gap: float, *, patient: bool) -> tuple[float, str]:
    """Seconds of a proof, and `PROVED` or why none is expected."""
    thin, factor = _thinned(flow)
    assert isinstance(thin.flow, LinearFlow)
    begun = time.perf_counter()
    model, error, unproved = modal.model_with_error(thin.flow, thin, way, gap, patient=patient)
    fixed = time.perf_counter() - begun
    if unproved and not patient:
        return fixed, unproved
    begun = time.perf_counter()
    proof = certify(
        model, gap=gap, model_error=error, scale=thin.scale, workers=way.workers, budget=way.boxes
    )
    seconds = fixed + factor * (time.perf_counter() - begun)
    ended = f"the boxes allowed are expected to leave a gap of {flow.told(proof.gap)}"
    most = gap if patient else gap / GAPS[0]
    return seconds, unproved or (PROVED if proof.gap <= most else ended)


def _thinned(flow: UnitFlow) -> tuple[UnitFlow, float]:
    """The flow at `NODES` of its nodes, and by how much more all of them cost."""
    assert isinstance(flow.flow, LinearFlow)
    every = max(1, len(flow.time) // NODES)
    step, count = every * flow.flow.step, (len(flow.time) - 1) // every
    coarse = replace(flow.flow, step=step, duration=count * step)
    thin = replace(flow, flow=coarse, kept=None)
    return thin, max(1.0, DENSE * len(flow.time) / len(thin.time))
