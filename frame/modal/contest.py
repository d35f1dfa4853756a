"""Contests of the optima on either side of a jump of the envelope's parameters."""

from __future__ import annotations

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.modal.newton import refine
from alphacut.frame.modal.optima import Optima, Response


def contest(
    model: Response, found: Optima, lower: Array, upper: Array, small: float, rounds: int = 20
) -> None:
    """Refine either optimum at both nodes of a jump, until no jump moves or the rounds are over.

    Args:
        model: The modal model.
        found: All problems, node by node, which keep what is better.
        lower: Lower ends of the box, shape (d,).
        upper: Upper ends.
        small: Gain that Newton's method leaves.
        rounds: Most rounds.
    """
    grid = np.arange(len(found.value)).reshape(-1, 2 * len(model.outputs))
    open_ = np.ones(len(found.value), bool)
    for _ in range(rounds):
        moved: list[Array] = []
        for here, there in (
            (grid[1:].ravel(), grid[:-1].ravel()),
            (grid[:-1].ravel(), grid[1:].ravel()),
        ):
            apart = np.abs(found.point[here] - found.point[there]).max(1)
            jump = (apart > 0.05 * (upper - lower).max()) & (open_[here] | open_[there])
            if jump.any():
                moved.append(_contested(model, found, here[jump], there[jump], lower, upper, small))
        open_[:] = False
        if moved:
            open_[np.concatenate(moved)] = True
        if not open_.any():
            return


def _contested(
    model: Response,
    found: Optima,
    here: Array,
    there: Array,
    lower: Array,
    upper: Array,
    small: float,
) -> Array:
    """Refine the optima of `there` as rivals of those of `here`; which of these improved."""
    rival = found.take(here)
    rival.point[:] = found.point[there]
    rival.value[:] = rival.side * model.value_at(rival.point, rival.node, rival.output)
    refine(model, rival, np.arange(len(rival.value)), lower, upper, small)
    return found.offer(model, rival.point, here)
