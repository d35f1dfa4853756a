"""Bounds of the outputs of interpolated motions with a yielding storey.

An output is a sum of the components drifts, velocities, force r of the slider and length of the
plastic path, with factors that may depend on the inputs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import comb

from alphacut.base.arrays import Array, Ints
from alphacut.frame.bounds.interpolated_defects import Interpolant
from alphacut.frame.bounds.interpolated_motions import LOAD_TERMS
from alphacut.frame.calculus.interpolation import (
    along_inputs,
    bernstein_matrix,
    refining_matrix,
)

# Parts of an element's time on which peaks are bounded where they matter (tuned: the bound of a
# polynomial of the degree 12 by its Bernstein coefficients is then within 1e-4 of its peak).
TIME_PARTS = 4


@dataclass(frozen=True, eq=False)
class OutputRows:
    """m outputs as sums of 2N + 2 components, and how errors of the motion enter.

    Args:
        factors: Factors of the components on the coarse grid, shape (m, components, F).
        remainder: What these miss, shape (m, components).
        magnitude: Bounds of the factors, shape (m, components).
        by_norm: Error of each output for S = 1, shape (m,).
        without_drift: The same but for the drift of the yielding storey, shape (m,).
        of_drift: Bound of the factor of this drift, shape (m,).
        degree: Degree of each output in each input, shape (m,).
    """

    factors: Array
    remainder: Array
    magnitude: Array
    by_norm: Array
    without_drift: Array
    of_drift: Array
    degree: Ints

    @property
    def uses_rates(self) -> bool:
        """Whether an output has a velocity in it."""
        n = self.magnitude.shape[1] // 2 - 1
        return bool(self.magnitude[:, n : 2 * n].any())


def output_series(found: Interpolant, rows: OutputRows, slider_level: Array) -> tuple[Array, Array]:
    """Return the outputs of interpolated motions, and bounds of what these series miss.

    Args:
        found: The motions.
        rows: The outputs.
        slider_level: Bound of what the polynomial of the slider's force misses, shape (e,), in N.

    Returns:
        Powers of τ on the grid, shape (e, K, m, F), and bounds, shape (e, m).
    """
    model = found.model
    missed_drifts = found.load_error @ model.following_drifts
    velocity = found.drifts  # no matter if no output uses velocities
    missed_velocity = found.velocity_error
    if rows.uses_rates:
        velocity = found.absolute_velocity.copy()
        velocity[:, :LOAD_TERMS] += model.follow.T @ found.load_rate
        missed_velocity = missed_velocity + found.rate_error @ np.abs(model.follow)
    path = found.phase[:, np.newaxis, np.newaxis] * found.drift
    path[:, 0] += found.path
    of_floors = [np.moveaxis(x, 2, 0) for x in (found.drifts, velocity)]
    components = [*of_floors[0], *of_floors[1], found.slider_force, path]
    missed = np.column_stack(
        [missed_drifts, missed_velocity, slider_level, missed_drifts[:, model.place]]
    )
    degrees = model.coarse, model.fine
    factors = along_inputs(rows.factors, model.inputs, refining_matrix, *degrees)
    values = np.zeros((*path.shape[:2], len(factors), path.shape[2]))
    for row, column in np.argwhere(rows.magnitude):
        values[:, :, row] += factors[row, column] * components[column]
    # The grid of the degree has a Lebesgue constant below 3 in each input (degrees up to 20).
    largest = np.zeros_like(missed)
    for column in np.flatnonzero(rows.remainder.any(axis=0)):
        peaks = np.abs(components[column]).max(axis=-1)
        largest[:, column] = 3.0**model.inputs * peaks.sum(axis=1)
    return values, missed @ rows.magnitude.T + (largest + missed) @ rows.remainder.T


def polygons(found: Interpolant, values: Array) -> Array:
    """Return Bernstein coefficients in τ of upper bounds over the box of (−output, output).

    Args:
        found: The motions.
        values: Powers of τ on the grid, shape (e, K, m, F).

    Returns:
        Shape (e, m, 2, K).
    """
    control = np.tensordot(bernstein_matrix(found.terms - 1), values, (1, 1))  # (K, e, m, F)
    middle, radius = found.model.ranges(np.asarray(control))
    return np.moveaxis(np.stack([radius - middle, radius + middle], axis=-1), 0, -1)


def part_peaks(found: Interpolant, values: Array, degree: int) -> Array:
    """Bound an output of one element on parts of the box and over all its times.

    Args:
        found: The motions.
        values: Powers of τ on the grid, shape (K, F).
        degree: Degree of the output in each input.

    Returns:
        Shape (parts,).
    """
    control = bernstein_matrix(found.terms - 1, TIME_PARTS) @ values
    return np.asarray(found.model.part_maxima(control, degree).max(axis=0))


def observe(upper: Array, times: Array, nodes: Array, bounds: Array, steps: Array) -> None:
    """Raise bounds at time nodes and over the steps before them by those of elements, in place.

    The node t is met at τ = (t − begin) / h = 1 − (end − t) / h, which the ends of begin, end and
    length h bound. On this interval a bound is at most its value at the midpoint and what its slope
    adds.

    Args:
        upper: Bernstein coefficients of upper bounds of (−output, output), shape (e, m, 2, K).
        times: Earliest and latest begin, earliest and latest end, shortest and greatest length of
            each element, shape (e, 6).
        nodes: Time nodes, rising, shape (T,).
        bounds: Bounds at nodes, shape (T, m, 2).
        steps: Bounds over the step before each node, with both its ends, shape (T, m, 2).
    """
    same = 1e-10 * (1 + times[:, 3])
    highest = upper.max(axis=-1)
    last = np.searchsorted(nodes[:-1], times[:, 3] - same)
    element, step = _pairs(np.searchsorted(nodes, times[:, 0] + same), last + 1)
    np.maximum.at(steps, step, highest[element])

    first = np.searchsorted(nodes, times[:, 0] - same)
    element, node = _pairs(first, np.searchsorted(nodes, times[:, 3] + same))
    begin, last_begin, first_end, end, shortest, longest = times[element].T
    shortest = np.maximum(shortest, 1e-300)
    longest = np.maximum(longest, 1e-300)
    t = nodes[node]
    low = np.maximum((t - last_begin) / longest, 1 - np.maximum(end - t, 0.0) / shortest)
    high = np.minimum(np.maximum(t - begin, 0.0) / shortest, 1 - (first_end - t) / longest)
    low = np.clip(low - 1e-9, 0.0, 1.0)
    high = np.clip(high + 1e-9, low, 1.0)
    degree = upper.shape[-1] - 1
    tau = (low + high)[:, np.newaxis] / 2
    k = np.arange(degree + 1)
    basis = comb(degree, k) * tau**k * (1 - tau) ** (degree - k)
    slope = degree * np.abs(np.diff(upper, axis=-1)).max(axis=-1)
    found = np.einsum("pk,pmsk->pms", basis, upper[element])
    found += slope[element] * ((high - low) / 2)[:, np.newaxis, np.newaxis]
    np.maximum.at(bounds, node, np.minimum(found, highest[element]))


def _pairs(first: Ints, behind: Ints) -> tuple[Ints, Ints]:
    """Return each number i with each of the integers from first_i to behind_i − 1."""
    count = np.maximum(behind - first, 0)
    number = np.repeat(np.arange(len(first)), count)
    before = np.repeat(np.cumsum(count) - count, count)
    return number, first[number] + np.arange(len(number)) - before
