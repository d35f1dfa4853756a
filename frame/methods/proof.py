"""Proof: guaranteed bounds of linear structures with up to six fuzzy inputs.

1. Displacements oscillate in the inputs; the modes' eigenvalues λ_k(p) and shares C_k(p) do not
   (section 7). Their series about the middle of a box give q(t; p) = 2 Re Σ C_k exp(λ_k t), and
   likewise the motion under a record (`frame.modes.damped`).
2. What these polynomials miss in the equations of motion is bounded over the whole box, and with it
   the error of the motion (`frame.bounds.model_error`). The degree rises until that takes a
   fifth of the gap wanted. Where it does not, the box is refused and bisected
   (`frame.bounds.spatial_branch_and_bound`).
3. Branch and bound encloses the polynomials' extremes at all nodes, for all outputs, sides and
   levels, between a point that is attained and a bound that is proved
   (`frame.bounds.branch_and_bound`).
"""

from __future__ import annotations

import logging
from contextlib import suppress
from dataclasses import dataclass, replace
from math import comb
from typing import ClassVar

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import checked_number
from alphacut.base.progress_bar import Progress, subprogress
from alphacut.frame import numbers
from alphacut.frame.bounds.box_proof import BisectionError, BoxBounds, Goal
from alphacut.frame.bounds.branch_and_bound import Optima, enclosed, first_optima
from alphacut.frame.bounds.kernel import call_examine
from alphacut.frame.bounds.model_error import (
    MAX_PARAMETERS,
    Remainder,
    direct_error_in_steps,
    largest_growth,
    motion_parts,
    proved_error,
)
from alphacut.frame.bounds.spatial_branch_and_bound import prove
from alphacut.frame.boxes import DEFAULT_TOLERANCE, Boxes, UnitFlow
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.envelope import Envelope
from alphacut.frame.modes.damped import require_dissipation
from alphacut.frame.modes.modal_model import ModalModel
from alphacut.frame.response.duhamel import call_with_load
from alphacut.frame.response.load_tables import Direct
from alphacut.frame.response.straying import Response, narrowed_at_jumps, narrowed_straying

LOG = logging.getLogger(__name__)


class GapError(UnprovedError):
    """The error of the modal model is bounded, but leaves too little of the gap."""


@dataclass(frozen=True)
class Proof:
    """The method and its options.

    Args:
        gap: Wanted distance of attained and proved bounds, as the tolerance; a tenth of that unless
            given.
        tolerance: Largest error allowed, what the gap may grow to where a smaller one is not
            proved: a fraction of each output's peak, or in the unit of the first displacement (the
            first output without one) where the envelope is not relative; 1e-3 unless given.
        boxes: Most boxes looked at for each bound, on average; where they end, the gap is wider.
        parts: Most parts of the box that a peak is worth, and that are refused.
        workers: Threads, which do not change the result; all cores unless given.

    Raises:
        RefusedError: A value is not positive.
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

    def peak_gap(self, flow: UnitFlow) -> Array:
        """Return the tolerance of each output, shape (m,)."""
        return flow.scale * self._gaps[-1]

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
        if n_inputs > MAX_PARAMETERS:
            raise UnprovedError(
                f"proofs are affordable up to {MAX_PARAMETERS} fuzzy inputs, and there are"
                f" {n_inputs}"
            )
        if len(flow.system.ratios) > 1:
            raise UnprovedError("damping by a ratio of each mode is no polynomial", "take dual")
        require_dissipation(flow.system, boxes)
        return float(numbers.BOXES_OF_INPUT**n_inputs)

    def call_kernels(self) -> None:
        """Call the compiled kernels of `bounds` that take tuples once; see `KernelThreads`."""
        call_with_load()
        call_examine()

    def bounds(self, flow: LinearFlow, boxes: Boxes, goal: Goal) -> list[BoxBounds]:
        """Return proved and attained bounds on each level of a part of the box.

        Raises:
            UnprovedError: The error of the modal model cannot be bounded within the tolerance, or
                the structure has no smooth oscillating modes over the part.
        """

        def within(gap: float) -> list[BoxBounds]:
            model, error = self._accurate_model(flow, boxes, goal.scale, gap)
            return bound_levels(model, error, goal.scale, gap, self.boxes, goal.workers, goal.tick)

        for gap in self._gaps[:-1]:  # the narrowest first
            with suppress(GapError, BisectionError):
                return within(gap)
        return within(self._gaps[-1])

    def _accurate_model(
        self, flow: LinearFlow, boxes: Boxes, scale: Array, gap: float
    ) -> tuple[ModalModel, Array]:
        """Modal model of a box whose proved error, (T, m), is a fifth of the gap at most."""
        max_degree, step, before = _max_degree(len(boxes.names)), 0, np.inf
        degree = min(int(numbers.FIRST_DEGREE), max_degree)
        while True:
            model = ModalModel.of_degree(flow, boxes, degree, numbers.LEFT_OUT_MODES * gap * scale)
            error = proved_error(model)
            excess = float((error / scale).max()) / (numbers.MAX_ERROR_FRACTION * gap)
            if excess <= 1:
                return model, error
            # factor of the error by a degree more, and how many degrees more it takes at that rate
            decay = (excess / before) ** (1 / step) if step else numbers.FIRST_DECAY
            further = np.log(excess) / -np.log(decay) if decay < 1 else np.inf
            if degree == max_degree or (step and not degree + further < max_degree + 1):
                raise self._refusal(model, excess, decay)
            step = min(max(1, int(numbers.DEGREE_CAUTION * further)), max_degree - degree)
            degree, before = degree + step, excess

    def _refusal(self, model: ModalModel, excess: float, decay: float) -> UnprovedError:
        """A `GapError` with the input to bisect; a `BisectionError` if too many are needed."""
        what = f"the proved error of the modes, {numbers.MAX_ERROR_FRACTION * excess:.3g} of it,"
        what += " takes too much of the gap"
        cure = "narrower or fewer fuzzy inputs, or a wider gap, can be proved"
        input_shares, max_degree = tail_shares(model), _max_degree(len(model.boxes.names))
        with_all_degrees = np.log2(excess) + (max_degree - model.degree) * np.log2(decay)
        # halving the inputs that contribute divides the error of degree N by 2^(N + 1)
        halvings = max(1.0, np.ceil(with_all_degrees / (max_degree + 1)))
        if not halvings / (input_shares**2).sum() <= np.log2(self.parts):
            return BisectionError(what, cure)
        return GapError(what, cure, int(input_shares.argmax()))


def bound_levels(
    model: ModalModel,
    model_error: Array,
    scale: Array,
    gap: float,
    budget: float = 4000,
    workers: int = 1,
    progress: Progress | None = None,
) -> list[BoxBounds]:
    """Bounds of all outputs at each node and on each level of a modal model, by branch and bound.

    The narrowest level comes first, whose best points are good ones of the wider levels too.

    `model_error` (T, m) bounds the model's distance from the exact motion. `gap` is the wanted
    difference of proved and reached bounds in units of `scale` (m,), `budget` the most boxes for a
    bound, on average.

    Raises:
        BisectionError: The gap is not above twice the model error and rounding.
    """
    direct = direct_error_in_steps(model)
    model, error = model.in_units(scale), model_error / scale
    rounding = Remainder(model, *model.boxes.unit_ends(0)).margin[..., 0]
    # so that rounding does not lift the gap above what was asked for
    least_gap = float((2 * error + rounding).max())
    search_gap = (1 - 1e-6) * gap - least_gap
    if search_gap <= 0:
        what = f"rounding and errors of the modes, {least_gap:.3g}, pass the gap of {gap:.3g}"
        raise BisectionError(what, "take the method dual, a shorter duration or a wider gap")
    levels, of_levels = len(model.boxes.alpha), list[tuple[Optima, Array, int]]()
    for level in reversed(range(levels)):
        tick = subprogress(progress, len(of_levels) / levels, (len(of_levels) + 1) / levels)
        lower, upper = model.boxes.unit_ends(level)
        optima = first_optima(model, lower, upper, numbers.NEWTON_GAP * search_gap)
        if of_levels:  # what the level inside attains is attained here too
            inside = of_levels[-1][0]
            better = inside.value > optima.value
            optima.value[better], optima.point[better] = inside.value[better], inside.point[better]
        proved, used = enclosed(
            *(model, lower, upper, optima),
            gap=search_gap,
            budget=budget,
            workers=workers,
            progress=tick,
        )
        LOG.debug("branch and bound: level %g took %d boxes", model.boxes.alpha[level], used)
        of_levels.append((optima, proved, used))
    error_between = _error_between_nodes(model, error, direct=direct / scale)
    between = (_line_deviation(model) + error_between) * scale
    facts = {
        "model_error": float(error.max()),
        "degree": model.degree,
        "boxes": sum(used for *_, used in of_levels) / levels,
        "evaluations": 1 / levels,
    }
    shape, bounds, outer = (*error.shape, 2), list[BoxBounds](), np.full(2 * error.size, np.inf)
    shares = np.broadcast_to(tail_shares(model), (*shape[1:], len(model.boxes.names)))
    for optima, proved, _ in reversed(of_levels):
        outer = np.minimum(outer, proved)  # what holds on a wider level holds on those inside it
        inner = optima.value.reshape(shape) - (error + rounding)[..., None]
        bounds.append(
            BoxBounds(
                outer=(outer.reshape(shape) + error[..., None]) * scale[:, None],
                inner=inner * scale[:, None],
                at=model.boxes.to_physical(optima.point.reshape(*shape, -1)),
                between=between,
                shares=shares,
                attained_error=2 * (error + rounding) * scale,
                facts=facts,
            )
        )
    return bounds


def _line_deviation(model: ModalModel) -> Array:
    """Bound of how far outputs lie beyond both their values in the step to each node, (T, m).

    Where no force jumps, it bounds how far they stray from a straight line there.
    """
    reach, rate = np.ones(len(model.boxes.names)), model.eigenvalue
    growth, spread = largest_growth(rate, reach), rate.imag.deviation()
    decay = -growth, rate.real.deviation() - rate.value.real  # least and greatest of each mode
    omega = np.abs(rate.value.imag) - spread, np.abs(rate.value.imag) + spread
    if (omega[0] <= 0).any():
        raise UnprovedError("a mode may not oscillate", "take less damping")
    grids = list[Array]()
    for k in range(model.count):
        q = min(decay[0][k] / w[k] for w in omega), max(decay[1][k] / w[k] for w in omega)
        along_omega = np.linspace(omega[0][k], omega[1][k], int(numbers.DEVIATION_POINTS))
        grids.append(np.multiply.outer(-np.linspace(*q, 3) + 1j, along_omega))
    responses = list[Response]()
    for part in motion_parts(model, growth):
        load = None if part.load is None else part.load.history
        spreads = 2 * np.stack([part.share.real.deviation(), part.share.imag.deviation()], 1)
        # of a load itself by the first mode's share
        of_modes = [None] if isinstance(part.load, Direct) else grids
        for k, sigma in enumerate(of_modes):
            shape = (1, 1) if sigma is None else sigma.shape
            kappa = np.multiply.outer(2 * part.share.value[k], np.ones(shape))
            responses.append(Response(sigma, load, 0, kappa, spreads[k]))
    by_magnitude = np.sum([x.line_deviation(model.flow.time) for x in responses], axis=0)
    straying = narrowed_straying(responses, model.flow.time, by_magnitude)
    return narrowed_at_jumps(responses, model.flow.time, straying)


def _error_between_nodes(model: ModalModel, error: Array, *, direct: Array) -> Array:
    """Bound of what the model's error in the step to a node exceeds its smaller end by, (T, m).

    Args:
        model: The model.
        error: Bound of its error at nodes, shape (T, m).
        direct: Bound of the part of the error within the step to each node that is in what forces
            add to outputs at once, shape (T, m); it may be zero at the nodes.
    """
    # All but that part decays no faster than exp(g t), g < 0 the least growth rate: within a step
    # of length h it is at most exp(−g h) times what it is at the end.
    exponent = largest_growth(model.eigenvalue, np.ones(len(model.boxes.names)))
    swell = float(np.exp(np.maximum(-exponent, 0.0).max() * model.flow.step))
    added = np.zeros_like(error)
    within = swell * np.maximum(error[1:], error[:-1]) + direct[1:]
    added[1:] = within - np.minimum(error[1:], error[:-1])
    return added


def tail_shares(model: ModalModel) -> Array:
    """Return each input's fraction of the terms of highest degree, about its part in the error."""
    index = model.eigenvalue.exponents  # of the terms, (terms, d)
    top = index.sum(1) == model.degree
    weight = np.zeros(len(index))
    for polynomials in (model.eigenvalue, model.coefficient):
        size = np.abs(polynomials.coefficients).reshape(len(index), -1)
        weight += (size / np.maximum(size.max(0), 1e-300)).max(1)
    shares = weight[top] @ index[top]
    return np.asarray(shares / max(float(shares.sum()), 1e-300))


def _max_degree(d: int) -> int:
    degree = int(numbers.MAX_DEGREE)
    while comb(d + degree, d) > numbers.MAX_TERMS:
        degree -= 1
    return degree
