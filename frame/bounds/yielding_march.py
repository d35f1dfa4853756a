"""Compiled march over all elements of the motion of one yielding storey over a box of inputs.

`yielding_element` has the equations and the inequality that bounds the error.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.kernels import compiled
from alphacut.frame.bounds.yielding_element import (
    DAMPING,
    DRIFT,
    ELASTIC,
    FORCE,
    MAX_TERMS,
    SLIDER,
    YIELDED,
    Load,
    Series,
    Storey,
    excess,
    expand,
    first_crossing,
    load_at,
    load_error,
    solve_event,
    total,
)
from alphacut.frame.bounds.yielding_outputs import (
    BEYOND,
    ERROR,
    FALL,
    INTEGRAL,
    MOST,
    NORM,
    PATH,
    PHASE,
    SAME_TIME,
    SIDE,
    TOP,
    TOP_SPEED,
    WINDOW,
    WORK,
    Element,
    Found,
    Observed,
    State,
    observe,
    observe_node,
)
from alphacut.frame.calculus.truncated_polynomials import magnitude, multiply

# Fraction of the yield drift, or of the velocity ω y, by which a state may pass an event without
# one being looked for (tuned: a smaller violation costs less than the event's own error).
IGNORED = 1e-9
# Fraction of what is passed without an event that its residual may be (tuned: with a larger one it
# is better left out).
MAX_RESIDUAL = 0.1
# Number of elements of the present length in which an event at the midpoint is looked for.
LOOK_AHEAD = 6.0
# Elements for each interval of the loads after which a march has failed.
MAX_ELEMENTS = 20
# How a march ends: at its last time, or where the error has passed its limit.
PROVED, TOO_WIDE = 0, 1


class End(NamedTuple):
    """How a march ends: its status, the bound S of the error, number of events, and last time."""

    status: int
    error: float
    events: int
    time: float


@compiled
def march(
    storey: Storey, load: Load, observed: Observed, start: tuple[Array, Array], limit: float,
    found: Found,
) -> tuple[int, float, int, float]:  # fmt: skip
    """Enclose the motion at all inputs of a box from t = 0 on, and return an `End` as a tuple.

    Args:
        storey: The storey.
        load: The load, whose intervals reach beyond the end of the motion.
        observed: The outputs.
        start: Displacement, less than y, and velocity at t = 0, shape (N,) each.
        limit: Bound S of the error, in m/s, at which the march ends.
        found: Receives the result; all bounds must begin with −∞.
    """
    n = len(start[0])
    state = State(start[0].copy(), start[1].copy(), np.zeros(n), np.zeros((2, n)), np.zeros(13))
    series = Series(np.zeros((MAX_TERMS, n)), np.zeros((MAX_TERMS, n)), np.zeros(5))
    element = Element(
        np.zeros(n), np.zeros(n), series, np.zeros(2, np.int64), np.zeros((MAX_TERMS, n))
    )
    event = np.zeros(n)  # time of the event that ends the element
    by_load = np.zeros(4)
    errors = np.zeros(4)
    numbers = state.numbers
    is_fixed = True  # whether the element begins at one time
    n_events = elements = 0
    # States at the last two times that were the same at all inputs, with interval and events, and
    # the time of the last one if the march has gone back to the first one for an event before it.
    last = _copy(state)
    before_last = _copy(state)
    counts = np.zeros((2, 2), np.int64)
    sought = np.inf
    sought_passed = 0.0
    observe_node(storey, observed, state, errors, 0, found)
    while not (is_fixed and element.integers[0] >= observed.last):
        if is_fixed:
            numbers[WINDOW] = state.begin[0]
            _assign(last, before_last)
            _assign(state, last)
            counts[1] = counts[0]
            counts[0] = (element.integers[0], n_events)
        target = _target(load, state, element, is_fixed)
        if target < 0:
            return TOO_WIDE, numbers[ERROR], n_events, state.begin[0]
        _to_time(storey, load, state, target, element)
        passed = _passed(storey, state, element)
        side, residual = 0.0, np.inf
        is_sought = target >= sought
        if passed > _tolerance(storey, numbers[PHASE]) or is_sought:
            most = max(passed, sought_passed) if is_sought else passed
            side, residual, known = _event(
                storey, load, state, target, most, is_fixed, is_sought, event, element
            )
            if residual < 0:
                # Somewhere in the box the event may come before the element begins: the march goes
                # back by one time, from where the event is sought.
                residual = np.inf
                if sought == np.inf and state.begin[0] > 0:
                    sought = state.begin[0]
                    sought_passed = passed
                    _assign(before_last, state)
                    element.integers[0] = counts[1, 0]
                    n_events = counts[1, 1]
                    _assign(before_last, last)
                    counts[0] = counts[1]
                    continue
            passed = min(_passed(storey, state, element), known)
            if element.integers[1] < 0:
                target = state.begin[0] + element.h[0]
        elements += 1
        if elements > MAX_ELEMENTS * observed.last:
            return TOO_WIDE, np.inf, n_events, state.begin[0]
        is_event = residual < np.inf

        until = target
        if is_event:
            until = event[0] + magnitude(event[1:])
        load_error(load, element.integers[0], numbers[WINDOW], until, by_load)
        _add_defects(storey, load, state, element, passed, residual, by_load)
        if not numbers[ERROR] <= limit:
            return TOO_WIDE, numbers[ERROR], n_events, state.begin[0]
        _write_errors(storey, numbers, by_load, errors)
        observe(storey, observed, load, state, element, errors, is_fixed and not is_event, found)

        terms = int(series.numbers[0])
        total(series.u, terms, state.u)
        total(series.v, terms, state.v)
        state.begin[:] += element.h
        if is_event:
            if n_events < len(found.events):
                _record(storey, load, state, element, side, errors, found.events[n_events])
            n_events += 1
            _switch(storey, state, side)
            is_fixed = False
            continue
        if target > sought:
            sought = np.inf
        # From here on the exact load acts: what it adds is the same at all inputs.
        state.u[0] += by_load[1]
        state.v[0] += by_load[0]
        numbers[TOP] += by_load[3]
        numbers[TOP_SPEED] += by_load[2]
        state.begin[:] = 0.0
        state.begin[0] = target
        is_fixed = True
        edge = element.integers[1]
        if edge < 0:
            edge = np.searchsorted(load.edges, target, side="right") - 1
        elif observed.node[edge] >= 0:
            by_load[:] = 0.0
            _write_errors(storey, numbers, by_load, errors)
            observe_node(storey, observed, state, errors, observed.node[edge], found)
        element.integers[0] = edge
    return PROVED, numbers[ERROR], n_events, state.begin[0]


@compiled
def _tolerance(storey: Storey, phase: float) -> float:
    """Return by how much a state may pass an event without one being looked for."""
    ignored = IGNORED * storey.magnitude[DRIFT]
    if phase != 0:
        ignored *= math.sqrt(storey.magnitude[ELASTIC])
    return float(ignored)


@compiled
def _target(load: Load, state: State, element: Element, is_fixed: bool) -> float:
    """Return the time at which an element without an event ends, and set its edge.

    It is the next edge of the loads, or, where the time of the last event may lie on both sides of
    an edge, the latest time of it; −1 behind the last edge.
    """
    piece = element.integers[0]
    if is_fixed:
        element.integers[1] = piece + 1
        return float(load.edges[piece + 1])
    latest = state.begin[0] + magnitude(state.begin[1:])
    edge = np.searchsorted(load.edges, latest + SAME_TIME)
    if edge >= len(load.edges):
        return -1.0
    if load.edges[edge - 1] > state.numbers[WINDOW] + SAME_TIME:
        element.integers[1] = -1
        return float(latest)
    element.integers[1] = edge
    return float(load.edges[edge])


@compiled
def _to_time(storey: Storey, load: Load, state: State, target: float, element: Element) -> None:
    """Write the motion up to a time that is the same at all inputs to `element`."""
    element.h[:] = -state.begin
    element.h[0] += target
    piece = element.integers[0]
    load_at(load, piece, state.begin, element.pushed)
    expand(
        storey, state.numbers[PHASE], state.slider[0], (state.u, state.v), element.h,
        (element.pushed, load.slope[piece]), element.series,
    )  # fmt: skip


@compiled
def _passed(storey: Storey, state: State, element: Element) -> float:
    """Return by how much the state may pass an event on an element; see `excess`."""
    numbers = state.numbers
    phase = numbers[PHASE]
    gap = _tolerance(storey, phase)
    below, above = excess(storey, phase, state.slider[0], element.series, gap, element.work)
    if phase == 0 and _is_decelerated(state, element):
        # Since the end of yielding the velocity s ṽ falls, so that z̃ leaves the yield drift.
        known = numbers[TOP] + magnitude(element.h) * max(numbers[TOP_SPEED], 0.0)
        if numbers[SIDE] > 0:
            above = min(above, known)
        else:
            below = min(below, known)
    numbers[BEYOND] = 0.0
    if min(below, above) <= 0:
        numbers[BEYOND] = 1.0 if above > below else -1.0
    return float(max(below, above))


@compiled
def _is_decelerated(state: State, element: Element) -> bool:
    """Return whether s ṽ falls on an element at all inputs, s the last direction of yielding."""
    side = state.numbers[SIDE]
    return bool(side * element.series.numbers[3] + element.series.numbers[4] < 0)


@compiled
def _event(
    storey: Storey, load: Load, state: State, target: float, passed: float, is_fixed: bool,
    is_sought: bool, event: Array, element: Element,
) -> tuple[float, float, float]:  # fmt: skip
    """Let the element end at the next event if there is one.

    The residual, in m or m/s, is infinite where the element has no event: because the midpoint of
    the box meets none; because the event comes later at all inputs; because Newton's method does
    not find its time as a polynomial; or because the element was shortened, see below. It is −1
    where the event may come before the element begins, which begins at one time.

    Args:
        storey: The storey.
        load: The load.
        state: State at the beginning of the element.
        target: Time at which the element ends without an event.
        passed: By how much the state may pass an event up to there.
        is_fixed: Whether the element begins at one time.
        is_sought: Whether the march has gone back for the event.
        event: Receives the time of the event.
        element: The motion up to `target`; replaced by that up to the event.

    Returns:
        The side of the event, its residual, and a bound of what the state on the element may pass,
        which is infinite if none is known.
    """
    phase = state.numbers[PHASE]
    tolerance = _tolerance(storey, phase)
    piece = element.integers[0]
    h = element.h[0]
    spacing = load.edges[piece + 1] - load.edges[piece]
    far = min(LOOK_AHEAD * spacing, 2.0 / math.sqrt(storey.magnitude[ELASTIC]))
    ahead = max(far / max(h, 1e-300), 1.0)
    tau, side = first_crossing(
        storey, phase, state.slider[0], element.series, tolerance / 2, min(ahead, 1e4)
    )
    if tau <= 0:
        return 0.0, np.inf, np.inf
    event[:] = 0.0
    event[0] = state.begin[0] + tau * h
    residual = _solve(storey, load, state, side, piece, event, element)
    spread = magnitude(event[1:])
    first = event[0] - spread
    last = event[0] + spread
    h_min = event[0] - state.begin[0] - magnitude(event[1:] - state.begin[1:])
    is_found = residual < MAX_RESIDUAL * passed
    # If the march has gone back, the event may come a little earlier than under the load here.
    margin = 0.3 * spread if is_sought else 0.0
    if not is_found or last >= load.edges[-3] or first >= target + margin:
        known = np.inf
        if is_found and first >= target and h_min >= 0:
            # What holds up to the event at all inputs holds on the shorter element.
            element.h[:] = event - state.begin
            known = _passed(storey, state, element)
        _to_time(storey, load, state, target, element)
        return 0.0, np.inf, known
    # Up to the first time of the event the motion goes on without one, so that fewer intervals of
    # the load meet in the element with the event.
    if is_fixed and last > target and first > state.begin[0] + spacing / 50:
        for part in (0.05, 0.3, 1.0):
            end = min(first - part * spread, target) - spacing / 1000
            if (is_sought and part < 0.1) or end <= state.begin[0]:
                continue
            _to_time(storey, load, state, end, element)
            if _passed(storey, state, element) <= tolerance:
                element.integers[1] = -1
                return 0.0, np.inf, np.inf
    if is_fixed and last > target:
        # the load of the interval in which the event lies at the midpoint
        piece = max(np.searchsorted(load.edges, event[0]) - 1, piece)
        residual = _solve(storey, load, state, side, piece, event, element)
        h_min = event[0] - state.begin[0] - magnitude(event[1:] - state.begin[1:])
    if not residual < MAX_RESIDUAL * passed or not h_min >= 0:
        _to_time(storey, load, state, target, element)
        return 0.0, -1.0 if is_fixed else np.inf, np.inf
    element.h[:] = event - state.begin
    element.integers[0] = piece
    return side, residual, np.inf


@compiled
def _solve(
    storey: Storey, load: Load, state: State, side: float, piece: int, event: Array,
    element: Element,
) -> float:  # fmt: skip
    """Return `solve_event` under the load of the interval `piece`, extended."""
    load_at(load, piece, state.begin, element.pushed)
    residual: float = solve_event(
        storey, state.numbers[PHASE], side, state.slider[0], (state.u, state.v, state.begin),
        (element.pushed, load.slope[piece]), event, element.series,
    )  # fmt: skip
    return residual


@compiled
def _copy(state: State) -> State:
    """Return a copy of a state."""
    return State(
        state.u.copy(), state.v.copy(), state.begin.copy(), state.slider.copy(),
        state.numbers.copy(),
    )  # fmt: skip


@compiled
def _assign(source: State, target: State) -> None:
    """Write a state to another one."""
    target.u[:] = source.u
    target.v[:] = source.v
    target.begin[:] = source.begin
    target.slider[:] = source.slider
    target.numbers[:] = source.numbers


@compiled
def _add_defects(
    storey: Storey, load: Load, state: State, element: Element, passed: float, residual: float,
    by_load: Array,
) -> None:  # fmt: skip
    """Add the defects of an element to the bounds of errors in the state.

    Args:
        storey: The storey.
        load: The load.
        state: State at the beginning, whose `numbers` are changed in place.
        element: The element.
        passed: By how much the state may pass an event; see `excess`.
        residual: What the state at the end is off the event, infinite without one.
        by_load: Integrals A and B of the load less the extended one, and bounds of them, (4,).
    """
    numbers = state.numbers
    size = storey.magnitude
    stiff = ELASTIC if numbers[PHASE] == 0 else YIELDED
    longest = magnitude(element.h)
    root_slider = math.sqrt(size[SLIDER])
    error = math.sqrt(size[ELASTIC]) * element.series.numbers[1] + element.series.numbers[2]
    error += longest * (size[DAMPING] * by_load[2] + size[stiff] * by_load[3])
    if _is_decelerated(state, element):
        numbers[TOP] += longest * max(numbers[TOP_SPEED], 0.0)
    else:
        numbers[TOP] = numbers[TOP_SPEED] = np.inf
    moved = 0.0  # what the slider is moved without a velocity
    if numbers[PHASE] == 0:
        beyond = max(passed + by_load[3] + storey.remainder[DRIFT], 0.0)
        error += longest * size[SLIDER] * beyond
        numbers[PATH] += 2 * beyond
        numbers[MOST] = beyond
        fall = _fall(state, element) if by_load[3] == 0 else 0.0
        # While z̃ rises the slider flows as it may. Over elements in a row on which z̃ falls at
        # all inputs, it falls by no more than it was beyond the yield drift at first.
        if beyond > 0 and fall >= 0 and not (fall > 0 and numbers[FALL] == numbers[BEYOND]):
            moved += beyond
        numbers[FALL] = numbers[BEYOND] if beyond > 0 and fall > 0 else 0.0
    else:
        numbers[FALL] = 0.0
        numbers[MOST] = 0.0
        moved += longest * max(passed + by_load[2], 0.0)
        error += longest * size[SLIDER] * storey.remainder[DRIFT]
    if residual < np.inf:
        # The slider is moved to the yield drift, or the plastic drift is taken without B.
        moved += by_load[3] + 2 * storey.remainder[DRIFT]
        if numbers[PHASE] == 0:
            moved += residual
    error += root_slider * moved
    numbers[ERROR] += error
    # |Δu| ≤ ∫ S dt + ∫ |δ_u| dt, as Δu' = Δv + δ_u
    numbers[INTEGRAL] += longest * numbers[ERROR] + element.series.numbers[1]
    numbers[PATH] += 2 * moved

    # The balance of energy of the motion is off by the work of the defects, and differs from that
    # of the exact motion by the works of load and damping on the error of the velocity.
    speed = by_load[2]
    displacement = by_load[3]
    for k in range(int(element.series.numbers[0])):
        speed += magnitude(element.series.v[k])
        displacement += magnitude(element.series.u[k])
    norm = speed**2 + size[YIELDED] * displacement**2 + size[SLIDER] * size[DRIFT] ** 2
    numbers[NORM] = math.sqrt(norm)
    push = magnitude(element.pushed) + abs(load.slope[element.integers[0]]) * longest
    damped = size[DAMPING] * (2 * speed + numbers[ERROR])
    numbers[WORK] += numbers[NORM] * error
    numbers[WORK] += numbers[ERROR] * (longest * (push + damped) + by_load[2])


@compiled
def _fall(state: State, element: Element) -> float:
    """Return 1 if z̃ falls at all inputs and times, −1 if it rises, and else 0.

    It is counted from the side at which it may be beyond the yield drift; 0 where this is not one.
    """
    v = element.series.v
    spread = magnitude(v[0, 1:])
    for k in range(1, int(element.series.numbers[0])):
        spread += magnitude(v[k])
    if abs(v[0, 0]) <= spread:
        return 0.0
    return float(-state.numbers[BEYOND] * math.copysign(1.0, v[0, 0]))


@compiled
def _write_errors(storey: Storey, numbers: Array, by_load: Array, errors: Array) -> None:
    """Write bounds of |Δu|, |Δv|, |Δz| and |ΔP| up to now to `errors`, shape (4,).

    The path follows from the balance of energy. With the force F = K_z y, F P is the work of the
    load less that of damping and less the energy, which is half the square of the norm N of the
    motion, and is off by at most (N + S/2) S with an error S of the norm. Where z̃ is beyond the
    yield drift, it differs by as much from the slider's, which the inequality is about.
    """
    S = numbers[ERROR]
    u = numbers[INTEGRAL]
    if storey.min_yielded > 0:
        u = min(u, S / math.sqrt(storey.min_yielded))
    work = numbers[WORK] + S * (numbers[NORM] + S / 2)
    errors[0] = u + by_load[3]
    errors[1] = S + by_load[2]
    errors[2] = S / math.sqrt(storey.min_slider) + by_load[3] + numbers[MOST]
    errors[3] = work / storey.min_force + numbers[PATH] + by_load[3]


@compiled
def _record(
    storey: Storey, load: Load, state: State, element: Element, side: float, errors: Array,
    event: Array,
) -> None:  # fmt: skip
    """Write an event, which ends the element before the state, to `event`, shape (3,).

    The approximate motion passes the event with a slope a; the exact one, which differs by at most
    e, does so within e / a. The slope at the event is halved for its change near there; where a
    bound of it is not positive, the time is not bounded.
    """
    phase = state.numbers[PHASE]
    if phase == 0:
        slope = side * state.v[0] - magnitude(state.v[1:])
        distance = errors[2]
    else:
        # the deceleration c v + K_p u + s F − load
        work = np.empty_like(state.u)
        slope_of_load = load.slope[element.integers[0]]
        deceleration = -element.pushed - slope_of_load * element.h + phase * storey.rows[FORCE]
        multiply(storey.rows[DAMPING], state.v, storey.table, work)
        deceleration += work
        multiply(storey.rows[YIELDED], state.u, storey.table, work)
        deceleration += work
        slope = phase * deceleration[0] - magnitude(deceleration[1:])
        distance = errors[1]
    around = np.inf
    if slope > 0:
        around = 2 * distance / slope
    spread = magnitude(state.begin[1:]) + around
    event[0] = side
    event[1] = state.begin[0] - spread
    event[2] = state.begin[0] + spread


@compiled
def _switch(storey: Storey, state: State, side: float) -> None:
    """Let an elastic storey yield in the direction `side`, or one that yields be elastic."""
    phase = state.numbers[PHASE]
    if phase == 0:
        state.slider[1] -= side * state.u
        state.numbers[PHASE] = side
    else:
        state.slider[0] = state.u - phase * storey.rows[DRIFT]
        state.numbers[SIDE] = phase
        state.numbers[TOP] = 0.0
        state.numbers[TOP_SPEED] = magnitude(state.v)
        state.slider[1] += phase * state.u
        state.numbers[PHASE] = 0.0
