"""What an envelope of the Graph Follower may be wrong by, judged by what it did not use."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.low_discrepancy import chebyshev_points, corners
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.envelope import Envelope
from alphacut.frame.methods.modal import guaranteed
from alphacut.frame.modal.fitting import fit_modes
from alphacut.frame.modal.levels import search_levels
from alphacut.frame.modal.polynomial_error import judged_at_optima, polynomial_error
from alphacut.frame.structures.modes import ModalError
from alphacut.frame.structures.polynomial_dependence import UnprovedError

SAMPLES = 128  # inside each level's box, as many on its faces, and at corners at most
SAFETY = 2.0
"""Factor on what they find beyond the bounds."""
GAP = 0.25
"""Gap of the proof that judges, as a share of the gain worth a graph."""
FITTED = 0.125
"""Wanted error of the modal model that judges, as a share of the gain worth a graph."""

BY_MODES = "the envelope of the exact motion by modes"


def judged(found: Envelope, flow: UnitFlow, steps: Array) -> Envelope:
    """The envelope with one error for search, polynomials and time stepping.

    The largest distance from what the exact motion's proved bounds leave possible, which the
    envelope keeps beside its own; where there is no proof, or it leaves more than the gain worth a
    graph, that from its envelope by modes, plus its own error; where the modes do not resolve the
    gain, what an independent sample finds beyond the bounds.

    Args:
        found: An envelope of the Graph Follower, whose gain worth a graph is among its facts.
        flow: Its trajectories.
        steps: Error of time stepping, shape (T, m).
    """
    proof = _proof(found, flow)
    if proof is not None:
        proved = _beside(found, proof, flow)
        sharp = float(proof.facts["gap"]) <= float(found.facts["gain"])  # enough to judge it
        return proved if sharp else _sharper(proved, found, flow)
    error = _by_modes(found, flow)
    if error is not None:
        return _told(found, error, flow, BY_MODES)
    own = float(found.facts["gain"]) * flow.scale if found.error is None else found.error
    missed = np.array([_missed(found, flow, level) for level in range(len(found.alpha))])
    error = np.broadcast_to(own, found.lower.shape) + SAFETY * missed[:, None]
    error = error + (steps if found.error is None else 0.0)
    judge = f"{len(sample(len(flow.boxes.names), 0))} independent trajectories on each level"
    return _told(found, error, flow, judge)


def _sharper(proved: Envelope, found: Envelope, flow: UnitFlow) -> Envelope:
    """An envelope beside a proof that is not sharp, with the error by modes where that is less."""
    error = _by_modes(found, flow)
    assert proved.error is not None
    if error is None or error.max() >= proved.error.max():
        return proved
    return _told(proved, np.minimum(error, proved.error), flow, BY_MODES)


def _told(found: Envelope, error: Array, flow: UnitFlow, judge: str) -> Envelope:
    """The envelope with an error and what it was found with."""
    facts = {
        **found.facts,
        "judged_by": judge,
        "estimated_error": float((error / flow.scale).max()),
    }
    nature = "estimated" if judge == BY_MODES and found.nature == "searched" else found.nature
    return replace(found, error=error, facts=facts, nature=nature)


def _proof(found: Envelope, flow: UnitFlow) -> Envelope | None:
    """Guaranteed envelope of the exact motion, or None."""
    if not isinstance(flow.flow, LinearFlow):
        return None
    exact = replace(flow, flow=replace(flow.flow, integrator=Exact()))
    try:
        return guaranteed(exact, GAP * float(found.facts["gain"]))
    except (UnprovedError, ModalError):
        return None


def _beside(found: Envelope, proof: Envelope, flow: UnitFlow) -> Envelope:
    """An envelope with proved bounds beside it and the largest error that they leave possible."""
    assert proof.inner_lower is not None
    assert proof.inner_upper is not None
    error = np.max(
        [
            np.abs(bound - own)
            for own, bounds in (
                (found.lower, (proof.lower, proof.inner_lower)),
                (found.upper, (proof.upper, proof.inner_upper)),
            )
            for bound in bounds
        ],
        axis=0,
    )
    facts = {
        **found.facts,
        "judged_by": "the guaranteed envelope of the exact motion",
        "estimated_error": float((error / flow.scale).max()),
        "proved_gap": proof.facts["gap"],
        **{name: proof.facts[name] for name in ("boxes", "kernel", "proof")},
    }
    return replace(
        found,
        nature="estimated" if found.nature == "searched" else found.nature,
        error=error,
        facts=facts,
        proved_lower=proof.lower,
        proved_upper=proof.upper,
    )


def _by_modes(found: Envelope, flow: UnitFlow) -> Array | None:
    """Distance from the modal envelope and the error of that; None where it resolves too little."""
    if not isinstance(flow.flow, LinearFlow):
        return None
    wanted = FITTED * float(found.facts["gain"])
    exact = replace(flow.flow, integrator=Exact())
    try:
        model = fit_modes(exact, flow.boxes, tolerance=wanted, scale=flow.scale)
    except ModalError:
        return None
    resolved = 2 * float(found.facts["gain"]) * flow.scale
    if (polynomial_error(model) > resolved).any():
        return None
    bounds, at, left = search_levels(replace(flow, kept=None), model, 0, wanted, None)
    own = polynomial_error(judged_at_optima(model, at, 0)[0])
    if (own > resolved).any():
        return None
    apart = np.abs(bounds - np.stack([-found.lower, found.upper], -1))
    return np.asarray((apart + left).max(-1) + own)


def _missed(found: Envelope, flow: UnitFlow, level: int) -> Array:
    """By how much an independent sample of a level leaves the envelope, shape (m,)."""
    lower, upper = flow.boxes.unit(level)
    points = (lower + upper) / 2 + (upper - lower) / 2 * sample(len(lower), level)
    worst = np.zeros(len(flow.outputs))
    for chunk in np.array_split(points, len(points) // 32):
        values = flow.values(chunk)
        beyond = np.maximum(values.max(0) - found.upper[level], found.lower[level] - values.min(0))
        worst = np.maximum(worst, beyond.max(0))
    return worst


def sample(d: int, level: int) -> Array:
    """Points of [−1, 1]^d where extremes may lie: inside, on faces and edges, at corners."""
    first = [100_003 * (level + 1) + k * SAMPLES for k in range(3)]
    inside, wide, ends = (chebyshev_points(d, SAMPLES, skip=skip) for skip in first)
    ends = np.sign(ends) if 2**d > SAMPLES else corners(-np.ones(d), np.ones(d))
    return np.concatenate([inside, np.clip(2 * wide, -1, 1), ends])
