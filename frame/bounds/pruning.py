"""Pruning of a box: of each input, the end of its range that cannot hold a higher peak.

The half or quarter of an input's range that lies away from the best inputs found is bounded by the
models at hand. Where no bound lies above the peak, that end is pruned (domain reduction by probing:
Tawarmalani, Sahinidis 2002). What remains is narrower in many inputs at once, and the remainders of
models that are expanded anew there fall with the fourth power of the widths.
"""

from __future__ import annotations

import numpy as np

from alphacut.frame.bounds.level import LevelModels, OutputBounds
from alphacut.frame.bounds.slabs import response_and_gradient
from alphacut.fuzzy.arrays import Array, Rows

ENDS = (0.25, 0.5)
"""Shares of an input's range that are tried, the second where the first can be pruned."""
EFFORTS = (1, 24)
"""Slabs of a bound over an end."""
STEPS = 40
"""Evaluations of the dual function for each slab."""


def prune_ends(
    level: LevelModels,
    problem: OutputBounds,
    bound_index: tuple[int, int],
    above: Rows,
    best: Array,
) -> tuple[Array, Array, Array]:
    """Prune ends of the box [−1, 1]^d over which no bound exceeds the peak by more than the gap.

    An end is a quarter or a half of one input's range, on the side away from the best input.

    Args:
        level: Models over the box.
        problem: Bounds of one output and side over the box.
        bound_index: Number of the output, and 0 for −output or 1 for the output.
        above: Indices of the nodes whose bounds exceed the peak, shape (J,).
        best: Coordinates of the best inputs found, shape (d,).

    Returns:
        Lower and upper ends of what remains, (d,) each, and upper bounds at these nodes over all
        that is pruned, (J,).
    """
    low, high = -np.ones_like(best), np.ones_like(best)
    pruned = np.full(len(above), -np.inf)
    for slabs in EFFORTS:
        for i in range(len(best)):
            prune_upper = best[i] <= 0
            for fraction in ENDS if high[i] - low[i] == 2.0 else ():  # not pruned before
                piece_low, piece_high = low.copy(), high.copy()
                end = 1 - 2 * fraction if prune_upper else 2 * fraction - 1
                (piece_low if prune_upper else piece_high)[i] = end
                piece = piece_low, piece_high
                bounds = _over_piece(level, problem, bound_index, above, piece, slabs)
                if bounds.max() > problem.attained + problem.wanted_gap:
                    break
                pruned = np.maximum(pruned, bounds)
                (high if prune_upper else low)[i] = end
    return low, high, pruned


def _over_piece(
    level: LevelModels,
    problem: OutputBounds,
    bound_index: tuple[int, int],
    above: Rows,
    piece: tuple[Array, Array],
    slabs: int,
) -> Array:
    """Upper bounds of one output and side over a piece of the box at nodes `above`, shape (J,).

    `piece` are its lower and upper ends, (d,) each; `bound_index` is the output's number, and 0 for
    −output or 1. The largest bounds are improved first, by at most `slabs` slabs each, until one
    stays above the peak; the others are those of the box, in `problem`.
    """
    inside = OutputBounds.initial(
        level.within(*piece), *bound_index, problem.wanted_gap, problem.attained
    )
    inside.out[0] = problem.out[0]
    for node in above[np.argsort(-problem.out[0, above])]:
        inside.run(np.array([node]), slabs, STEPS, 1.0, 0.0)
        if inside.out[0, node] > problem.attained + problem.wanted_gap:
            break
    return np.asarray(inside.out[0, above])


def remainder(problem: OutputBounds, node: int) -> tuple[float, Array]:
    """Least addition of the Taylor remainders to a bound at a node, and each input's part in it.

    Returns:
        The addition, in the output's unit, and fractions of it, shape (d,), whose sum is 1.

    At the maximum the multipliers are the slopes of the motion by the intervening variables.
    Remainders are of fourth degree: they are shared out by the squares of what the first and second
    degree of each variable have of an input.
    """
    data, d = problem.data, problem.data.linear.shape[1]
    slope = np.zeros(len(data.linear))  # of the response by each intervening variable
    response_and_gradient(problem.at[node], node, problem.side, data, slope)
    upper = np.zeros((len(slope), d, d))
    upper[(slice(None), *np.triu_indices(d))] = np.abs(data.quadratic)
    size = (np.abs(data.linear) + upper.sum(1) + upper.sum(2)) ** 2
    by_input = np.abs(slope) * data.remainder
    shares = (by_input / np.maximum(size.sum(1), 1e-300)) @ size
    least = float(problem.constant[1, node] + by_input.sum())
    return least, np.asarray(shares / max(float(shares.sum()), 1e-300))
