"""The dual function of a Lagrangian relaxation, and its minimisation by deflected subgradients.

An output at a time node is Σ_k F_k(z_k(u)): z_k are the intervening variables of mode k, functions
of the inputs u, and F_k is the response of one oscillator. All z are scaled to [−1, 1] over the
box: z = a·u + u·Q u + cubic terms ± R. For any multipliers μ the maximum over the box of side ×
output, side being −1 or 1, is at most (Geoffrion 1974, Lemaréchal 2001)

    D(μ) = Σ_k max over the mode's table of [ Σ_s c e + |r e − μ_s| − μ_ω ω − μ_g g ]
         + max over u of [ Σ μ (a·u + u·Q u) + truncated modes ] + Σ |μ| R

plus a bound of the cubic terms. D is convex. In the first line e is the response to source s of the
oscillator at a point (ω, g) of the table, and c ± r is the range of its participation factor over
the box, with the multiplier μ_s.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.kernels import compiled, kernel
from alphacut.frame.calculus.unproved import UnprovedError

LARGEST = 1e100
"""Largest magnitude of models, tables and multipliers, so that no sum of their products overflows;
with a larger one the products of three of them could."""


class DualFunctionData(NamedTuple):
    """Models and tables of one side of one output, as the kernels take them.

    There are K modes, T time nodes, L inputs, and Z = K (2 + sources) intervening variables: of
    each mode ω, g and its participation factor for each source, in this order. The table of a mode
    stands on a grid of W values of ω and Q values of q = g/ω; its points are numbered with ω
    running fastest. Quadratic and cubic coefficients are packed by rows, i ≤ j ≤ k.
    """

    table: Array  # responses to a unit participation factor, (K, sources, T, Q W)
    omega: Array  # scaled ω of the tables' points, (K, Q W)
    decay: Array  # scaled g of the tables' points, (K, Q W)
    grid_start: Array  # smallest ω and q of each table, (K, 2)
    grid_step: Array  # distances of its points along ω and q, (K, 2)
    grid_points: Array  # number of points along ω and along q, (2,)
    # first and last point along ω, then along q, that enclose the range of each mode, (K, 4)
    cell: Array
    midpoint: Array  # midpoints of ω and g over the box, (K, 2)
    radius: Array  # radii of ω and g, by which they are scaled, (K, 2)
    participation: Array  # midpoints of the participation factors, (K, sources)
    participation_radius: Array  # radii of the participation factors, (K, sources)
    linear: Array  # linear coefficients of the scaled variables, (Z, L)
    quadratic: Array  # quadratic coefficients, (Z, L (L + 1)/2)
    cubic: Array  # cubic coefficients, (Z, monomials)
    # what the sum of the cubic terms is expected to reach for a multiplier of 1, (Z,)
    expected_cubic: Array
    remainder: Array  # bounds of what the models leave out, with `expected_cubic`, (Z,)
    # midpoints and radii of the responses of truncated modes, in turn, (2 sources, T); (0, 1) if
    # there are none
    truncated_response: Array
    # linear coefficients of their participation factors and amplitudes, in turn, (2 sources, L)
    truncated_linear: Array
    truncated_quadratic: Array  # quadratic coefficients of the same
    multiplier_spacing: Array  # distance of the values that multipliers take, (1,)


def require_in_range(fields: Mapping[str, Array]) -> None:
    """Raise UnprovedError where a number of models or tables is not finite or above `LARGEST`."""
    for name, values in fields.items():
        if not (np.abs(values) <= LARGEST).all():
            raise UnprovedError(f"dual function: {name} is not finite or above {LARGEST:g}")


# The margin for rounding holds for any order of a sum and for fused products, so the compiler may
# use both. NaN and infinity keep their meaning.
loops = kernel(fastmath={"reassoc", "contract"})


@loops
def box_maximum(linear: Array, quadratic: Array, u: Array) -> float:
    """Return an upper bound of linear·u + Σ_{i ≤ j} q_ij u_i u_j over the box [−1, 1]^d.

    The bound is the maximum itself where every input is fixed by its slope or enters alone; else
    products of two free inputs are counted by their magnitudes.

    Args:
        linear: Coefficients of u, shape (d,); not changed.
        quadratic: Coefficients q_ij packed by rows, q_11, q_12, …, q_22, …, shape (d (d + 1)/2,);
            not changed.
        u: Overwritten with a point of the box, shape (d,), at which the function is near the bound.
    """
    d = len(u)
    full = np.empty((d, d))  # q_ij, symmetric
    slope = linear.copy()  # of the function, at the inputs that are fixed so far
    at = 0
    for i in range(d):
        for j in range(i, d):
            full[i, j] = full[j, i] = quadratic[at]
            at += 1
    slack = np.empty(d)  # Σ_j |q_ij| over the inputs j ≠ i that are free
    for i in range(d):
        slack[i] = -abs(full[i, i])
        for j in range(d):
            slack[i] += abs(full[i, j])

    # The derivative by u_i is slope_i + 2 q_ii u_i + Σ_j q_ij u_j over the free j. Where |slope_i|
    # ≥ slack_i + 2 max(−q_ii, 0) it has one sign (or q_ii > 0 and the function is convex in u_i),
    # so the maximum is at an end. Fixing an input changes the slopes of the others.
    is_free = np.ones(d, np.bool_)
    total = 0.0
    has_fixed = True
    while has_fixed:
        has_fixed = False
        for i in range(d):
            if is_free[i] and abs(slope[i]) >= slack[i] + 2 * max(-full[i, i], 0.0):
                is_free[i] = False
                has_fixed = True
                u[i] = 1.0 if slope[i] >= 0 else -1.0
                total += abs(slope[i]) + full[i, i]
                for j in range(d):
                    slope[j] += full[i, j] * u[i]
                    slack[j] -= abs(full[i, j])

    # The parabolas of the free inputs are maximised one by one; products of two free inputs count
    # by magnitude.
    for i in range(d):
        if not is_free[i]:
            continue
        magnitude = abs(slope[i])
        bend = full[i, i]
        u[i] = 1.0 if slope[i] >= 0 else -1.0
        if bend >= 0 or magnitude >= -2 * bend:
            total += magnitude + bend
        else:
            total -= magnitude * magnitude / (4 * bend)
            u[i] *= magnitude / (-2 * bend)
        for j in range(i + 1, d):
            if is_free[j]:
                total += abs(full[i, j])
    return total


@loops
def products(u: Array, out: Array) -> None:
    """Write the products u_i u_j with i ≤ j, packed by rows, to `out`.

    Args:
        u: Inputs, shape (d,).
        out: Overwritten with u_1 u_1, u_1 u_2, …, u_2 u_2, …, shape (d (d + 1)/2,).
    """
    at = 0
    for i in range(len(u)):
        for j in range(i, len(u)):
            out[at] = u[i] * u[j]
            at += 1


@loops
def add(out: Array, factor: float, row: Array) -> None:
    """Add factor × row to `out`, in place."""
    for i in range(len(out)):
        out[i] += factor * row[i]


@loops
def dot(a: Array, b: Array) -> float:
    """Return the scalar product a·b."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@loops
def dual_value(
    mu: Array, cell: Ints, node: int, side: float, data: DualFunctionData, gradient: Array, u: Array
) -> float:
    """Return the dual function D(μ) of side × output at a node, less constants and cubic terms.

    Z = K (2 + S) variables z, scaled to [−1, 1], describe K modes: mode by mode the frequency ω,
    the decay g, and a participation factor for each of S sources. D(μ) has three terms. The first
    is a sum over modes: the maximum of the mode's response minus its Σ μ_z z over a table of ω and
    g. The second is the maximum of Σ μ_z z(u) plus the truncated modes over inputs u in [−1, 1]^L.
    The third is Σ_z |μ_z| R_z.

    Args:
        mu: Multipliers μ, shape (Z,).
        cell: First and last point along ω, then along q = g/ω, of the range of the table of each of
            K modes over which the maximum is taken, shape (K, 4).
        node: Index of the time node.
        side: −1 or 1.
        data: `table`, responses of each mode to unit sources at the points of its table, shape (K,
            S, T, points), where `omega` and `decay` (K, points) are scaled ω and g; `participation`
            ± `participation_radius` (K, S), ranges of the participation factors; `linear` (Z, L)
            and packed `quadratic` (Z, L (L + 1)/2) coefficients of z(u), and `remainder` R (Z,);
            and of terms of truncated modes `truncated_response` (terms, T), by which
            `truncated_linear` and `truncated_quadratic`, coefficients in the same order, are
            multiplied. All numbers, and |μ|, are at most `LARGEST` = 1e100.
        gradient: Overwritten with a subgradient of D, shape (Z,).
        u: Overwritten with inputs near the second maximum, shape (L,).
    """
    modes, sources = data.participation.shape
    gradient[:] = 0.0
    total = 0.0
    values = np.empty(data.omega.shape[1])
    for k in range(modes):
        largest, at = mode_maximum(mu, k, cell[k], node, side, data, values)
        total += largest
        # A subgradient of a maximum is the gradient of the maximand at its maximum.
        first = k * (2 + sources)
        gradient[first] = -data.omega[k, at]
        gradient[first + 1] = -data.decay[k, at]
        for s in range(sources):
            response = data.table[k, s, node, at]
            difference = side * data.participation_radius[k, s] * response - mu[first + 2 + s]
            gradient[first + 2 + s] = -1.0 if difference >= 0 else 1.0

    # The second maximum: linear and packed quadratic coefficients of its argument.
    linear = np.zeros(data.linear.shape[1])
    quadratic = np.zeros(data.quadratic.shape[1])
    for s in range(len(data.truncated_linear)):
        add(linear, side * data.truncated_response[s, node], data.truncated_linear[s])
        add(quadratic, side * data.truncated_response[s, node], data.truncated_quadratic[s])
    for z in range(len(mu)):
        add(linear, mu[z], data.linear[z])
        add(quadratic, mu[z], data.quadratic[z])
    total += box_maximum(linear, quadratic, u)
    u_products = quadratic  # overwritten
    products(u, u_products)
    for z in range(len(mu)):
        total += abs(mu[z]) * data.remainder[z]
        gradient[z] += dot(data.linear[z], u) + dot(data.quadratic[z], u_products)
        gradient[z] += np.sign(mu[z]) * data.remainder[z]
    return total


@loops
def mode_maximum(
    mu: Array, k: int, cell: Ints, node: int, side: float, data: DualFunctionData, values: Array
) -> tuple[float, int]:
    """Return the maximum of one mode's term of D(μ) over a range of its table, and the point of it.

    The term is Σ_s c e + |r e − μ_s| − μ_ω ω − μ_g g, which `maximand` computes at each point.
    Between the points e is taken as bilinear in ω and q, as g = q ω is, and the error of this is
    bounded elsewhere. So the term is convex along each axis, and its maximum over all ω and q that
    the points enclose is that over the points.

    Points of a table are numbered row by row of q = g/ω, with the frequency ω running fastest. Of
    equal values the one of the lowest ω, then of the lowest q, is taken. Loops run over slices from
    0, without which they are not compiled to vector instructions.

    Args:
        mu: Multipliers μ of all modes, shape (Z,).
        k: Index of the mode.
        cell: First and last point along ω, then first and last along q, inclusive, shape (4,).
        node: Index of the time node.
        side: −1 or 1.
        data: Tables and ranges of the participation factors; `grid_points[0]` is the number of
            points along ω.
        values: Scratch, shape (points of the table,).
    """
    count = int(data.grid_points[0])  # points of a row of the table, along ω
    width = cell[1] + 1 - cell[0]
    first = cell[2] * count + cell[0]
    end = cell[3] * count + cell[1] + 1
    maximand(mu, k, first, node, side, data, values[first:end])

    # The maximum over the rows for each ω, then the ω of the largest of these, then its row.
    largest = np.full(width, -1e300)
    for begin in range(first, end, count):
        of_row = values[begin : begin + width]
        for i in range(width):
            largest[i] = of_row[i] if of_row[i] > largest[i] else largest[i]
    column = 0
    for i in range(width):
        column = i if largest[i] > largest[column] else column
    at = first + column
    while values[at] != largest[column]:
        at += count
    return largest[column], at


@loops
def maximand(
    mu: Array, k: int, first: int, node: int, side: float, data: DualFunctionData, values: Array
) -> None:
    """Write one mode's term of D(μ), Σ_s c e + |r e − μ_s| − μ_ω ω − μ_g g, at points of its table.

    With e the response to source s and c ± r the range of its participation factor, times `side`, c
    e + |r e − μ_s| is the maximum of (c + r z) e − μ_s z over z in [−1, 1].

    Args:
        mu: Multipliers of all modes, shape (Z,). Those of mode k begin at k (2 + sources): μ_ω,
            μ_g, then μ_s of each source s.
        k: Index of the mode.
        first: Index of the table point of values[0].
        node: Index of the time node.
        side: −1 or 1.
        data: `omega` and `decay`, scaled ω and g at the table's points, shape (modes, points);
            `table`, responses e, shape (modes, sources, times, points); `participation` c and
            `participation_radius` r, shape (modes, sources). There is at least one source.
        values: Overwritten with the terms at consecutive points, shape (wanted points,).
    """
    sources = data.participation.shape[1]
    end = first + len(values)
    z = k * (2 + sources)
    omega = data.omega[k, first:end]
    decay = data.decay[k, first:end]
    mu_omega = mu[z]
    mu_decay = mu[z + 1]
    for s in range(sources):
        e = data.table[k, s, node, first:end]
        mu_s = mu[z + 2 + s]
        c = side * data.participation[k, s]
        r = side * data.participation_radius[k, s]
        if s == 0:
            for i in range(len(values)):
                values[i] = c * e[i] + abs(r * e[i] - mu_s) - mu_omega * omega[i]
                values[i] -= mu_decay * decay[i]
        else:
            for i in range(len(values)):
                values[i] += c * e[i] + abs(r * e[i] - mu_s)


@loops
def cubic_bound(mu: Array, data: DualFunctionData) -> float:
    """Bound Σ_z μ_z (cubic terms of z) over the box, less the allowance for it in D(μ).

    Each variable z of the modes is a polynomial of the inputs in [−1, 1]. D(μ) contains the
    allowance Σ |μ_z| `expected_cubic[z]` for the cubic terms, which may be too small or too large.
    The result is to be added to D(μ), also if it is negative.

    Args:
        mu: Multipliers, shape (Z,).
        data: `cubic`, the cubic coefficients of each variable, shape (Z, monomials), and
            `expected_cubic`, shape (Z,).
    """
    total = np.zeros(data.cubic.shape[1])
    expected = 0.0
    for z in range(len(mu)):
        add(total, mu[z], data.cubic[z])
        expected += abs(mu[z]) * data.expected_cubic[z]
    return np.abs(total).sum() - expected


@compiled
def minimise(
    mu: Array,
    cell: Ints,
    node: int,
    side: float,
    data: DualFunctionData,
    steps: int,
    patience: int,
    target: float,
    model_value: float,
    disagreement: Array,
    u: Array,
) -> float:
    """Minimise the dual function D(μ) by deflected subgradient steps; return an upper bound.

    The bound, of side × output at the node without constants, is the smallest D(μ) that is met,
    with the bound of the cubic terms. It holds for any μ, so nothing rests on convergence. The
    direction of a step is the subgradient, with a part of the last direction where these oppose
    one another (Camerini, Fratta, Maffioli 1975). Its length aims at an expected value of D (Polyak
    1969); less is expected after `patience` steps that do not bring a third of it.

    Args:
        mu: Multipliers to begin at, shape (Z,); overwritten with the best ones.
        cell: As in `dual_value`, shape (K, 4).
        node: Number of the time node.
        side: −1 or 1.
        data: Models and tables.
        steps: Most evaluations of D.
        patience: As above.
        target: Value of D at which the iteration ends.
        model_value: A value of side × output in the model; D cannot fall below it.
        disagreement: Overwritten, shape (Z,): |μ_z| times the distance between the variable z at
            the table's maximum and z(u), an average over the steps with weights that fall by 0.8.
        u: Overwritten with the inputs of the second maximum for the best multipliers, shape (L,).
    """
    gradient = np.empty(len(mu))
    direction = np.zeros(len(mu))
    best_mu = mu.copy()
    inputs = np.empty(len(u))
    lowest = np.inf
    expected_drop = np.inf
    idle_steps = 0
    disagreement[:] = 0.0
    for _ in range(steps):
        value = dual_value(mu, cell, node, side, data, gradient, inputs)
        for z in range(len(mu)):
            disagreement[z] = 0.8 * disagreement[z] + abs(gradient[z] * mu[z])
        if value < lowest:
            if lowest - value > 0.3 * expected_drop:
                idle_steps = 0
            lowest = value
            best_mu[:] = mu
            u[:] = inputs
        if lowest <= target:
            break
        if expected_drop == np.inf:
            expected_drop = 0.7 * max(lowest - model_value, 0.0)
        idle_steps += 1
        if idle_steps > patience:  # begin again at the best multipliers, with shorter steps
            expected_drop = 0.5 * expected_drop
            idle_steps = 0
            mu[:] = best_mu
            direction[:] = 0.0
            if expected_drop < 0.1 * (target - model_value):
                break
            continue
        drop = value - lowest + expected_drop
        if not subgradient_step(mu, gradient, direction, drop, data.multiplier_spacing[0]):
            break
    mu[:] = best_mu
    return lowest + cubic_bound(mu, data)


@loops
def subgradient_step(
    mu: Array, gradient: Array, direction: Array, drop: float, spacing: float
) -> bool:
    """Move the multipliers μ, in place, by a deflected subgradient step that aims at a fall of D.

    The direction is the subgradient, plus a part of the last direction where both oppose one
    another (Camerini, Fratta, Maffioli 1975). Multipliers are rounded to multiples of `spacing`: on
    this grid their path does not depend on rounding, and any μ gives a valid bound.

    Args:
        mu: Multipliers, shape (Z,); changed in place.
        gradient: A subgradient of D at μ, shape (Z,).
        direction: Direction of the last step, or zeros at the first one, shape (Z,); overwritten
            with the new one.
        drop: Fall of D that is aimed at, ≥ 0.
        spacing: Distance of the values that multipliers take, > 0.

    Returns:
        False where the direction is zero and μ stays, or a multiplier exceeds `LARGEST`: the
        iteration ends then, and μ may be changed in part. True otherwise.
    """
    along = 0.0
    squared_length = 0.0
    for z in range(len(mu)):
        along += gradient[z] * direction[z]
        squared_length += direction[z] ** 2
    # The factor 1.5 is the one of Camerini, Fratta and Maffioli.
    deflection = -1.5 * along / squared_length if along < 0 and squared_length > 0 else 0.0
    squared_length = 0.0
    for z in range(len(mu)):
        direction[z] = gradient[z] + deflection * direction[z]
        squared_length += direction[z] ** 2
    if squared_length < 1e-24:
        return False
    for z in range(len(mu)):
        mu[z] = spacing * np.rint((mu[z] - drop / squared_length * direction[z]) / spacing)
        if not abs(mu[z]) <= LARGEST:
            return False
    return True
