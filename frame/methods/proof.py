"""Guaranteed bounds of linear structures with up to six fuzzy inputs, by branch and bound.

1. Displacements oscillate in the inputs; the eigenvalues λ_k(p) of the modes and the participation
   factors C_k(p) do not (section 7 of the paper). Their polynomials about the midpoint of a box
   give the modal model q(t; p) = 2 Re Σ_k C_k exp(λ_k t), and likewise the response to a record
   (`frame.modes.damped`).
2. The residual of these polynomials in the equations of motion is bounded over the whole box, and
   with it the error of the response (`frame.modes.modal_model`). The degree rises until the error
   takes a fifth of the wanted gap. If it does not fall that far, the box is bisected
   (`frame.bounds.spatial_branch_and_bound`).
3. Branch and bound encloses the extreme values of the model at all nodes, for all outputs, sides
   and levels, between an attained value and a guaranteed bound (`frame.bounds.branch_and_bound`).
"""

from __future__ import annotations

import logging
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import checked_number
from alphacut.base.progress_bar import Progress
from alphacut.frame import numbers
from alphacut.frame.bounds.box_proof import (
    BisectionError,
    BoxBounds,
    Goal,
    refusing,
    take_larger,
)
from alphacut.frame.bounds.branch_and_bound import (
    Optima,
    bound_problems,
    first_optima,
    remainder_bounds,
)
from alphacut.frame.bounds.spatial_branch_and_bound import halvings, prove
from alphacut.frame.boxes import DEFAULT_TOLERANCE, MAX_PARAMETERS, Boxes, UnitFlow
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import Flow, LinearFlow, exact_flow
from alphacut.frame.dynamics.yielding import YieldingFlow
from alphacut.frame.methods.method import Method
from alphacut.frame.methods.yielding_proof import YIELDING_GAP, provable_frame, prove_yielding
from alphacut.frame.modes.damped import require_dissipation
from alphacut.frame.modes.modal_model import ModalModel, error_fractions
from alphacut.frame.modes.modes import FittedModel, as_oscillators, fitted_model
from alphacut.frame.result import Envelope
from alphacut.frame.threshold import Threshold
from alphacut.frame.verification.rounding import rounding_margin

LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class Proof(Method):
    """Branch and bound as a method, and its options.

    Args:
        gap: Wanted distance of attained values and guaranteed bounds, as a fraction of the peak of
            each output, or in the unit of the first displacement (of the first output if there is
            none) if the envelope is not relative; by default a tenth of the tolerance.
        tolerance: Largest distance allowed, to which the gap may grow if a smaller one is not
            proved, in the same unit; 1e-3 of each peak by default. Where columns yield, one of both
            is the wanted gap, and 0.01 of each peak without them.
        boxes: Largest number of boxes looked at for each bound, on average; where columns yield,
            for all bounds of a level. If it is reached, the gap is wider.
        parts: Largest number of sub-boxes for a peak, and of sub-boxes that may be refused.
        workers: Number of threads, which does not change the result; by default all cores.
        thresholds: Limits of peaks where columns yield. With them the effort goes to the question
            whether they hold, and not to the gap.

    Raises:
        RefusedError: A value is not positive.
    """

    name: ClassVar[str] = "proof"
    takes_kinks: ClassVar[bool] = True
    is_exact: ClassVar[bool] = True
    gap: float | None = None
    tolerance: float | None = None
    boxes: float = 4000
    parts: int = 16
    workers: int | None = None
    thresholds: tuple[Threshold, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        for key in ("gap", "tolerance", "boxes", "parts"):
            if getattr(self, key) is not None:
                checked_number(key, getattr(self, key), positive=True)

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Return the guaranteed envelope of all outputs on all levels.

        Args:
            flow: The response over the boxes of the inputs.
            progress: Called with the completed fraction.

        Raises:
            UnprovedError: The structure is not linear, the integrator is not the exact one, there
                are more than six inputs, or the error of the modal model cannot be bounded within
                the tolerance; or columns yield, and `prove_yielding` does not bound the response.
            FailedError: An attained value exceeds a guaranteed bound: the proof is wrong.
        """
        if isinstance(flow.flow, YieldingFlow):
            gap = flow.peak * YIELDING_GAP
            if stated := self.gap or self.tolerance:
                gap = flow.scale * stated
            return prove_yielding(
                flow,
                self.name,
                gap,
                budget=self.boxes,
                thresholds=self.thresholds,
                progress=progress,
            )
        # Without a tolerance the gap is the tolerance, too.
        tolerance = flow.tolerance(self.tolerance or self.gap)
        return prove(replace(self, tolerance=tolerance), flow, rounding_margin, progress)

    def peak_gap(self, flow: UnitFlow) -> Array:
        """Return the largest gap allowed at the peak of each output, shape (outputs,)."""
        return flow.scale * self._gaps[-1]

    @property
    def _gaps(self) -> tuple[float, ...]:
        """Gaps that are tried on a sub-box, the smallest first, in units of the outputs' scale."""
        tolerance = self.tolerance or DEFAULT_TOLERANCE
        if self.gap:
            return (self.gap,)
        return (0.1 * tolerance, tolerance)

    def require_possible(self, flow: Flow, boxes: Boxes) -> None:
        """Refuse a structure without a proof, with `forecast`, or `provable_frame` if it yields."""
        if isinstance(flow, YieldingFlow):
            provable_frame(flow, boxes)
        else:
            with refusing():
                self.forecast(exact_flow(flow), boxes)

    def forecast(self, flow: LinearFlow, boxes: Boxes) -> float:
        """Return the expected work on a box, in evaluations of the response of a mode at a node.

        Args:
            flow: The exact response.
            boxes: The boxes of the inputs; the widest one counts.

        Raises:
            UnprovedError: More than six inputs have a width, damping is given by a ratio of each
                mode, or the structure is not known to lose energy at all points of the box.
        """
        n_inputs = int((boxes.upper[0] > boxes.lower[0]).sum())
        if n_inputs > MAX_PARAMETERS:
            raise UnprovedError(
                f"proofs are affordable up to {MAX_PARAMETERS} fuzzy inputs, and there are"
                f" {n_inputs}"
            )
        if len(flow.system.ratios) > 1:
            raise UnprovedError("damping by a ratio of each mode is no polynomial", "take dual")
        # The bound of the model error integrates the residual over time, which needs that the
        # energy of the error does not grow.
        require_dissipation(flow.system, boxes)
        # One more input multiplies the boxes of a branch and bound by about 4 (measured). A larger
        # factor would prefer the dual bound, whose work is compared with this.
        return float(4.0**n_inputs)

    def bounds(self, flow: LinearFlow, boxes: Boxes, goal: Goal) -> list[BoxBounds]:
        """Return guaranteed bounds and attained values on each level of a sub-box.

        The smallest of the gaps that are allowed is tried first. If the model is not accurate
        enough for a gap, the next larger one is tried.

        Args:
            flow: The exact response.
            boxes: The sub-box on each level.
            goal: Unit of the gap for each output, number of threads, and progress.

        Returns:
            For each level, upper bounds and attained values of both sides of the outputs at all
            time nodes, with the inputs that attain them.

        Raises:
            UnprovedError: The modal model is not accurate enough even for the largest gap, with
                the input to bisect, or as a `BisectionError` if bisections would not help. Or the
                structure has no smooth oscillating modes over the sub-box.
        """
        # Models by their degree, with their errors. Those for a gap leave out no mode that a larger
        # gap would keep, and serve there as well.
        models: dict[int, tuple[ModalModel, Array]] = {}

        def bounds_within(gap: float) -> list[BoxBounds]:
            """Return the bounds for one gap; raise UnprovedError if the model is inaccurate."""
            tolerance = numbers.MAX_ERROR_FRACTION * gap * goal.scale
            found = fitted_model(flow, boxes, tolerance, models)
            if found.excess > 1:
                raise self._inaccurate(found)
            return bound_levels(
                found.model, found.error, goal.scale, gap, self.boxes, goal.workers, goal.tick
            )

        for gap in self._gaps[:-1]:
            with suppress(UnprovedError):
                return bounds_within(gap)
        return bounds_within(self._gaps[-1])

    def _inaccurate(self, found: FittedModel) -> UnprovedError:
        """Return, without raising it, the error for a model that is too inaccurate.

        It has the index of the input to bisect, the one that contributes most; or it is a
        `BisectionError` if more bisections are needed than the number of sub-boxes allows, or if no
        input contributes to the error.
        """
        what = f"the proved error of the modes, {numbers.MAX_ERROR_FRACTION * found.excess:.3g} of"
        what += " it, takes too much of the gap"
        cure = "narrower or fewer fuzzy inputs, or a wider gap, can be proved"
        fractions = error_fractions(found.model)
        # The halvings are distributed among the inputs in proportion to their fractions.
        is_affordable = found.halvings <= halvings(fractions, self.parts)
        if not (is_affordable and fractions.any()):
            return BisectionError(what, cure)
        return UnprovedError(what, cure, int(fractions.argmax()))


def bound_levels(
    model: ModalModel,
    model_error: Array,
    scale: Array,
    gap: float,
    budget: float = 4000,
    workers: int = 1,
    progress: Progress | None = None,
) -> list[BoxBounds]:
    """Return bounds of all outputs at each node and on each level by branch and bound.

    The narrowest level is bounded first, whose best points are also good ones of wider levels.

    Args:
        model: Modal model of the response.
        model_error: Guaranteed bound of its error at the nodes, shape (times, outputs).
        scale: Unit of the gap for each output, shape (outputs,).
        gap: Wanted difference of guaranteed bounds and attained values.
        budget: Largest number of boxes for a bound, on average.
        workers: Number of threads.
        progress: Called with the completed fraction.

    Returns:
        The bounds on each level, in the order of `model.boxes.alpha`.

    Raises:
        BisectionError: The gap does not exceed twice the model error.
    """
    in_own_units = model
    model = model.in_units(scale)
    error = model_error / scale
    lower, upper = model.boxes.unit_ends(0)
    error = error + remainder_bounds(model, lower, upper).tables
    # The error is added to the bounds on either side. The search has the rest of the gap, a little
    # less so that rounding does not make the sum larger than the gap.
    least_gap = float(2 * error.max())
    search_gap = (1 - 1e-6) * gap - least_gap
    if search_gap <= 0:
        what = f"errors of the modes, {least_gap:.3g}, pass the gap of {gap:.3g}"
        raise BisectionError(what, "take the method dual, a shorter duration or a wider gap")

    n_levels = len(model.boxes.alpha)
    all_optima: list[Optima] = []  # from the narrowest level on, as the two following lists
    all_proved: list[Array] = []
    n_boxes: list[int] = []
    for level, tick in model.boxes.inside_out(progress):
        lower, upper = model.boxes.unit_ends(level)
        # Good attained values let branch and bound discard most boxes at once.
        optima = first_optima(model, lower, upper, numbers.NEWTON_GAP * search_gap)
        if all_optima:  # a wider box contains what the narrower one attains
            inside = all_optima[-1]
            take_larger(optima.value, optima.point, inside.value, inside.point)
        proved, count = bound_problems(
            model,
            lower,
            upper,
            optima,
            gap=search_gap,
            budget=budget,
            workers=workers,
            progress=tick,
        )
        LOG.debug("branch and bound: level %g took %d boxes", model.boxes.alpha[level], count)
        all_optima.append(optima)
        all_proved.append(proved)
        n_boxes.append(count)

    between = as_oscillators(in_own_units, error * scale).interpolation_error()
    facts = {
        "model_error": float(error.max()),
        "degree": model.degree,
        "boxes": sum(n_boxes) / n_levels,
        "evaluations": 1 / n_levels,
    }
    shape = (*error.shape, 2)
    fractions = np.broadcast_to(error_fractions(model), (*shape[1:], len(model.boxes.names)))
    bounds = []
    upper = np.full(2 * error.size, np.inf)
    for optima, proved in zip(reversed(all_optima), reversed(all_proved), strict=True):
        upper = np.minimum(upper, proved)  # a narrower box lies inside the wider ones
        attained = optima.value.reshape(shape) - error[..., np.newaxis]
        box_bounds = BoxBounds(
            upper=(upper.reshape(shape) + error[..., np.newaxis]) * scale[:, np.newaxis],
            attained=attained * scale[:, np.newaxis],
            attained_at=model.boxes.to_physical(optima.point.reshape(*shape, -1)),
            between_nodes=between,
            gap_fractions=fractions,
            attained_error=2 * error * scale,
            facts=facts,
        )
        bounds.append(box_bounds)
    return bounds
