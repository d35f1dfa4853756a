"""One-step methods for linear structures.

All derivatives of a step with respect to parameters share one factorisation (`jet.inverse`): it is
the scheme that is differentiated, not the differential equation (internal differentiation: Bock
1981).

Loads come at their own times: linear between their samples, or that times a sine, with jumps where
they begin or end. Neither samples nor jumps need lie on nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import ceil, log2
from typing import ClassVar

import numpy as np

from alphacut.base.errors import require
from alphacut.frame.calculus.jet import Array, Jet, concatenate, inverse
from alphacut.frame.records.history import History
from alphacut.frame.structures.linear import Matrices

SAME = 1e-12
"""Distance of a sample from a node, as a fraction of the step, that is rounding."""
TERMS = 26
"""Terms of exp(A τ) where |λ| τ ≤ `MAX_PHASE`: the next is 2^26 / 26! = 2e-19."""
MAX_PHASE = 2.0
"""Largest |λ| times a substep of the exact step."""
MAX_SUBSTEPS = 4096
SINE_POINTS = 16
"""Points of Gauss quadrature for a sine that turns by `MAX_PHASE` at most, beside the others."""


@dataclass(frozen=True, eq=False)
class StepMap:
    """x[k+1] = T x[k] + G load[k] with x = [q; v]."""

    transfer: Jet  # T, (S, 2n, 2n)
    load: Jet  # G, (S, 2n, L)
    loads: Array  # what G acts on in each step, (steps, L)


@dataclass(frozen=True)
class Midpoint:
    """Midpoint discrete Lagrangian with midpoint Lagrange–d'Alembert forcing.

    Eliminating the velocity gives (M/h + D/2 + hK/4) q[k+1] = (2M/h − hK/2) q[k] − (M/h − D/2 +
    hK/4) q[k−1]. On a linear structure this is Newmark's method with β = 1/4 and γ = 1/2.
    """

    name: ClassVar[str] = "midpoint"

    def step_map(
        self, matrices: Matrices, pushes: Jet, loads: Sequence[History], step: float, count: int
    ) -> StepMap:
        """Return the map of each of `count` steps, whose velocities are M⁻¹ times the momenta.

        `pushes` are accelerations by a unit of each of the L loads, shape (S, n, L).
        """
        m, h = matrices, step
        inertia, spring = m.mass * (1 / h) + m.damping * 0.5, m.stiffness * (h / 4)
        implicit_inverse = inverse(inertia + spring)
        # q[k+1] = q_by_q q[k] + q_by_v v[k] + q_by_load load[k]
        # v[k+1] = 2 (q[k+1] − q[k])/h − v[k]
        q_by_q = implicit_inverse @ (inertia - spring)
        q_by_v = implicit_inverse @ m.mass
        q_by_load = q_by_v @ (concatenate([pushes, pushes], -1) * (h / 4))  # the mean load, h/2
        eye = np.eye(m.mass.value.shape[-1])
        upper = concatenate([q_by_q, q_by_v], -1)
        lower = concatenate([(q_by_q - eye) * (2 / h), q_by_v * (2 / h) - eye], -1)
        load = concatenate([q_by_load, q_by_load * (2 / h)], -2)
        return StepMap(concatenate([upper, lower], -2), load, linear_loads(loads, h, count))


@dataclass(frozen=True)
class Exact:
    """Exact propagator exp(A h) and Duhamel integral; arguments and result as of `Midpoint`."""

    name: ClassVar[str] = "exact"

    def step_map(
        self, matrices: Matrices, pushes: Jet, loads: Sequence[History], step: float, count: int
    ) -> StepMap:
        """Return the exact map of each of `count` steps.

        Over a substep of length h, ∫ exp(A τ) b f(h − τ) dτ = Σ_k (A h)^k b / k! ∫ (τ/h)^k f dτ:
        G holds (A h)^k b / k! of each load, b = [0; push], carried on to the step's end, and
        `loads` the moments.

        Raises:
            RefusedError: A step would take more than `MAX_SUBSTEPS` substeps.
        """
        A, substeps = state_matrix(matrices), 1
        if loads:
            fastest = float(np.abs(np.linalg.eigvals(A.value)).max())
            fastest = max(fastest, *(load.frequency for load in loads), 1e-300)
            substeps = 1 << max(0, ceil(log2(max(1.0, fastest * step / MAX_PHASE)) - 1e-9))
            longest = f"up to {MAX_PHASE * MAX_SUBSTEPS / fastest:.2g} s"
            allowed = f"{longest} with motions as fast as {fastest:.3g} rad/s under a load"
            require(substeps <= MAX_SUBSTEPS, "step", value=f"{step:g} s", allowed=allowed)
        h = step / substeps
        term = concatenate([pushes * 0.0, pushes], -2)
        series = [term]
        for k in range(1, TERMS):
            term = A @ term * (h / k)
            series.append(term)
        columns = [concatenate([x[..., i : i + 1] for x in series], -1) for i in range(len(loads))]
        transfer = exponential(A * h)
        for _ in range(substeps.bit_length() - 1):  # doubles the time until it is a step
            columns = [concatenate([x, transfer @ x], -1) for x in columns]
            transfer = transfer @ transfer
        moments = [load_moments(load, h, count * substeps, TERMS) for load in loads]
        # the last substep comes first, as in the columns
        by_step = [x.reshape(count, substeps, TERMS)[:, ::-1].reshape(count, -1) for x in moments]
        gain = concatenate(columns, -1) if loads else term
        return StepMap(transfer, gain, np.concatenate([np.empty((count, 0)), *by_step], -1))


Integrator = Midpoint | Exact
INTEGRATORS: dict[str, Integrator] = {m.name: m for m in (Midpoint(), Exact())}


def state_matrix(m: Matrices) -> Jet:
    """Return the state matrix A of [q; v]˙ = A [q; v], shape (S, 2n, 2n) (eq. 17, eq. 23)."""
    inverse_mass = m.inverse_mass
    lower = concatenate([-(inverse_mass @ m.stiffness), -(inverse_mass @ m.damping)], -1)
    n = m.mass.value.shape[-1]
    upper = lower.like(np.broadcast_to(np.hstack([np.zeros((n, n)), np.eye(n)]), lower.value.shape))
    return concatenate([upper, lower], -2)


def exponential(z: Jet) -> Jet:
    """Return the matrix exponential with derivatives, shape (…, N, N), by scaling and squaring."""
    norm = float(np.abs(z.value).sum(-2).max(initial=0.0))
    squarings = max(0, ceil(log2(norm / 0.25))) if norm > 0 else 0
    z = z * 0.5**squarings
    eye = np.eye(z.value.shape[-1])
    degree = 12  # remainder 0.25^13/13! < 1e-17
    series = z * (1 / degree) + eye
    for k in range(degree - 1, 0, -1):
        series = z @ series * (1 / k) + eye
    for _ in range(squarings):
        series = series @ series
    return series


@lru_cache(maxsize=8)
def load_moments(history: History, step: float, count: int, order: int) -> Array:
    """Return ∫ s^k f dt of a load f over each of `count` steps, k < `order`, shape (count, order).

    s falls from 1 at a step's beginning to 0 at its end.
    """
    # segments between neighbouring nodes and samples: their steps, rising, and times in these
    samples = history.start + np.arange(len(history.samples)) * history.step
    nearest = np.round(samples / step)
    inner = (np.abs(samples - nearest * step) > SAME * step) & (samples < count * step)
    home = np.concatenate([np.arange(count), np.floor(samples[inner] / step).astype(int)])
    start = np.concatenate([np.zeros(count), samples[inner] - home[count:] * step])
    in_time = np.lexsort((start, home))
    home, start = home[in_time], start[in_time]
    end = np.append(start[1:], 0.0)
    end[np.append(np.diff(home) > 0, True)] = step
    # Gauss quadrature in each, exact, with a sine to round-off
    points, weights = np.polynomial.legendre.leggauss(
        order // 2 + 1 + (SINE_POINTS if history.frequency else 0)
    )
    length = (end - start)[:, None]
    since = start[:, None] + length * (points + 1) / 2
    time = home[:, None] * step + since
    load = history.envelope(time) * history.wave(time) * (length / 2 * weights)
    first_segment = np.searchsorted(home, np.arange(count))  # of each step
    moments: Array = np.empty((count, order))
    for k in range(order):
        moments[:, k] = np.add.reduceat(load.sum(1), first_segment)
        load = load * (1 - since / step)
    return moments


def linear_loads(loads: Sequence[History], step: float, count: int) -> Array:
    """Return the best lines through L loads in each step by end values, shape (count, 2 L).

    A line has the load's impulse and first moment in the step, and is the load where that is
    linear. Values at the beginnings of steps come first, load by load, then those at their ends.
    """
    moments = np.array([load_moments(x, step, count, 2) for x in loads])
    mean, moment = np.moveaxis(moments.reshape(len(loads), count, 2) / step, -1, 0)
    tilt = 2 * moment - mean
    return np.concatenate([mean + 3 * tilt, mean - 3 * tilt]).T
