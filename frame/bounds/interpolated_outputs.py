"""Bounds of the outputs of interpolated motions with a yielding storey.

An output is a sum of drifts, velocities, the force r of the slider and the length of the plastic
path, with factors that may depend on the inputs. With velocities q' = M⁻¹ (P − C q) + Σ w_l g_l' it
is a sum of the components drifts, P, q, g', r and path.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.kernels import compiled
from alphacut.frame.bounds.interpolated_defects import Interpolant, drifts
from alphacut.frame.bounds.interpolated_motions import LOAD_TERMS
from alphacut.frame.calculus.interpolation import bernstein_matrix, coefficients
from alphacut.frame.calculus.taylor_model import TaylorModel

# Parts of an element's time on which peaks are bounded where they matter (tuned: the bound of a
# polynomial of the degree 12 by its Bernstein coefficients is then within 1e-4 of its peak).
TIME_PARTS = 4


@dataclass(frozen=True, eq=False)
class OutputRows:
    """m outputs as sums of components, and how errors of the motion enter.

    Args:
        factors: Factors of the components on the grid, shape (m, components, F).
        remainder: What these miss, shape (m, components).
        magnitude: Bounds of the factors, shape (m, components).
        by_norm: Error of each output for S = 1, shape (m,).
        without_drift: The same but for the drift of the yielding storey, shape (m,).
        of_drift: Bound of the factor of this drift, shape (m,).
        of_slider: Bound of the factor of the slider's force, shape (m,).
        of_path: Bound of the factor of the plastic path, shape (m,).
        degree: Degree of each output in each input, shape (m,).
        uses_rates: Whether an output has a velocity in it.
    """

    factors: Array
    remainder: Array
    magnitude: Array
    by_norm: Array
    without_drift: Array
    of_drift: Array
    of_slider: Array
    of_path: Array
    degree: Ints
    uses_rates: bool

    @property
    def uses_path(self) -> bool:
        """Whether an output is dissipated energy."""
        return bool(self.of_path.any())


class Row(NamedTuple):
    """Factors of an output, as Taylor models.

    The first six are those of its components, in their order; the last one is that of velocities,
    from which the factors of P, q and g' follow.
    """

    drifts: TaylorModel  # (N,)
    momenta: TaylorModel  # (N,)
    displacements: TaylorModel  # (N,)
    rates: TaylorModel  # (L,)
    slider: TaylorModel  # (1,)
    path: TaylorModel  # (1,)
    velocities: TaylorModel  # (N,)


def components(found: Interpolant) -> Array:
    """Return drifts, P, q, g', r and path of interpolated motions, (e, K, components, F)."""
    rate = np.zeros((*found.relative.shape[:2], *found.load_rate.shape[2:]))
    rate[:, :LOAD_TERMS] = found.load_rate
    is_elastic = (found.phase == 0)[:, np.newaxis, np.newaxis]
    phase = found.phase[:, np.newaxis]
    slider = np.where(is_elastic, found.slider_force, 0.0)
    slider[:, 0] += phase * found.model.force
    path = phase[:, :, np.newaxis] * found.drift
    path[:, 0] += found.path
    return np.concatenate(
        [
            drifts(found.relative, axis=2),
            found.momentum,
            found.relative,
            rate,
            slider[:, :, np.newaxis],
            path[:, :, np.newaxis],
        ],
        axis=2,
    )


def output_series(found: Interpolant, rows: OutputRows, slider_level: Array) -> tuple[Array, Array]:
    """Return the outputs of interpolated motions, and bounds of what these series miss.

    Args:
        found: The motions.
        rows: The outputs.
        slider_level: Bound of what the polynomial of the slider's force misses, shape (e,), in N.

    Returns:
        Powers of τ on the grid, shape (e, K, m, F), and bounds, shape (e, m).
    """
    parts = components(found)
    m, count, _ = rows.factors.shape
    values = np.zeros((*parts.shape[:2], m, parts.shape[3]))
    for row in range(m):
        for column in range(count):
            if rows.magnitude[row, column]:
                values[:, :, row] += rows.factors[row, column] * parts[:, :, column]
    model = found.model
    n = model.floors
    loads = len(model.follow)
    missed = np.zeros((len(parts), count))
    missed[:, :n] = found.load_error @ np.abs(drifts(model.follow, axis=1))
    missed[:, 2 * n : 3 * n] = found.load_error @ np.abs(model.follow)
    missed[:, 3 * n : 3 * n + loads] = found.rate_error
    missed[:, 3 * n + loads] = slider_level
    # The grid of the degree has a Lebesgue constant below 3 in each input (degrees up to 20).
    largest = 3.0**model.inputs * np.abs(parts).max(axis=-1).sum(axis=1)
    return values, missed @ rows.magnitude.T + (largest + missed) @ rows.remainder.T


def polygons(found: Interpolant, values: Array) -> Array:
    """Return Bernstein coefficients in τ of upper bounds over the box of (−output, output).

    Args:
        found: The motions.
        values: Powers of τ on the grid, shape (e, K, m, F).

    Returns:
        Shape (e, m, 2, K).
    """
    matrix = bernstein_matrix(found.terms - 1)
    control = np.asarray(np.tensordot(matrix, values, (1, 1)), np.float64)  # (K, e, m, F)
    by_input = coefficients(control, found.model.inputs, found.model.fine)
    middle = by_input[..., 0]
    radius = np.abs(by_input[..., 1:]).sum(axis=-1)
    both = np.stack([radius - middle, radius + middle], axis=-1)
    return np.ascontiguousarray(np.moveaxis(both, 0, -1))


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


@compiled
def observe(upper: Array, times: Array, nodes: Array, bounds: Array, steps: Array) -> None:
    """Raise bounds at time nodes and over the steps before them by those of elements, in place.

    The node t is met at τ = (t − begin) / h = 1 − (end − t) / h. The ends of begin, end and length
    h bound τ. On this interval de Casteljau's algorithm has the Bernstein coefficients.

    Args:
        upper: Bernstein coefficients of upper bounds of (−output, output), shape (e, m, 2, K).
        times: Earliest and latest begin, earliest and latest end, shortest and greatest length of
            each element, shape (e, 6).
        nodes: Time nodes, rising, shape (T,).
        bounds: Bounds at nodes, shape (T, m, 2).
        steps: Bounds over the step before each node, with both its ends, shape (T, m, 2).
    """
    terms = upper.shape[3]
    work = np.empty(terms)
    for e in range(len(upper)):
        begin, last_begin, first_end, end, shortest, longest = times[e]
        same = 1e-10 * (1 + end)
        first = np.searchsorted(nodes, begin - same)
        last = np.searchsorted(nodes, end + same)
        first_step = max(np.searchsorted(nodes, begin + same), 0)
        last_step = min(np.searchsorted(nodes, end - same), len(nodes) - 1)
        for row in range(upper.shape[1]):
            for side in range(2):
                most = upper[e, row, side].max()
                for step in range(first_step, last_step + 1):
                    steps[step, row, side] = max(steps[step, row, side], most)
        for node in range(first, last):
            t = nodes[node]
            low = max((t - last_begin) / max(longest, 1e-300), 0.0)
            high = 1.0
            if first_end >= t:
                high = 1 - (first_end - t) / max(longest, 1e-300)
            if shortest > 0:
                low = max(low, 1 - max(end - t, 0.0) / shortest)
                high = min(high, max(t - begin, 0.0) / shortest)
            low = min(max(low - 1e-9, 0.0), 1.0)
            high = min(max(high + 1e-9, low), 1.0)
            for row in range(upper.shape[1]):
                for side in range(2):
                    most = _restricted_max(upper[e, row, side], low, high, work)
                    bounds[node, row, side] = max(bounds[node, row, side], most)


@compiled
def _restricted_max(control: Array, low: float, high: float, work: Array) -> float:
    """Return the largest Bernstein coefficient of a polynomial on [low, high] within [0, 1]."""
    n = len(control)
    work[:] = control
    # the part [0, high]: `work` ends with its coefficients in turn
    for level in range(1, n):
        for i in range(n - 1, level - 1, -1):
            work[i] = (1 - high) * work[i - 1] + high * work[i]
    # The part [low / high, 1] of that.
    split = low / high if high > 0 else 0.0
    for level in range(1, n):
        for i in range(n - level):
            work[i] = (1 - split) * work[i] + split * work[i + 1]
    most = work[0]
    for i in range(1, n):
        most = max(most, work[i])
    return float(most)
