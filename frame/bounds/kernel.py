"""Examination of boxes in the branch and bound, compiled by Numba; without it, plain Python.

An item is an output and side (lower or upper bound) at a time node in a box. About the box's centre
the output, times its side, is f + g·x + x·H·x/2 for |x| ≤ r, up to `rest`. An item is

- left to the neighbouring box, or confined to faces, where the output is monotone along axes;
- closed, where a bound lies below its target, the best known value plus the gap: the bound of the
  quadratic, that of modes which turn at rates linear in the inputs, or that of a concave function
  above the quadratic;
- else split, along the axis that adds most to what is not known.
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.kernels import compiled

FACES = 16
"""Codes from here on confine an item to faces: plus 3^axis, once for lower and twice for upper."""
SWEEPS = 8
MAX_PHASE = 4.0
"""Largest change of phase, in rad, over a box for which linear phases are used."""
SWELL = 1.7
"""Largest z for which 1 + z + z² lies above exp(z)."""


@compiled
def separable_bound(g: Array, H: Array, r: Array) -> float:
    """Upper bound of g·x + x·H·x/2 for |x| ≤ r, as a sum of bounds along each axis.

    Mixed terms are moved to the diagonal: 2 x_i x_j ≤ x_i² r_j/r_i + x_j² r_i/r_j.
    """
    total = 0.0
    for i in range(len(r)):
        if r[i] <= 0:
            continue
        bend, slope = H[i, i], abs(g[i])
        for j in range(len(r)):
            if j != i:
                bend += abs(H[i, j]) * r[j] / r[i]
        if bend < 0 and slope < -bend * r[i]:
            total -= slope * slope / (2 * bend)
        else:
            total += slope * r[i] + 0.5 * bend * r[i] * r[i]
    return total


@compiled
def stays_below(g: Array, H: Array, r: Array, allowed: float, work: Array, L: Array) -> bool:
    """Whether g·x + x·H·x/2 ≤ allowed is shown for |x| ≤ r; False if it stays open.

    The quadratic plus Σ s_i (r_i² − x_i²)/2 lies above it (αBB: Adjiman, Floudas 1998). Where that
    is concave, each of its tangents is a bound; they are taken at points of an ascent along the
    axes, from 0. `work` (3, d) and `L` (d, d) are scratch.
    """
    if allowed <= 0:
        return False
    d, shift, x, slope = len(g), work[0], work[1], work[2]  # shift: the s_i
    value = 0.0
    for i in range(d):
        x[i], slope[i], shift[i] = 0.0, g[i], 0.0
        if r[i] > 0:
            shift[i] = allowed / (4 * d * r[i] * r[i])
        value += shift[i] / 2 * r[i] * r[i]
    for i in range(d):  # concave if Cholesky's factor of diag(s) − H exists, on axes with a width
        for j in range(i + 1):
            if r[i] <= 0 or r[j] <= 0:
                L[i, j] = 0.0
                continue
            total = -H[i, j] if i != j else shift[i] - H[i, i]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if i != j:
                L[i, j] = total / L[j, j]
            elif total > 1e-12 * (shift[i] + abs(H[i, i])):
                L[i, i] = sqrt(total)
            else:
                return False
    for _ in range(SWEEPS):
        tangent = value
        for i in range(d):
            tangent += abs(slope[i]) * r[i] - slope[i] * x[i]
        if tangent <= allowed:
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
def linear_phase_remainder(reach: float, e: Array, c: Array) -> float:
    """Bound of what a mode C exp(λ t) differs from one of linear phase beyond second order in x.

    The mode of linear phase has C = C₀ and λ = λ₀ + i ω·x, whose phase changes by at most `reach`
    over the box. The bound is a sixth of one of the difference's third derivative, by Leibniz'
    rule, divided by |exp(λ₀ t)|; infinite beyond `MAX_PHASE` or `SWELL`. `e` and `c` are bounds
    over the box of the derivatives of λ t (order 1: of its real part; 0 is not read) and C, of
    order 0 to 3, times the radii.
    """
    z0, z1 = e[1] + e[2] / 2, e[1] + e[2]
    if not (reach < MAX_PHASE and z0 < SWELL):
        return inf
    swell, curved = 1 + z0 + z0 * z0, e[2] + z1 * z1
    p0, p1 = c[1] + c[0] * z0 * swell, c[1] + c[0] * z1
    p2 = c[2] + 2 * c[1] * z1 + c[0] * curved
    p3 = c[3] + 3 * c[2] * z1 + 3 * c[1] * curved + c[0] * (e[3] + 3 * e[2] * z1 + z1**3)
    total: float = (reach**3 * p0 + (3 * reach**2 * p1 + 3 * reach * p2 + p3) * swell) / 6
    return total


@compiled
def linear_phase_bound(
    g: Array, H: Array, w: Array, t: float, side: float, modes: tuple[Array, ...], o: int
) -> float:
    """Make g·x + x·H·x/2 + the result an upper bound of side × (output − its central value).

    With |s| ≤ S for a mode's phase s = ω·x, Re A exp(i s) exceeds its quadratic Taylor model by at
    most |Im A| S³/24 + Im A S² s/8 (Chebyshev) + max(Re A, 0) S² s²/24 + |Im A| S⁵/120 + |Re A|
    S⁶/720. Terms in x are added to `g` and `H`; the sum of the constant ones, with the bounds of
    `linear_phase_remainder`, is returned.

    `w` holds the waves exp(λ₀ t), real and imaginary parts in turn, (2 n,); `modes` C₀ (n, m, 2), ω
    (n, d), bounds of |ω·x| and of |Re (λ − λ₀)| (n,), and of derivatives times radii, of λ of order
    2 and 3, (2, n), and of C of order 0 to 3, (4, n, m).
    """
    share, slope, phase, decay, e, c = modes
    remainder, rates = 0.0, np.empty(4)
    for k in range(len(phase)):
        re, im = w[2 * k], w[2 * k + 1]
        A_re = 2 * side * (share[k, o, 0] * re - share[k, o, 1] * im)
        A_im = 2 * side * (share[k, o, 0] * im + share[k, o, 1] * re)
        S = phase[k] * t
        rates[1], rates[2], rates[3] = decay[k] * t, e[0, k] * t, e[1, k] * t
        remainder += 2 * sqrt(re * re + im * im) * linear_phase_remainder(S, rates, c[:, k, o])
        remainder += abs(A_im) * (S**3 / 24 + S**5 / 120) + abs(A_re) * S**6 / 720
        linear, quadratic = A_im * S * S * t / 8, max(A_re, 0.0) * S * S * t * t / 12
        for i in range(len(g)):
            g[i] += linear * slope[k, i]
            for j in range(len(g)):
                H[i, j] += quadratic * slope[k, i] * slope[k, j]
    return remainder


@compiled
def expand_output(w: Array, table: Array, J: Array, H: Array) -> None:
    """Write an output's value, gradient and packed Hessian, Σ_k w_k table_k, to J; unpack it to H.

    J has shape (1 + d + d (d + 1)/2,), `table` (K, len(J)), the waves w (K,) and H (d, d).
    """
    J[:] = 0.0
    for k in range(len(w)):
        for a in range(len(J)):
            J[a] += w[k] * table[k, a]
    a = 1 + len(H)
    for i in range(len(H)):
        for j in range(i, len(H)):
            H[i, j] = H[j, i] = J[a]
            a += 1


@compiled
def examine(
    rows: tuple[Ints, ...],
    boxes: tuple[Array, ...],
    waves: Array,
    time: Array,
    linear_phases: tuple[Array, ...],
    remainder: tuple[Array, ...],
    target: Array,
    has_linear_phases: bool,
) -> tuple[Ints, Array, Array]:
    """Examine all items: what is done next with each, its value and its upper bound.

    An item is a box with a problem, an output and side at a time node; a row is a box with a node.
    About a box's centre side × output is f + g·x + x·S·x/2 up to `missing`, |x| ≤ r.

    Returns:
        Codes (0: closed; 1 + i: bisect along axis i; `FACES` and more: confine to faces), side ×
        output at the centres, and upper bounds over the boxes, each with an entry for each item.

    Args:
        rows: First row of each box, first item of each row, node of each row, column of each item
            (2 output + 1 for upper bounds).
        boxes: Radius, which faces lie on the domain's, and tables from waves to jets (B, m, K, q).
        waves: Waves of all modes at the rows, real and imaginary parts, shape (R, K).
        time: Nodes, shape (T,), in s.
        linear_phases: The `modes` of `linear_phase_bound`, along the boxes.
        remainder: Bounds of third derivatives (T, m, d, d, d) and of rounding (T, m, 1 + d).
        target: Best value of each problem with the gap asked for.
        has_linear_phases: Whether modes with linear phases are tried as bounds.
    """
    row_start, item_start, nodes, column = rows
    radius, edges, tables = boxes
    share, slope, phase, decay, of_rates, of_shares = linear_phases
    third, margin = remainder
    d, m, q = radius.shape[1], tables.shape[1], tables.shape[3]
    code, value = np.zeros(len(column), np.int64), np.zeros(len(column))
    bound = np.zeros(len(column))
    J, H, g, S, slope_margin, second_change = (
        np.empty(q), np.empty((d, d)), np.empty(d), np.empty((d, d)), np.empty(d), np.empty(d),
    )  # fmt: skip
    work, L = np.empty((3, d)), np.empty((d, d))
    for b in range(len(radius)):
        r = radius[b]
        modes = (share[b], slope[b], phase[b], decay[b], of_rates[b], of_shares[b])
        for row in range(row_start[b], row_start[b + 1]):
            node, before = nodes[row], -1
            for item in range(item_start[row], item_start[row + 1]):
                o, side = column[item] // 2, 2.0 * (column[item] % 2) - 1
                noise = missing = margin[node, o, 0]  # missing: rounding and cubic terms
                if o != before:
                    expand_output(waves[row], tables[b, o], J, H)
                    before = o
                # With the third derivatives |T_ijk| at most `third`, the slope along axis i differs
                # from g_i by Σ |H_ij| r_j and, by Taylor's theorem, Σ |T_ijk| r_j r_k / 2 at most.
                for i in range(d):
                    third_change = second_change[i] = 0.0
                    for j in range(d):
                        second_change[i] += abs(H[i, j]) * r[j]
                        for k in range(d):
                            third_change += third[node, o, i, j, k] * r[j] * r[k]
                    slope_margin[i] = third_change / 2 + margin[node, o, 1 + i]
                    missing += third_change * r[i] / 6
                f, aim = side * J[0], target[node * 2 * m + column[item]]
                faces, stride, is_monotone_inside = 0, 1, False
                for i in range(d):
                    g[i] = side * J[1 + i]
                    for j in range(d):
                        S[i, j] = side * H[i, j]
                    if r[i] > 0 and abs(g[i]) > second_change[i] + slope_margin[i]:
                        up = 1 if g[i] > 0 else 0
                        if edges[b, up, i]:
                            faces += stride * (1 + up)
                        else:
                            is_monotone_inside = True  # the neighbouring box holds higher points
                    stride *= 3
                value[item] = f
                bound[item] = f + separable_bound(g, S, r) + missing
                if is_monotone_inside or bound[item] <= aim:
                    continue
                if has_linear_phases:  # bound by modes of linear phase
                    room = aim - f - noise
                    room -= linear_phase_bound(g, S, waves[row], time[node], side, modes, o)
                    if separable_bound(g, S, r) <= room or stays_below(g, S, r, room, work, L):
                        continue
                    for i in range(d):
                        g[i] = side * J[1 + i]
                        for j in range(d):
                            S[i, j] = side * H[i, j]
                if faces:
                    code[item] = FACES + faces
                    continue
                # bound by a concave function above the quadratic
                if stays_below(g, S, r, aim - f - missing, work, L):
                    continue
                largest_weight = -1.0  # bisect along the axis that adds most to what is not known
                for i in range(d):
                    weight = r[i] * (2 * slope_margin[i] + second_change[i] / 2)
                    if r[i] > 0 and weight > largest_weight:
                        largest_weight, code[item] = weight, 1 + i
    return code, value, bound


def call_examine() -> None:
    """Call `examine` once without a box; see `KernelThreads`."""
    no_numbers = np.zeros(0, np.int64)
    faces = np.zeros((0, 2, 0), np.bool_)
    phases = tuple(np.zeros((0,) * dimensions) for dimensions in (4, 3, 2, 2, 3, 4))
    examine(
        (no_numbers,) * 4,
        (np.zeros((0, 0)), faces, np.zeros((0,) * 4)),
        np.zeros((0, 0)),
        np.zeros(0),
        phases,
        (np.zeros((0,) * 5), np.zeros((0,) * 3)),
        np.zeros(0),
        False,
    )
