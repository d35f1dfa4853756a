"""One-step methods for linear structures.

The scheme is differentiated by the parameters, not the differential equation (internal
differentiation, Bock 1981); all derivatives of a step share one factorisation (`jet.inverse`).

Loads are linear between their own samples, or that times a sine, and may jump where they begin or
end. Neither samples nor jumps need to lie on time nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import ceil, log2
from typing import ClassVar

import numpy as np

from alphacut.base.errors import require
from alphacut.frame.calculus.polynomials import Array, Jet, concatenate, inverse
from alphacut.frame.records.history import History
from alphacut.frame.structures.linear import Matrices

# Distance of a load's sample from a time node, as a fraction of the step, that is rounding. A
# larger one would move samples; a smaller one would make segments so short that they are rounding
# alone.
SAME = 1e-12


@dataclass(frozen=True, eq=False)
class StepMap:
    """The map x[k+1] = T x[k] + G load[k] of the states x = [q; v] of S structures.

    Args:
        transfer: T, shape (S, 2n, 2n).
        load: G, shape (S, 2n, numbers that describe the loads in a step).
        loads: These numbers for each step, which G multiplies, shape (steps, numbers).
    """

    transfer: Jet
    load: Jet
    loads: Array


@dataclass(frozen=True)
class Midpoint:
    """Midpoint discrete Lagrangian with midpoint Lagrange–d'Alembert forcing.

    On a linear structure this is Newmark's method with β = 1/4 and γ = 1/2: without the velocity,
    (M/h + D/2 + h K/4) q[k+1] = (2 M/h − h K/2) q[k] − (M/h − D/2 + h K/4) q[k−1].
    """

    name: ClassVar[str] = "midpoint"

    def step_map(
        self, matrices: Matrices, pushes: Jet, loads: Sequence[History], step: float, count: int
    ) -> StepMap:
        """Return the map of one step of the midpoint scheme for the states [q; v] of structures.

        The velocities are M⁻¹ times the momenta of the discrete Lagrangian.

        Args:
            matrices: Matrices of S structures with n unknowns.
            pushes: Accelerations of the unknowns by a unit of each of the L loads, shape (S, n, L).
            loads: Histories of the loads, in the order of these columns.
            step: Length h of a step, in s.
            count: Number of steps from t = 0 on.

        Returns:
            The map x[k+1] = T x[k] + G load[k]: T, shape (S, 2n, 2n); G, shape (S, 2n, 2 L); and
            load, shape (count, 2 L). In each step a line stands for each load; load[k] has the
            values of all lines at the beginning of the step, then those at its end.

        Raises:
            numpy.linalg.LinAlgError: M/h + D/2 + h K/4 is singular.
        """
        m = matrices
        h = step
        inertia = m.mass * (1 / h) + m.damping * 0.5
        spring = m.stiffness * (h / 4)
        implicit_inverse = inverse(inertia + spring)
        # q[k+1] = q_by_q q[k] + q_by_v v[k] + q_by_load load[k]
        # v[k+1] = 2 (q[k+1] − q[k])/h − v[k]
        q_by_q = implicit_inverse @ (inertia - spring)
        q_by_v = implicit_inverse @ m.mass
        # the load of a step is the mean of its values at both ends, with a weight of h/2
        q_by_load = q_by_v @ (concatenate([pushes, pushes], -1) * (h / 4))
        # both rows of x[k+1] = T x[k] + G load[k]; the velocity follows from the mean of both
        # velocities, which is (q[k+1] − q[k])/h
        eye = np.eye(m.mass.value.shape[-1])
        upper = concatenate([q_by_q, q_by_v], -1)
        lower = concatenate([(q_by_q - eye) * (2 / h), q_by_v * (2 / h) - eye], -1)
        load = concatenate([q_by_load, q_by_load * (2 / h)], -2)
        return StepMap(concatenate([upper, lower], -2), load, linear_loads(loads, h, count))


@dataclass(frozen=True)
class Exact:
    """Exact solution of a step: the propagator exp(A h) and Duhamel's integral."""

    name: ClassVar[str] = "exact"

    def step_map(
        self, matrices: Matrices, pushes: Jet, loads: Sequence[History], step: float, count: int
    ) -> StepMap:
        """Return the exact map x[k+1] = T x[k] + G load[k] of the states [q; v] over one step.

        With the state matrix A and b = [0; push], a load f adds to the state in a substep of length
        h

            ∫ exp(A τ) b f(h − τ) dτ = Σ_k (A h)^k b / k! · ∫ (τ/h)^k f(h − τ) dτ.

        Args:
            matrices: Matrices of S structures with n unknowns.
            pushes: Accelerations of the unknowns by a unit of each of the L loads, shape (S, n, L).
            loads: Histories of the loads, in the order of these columns.
            step: Length of a step, in s.
            count: Number of steps from t = 0 on.

        Returns:
            T, shape (S, 2n, 2n); G, shape (S, 2n, L · substeps · 26), the vectors (A h)^k b / k! of
            each load and substep, the last substep first, carried on to the end of the step; and
            load[k], shape (count, L · substeps · 26), the integrals that they multiply.

        Raises:
            RefusedError: A step would take more than 4096 substeps.
            numpy.linalg.LinAlgError: A mass matrix is singular.
        """
        # In a substep |λ| h ≤ 2 for all eigenvalues, up to which 26 terms of the exponential are
        # enough: the next one is 2^26/26! = 2e-19.
        largest_phase = 2.0
        terms = 26
        most_substeps = 4096
        A = state_matrix(matrices)
        substeps = 1
        if loads:
            fastest = float(np.abs(np.linalg.eigvals(A.value)).max())
            fastest = max(fastest, max(load.frequency for load in loads), 1e-300)
            # a power of 2, so that doubling the time ends at a whole step
            doublings = ceil(log2(max(1.0, fastest * step / largest_phase)) - 1e-9)
            substeps = 1 << max(0, doublings)
            longest = f"up to {largest_phase * most_substeps / fastest:.2g} s"
            allowed = f"{longest} with motions as fast as {fastest:.3g} rad/s under a load"
            cure = "such fast motions are mostly stiffness or mass in a wrong unit"
            require(substeps <= most_substeps, "step", f"{step:g} s", allowed, cure)
        h = step / substeps

        # (A h)^k b / k!, each from the one before
        term = concatenate([pushes * 0.0, pushes], -2)
        series = [term]
        for k in range(1, terms):
            term = A @ term * (h / k)
            series.append(term)
        columns = []  # of each load, by powers of τ/h
        for i in range(len(loads)):
            columns.append(concatenate([x[..., i : i + 1] for x in series], -1))
        transfer = exponential(A * h)
        for _ in range(substeps.bit_length() - 1):
            # the columns of earlier substeps are carried on by exp(A t), t the time so far
            columns = [concatenate([x, transfer @ x], -1) for x in columns]
            transfer = transfer @ transfer

        moments_by_step = [np.empty((count, 0))]
        for load in loads:
            moments = load_moments(load, h, count * substeps, terms)
            # the last substep comes first, as in the columns
            last_first = moments.reshape(count, substeps, terms)[:, ::-1]
            moments_by_step.append(last_first.reshape(count, -1))
        gain = term
        if loads:
            gain = concatenate(columns, -1)
        return StepMap(transfer, gain, np.concatenate(moments_by_step, -1))


Integrator = Midpoint | Exact
INTEGRATORS: dict[str, Integrator] = {m.name: m for m in (Midpoint(), Exact())}
"""The integrators by the words that a case file has for them."""


def state_matrix(m: Matrices) -> Jet:
    """Return the state matrices A of the free motion [q; v]˙ = A [q; v].

    Args:
        m: Mass M, damping D and stiffness K of n unknowns at S parameter sets, with their
            derivatives by the parameters.

    Returns:
        The matrices with their derivatives (a jet), shape (S, 2n, 2n), with the blocks [[0, I],
        [-M⁻¹ K, -M⁻¹ D]].

    Raises:
        numpy.linalg.LinAlgError: A mass matrix is singular.
    """
    inverse_mass = m.inverse_mass
    lower = concatenate([-(inverse_mass @ m.stiffness), -(inverse_mass @ m.damping)], -1)
    n = m.mass.value.shape[-1]
    velocity_rows = np.hstack([np.zeros((n, n)), np.eye(n)])
    upper = lower.like(np.broadcast_to(velocity_rows, lower.value.shape))
    return concatenate([upper, lower], -2)


def exponential(z: Jet) -> Jet:
    """Return the exponentials of matrices, with derivatives, by scaling and squaring.

    Args:
        z: Matrices with their derivatives by d parameters (a jet), shape (…, N, N), of finite
            values.

    Returns:
        Jet of the same shape, accurate to rounding in the values; squaring amplifies rounding where
        a matrix has a large norm.
    """
    # exp(z) = exp(z/2^s)^(2^s), with s such that the 1-norm of z/2^s is at most .25
    norm = float(np.abs(z.value).sum(-2).max(initial=0.0))
    # One number of squarings serves all matrices, since they are squared together.
    squarings = 0
    if norm > 0:
        squarings = max(0, ceil(log2(norm / 0.25)))
    z = z * 0.5**squarings
    eye = np.eye(z.value.shape[-1])
    # Horner's rule for Σ_k z^k/k! up to degree 12; the remainder is below .25^13/13! < 1e-17
    degree = 12
    series = z * (1 / degree) + eye
    for k in range(degree - 1, 0, -1):
        series = z @ series * (1 / k) + eye
    for _ in range(squarings):
        series = series @ series
    return series


@lru_cache(maxsize=8)
def load_moments(history: History, step: float, count: int, order: int) -> Array:
    """Return the moments ∫ s^k f(t) dt of a load f over each step, for k = 0 … order - 1.

    In each step s falls from 1 at its beginning to 0 at its end. The integrals are exact to
    rounding, also where samples and jumps of the load lie inside a step; with a sine in the load
    this holds if it turns by at most 2 rad in a step. Results are cached; callers must not change
    them.

    Args:
        history: The load f, zero before it starts, and behind its end unless its last sample is
            held.
        step: Length of a step, in s.
        count: Number of steps from t = 0 on.
        order: Number of moments of each step.

    Returns:
        Array of shape (count, order), in the unit of the load times s.
    """
    # Segments in which the load is smooth, between neighbouring nodes and samples. Each has the
    # number of its step (`home`), and its start and end from the beginning of that step.
    samples = history.start + np.arange(len(history.samples)) * history.step
    nearest = np.round(samples / step)
    is_inner = (np.abs(samples - nearest * step) > SAME * step) & (samples < count * step)
    home = np.concatenate([np.arange(count), np.floor(samples[is_inner] / step).astype(int)])
    start = np.concatenate([np.zeros(count), samples[is_inner] - home[count:] * step])
    in_time = np.lexsort((start, home))
    home = home[in_time]
    start = start[in_time]
    end = np.append(start[1:], 0.0)
    is_last_of_step = np.append(np.diff(home) > 0, True)
    end[is_last_of_step] = step

    # Gauss quadrature in each segment: exact for s^k times a line; for a sine that turns by at
    # most 2 rad, 16 more points are exact to rounding
    point_count = order // 2 + 1
    if history.frequency:
        point_count += 16
    points, weights = np.polynomial.legendre.leggauss(point_count)
    length = (end - start)[:, None]
    since_step = start[:, None] + length * (points + 1) / 2
    time = home[:, None] * step + since_step
    weighted = history.envelope(time) * history.wave(time) * (length / 2 * weights)
    until_end = 1 - since_step / step
    first_segment_of_step = np.searchsorted(home, np.arange(count))
    moments: Array = np.empty((count, order))
    for k in range(order):
        moments[:, k] = np.add.reduceat(weighted.sum(1), first_segment_of_step)
        weighted *= until_end
    return moments


def linear_loads(loads: Sequence[History], step: float, count: int) -> Array:
    """Return, for each load in each step, the line with the same integral and first moment.

    For a load that is linear in a step, this line is the load itself.

    Args:
        loads: The L loads; there may be none.
        step: Length of a step, in s.
        count: Number of steps from t = 0 on.

    Returns:
        Values of the lines in the units of the loads, shape (count, 2 L): of each load at the
        beginning of the step, then of each load at its end.
    """
    moments = np.array([load_moments(load, step, count, 2) for load in loads])
    by_load = moments.reshape(len(loads), count, 2) / step  # also without loads
    mean = by_load[..., 0]
    first_moment = by_load[..., 1]
    # of a line from a to b: mean (a + b)/2 and first moment a/3 + b/6, so that a − b = 6 tilt
    tilt = 2 * first_moment - mean
    return np.concatenate([mean + 3 * tilt, mean - 3 * tilt]).T
