"""Compiled motions of a frame with a yielding storey at parameter sets with one order of events.

`interpolated_defects` interpolates these motions over a box of inputs, bounds by how much the
interpolant misses the equations there, and has the equations. Nothing is proved here: a motion that
is wrong has large defects.

The unknowns are X = q − Σ w_l g_l and P = M X' + C q with the displacements q relative to the
ground. Each load f_l(t) accelerates the floors by w_l f_l, and g_l is its integral twice over time:

    X' = M⁻¹ (P − C q),    P' = −K_p q − b r,    q = X + Σ w_l g_l.

Here r is the force of the slider of the storey with the drift bᵀ q. It is K_z bᵀ q − c while the
storey is elastic, with a constant c, and ± its yield force while it yields. So the loads enter by
g_l alone. It has two derivatives in which only the second one jumps or has kinks, so that one
polynomial approximates it over several samples.

Time is cut into elements, which begin and end at a time that is the same at all parameter sets, at
an event, or at a fixed fraction of the time between two of these.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.kernels import compiled

# Largest number of terms of a Taylor series over an element, and the fraction of the largest term
# at which it ends. What is left out is a part of the defects.
MAX_TERMS = 22
LAST_TERM = 1e-15
# Number of terms of a load's polynomial over an element (tuned: a degree of 7 misses some 1e-8 of a
# ground's displacement where an event may come at several samples).
LOAD_TERMS = 8
# Points at which the load is interpolated, and the matrix from values to powers; the matrix from
# values at the points (1 + s) / 2 to Bernstein coefficients on [0, 1].
FIT_POINTS = np.cos(np.pi * (np.arange(LOAD_TERMS) + 0.5) / LOAD_TERMS)
FIT = np.linalg.inv(np.vander(FIT_POINTS, LOAD_TERMS, increasing=True))
BERNSTEIN = np.linalg.inv(
    np.array(
        [
            [
                math.comb(LOAD_TERMS - 1, i) * s**i * (1 - s) ** (LOAD_TERMS - 1 - i)
                for i in range(LOAD_TERMS)
            ]
            for s in (1 + FIT_POINTS) / 2
        ]
    )
)
# Spread of the time of an event, as a fraction of its duration, above which it is left out, and
# fraction of the room at its time that it may take then (tuned).
SHORT_EVENT = 0.3
SHORT_ROOM = 0.2
# What an event that is left out costs, as a multiple of how far the slider is moved, with what the
# force that is missed meanwhile pushes (tuned).
COST = 1.2
# Time of an event that does not come, in s.
NEVER = 1e30
# How a march ends.
DONE, NO_COMMON_ORDER, TOO_MANY = range(3)


class Frames(NamedTuple):
    """A frame of N floors at J parameter sets under L loads."""

    inverse_mass: Array  # (J, N), in 1/kg
    damping: Array  # C, (J, N, N), in N s/m
    elastic: Array  # K_p + K_z b bᵀ, (J, N, N), in N/m
    yielded: Array  # K_p, (J, N, N), in N/m
    slider: Array  # K_z, (J,), in N/m
    force: Array  # yield force of the slider, (J,), in N
    place: int  # number of the yielding storey, from 0
    follow: Array  # w, (L, N)


class LoadIntegrals(NamedTuple):
    """g of L loads: cubic polynomials of the time since the beginning of each of E intervals."""

    edges: Array  # (E + 1,), in s
    powers: Array  # (E, L, 4)


class Elements(NamedTuple):
    """Motions at J parameter sets on at most E elements, with A the fraction τ that has passed."""

    begin: Array  # (E, J), in s
    length: Array  # (E, J), in s
    phase: Ints  # direction of yielding, or 0, (E,)
    constant: Array  # c of an elastic storey, in N, (E, J)
    path: Array  # plastic path of an elastic storey; of a yielding one less phase · drift, (E, J)
    series: Array  # powers of τ of X and P, (E, MAX_TERMS, 2N, J)
    load: Array  # powers of τ of the polynomials of g, (E, LOAD_TERMS, L, J)
    fit: Array  # powers of (t − midpoint) / radius of these, (E, L, LOAD_TERMS)
    span: Array  # midpoint and radius of the times of an element, in s, (E, 2)
    fit_error: Array  # bounds of |g − its polynomial|, and of the derivative by time, (E, L, 2)
    event: Ints  # side of the event at the end of the element, 0 without one, (E,)
    terms: Ints  # number of powers of τ, (E,)


@compiled
def _drift(x: Array, place: int) -> float:
    """Return the drift of a storey of displacements (N,)."""
    if place == 0:
        return float(x[0])
    return float(x[place] - x[place - 1])


@compiled
def _interval(loads: LoadIntegrals, t: float) -> int:
    """Return the interval of a time; that behind it where the time is an edge but for rounding."""
    i = int(np.searchsorted(loads.edges, t + 1e-11 * (1 + t), side="right")) - 1
    return min(max(i, 0), len(loads.powers) - 1)


@compiled
def _shifted(loads: LoadIntegrals, interval: int, t: float, h: float, out: Array) -> None:
    """Write the cubic of an interval by powers of (time − t) / h to `out`, shape (4 or more, L)."""
    s = t - loads.edges[interval]
    for load in range(loads.powers.shape[1]):
        a, b, c, d = loads.powers[interval, load]
        out[0, load] = a + s * (b + s * (c + s * d))
        out[1, load] = h * (b + s * (2 * c + s * 3 * d))
        out[2, load] = h**2 * (c + s * 3 * d)
        out[3, load] = h**3 * d


@compiled
def _expand(
    frames: Frames, j: int, phase: int, constant: float, load: Array, h: float, start: Array,
    series: Array,
) -> int:  # fmt: skip
    """Write the Taylor series of X and P over an element, and return its number of terms.

    Args:
        frames: The frames.
        j: Number of the parameter set.
        phase: Direction of yielding, or 0.
        constant: c of an elastic storey.
        load: Powers of τ of g, shape (terms, L).
        h: Length of the element.
        start: X and P at τ = 0, shape (2N,).
        series: Receives the powers of τ, shape (MAX_TERMS, 2N); the rest is set to zero.
    """
    n = len(start) // 2
    stiffness = frames.elastic[j] if phase == 0 else frames.yielded[j]
    damping = frames.damping[j]
    slider = -constant if phase == 0 else phase * frames.force[j]
    place = frames.place
    q = np.empty(n)
    series[:] = 0.0
    series[0] = start
    largest_x = largest_p = 0.0
    terms = MAX_TERMS
    small = 0
    for k in range(MAX_TERMS - 1):
        x_size = p_size = 0.0
        for i in range(n):
            q[i] = series[k, i]
            if k < len(load):
                for c in range(load.shape[1]):
                    q[i] += frames.follow[c, i] * load[k, c]
            x_size = max(x_size, abs(series[k, i]))
            p_size = max(p_size, abs(series[k, n + i]))
        largest_x = max(largest_x, x_size)
        largest_p = max(largest_p, p_size)
        if k >= LOAD_TERMS and x_size <= LAST_TERM * largest_x and p_size <= LAST_TERM * largest_p:
            small += 1
            if small == 2:
                terms = k + 1
                break
        else:
            small = 0
        for i in range(n):
            momentum = series[k, n + i]
            force = 0.0
            for m in range(n):
                momentum -= damping[i, m] * q[m]
                force -= stiffness[i, m] * q[m]
            if k == 0 and i == place:
                force -= slider
            if k == 0 and i == place - 1:
                force += slider
            series[k + 1, i] = h * momentum * frames.inverse_mass[j, i] / (k + 1)
            series[k + 1, n + i] = h * force / (k + 1)
    return terms


@compiled
def _drift_series(
    frames: Frames, series: Array, load: Array, terms: int, out: Array
) -> None:  # fmt: skip
    """Write the powers of τ of the drift bᵀ q of the yielding storey to `out`."""
    for k in range(terms):
        out[k] = _drift(series[k], frames.place)
        if k < len(load):
            for c in range(load.shape[1]):
                out[k] += _drift(frames.follow[c], frames.place) * load[k, c]


@compiled
def _excess(
    frames: Frames, j: int, phase: int, constant: float, drift: Array, terms: int, tau: float,
    h: float, side: int,
) -> tuple[float, int]:  # fmt: skip
    """Return by how much the state at τ passes the next event, in N or m/s, and its side."""
    value = 0.0
    if phase != 0:
        for k in range(terms - 1, 0, -1):
            value = value * tau + k * drift[k]
        return -phase * value / h, 0
    for k in range(terms - 1, -1, -1):
        value = value * tau + drift[k]
    force = frames.slider[j] * value - constant
    if side == 0:
        side = 1 if force > 0 else -1
    return side * force - frames.force[j], side


@compiled
def _next_event(
    frames: Frames, loads: LoadIntegrals, j: int, phase: int, constant: float, t: float,
    after: float, state: Array, longest: float, until: float, room: Array, spent: float,
) -> tuple[float, int, float, float]:  # fmt: skip
    """Return the next event of one motion, behind the time `after`.

    Args:
        frames: The frames.
        loads: The loads.
        j: Number of the parameter set.
        phase: Direction of yielding, or 0.
        constant: c of an elastic storey.
        t: Time of the state.
        after: Time behind which events count.
        state: X and P at t, shape (2N,).
        longest: Largest length of an element.
        until: Time at which the search ends.
        room: How far the slider may be moved at most from each interval on, in m, shape (E,).
        spent: How far it has been moved by events that were left out before, in m.

    Returns:
        Its time, `NEVER` if there is none; its side; the time at which the excess ends by itself or
        the search does, `NEVER` if it exceeds the room; and by how much the slider would be moved.
    """
    series = np.empty((MAX_TERMS, len(state)))
    load = np.zeros((4, loads.powers.shape[1]))
    drift = np.empty(MAX_TERMS)
    # Below this excess a motion has not passed an event (tuned: far above rounding).
    tolerance = 1e-11 * frames.force[j]
    if phase != 0:
        tolerance /= math.sqrt(frames.slider[j] / frames.inverse_mass[j, frames.place])
    # What the slider's excess force pushes counts as the move that adds as much to S.
    of_drift = frames.inverse_mass[j, frames.place]
    if frames.place > 0:
        of_drift += frames.inverse_mass[j, frames.place - 1]
    by_push = math.sqrt(of_drift / frames.slider[j])
    first = NEVER
    side = 0
    size = moved = pushed = 0.0
    passes = False
    y = state.copy()
    while t < until:
        i = _interval(loads, t)
        h = min(loads.edges[i + 1] - t, longest)
        _shifted(loads, i, t, h, load)
        terms = _expand(frames, j, phase, constant, load, h, y, series)
        _drift_series(frames, series, load, terms, drift)
        before = 0.0
        for m in range(1, 5):
            tau = m / 4
            value, its = _excess(frames, j, phase, constant, drift, terms, tau, h, side)
            if t + tau * h > after:
                if (value > tolerance) != passes:
                    low = before
                    high = tau
                    for _ in range(50):
                        mid = (low + high) / 2
                        value_there, _ = _excess(
                            frames,
                            j,
                            phase,
                            constant,
                            drift,
                            terms,
                            mid,
                            h,
                            side if passes else its,
                        )
                        if (value_there > tolerance) != passes and t + mid * h > after:
                            high = mid
                        else:
                            low = mid
                    if passes:
                        return first, side, t + high * h, size
                    passes = True
                    first = t + high * h
                    side = its
                if passes:
                    if phase == 0:
                        moved = max(moved, value / frames.slider[j])
                        pushed += value * h / 4
                        size = moved + by_push * pushed
                    else:
                        size += value * h / 4
                    if COST * size + spent > room[i]:
                        return first, side, NEVER, size
            before = tau
        for i in range(len(y)):
            y[i] = 0.0
            for k in range(terms):
                y[i] += series[k, i]
        t += h
    # What passes at the end of the search, and stays within the room, counts as ended there.
    return first, side, until if passes else NEVER, size


@compiled
def _fit_load(
    loads: LoadIntegrals, low: float, high: float, fit: Array, span: Array, error: Array
) -> None:  # fmt: skip
    """Write polynomials of g over [low, high] to `fit` and `span`, and bounds of what they miss.

    Within one interval g is a cubic polynomial, which is taken as it is. Else it is interpolated.
    On each interval the difference is a polynomial, which its Bernstein coefficients bound, as
    those of the derivative bound that.

    Args:
        loads: The loads.
        low: Earliest time.
        high: Latest time.
        fit: Receives the powers of (t − midpoint) / radius, shape (L, LOAD_TERMS).
        span: Receives midpoint and radius, shape (2,).
        error: Receives bounds of the difference and of its derivative by time, shape (L, 2).
    """
    count = loads.powers.shape[1]
    mid = (low + high) / 2
    rad = max((high - low) / 2, 1e-300)
    span[0] = mid
    span[1] = rad
    error[:] = 0.0
    fit[:] = 0.0
    cubic = np.zeros((4, count))
    first = _interval(loads, low)
    last = first
    while last + 1 < len(loads.powers) and loads.edges[last + 1] < high - 1e-11 * (1 + high):
        last += 1
    if first == last:
        _shifted(loads, first, mid, rad, cubic)
        for c in range(count):
            for k in range(4):
                fit[c, k] = cubic[k, c]
        return
    values = np.zeros((LOAD_TERMS, count))
    for p in range(LOAD_TERMS):
        t = mid + rad * FIT_POINTS[p]
        _shifted(loads, _interval(loads, t), t, 1.0, cubic)
        values[p] = cubic[0]
    for c in range(count):
        for k in range(LOAD_TERMS):
            for p in range(LOAD_TERMS):
                fit[c, k] += FIT[k, p] * values[p, c]
    bernstein = np.empty(LOAD_TERMS)
    for piece in range(first, last + 1):
        begin = max(loads.edges[piece], low)
        width = min(loads.edges[piece + 1], high) - begin
        if width <= 0:
            continue
        for c in range(count):
            for p in range(LOAD_TERMS):
                t = begin + width * (1 + FIT_POINTS[p]) / 2
                _shifted(loads, piece, t, 1.0, cubic)
                value = 0.0
                for k in range(LOAD_TERMS - 1, -1, -1):
                    value = value * (t - mid) / rad + fit[c, k]
                values[p, c] = cubic[0, c] - value
            for k in range(LOAD_TERMS):
                bernstein[k] = 0.0
                for p in range(LOAD_TERMS):
                    bernstein[k] += BERNSTEIN[k, p] * values[p, c]
                error[c, 0] = max(error[c, 0], abs(bernstein[k]))
                if k > 0:
                    slope = (LOAD_TERMS - 1) * abs(bernstein[k] - bernstein[k - 1]) / width
                    error[c, 1] = max(error[c, 1], slope)


@compiled
def _composed(fit: Array, span: Array, begin: float, h: float, out: Array) -> None:
    """Write a load's polynomials by powers of τ, t = begin + τ h, to `out`, (LOAD_TERMS, L)."""
    at_zero = (begin - span[0]) / span[1]
    slope = h / span[1]
    out[:] = 0.0
    for c in range(len(fit)):
        for k in range(LOAD_TERMS - 1, -1, -1):
            for m in range(LOAD_TERMS - 1, 0, -1):
                out[m, c] = out[m, c] * at_zero + out[m - 1, c] * slope
            out[0, c] = out[0, c] * at_zero + fit[c, k]


@compiled
def _most(values: Array, spectral: Array) -> float:
    """Bound what interpolates values at the parameter sets from above over the box."""
    found = 0.0
    for row in range(len(spectral)):
        coefficient = 0.0
        for column in range(len(values)):
            coefficient += spectral[row, column] * values[column]
        found += coefficient if row == 0 else abs(coefficient)
    return found


@compiled
def _mark_behind(loads: LoadIntegrals, t: float) -> int:
    """Return the number of the first edge that lies well behind a time."""
    i = _interval(loads, t) + 1
    if i < len(loads.powers) and loads.edges[i] - t < 0.25 * (loads.edges[i] - loads.edges[i - 1]):
        i += 1
    return int(i)


@compiled
def march(
    frames: Frames, loads: LoadIntegrals, start: Array, last: int, longest: float, window: float,
    room: Array, small: float, stride: int, spectral: Array, out: Elements,
) -> tuple[int, int]:  # fmt: skip
    """Write the motions of J frames with one order of events, and return how this ends.

    An event that some of the motions do not have, or only at another time, is left out by all of
    them if it moves the slider by no more than the room at that time.

    Args:
        frames: The frames.
        loads: The loads.
        start: X and P at t = 0, shape (J, 2N).
        last: Number of the edge of the loads at which the motion ends.
        longest: Largest length of an element, in s.
        window: Largest difference of the times of an event, in s.
        room: How far the slider may be moved at most from each interval on, in m, shape (E,).
        small: How far an event that all motions have may move the slider if it is left out, in m.
        stride: Intervals of the loads between two fixed times at which elements begin and end.
        spectral: Matrix from values at the parameter sets to Chebyshev coefficients, (J, J).
        out: Receives the elements.

    Returns:
        The status (`DONE`, `NO_COMMON_ORDER` or `TOO_MANY` elements) and the number of elements.
    """
    n_sets, n = frames.inverse_mass.shape
    until = loads.edges[-2]
    search_until = min(until, loads.edges[last] + window)
    state = start.copy()
    t, event_time, end_time, size, constant, path, new = np.zeros((7, n_sets))
    side = np.zeros(n_sets, np.int64)
    series = np.empty((MAX_TERMS, 2 * n))
    phase = edge = element = 0
    spent = 0.0
    is_fixed = True
    is_fresh = True  # whether the next event is not known
    while not (is_fixed and edge >= last):
        chosen = np.ones(n_sets, np.bool_)
        while is_fresh:
            for j in range(n_sets):
                if chosen[j]:
                    after = end_time[j] if end_time[j] > 0 else t[j]
                    event_time[j], side[j], end_time[j], size[j] = _next_event(
                        frames, loads, j, phase, constant[j], t[j], after + 1e-9, state[j],
                        longest, search_until, room, spent,
                    )  # fmt: skip
            f = event_time.argmin()
            if event_time[f] >= loads.edges[last]:  # none that counts before the end
                event_time[:] = NEVER
                break
            # What begins when the first event has ended is another event.
            chosen = event_time < min(event_time[f] + window, end_time[f])
            chosen &= side == side[f]
            can_skip = True
            most = 0.0
            latest = event_time[f]
            shortest = NEVER
            for j in range(n_sets):
                if chosen[j]:
                    can_skip = can_skip and end_time[j] < NEVER
                    most = max(most, size[j])
                    latest = max(latest, event_time[j])
                    shortest = min(shortest, end_time[j] - event_time[j])
            # An event of all motions that hardly moves the slider costs less if it is left out, and
            # so does one whose time spreads over more than it lasts: it is no smooth function of
            # the inputs.
            allowed = small
            if latest - event_time[f] > SHORT_EVENT * shortest:
                allowed = max(allowed, SHORT_ROOM * (room[_interval(loads, event_time[f])] - spent))
            if chosen.all() and not (can_skip and most < allowed):
                break
            if not can_skip:
                return NO_COMMON_ORDER, element
            spent += COST * most
        is_fresh = False
        # Between the parameter sets an event may come earlier, or later, than at all of them.
        mark = min(edge + stride, last) if is_fixed else _mark_behind(loads, _most(t, spectral))
        if mark >= len(loads.powers):
            return TOO_MANY, element
        spacing = loads.edges[mark] - loads.edges[mark - 1]
        is_event = -_most(-event_time, spectral) <= loads.edges[mark] + 0.5 * spacing
        for j in range(n_sets):
            new[j] = event_time[j] if is_event else loads.edges[mark]
        if new.max() >= until:
            return NO_COMMON_ORDER, element
        span = new - t
        begin = t.copy()
        parts = math.ceil(span.max() / longest - 1e-9)
        if span.min() <= 0:
            return NO_COMMON_ORDER, element
        if element + parts >= len(out.phase):
            return TOO_MANY, element
        for part in range(parts):
            out.begin[element] = begin + span * part / parts
            out.length[element] = span / parts
            out.phase[element] = phase
            out.constant[element] = constant
            if phase != 0:
                out.constant[element] = 0.0
            out.path[element] = path
            out.event[element] = 0
            # Between the parameter sets the interpolated times may go beyond theirs.
            low = -_most(-out.begin[element], spectral)
            high = _most(out.begin[element] + out.length[element], spectral)
            _fit_load(loads, low, high, out.fit[element], out.span[element], out.fit_error[element])
            terms = 0
            for j in range(n_sets):
                load = np.empty((LOAD_TERMS, len(out.fit[element])))
                _composed(
                    out.fit[element], out.span[element], out.begin[element, j],
                    out.length[element, j], load,
                )  # fmt: skip
                count = _expand(
                    frames, j, phase, constant[j], load, out.length[element, j], state[j], series
                )
                terms = max(terms, count)
                out.load[element, :, :, j] = load
                out.series[element, :, :, j] = series
                for i in range(2 * n):
                    state[j, i] = 0.0
                    for k in range(MAX_TERMS):
                        state[j, i] += series[k, i]
                if is_event and part == parts - 1:
                    end = 0.0
                    for k in range(LOAD_TERMS):
                        for c in range(load.shape[1]):
                            end += _drift(frames.follow[c], frames.place) * load[k, c]
                    end += _drift(state[j], frames.place)
                    if phase == 0:
                        path[j] -= side[0] * end
                    else:
                        path[j] += phase * end
                        constant[j] = frames.slider[j] * end - phase * frames.force[j]
            out.terms[element] = terms
            element += 1
        t[:] = new
        is_fixed = not is_event
        if not is_event:
            edge = mark
            continue
        out.event[element - 1] = side[0] if phase == 0 else phase
        phase = int(side[0]) if phase == 0 else 0
        is_fresh = True
        end_time[:] = 0.0
    return DONE, element
