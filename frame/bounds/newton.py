"""Local optima of an envelope's bounds: Newton's method with a trust region, for many at a time.

A problem is an output at a node on a side; its best point so far is the inner bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.frame import numbers
from alphacut.frame.calculus.box_quadratic import gain, global_maximum, local_maximum
from alphacut.frame.modes.modal_model import ModalModel
from alphacut.fuzzy.arrays import Array, Ints
from alphacut.fuzzy.sets.boxes import chebyshev_points

BOX_WIDTH = 2.0
"""Width of the unit box [−1, 1]^d."""


@dataclass(eq=False)
class Optima:
    """Best points so far of N problems: of each node, output and side (−1, +1), in this order."""

    point: Array  # unit coordinates, (N, d)
    value: Array  # side × output there, (N,)


def first_optima(model: ModalModel, lower: Array, upper: Array, least_gain: float) -> Optima:
    """Local optima of all problems over a box.

    Each begins at the best of the centre and Chebyshev points, and is refined by Newton's method
    until that predicts a gain below `least_gain`, in units of the outputs.
    """
    samples = chebyshev_points(len(lower), int(numbers.NEWTON_SAMPLES))
    unit = np.vstack([np.zeros((1, len(lower))), samples])
    pool = (lower + upper) / 2 + (upper - lower) / 2 * unit
    values = np.concatenate([model.values(pool[k : k + 64]) for k in range(0, len(pool), 64)])
    values = values.reshape(len(pool), -1)
    best = np.stack([values.argmin(0), values.argmax(0)], 1).ravel()
    optima = Optima(pool[best], np.stack([-values.min(0), values.max(0)], 1).ravel())
    if (upper > lower).any():
        refine(model, optima, np.arange(len(best)), lower, upper, least_gain)
    return optima


def refine(
    model: ModalModel, optima: Optima, which: Ints, lower: Array, upper: Array, least_gain: float
) -> None:
    """Improve the optima in rows `which` by Newton's method in a box, in place.

    A problem ends when its quadratic model predicts a gain of at most `least_gain`.
    """
    size = max(int(numbers.NEWTON_PIECE) * 6 // max(lower.size, 6), 1)
    for piece in np.array_split(which, -(-len(which) // size) or 1):
        _newton(model, optima, piece, lower, upper, least_gain)


def _newton(
    model: ModalModel, optima: Optima, which: Ints, lower: Array, upper: Array, least_gain: float
) -> None:
    radius: Array = np.full(len(which), numbers.NEWTON_RADIUS)
    f, g, H = _signed(model, optima.point[which], which)
    for count in range(int(numbers.NEWTON_STEPS)):
        low = np.maximum(lower - optima.point[which], -radius[:, None])
        high = np.minimum(upper - optima.point[which], radius[:, None])
        step = (
            local_maximum(g, H, low, high, rounds=2)
            if count < numbers.NEWTON_LOCAL_STEPS
            else global_maximum(g, H, low, high)
        )
        predicted = gain(g, H, step)
        at_edge = np.abs(step).max(1, initial=0.0) >= 0.999 * radius
        # at the edge of the region, a parabola would gain as much more in the whole box
        growth = np.where(at_edge, np.minimum((BOX_WIDTH / radius) ** 2, 1e3), 1.0)
        open_ = predicted * growth > least_gain
        if not open_.all():
            which, radius, step, predicted, g, H = (
                x[open_] for x in (which, radius, step, predicted, g, H)
            )
        if not len(which):
            return
        trial = np.clip(optima.point[which] + step, lower, upper)
        f, trial_g, trial_H = _signed(model, trial, which)
        actual_gain = f - optima.value[which]
        better = actual_gain > 0
        optima.point[which[better]], optima.value[which[better]] = trial[better], f[better]
        g[better], H[better] = trial_g[better], trial_H[better]
        ratio = actual_gain / predicted
        expansion = np.where(np.abs(ratio - 1) < numbers.NEWTON_SOUND, 5, 2)
        wider, narrower = np.minimum(expansion * radius, BOX_WIDTH), 0.3 * np.abs(step).max(1)
        radius = np.where(ratio > 0.75, wider, np.where(ratio < 0.25, narrower, radius))


def _signed(model: ModalModel, points: Array, which: Ints) -> tuple[Array, Array, Array]:
    """Side × output (W,), its gradient and Hessian, of problems `which` at their points (W, d)."""
    node, column = np.divmod(which, 2 * len(model.flow.outputs))
    f, g, H = model.at(points, node, column // 2)
    side = 2.0 * (column % 2) - 1
    return side * f, side[:, None] * g, side[:, None, None] * H
