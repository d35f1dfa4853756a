"""Pruning of a box: of each input, the end of its range that cannot hold a higher peak.

The half or quarter of an input's range that lies away from the best inputs found is bounded by the
models at hand. Where no bound there exceeds the peak, that end is pruned (domain reduction by
probing: Tawarmalani, Sahinidis 2002). What remains is narrower in many inputs at once, and the
remainders of models that are expanded anew there fall with the fourth power of the widths.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.frame import numbers
from alphacut.frame.bounds.level import LevelModels, OutputBounds
from alphacut.frame.bounds.node_bounds import response_and_gradient


class PrunedBox(NamedTuple):
    """What remains of the box [−1, 1]^d for one peak, and bounds over what was pruned."""

    low: Array  # lower ends of what remains, (d,)
    high: Array  # upper ends
    upper: Array  # upper bounds at the given nodes over all that is pruned, (J,); −inf for nothing
    gap_fractions: Array  # fraction of the gap that each input accounts for, (d,)


def prune_ends(level: LevelModels, bounds: OutputBounds, above: Ints) -> PrunedBox:
    """Prune ends of the box [−1, 1]^d that hold no peak above the incumbent by more than the gap.

    For each input, bounds are computed over a quarter or a half of its range, at the end away from
    the best inputs found. Where the bound exceeds `bounds.attained`, the incumbent, by at most
    `bounds.wanted_gap` at every node, that end cannot hold a peak that is worth a search, and is
    pruned.

    Args:
        level: Models over the box.
        bounds: Bounds of one side of one output over the box. Not changed.
        above: Indices of the J ≥ 1 time nodes whose bounds exceed incumbent + gap, shape (J,).

    Returns:
        `low` and `high`, ends of what remains, shape (d,), −1 and 1 where nothing is pruned;
        `upper`, bounds over all that is pruned at the nodes `above`, shape (J,), −inf if that is
        nothing; and `gap_fractions`, the estimated fraction of the gap that each input accounts
        for, shape (d,).

    Raises:
        UnprovedError: Numbers of the models over a piece exceed the range of the dual function.
    """
    highest_node = int(above[bounds.upper[above].argmax()])
    best_inputs = bounds.model_inputs[highest_node]
    low = -np.ones_like(best_inputs)
    high = np.ones_like(best_inputs)
    pruned_upper = np.full(len(above), -np.inf)
    # The first pass bounds each end by one cell of the modes' ranges, which is cheap. The second
    # tries the ends that are left with many cells.
    for max_cells in (1, numbers.PRUNING_CELLS):
        for i in range(len(best_inputs)):
            if high[i] - low[i] < 2.0:  # pruned before
                continue
            prunes_upper_end = best_inputs[i] <= 0
            # A quarter of the range is tried first, and half of it if that can be pruned.
            for fraction in (0.25, 0.5):
                end = 1 - 2 * fraction if prunes_upper_end else 2 * fraction - 1
                piece_low = low.copy()
                piece_high = high.copy()
                if prunes_upper_end:
                    piece_low[i] = end
                else:
                    piece_high[i] = end
                piece = level.on_subbox(piece_low, piece_high)
                piece_upper = _bounds_over_piece(piece, bounds, above, max_cells=max_cells)
                if piece_upper.max() > bounds.attained + bounds.wanted_gap:
                    break
                pruned_upper = np.maximum(pruned_upper, piece_upper)
                if prunes_upper_end:
                    high[i] = end
                else:
                    low[i] = end
    gap_fractions = remainder_addition(bounds, highest_node).input_fractions
    return PrunedBox(low, high, pruned_upper, gap_fractions)


def _bounds_over_piece(
    piece: LevelModels, bounds: OutputBounds, above: Ints, *, max_cells: int
) -> Array:
    """Return upper bounds of one side of one output over a piece of the box, shape (J,).

    They begin at the bounds over the whole box, which hold there, too. Nodes are bounded in the
    order of these, the largest first, until one stays above `bounds.attained` +
    `bounds.wanted_gap`: then the piece cannot be pruned, and later nodes keep the bounds of the
    whole box.

    Args:
        piece: Models over the piece.
        bounds: Bounds over the whole box. Not changed.
        above: Indices of the time nodes, shape (J,).
        max_cells: Most ranges of the modes' frequencies and decays into which the piece is divided
            at a node.

    Raises:
        UnprovedError: Numbers of the models exceed the range of the dual function.
    """
    output, side = bounds.index
    inside = OutputBounds.initial(piece, output, side, bounds.wanted_gap, bounds.attained)
    inside.upper[:] = bounds.upper
    effort = inside.effort(max_cells, numbers.PRUNING_STEPS, slack_below_peak=1.0)
    for node in above[np.argsort(-bounds.upper[above])]:
        inside.improve(np.array([node]), effort)
        if inside.upper[node] > bounds.attained + bounds.wanted_gap:
            break
    return inside.upper[above]


class RemainderAddition(NamedTuple):
    """What the remainders of Taylor models add to a bound."""

    total: float  # lower estimate of the addition, in the unit of the output
    input_fractions: Array  # fraction of it that each input accounts for, (d,)


def remainder_addition(bounds: OutputBounds, node: int) -> RemainderAddition:
    """Estimate what Taylor remainders add to the bound at a node, and which inputs cause it.

    At the minimum of the dual function its multipliers are the slopes of the response by the
    variables z of the modes (frequency, decay, participation factors), and the bound contains Σ
    |slope_z| R_z with the remainders R_z of z as polynomials of the inputs. Remainders are of
    fourth degree in the inputs. Each R_z is distributed over the inputs in proportion to the
    squares of their coefficients of first and second degree in z.

    Args:
        bounds: Bounds of one side of one output over a box of d inputs, and the inputs at which the
            model is largest at each node.
        node: Index of the time node.

    Returns:
        `total`, a lower estimate of the addition in the unit of the output, with the constants of
        the bound; and `input_fractions`, the fraction that each input accounts for, shape (d,),
        which add up to 1, or are 0 if nothing is added.
    """
    data = bounds.data
    d = data.linear.shape[1]
    slope = np.zeros(len(data.linear))  # of the response by each intervening variable
    response_and_gradient(bounds.model_inputs[node], node, bounds.side, data, slope)

    # The quadratic coefficients are packed by rows i ≤ j; each counts for both of its inputs.
    upper_triangle = np.zeros((len(slope), d, d))
    row, column = np.triu_indices(d)
    upper_triangle[:, row, column] = np.abs(data.quadratic)
    of_inputs = np.abs(data.linear) + upper_triangle.sum(axis=1) + upper_triangle.sum(axis=2)
    weights = of_inputs**2

    by_variable = np.abs(slope) * data.remainder
    by_input = (by_variable / np.maximum(weights.sum(axis=1), 1e-300)) @ weights
    return RemainderAddition(
        total=float(bounds.constant[1, node] + by_variable.sum()),
        input_fractions=np.asarray(by_input / max(float(by_input.sum()), 1e-300)),
    )
