"""Certified envelopes: for every node, level and output an attained bound and a proved one."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np

from alphacut.frame.bounds.branch_and_bound import enclosed
from alphacut.frame.bounds.newton import Optima, first_optima
from alphacut.frame.bounds.remainder import Remainder, largest_growth, parts, suprema
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.modal_model import ModalModel
from alphacut.frame.response.load_tables import Direct
from alphacut.frame.response.straying import line_deviations
from alphacut.fuzzy.progress_bar import Progress, subprogress

LOG = logging.getLogger(__name__)

POINTS = (24, 3)
"""Points along ω and g/ω of each mode at which its straying from lines between nodes is read."""
NEWTON_GAP = 0.02
"""Share of the gap that Newton's method may leave."""


@dataclass(frozen=True, eq=False)
class Certificate:
    """Enclosure of an envelope.

    Args:
        bounds: Attained upper bounds of (−output, output), less the model error and rounding, shape
            (A, T, m, 2).
        at: Their unit coordinates, shape (A, T, m, 2, d).
        outer: Proved upper bounds, shape (A, T, m, 2).
        between: Bound of what each output exceeds both ends of the step to a node by, shape (T, m),
            in its unit.
        attained_error: What the trajectories at `at` may exceed `bounds` by, shape (T, m).
        boxes: Boxes of parameters looked at.
    """

    bounds: Array
    at: Array
    outer: Array
    between: Array
    attained_error: Array
    boxes: int


def certify(
    model: ModalModel,
    *,
    gap: float,
    model_error: Array,
    scale: Array,
    workers: int = 1,
    budget: float = 4000,
    progress: Progress | None = None,
) -> Certificate:
    """Attained and proved bounds of every output at each node and level, by branch and bound.

    The narrowest level comes first, whose best points are good ones of the wider levels too.

    Args:
        model: The modal model.
        gap: Wanted difference between proved and attained bound, in units of the reference output.
        model_error: Bound of the difference between the modal model and the trajectories, shape (T,
            m).
        scale: Factor on the gap for each output, shape (m,).
        workers: Threads.
        budget: Most boxes per bound on average.
        progress: Called with the fraction done.

    Raises:
        ValueError: The model error alone exceeds the gap.
    """
    model, error = model.in_units(scale), model_error / scale
    rounding = Remainder(model, *model.boxes.unit(0)).margin[..., 0]
    # so that rounding does not lift the gap above what was asked for
    least_gap = float((2 * error + rounding).max())
    search_gap = (1 - 1e-6) * gap - least_gap
    if search_gap <= 0:
        raise ValueError(
            f"certify: the gap {gap:.3g} is not above twice the model error, {least_gap:.3g}; ask"
            " for a wider gap or a lower tolerance"
        )
    levels, of_levels = len(model.boxes.alpha), list[tuple[Optima, Array, int]]()
    for level in reversed(range(levels)):
        tick = subprogress(progress, len(of_levels) / levels, (len(of_levels) + 1) / levels)
        lower, upper = model.boxes.unit(level)
        optima = first_optima(model, lower, upper, NEWTON_GAP * search_gap)
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
    shape = (levels, *error.shape, 2)
    inner = np.stack([optima.value for optima, *_ in of_levels[::-1]]).reshape(shape)
    at = np.stack([optima.point for optima, *_ in of_levels[::-1]]).reshape(*shape, -1)
    outer = np.stack([proved for _, proved, _ in of_levels[::-1]]).reshape(shape)
    # what holds on a wider box holds on those inside it
    outer = np.minimum.accumulate(outer, axis=0) + error[..., None]
    between = _between(model) + _growth(model, error)
    return Certificate(
        bounds=(inner - (error + rounding)[..., None]) * scale[:, None],
        at=at,
        outer=outer * scale[:, None],
        between=between * scale,
        attained_error=2 * (error + rounding) * scale,
        boxes=sum(used for *_, used in of_levels),
    )


def _between(model: ModalModel) -> Array:
    """Bound of how far outputs stray from straight lines in the step to each node, (T, m)."""
    reach, rate = np.ones(len(model.boxes.names)), model.eigenvalue
    growth, spread = largest_growth(rate, reach), rate.imag.spread()
    decay = -growth, rate.real.spread() - rate.value.real  # least and greatest of each mode
    omega = np.abs(rate.value.imag) - spread, np.abs(rate.value.imag) + spread
    if (omega[0] <= 0).any():
        raise UnprovedError("a mode may not oscillate", "take less damping")
    deviation = np.zeros((len(model.time), len(model.outputs)))
    for part in parts(model, growth):
        size = suprema(part.share, reach)[0]
        load = None if part.load is None else part.load.history
        if isinstance(part.load, Direct):
            deviation += 2 * part.load.history.line_deviation(model.time)[:, None] * size.sum(0)
            continue
        for k in range(model.count):
            q = min(decay[0][k] / w[k] for w in omega), max(decay[1][k] / w[k] for w in omega)
            points = [np.linspace(omega[0][k], omega[1][k], POINTS[0]), np.linspace(*q, POINTS[1])]
            sigma = (-points[1][:, None] + 1j) * points[0]
            bent = line_deviations(sigma, load, model.time, 0)[0]
            deviation += 2 * np.outer(bent, size[k])
    return deviation


def _growth(model: ModalModel, margin: Array) -> Array:
    """Bound of what the model's error in the step to a node exceeds its smaller end by, (T, m)."""
    # it decays no faster than exp(g t): inside it is at most exp(−g h) times what it is at the end
    exponent = largest_growth(model.eigenvalue, np.ones(len(model.boxes.names)))
    swell = float(np.exp(np.maximum(-exponent, 0.0).max() * model.flow.step))
    added = np.zeros_like(margin)
    added[1:] = swell * np.maximum(margin[1:], margin[:-1]) - np.minimum(margin[1:], margin[:-1])
    return added
