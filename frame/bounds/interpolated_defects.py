"""By how much interpolated motions of a frame with a yielding storey miss its equations.

The theory is in docs/theory/proofs.md, "A yielding storey": the energy norm S of the difference of
the interpolated to the true motion grows by no more than the norms of the defects. Here all defects
are bounded at all inputs of the box and at all times, by coefficients of polynomials. Arrays over a
grid of inputs have it as their last axis; e counts elements, k powers of τ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.frame.bounds.interpolated_motions import LOAD_TERMS, Elements
from alphacut.frame.calculus.interpolation import (
    along_inputs,
    bernstein_matrix,
    box_maxima,
    coefficients,
    magnitude,
    part_maxima,
    refining_matrix,
)

# Parts of each input over which S is kept, by the number of inputs (tuned: a left-out event moves
# the slider in a corner of the box alone, and the peak may lie elsewhere).
PARTS = {0: 1, 1: 8, 2: 4, 3: 2}
# Numbers of parts of an element's time on which the slider's force is bounded, in turn, until its
# excess is below a fraction of the yield force, or does not become smaller by half (tuned).
TIME_PARTS = (2, 8, 32, 128)
SMALL_VIOLATION = 1e-9
# The same of the velocity of a yielding storey.
REVERSAL_PARTS = 32


@dataclass(frozen=True, eq=False)
class BoxModel:
    """Properties of a frame of N floors over a box, as polynomials on a grid, with bounds.

    A storey z has the stiffness κ_z after yielding, less weight over height (of an elastic storey:
    its stiffness less weight over height), and the yielding one a slider of the stiffness K_z
    beside it. Each property is a polynomial but for a remainder.

    Args:
        inputs: Number d of inputs.
        degree: Degree of the interpolation of motions in each input.
        fine: Degree of the grid, at which products of a length, a property and a motion are exact.
        of_slider: Degree of the slider's force in each input.
        place: Number of the yielding storey.
        follow: w, accelerations of the floors under a unit of each load, shape (L, N).
        mass: Values on the grid, shape (N, F), in kg.
        stiffness: κ on the grid, shape (N, F), in N/m.
        damping: C on the grid, shape (N, N, F), in N s/m.
        slider: K_z on the grid, shape (F,), in N/m.
        force: Yield force of the slider on the grid, shape (F,), in N.
        mass_remainder: Shape (N,), as those that follow.
        stiffness_remainder: Shape (N,).
        damping_remainder: Shape (N, N).
        slider_remainder: A number, as the next one.
        force_remainder: In N.
        mass_ends: Lower and upper bounds, shape (2, N), as the next one.
        stiffness_ends: Lower bounds are not negative.
        slider_ends: Shape (2,), as the next one; lower bounds are positive.
        force_ends: In N.
        max_damping: Bounds of |C|, shape (N, N).
    """

    inputs: int
    degree: int
    fine: int
    of_slider: int
    place: int
    follow: Array
    mass: Array
    stiffness: Array
    damping: Array
    slider: Array
    force: Array
    mass_remainder: Array
    stiffness_remainder: Array
    damping_remainder: Array
    slider_remainder: float
    force_remainder: float
    mass_ends: Array
    stiffness_ends: Array
    slider_ends: Array
    force_ends: Array
    max_damping: Array

    @property
    def floors(self) -> int:
        """Number N of floors."""
        return len(self.mass)

    @property
    def parts(self) -> int:
        """Number of parts of each input over which S is kept."""
        return PARTS[self.inputs]

    @property
    def direction_norm(self) -> float:
        """Bound of (bᵀ M⁻¹ b)^½, with the drift bᵀ q of the yielding storey."""
        z = self.place
        total = 1 / self.mass_ends[0, z]
        if z:
            total += 1 / self.mass_ends[0, z - 1]
        return float(np.sqrt(total))

    @property
    def following_drift(self) -> Array:
        """|bᵀ w| of each load, shape (L,)."""
        return np.abs(drifts(self.follow, axis=1)[:, self.place])

    def refined(self, values: Array) -> Array:
        """Return what interpolates values at the parameter sets of the motions, on the grid."""
        return along_inputs(refining_matrix(self.degree, self.fine), values, self.inputs)

    def magnitude(self, values: Array) -> Array:
        """Bound the magnitudes of polynomials on the grid over the box, shape (…)."""
        return magnitude(values, self.inputs, self.fine)

    def part_maxima(self, values: Array, degree: int) -> Array:
        """Bound polynomials of a degree on each part of the box, shape (…, parts)."""
        return part_maxima(values, self.inputs, self.fine, self.parts, degree)

    def largest(self, values: Array) -> Array:
        """Bound what interpolates values at the parameter sets of the motions, shape (…).

        The sum of the magnitudes of all Lagrange polynomials, the Lebesgue constant, is below 2 for
        each input up to the degree 4, and so is that of a finer grid.
        """
        return np.asarray(2.0**self.inputs * np.abs(values).max(axis=-1))


@dataclass(frozen=True, eq=False)
class Interpolant:
    """Interpolated motions on some elements, and what they leave out of the load.

    Args:
        model: The frame over the box.
        terms: Number K of powers of τ.
        displacement: X, shape (e, K, N, F), in m, as the next ones.
        relative: q with the polynomials of g.
        momentum: P, in kg m/s.
        length: Lengths of elements, shape (e, F), in s.
        max_length: Upper bounds of them, shape (e,).
        phase: Direction of yielding or 0, shape (e,).
        constant: c of an elastic storey, before an element or behind it, shape (e, F), in N.
        path: See `Elements`, shape (e, F), in m.
        load_error: Bounds of |g − the polynomials in τ and inputs that stand for it|, (e, L), in m.
        load_variation: Bounds of the derivative by τ of g − these, shape (e, L), in m.
        load_rate: What interpolates g' at the inputs, shape (e, LOAD_TERMS, L, F), in m/s.
        rate_error: Bounds of |g' − this|, shape (e, L).
        max_relative: Bounds of |q| by powers of τ, shape (e, K, N).
        times: Earliest and latest begin, earliest and latest end, shortest and greatest length of
            each element, shape (e, 6), in s.
    """

    model: BoxModel
    terms: int
    displacement: Array
    relative: Array
    momentum: Array
    length: Array
    max_length: Array
    phase: Ints
    constant: Array
    path: Array
    load_error: Array
    load_variation: Array
    load_rate: Array
    rate_error: Array
    max_relative: Array
    times: Array

    @property
    def drift(self) -> Array:
        """Drift of the yielding storey, shape (e, K, F), in m."""
        return storey_drift(self.relative, self.model.place)

    @property
    def slider_force(self) -> Array:
        """K_z bᵀ q − c of an elastic storey, shape (e, K, F), in N."""
        force = self.model.slider * self.drift
        force[:, 0] -= self.constant
        return force


@dataclass(frozen=True, eq=False)
class Defects:
    """Bounds of the defects of some elements, each integrated over the element.

    Args:
        growth: Growth of S at all inputs, shape (e,), in J^½.
        violation: Growth of S on each part of the box where an event is left out, (e, parts).
        drift: Bound of ∫ |bᵀ δ_q| dt, shape (e,), in m.
        path: By how much the length of the plastic path may differ from that of a flow that obeys
            the flow rule, shape (e,), in m.
        beyond: By how much the slider may be beyond its yield force, shape (e, parts), in N.
        level: What polynomials of the slider's force miss, shape (e,), in N.
    """

    growth: Array
    violation: Array
    drift: Array
    path: Array
    beyond: Array
    level: Array


def drifts(values: Array, axis: int) -> Array:
    """Return the differences of neighbouring floors along an axis, the first one to the ground."""
    zero = np.zeros_like(values.take([0], axis=axis))
    return np.diff(values, axis=axis, prepend=zero)


def storey_drift(values: Array, place: int) -> Array:
    """Return the drift of one storey of displacements of shape (e, K, N, …)."""
    if place == 0:
        return values[:, :, 0].copy()
    return values[:, :, place] - values[:, :, place - 1]


def interpolate(
    model: BoxModel, elements: Elements, chosen: slice, *, with_rates: bool
) -> Interpolant | None:
    """Return the interpolated motions on some elements, or None where their times go astray.

    The times of an element must lie within those at which its load is approximated, and its length
    must not be negative, at all inputs.

    Args:
        model: The frame over the box.
        elements: Motions at its parameter sets.
        chosen: Which elements.
        with_rates: Whether the error of the rates of the loads is bounded, which velocities need.
    """
    begin = elements.begin[chosen]
    length = elements.length[chosen]
    span = elements.span[chosen]
    end = begin + length
    ends = np.stack([-begin, begin, -end, end, -length, length], axis=1)
    times = np.minimum(
        part_maxima(ends, model.inputs, model.degree, model.parts).max(axis=-1),
        box_maxima(ends, model.inputs, model.degree),
    )
    times[:, ::2] *= -1.0
    # The margin is rounding, which the widening of all bounds covers.
    margin = 1e-10 * (1 + np.abs(span).sum(axis=1))
    within = times[:, 0] >= span[:, 0] - span[:, 1] - margin
    within &= times[:, 3] <= span[:, 0] + span[:, 1] + margin
    if not (within & (times[:, 4] >= 0)).all():
        return None
    n = model.floors
    terms = max(int(elements.terms[chosen].max(initial=0)), LOAD_TERMS)
    series = elements.series[chosen, :terms]
    relative = series[:, :, :n].copy()
    relative[:, :LOAD_TERMS] += np.einsum("ln,eklj->eknj", model.follow, elements.load[chosen])
    refined = model.refined(np.concatenate([series, relative], axis=2))
    # Polynomials of the rate of the load, by powers of (t − midpoint) / radius.
    fit = elements.fit[chosen]
    rate = np.zeros_like(fit)
    rate[:, :, :-1] = fit[:, :, 1:] * np.arange(1, LOAD_TERMS) / span[:, 1, np.newaxis, np.newaxis]
    at_zero = (begin - span[:, :1]) / span[:, 1:]
    rates = _composed(rate, at_zero, length / span[:, 1:])
    missed = _composition_errors(model, begin, length, span, fit, elements.load[chosen])
    missed_rate = np.zeros_like(missed)
    if with_rates:
        missed_rate = _composition_errors(model, begin, length, span, rate, rates)
    fit_error = elements.fit_error[chosen]
    powers = np.arange(LOAD_TERMS)[:, np.newaxis]
    max_length = times[:, 5]
    # At the end of yielding the constant of the elastic storey that follows counts.
    constant = elements.constant[chosen].copy()
    for e in np.flatnonzero((elements.phase[chosen] != 0) & (elements.event[chosen] != 0)):
        constant[e] = elements.constant[chosen.start + e + 1]
    return Interpolant(
        model=model,
        terms=terms,
        displacement=refined[:, :, :n],
        momentum=refined[:, :, n : 2 * n],
        relative=refined[:, :, 2 * n :],
        length=model.refined(length),
        max_length=max_length,
        phase=elements.phase[chosen],
        constant=model.refined(constant),
        path=model.refined(elements.path[chosen]),
        load_error=fit_error[..., 0] + missed.sum(axis=1),
        load_variation=fit_error[..., 1] * max_length[:, np.newaxis]
        + (powers * missed).sum(axis=1),
        load_rate=model.refined(rates),
        rate_error=fit_error[..., 1] + missed_rate.sum(axis=1),
        max_relative=model.largest(relative),
        times=times,
    )


def _composed(fit: Array, at_zero: Array, slope: Array) -> Array:
    """Return polynomials of s by powers of τ for s = at_zero + τ slope.

    Args:
        fit: Powers of s, shape (e, L, LOAD_TERMS).
        at_zero: Shape (e, points).
        slope: Shape (e, points).

    Returns:
        Shape (e, LOAD_TERMS, L, points).
    """
    e, loads, terms = fit.shape
    found = np.zeros((terms, e, loads, at_zero.shape[1]))
    for k in range(terms - 1, -1, -1):  # Horner's rule
        found[1:] = found[1:] * at_zero[:, np.newaxis] + found[:-1] * slope[:, np.newaxis]
        found[0] = found[0] * at_zero[:, np.newaxis] + fit[:, :, k, np.newaxis]
    return found.swapaxes(0, 1)


def _composition_errors(
    model: BoxModel, begin: Array, length: Array, span: Array, fit: Array, series: Array
) -> Array:
    """Bound what the interpolation of a load's polynomials over the inputs misses.

    At the inputs u and the fraction τ an element has the time t = t_0(u) + τ h(u), and the load is
    a polynomial of t. So it is one of τ and u, of the degree 7 n in each input with the degree n of
    the interpolation. Its Chebyshev coefficients less those of the interpolant bound the
    difference.

    Args:
        model: The frame over the box.
        begin: t_0 at the parameter sets, shape (e, J).
        length: h at the parameter sets, shape (e, J).
        span: Midpoint and radius of the times of each element, shape (e, 2).
        fit: Powers of (t − midpoint) / radius, shape (e, L, LOAD_TERMS).
        series: Powers of τ at the parameter sets, shape (e, LOAD_TERMS, L, J).

    Returns:
        Bounds of the difference by powers of τ, shape (e, LOAD_TERMS, L).
    """
    errors = np.zeros(series.shape[:3])
    varies = np.flatnonzero((np.ptp(begin, axis=1) > 0) | (np.ptp(length, axis=1) > 0))
    degree = (LOAD_TERMS - 1) * model.degree
    refine = refining_matrix(model.degree, degree)
    if len(varies):
        mid, rad = span[varies].T[..., np.newaxis]
        at_zero = (along_inputs(refine, begin[varies], model.inputs) - mid) / rad
        slope = along_inputs(refine, length[varies], model.inputs) / rad
        exact = _composed(fit[varies], at_zero, slope)
        exact -= along_inputs(refine, series[varies], model.inputs)
        errors[varies] = magnitude(exact, model.inputs, degree)
    return errors


def defects(found: Interpolant, event: Ints, small: float = 0.0) -> Defects:
    """Bound the defects of interpolated motions.

    Args:
        found: The motions.
        event: That of `Elements`, shape (e,).
        small: Growth of S by an event that is left out that is not bounded more closely, in J^½.
    """
    model = found.model
    shape = found.drift.shape[0]
    growth, drift = _residuals(found)
    at_events = _jumps(found, event)
    violation = np.zeros((shape, model.parts**model.inputs))
    beyond = np.zeros_like(violation)
    path = 2 * found.load_error @ model.following_drift * (event != 0)
    level, variation = _slider_errors(found)
    force = found.slider_force
    for e in _elastic_violations(found, force, level):
        moved, beyond[e], forced, rise = _elastic_violation(
            model, force[e], level[e], variation[e], small
        )
        # |δ_j| adds up to what the slider falls back, and forces miss what it is beyond meanwhile.
        forced = forced * found.max_length[e]
        violation[e] = moved / np.sqrt(model.slider_ends[0]) + model.direction_norm * forced
        path[e] += rise / model.slider_ends[0]
    for e, back in _reversals(found):
        violation[e] = np.sqrt(model.slider_ends[1]) * back
        path[e] += back.max()
    level = np.where(found.phase == 0, level, model.force_remainder)
    return Defects(growth + at_events, violation, drift, path, beyond, level)


def _residuals(found: Interpolant) -> tuple[Array, Array]:
    """Bound what kinematics and the balance of forces miss.

    With powers of τ the residuals are h δ_q = X' − h M⁻¹ (P − C q) and h δ_P = P' + h (K_p q + b r)
    of each power. Then δ_v = δ_P − C δ_q, and S grows by ‖δ_v‖ in M⁻¹ and ‖δ_q‖ in K_e = K_p + K_z
    b bᵀ. Integrated over τ a power k has the factor 1 / (k + 1).

    Returns:
        Growth of S, shape (e,), and ∫ |bᵀ δ_q| dt, shape (e,).
    """
    model = found.model
    n = model.floors
    z = model.place
    h = found.length[:, np.newaxis]
    order = np.arange(1, found.terms)[:, np.newaxis]
    elastic = (found.phase == 0)[:, np.newaxis, np.newaxis]
    K = found.relative.shape[1]

    kinematic = -h[:, :, np.newaxis] * found.momentum
    balance = np.zeros_like(kinematic)
    kinematic[:, :-1] += order[..., np.newaxis] * model.mass * found.displacement[:, 1:]
    balance[:, :-1] += order[..., np.newaxis] * found.momentum[:, 1:]
    for i in range(n):
        for j in range(n):
            if model.damping[i, j].any():
                kinematic[:, :, i] += h * model.damping[i, j] * found.relative[:, :, j]
    for storey in range(n):
        force = model.stiffness[storey] * storey_drift(found.relative, storey)
        if storey == z:
            slider = np.where(elastic, model.slider * found.drift, 0.0)
            yielding = found.phase[:, np.newaxis] * model.force
            slider[:, 0] += np.where(elastic[:, 0], -found.constant, yielding)
            force += slider
        force *= h
        balance[:, :, storey] += force
        if storey:
            balance[:, :, storey - 1] -= force
    mean_mass = model.mass_ends.mean(axis=0)
    drift_defect = model.magnitude(drifts(kinematic / mean_mass[:, np.newaxis], axis=2))
    force_defect = model.magnitude(balance)

    # What remainders of the properties and errors of the load add, as terms of the power 0.
    longest = found.max_length[:, np.newaxis]
    followed = np.abs(model.follow)
    missed = found.load_error @ followed  # (e, N), of q
    largest = found.max_relative.sum(axis=1)
    speed = (order * model.largest(found.displacement[:, 1:])).sum(axis=1)
    more_kinematic = speed * model.mass_remainder
    more_kinematic += longest * (missed @ model.max_damping)
    more_kinematic += longest * (largest @ model.damping_remainder)
    stiffest = model.stiffness_ends[1].copy()
    stiffest[z] += model.slider_ends[1]
    remainder = model.stiffness_remainder.copy()
    remainder[z] += model.slider_remainder
    drift_missed = found.load_error @ np.abs(drifts(model.follow, axis=1))
    largest_drift = np.abs(drifts_bound(largest))
    storey_force = longest * (drift_missed * stiffest + largest_drift * remainder)
    storey_force[:, z] += longest[:, 0] * model.force_remainder
    more_force = storey_force.copy()
    more_force[:, :-1] += storey_force[:, 1:]
    more_floor = more_kinematic / model.mass_ends[0]
    drift_defect[:, 0] += drifts_bound(more_floor)
    force_defect[:, 0] += more_force

    # |δ_q| of a floor is at most the sum of its drifts below. The residuals were divided by the
    # mean mass m̄; the true one differs from that by the factor m̄ / m.
    floor_defect = drift_defect.cumsum(axis=2)
    excess = np.maximum(mean_mass / model.mass_ends[0] - 1, 1 - mean_mass / model.mass_ends[1])
    if excess.any():
        drift_defect = drift_defect + drifts_bound(floor_defect * excess)
        floor_defect = drift_defect.cumsum(axis=2)
    force_defect = force_defect + floor_defect @ model.max_damping
    by_power = np.sqrt((force_defect**2 / model.mass_ends[0]).sum(axis=-1))
    by_power += np.sqrt((drift_defect**2 * stiffest).sum(axis=-1))
    weights = 1 / np.arange(1, K + 1)
    return by_power @ weights, drift_defect[:, :, z] @ weights


def drifts_bound(values: Array) -> Array:
    """Return bounds of the drifts of what is bounded by `values` at each floor, shape (…, N)."""
    found: Array = values.copy()
    found[..., 1:] += values[..., :-1]
    return found


def _jumps(found: Interpolant, event: Ints) -> Array:
    """Bound by how much the slider is moved at once at events, times √K_z, shape (e,).

    At an event at the end of an element its force, K_z bᵀ q − c with the constant of the elastic
    side, should be ± its yield force.
    """
    model = found.model
    jumps = np.zeros(len(event))
    at = np.flatnonzero(event)
    if not len(at):
        return jumps
    force = model.slider * found.drift[at].sum(axis=1) - found.constant[at]
    force -= event[at, np.newaxis] * model.force
    missed = model.magnitude(force)
    missed += model.slider_ends[1] * (found.load_error[at] @ model.following_drift)
    largest = 2 * found.max_relative[at].sum(axis=(1, 2))
    missed += model.slider_remainder * largest + model.force_remainder
    jumps[at] = missed / np.sqrt(model.slider_ends[0])
    return jumps


def _slider_errors(found: Interpolant) -> tuple[Array, Array]:
    """Bound what polynomials of the slider's force less its yield force miss, in N.

    Returns:
        Bounds of the error and of its derivative by τ, shape (e,) each.
    """
    model = found.model
    stiffest = model.slider_ends[1]
    largest = 2 * found.max_relative.sum(axis=2)  # of the drift, by powers
    level = stiffest * (found.load_error @ model.following_drift) + model.force_remainder
    level += model.slider_remainder * largest.sum(axis=1)
    variation = stiffest * (found.load_variation @ model.following_drift)
    variation += model.slider_remainder * (largest @ np.arange(found.terms))
    return level, variation


def _elastic_violations(found: Interpolant, force: Array, level: Array) -> Ints:
    """Return the elements on which the slider of an elastic storey may pass its yield force.

    Args:
        found: The motions.
        force: The slider's force while elastic, shape (e, K, F), in N.
        level: Bounds of what it misses, shape (e,), in N.
    """
    model = found.model
    at = np.flatnonzero(found.phase == 0)
    # Mostly the sum of all magnitudes shows that the force is small enough.
    matrix = bernstein_matrix(found.terms - 1)
    control = np.einsum("ik,ekf->eif", matrix, force[at])
    middle, radius = ranges(model, control)
    most = np.abs(middle) + radius
    return np.asarray(at[most.max(axis=1, initial=0.0) + level[at] > model.force_ends[0]])


def ranges(model: BoxModel, values: Array) -> tuple[Array, Array]:
    """Return midpoints and radii of intervals of polynomials over the box, shape (…) each."""
    found = coefficients(values, model.inputs, model.fine)
    return found[..., 0], np.abs(found[..., 1:]).sum(axis=-1)


def _elastic_violation(
    model: BoxModel, force: Array, level: float, variation: float, small: float
) -> tuple[Array, Array, Array, float]:
    """Bound what is left out where the slider of an elastic storey passes its yield force.

    The slider of the motion is held there. While the force rises beyond, it flows as it may; it is
    moved by what the force falls back. By the variation-diminishing property of the Bernstein form
    a polynomial falls above zero by no more than its control polygon does, and a mean of the
    control points bounds its integral.

    Args:
        model: The frame.
        force: The slider's force by powers of τ, shape (K, F), in N.
        level: Bound of what it misses, in N.
        variation: Bound of the derivative by τ of what it misses, in N.
        small: See `defects`.

    Returns:
        On each part of the box: bounds of what the force falls beyond the yield force, in N; of by
        how much it is beyond; and of the integral of that over τ. And how far it rises beyond
        anywhere in the box, in N.
    """
    best = _elastic_violation_on(model, force, level, variation, TIME_PARTS[0])
    enough = max(SMALL_VIOLATION * model.force_ends[0], small * np.sqrt(model.slider_ends[0]))
    for pieces in TIME_PARTS[1:]:
        # Control points on shorter parts of the time lie closer to the force.
        if not best[0].max() > enough:
            break
        closer = _elastic_violation_on(model, force, level, variation, pieces)
        gain = best[0].max() / max(closer[0].max(), 1e-300)
        best = closer
        if gain < 2:
            break
    return best


def _elastic_violation_on(
    model: BoxModel, force: Array, level: float, variation: float, pieces: int
) -> tuple[Array, Array, Array, float]:
    """Return the results of `_elastic_violation` by control points on equal parts of the time."""
    control = bernstein_matrix(len(force) - 1, pieces) @ force
    parts = model.parts**model.inputs
    moved, most, integral = np.zeros((3, parts))
    rise = 0.0
    degree = model.of_slider
    for side in (-1.0, 1.0):
        excess = side * control - model.force
        middle, radius = ranges(model, excess)
        may_pass = middle + radius + level > 0
        if not may_pass.any():
            continue
        # Control points that are surely below count as zero, and bound falls and rises of those
        # beside them. The last one of a part of the time is the first one of the next.
        near = np.flatnonzero(may_pass)
        above = np.zeros((len(excess), parts))
        above[near] = np.maximum(model.part_maxima(excess[near], degree) + level, 0.0)
        falls = above[near]
        inner = near < len(excess) - 1
        change = excess[near[inner]] - excess[near[inner] + 1]
        falls[inner] = np.minimum(falls[inner], np.maximum(model.part_maxima(change, degree), 0.0))
        falls[~inner] = 0.0
        rises = above[near]
        inner = near > 0
        change = excess[near[inner]] - excess[near[inner] - 1]
        rises[inner] = np.minimum(rises[inner], np.maximum(model.part_maxima(change, degree), 0.0))
        rises[~inner] = 0.0
        # What the force misses rises and falls on those parts of the time alone.
        is_beyond = above.reshape(pieces, -1, parts).max(axis=1) > 0
        varied = variation * is_beyond.mean(axis=0)
        moved += falls.sum(axis=0) + varied
        rise += float((rises.sum(axis=0) + varied).max())
        most = np.maximum(most, above.max(axis=0))
        integral += above.mean(axis=0)
    return moved, most, integral, rise


def _reversals(found: Interpolant) -> list[tuple[int, Array]]:
    """Bound how far a yielding storey moves against its direction of yielding.

    Returns:
        Numbers of elements on which it may, each with the distance on each part of the box, in m.
    """
    model = found.model
    at = np.flatnonzero(found.phase)
    if not len(at):
        return []
    order = np.arange(1, found.terms)[:, np.newaxis]
    # h times the velocity of the drift against the direction, at control points
    backward = -found.phase[at, np.newaxis, np.newaxis] * order * found.drift[at, 1:]
    middle, radius = ranges(
        model, np.einsum("ik,ekf->eif", bernstein_matrix(len(order) - 1), backward)
    )
    variation = found.load_variation[at] @ model.following_drift
    control_matrix = bernstein_matrix(len(order) - 1, REVERSAL_PARTS)
    results: list[tuple[int, Array]] = []
    for number in np.flatnonzero((middle + radius).max(axis=1) + variation > 0):
        control = control_matrix @ backward[number]
        above = model.part_maxima(control, model.degree) + variation[number]
        results.append((int(at[number]), np.maximum(above, 0.0).mean(axis=0)))
    return results
