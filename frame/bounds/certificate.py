"""Certified envelopes: for every node, level and output an attained bound and a proved one."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np

from alphacut.frame.bounds.branch_and_bound import enclosed
from alphacut.frame.bounds.newton import Optima, first_optima
from alphacut.frame.bounds.remainder import Remainder, largest_growth, parts, suprema
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.polynomial import Polynomial
from alphacut.frame.modes.modal_model import ModalModel
from alphacut.frame.response.load_tables import Direct
from alphacut.fuzzy.progress_bar import Progress, subprogress

LOG = logging.getLogger(__name__)

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
    """Bound of the interpolation error of the model's outputs in the step to each node, (T, m)."""
    # h²/8 times |q̈|, h/4 times a kink where a load jumps; of outputs that a load feeds, its own
    reach, h = np.ones(len(model.boxes.names)), model.flow.step
    rate, growth = suprema(model.eigenvalue, reach)[0], largest_growth(model.eigenvalue, reach)
    curve = np.zeros((len(model.time), len(model.outputs)))
    kink = np.zeros_like(curve)
    feedthrough = np.zeros_like(curve)
    for part in parts(model, growth):
        size = suprema(part.share, reach)[0].reshape(model.count, -1)
        if isinstance(part.load, Direct):
            feedthrough += 2 * part.load.history.line_deviation(model.time)[:, None] * size.sum(0)
            continue
        wave = part.waves[0].copy()
        if part.load is not None:  # R'' = λ² R + λ a + a', and a' acts on Σ C_k alone
            # within a step a wave is at most exp(|g| h) times what it is at the end
            wave *= np.exp(np.maximum(-growth, 0.0) * h)
            largest_load, slope = part.load.history.extremes
            jump = max((x for _, x in part.load.history.jumps), default=0.0)
            coefficient_sum = Polynomial(
                part.share.index,
                2 * part.share.coefficients.reshape(-1, model.count, curve.shape[1]).sum(1).real,
            )
            curve += 2 * largest_load * rate @ size + slope * suprema(coefficient_sum, reach)[0]
            kink += jump * suprema(coefficient_sum, reach)[0]
        wave[1:] = np.maximum(wave[1:], wave[:-1])
        curve += 2 * (wave * rate**2) @ size
    deviation: Array = h**2 / 8 * curve + h / 4 * kink + feedthrough
    deviation[0] = 0.0
    return deviation


def _growth(model: ModalModel, margin: Array) -> Array:
    """Bound of what the model's error in the step to a node exceeds its smaller end by, (T, m)."""
    # it decays no faster than exp(g t): inside it is at most exp(−g h) times what it is at the end
    exponent = largest_growth(model.eigenvalue, np.ones(len(model.boxes.names)))
    swell = float(np.exp(np.maximum(-exponent, 0.0).max() * model.flow.step))
    added = np.zeros_like(margin)
    added[1:] = swell * np.maximum(margin[1:], margin[:-1]) - np.minimum(margin[1:], margin[:-1])
    return added
