"""Newton's method with a trust region in a box, for many problems together."""

from __future__ import annotations

import numpy as np

from alphacut.frame.calculus.box_quadratic import gain, global_maximum, local_maximum
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.low_discrepancy import chebyshev_points
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.optima import Optima, Response, best_of, trajectories
from alphacut.fuzzy.arrays import Rows
from alphacut.fuzzy.progress_bar import Progress, subprogress

SAMPLES = 256
"""Trajectories of the model that the first optima begin at."""
PIECE = 6000
"""Problems treated together; more would leave the cache."""
LEAST = 250
"""Problems below which a piece costs more than it saves."""
USUAL = 6
"""Newton steps after which quadratic models are maximised over all faces: the rest is on ridges."""
FIRST_RADIUS, SURE = 0.4, 0.1
"""Trust region's first radius; by how much a gain may miss what was promised of a sound model."""
WIDTH = 2.0
"""Of the unit box."""
ITERATIONS = 300
"""Newton steps after which a problem that has not converged is left as it is."""


def first_optima(
    model: ModalModel,
    lower: Array,
    upper: Array,
    small: float,
    unit: Array | None = None,
    progress: Progress | None = None,
    nodes: Rows | None = None,
) -> Optima:
    """Optima of nodes, all outputs and sides in the box [lower, upper], from a sample of it.

    Args:
        model: The modal model.
        lower: Lower ends, shape (d,).
        upper: Upper ends.
        small: What Newton's method may leave, in units of the outputs.
        unit: The sample in [−1, 1]^d, shape (n, d); the centre and Chebyshev points unless given.
        progress: Takes the share done.
        nodes: Indices of the nodes, shape (J,); all of the model unless given.
    """
    nodes = np.arange(len(model.time)) if nodes is None else nodes
    if unit is None:
        unit = np.vstack([np.zeros((1, len(lower))), chebyshev_points(len(lower), SAMPLES)])
    points = (lower + upper) / 2 + (upper - lower) / 2 * unit
    optima = best_of(points, trajectories(model, points, nodes), nodes)
    if (upper > lower).any():
        refine(model, optima, np.arange(len(optima.value)), lower, upper, small, progress)
    return optima


def refine(
    model: Response,
    optima: Optima,
    which: Array,
    lower: Array,
    upper: Array,
    small: float,
    progress: Progress | None = None,
) -> None:
    """Newton's method in the box on `which`, until none promises more than `small`."""
    size = min(PIECE * 6 // max(lower.size, 6), max(LEAST, -(-len(which) // 2)))
    pieces = np.array_split(which, -(-len(which) // size) or 1)
    for done, piece in enumerate(pieces):
        tick = subprogress(progress, done / len(pieces), (done + 1) / len(pieces))
        _newton(model, optima, piece, lower, upper, small, tick)


def _newton(
    model: Response,
    optima: Optima,
    which: Array,
    lower: Array,
    upper: Array,
    small: float,
    tick: Progress,
) -> None:
    """End a problem when its model, not held back by the trust region, promises at most `small`.

    What the models last promised is kept in `optima.left`.
    """
    size = len(which)
    radius: Array = np.full(size, FIRST_RADIUS)
    f, g, H = _signed(model, optima, optima.point[which], which)
    bend = np.zeros_like(H)  # what gradients have shown H to lack
    for count in range(ITERATIONS):
        low = np.maximum(lower - optima.point[which], -radius[:, None])
        high = np.minimum(upper - optima.point[which], radius[:, None])
        step = (
            local_maximum(g, H, low, high, rounds=2)
            if count < USUAL
            else global_maximum(g, H, low, high)
        )
        promised = gain(g, H, step)
        optima.left[which] = promised
        at_edge = np.abs(step).max(1, initial=0.0) >= 0.999 * radius
        # held back, it may promise as much more in the whole box as a parabola does
        open_ = promised * np.where(at_edge, np.minimum((WIDTH / radius) ** 2, 1e3), 1.0) > small
        if not open_.all():
            which, radius, step, promised, g, H, bend = (
                x[open_] for x in (which, radius, step, promised, g, H, bend)
            )
        tick(1 - len(which) / max(size, 1))
        if not len(which):
            return
        trial = np.clip(optima.point[which] + step, lower, upper)
        step = trial - optima.point[which]
        f, g2, H2 = _signed(model, optima, trial, which)
        if model.secant:
            H2 += bend
            lack = _symmetric_rank_one(H2, step, g2 - g)
            for x in (bend, H, H2):
                x += lack
        got = f - optima.value[which]
        better = got > 0
        optima.point[which[better]], optima.value[which[better]] = trial[better], f[better]
        g[better], H[better] = g2[better], H2[better]
        ratio = got / promised
        radius = np.where(
            ratio > 0.75,
            np.minimum(np.where(np.abs(ratio - 1) < SURE, 5, 2) * radius, WIDTH),
            np.where(ratio < 0.25, 0.3 * np.abs(step).max(1), radius),
        )


def _symmetric_rank_one(H: Array, step: Array, change: Array) -> Array:
    """Least correction of Hessians (N, d, d) that explains a change of gradients over a step."""
    lack = change - (H @ step[..., None])[..., 0]
    weight = (lack * step).sum(1)
    size = np.sqrt((lack**2).sum(1) * (step**2).sum(1))
    sound = np.abs(weight) > 1e-6 * size
    scaled = lack / np.where(sound, weight, 1.0)[:, None] * sound[:, None]
    return np.asarray(lack[:, :, None] * scaled[:, None, :])


def _signed(
    model: Response, optima: Optima, points: Array, which: Array
) -> tuple[Array, Array, Array]:
    """Side × output with gradient and Hessian, of problems `which` at points (W, d)."""
    side = optima.side[which]
    f, g, H = model.at(points, optima.node[which], optima.output[which])
    H *= side[:, None, None]
    return side * f, side[:, None] * g, H
