"""Compiled motions of a frame with a yielding storey at parameter sets with one order of events.

`interpolated_defects` interpolates these motions over a box of inputs, bounds by how much the
interpolant misses the equations there, and has the equations. Nothing is proved here: a motion that
is wrong has large defects.

The unknowns are X = q − Σ w_l g_l and P = M X' + C q with the displacements q relative to the
ground. Each load f_l(t) accelerates the floors by w_l f_l, and g_l is its integral twice over time:

    X' = M⁻¹ P − D q,    P' = −K_p q − b r,    q = X + Σ w_l g_l,    D = M⁻¹ C.

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
from alphacut.frame.calculus.interpolation import bernstein_matrix

# Largest number of terms of a Taylor series over an element, and the fraction of the largest term
# at which it ends. What is left out is a part of the defects.
MAX_TERMS = 22
LAST_TERM = 1e-15
# Number of terms of a load's polynomial over an element (tuned: a degree of 7 misses some 1e-8 of a
# ground's displacement where an event may come at several samples).
LOAD_TERMS = 8
# Points at which the load is interpolated, and the matrix from values to powers.
FIT_POINTS = np.cos(np.pi * (np.arange(LOAD_TERMS) + 0.5) / LOAD_TERMS)
FIT = np.linalg.inv(np.vander(FIT_POINTS, LOAD_TERMS, increasing=True))
BERNSTEIN = bernstein_matrix(LOAD_TERMS - 1)
# Spread of the time of an event, as a fraction of its duration, above which it is left out, and
# fraction of the room at its time that it may take then (tuned).
SHORT_EVENT = 0.3
SHORT_ROOM = 0.2
# What an event that is left out costs, as a multiple of how far the slider is moved, with what the
# force that is missed meanwhile pushes (tuned).
COST = 1.2
# Largest length of an element that begins and ends at fixed times, as a multiple of that of others
# (tuned: the Taylor series needs some more terms).
CALM = 2.0
# Time of an event that does not come, in s.
NEVER = 1e30
# Number of elements of a march that fails.
NONE = -1


class Frames(NamedTuple):
    """A frame of N floors at J parameter sets under L loads.

    A storey has the stiffness κ after yielding, less weight over height, and the yielding one a
    slider beside it.
    """

    inverse_mass: Array  # (N, J), in 1/kg
    decay: Array  # D = M⁻¹ C, (N, N, J), in 1/s
    stiffness: Array  # κ, (N, J), in N/m
    slider: Array  # K_z, (J,), in N/m
    force: Array  # yield force of the slider, (J,), in N
    place: int  # number of the yielding storey, from 0
    follow: Array  # w, (L, N)


class LoadIntegrals(NamedTuple):
    """g of L loads: cubic polynomials of the time since the beginning of each of E intervals."""

    edges: Array  # (E + 1,), in s
    powers: Array  # (E, L, 4)


class Search(NamedTuple):
    """How far J motions have been searched for events, and how they move over a quiet step.

    Over a step of the length `step` without an event the state at its end, and before it the
    slider's elastic force, or the rate of the drift of a yielding storey, at its quarters, are
    linear in the state at its beginning, the powers of the loads, and a constant: c of an elastic
    storey, the direction of yielding else.
    """

    time: Array  # up to which there is no event that is not left out, (J,), in s
    state: Array  # X and P there, (J, 2N)
    step: float  # part of an interval of the loads, in s
    rows: Array  # of an elastic and of a yielding storey, (J, 2, 4 + 2N, 2N + 4 L + 1)


class Elements(NamedTuple):
    """Motions at J parameter sets on at most E elements, with the fraction τ that has passed."""

    begin: Array  # (E, J), in s
    length: Array  # (E, J), in s
    phase: Ints  # direction of yielding, or 0, (E,)
    constant: Array  # c of an elastic storey, or of the one behind it, in N, (E, J)
    path: Array  # plastic path of an elastic storey; of a yielding one less phase · drift, (E, J)
    series: Array  # powers of τ of X and P, (E, MAX_TERMS, 2N, J)
    fit: Array  # polynomials of g, powers of (t − midpoint) / radius, (E, L, LOAD_TERMS)
    span: Array  # midpoint and radius of the times of an element, in s, (E, 2)
    fit_error: Array  # bounds of |g − its polynomial|, and of the derivative by time, (E, L, 2)
    event: Ints  # side of the event at the end of the element, 0 without one, (E,)
    terms: Ints  # number of powers of τ, (E,)


@compiled
def composed(fit: Array, at_zero: Array, slope: Array, out: Array) -> None:
    """Write polynomials of s by powers of τ for s = at_zero + τ slope to `out`.

    Args:
        fit: Powers of s, shape (L, terms).
        at_zero: Shape (J,).
        slope: Shape (J,).
        out: Receives the powers of τ, shape (terms, L, J).
    """
    out[:] = 0.0
    loads, terms = fit.shape
    for c in range(loads):
        for k in range(terms - 1, -1, -1):  # Horner's rule
            for m in range(terms - 1, 0, -1):
                out[m, c] = out[m, c] * at_zero + out[m - 1, c] * slope
            out[0, c] = out[0, c] * at_zero + fit[c, k]


@compiled
def _interval(loads: LoadIntegrals, t: float) -> int:
    """Return the interval of a time; that behind it where the time is an edge but for rounding."""
    i = int(np.searchsorted(loads.edges, t + 1e-11 * (1 + t), side="right")) - 1
    return min(i, len(loads.powers) - 1)


@compiled
def _cubic(loads: LoadIntegrals, interval: int, t: float, h: float) -> Array:
    """Return the cubics of an interval by powers of (time − t) / h, shape (4, L)."""
    s = t - loads.edges[interval]
    out = np.empty((4, loads.powers.shape[1]))
    for load in range(out.shape[1]):
        a, b, c, d = loads.powers[interval, load]
        out[0, load] = a + s * (b + s * (c + s * d))
        out[1, load] = h * (b + s * (2 * c + s * 3 * d))
        out[2, load] = h**2 * (c + s * 3 * d)
        out[3, load] = h**3 * d
    return out


@compiled
def _drifts(frames: Frames, series: Array, load: Array) -> Array:
    """Return the powers of τ of the drift bᵀ q of the yielding storey, shape (terms,)."""
    place = frames.place
    found = series[:, place].copy()
    follow = frames.follow[:, place].copy()
    if place > 0:
        found -= series[:, place - 1]
        follow -= frames.follow[:, place - 1]
    for k in range(len(load)):
        for c in range(len(follow)):
            found[k] += follow[c] * load[k, c]
    return found


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
    q = np.empty(n)
    series[:] = 0.0
    series[0] = start
    largest_x = largest_p = 0.0
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
            return k + 1
        factor = h / (k + 1)
        for i in range(n):
            speed = frames.inverse_mass[i, j] * series[k, n + i]
            for m in range(n):
                speed -= frames.decay[i, m, j] * q[m]
            series[k + 1, i] = factor * speed
            drift = q[i] - q[i - 1] if i else q[i]
            force = frames.stiffness[i, j] * drift
            if i == frames.place:
                if phase == 0:
                    force += frames.slider[j] * drift
                if k == 0:
                    force += phase * frames.force[j] if phase else -constant
            series[k + 1, n + i] -= factor * force
            if i:
                series[k + 1, n + i - 1] += factor * force
    return MAX_TERMS


@compiled
def _excess(powers: Array, tau: float, side: int, limit: float) -> float:
    """Return by how much a polynomial passes a limit at τ, on a side, or on any if this is 0."""
    value = 0.0
    for k in range(len(powers) - 1, -1, -1):
        value = value * tau + powers[k]
    return (side * value if side else abs(value)) - limit


@compiled
def _fill_rows(frames: Frames, step: float, rows: Array) -> None:
    """Write how motions move over a quiet step to `rows`; see `Search`."""
    n, n_sets = frames.inverse_mass.shape
    series = np.empty((MAX_TERMS, 2 * n))
    unit = np.zeros(rows.shape[-1])
    for j in range(n_sets):
        for phase in range(2):
            # The column of the constant is the last one, and comes first: the force of a yielding
            # storey is a part of all others.
            for column in range(len(unit) - 1, -1, -1):
                unit[:] = 0.0
                unit[column] = 1.0
                load = unit[2 * n : -1].copy().reshape(4, -1)
                count = _expand(frames, j, phase, unit[-1], load, step, unit[: 2 * n], series)
                powers = _drifts(frames, series[:count], load)
                if phase == 0:
                    powers *= frames.slider[j]
                    powers[0] -= unit[-1]
                else:
                    powers = np.arange(1, count) * powers[1:] / step
                found = rows[j, phase, :, column]
                for m in range(4):
                    found[m] = _excess(powers, (m + 1) / 4, 1, 0.0)
                found[4:] = series.sum(axis=0)
                if phase != 0 and unit[-1] == 0.0:
                    found -= rows[j, phase, :, -1]


@compiled
def _passes_quietly(
    loads: LoadIntegrals, search: Search, j: int, phase: int, constant: float, interval: int,
    limit: float,
) -> bool:  # fmt: skip
    """Return whether a motion has no event in a step, and then move it to its end, in place.

    Args:
        loads: The loads.
        search: Where the motion is, a whole number of steps before the end of the interval.
        j: Number of the motion.
        phase: Direction of yielding, or 0.
        constant: c of an elastic storey.
        interval: The interval.
        limit: Force, or velocity against the direction of yielding, that is not passed at quarters
            of the step if there is no event.
    """
    step = search.step
    t = search.time[j]
    edge = loads.edges[interval + 1]
    rows = search.rows[j, abs(phase)]
    given = np.empty(rows.shape[1])
    states = len(rows) - 4
    given[:states] = search.state[j]
    given[states:-1] = _cubic(loads, interval, t, step).ravel()
    given[-1] = phase if phase else constant
    for m in range(len(rows)):
        value = 0.0
        for column in range(len(given)):
            value += rows[m, column] * given[column]
        if m >= 4:
            search.state[j, m - 4] = value
        elif (-phase * value if phase else abs(value)) > limit:
            return False
    search.time[j] = edge if edge - t < 1.5 * step else t + step
    return True


@compiled
def _next_event(
    frames: Frames, loads: LoadIntegrals, search: Search, j: int, phase: int, constant: float,
    after: float, longest: float, until: float, room: Array, spent: float,
) -> tuple[float, int, float, float]:  # fmt: skip
    """Return the next event of one motion, behind the time `after`, and move `search` up to it.

    Args:
        frames: The frames.
        loads: The loads.
        search: Where the motions are, not behind `after`.
        j: Number of the parameter set.
        phase: Direction of yielding, or 0.
        constant: c of an elastic storey.
        after: Time behind which events count.
        longest: Largest length of an element.
        until: Time at which the search ends.
        room: How far the slider may be moved at most from each interval on, in m, shape (E,).
        spent: How far it has been moved by events that were left out before, in m.

    Returns:
        Its time, `NEVER` if there is none; its side; the time at which the excess ends by itself or
        the search does, `NEVER` if it exceeds the room; and by how much the slider would be moved.
    """
    series = np.empty((MAX_TERMS, search.state.shape[1]))
    place = frames.place
    slider = frames.slider[j]
    inverse_mass = frames.inverse_mass[place, j]
    # The slider's force passes its yield force, or the velocity passes zero against its direction.
    # What the slider's excess force pushes counts as the move that adds as much to S.
    if phase == 0:
        limit = frames.force[j]
        per_excess = 1 / slider
        of_drift = inverse_mass + (frames.inverse_mass[place - 1, j] if place else 0.0)
        by_push = math.sqrt(of_drift / slider)
    else:
        limit = per_excess = 0.0
        by_push = 1.0
    # Below this excess a motion has not passed an event (tuned: far above rounding).
    tolerance = 1e-11 * frames.force[j]
    if phase != 0:
        tolerance /= math.sqrt(slider / inverse_mass)
    first = NEVER
    side = 0
    size = moved = pushed = 0.0
    passes = False
    while search.time[j] < until:
        t = search.time[j]
        i = _interval(loads, t)
        # Equal steps to the end of the interval, most of which have the length of a quiet one.
        rest = loads.edges[i + 1] - t
        h = rest / max(math.ceil(rest / longest - 1e-9), 1)
        is_whole = t > after and abs(h - search.step) < 1e-9 * h
        if is_whole and not passes and _passes_quietly(
            loads, search, j, phase, constant, i, limit + tolerance
        ):  # fmt: skip
            continue
        load = _cubic(loads, i, t, h)
        terms = _expand(frames, j, phase, constant, load, h, search.state[j], series)
        powers = _drifts(frames, series[:terms], load)
        if phase == 0:
            powers *= slider
            powers[0] -= constant
        else:
            powers = -phase * np.arange(1, terms) * powers[1:] / h
            side = 1
        before = 0.0
        for m in range(1, 5):
            tau = m / 4
            value = _excess(powers, tau, side, limit)
            if t + tau * h > after:
                if (value > tolerance) != passes:
                    low = before
                    high = tau
                    for _ in range(50):
                        mid = (low + high) / 2
                        above = _excess(powers, mid, side, limit) > tolerance
                        if above != passes and t + mid * h > after:
                            high = mid
                        else:
                            low = mid
                    if passes:
                        return first, side, t + high * h, size
                    passes = True
                    first = t + high * h
                    if side == 0:
                        side = 1 if _excess(powers, high, 1, limit) > -limit else -1
                if passes:
                    moved = max(moved, value * per_excess)
                    pushed += value * h / 4
                    size = moved + by_push * pushed
                    if COST * size + spent > room[i]:
                        return first, side, NEVER, size
            before = tau
        search.state[j] = series.sum(axis=0)
        search.time[j] = t + h
    # What passes at the end of the search, and stays within the room, counts as ended there.
    return first, side, until if passes else NEVER, size


@compiled
def _fit_load(
    loads: LoadIntegrals, low: float, high: float, fit: Array, span: Array, error: Array
) -> None:
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
    mid = (low + high) / 2
    rad = max((high - low) / 2, 1e-300)
    span[0] = mid
    span[1] = rad
    error[:] = 0.0
    fit[:] = 0.0
    first = _interval(loads, low)
    last = max(first, _interval(loads, high - 2e-11 * (1 + high)))
    if first == last:
        fit[:, :4] = _cubic(loads, first, mid, rad).T
        return
    for p in range(LOAD_TERMS):
        t = mid + rad * FIT_POINTS[p]
        values = _cubic(loads, _interval(loads, t), t, 1.0)[0]
        for c in range(len(fit)):
            fit[c] += FIT[:, p] * values[c]
    local = np.empty((LOAD_TERMS, len(fit), 1))
    for piece in range(first, last + 1):
        begin = max(loads.edges[piece], low)
        width = min(loads.edges[piece + 1], high) - begin
        if width <= 0:
            continue
        missed = fit.copy()
        missed[:, :4] -= _cubic(loads, piece, mid, rad).T
        composed(missed, np.array([(begin - mid) / rad]), np.array([width / rad]), local)
        for c in range(len(fit)):
            control = BERNSTEIN @ local[:, c, 0].copy()
            slope = (LOAD_TERMS - 1) * np.abs(np.diff(control)).max() / width
            error[c, 0] = max(error[c, 0], np.abs(control).max())
            error[c, 1] = max(error[c, 1], slope)


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
    room: Array, small: float, stride: int, spectral: Array, out: Elements, alone: Array,
) -> int:  # fmt: skip
    """Write the motions of J frames with one order of events, and return the number of elements.

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
        alone: Receives 1 where motions have the event for which there is no common order, and 0 at
            other parameter sets, shape (J,).

    Returns:
        The number of elements; `NONE` without a common order of events, or of too many elements.
    """
    n, n_sets = frames.inverse_mass.shape
    until = loads.edges[-2]
    search_until = min(until, loads.edges[last] + window)
    state = start.copy()
    t, event_time, end_time, size, constant, path, new = np.zeros((7, n_sets))
    side = np.zeros(n_sets, np.int64)
    series = np.empty((MAX_TERMS, 2 * n))
    loads_at = np.empty((LOAD_TERMS, len(frames.follow), n_sets))
    phase = edge = element = 0
    spent = 0.0
    alone[:] = 0.0
    is_fixed = True
    is_fresh = True  # whether the next event is not known
    interval = float(np.median(np.diff(loads.edges[: last + 1])))
    search = Search(
        time=t.copy(),
        state=start.copy(),
        step=interval / math.ceil(interval / longest - 1e-9),
        rows=np.empty((n_sets, 2, 4 + 2 * n, 2 * n + 4 * len(frames.follow) + 1)),
    )
    _fill_rows(frames, search.step, search.rows)
    while not (is_fixed and edge >= last):
        chosen = np.ones(n_sets, np.bool_)
        while is_fresh:
            for j in range(n_sets):
                if chosen[j]:
                    after = end_time[j] if end_time[j] > 0 else t[j]
                    event_time[j], side[j], end_time[j], size[j] = _next_event(
                        frames, loads, search, j, phase, constant[j], after + 1e-9, longest,
                        search_until, room, spent,
                    )  # fmt: skip
            f = event_time.argmin()
            if event_time[f] >= loads.edges[last]:  # none that counts before the end
                event_time[:] = NEVER
                break
            # What begins when the first event has ended is another event.
            chosen = event_time < min(event_time[f] + window, end_time[f])
            chosen &= side == side[f]
            can_skip = end_time[chosen].max() < NEVER
            most = size[chosen].max()
            shortest = (end_time - event_time)[chosen].min()
            # An event of all motions that hardly moves the slider costs less if it is left out, and
            # so does one whose time spreads over more than it lasts: it is no smooth function of
            # the inputs.
            allowed = small
            if event_time[chosen].max() - event_time[f] > SHORT_EVENT * shortest:
                allowed = max(allowed, SHORT_ROOM * (room[_interval(loads, event_time[f])] - spent))
            if chosen.all() and not (can_skip and most < allowed):
                break
            if not can_skip:
                alone[:] = chosen
                return NONE
            spent += COST * most
        is_fresh = False
        # Between the parameter sets an event may come earlier, or later, than at all of them.
        mark = min(edge + stride, last) if is_fixed else _mark_behind(loads, _most(t, spectral))
        if mark >= len(loads.powers):
            return NONE
        spacing = loads.edges[mark] - loads.edges[mark - 1]
        is_event = -_most(-event_time, spectral) <= loads.edges[mark] + 0.5 * spacing
        new[:] = loads.edges[mark]
        if is_event:
            new[:] = event_time
        span = new - t
        begin = t.copy()
        # An element at an event misses more, as its load is that of several intervals.
        most_of_part = longest if is_event or not is_fixed else CALM * longest
        parts = math.ceil(span.max() / most_of_part - 1e-9)
        if new.max() >= until or span.min() <= 0 or element + parts >= len(out.phase):
            return NONE
        for part in range(parts):
            out.begin[element] = begin + span * part / parts
            out.length[element] = span / parts
            out.phase[element] = phase
            out.path[element] = path
            out.event[element] = 0
            # Between the parameter sets the interpolated times may go beyond theirs.
            low = -_most(-out.begin[element], spectral)
            high = _most(out.begin[element] + out.length[element], spectral)
            _fit_load(loads, low, high, out.fit[element], out.span[element], out.fit_error[element])
            at_zero = (out.begin[element] - out.span[element, 0]) / out.span[element, 1]
            slope = out.length[element] / out.span[element, 1]
            composed(out.fit[element], at_zero, slope, loads_at)
            out.terms[element] = 0
            is_end = is_event and part == parts - 1
            for j in range(n_sets):
                load = loads_at[:, :, j]
                h = out.length[element, j]
                count = _expand(frames, j, phase, constant[j], load, h, state[j], series)
                out.terms[element] = max(out.terms[element], count)
                out.series[element, :, :, j] = series
                state[j] = series.sum(axis=0)
                if is_end:
                    drift = _drifts(frames, series, load).sum()
                    if phase == 0:
                        path[j] -= side[0] * drift
                    else:
                        path[j] += phase * drift
                        constant[j] = frames.slider[j] * drift - phase * frames.force[j]
            out.constant[element] = constant
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
        search.time[:] = t
        search.state[:] = state
    return element
