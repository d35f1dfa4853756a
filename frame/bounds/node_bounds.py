"""Bounds at nodes: best-first bisection of the modes' frequencies and damping, with dual bounds.

A cell is a range of the table of each mode, that is of its ω and q = g/ω. Where the bound at a node
is too far above a value of the model, the cell with the largest bound is halved along the ω or q of
one mode: few ranges, where the inputs are many.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.kernels import compiled
from alphacut.frame.bounds.dual_function import (
    DualFunctionData,
    add,
    dot,
    loops,
    minimise,
    products,
)
from alphacut.frame.numbers import CELL_GRACE, MIN_CELL_PROGRESS, PATIENCE


class Effort(NamedTuple):
    """Effort that a node is worth."""

    cells: int  # most cells
    steps: int  # most evaluations of the dual function for a cell
    # addition to the wanted gap of a node below the peak, as a fraction of its distance from the
    # peak; at 1 only bounds above the peak count
    slack_below_peak: float
    # smallest gap worth any effort, as a multiple of what the remainders of the Taylor models add
    # to the bound
    remainder_multiple: float
    wanted_gap: float  # distance of bound and model value that suffices
    incumbent: float  # the largest attained value of side × output over time
    ascents: int  # most steps of the model's ascent


class Cells(NamedTuple):
    """Cells of the modes' tables with their dual bounds, at most `Effort.cells` of them."""

    # first and last point along ω, then along q = g/ω, of each mode's table, (cells, K, 4)
    ends: Ints
    mu: Array  # multipliers μ, (cells, Z)
    disagreement: Array  # of the variables for these multipliers, see `minimise`, (cells, Z)
    value: Array  # upper bounds D(μ) over the cells, (cells,)


@compiled
def bound_nodes(
    nodes: Ints,
    side: float,
    effort: Effort,
    constants: Array,
    data: DualFunctionData,
    out: Array,
    at: Array,
) -> None:
    """Write upper bounds of side × output at rising time nodes (J,).

    At each node the dual function D(μ), see `dual_function`, is minimised over cells of the modes'
    tables, and the cell of the largest bound is halved until that is near a value of the model. The
    bound at the node is the largest over its cells. Each node begins at the multipliers and inputs
    of the one before.

    Args:
        nodes: Numbers of the time nodes.
        side: −1 or 1.
        effort: What a node is worth.
        constants: What is added to the model value for the response, and to that sum for the bound,
            shape (2, T).
        data: Models and tables.
        out: Overwritten with the bounds, and with the model's values of side × output at the best
            inputs found, shape (2, J).
        at: Overwritten with these inputs, shape (J, L).
    """
    max_cells = effort.cells
    variables = len(data.linear)
    cells = Cells(
        np.zeros((max_cells, len(data.participation), 4), np.int64),
        np.zeros((max_cells, variables)),
        np.zeros((max_cells, variables)),
        np.zeros(max_cells),
    )
    mu = np.zeros(variables)  # of undivided tables
    u = np.zeros(data.linear.shape[1])  # inputs of the model value
    for j in range(len(nodes)):
        node = nodes[j]
        constant = constants[:, node]
        cells.ends[0] = data.cell.astype(np.int64)
        cells.mu[0] = mu
        cells.value[0] = np.inf
        model_value = ascend(u, node, side, data, effort.ascents)
        target = target_value(model_value, 0.0, effort, constant)
        model_value = bound_cell(0, node, side, data, effort, target, cells, model_value, u)
        mu[:] = cells.mu[0]
        of_remainders = constant[1] + dot(np.abs(mu), data.remainder)
        min_gap = effort.remainder_multiple * of_remainders
        count = 1
        first_bound = cells.value[0]
        while count < max_cells:
            worst = int(np.argmax(cells.value[:count]))
            target = target_value(model_value, min_gap, effort, constant)
            even_fall = (first_bound - target) * MIN_CELL_PROGRESS * count / max_cells
            falls_slowly = cells.value[worst] > first_bound - even_fall
            if cells.value[worst] <= target or (count >= CELL_GRACE and falls_slowly):
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


@compiled
def target_value(model_value: float, min_gap: float, effort: Effort, constant: Array) -> float:
    """Return the value of the dual function at which a node's bound is as tight as asked for.

    A node whose model value lies below the largest attained one, the incumbent, may have a wider
    gap: by `slack_below_peak` times the distance.

    Args:
        model_value: Largest known value of side × output in the model, without its constants.
        min_gap: Smallest gap worth any effort.
        effort: `wanted_gap`, `incumbent` and `slack_below_peak`.
        constant: Two numbers. The first is the part of the response that no input changes, which
            model value and dual function leave out; the second is added to the bound alone.
    """
    below_peak = max(0.0, effort.incumbent - model_value - constant[0])
    gap = max(effort.wanted_gap, min_gap) + effort.slack_below_peak * below_peak
    return model_value + gap - constant[1]


@compiled
def bound_cell(
    cell: int,
    node: int,
    side: float,
    data: DualFunctionData,
    effort: Effort,
    target: float,
    cells: Cells,
    model_value: float,
    u: Array,
) -> float:
    """Improve the dual bound of one cell at a time node; return the largest model value so far.

    A cell is a range of each mode's table of responses over frequency and decay. The row `cell` of
    `cells` is changed in place: its bound `value` never rises, its multipliers `mu` and the
    `disagreement` of its variables are overwritten. Where the bound stays above the target, and
    always in cell 0, an ascent looks for inputs with a larger model value.

    Args:
        cell: Index of the cell.
        node: Index of the time node.
        side: −1 or 1.
        data: Models and tables of the output; they are read only.
        effort: Limits of the work: at most `steps` evaluations in the minimisation of the bound,
            which takes shorter steps after some of them without enough progress, and at most
            `ascents` steps of the ascent.
        target: Value of the dual function at which its minimisation ends.
        cells: All cells; `ends` of this one must be set, and `mu` is where the minimisation begins.
        model_value: Largest value of side × output in the model that is known before.
        u: Inputs at which it is attained, shape (L,); overwritten where a larger one is found.
    """
    inputs = np.empty(len(u))
    bound = minimise(
        cells.mu[cell],
        cells.ends[cell],
        node,
        side,
        data,
        effort.steps,
        PATIENCE,
        target,
        model_value,
        cells.disagreement[cell],
        inputs,
    )
    cells.value[cell] = min(bound, cells.value[cell])
    if cells.value[cell] > target or cell == 0:
        new_value = ascend(inputs, node, side, data, effort.ascents)
        if new_value > model_value:
            model_value = new_value
            u[:] = inputs
    return model_value


@compiled
def halve_cell(cells: Cells, halved: int, count: int) -> bool:
    """Halve a cell along the ω or q = g/ω on which both maxima of D(μ) disagree most.

    The first maximum of the dual function is at a point of each mode's table, the second at inputs
    u, and the bound is sharp where the frequencies ω and decays g of both agree. The cell keeps the
    lower half, and cell number `count` becomes the upper one, with the same multipliers and bound;
    both are changed in place. The point in the middle belongs to both.

    Args:
        cells: Cells with `ends`, first and last point along ω, then q, of each of K modes, shape
            (cells, K, 4), and `disagreement` of the variables, mode by mode ω, g, participation
            factors, shape (cells, Z). Other numbers in its place halve a cell where they are
            largest.
        halved: Index of the cell.
        count: Number of cells so far, which is the index of the new one; it must be below the
            length of the arrays.

    Returns:
        False, with nothing changed, where no range with a disagreement has a point between its
        ends.
    """
    ends = cells.ends[halved]
    disagreement = cells.disagreement[halved]
    n_variables = len(disagreement) // len(ends)  # of a mode: ω, g and its participation factors
    largest = 0.0
    mode = -1
    axis = 0
    for k in range(len(ends)):
        for direction in range(2):  # ω and q
            n_intervals = ends[k, 2 * direction + 1] - ends[k, 2 * direction]
            of_variable = disagreement[k * n_variables + direction]
            if n_intervals >= 2 and of_variable > largest:
                largest = of_variable
                mode = k
                axis = direction
    if mode < 0:
        return False
    middle = (ends[mode, 2 * axis] + ends[mode, 2 * axis + 1]) // 2
    cells.ends[count] = ends
    cells.mu[count] = cells.mu[halved]
    cells.value[count] = cells.value[halved]
    cells.ends[halved, mode, 2 * axis + 1] = middle
    cells.ends[count, mode, 2 * axis] = middle
    return True


@loops
def model_and_gradient(
    u: Array, node: int, side: float, data: DualFunctionData, gradient: Array
) -> float:
    """Return side × output in the model at inputs u, without its constants, and its gradient.

    The model takes frequencies, decays and participation factors of the modes as quadratic
    polynomials z of the inputs, responses by bilinear interpolation in tables, and truncated modes
    as a quadratic. The constants, its terms that no input changes, are those of truncated modes.

    Args:
        u: Inputs in [−1, 1], shape (L,).
        node: Index of the time node.
        side: −1 or 1.
        data: `linear` (Z, L) and `quadratic` (Z, L (L + 1)/2) coefficients of z, the latter packed
            by rows i ≤ j; `truncated_response` (terms, T), by which `truncated_linear` and
            `truncated_quadratic`, coefficients in the same order, are multiplied; and the tables
            that `response_and_gradient` reads.
        gradient: Overwritten with the derivatives by the inputs, shape (L,).
    """
    u_products = np.empty(data.quadratic.shape[1])
    slopes = np.zeros(len(data.linear))  # by the intervening variables
    products(u, u_products)
    total = response_and_gradient(u, node, side, data, slopes)

    # Linear and quadratic coefficients in u of the response that is linear in these variables.
    gradient[:] = 0.0
    quadratic = np.zeros(len(u_products))
    for z in range(len(slopes)):
        add(gradient, slopes[z], data.linear[z])
        add(quadratic, slopes[z], data.quadratic[z])
    for s in range(len(data.truncated_linear)):
        response = side * data.truncated_response[s, node]
        total += response * (
            dot(data.truncated_linear[s], u) + dot(data.truncated_quadratic[s], u_products)
        )
        add(gradient, response, data.truncated_linear[s])
        add(quadratic, response, data.truncated_quadratic[s])
    at = 0
    for i in range(len(u)):
        for j in range(i, len(u)):
            gradient[i] += quadratic[at] * u[j]
            gradient[j] += quadratic[at] * u[i]
            at += 1
    return total


@loops
def response_and_gradient(
    u: Array, node: int, side: float, data: DualFunctionData, slopes: Array
) -> float:
    """Return the sum of the modes' responses, side × output, in the model at inputs u.

    Z variables z, scaled to [−1, 1], are quadratic polynomials of u: for each of K modes its
    frequency ω, its decay g, and a participation factor for each source. Responses to unit sources
    are interpolated bilinearly in tables over ω and q = g/ω; beyond a table its edge is taken.

    Args:
        u: Inputs in [−1, 1], shape (L,).
        node: Index of the time node.
        side: −1 or 1.
        data: `linear` and `quadratic` coefficients of z; `midpoint` and `radius` of ω and g, shape
            (K, 2); `participation` and `participation_radius`, shape (K, sources); `table`, shape
            (K, sources, T, points) with ω running fastest; `grid_start`, `grid_step` along ω and q,
            shape (K, 2), and `grid_points`, shape (2,).
        slopes: Overwritten with the derivatives of the sum by z, shape (Z,).
    """
    u_products = np.empty(data.quadratic.shape[1])
    z = np.empty(len(data.linear))  # scaled intervening variables at u
    products(u, u_products)
    for v in range(len(z)):
        z[v] = dot(data.linear[v], u) + dot(data.quadratic[v], u_products)
    slopes[:] = 0.0
    total = 0.0
    width = int(data.grid_points[0])  # points of a row of a table, along ω
    sources = data.participation.shape[1]
    for k in range(len(data.participation)):
        first = k * (2 + sources)  # ω of the mode, then g and the participation factors
        omega = data.midpoint[k, 0] + data.radius[k, 0] * z[first]
        g = data.midpoint[k, 1] + data.radius[k, 1] * z[first + 1]
        # Place (x, y) along ω and q = g/ω in steps of the grid, inside the table's last cell at
        # most; then the cell (i, j), and the place in it.
        x = min(max((omega - data.grid_start[k, 0]) / data.grid_step[k, 0], 0.0), width - 1.000001)
        y = (g / omega - data.grid_start[k, 1]) / data.grid_step[k, 1]
        y = min(max(y, 0.0), data.grid_points[1] - 1.000001)
        i = int(x)
        j = int(y)
        x = x - i
        y = y - j
        at = j * width + i
        for s in range(sources):
            e = data.table[k, s, node]
            a = e[at]
            b = e[at + 1]
            c = e[at + width]
            f = e[at + width + 1]
            value = side * ((1 - y) * ((1 - x) * a + x * b) + y * ((1 - x) * c + x * f))
            by_omega = side * ((1 - y) * (b - a) + y * (f - c)) / data.grid_step[k, 0]
            by_q = side * ((1 - x) * (c - a) + x * (f - b)) / data.grid_step[k, 1]
            amplitude = (
                data.participation[k, s] + data.participation_radius[k, s] * z[first + 2 + s]
            )
            total += amplitude * value
            # dq = dg/ω − g dω/ω²
            slopes[first] += amplitude * (by_omega - by_q * g / omega**2) * data.radius[k, 0]
            slopes[first + 1] += amplitude * by_q / omega * data.radius[k, 1]
            slopes[first + 2 + s] = value * data.participation_radius[k, s]
    return total


@loops
def ascend(u: Array, node: int, side: float, data: DualFunctionData, steps: int) -> float:
    """Raise side × output in the model by moving the inputs u, in place; return its value there.

    It is a projected gradient ascent over the box [−1, 1]^L with the step lengths of Barzilai and
    Borwein (1988). Any inputs give a valid lower bound of the model's maximum, so that it need not
    converge. The value never falls below that at the given inputs, which stay where no better ones
    are found.

    Args:
        u: Inputs to begin at, shape (L,); overwritten with the best ones.
        node: Index of the time node.
        side: −1 or 1.
        data: Models and tables of the output, as `model_and_gradient` takes them; they are read
            only.
        steps: Most evaluations after the first; 0 leaves u as it is.
    """
    # Inputs are rounded to multiples of 1/grid, so that their path does not depend on rounding.
    grid = 2.0**24
    d = len(u)
    slope = np.empty(d)
    trial = np.empty(d)
    trial_slope = np.empty(d)
    point = u.copy()
    value = model_and_gradient(u, node, side, data, slope)
    # The numbers of this ascent, such as the first step of at most 0.3 in each input, are tuned.
    length = 0.3 / (np.abs(slope).max() + 1e-300)
    for _ in range(steps):
        for i in range(d):
            trial[i] = np.rint(grid * min(max(point[i] + length * slope[i], -1.0), 1.0)) / grid
        new_value = model_and_gradient(trial, node, side, data, trial_slope)
        squared_step = 0.0
        bend = 0.0  # step · (fall of the slope)
        for i in range(d):
            step = trial[i] - point[i]
            squared_step += step * step
            bend += step * (slope[i] - trial_slope[i])
        if squared_step < 1e-8:
            break
        # The value may fall a little in between; where it falls more, the step is shortened.
        if new_value < value - 0.02 * abs(value):
            length *= 0.3
            continue
        length = squared_step / bend if bend > 0 else 4 * length
        point[:] = trial
        slope[:] = trial_slope
        if new_value > value:
            value = new_value
            u[:] = point
    return value
