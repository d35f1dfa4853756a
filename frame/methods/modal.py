"""Envelopes by modal intervening variables: what is tried first for linear structures."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.threads import threads
from alphacut.frame.certificate.certificate import Certificate, certify
from alphacut.frame.certificate.model_error import proved_error
from alphacut.frame.certificate.remainder import MOST_PARAMETERS, require_certifiable
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.envelope import Envelope, signed_envelope
from alphacut.frame.modal.exact_response import ExactResponse
from alphacut.frame.modal.fitting import MANY, fit_modes
from alphacut.frame.modal.levels import polished_levels, search_levels
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.polynomial_error import judged_at_optima, polynomial_error
from alphacut.frame.modal.proportional_response import exact_response
from alphacut.frame.structures.linear import frequencies, round_off
from alphacut.frame.structures.modes import ModalError
from alphacut.frame.structures.polynomial_dependence import UnprovedError
from alphacut.fuzzy.progress_bar import Progress

FINE = 8
"""Wanted error of an envelope over the tolerance of the polynomials that keeps it."""
SAFETY = 3.0
"""Factor on the model error sampled at held-out points."""
PORTION = 0.2
"""Share of the gap that the error of the modal model may take on either side."""
USUAL = 10.0
"""Proved over sampled error, seldom less."""
TOO_WIDE = "the proved error of the modes, some"
"""Beginning of the reason where the error of the modes takes too much of the gap."""
ATTEMPTS = 5
"""Models of rising degree that are tried before the error is sampled instead of proved."""
BOXES = 1000.0
"""Boxes for each bound, on average, that a proof nobody asked for may look at."""
MOST_BOXES = 2e7
"""The same for all bounds of a level together: seconds, or a minute under a record."""
ENOUGH = 2.0
"""Error of the polynomials, as a multiple of the tolerance, from which on exact trajectories take
over."""
ROUGH = 0.3
"""Error of the polynomials, as a share of an output's peak, above which they lead nowhere, and
Newton's method learns second derivatives from gradients."""
APART = 3.0
"""Change of phase (rad) over the box between nodes from which on they do not guide each other."""
GUIDED = 0.3
"""Share of the time that the polynomials' search takes before that, for the progress alone."""
EXACT = "values of exact trajectories at the parameters given; polynomials only led there"
PROVED = (
    "the error of its polynomials is bounded over the whole box by the energy of what they miss in"
    " the equations of motion"
)
SAMPLED = "the error of its polynomials is verified by sampling, since it could not be proved"


class GapError(UnprovedError):
    """The error of the modal model is bounded, but leaves too little of the gap."""


@dataclass(frozen=True)
class Modal:
    """The method and its options.

    Args:
        tolerance: Wanted error of the modal model, in units of the outputs.
        budget: Most eigen-analyses.
        seed: Of the samples that find the basins.
        certify: Wanted gap between attained and proved bounds, in units of the outputs; None for no
            certificate.
        boxes: Most boxes of the branch and bound per bound, on average.
        workers: Processes of the branch and bound.
        passes: Most independent passes of the search of polynomials; 1 takes the least effort
            throughout, for differences that need two digits.

    Raises:
        ValueError: A value is out of its range.
    """

    tolerance: float = 1e-6
    budget: int = 280
    seed: int = 0
    certify: float | None = None
    boxes: float = 4000
    workers: int = 1
    passes: int = 8

    def __post_init__(self) -> None:
        counts = (self.budget, self.workers, self.passes)
        if not self.tolerance > 0 or min(counts) < 1 or self.boxes <= 0:
            raise ValueError(
                f"tolerance {self.tolerance:g}, budget {self.budget}, workers {self.workers},"
                f" passes {self.passes}: each must be positive"
            )
        if self.certify is not None and not self.certify > 0:
            raise ValueError(f"certify: {self.certify:g} is not allowed; the gap must be positive")

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Envelope of a linear structure from a polynomial modal model over the widest box.

        Where the polynomials do not reach the tolerance, or the parameters are more than six,
        exact trajectories polish their optima, and `error` is what the search may have missed.

        Args:
            flow: Trajectories of a `LinearFlow`.
            progress: Called with the fraction done.

        Raises:
            ModalError: The structure has no smooth oscillating modes over the box.
            ValueError: The flow is not that of a linear structure.
        """
        linear, begun = self._linear(flow), time.perf_counter()
        if self.certify is not None:
            return _certified(flow, self, self.certify, begun, progress)
        model = fit_modes(
            linear, flow.boxes, tolerance=self.tolerance, budget=self.budget, scale=flow.scale
        )
        exact, points = self._exact(model, flow), 0
        guided = progress and (lambda share: progress(GUIDED * share if exact else share))
        bounds, at, left = search_levels(
            flow, model, self.seed, self.tolerance, guided, passes=1 if exact else self.passes
        )
        if exact is None:
            model, points = judged_at_optima(model, at, self.seed)
            exact = self._exact(model, flow)
        if exact is not None:
            polished = progress and (lambda share: progress(GUIDED + (1 - GUIDED) * share))
            bounds, at, left = polished_levels(flow, exact, at, self.seed, self.tolerance, polished)
            error = left.max(-1)
            facts: dict[str, float | str] = {"degree": model.degree, "bounds": EXACT}
        else:
            error = polynomial_error(model) + left.max(-1)
            facts = _judged(model, points, self.tolerance, flow)
        error = np.maximum(error, rounding(model, np.abs(bounds).max((0, 1, 3))))
        facts["search_error"] = float((left.max(-1) / flow.scale).max())
        return signed_envelope(
            flow,
            bounds,
            at,
            method="modal",
            nature=_nature(flow, exact, model),
            error=error,
            facts=facts,
            trajectories=model.analyses,
            seconds=time.perf_counter() - begun,
        )

    def _linear(self, flow: UnitFlow) -> LinearFlow:
        """The flow of a linear structure whose integrator allows what is asked for."""
        linear = flow.flow
        if not isinstance(linear, LinearFlow):
            raise ValueError("method: 'modal' needs a linear structure; take graph-follower")
        if self.certify is not None and not isinstance(linear.integrator, Exact):
            raise ValueError(
                f"certify: with the integrator '{linear.integrator.name}' nothing is proved, since"
                " a proof is of the exact motion; take the integrator exact"
            )
        return linear

    def _exact(self, model: ModalModel, flow: UnitFlow) -> ExactResponse | None:
        """What polishes the bounds; None where the polynomials do, or nothing can."""
        if (model.error / flow.scale).max() <= ENOUGH * self.tolerance:
            return None
        peak = np.abs(flow.flow.values(flow.boxes.modal[None])[0]).max(0)
        bent = not (model.error.max(0) > ROUGH * peak).any()
        try:
            return exact_response(model, flow.scale, bent=bent)
        except ModalError:
            return None


def rounding(model: ModalModel, peak: Array) -> Array:
    """Least error of trajectories in doubles, given their peaks (m,), shape (T, m)."""
    rates = np.abs(model.eigenvalue.coefficients[0])
    largest = max(rates.max(), frequencies(model.flow.system).max())
    share: Array = 64 * np.finfo(float).eps + round_off(largest**2, rates.min(), model.time)
    return share[:, None] * peak


def _nature(flow: UnitFlow, exact: ExactResponse | None, model: ModalModel) -> str:
    """Worth of the error: less without a guide, in many dimensions, or with nodes far apart."""
    led = len(flow.boxes.names) <= MANY and (exact is None or exact.bent)
    alone = model.turned(flow.time[1] - flow.time[0]) > APART
    return "searched" if not led or alone else "estimated"


def _judged(
    model: ModalModel, points: int, tolerance: float, flow: UnitFlow
) -> dict[str, float | str]:
    """Facts of bounds that polynomials give, judged at a number of points."""
    facts: dict[str, float | str] = {
        "degree": model.degree,
        "model_error": float(model.error.max()),
        "judged_by": f"trajectories at {points} optima, corners and random points",
    }
    reached = float((model.error / flow.scale).max())
    if reached > tolerance:
        facts["reason"] = (
            f"modal: the polynomials reach {flow.told(reached)} and not the tolerance"
            f" {flow.told(tolerance)}, see the error; take the method auto, narrower supports or"
            " a larger budget"
        )
    return facts


def guaranteed(
    flow: UnitFlow, gap: float, progress: Progress | None = None, workers: int | None = None
) -> Envelope:
    """Proved envelope of a linear structure, within a gap unless the boxes do not suffice.

    Args:
        flow: Trajectories of a `LinearFlow`.
        gap: Wanted gap between attained and proved bounds, in units of the outputs.
        progress: Called with the fraction done.
        workers: Threads; None for all cores.

    Raises:
        UnprovedError: The error of the modal model cannot be bounded, or there are too many
            parameters.
        ModalError: The structure has no smooth oscillating modes over the box.
    """
    if len(flow.boxes.names) > MOST_PARAMETERS:
        raise UnprovedError(
            f"proofs are affordable up to {MOST_PARAMETERS} fuzzy inputs, and there are"
            f" {len(flow.boxes.names)}; fewer can be proved"
        )
    size = 2 * len(flow.outputs) * len(flow.time)
    boxes = min(BOXES, MOST_BOXES / size)
    method = Modal(certify=gap, boxes=boxes, workers=workers or threads())
    return _certified(flow, method, gap, time.perf_counter(), progress, insist=True)


def _certified(
    flow: UnitFlow,
    method: Modal,
    gap: float,
    begun: float,
    progress: Progress | None,
    *,
    insist: bool = False,
) -> Envelope:
    assert isinstance(flow.flow, LinearFlow)
    require_certifiable(len(flow.boxes.names))
    model, error, unproved = model_with_error(flow.flow, flow, method, gap, patient=not insist)
    if unproved and insist:
        raise (GapError if unproved.startswith(TOO_WIDE) else UnprovedError)(unproved)
    proof = certify(
        model,
        gap=gap,
        model_error=error,
        scale=flow.scale,
        workers=method.workers,
        budget=method.boxes,
        progress=progress,
        told=flow.told,
    )
    envelope = signed_envelope(
        flow,
        proof.outer,
        proof.at,
        method="modal",
        nature="verified by sampling" if unproved else "guaranteed",
        error=(proof.outer - proof.bounds).max(-1),
        between=proof.between,
        trajectories=model.analyses,
        seconds=time.perf_counter() - begun,
        facts=_proof_facts(flow, model, error, proof, unproved),
    )
    return replace(envelope, inner_lower=-proof.bounds[..., 0], inner_upper=proof.bounds[..., 1])


def _proof_facts(
    flow: UnitFlow, model: ModalModel, error: Array, proof: Certificate, unproved: str
) -> dict[str, float | str]:
    facts: dict[str, float | str] = {
        "model_error": float((error / flow.scale).max()),
        "degree": model.degree,
        "gap": proof.gap,
        "gap_output": flow.outputs[flow.reference],
        "between_nodes": float((proof.between / flow.scale).max()),
        "boxes": proof.boxes,
        "kernel": proof.kernel,
        "proof": f"the branch and bound is rigorous for the modal model; {PROVED}",
    }
    if unproved:
        facts["unproved"] = unproved
        facts["proof"] = (
            f"the branch and bound is rigorous for the modal model; {SAMPLED}: {unproved}"
        )
    return facts


def model_with_error(
    linear: LinearFlow,
    flow: UnitFlow,
    method: Modal,
    gap: float,
    *,
    patient: bool = True,
    unproved: str = "",
) -> tuple[ModalModel, Array, str]:
    """Modal model for a certificate, its error (T, m), and why that is only sampled.

    The proved bound exceeds the sampled error some thirty times, so the polynomials are refined
    until it takes little of the gap. `patient` is as for `proved_error`; where it is known why
    nothing is proved, `unproved` says so, and only sampled errors are asked for.
    """

    def fitted(tolerance: float) -> ModalModel:
        return fit_modes(
            linear,
            flow.boxes,
            tolerance=tolerance,
            budget=method.budget,
            scale=flow.scale,
            energy=True,
        )

    model = first = fitted(min(method.tolerance, gap / 30))
    reason = unproved
    for _ in range(0 if unproved else ATTEMPTS):
        sampled = float((model.error / flow.scale).max())
        largest = USUAL * sampled  # a bound is seldom less, and takes time
        if largest <= PORTION * gap:
            try:
                error = proved_error(model, patient=patient)
            except UnprovedError as unknown:
                reason = str(unknown)
                break
            largest = float((error / flow.scale).max())
            if largest <= PORTION * gap:
                return model, error, ""
        reason = (
            f"{TOO_WIDE} {flow.told(largest)}, takes too much of the gap {flow.told(gap)}; a proof"
            f" may need a gap of some {flow.told(1.2 * largest / PORTION)}, or narrower or fewer"
            " fuzzy inputs"
        )
        # a degree more divides it by ten or so
        model, before = (fitted(sampled * min(0.99, 4 * PORTION * gap / largest)), model.degree)
        if model.degree <= before:
            break
    return first, SAFETY * first.error, reason
