"""Newton's method with a trust region in a box, for many problems together."""

from __future__ import annotations

import numpy as np

from alphacut.frame.calculus.box_quadratic import gain, global_maximum, local_maximum
from alphacut.frame.calculus.jet import Array
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.optima import Optima, Response, best_of, trajectories
from alphacut.fuzzy.arrays import Rows
from alphacut.fuzzy.progress_bar import Progress, subprogress
from alphacut.fuzzy.sets.boxes import chebyshev_points

SAMPLES = 256
"""Trajectories of the model that the first optima begin at."""
MAX_PIECE = 6000
"""Most problems solved together, of six inputs; more would leave the cache."""
MIN_PIECE = 250
"""Problems below which a piece costs more than it saves."""
LOCAL_STEPS = 6
"""Newton steps by local maxima of the quadratic models; problems that need more lie on ridges, and
their models are maximised over all faces of the box."""
FIRST_RADIUS = 0.4
"""First radius of the trust region, in unit coordinates."""
SOUND = 0.1
"""Relative error of a predicted gain up to which the radius grows five times in place of twice."""
BOX_WIDTH = 2.0
"""Width of the unit box [−1, 1]^d."""
ITERATIONS = 300
"""Newton steps after which a problem that has not converged is left as it is."""


def first_optima(
    model: ModalModel,
    lower: Array,
    upper: Array,
    least_gain: float,
    unit: Array | None = None,
    progress: Progress | None = None,
    nodes: Rows | None = None,
) -> Optima:
    """Local optima of all outputs, on both sides, at nodes over the box [lower, upper].

    Each begins at the best point of a sample of the box and is refined by Newton's method.

    Args:
        model: The modal model.
        lower: Lower ends, shape (d,).
        upper: Upper ends.
        least_gain: Predicted gain below which Newton's method stops, in units of the outputs.
        unit: The sample in [−1, 1]^d, shape (n, d); the centre and Chebyshev points unless given.
        progress: Called with the completed fraction.
        nodes: Indices of the nodes, shape (J,); all of the model unless given.
    """
    nodes = np.arange(len(model.time)) if nodes is None else nodes
    if unit is None:
        unit = np.vstack([np.zeros((1, len(lower))), chebyshev_points(len(lower), SAMPLES)])
    points = (lower + upper) / 2 + (upper - lower) / 2 * unit
    optima = best_of(points, trajectories(model, points, nodes), nodes)
    if (upper > lower).any():
        refine(model, optima, np.arange(len(optima.value)), lower, upper, least_gain, progress)
    return optima


def refine(
    model: Response,
    optima: Optima,
    which: Array,
    lower: Array,
    upper: Array,
    least_gain: float,
    progress: Progress | None = None,
) -> None:
    """Improve the optima in rows `which` by Newton's method in a box, in place.

    A problem ends when its quadratic model predicts a gain of at most `least_gain`.
    """
    half_of_all = -(-len(which) // 2)
    size = min(MAX_PIECE * 6 // max(lower.size, 6), max(MIN_PIECE, half_of_all))
    pieces = np.array_split(which, -(-len(which) // size) or 1)
    for done, piece in enumerate(pieces):
        tick = subprogress(progress, done / len(pieces), (done + 1) / len(pieces))
        _newton(model, optima, piece, lower, upper, least_gain, tick)


def _newton(
    model: Response,
    optima: Optima,
    which: Array,
    lower: Array,
    upper: Array,
    least_gain: float,
    tick: Progress,
) -> None:
    """Improve the optima in rows `which` by Newton's method with a trust region, in place.

    A problem ends when its quadratic model predicts a gain of at most `least_gain` without the
    trust region. The gain predicted last is kept in `optima.predicted_gain`.
    """
    n_problems = len(which)
    radius: Array = np.full(n_problems, FIRST_RADIUS)
    f, g, H = _signed(model, optima, optima.point[which], which)
    correction = np.zeros_like(H)  # of H, by secants of the gradient
    for count in range(ITERATIONS):
        low = np.maximum(lower - optima.point[which], -radius[:, None])
        high = np.minimum(upper - optima.point[which], radius[:, None])
        step = (
            local_maximum(g, H, low, high, rounds=2)
            if count < LOCAL_STEPS
            else global_maximum(g, H, low, high)
        )
        predicted = gain(g, H, step)
        optima.predicted_gain[which] = predicted
        at_edge = np.abs(step).max(1, initial=0.0) >= 0.999 * radius
        # at the edge of the region, a parabola would gain as much more in the whole box
        growth = np.where(at_edge, np.minimum((BOX_WIDTH / radius) ** 2, 1e3), 1.0)
        open_ = predicted * growth > least_gain
        if not open_.all():
            which, radius, step, predicted, g, H, correction = (
                x[open_] for x in (which, radius, step, predicted, g, H, correction)
            )
        tick(1 - len(which) / max(n_problems, 1))
        if not len(which):
            return
        trial = np.clip(optima.point[which] + step, lower, upper)
        step = trial - optima.point[which]
        f, g2, H2 = _signed(model, optima, trial, which)
        if model.secant:
            H2 += correction
            update = _symmetric_rank_one(H2, step, g2 - g)
            for x in (correction, H, H2):
                x += update
        actual_gain = f - optima.value[which]
        better = actual_gain > 0
        optima.point[which[better]], optima.value[which[better]] = trial[better], f[better]
        g[better], H[better] = g2[better], H2[better]
        ratio = actual_gain / predicted
        expansion = np.where(np.abs(ratio - 1) < SOUND, 5, 2)
        wider, narrower = np.minimum(expansion * radius, BOX_WIDTH), 0.3 * np.abs(step).max(1)
        radius = np.where(ratio > 0.75, wider, np.where(ratio < 0.25, narrower, radius))


def _symmetric_rank_one(H: Array, step: Array, change: Array) -> Array:
    """Symmetric rank-one updates y yᵀ / (y·s) to add to Hessians H (N, d, d), y = change − H s.

    `change` (N, d) is that of the gradient over the step s (N, d). An update is zero where it would
    be unstable, |y·s| being small beside |y| |s|.
    """
    y = change - (H @ step[..., None])[..., 0]
    product = (y * step).sum(1)
    size = np.sqrt((y**2).sum(1) * (step**2).sum(1))
    is_stable = np.abs(product) > 1e-6 * size
    scaled = y / np.where(is_stable, product, 1.0)[:, None] * is_stable[:, None]
    return np.asarray(y[:, :, None] * scaled[:, None, :])


def _signed(
    model: Response, optima: Optima, points: Array, which: Array
) -> tuple[Array, Array, Array]:
    """Side × output (W,), its gradient and Hessian, of problems `which` at their points (W, d)."""
    side = optima.side[which]
    f, g, H = model.at(points, optima.node[which], optima.output[which])
    H *= side[:, None, None]
    return side * f, side[:, None] * g, H
