"""By how much interpolated motions of a frame with a yielding storey miss its equations.

The theory is in docs/theory/proofs.md, "A yielding storey": the energy norm S of the difference of
the interpolated to the true motion grows by no more than the norms of the defects. Here all defects
are bounded at all inputs of the box and at all times, by coefficients of polynomials. Arrays over a
grid of inputs have it as their last axis; e counts elements, k powers of τ.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.frame.bounds.interpolated_motions import LOAD_TERMS, Elements, composed
from alphacut.frame.calculus.interpolation import (
    along_inputs,
    bernstein_matrix,
    box_maxima,
    coefficients,
    magnitude,
    part_maxima,
    refining_matrix,
)

Values = TypeVar("Values")

# Parts of each input over which S is kept, by the number of inputs (tuned: a left-out event moves
# the slider in a corner of the box alone, and the peak may lie elsewhere).
PARTS = {0: 1, 1: 8, 2: 4, 3: 2}
# Numbers of parts of an element's time on which the slider's force is bounded, in turn, until its
# excess is below a fraction of the yield force, or does not become smaller by half (tuned).
TIME_PARTS = (1, 2, 8, 32, 128)
SMALL_VIOLATION = 1e-9
# The same of the velocity of a yielding storey.
REVERSAL_PARTS = 32


class Properties(NamedTuple, Generic[Values]):
    """Properties of a frame of N floors: over a box, at the points of a grid, or bounds of them.

    A storey z has the stiffness κ_z after yielding, less weight over height (of an elastic storey:
    its stiffness less weight over height), and the yielding one a slider beside it.
    """

    mass: Values  # M, (N,), in kg
    inverse_mass: Values  # (N,), in 1/kg
    damping: Values  # C, (N, N), in N s/m
    decay: Values  # D = M⁻¹ C, (N, N), in 1/s
    stiffness: Values  # κ, (N,), in N/m
    slider: Values  # K_z, (), in N/m
    force: Values  # yield force of the slider, (), in N
    q0: Values  # initial displacements, (N,), in m
    v0: Values  # initial velocities, (N,), in m/s


@dataclass(frozen=True, eq=False)
class BoxModel:
    """A frame of N floors over a box: its properties are polynomials but for a remainder.

    Args:
        inputs: Number d of inputs.
        degree: Degree of the interpolation of motions in each input.
        fine: Degree of the grid, at which products of a length, a property and a motion are exact.
        coarse: Degree at which products of a property and a motion are, and outputs.
        of_slider: Degree of the slider's force in each input.
        place: Number of the yielding storey.
        follow: w, accelerations of the floors under a unit of each load, shape (L, N).
        at_sets: Properties at the parameter sets of the motions.
        grid: Properties on the grid.
        low: Lower bounds; those of κ are not negative, those of masses and of the slider positive.
        high: Bounds of magnitudes.
        missed: Bounds of what the polynomials of properties miss.
    """

    inputs: int
    degree: int
    fine: int
    coarse: int
    of_slider: int
    place: int
    follow: Array
    at_sets: Properties[Array]
    grid: Properties[Array]
    low: Properties[Array]
    high: Properties[Array]
    missed: Properties[Array]

    @cached_property
    def fixed(self) -> BoxModel:
        """The same on the coarse grid, for elements whose length is the same at all inputs."""
        degrees = self.fine, self.coarse
        values = (along_inputs(x, self.inputs, refining_matrix, *degrees) for x in self.grid)
        return replace(self, fine=self.coarse, grid=Properties(*values))

    @property
    def parts(self) -> int:
        """Number of parts of each input over which S is kept."""
        return PARTS[self.inputs]

    @property
    def direction_norm(self) -> float:
        """Bound of (bᵀ M⁻¹ b)^½, with the drift bᵀ q of the yielding storey."""
        z = self.place
        return float(np.sqrt(self.high.inverse_mass[max(z - 1, 0) : z + 1].sum()))

    @property
    def soft_root(self) -> float:
        """Lower bound of κ^½ of the yielding storey, in (N/m)^½; above 0 by rounding at least."""
        return float(np.sqrt(max(self.low.stiffness[self.place], 1e-300)))

    def elastic_stiffness(self, of: Properties[Array]) -> Array:
        """Return the sum of bounds of all storeys' stiffness and of that of the slider, (N,)."""
        found = of.stiffness.copy()
        found[self.place] += of.slider
        return found

    @property
    def following_drifts(self) -> Array:
        """Magnitudes of the drifts of w, shape (L, N)."""
        return np.abs(drifts(self.follow, axis=1))

    def refined(self, values: Array) -> Array:
        """Return what interpolates values at the parameter sets of the motions, on the grid."""
        return along_inputs(values, self.inputs, refining_matrix, self.degree, self.fine)

    def magnitude(self, values: Array) -> Array:
        """Bound the magnitudes of polynomials on the grid over the box, shape (…)."""
        return magnitude(values, self.inputs, self.fine)

    def part_maxima(self, values: Array, degree: int) -> Array:
        """Bound polynomials of a degree on each part of the box, shape (…, parts)."""
        return part_maxima(values, self.inputs, self.fine, self.parts, degree)

    def ranges(self, values: Array) -> tuple[Array, Array]:
        """Return midpoints and radii of intervals of polynomials over the box, shape (…) each."""
        found = coefficients(values, self.inputs, self.fine)
        return found[..., 0], np.abs(found[..., 1:]).sum(axis=-1)

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
        event: Side of the event at the end, or 0, shape (e,).
        constant: c of an elastic storey, before an element or behind it, shape (e, F), in N.
        path: See `Elements`, shape (e, F), in m.
        load_error: Bounds of |g − the polynomials in τ and inputs that stand for it|, (e, L), in m.
        load_variation: Bounds of the derivative by τ of g − these, shape (e, L), in m.
        load_rate: What interpolates g' at the inputs, shape (e, LOAD_TERMS, L, F), in m/s; without
            loads if it is not asked for.
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
    event: Ints
    constant: Array
    path: Array
    load_error: Array
    load_variation: Array
    load_rate: Array
    rate_error: Array
    max_relative: Array
    times: Array

    @cached_property
    def drifts(self) -> Array:
        """Drifts of all storeys, shape (e, K, N, F), in m."""
        return drifts(self.relative, axis=2)

    @property
    def drift(self) -> Array:
        """Drift of the yielding storey, shape (e, K, F), in m."""
        return self.drifts[:, :, self.model.place]

    @cached_property
    def elastic_force(self) -> Array:
        """K_z bᵀ q − c, shape (e, K, F), in N."""
        force = self.model.grid.slider * self.drift
        force[:, 0] -= self.constant
        return force

    @cached_property
    def slider_force(self) -> Array:
        """Force of the slider, of an elastic or a yielding storey, shape (e, K, F), in N."""
        force = np.where(self.phase[:, np.newaxis, np.newaxis] == 0, self.elastic_force, 0.0)
        force[:, 0] += self.phase[:, np.newaxis] * self.model.grid.force
        return force

    @cached_property
    def absolute_velocity(self) -> Array:
        """M⁻¹ P − D q, shape (e, K, N, F), in m/s."""
        velocity = self.model.grid.inverse_mass * self.momentum
        velocity -= np.einsum("ijf,ekjf->ekif", self.model.grid.decay, self.relative)
        return velocity

    @cached_property
    def velocity_error(self) -> Array:
        """Bounds of what this misses, shape (e, N), in m/s."""
        model = self.model
        missed = self.load_error @ np.abs(model.follow) @ model.high.decay.T
        missed += self.max_relative.sum(axis=1) @ model.missed.decay.T
        return missed + model.missed.inverse_mass * model.largest(self.momentum).sum(axis=1)


class Defects(NamedTuple):
    """Bounds of the defects of some elements, each integrated over the element."""

    growth: Array  # growth of S at all inputs, (e,), in J^½
    violation: Array  # growth of S on each part of the box where an event is left out, (e, parts)
    drift: Array  # bound of ∫ |bᵀ δ_q| dt, (e,), in m
    path: Array  # by how much the plastic path differs from that of a flow by the rule, (e,), in m
    beyond: Array  # by how much the slider may be beyond its yield force, (e, parts), in N
    level: Array  # what polynomials of the slider's force miss, (e,), in N


def drifts(values: Array, axis: int) -> Array:
    """Return the differences of neighbouring floors along an axis, the first one to the ground."""
    return np.diff(values, axis=axis, prepend=0.0)


def max_drifts(values: Array) -> Array:
    """Return bounds of the drifts of what is bounded by `values` at each floor, shape (…, N)."""
    found: Array = values.copy()
    found[..., 1:] += values[..., :-1]
    return found


def interpolate(
    model: BoxModel, elements: Elements, chosen: slice | Ints, *, with_rates: bool
) -> Interpolant | None:
    """Return the interpolated motions on some elements, or None where their times go astray.

    The times of an element must lie within those at which its load is approximated, and its length
    must not be negative, at all inputs.

    Args:
        model: The frame over the box.
        elements: Motions at its parameter sets.
        chosen: Which elements.
        with_rates: Whether the rates of the loads are found, which velocities need.
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
    max_length = times[:, 5]
    # The margin is rounding, which the widening of all bounds covers.
    margin = 1e-10 * (1 + np.abs(span).sum(axis=1))
    within = times[:, 0] >= span[:, 0] - span[:, 1] - margin
    within &= times[:, 3] <= span[:, 0] + span[:, 1] + margin
    if not (within & (times[:, 4] >= 0)).all():
        return None
    # Polynomials of loads, and of their rates, by powers of (t − midpoint) / radius.
    fit = elements.fit[chosen]
    n_loads = fit.shape[1]
    if with_rates:
        rate = np.zeros_like(fit)
        rate[:, :, :-1] = fit[:, :, 1:] * np.arange(1, LOAD_TERMS) / span[:, 1, None, None]
        fit = np.concatenate([fit, rate], axis=1)
    loads, missed, variation = _loads_over_inputs(model, begin, length, span, fit)
    fit_error = elements.fit_error[chosen]

    n = len(model.follow[0])
    terms = max(int(elements.terms.max(initial=0)), LOAD_TERMS)
    series = elements.series[chosen, :terms]
    relative = series[:, :, :n].copy()
    relative[:, :LOAD_TERMS] += model.follow.T @ loads[:, :, :n_loads]
    refined = model.refined(np.concatenate([series, relative], axis=2))
    return Interpolant(
        model=model,
        terms=terms,
        displacement=refined[:, :, :n],
        momentum=refined[:, :, n : 2 * n],
        relative=refined[:, :, 2 * n :],
        length=model.refined(length),
        max_length=max_length,
        phase=elements.phase[chosen],
        event=elements.event[chosen],
        constant=model.refined(elements.constant[chosen]),
        path=model.refined(elements.path[chosen]),
        load_error=fit_error[..., 0] + missed[:, :n_loads],
        load_variation=fit_error[..., 1] * max_length[:, np.newaxis] + variation[:, :n_loads],
        load_rate=model.refined(loads[:, :, n_loads:]) if with_rates else loads[:, :, n_loads:],
        rate_error=fit_error[..., 1] + missed[:, -n_loads:],
        max_relative=model.largest(relative),
        times=times,
    )


def _loads_over_inputs(
    model: BoxModel, begin: Array, length: Array, span: Array, fit: Array
) -> tuple[Array, Array, Array]:
    """Return loads at the parameter sets, and bounds of what interpolation over inputs misses.

    At the inputs u and the fraction τ an element has the time t = t_0(u) + τ h(u), and the load is
    a polynomial of t. So it is one of τ and u, of the degree 7 n in each input with the degree n of
    the interpolation. Its Chebyshev coefficients less those of its interpolant bound the
    difference, in the Bernstein form in τ.

    Args:
        model: The frame over the box.
        begin: t_0 at the parameter sets, shape (e, J).
        length: h at the parameter sets, shape (e, J).
        span: Midpoint and radius of the times of each element, shape (e, 2).
        fit: Powers of (t − midpoint) / radius, shape (e, L, LOAD_TERMS).

    Returns:
        Powers of τ, shape (e, LOAD_TERMS, L, J), and bounds of the difference and of its derivative
        by τ, shape (e, L).
    """
    at_zero = (begin - span[:, :1]) / span[:, 1:]
    slope = length / span[:, 1:]
    loads = _composed_elements(fit, at_zero, slope)
    missed, variation = np.zeros((2, *fit.shape[:2]))
    varies = np.flatnonzero((np.ptp(begin, axis=1) > 0) | (np.ptp(length, axis=1) > 0))
    if len(varies):
        degree = (LOAD_TERMS - 1) * model.degree
        how = model.inputs, refining_matrix, model.degree, degree
        finer = along_inputs(np.stack([at_zero[varies], slope[varies]]), *how)
        exact = _composed_elements(fit[varies], finer[0], finer[1])
        exact -= along_inputs(loads[varies], *how)
        exact = np.asarray(np.tensordot(bernstein_matrix(LOAD_TERMS - 1), exact, (1, 1)), float)
        missed[varies] = magnitude(exact, model.inputs, degree).max(axis=0)
        rate = magnitude(np.diff(exact, axis=0), model.inputs, degree).max(axis=0)
        variation[varies] = (LOAD_TERMS - 1) * rate
    return loads, missed, variation


def _composed_elements(fit: Array, at_zero: Array, slope: Array) -> Array:
    """Return the results of `composed` of all elements, shape (e, LOAD_TERMS, L, points)."""
    found = np.empty((len(fit), LOAD_TERMS, fit.shape[1], at_zero.shape[1]))
    for e in range(len(fit)):
        composed(fit[e], at_zero[e], slope[e], found[e])
    return found


def defects(found: Interpolant, small: float = 0.0) -> Defects:
    """Bound the defects of interpolated motions.

    Args:
        found: The motions.
        small: Growth of S by an event that is left out that is not bounded more closely, in J^½.
    """
    model = found.model
    low = model.low
    high = model.high
    growth, drift = _residuals(found)
    following = model.following_drifts[:, model.place]
    path = 2 * found.load_error @ following * (found.event != 0)
    # What polynomials of the slider's force less its yield force miss, and its derivative by τ.
    by_powers = 2 * model.missed.slider * found.max_relative.sum(axis=2)
    level = high.slider * (found.load_error @ following) + by_powers.sum(axis=1)
    level += model.missed.force
    variation = high.slider * (found.load_variation @ following)
    variation += by_powers @ np.arange(found.terms)

    # At an event at the end of an element the force, with the constant of the elastic side, should
    # be ± the yield force. The slider is moved at once by what it misses.
    at = np.flatnonzero(found.event)
    if len(at):
        missed = found.elastic_force[at].sum(axis=1)
        missed -= found.event[at, np.newaxis] * model.grid.force
        growth[at] += (model.magnitude(missed) + level[at]) / np.sqrt(low.slider)

    violation = np.zeros((len(growth), model.parts**model.inputs))
    beyond = np.zeros_like(violation)
    at = np.flatnonzero(found.phase == 0)
    passed = _elastic_violations(model, found.elastic_force[at], level[at], variation[at], small)
    beyond[at] = passed.most
    # |δ_j| adds up to what the slider falls back, and forces miss what it is beyond meanwhile.
    forced = passed.integral * found.max_length[at, np.newaxis]
    violation[at] = passed.falls / np.sqrt(low.slider) + model.direction_norm * forced
    path[at] += passed.rises.max(axis=1) / low.slider
    at, back = _reversals(found)
    violation[at] = np.sqrt(high.slider) * back
    path[at] += back.max(axis=1)
    level = np.where(found.phase == 0, level, model.missed.force)
    return Defects(growth, violation, drift, path, beyond, level)


def _residuals(found: Interpolant) -> tuple[Array, Array]:
    """Bound what kinematics and the balance of forces miss.

    With powers of τ the residuals are h δ_q = X' − h (M⁻¹ P − D q) and h δ_P = P' + h (K_p q + b r)
    of each power. Then δ_v = δ_P − C δ_q, and S grows by ‖δ_v‖ in M⁻¹ and ‖δ_q‖ in K_e = K_p + K_z
    b bᵀ. Integrated over τ a power k has the factor 1 / (k + 1).

    Returns:
        Growth of S, shape (e,), and ∫ |bᵀ δ_q| dt, shape (e,).
    """
    model = found.model
    z = model.place
    h = found.length[:, np.newaxis, np.newaxis]
    order = np.arange(1, found.terms)[:, np.newaxis, np.newaxis]
    kinematic = -h * found.absolute_velocity
    kinematic[:, :-1] += order * found.displacement[:, 1:]
    drift_defect = model.magnitude(drifts(kinematic, axis=2))
    balance = model.grid.stiffness * found.drifts
    balance[:, :, z] += found.slider_force
    balance *= h
    balance[:, :, :-1] -= balance[:, :, 1:]  # a floor is held from below and pulled from above
    balance[:, :-1] += order * found.momentum[:, 1:]
    force_defect = model.magnitude(balance)

    # What remainders of the properties and errors of the load add, as terms of the power 0.
    longest = found.max_length[:, np.newaxis]
    drift_defect[:, 0] += max_drifts(longest * found.velocity_error)
    stiffest = model.elastic_stiffness(model.high)
    storey_force = found.load_error @ model.following_drifts * stiffest
    largest = max_drifts(found.max_relative.sum(axis=1))
    storey_force += largest * model.elastic_stiffness(model.missed)
    storey_force[:, z] += model.missed.force
    storey_force *= longest
    force_defect[:, 0] += storey_force
    force_defect[:, 0, :-1] += storey_force[:, 1:]

    # |δ_q| of a floor is at most the sum of its drifts below.
    force_defect = force_defect + drift_defect.cumsum(axis=2) @ model.high.damping
    by_power = np.sqrt((force_defect**2 * model.high.inverse_mass).sum(axis=-1))
    by_power += np.sqrt((drift_defect**2 * stiffest).sum(axis=-1))
    weights = 1 / np.arange(1, found.terms + 1)
    return by_power @ weights, drift_defect[:, :, z] @ weights


class _Violations(NamedTuple):
    """What is left out where the slider of an elastic storey passes its yield force, in N."""

    falls: Array  # what the force falls beyond the yield force, on parts of the box, (e, parts)
    rises: Array  # what it rises there, (e, parts)
    most: Array  # by how much it is beyond, (e, parts)
    integral: Array  # of that over τ, (e, parts)


def _elastic_violations(
    model: BoxModel, force: Array, level: Array, variation: Array, small: float
) -> _Violations:
    """Bound what is left out where the slider of an elastic storey passes its yield force.

    The slider of the motion is held there. While the force rises beyond, it flows as it may; it is
    moved by what the force falls back. By the variation-diminishing property of the Bernstein form
    a polynomial falls above zero by no more than its control polygon does, and a mean of the
    control points bounds its integral.

    Args:
        model: The frame.
        force: The slider's force by powers of τ, shape (e, K, F), in N.
        level: Bounds of what it misses, shape (e,), in N.
        variation: Bounds of the derivative by τ of what it misses, shape (e,), in N.
        small: See `defects`.
    """
    best = _elastic_violations_on(model, force, level, variation, TIME_PARTS[0])
    enough = np.maximum(SMALL_VIOLATION * model.low.force, small * np.sqrt(model.low.slider))
    rough = np.arange(len(force))
    for pieces in TIME_PARTS[1:]:
        # Control points on shorter parts of the time lie closer to the force.
        before = best.falls[rough].max(axis=1, initial=0.0)
        rough = rough[before > enough]
        closer = _elastic_violations_on(model, force[rough], level[rough], variation[rough], pieces)
        for kept, found in zip(best, closer, strict=True):
            kept[rough] = found
        if pieces > TIME_PARTS[1]:
            rough = rough[before[before > enough] >= 2 * closer.falls.max(axis=1, initial=0.0)]
    return best


def _elastic_violations_on(
    model: BoxModel, force: Array, level: Array, variation: Array, pieces: int
) -> _Violations:
    """Return the results of `_elastic_violations` by control points on equal parts of the time."""
    control = bernstein_matrix(force.shape[1] - 1, pieces) @ force
    of_box = coefficients(control, model.inputs, model.fine)
    of_limit = coefficients(model.grid.force, model.inputs, model.fine)
    parts = model.parts**model.inputs
    found = _Violations(*np.zeros((4, len(force), parts)))
    for side in (-1.0, 1.0):
        # Control points that are surely below count as zero, and bound falls and rises of those
        # beside them. The last one of a part of the time is the first one of the next.
        middle = side * of_box[..., 0] - of_limit[0]
        radius = np.abs(side * of_box[..., 1:] - of_limit[1:]).sum(axis=-1)
        element, near = np.nonzero(middle + radius + level[:, np.newaxis] > 0)
        if not len(near):
            continue
        excess = side * control[element, near] - model.grid.force
        most = model.part_maxima(excess, model.of_slider) + level[element, np.newaxis]
        above = np.zeros((*control.shape[:2], parts))
        above[element, near] = np.maximum(most, 0.0)
        # What the force misses rises and falls on those parts of the time alone.
        is_beyond = above.reshape(len(force), pieces, -1, parts).max(axis=2) > 0
        for total, step in ((found.falls, 1), (found.rises, -1)):
            beside = np.clip(near + step, 0, control.shape[1] - 1)
            change = side * (control[element, near] - control[element, beside])
            change = np.maximum(model.part_maxima(change, model.of_slider), 0.0)
            np.add.at(total, element, np.minimum(above[element, near], change))
            total += variation[:, np.newaxis] * is_beyond.mean(axis=1)
        np.maximum(found.most, above.max(axis=1), out=found.most)
        np.add(found.integral, above.mean(axis=1), out=found.integral)
    return found


def _reversals(found: Interpolant) -> tuple[Ints, Array]:
    """Bound how far a yielding storey moves against its direction of yielding.

    Returns:
        Numbers of elements on which it may, and the distance on each part of the box, in m.
    """
    model = found.model
    at = np.flatnonzero(found.phase)
    order = np.arange(1, found.terms)[:, np.newaxis]
    # h times the velocity of the drift against the direction, at control points
    backward = -found.phase[at, np.newaxis, np.newaxis] * order * found.drift[at, 1:]
    middle, radius = model.ranges(bernstein_matrix(len(order) - 1) @ backward)
    variation = found.load_variation[at] @ model.following_drifts[:, model.place]
    chosen = np.flatnonzero((middle + radius).max(axis=1, initial=-np.inf) + variation > 0)
    control = bernstein_matrix(len(order) - 1, REVERSAL_PARTS) @ backward[chosen]
    above = model.part_maxima(control, model.degree) + variation[chosen, np.newaxis, np.newaxis]
    return at[chosen], np.maximum(above, 0.0).mean(axis=1)
