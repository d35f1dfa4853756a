"""Compiled bounds of the outputs of a yielding storey on an element of its motion.

`yielding_march` makes the elements, and `yielding_element` has the equations.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.kernels import compiled
from alphacut.frame.bounds.yielding_element import Load, Series, Storey
from alphacut.frame.calculus.truncated_polynomials import magnitude, multiply, upper_bound

# Fraction of an output's peak to which bounds within elements are refined (tuned).
PEAK_GAP = 1e-4
# Entries of `State.numbers`: direction of yielding, or 0; the last time that was the same at all
# inputs, in s; the bound S of the error in m/s, and its integral in m; what the plastic path lacks,
# in m; what the work of load, damping and defects is off, in m²/s²; the energy norm of the motion
# on the element, in m/s; the last direction s of yielding, with bounds of s z̃ − y in m and of s ṽ
# in m/s since then, as long as the storey is decelerated; the side at which an elastic storey may
# be beyond the yield drift, or 0; by how much it may be, in m; and the side from which it fell on
# the element before, or 0.
PHASE, WINDOW, ERROR, INTEGRAL, PATH, WORK, NORM, SIDE, TOP, TOP_SPEED, BEYOND, MOST, FALL = range(
    13
)
# Time in s below which two times are taken as the same one, far above rounding and far below steps.
SAME_TIME = 1e-12


class Observed(NamedTuple):
    """m outputs as linear functions of the state.

    An output is a_0 u + a_2 v − a_3 p + a_5 P of an elastic storey, with its plastic drift p and
    the length P = ∫ |p'| dt of the plastic path, and a_1 u + a_2 v + s a_4 + a_5 P of one that
    yields in the direction s. Its error is at most w_0 |Δu| + w_1 |Δv| + w_2 |Δz| + w_3 |ΔP|.
    """

    rows: Array  # coefficients a, (m, 6, N)
    remainder: Array  # bounds of what the polynomials leave out, (m, 6)
    weights: Array  # w, (m, 4)
    last: int  # index of the interval of the loads that begins at the end of the motion
    node: Ints  # number of the time node at each edge of the loads, −1 for none, (E + 1,)
    step: Ints  # number of the first time node behind each edge, T behind the last node, (E + 1,)


class Found(NamedTuple):
    """What a march writes."""

    bounds: Array  # largest (−output, output) at time nodes, (T, m, 2)
    steps: Array  # the same over the step before each node, with both its ends, (T, m, 2)
    peaks: Array  # the same over all times, (m, 2)
    events: Array  # direction of yielding, or 0; earliest and latest time, in s; (max_events, 3)


class State(NamedTuple):
    """State at the beginning of an element, as polynomials of the inputs, shape (N,) each.

    `slider` has the plastic drift p of an elastic storey, and its path P, or P − s u of a storey
    that yields in the direction s. `numbers` has the entries named above.
    """

    u: Array
    v: Array
    begin: Array  # time, in s
    slider: Array  # (2, N)
    numbers: Array  # (13,)


class Element(NamedTuple):
    """An element: its length, its load at τ = 0, and the motion on it.

    The load is that of the interval `integers[0]`, extended. At the end the edge `integers[1]` of
    the loads is reached, or none if it is −1.
    """

    h: Array  # (N,)
    pushed: Array  # acceleration by the load at τ = 0, (N,)
    series: Series
    integers: Ints  # (2,)
    work: Array  # (MAX_TERMS, N), overwritten


@compiled
def _output(
    storey: Storey, observed: Observed, row: int, state: State, motion: tuple[Array, Array],
    out: Array,
) -> float:  # fmt: skip
    """Write the series of an output to `out`, and return a bound of what it leaves out.

    Args:
        storey: The storey.
        observed: The outputs.
        row: Number of the output.
        state: Phase and slider.
        motion: Series of displacement and velocity, shape (terms or more, N).
        out: Series of the output, shape (terms, N).
    """
    u, v = motion
    a = observed.rows[row]
    rest = observed.remainder[row]
    phase = state.numbers[PHASE]
    on_u = 0 if phase == 0 else 1
    work = np.empty(out.shape[1])
    lost = multiply(a[5], state.slider[1], storey.table, out[0])
    lost += rest[5] * magnitude(state.slider[1])
    out[1:] = 0.0
    if phase == 0:
        lost += multiply(a[3], state.slider[0], storey.table, work)
        lost += rest[3] * magnitude(state.slider[0])
        out[0] -= work
    else:
        out[0] += phase * a[4]
        lost += rest[4]
    for k in range(len(out)):
        lost += multiply(a[on_u], u[k], storey.table, work)
        out[k] += work
        lost += multiply(a[2], v[k], storey.table, work)
        out[k] += work
        lost += (rest[on_u] + rest[5]) * magnitude(u[k]) + rest[2] * magnitude(v[k])
        if phase != 0:
            lost += multiply(a[5], u[k], storey.table, work)
            out[k] += phase * work
    return float(lost)


@compiled
def observe(
    storey: Storey, observed: Observed, load: Load, state: State, element: Element,
    errors: Array, is_fixed: bool, found: Found,
) -> None:  # fmt: skip
    """Raise peaks by an element, and bounds at the time nodes that it may contain.

    Args:
        storey: The storey.
        observed: The outputs.
        load: The load.
        state: State at the beginning of the element.
        element: The element.
        errors: Bounds of |Δu|, |Δv|, |Δz| and |ΔP|, shape (4,).
        is_fixed: Whether begin and end are the same at all inputs: then no time node lies inside.
        found: Its bounds are raised in place.
    """
    terms = int(element.series.numbers[0])
    n = len(element.h)
    series = np.empty((terms, n))
    negative = np.empty((terms, n))
    motion = (element.series.u, element.series.v)
    # the steps that the element may touch
    end = state.begin + element.h
    begin = state.begin[0] - magnitude(state.begin[1:])
    edge = np.searchsorted(load.edges, begin + SAME_TIME, side="right") - 1
    first = observed.step[max(edge, 0)]
    edge = np.searchsorted(load.edges, end[0] + magnitude(end[1:]) - SAME_TIME) - 1
    last = min(observed.step[max(edge, 0)], len(found.steps) - 1)
    for row in range(len(observed.rows)):
        error = _output(storey, observed, row, state, motion, series)
        error += (observed.weights[row] * errors).sum()
        negative[:] = -series
        gap = PEAK_GAP * max(found.peaks[row, 0], found.peaks[row, 1], 0.0)
        for side in range(2):
            chosen = negative if side == 0 else series
            most = upper_bound(chosen, terms, 0.0, 1.0, gap, -np.inf) + error
            found.peaks[row, side] = max(found.peaks[row, side], most)
            for step in range(first, last + 1):
                found.steps[step, row, side] = max(found.steps[step, row, side], most)
            if not is_fixed:
                _observe_inside(
                    observed, load, state, element, chosen, error, row, side, gap, found
                )


@compiled
def _observe_inside(
    observed: Observed, load: Load, state: State, element: Element, series: Array, error: float,
    row: int, side: int, gap: float, found: Found,
) -> None:  # fmt: skip
    """Raise the bounds of one side of an output at time nodes that an element may contain.

    A node t is met at τ = (t − begin) / h = 1 − (end − t) / h. The bounds of begin, end and h bound
    τ. A node at which the element begins or ends at all inputs is bounded elsewhere.
    """
    spread = magnitude(state.begin[1:])
    first = state.begin[0] - spread
    last = state.begin[0] + spread
    end = state.begin + element.h
    spread_of_end = magnitude(end[1:])
    longest = magnitude(element.h)
    shortest = 2 * element.h[0] - longest
    edge = np.searchsorted(load.edges, first - SAME_TIME)
    if spread == 0:
        edge = np.searchsorted(load.edges, first + SAME_TIME)
    until = end[0] + spread_of_end + (SAME_TIME if spread_of_end > 0 else -SAME_TIME)
    while edge < len(load.edges) and load.edges[edge] <= until:
        node = observed.node[edge]
        time = load.edges[edge]
        edge += 1
        if node < 0:
            continue
        low = (time - last) / longest
        high = 1 - (end[0] - spread_of_end - time) / longest
        if shortest > 0:
            low = max(low, 1 - (end[0] + spread_of_end - time) / shortest)
            high = min(high, (time - first) / shortest)
        low = min(max(low - SAME_TIME, 0.0), 1.0)
        high = min(max(high + SAME_TIME, low), 1.0)
        most = error + upper_bound(series, len(series), low, high, gap, -np.inf)
        found.bounds[node, row, side] = max(found.bounds[node, row, side], most)


@compiled
def observe_node(
    storey: Storey, observed: Observed, state: State, errors: Array, node: int, found: Found
) -> None:
    """Raise the bounds at a time node, and the peaks, by the state at this time at all inputs."""
    n = len(state.u)
    motion = (state.u.reshape(1, n), state.v.reshape(1, n))
    value = np.empty((1, n))
    for row in range(len(observed.rows)):
        error = _output(storey, observed, row, state, motion, value)
        radius = magnitude(value[0, 1:]) + error + (observed.weights[row] * errors).sum()
        for side in range(2):
            most = radius + (value[0, 0] if side else -value[0, 0])
            found.bounds[node, row, side] = max(found.bounds[node, row, side], most)
            found.steps[node, row, side] = max(found.steps[node, row, side], most)
            found.peaks[row, side] = max(found.peaks[row, side], most)
