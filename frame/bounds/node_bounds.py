"""Bounds at nodes: best-first bisection of the modes' frequencies and damping, with dual bounds.

Where the bound at a node is too far above a value of the model, the cell of the modes' tables with
the largest bound is halved: ranges of the few ω and g/ω of a mode, not of the many inputs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.kernels import compiled
from alphacut.frame.bounds.dual_function import (
    Data,
    add,
    data_without_modes,
    dot,
    loops,
    minimise,
    products,
)

GRID = 2.0**24
"""Steps of the model's ascent in unit coordinates, so that rounding does not lead it elsewhere."""


class Effort(NamedTuple):
    """Effort that a node is worth."""

    cells: int  # most cells
    steps: int  # most evaluations of the dual function for a cell
    # addition to the wanted gap of a node below the peak, as a fraction of its distance from the
    # peak; at 1 only bounds above the peak count
    slack_below_peak: float
    # least gap worth any effort, as a multiple of what the remainders of the Taylor models add to
    # the bound
    remainder_multiple: float
    wanted_gap: float  # distance of bound and model value that suffices
    incumbent: float  # the largest reached value of side × output over time
    patience: int  # steps of `minimise` after which less is expected
    ascents: int  # most steps of the model's ascent
    grace: int  # cells after which the fall of the gap counts
    min_progress: float  # least fall of the gap, as a fraction of an even fall to what suffices


class Cells(NamedTuple):
    """Parts of the modes' tables with their dual bounds, at most `Effort.cells` of them."""

    ends: Ints  # first and last point along ω and along q = g/ω of each mode's table, (…, K, 4)
    mu: Array  # multipliers μ, (…, Z)
    # |μ_z| times the distance of variable z between the inputs of the maxima over the tables and
    # over the box in D(μ), (…, Z)
    disagreement: Array
    value: Array  # upper bounds D(μ) over the cells, (…,)


@compiled
def bound_nodes(
    nodes: Ints, side: float, effort: Effort, constants: Array, data: Data, out: Array, at: Array
) -> None:
    """Write upper bounds of side × output at rising time nodes (J,), each begun from the last.

    At each node the output's dual function D(μ), see `dual_function`, is minimised over cells of
    the modes' tables, and the cell of the largest bound is halved until that is near a value of the
    model: best-first bisection of the ranges of the modes' ω and q = g/ω.

    `constants` (2, T) are added to the model's value for the motion's, and to both for the bound.
    Written are `out` (2, J), bounds of side × output and the model's values of it, and `at` (J, L),
    the inputs of the latter.
    """
    max_cells, Z = effort.cells, len(data.linear)
    cells = Cells(
        np.zeros((max_cells, len(data.share), 4), np.int64),
        np.zeros((max_cells, Z)),
        np.zeros((max_cells, Z)),
        np.zeros(max_cells),
    )
    mu, u = np.zeros(Z), np.zeros(data.linear.shape[1])  # of undivided tables; of the model's value
    for j in range(len(nodes)):
        node, constant = nodes[j], constants[:, nodes[j]]
        cells.ends[0], cells.mu[0], cells.value[0] = data.ends.astype(np.int64), mu, np.inf
        model_value = ascend(u, node, side, data, effort.ascents)
        target = target_value(model_value, 0.0, effort, constant)
        model_value = bound_cell(0, node, side, data, effort, target, cells, model_value, u)
        mu[:] = cells.mu[0]
        least_gap = effort.remainder_multiple * (constant[1] + dot(np.abs(mu), data.remainder))
        count, first_bound = 1, cells.value[0]
        while count < max_cells:
            worst = int(np.argmax(cells.value[:count]))
            target = target_value(model_value, least_gap, effort, constant)
            fall = (first_bound - target) * effort.min_progress * count / max_cells
            falls_slowly = count >= effort.grace and cells.value[worst] > first_bound - fall
            if cells.value[worst] <= target or falls_slowly:
                break
            if not halve_cell(cells, worst, count):
                break
            for half in (worst, count):
                model_value = bound_cell(
                    half, node, side, data, effort, target, cells, model_value, u
                )
            count += 1
        out[0, j] = cells.value[:count].max() + constant[0] + constant[1]
        out[1, j] = model_value + constant[0]
        at[j] = u


def call_bound_nodes() -> None:
    """Call `bound_nodes` once without a node; see `KernelThreads`."""
    none, data = np.zeros((2, 0)), data_without_modes()
    effort = Effort(
        cells=0,
        steps=0,
        slack_below_peak=0.0,
        remainder_multiple=0.0,
        wanted_gap=0.0,
        incumbent=0.0,
        patience=0,
        ascents=0,
        grace=0,
        min_progress=0.0,
    )
    bound_nodes(np.zeros(0, np.int64), 1.0, effort, none, data, none, np.zeros((0, 0)))


@compiled
def target_value(model_value: float, least_gap: float, effort: Effort, constant: Array) -> float:
    """Value of the dual function at which a node's bound is as tight as asked for."""
    below_peak = max(0.0, effort.incumbent - model_value - constant[0])
    gap = max(effort.wanted_gap, least_gap) + effort.slack_below_peak * below_peak
    return model_value + gap - constant[1]


@compiled
def bound_cell(
    cell: int,
    node: int,
    side: float,
    data: Data,
    effort: Effort,
    target: float,
    cells: Cells,
    model_value: float,
    u: Array,
) -> float:
    """Improve the dual bound of a cell; return the largest model value so far, at inputs `u`."""
    here, steps, patience = np.empty(len(u)), effort.steps, effort.patience
    ends, mu, disagreement = cells.ends[cell], cells.mu[cell], cells.disagreement[cell]
    value = minimise(
        mu, ends, node, side, data, steps, patience, target, model_value, disagreement, here
    )
    cells.value[cell] = min(value, cells.value[cell])
    if cells.value[cell] > target or cell == 0:
        new_value = ascend(here, node, side, data, effort.ascents)
        if new_value > model_value:
            model_value = new_value
            u[:] = here
    return model_value


@compiled
def halve_cell(cells: Cells, halved: int, count: int) -> bool:
    """Halve a cell along the ω, or g by q = g/ω, of largest disagreement (see `Cells`).

    The cell keeps the lower half, and number `count` becomes the upper one. Returns False where no
    range of ω or q has a point of its table between its ends.
    """
    ends, disagreement = cells.ends[halved], cells.disagreement[halved]
    n_variables = len(disagreement) // len(ends)  # of a mode: ω, g and its amplitudes
    largest, mode, axis = 0.0, -1, 0
    for k in range(len(ends)):
        for direction in range(2):  # ω and q
            n_intervals = ends[k, 2 * direction + 1] - ends[k, 2 * direction]
            of_variable = disagreement[k * n_variables + direction]
            if n_intervals >= 2 and of_variable > largest:
                largest, mode, axis = of_variable, k, direction
    if mode < 0:
        return False
    middle = (ends[mode, 2 * axis] + ends[mode, 2 * axis + 1]) // 2
    cells.ends[count], cells.mu[count] = ends, cells.mu[halved]
    cells.value[count] = cells.value[halved]
    cells.ends[halved, mode, 2 * axis + 1] = middle
    cells.ends[count, mode, 2 * axis] = middle
    return True


@loops
def model_and_gradient(u: Array, node: int, side: float, data: Data, gradient: Array) -> float:
    """Side × output in the model at inputs u (L,), without its constants; `gradient` is written."""
    bilinear, slopes = np.empty(data.quadratic.shape[1]), np.zeros(len(data.linear))
    products(u, bilinear)
    total = response_and_gradient(u, node, side, data, slopes)
    gradient[:] = 0.0
    quadratic = np.zeros(len(bilinear))  # of the linearised response, packed by rows i ≤ j
    for a in range(len(slopes)):
        add(gradient, slopes[a], data.linear[a])
        add(quadratic, slopes[a], data.quadratic[a])
    for s in range(len(data.truncated_linear)):  # truncated modes
        wave = side * data.truncated_response[s, node]
        total += wave * (
            dot(data.truncated_linear[s], u) + dot(data.truncated_quadratic[s], bilinear)
        )
        add(gradient, wave, data.truncated_linear[s])
        add(quadratic, wave, data.truncated_quadratic[s])
    at = 0
    for i in range(len(u)):
        for j in range(i, len(u)):
            gradient[i] += quadratic[at] * u[j]
            gradient[j] += quadratic[at] * u[i]
            at += 1
    return total


@loops
def response_and_gradient(u: Array, node: int, side: float, data: Data, slopes: Array) -> float:
    """Sum of the modes' responses, side × output, in the model at inputs u (L,).

    `slopes` (Z,) is written: its gradient by all scaled intervening variables.
    """
    bilinear, z = np.empty(data.quadratic.shape[1]), np.empty(len(data.linear))
    products(u, bilinear)
    for v in range(len(z)):
        z[v] = dot(data.linear[v], u) + dot(data.quadratic[v], bilinear)
    slopes[:] = 0.0
    total, width, sources = 0.0, int(data.points[0]), data.share.shape[1]
    for k in range(len(data.share)):  # by bilinear interpolation in the table of mode k
        first = k * (2 + sources)  # of its variables: ω, g and amplitudes
        w = data.centre[k, 0] + data.radius[k, 0] * z[first]
        g = data.centre[k, 1] + data.radius[k, 1] * z[first + 1]
        x = min(max((w - data.start[k, 0]) / data.step[k, 0], 0.0), width - 1.000001)
        y = min(max((g / w - data.start[k, 1]) / data.step[k, 1], 0.0), data.points[1] - 1.000001)
        i, j = int(x), int(y)
        x, y = x - i, y - j
        at = j * width + i
        for s in range(sources):
            e = data.table[k, s, node]
            a, b, c, f = e[at], e[at + 1], e[at + width], e[at + width + 1]  # corners
            value = side * ((1 - y) * ((1 - x) * a + x * b) + y * ((1 - x) * c + x * f))
            along = side * ((1 - y) * (b - a) + y * (f - c)) / data.step[k, 0]
            across = side * ((1 - x) * (c - a) + x * (f - b)) / data.step[k, 1]
            amplitude = data.share[k, s] + data.reach[k, s] * z[first + 2 + s]
            total += amplitude * value
            slopes[first] += amplitude * (along - across * g / w**2) * data.radius[k, 0]
            slopes[first + 1] += amplitude * across / w * data.radius[k, 1]
            slopes[first + 2 + s] = value * data.reach[k, s]
    return total


@loops
def ascend(u: Array, node: int, side: float, data: Data, steps: int) -> float:
    """Raise the model's side × output from inputs u (L,), which are written; return its value.

    It is a projected gradient ascent over [−1, 1]^L with steps by Barzilai and Borwein (1988).
    """
    d = len(u)
    slope, trial, trial_slope, point = np.empty(d), np.empty(d), np.empty(d), u.copy()
    value = model_and_gradient(u, node, side, data, slope)
    size = 0.3 / (np.abs(slope).max() + 1e-300)
    for _ in range(steps):
        for i in range(d):
            trial[i] = np.rint(GRID * min(max(point[i] + size * slope[i], -1.0), 1.0)) / GRID
        new = model_and_gradient(trial, node, side, data, trial_slope)
        along = bend = 0.0
        for i in range(d):
            step = trial[i] - point[i]
            along += step * step
            bend += step * (slope[i] - trial_slope[i])
        if along < 1e-8:
            break
        if new < value - 0.02 * abs(value):
            size *= 0.3
            continue
        size = along / bend if bend > 0 else 4 * size
        point[:], slope[:] = trial, trial_slope
        if new > value:
            value = new
            u[:] = point
    return value
