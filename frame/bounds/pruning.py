"""Pruning of a box: of each input, the end of its range that cannot hold a higher peak.

The half or quarter of an input's range that lies away from the best inputs found is bounded by the
models at hand. Where no bound lies above the peak, that end is pruned (domain reduction by probing:
Tawarmalani, Sahinidis 2002). What remains is narrower in many inputs at once, and the remainders of
models that are expanded anew there fall with the fourth power of the widths.
"""

from __future__ import annotations

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.frame import numbers
from alphacut.frame.bounds.level import LevelModels, OutputBounds
from alphacut.frame.bounds.node_bounds import response_and_gradient

FRACTIONS = (0.25, 0.5)
"""Fractions of an input's range that are tried, the second where the first can be pruned."""


def prune_ends(
    level: LevelModels, bounds: OutputBounds, above: Ints
) -> tuple[Array, Array, Array, Array]:
    """Prune ends of the box [−1, 1]^d over which no bound exceeds the peak by more than the gap.

    Args:
        level: Models over the box.
        bounds: Bounds of one output and side over the box.
        above: Nodes whose bounds exceed the peak, shape (J,).

    Returns:
        Lower and upper ends of what remains, (d,) each; upper bounds at these nodes over all that
        is pruned, (J,), −inf if nothing is; and each input's share in the gap, (d,).
    """
    highest = int(above[bounds.out[0, above].argmax()])
    best = bounds.at[highest]
    low, high = -np.ones_like(best), np.ones_like(best)
    pruned = np.full(len(above), -np.inf)
    limit = bounds.reached + bounds.wanted_gap
    for cells in (1, int(numbers.PRUNING_CELLS)):
        for i in range(len(best)):
            prune_upper = best[i] <= 0
            for fraction in FRACTIONS if high[i] - low[i] == 2.0 else ():  # not pruned before
                end = 1 - 2 * fraction if prune_upper else 2 * fraction - 1
                piece_low, piece_high = low.copy(), high.copy()
                (piece_low if prune_upper else piece_high)[i] = end
                piece = level.on_subbox(piece_low, piece_high)
                inside = OutputBounds.initial(
                    piece, *bounds.index, bounds.wanted_gap, bounds.reached
                )
                inside.out[0] = bounds.out[0]
                effort = inside.effort(cells, int(numbers.PRUNING_STEPS), slack_below_peak=1.0)
                for node in above[np.argsort(-bounds.out[0, above])]:  # the largest bound first
                    inside.improve(np.array([node]), effort)
                    if inside.out[0, node] > limit:
                        break
                over_piece = inside.out[0, above]
                if over_piece.max() > limit:
                    break
                pruned = np.maximum(pruned, over_piece)
                (high if prune_upper else low)[i] = end
    return low, high, pruned, remainder_addition(bounds, highest)[1]


def remainder_addition(bounds: OutputBounds, node: int) -> tuple[float, Array]:
    """Return what Taylor remainders add to a bound at least, and the inputs' fractions of it, (d,).

    At the maximum the multipliers are the slopes of the motion by the intervening variables.
    Remainders are of fourth degree: they are shared out by the squares of what the first and second
    degree of each variable have of an input.
    """
    data, d = bounds.data, bounds.data.linear.shape[1]
    slope = np.zeros(len(data.linear))  # of the response by each intervening variable
    response_and_gradient(bounds.at[node], node, bounds.side, data, slope)
    upper = np.zeros((len(slope), d, d))
    upper[(slice(None), *np.triu_indices(d))] = np.abs(data.quadratic)
    size = (np.abs(data.linear) + upper.sum(1) + upper.sum(2)) ** 2
    by_variable = np.abs(slope) * data.remainder
    shares = (by_variable / np.maximum(size.sum(1), 1e-300)) @ size
    least = float(bounds.constant[1, node] + by_variable.sum())
    return least, np.asarray(shares / max(float(shares.sum()), 1e-300))
