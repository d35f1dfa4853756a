"""Compiled enclosure of the motion of one yielding storey over a box of inputs.

The storey has, per unit of mass, m u'' + c u' + f = load with f = K_p u + K_z z. Here K_p is its
stiffness after yielding, less the softening by weight, and z the elastic drift of a slider of the
stiffness K_z that holds |z| ≤ y. The plastic drift p obeys z' = u' − p' and p' (z − ζ) ≥ 0 for all
|ζ| ≤ y. Time is cut into elements. An element begins and ends at a time that is the same at all
inputs, or at an event, whose time is a polynomial of the inputs. On an element an approximate
motion (ũ, ṽ, z̃) is a polynomial in τ, the fraction that has passed, and in the inputs.

*Inequality.* The approximate motion obeys all equations but for defects: ũ' = ṽ + δ_u in
kinematics, δ_v in the balance of forces, and z̃' = ũ' − p̃' + δ_z with an admissible flow p̃' in
the slider. Let Δ be the approximate less the exact motion, at the same inputs, and

    S² = Δv² + K_p Δu² + K_z Δz².

Then S S' = −c Δv² + Δv δ_v + (K_p Δu + K_z Δz) δ_u + K_z Δz δ_z − K_z Δz Δp'. Damping takes energy,
and so does the last term, since both flows obey the rule: −Δz Δp' = p' (z̃ − z) + p̃' (z − z̃) ≤ 0.
By Cauchy's inequality S' ≤ |δ_v| + √(K_p + K_z) |δ_u| + √K_z |δ_z|: errors add up over time and do
not grow. With K_p ≥ 0, |Δv| ≤ S, |Δz| ≤ S/√K_z, and |Δu| is at most S/√K_p and
∫ S dt + ∫ |δ_u| dt.

*Yield condition.* If z̃ passes y by η while it counts as elastic, the slider of the approximate
motion is held at y. It flows while z̃ rises, as it may, and is moved by at most η when z̃ falls:
|δ_z| adds up to η, and forces are off by K_z η meanwhile. If the velocity has the wrong sign in a
yielding state, by at most w over a time h, the slider is moved by at most w h. So an event that is
left out costs what it would have changed.

*Loads.* They are linear between samples. Where the time of an event may lie in several intervals,
the load g̃ of one of these is extended. The approximate motion is then that of g̃ plus the integrals
A, B of g − g̃ once and twice over time, which are the same at all inputs: they are added at the end,
and c A + K B is a defect of the balance.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.kernels import compiled
from alphacut.frame.calculus.truncated_polynomials import (
    ProductTable,
    magnitude,
    max_at,
    multiply,
    reciprocal,
    upper_bound,
)

# Rows of the coefficients of a storey, per unit of mass: damping c in 1/s; stiffness K_e = K_p +
# K_z while elastic, K_p while yielding, and K_z of the slider in 1/s²; its yield force K_z y in
# m/s²; and its yield drift y in m.
DAMPING, ELASTIC, YIELDED, SLIDER, FORCE, DRIFT = range(6)
# Largest number of terms of a series over an element.
MAX_TERMS = 40
# Two terms in a row below this fraction of the largest one end a series. What follows them is a
# part of the defects.
LAST_TERM = 1e-15
# Newton's steps to the time of an event.
MAX_STEPS = 12


class Storey(NamedTuple):
    """A storey over a box of inputs: six polynomials, and bounds of them."""

    rows: Array  # coefficients, (6, N), in the order of the constants above
    remainder: Array  # bound of what the polynomials leave out, (6,)
    magnitude: Array  # bound of each over the box, with its remainder, (6,)
    table: ProductTable
    min_yielded: float  # lower bound of K_p, not negative
    min_slider: float  # lower bound of K_z, positive
    min_force: float  # lower bound of K_z y, positive


class Load(NamedTuple):
    """An acceleration that is linear between E + 1 times, per unit of mass."""

    edges: Array  # (E + 1,), in s
    first: Array  # acceleration at the beginning of each interval, (E,), in m/s²
    slope: Array  # its slope there, (E,), in m/s³


class Series(NamedTuple):
    """Series of displacement and velocity over an element, and the integrals of their defects."""

    u: Array  # (MAX_TERMS, N)
    v: Array
    # number of terms, ∫|δ_u| dt in m, ∫|δ_v| dt in m/s, and the midpoint and radius of an interval
    # of the acceleration over the element and the box, in m/s²
    numbers: Array  # (5,)


@compiled
def expand(
    storey: Storey, phase: float, plastic: Array, start: tuple[Array, Array], h: Array,
    load: tuple[Array, float], series: Series,
) -> None:  # fmt: skip
    """Write the series of the motion over an element from a state on.

    Args:
        storey: The storey.
        phase: 0 while it is elastic, else the direction of yielding.
        plastic: Plastic drift of an elastic storey, shape (N,).
        start: Displacement and velocity at τ = 0, shape (N,) each.
        h: Length of the element, not negative over the box, shape (N,).
        load: Acceleration at τ = 0, shape (N,), and its slope over time.
        series: Receives the result.
    """
    table = storey.table
    size = storey.magnitude
    stiff = ELASTIC if phase == 0 else YIELDED
    U, V, _ = series
    n = len(h)
    longest = magnitude(h)
    U[0] = start[0]
    V[0] = start[1]
    by_damping = np.empty(n)
    by_stiffness = np.empty(n)
    force = np.empty(n)
    du = dv = 0.0
    if phase == 0:
        dv += longest * multiply(storey.rows[SLIDER], plastic, table, force)
        dv += longest * storey.remainder[SLIDER] * magnitude(plastic)
    else:
        force[:] = -phase * storey.rows[FORCE]
        dv += longest * storey.remainder[FORCE]
    scale = previous = 0.0
    sum_u = sum_v = 0.0
    acceleration = spread = 0.0
    terms = MAX_TERMS
    for k in range(MAX_TERMS):
        size_u = magnitude(U[k])
        size_v = magnitude(V[k])
        sum_u += size_u
        sum_v += size_v
        largest = size_u + longest * size_v
        scale = max(scale, largest)
        if k == MAX_TERMS - 1 or (k > 2 and max(largest, previous) <= LAST_TERM * scale):
            # The terms that would follow are those that the last ones leave in the equations.
            du += longest * size_v / (k + 1)
            dv += longest * (size[DAMPING] * size_v + size[stiff] * size_u) / (k + 1)
            terms = k + 1
            break
        previous = largest
        du += multiply(h, V[k], table, U[k + 1]) / (k + 1)
        lost = multiply(storey.rows[DAMPING], V[k], table, by_damping)
        lost += multiply(storey.rows[stiff], U[k], table, by_stiffness)
        for i in range(n):
            by_damping[i] = -by_damping[i] - by_stiffness[i]
            if k == 0:
                by_damping[i] += force[i] + load[0][i]
            elif k == 1:
                by_damping[i] += load[1] * h[i]
        spread += magnitude(by_damping)
        if k == 0:
            acceleration = by_damping[0]
            spread -= abs(acceleration)
        dv += (longest * lost + multiply(h, by_damping, table, V[k + 1])) / (k + 1)
        U[k + 1] /= k + 1
        V[k + 1] /= k + 1
    dv += longest * (storey.remainder[DAMPING] * sum_v + storey.remainder[stiff] * sum_u)
    series.numbers[0] = terms
    series.numbers[1] = du
    series.numbers[2] = dv
    series.numbers[3] = acceleration
    series.numbers[4] = spread


@compiled
def total(series: Array, terms: int, out: Array) -> None:
    """Write the polynomial at τ = 1 to `out`."""
    out[:] = 0.0
    for k in range(terms):
        out += series[k]


@compiled
def excess(
    storey: Storey, phase: float, plastic: Array, series: Series, gap: float, work: Array
) -> tuple[float, float]:  # fmt: skip
    """Return by how much the state may pass the next event somewhere on an element.

    Velocities do not change their sign where their interval has one, and rise or fall where that of
    the acceleration has one. Then the extreme state lies at an end of the element.

    Args:
        storey: The storey.
        phase: 0 while it is elastic, else the direction s of yielding.
        plastic: Plastic drift of an elastic storey, shape (N,).
        series: The motion on the element.
        gap: By how much the bound may exceed a value that was met.
        work: Is overwritten, shape (MAX_TERMS, N).

    Returns:
        Bounds of −z̃ − y and z̃ − y of an elastic storey, in m; twice that of −s ṽ of one that yields
        in the direction s, in m/s. They are negative where no event is possible.
    """
    terms = int(series.numbers[0])
    if phase != 0:
        for k in range(terms):
            work[k] = -phase * series.v[k]
        found = _bound(work, terms, _sign(-phase * series.numbers[3], series.numbers[4]), gap)
        return found, found
    speed = series.v[0, 0]
    spread = magnitude(series.v[0, 1:])
    for k in range(1, terms):
        spread += magnitude(series.v[k])
    for k in range(terms):
        work[k] = -series.u[k]
    work[0] += plastic - storey.rows[DRIFT]
    below = _bound(work, terms, _sign(-speed, spread), gap)
    for k in range(terms):
        work[k] = series.u[k]
    work[0] -= plastic + storey.rows[DRIFT]
    return below, _bound(work, terms, _sign(speed, spread), gap)


@compiled
def _sign(midpoint: float, radius: float) -> float:
    """Return the sign of all numbers of an interval, 0 if they have no common one."""
    if abs(midpoint) <= radius:
        return 0.0
    return math.copysign(1.0, midpoint)


@compiled
def _bound(series: Array, terms: int, slope: float, gap: float) -> float:
    """Return an upper bound of a series over the element, or any negative one if there is such.

    `slope` is the sign of its derivative at all inputs and times, 0 where it has none.
    """
    # mostly the sum of all magnitudes shows that there is no event
    rough = series[0, 0] + magnitude(series[0, 1:])
    for k in range(1, terms):
        rough += magnitude(series[k])
    if rough < 0:
        return float(rough)
    if slope != 0:
        work = np.empty(series.shape[1])
        return float(max_at(series, terms, 1.0 if slope > 0 else 0.0, work))
    return float(upper_bound(series, terms, 0.0, 1.0, gap, 0.0))


@compiled
def first_crossing(
    storey: Storey, phase: float, plastic: Array, series: Series, tolerance: float, longest: float
) -> tuple[float, float]:
    """Return τ at which the motion at the midpoint of the box meets an event, and its side.

    The series is followed beyond its element, so that τ is a guess. It is −1 if no event is met up
    to `longest`. The side is the direction in which an elastic storey yields, else 0.
    """
    terms = int(series.numbers[0])
    step = 0.125
    before = np.array([np.inf, np.inf])
    low = 0.0
    while low <= longest:
        for which in range(2):
            side = 2.0 * which - 1.0
            if phase != 0 and which == 0:
                continue
            value = _margin(storey, phase, plastic, series, terms, side, low) - tolerance
            if value > 0 and before[which] <= 0:
                begin = low - step
                end = low
                for _ in range(40):
                    middle = (begin + end) / 2
                    at = _margin(storey, phase, plastic, series, terms, side, middle) - tolerance
                    if at > 0:
                        end = middle
                    else:
                        begin = middle
                if phase != 0:
                    side = 0.0
                return end, side
            before[which] = value
        low += step
    return -1.0, 0.0


@compiled
def _margin(
    storey: Storey,
    phase: float,
    plastic: Array,
    series: Series,
    terms: int,
    side: float,
    tau: float,
) -> float:
    """Return by how much the midpoint's motion passes an event at τ, as `excess` counts it."""
    value = 0.0
    for k in range(terms - 1, -1, -1):
        x = series.u[k, 0] if phase == 0 else series.v[k, 0]
        value = value * tau + x
    if phase != 0:
        return -phase * value
    return float(side * (value - plastic[0]) - storey.rows[DRIFT, 0])


@compiled
def load_at(load: Load, piece: int, start: Array, out: Array) -> None:
    """Write the load of an interval at the times `start`, shape (N,), to `out`."""
    out[:] = load.slope[piece] * start
    out[0] += load.first[piece] - load.slope[piece] * load.edges[piece]


@compiled
def solve_event(
    storey: Storey, phase: float, side: float, plastic: Array, start: tuple[Array, Array, Array],
    load: tuple[Array, float], end: Array, series: Series,
) -> float:  # fmt: skip
    """Find the time of an event as a polynomial of the inputs by Newton's method.

    Args:
        storey: The storey.
        phase: 0 while it is elastic, else the direction of yielding.
        side: Direction in which an elastic storey yields.
        plastic: Plastic drift of an elastic storey, shape (N,).
        start: Displacement, velocity and time at which the element begins, shape (N,) each.
        load: Acceleration at its beginning, shape (N,), and its slope over time.
        end: Guess of the time of the event, shape (N,); replaced by the best time met.
        series: Receives the motion up to that time.

    Returns:
        A bound of |z̃ − side y| or of |ṽ| at that time, which may lie before the beginning somewhere
        in the box; infinite if there is no such time.
    """
    n = len(end)
    best = np.inf
    best_end = end.copy()
    state = (start[0], start[1])
    u, v, h, slope, work, inverse = np.zeros((6, n))
    frequency = math.sqrt(storey.magnitude[ELASTIC])
    for _ in range(MAX_STEPS):
        h[:] = end - start[2]
        if not (h[0] > 0 and magnitude(h) * frequency < 4.0):
            break
        expand(storey, phase, plastic, state, h, load, series)
        terms = int(series.numbers[0])
        total(series.u, terms, u)
        total(series.v, terms, v)
        if phase == 0:
            for i in range(n):
                u[i] = side * (u[i] - plastic[i]) - storey.rows[DRIFT, i]
                slope[i] = side * v[i]
        else:
            multiply(storey.rows[DAMPING], v, storey.table, work)
            slope[:] = work
            multiply(storey.rows[YIELDED], u, storey.table, work)
            for i in range(n):
                slope[i] += work[i] + phase * storey.rows[FORCE, i] - load[0][i] - load[1] * h[i]
                slope[i] *= phase
                u[i] = -phase * v[i]
        size = magnitude(u)
        if size < best:
            best = size
            best_end[:] = end
        elif size > best:
            break
        if not reciprocal(slope, storey.table, inverse) or inverse[0] < 0:
            break
        multiply(u, inverse, storey.table, work)
        end -= work
        if magnitude(work) <= 1e-16 * abs(end[0]):
            break
    end[:] = best_end
    h[:] = end - start[2]
    if best == np.inf:
        return np.inf
    expand(storey, phase, plastic, state, h, load, series)
    return best


@compiled
def load_error(load: Load, piece: int, begin: float, end: float, out: Array) -> None:
    """Write integrals from `begin` to `end` of the load less the extended one of an interval.

    `out` receives A and B, this difference integrated once and twice, and bounds of |A| and |B| on
    the way, shape (4,). The difference is linear on each interval, so that the trapezoidal rule is
    exact for it, and bounds the integral of its magnitude from above (it is convex).
    """
    out[:] = 0.0
    e = piece
    while e > 0 and load.edges[e] > begin:
        e -= 1
    while e < len(load.first) and load.edges[e] < end:
        low = max(begin, load.edges[e])
        high = min(end, load.edges[e + 1])
        if high > low:
            left = load.first[e] + load.slope[e] * (low - load.edges[e])
            left -= load.first[piece] + load.slope[piece] * (low - load.edges[piece])
            rise = (load.slope[e] - load.slope[piece]) * (high - low)
            if e == piece:
                left = rise = 0.0
            width = high - low
            out[1] += width * out[0] + width**2 * (left / 2 + rise / 6)
            out[0] += width * (left + rise / 2)
            out[2] += width * (abs(left) + abs(left + rise)) / 2
        e += 1
    out[3] = out[2] * (end - begin)
