"""The dual function of a Lagrangian relaxation and its minimisation by deflected subgradients.

An output at a node is Σ_k F_k(z_k(u)): z_k are intervening variables of mode k, F_k the response of
one oscillator. All z are scaled to [−1, 1] over the box: z = a·u + u·Q u ± R. For any multipliers μ
the maximum of side × output over the inputs u is at most (Geoffrion 1974, Lemaréchal 2001)

    D(μ) = Σ_k max over the mode's table of [ Σ_s c e + |r e − μ_s| − μ_ω ω − μ_g g ]
         + max over u of [ Σ μ (a·u + u·Q u) + truncated modes ] + Σ |μ| R,

a convex function; e are responses to source s, c ± r the range of their amplitude.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.kernels import compiled, kernel
from alphacut.frame.calculus.unproved import UnprovedError

LARGEST = 1e100
"""Magnitude of models, tables and multipliers at most: no sum of their products overflows."""


class Data(NamedTuple):
    """Models and tables of K modes for one output: L inputs, Z = K (2 + sources) variables."""

    table: Array  # responses, (K, sources, T, Q W)
    omega: Array  # scaled ω of the tables' points, (K, Q W)
    decay: Array  # scaled g of them, the same
    start: Array  # least ω and q of each table, (K, 2)
    step: Array  # distances of its points, (K, 2)
    points: Array  # number of points along ω and along q, (2,)
    ends: Array  # first and last point along ω and along q that the box reaches, (K, 4)
    centre: Array  # centres of ω and g, (K, 2)
    radius: Array  # their radii
    share: Array  # centres of the shares, (K, sources)
    reach: Array  # their radii
    linear: Array  # linear parts of all scaled variables, (Z, L)
    quadratic: Array  # quadratic parts, packed by rows, (Z, L (L + 1)/2)
    cubic: Array  # cubic parts, packed, (Z, monomials)
    expected: Array  # what is expected of the cubic parts' sum for a multiplier of 1, (Z,)
    remainder: Array  # remainders, with `expected`, (Z,)
    # middles and half ranges of truncated modes' responses, (2 sources, T); (0, 1) if there are
    # none
    truncated_response: Array
    truncated_linear: Array  # linear parts of their shares and amplitudes, (2 sources, L)
    truncated_quadratic: Array  # quadratic parts
    grain: Array  # distance of the values that multipliers take, (1,)


def data_without_modes() -> Data:
    """Return `Data` of empty arrays, with which a kernel can be called before there are models."""
    dimensions = dict.fromkeys(Data._fields, 2)
    dimensions |= {"table": 4, "points": 1, "expected": 1, "remainder": 1, "grain": 1}
    return Data(**{name: np.zeros((0,) * count) for name, count in dimensions.items()})


def roundings(modes: int, sources: int, inputs: int) -> int:
    """Roundings of a term of the dual function: of its sums over variables, pairs and modes."""
    return 2 * modes * (sources + 2) + 2 * inputs**2 + 4 * inputs + 4 * sources + 32


def require_in_range(fields: Mapping[str, Array]) -> None:
    """Raise UnprovedError where a number of models or tables is not finite or above `LARGEST`."""
    for name, values in fields.items():
        if not (np.abs(values) <= LARGEST).all():
            raise UnprovedError(f"dual function: {name} is not finite or above {LARGEST:g}")


# bounds of rounding hold for any order of a sum, with fused products too; NaN and infinity stay
loops = kernel(fastmath={"reassoc", "contract"})


@loops
def box_maximum(linear: Array, quadratic: Array, u: Array) -> float:
    """Upper bound of linear·u + Σ_{i ≤ j} q_ij u_i u_j over [−1, 1]^d; `u` near it is written.

    Inputs whose slope outweighs all that couples them are at an end of the box, one after the
    other; products of the rest count by magnitude. The q_ij are packed by rows.
    """
    d = len(u)
    # full: q_ij, symmetric; slack: Σ_j |q_ij| over the free j ≠ i
    full, slack, slope = np.empty((d, d)), np.empty(d), linear.copy()
    at = 0
    for i in range(d):
        for j in range(i, d):
            full[i, j] = full[j, i] = quadratic[at]
            at += 1
    for i in range(d):
        slack[i] = -abs(full[i, i])
        for j in range(d):
            slack[i] += abs(full[i, j])
    free = np.ones(d, np.bool_)
    total, has_fixed = 0.0, True
    while has_fixed:
        has_fixed = False
        for i in range(d):
            if free[i] and abs(slope[i]) >= slack[i] + 2 * max(-full[i, i], 0.0):
                free[i], has_fixed = False, True
                u[i] = 1.0 if slope[i] >= 0 else -1.0
                total += abs(slope[i]) + full[i, i]
                for j in range(d):
                    slope[j] += full[i, j] * u[i]
                    slack[j] -= abs(full[i, j])
    for i in range(d):
        if not free[i]:
            continue
        size, bend = abs(slope[i]), full[i, i]
        u[i] = 1.0 if slope[i] >= 0 else -1.0
        if bend >= 0 or size >= -2 * bend:
            total += size + bend
        else:
            total -= size * size / (4 * bend)
            u[i] *= size / (-2 * bend)
        for j in range(i + 1, d):
            if free[j]:
                total += abs(full[i, j])
    return total


@loops
def products(u: Array, out: Array) -> None:
    """u_i u_j, packed by rows, i ≤ j."""
    at = 0
    for i in range(len(u)):
        for j in range(i, len(u)):
            out[at] = u[i] * u[j]
            at += 1


@loops
def add(out: Array, factor: float, row: Array) -> None:
    """Adds factor × row."""
    for i in range(len(out)):
        out[i] += factor * row[i]


@loops
def dot(a: Array, b: Array) -> float:
    """a·b."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@loops
def dual_value(
    mu: Array, cell: Ints, node: int, side: float, data: Data, gradient: Array, u: Array
) -> float:
    """Value D(μ) of the dual function at multipliers μ (Z,), without constants and cubic parts.

    Written are a subgradient (Z,) and `u` (L,), the inputs that maximise the part over the box.
    `cell` (K, 4) holds the first and last point along ω and along q = g/ω at which each mode's
    table is read. |μ| and data are at most `LARGEST`.
    """
    modes, sources = data.share.shape
    gradient[:] = 0.0
    total, values = 0.0, np.empty(data.omega.shape[1])
    for k in range(modes):
        highest, at = mode_maximum(mu, k, cell[k], node, side, data, values)
        total += highest
        first = k * (2 + sources)
        gradient[first] = -data.omega[k, at]
        gradient[first + 1] = -data.decay[k, at]
        for s in range(sources):
            difference = side * data.reach[k, s] * data.table[k, s, node, at] - mu[first + 2 + s]
            gradient[first + 2 + s] = -1.0 if difference >= 0 else 1.0
    slope, bend = np.zeros(data.linear.shape[1]), np.zeros(data.quadratic.shape[1])
    for s in range(len(data.truncated_linear)):
        add(slope, side * data.truncated_response[s, node], data.truncated_linear[s])
        add(bend, side * data.truncated_response[s, node], data.truncated_quadratic[s])
    for z in range(len(mu)):
        add(slope, mu[z], data.linear[z])
        add(bend, mu[z], data.quadratic[z])
    total += box_maximum(slope, bend, u)
    products(u, bend)
    for z in range(len(mu)):
        total += abs(mu[z]) * data.remainder[z]
        gradient[z] += dot(data.linear[z], u) + dot(data.quadratic[z], bend)
        gradient[z] += np.sign(mu[z]) * data.remainder[z]
    return total


@loops
def mode_maximum(
    mu: Array, k: int, cell: Ints, node: int, side: float, data: Data, values: Array
) -> tuple[float, int]:
    """Maximum of mode k's term in D(μ) over a cell of its table, and its point.

    Loops run over slices from 0, without which they are not compiled to vector instructions.
    """
    count, width = int(data.points[0]), cell[1] + 1 - cell[0]  # a row has `count` points along ω
    first, end = cell[2] * count + cell[0], cell[3] * count + cell[1] + 1
    maximand(mu, k, first, node, side, data, values[first:end])
    highest = np.full(width, -1e300)
    for begin in range(first, end, count):
        of_row = values[begin : begin + width]
        for i in range(width):
            highest[i] = of_row[i] if of_row[i] > highest[i] else highest[i]
    column = 0
    for i in range(width):
        column = i if highest[i] > highest[column] else column
    at = first + column
    while values[at] != highest[column]:
        at += count
    return highest[column], at


@loops
def maximand(
    mu: Array, k: int, first: int, node: int, side: float, data: Data, values: Array
) -> None:
    """Write Σ_s c e + |r e − μ_s| − μ_ω ω − μ_g g to `values`, from mode k's point `first` on."""
    sources, end = data.share.shape[1], first + len(values)
    z = k * (2 + sources)
    w, g, mu_w, mu_g = data.omega[k, first:end], data.decay[k, first:end], mu[z], mu[z + 1]
    for s in range(sources):
        e, m = data.table[k, s, node, first:end], mu[z + 2 + s]
        c, r = side * data.share[k, s], side * data.reach[k, s]
        if s == 0:
            for i in range(len(values)):
                values[i] = c * e[i] + abs(r * e[i] - m) - mu_w * w[i] - mu_g * g[i]
        else:
            for i in range(len(values)):
                values[i] += c * e[i] + abs(r * e[i] - m)


@loops
def remainder_bound(mu: Array, data: Data) -> float:
    """Bound of Σ μ (cubic part) over the box, less what D(μ) has expected of it."""
    total, expected = np.zeros(data.cubic.shape[1]), 0.0
    for z in range(len(mu)):
        add(total, mu[z], data.cubic[z])
        expected += abs(mu[z]) * data.expected[z]
    return np.abs(total).sum() - expected


@compiled
def minimise(
    mu: Array,
    cell: Ints,
    node: int,
    side: float,
    data: Data,
    steps: int,
    patience: int,
    target: float,
    model_value: float,
    disagreement: Array,
    u: Array,
) -> float:
    """Minimise the dual function D(μ) by deflected subgradient steps; return an upper bound.

    D(μ) = Σ_k max over a cell of mode k's table + max over inputs u in [−1, 1]^L + Σ |μ| R bounds
    side × output at a node for any multipliers μ of the modes' intervening variables z(u). The
    direction is the subgradient with a part of the last direction where these oppose one
    another (Camerini, Fratta, Maffioli 1975). Its length aims at a value of D that is expected
    (Polyak 1969); less is expected after `patience` steps without a third of it. The bound is the
    least D that is met, with that of the Taylor models' cubic parts.

    At most `steps` values of D are taken; it ends at `target`, and D cannot fall below
    `model_value`, which motions of the model reach. Written are the best multipliers `mu` (Z,),
    from which it begins; `u` (L,), the inputs of the second maximum for them; and `disagreement`
    (Z,): |μ_z| times the distance of variable z where the table's maximum is from z(u), a mean over
    the steps with weights that fall by 0.8.
    """
    gradient, direction, best = np.empty(len(mu)), np.zeros(len(mu)), mu.copy()
    here = np.empty(len(u))
    lowest, expected_drop, idle = np.inf, np.inf, 0
    disagreement[:] = 0.0
    for _ in range(steps):
        value = dual_value(mu, cell, node, side, data, gradient, here)
        for z in range(len(mu)):
            disagreement[z] = 0.8 * disagreement[z] + abs(gradient[z] * mu[z])
        if value < lowest:
            if lowest - value > 0.3 * expected_drop:
                idle = 0
            lowest = value
            best[:], u[:] = mu, here
        if lowest <= target:
            break
        if expected_drop == np.inf:
            expected_drop = 0.7 * max(lowest - model_value, 0.0)
        idle += 1
        if idle > patience:  # back to the best multipliers
            expected_drop, idle = 0.5 * expected_drop, 0
            mu[:], direction[:] = best, 0.0
            if expected_drop < 0.1 * (target - model_value):
                break
        elif not subgradient_step(
            mu, gradient, direction, value - lowest + expected_drop, data.grain[0]
        ):
            break
    mu[:] = best
    return lowest + remainder_bound(mu, data)


@loops
def subgradient_step(
    mu: Array, gradient: Array, direction: Array, drop: float, grain: float
) -> bool:
    """Make a deflected subgradient step of the multipliers μ that aims at a fall of D by `drop`.

    `mu` and `direction` are written. Multipliers are rounded to multiples of `grain`: on a grid
    their path does not depend on rounding, and any μ gives a bound.

    Returns:
        False where the direction is zero, or a multiplier exceeds `LARGEST`.
    """
    length = along = 0.0
    for z in range(len(mu)):
        along += gradient[z] * direction[z]
        length += direction[z] ** 2
    deflection = -1.5 * along / length if along < 0 and length > 0 else 0.0
    length = 0.0
    for z in range(len(mu)):
        direction[z] = gradient[z] + deflection * direction[z]
        length += direction[z] ** 2
    if length < 1e-24:
        return False
    for z in range(len(mu)):
        mu[z] = grain * np.rint((mu[z] - drop / length * direction[z]) / grain)
        if not abs(mu[z]) <= LARGEST:
            return False
    return True
