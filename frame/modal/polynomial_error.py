"""How far polynomials may be from trajectories, judged where the envelope touches them."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.modal.fitting import MANY
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.starting_points import fresh_points

MARGIN = 2.0
"""Factor on the deviation of judging trajectories up to a node."""
FLOOR = 0.1
"""Least deviation at a node, as a share of the output's largest."""
FRESH = 256
"""Random points that judge beside the optima and the corners."""
NUMBERS = 4e6
"""Most numbers of the trajectories at optima; of more optima some are drawn."""
PIECE = 256
"""Trajectories computed together."""


def polynomial_error(model: ModalModel) -> Array:
    """Estimated deviation of the model from the trajectories, shape (T, m).

    Judging trajectories are few, so a node takes the largest deviation up to it, and the floor.
    """
    so_far = np.maximum.accumulate(model.error, axis=0)
    return np.asarray(MARGIN * np.maximum(so_far, FLOOR * so_far[-1]))


def judged_at_optima(model: ModalModel, at: Array, seed: int) -> tuple[ModalModel, int]:
    """The model with deviations at all kinds of points that bounds come from in its error.

    These are the optima of every value, level, output and side, the corners of the box, where
    polynomials are worst, and fresh points.

    Args:
        model: The polynomials.
        at: Unit coordinates of the optima, shape (…, d).
        seed: Of what is drawn.

    Returns:
        The model, and the number of points.
    """
    points = judging_points(at, model.error.size, np.random.default_rng((seed, 11)))
    wrong = model.error
    for piece in np.array_split(points, -(-len(points) // PIECE)):
        truth = model.flow.values(model.boxes.to_physical(piece))
        wrong = np.maximum(wrong, np.abs(model.values(piece) - truth).max(0))
    return replace(model, error=wrong), len(points)


def judging_points(at: Array, size: int, rng: np.random.Generator) -> Array:
    """Different optima out of `at` (…, d), corners and fresh points, shape (S, d).

    Args:
        at: Unit coordinates, shape (…, d).
        size: Numbers T m of one trajectory.
        rng: Draws optima where there are too many, and the fresh points.
    """
    d = at.shape[-1]
    optima = np.unique(np.round(at.reshape(-1, d), 2), axis=0)
    most = int(max(NUMBERS / size, FRESH))
    ends = np.ones(d)
    corners = np.array(list(product((-1.0, 1.0), repeat=d))) if d <= MANY else np.empty((0, d))
    fresh = fresh_points(rng, -ends, ends, FRESH)
    return np.vstack([np.clip(rng.permutation(optima)[:most], -1, 1), corners, fresh])
