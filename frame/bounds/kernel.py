"""Examination of sub-boxes in the branch and bound, compiled by Numba; without it, plain Python.

An item is a sub-box with a problem: one side (−1 or 1) of an output at a time node. About the
midpoint of the sub-box, side × output is f + g·x + x·H·x/2 for |x_i| ≤ r_i, with an error of at
most `missing`. An item is

- left to the neighbouring sub-box, or confined to faces, where the output is monotonic along axes;
- closed, where a bound lies below its target, the best known value plus the gap: the bound of the
  quadratic, or that of a concave function above it;
- else split, along the axis that adds most to what is not known.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.kernels import compiled

FACES = 16
"""Codes from here on confine an item to faces: plus 3^axis, once for lower and twice for upper."""
INSIDE = -1
"""Stands for faces where the output rises towards a neighbouring sub-box."""


class Items(NamedTuple):
    """Items in the order of their sub-boxes; a row holds those of one sub-box at one time node."""

    first_row: Ints  # first row of each of B sub-boxes, and the number of rows, (B + 1,)
    first_item: Ints  # first item of each of R rows, and the number of items, (R + 1,)
    node: Ints  # time node of each row, (R,)
    column: Ints  # of each item, 2 output + 1 for the side 1, (items,)


class BoxTables(NamedTuple):
    """Geometry of B sub-boxes with d axes, and the outputs there; q = 1 + d + d (d + 1)/2."""

    radius: Array  # (B, d)
    is_outer: Mask  # whether the lower and the upper faces lie on those of the whole box, (B, 2, d)
    # factors of the K waves in value, gradient and packed Hessian of each output, (B, m, K, q)
    factors: Array


class Examination(NamedTuple):
    """What is done next with each item, and what is known of it, one entry each."""

    code: Ints  # 0: closed; 1 + i: bisect along axis i; `FACES` and more: confine to faces
    value: Array  # side × output at the midpoint of the sub-box
    bound: Array  # guaranteed upper bound of side × output over the sub-box


@compiled
def separable_bound(g: Array, H: Array, r: Array) -> float:
    """Return an upper bound of g·x + x·H·x/2 for |x_i| ≤ r_i, as a sum of bounds along each axis.

    Mixed terms are moved to the diagonal: 2 x_i x_j ≤ x_i² r_j/r_i + x_j² r_i/r_j. Axes with r_i =
    0 are left out.

    Args:
        g: Shape (d,).
        H: Symmetric, shape (d, d).
        r: Radii r_i ≥ 0, shape (d,).
    """
    total = 0.0
    for i in range(len(r)):
        if r[i] <= 0:
            continue
        bend = H[i, i]
        slope = abs(g[i])
        for j in range(len(r)):
            if j != i:
                bend += abs(H[i, j]) * r[j] / r[i]
        if bend < 0 and slope < -bend * r[i]:
            total -= slope * slope / (2 * bend)
        else:
            total += slope * r[i] + 0.5 * bend * r[i] * r[i]
    return total


@compiled
def has_cholesky_factor(H: Array, shift: Array, r: Array, factor: Array) -> bool:
    """Return whether diag(s) − H is positive definite, by more than rounding, where r_i > 0.

    A pivot counts as positive above 1e-12 (s_i + |H_ii|). If all r_i are 0 the result is True.

    Args:
        H: Symmetric, shape (d, d).
        shift: s, shape (d,).
        r: Radii, shape (d,); axes with 0 are left out.
        factor: Scratch, shape (d, d); its lower triangle is overwritten with the Cholesky factor,
            as far as it exists.
    """
    for i in range(len(r)):
        for j in range(i + 1):
            if r[i] <= 0 or r[j] <= 0:
                factor[i, j] = 0.0
                continue
            total = -H[i, j] if i != j else shift[i] - H[i, i]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            if i != j:
                factor[i, j] = total / factor[j, j]
            elif total > 1e-12 * (shift[i] + abs(H[i, i])):
                factor[i, i] = sqrt(total)
            else:
                return False
    return True


@compiled
def stays_below(g: Array, H: Array, r: Array, allowed: float, work: Array, factor: Array) -> bool:
    """Return whether g·x + x·H·x/2 ≤ `allowed` is proved for |x_i| ≤ r_i; False if it stays open.

    The quadratic plus Σ s_i (r_i² − x_i²)/2 with s_i ≥ 0 lies above it (αBB: Adjiman, Floudas
    1998). Where that is concave, each of its tangent planes is a bound. They are taken at points of
    an ascent along the axes, from 0. The quadratic is 0 at x = 0, so `allowed` ≤ 0 is not tried and
    gives False.

    Args:
        g: Shape (d,).
        H: Symmetric, shape (d, d).
        r: Radii r_i ≥ 0, shape (d,); axes with 0 are left out.
        allowed: In the unit of the output.
        work: Scratch, shape (3, d).
        factor: Scratch, shape (d, d).
    """
    if allowed <= 0:
        return False
    d = len(g)
    shift = work[0]  # s
    x = work[1]
    slope = work[2]  # of the concave function at x
    value = 0.0  # of the concave function at x
    for i in range(d):
        x[i] = 0.0
        slope[i] = g[i]
        shift[i] = 0.0
        if r[i] > 0:
            # Together the terms of all axes lift the quadratic by an eighth of `allowed` at most.
            shift[i] = allowed / (4 * d * r[i] * r[i])
        value += shift[i] / 2 * r[i] * r[i]
    if not has_cholesky_factor(H, shift, r, factor):
        return False
    for _ in range(8):  # sweeps over the axes; few problems are decided later
        tangent_bound = value  # the largest value of the tangent plane at x over the box
        for i in range(d):
            tangent_bound += abs(slope[i]) * r[i] - slope[i] * x[i]
        if tangent_bound <= allowed:
            return True
        if value > allowed:
            return False
        for i in range(d):
            if r[i] <= 0:
                continue
            bend = shift[i] - H[i, i]
            step = max(min(x[i] + slope[i] / bend, r[i]), -r[i]) - x[i]
            value += step * (slope[i] - bend * step / 2)
            x[i] += step
            for j in range(d):
                slope[j] += H[j, i] * step
            slope[i] -= shift[i] * step
    return False


@compiled
def expand_output(waves: Array, factors: Array, jet: Array) -> None:
    """Write value, gradient and packed Hessian of an output, Σ_k waves_k factors_k, to `jet`.

    Args:
        waves: Values in time of the K terms of the output, shape (K,).
        factors: Their factors as functions of d inputs, shape (K, q), q = 1 + d + d (d + 1)/2:
            value, d first derivatives, and second derivatives by u_i and u_j for i ≤ j, packed by
            rows.
        jet: Overwritten with the sums, in the same order, shape (q,).
    """
    jet[:] = 0.0
    for k in range(len(waves)):
        for a in range(len(jet)):
            jet[a] += waves[k] * factors[k, a]


@compiled
def unpack_derivatives(jet: Array, side: float, g: Array, H: Array) -> None:
    """Write gradient and Hessian of side × output to `g` and `H`.

    Args:
        jet: Value of the output, its d first derivatives, and its second derivatives by u_i and u_j
            for i ≤ j, packed by rows, shape (1 + d + d (d + 1)/2,).
        side: −1 or 1.
        g: Overwritten, shape (d,).
        H: Overwritten, symmetric, shape (d, d).
    """
    d = len(g)
    a = 1 + d
    for i in range(d):
        g[i] = side * jet[1 + i]
        for j in range(i, d):
            H[i, j] = H[j, i] = side * jet[a]
            a += 1


@compiled
def model_errors(H: Array, third: Array, r: Array, bend: Array, slope_error: Array) -> float:
    """Return the error of a quadratic Taylor model over a sub-box, and write those of its slopes.

    With third derivatives of at most |T_ijk|, Taylor's theorem bounds the error of the model by
    Σ |T_ijk| r_i r_j r_k / 6, and that of its slope along axis i by Σ |T_ijk| r_j r_k / 2.

    Args:
        H: Hessian at the midpoint, shape (d, d).
        third: |T_ijk|, shape (d, d, d).
        r: Radii, shape (d,).
        bend: Overwritten with Σ_j |H_ij| r_j, by which the slopes of the model change, shape (d,).
        slope_error: Overwritten with the errors of the slopes, shape (d,).
    """
    error = 0.0
    for i in range(len(r)):
        third_change = bend[i] = 0.0
        for j in range(len(r)):
            bend[i] += abs(H[i, j]) * r[j]
            for k in range(len(r)):
                third_change += third[i, j, k] * r[j] * r[k]
        slope_error[i] = third_change / 2
        error += third_change * r[i] / 6
    return error


@compiled
def rising_faces(g: Array, bend: Array, slope_error: Array, r: Array, is_outer: Mask) -> int:
    """Return the faces of a sub-box on which the highest point of an output must lie.

    Where the slope |g_i| at the midpoint exceeds all that it may change by within the sub-box, the
    output rises along axis i towards one face, and its highest point lies there.

    Args:
        g: Gradient of side × output at the midpoint, shape (d,).
        bend: Change of the slopes that the Hessian allows, Σ_j |H_ij| r_j, shape (d,).
        slope_error: Error of the slopes of the quadratic model, shape (d,).
        r: Radii of the sub-box, shape (d,); axes with 0 do not count.
        is_outer: Whether the lower and the upper faces lie on those of the whole box, shape (2, d).

    Returns:
        Σ_i 3^i e_i, where e_i is 1 for the lower face of axis i, 2 for its upper face and 0 for
        neither. `INSIDE` = −1 if one of the faces lies inside the whole box: then the neighbouring
        sub-box holds higher points.
    """
    faces = 0
    stride = 1
    for i in range(len(r)):
        if r[i] > 0 and abs(g[i]) > bend[i] + slope_error[i]:
            upper = 1 if g[i] > 0 else 0
            if not is_outer[upper, i]:
                return INSIDE
            faces += stride * (1 + upper)
        stride *= 3
    return faces


@compiled
def bisection_code(bend: Array, slope_error: Array, r: Array) -> int:
    """Return 1 + the axis whose bisection promises most for one sub-box, or 0 without any width.

    The weight of axis i is r_i (2 slope_error_i + bend_i/2): what the error of the slope and the
    change of the slope by the Hessian add to the bound along it. The first axis is taken of equal
    ones.

    Args:
        bend: Σ_j |H_ij| r_j for the Hessian H of the output, shape (d,).
        slope_error: Errors of the slopes of the quadratic model, shape (d,).
        r: Radii of the sub-box, shape (d,).
    """
    largest = -1.0
    code = 0
    for i in range(len(r)):
        weight = r[i] * (2 * slope_error[i] + bend[i] / 2)
        if r[i] > 0 and weight > largest:
            largest = weight
            code = 1 + i
    return code


@compiled
def examine(
    items: Items, boxes: BoxTables, waves: Array, third: Array, target: Array, found: Examination,
) -> None:  # fmt: skip
    """Examine all items: what is done next with each, its value and its upper bound.

    An item is one of B sub-boxes with a problem: one side, −1 or 1, of one of m outputs at one of T
    time nodes. Side × output is a quadratic about the midpoint of the sub-box plus an error.

    Args:
        items: The items, ordered by sub-box, then by time node; a row holds those of one sub-box
            and node. `first_row` (B + 1,) and `first_item` (R + 1,) say where each begins; `column`
            is 2 output + (0 for the side −1, 1 for 1).
        boxes: Radii of the sub-boxes (B, d), which of their faces are outer ones (B, 2, d), and the
            factors of the K terms in value, gradient and packed Hessian of each output (B, m, K,
            q).
        waves: Values in time of these terms, real and imaginary parts, at the rows, shape (R, K).
        third: Bounds over the whole box of the third derivatives of each output, shape (T, m, d, d,
            d).
        target: Best known value plus the wanted gap of each problem, shape (2 T m,), in the order
            of nodes, outputs, sides.
        found: Receives for each item: `code`, 0 where it is closed (its bound is at most the
            target, or a neighbouring sub-box holds higher points), 1 + i to bisect axis i, `FACES`
            + Σ 3^i (once for lower, twice for upper ends) to confine it to faces; `value` of side ×
            output at the midpoint; and its guaranteed upper `bound` over the sub-box. Its codes
            must be 0 before.
    """
    code, value, bound = found
    outputs = boxes.factors.shape[1]
    d = boxes.radius.shape[1]
    jet = np.empty(boxes.factors.shape[3])
    g = np.empty(d)  # gradient of side × output
    H = np.empty((d, d))  # its Hessian
    bend = np.empty(d)
    slope_error = np.empty(d)
    work = np.empty((3, d))
    factor = np.empty((d, d))
    for b in range(len(boxes.radius)):
        r = boxes.radius[b]
        for row in range(items.first_row[b], items.first_row[b + 1]):
            node = items.node[row]
            output = -1
            for item in range(items.first_item[row], items.first_item[row + 1]):
                column = items.column[item]
                side = 2.0 * (column % 2) - 1
                if column // 2 != output:
                    output = column // 2
                    expand_output(waves[row], boxes.factors[b, output], jet)
                unpack_derivatives(jet, side, g, H)
                missing = model_errors(H, third[node, output], r, bend, slope_error)
                value[item] = side * jet[0]
                bound[item] = value[item] + separable_bound(g, H, r) + missing
                faces = rising_faces(g, bend, slope_error, r, boxes.is_outer[b])
                aim = target[node * 2 * outputs + column]
                if faces == INSIDE or bound[item] <= aim:
                    continue
                if faces:
                    code[item] = FACES + faces
                    continue
                allowed = aim - value[item] - missing
                if not stays_below(g, H, r, allowed, work, factor):
                    code[item] = bisection_code(bend, slope_error, r)
