"""Proof: guaranteed bounds of linear structures with up to six fuzzy inputs.

1. Displacements oscillate in the inputs; the modes' eigenvalues λ_k(p) and shares C_k(p) do not
   (section 7). Their series about the middle of a box give q(t; p) = 2 Re Σ C_k exp(λ_k t), and
   likewise the motion under a record (`frame.modes.damped`).
2. What these polynomials miss in the equations of motion is bounded over the whole box, and with it
   the error of the motion (`frame.bounds.model_error`). The degree rises until that takes a
   fifth of the gap wanted. Where it does not, the part is refused and bisected
   (`frame.bounds.spatial_branch_and_bound`).
3. Branch and bound encloses the polynomials' extremes at all nodes, for all outputs, sides and
   levels, between a point that is attained and a bound that is proved (`frame.bounds`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import comb
from typing import ClassVar

import numpy as np

from alphacut.frame.bounds.box_proof import BisectionError, BoxBounds, Goal
from alphacut.frame.bounds.certificate import certify
from alphacut.frame.bounds.model_error import proved_error
from alphacut.frame.bounds.remainder import MOST_PARAMETERS
from alphacut.frame.bounds.spatial_branch_and_bound import prove
from alphacut.frame.boxes import DEFAULT_TOLERANCE, Boxes, UnitFlow
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.envelope import Envelope
from alphacut.frame.modes.damped import require_dissipation
from alphacut.frame.modes.modal_model import ModalModel
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.progress_bar import Progress
from alphacut.fuzzy.refused import checked_number

MAX_ERROR_FRACTION = 0.2
"""Fraction of the gap that the error of the modal model may take on either side."""
LEFT_OUT = 1 / 120
"""Fraction of the gap that modes may be worth that are left out; their energy counts as error."""
BOXES_OF_INPUT = 4.0
"""Factor by which one more input multiplies the boxes of a branch and bound, about."""
LEAST_DEGREE, MAX_DEGREE = 3, 20
MAX_TERMS = 3100
"""Monomials of a polynomial: degree 13, 10 and 8 of 4, 5 and 6 inputs."""
FIRST_DECAY = 0.1
"""Factor by which a degree more multiplies the error, before any is seen."""
CAUTION = 0.8
"""Fraction of the degrees that the errors ask for which is taken at once."""


class GapError(UnprovedError):
    """The error of the modal model is bounded, but leaves too little of the gap."""


@dataclass(frozen=True)
class Proof:
    """The method and its options.

    Args:
        gap: Wanted distance of attained and proved bounds, as the tolerance; a tenth of that unless
            given.
        tolerance: Largest error allowed, what the gap may grow to where a smaller one is not
            proved: a share of each output's peak, or in the unit of the first displacement (the
            first output without one) where the envelope is not relative; 1e-3 unless given.
        boxes: Most boxes looked at for each bound, on average; where they end, the gap is wider.
        parts: Most parts of the box that a peak is worth, and that are refused.
        workers: Threads, which do not change the result; all cores unless given.

    Raises:
        RefusedError: A value is not positive.

    Example:
        >>> from alphacut.frame import StoreyFrame, envelope
        >>> from alphacut.fuzzy import Triangular
        >>> frame = StoreyFrame(masses=[1e3], stiffness=[4e4], q0=[0.1])
        >>> inputs = {"m1": Triangular(900, 1000, 1100)}
        >>> str(envelope(frame, inputs, Proof(), duration=0.5, step=0.1).nature)
        'guaranteed'
    """

    name: ClassVar[str] = "proof"
    gap: float | None = None
    tolerance: float | None = None
    boxes: float = 4000
    parts: int = 16
    workers: int | None = None

    def __post_init__(self) -> None:
        for key in ("gap", "tolerance", "boxes", "parts"):
            if getattr(self, key) is not None:
                checked_number(key, getattr(self, key), positive=True)

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Return the guaranteed envelope of all outputs on all levels.

        Raises:
            UnprovedError: The error of the modal model cannot be bounded within the tolerance.
        """
        tolerance = flow.tolerance(self.tolerance or self.gap)
        return prove(replace(self, tolerance=tolerance), flow, progress)

    def peak_gap(self, scale: Array, peak: Array) -> Array:
        """Return the tolerance of each output, shape (m,)."""
        del peak
        return scale * self._gaps[-1]

    @property
    def _gaps(self) -> tuple[float, ...]:
        """Gaps that are tried on a part, in units of the tolerance."""
        tolerance = self.tolerance or DEFAULT_TOLERANCE
        return (self.gap,) if self.gap else (0.1 * tolerance, tolerance)

    def forecast(self, flow: LinearFlow, boxes: Boxes) -> float:
        """Return the expected work on the box, in evaluations of a mode's motion at a node.

        Raises:
            UnprovedError: There are too many inputs, or the structure is not known to lose energy.
        """
        n_inputs = int((boxes.upper[0] > boxes.lower[0]).sum())
        if n_inputs > MOST_PARAMETERS:
            raise UnprovedError(
                f"proofs are affordable up to {MOST_PARAMETERS} fuzzy inputs, and there are"
                f" {n_inputs}"
            )
        if len(flow.system.ratios) > 1:
            raise UnprovedError("damping by a ratio of each mode is no polynomial", "take dual")
        require_dissipation(flow.system, boxes)
        return float(BOXES_OF_INPUT**n_inputs)

    def bounds(self, flow: LinearFlow, boxes: Boxes, goal: Goal) -> list[BoxBounds]:
        """Return proved and attained bounds on each level of a part of the box.

        Raises:
            UnprovedError: The error of the modal model cannot be bounded within the tolerance, or
                the structure has no smooth oscillating modes over the part.
        """
        for gap in self._gaps:  # the narrowest first
            try:
                model, error = self._accurate_model(flow, boxes, goal.scale, gap)
                break
            except (GapError, BisectionError):
                if gap == self._gaps[-1]:
                    raise
        proof = certify(
            model,
            gap=gap,
            model_error=error,
            scale=goal.scale,
            workers=goal.workers,
            budget=self.boxes,
            progress=goal.tick,
        )
        facts = {
            "model_error": float((error / goal.scale).max()),
            "degree": model.degree,
            "boxes": proof.boxes / len(boxes.alpha),
            "evaluations": 1 / len(boxes.alpha),
        }
        inputs = boxes.to_physical(proof.at)
        shares = np.broadcast_to(tail_shares(model), inputs.shape[2:])
        return [
            BoxBounds(
                outer=outer,
                inner=inner,
                at=at,
                between=proof.between,
                shares=shares,
                attained_error=proof.attained_error,
                facts=facts,
            )
            for outer, inner, at in zip(proof.outer, proof.bounds, inputs, strict=True)
        ]

    def _accurate_model(
        self, flow: LinearFlow, boxes: Boxes, scale: Array, gap: float
    ) -> tuple[ModalModel, Array]:
        """Modal model of a box whose proved error, (T, m), is a fifth of the gap at most."""
        degree, max_degree, step, before = LEAST_DEGREE, _max_degree(len(boxes.names)), 0, np.inf
        while True:
            model = ModalModel.of_degree(flow, boxes, degree, LEFT_OUT * gap * scale)
            error = proved_error(model)
            excess = float((error / scale).max()) / (MAX_ERROR_FRACTION * gap)
            if excess <= 1:
                return model, error
            # factor of the error by a degree more, and how many degrees more it takes at that rate
            decay = (excess / before) ** (1 / step) if step else FIRST_DECAY
            further = np.log(excess) / -np.log(decay) if decay < 1 else np.inf
            if degree == max_degree or (step and not degree + further < max_degree + 1):
                raise self._refusal(model, excess, decay)
            step = min(max(1, int(CAUTION * further)), max_degree - degree)
            degree, before = degree + step, excess

    def _refusal(self, model: ModalModel, excess: float, decay: float) -> UnprovedError:
        """A `GapError` with the input to bisect; a `BisectionError` if too many are needed."""
        what = f"the proved error of the modes, {MAX_ERROR_FRACTION * excess:.3g} of it,"
        what += " takes too much of the gap"
        cure = "narrower or fewer fuzzy inputs, or a wider gap, can be proved"
        input_shares, max_degree = tail_shares(model), _max_degree(len(model.boxes.names))
        with_all_degrees = np.log2(excess) + (max_degree - model.degree) * np.log2(decay)
        # halving the inputs that contribute divides the error of degree N by 2^(N + 1)
        halvings = max(1.0, np.ceil(with_all_degrees / (max_degree + 1)))
        if not halvings / (input_shares**2).sum() <= np.log2(self.parts):
            return BisectionError(what, cure)
        return GapError(what, cure, int(input_shares.argmax()))


def tail_shares(model: ModalModel) -> Array:
    """Return each input's fraction in the terms of highest degree of a modal model, (d,).

    It estimates the input's part in the model's error.
    """
    index = model.eigenvalue.exponents  # of the terms, (terms, d)
    top = index.sum(1) == model.degree
    weight = np.zeros(len(index))
    for polynomials in (model.eigenvalue, model.coefficient):
        size = np.abs(polynomials.coefficients).reshape(len(index), -1)
        weight += (size / np.maximum(size.max(0), 1e-300)).max(1)
    shares = weight[top] @ index[top]
    return np.asarray(shares / max(float(shares.sum()), 1e-300))


def _max_degree(d: int) -> int:
    """Greatest degree of polynomials in d inputs that are affordable."""
    degree = MAX_DEGREE
    while comb(d + degree, d) > MAX_TERMS:
        degree -= 1
    return degree
