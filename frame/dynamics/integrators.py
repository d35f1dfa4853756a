"""One-step methods for linear structures, with the facts they claim.

Every method is a frozen dataclass with two claims that tests measure: `order`, and
`stability_limit`, the largest ω h without growth of an undamped oscillation. All derivatives of a
step with respect to parameters share one factorisation (`jet.inverse`): it is the scheme that is
differentiated, not the differential equation (internal differentiation: Bock 1981).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, inf, log2
from typing import ClassVar

import numpy as np

from alphacut.frame.calculus.jet import Jet, concatenate, inverse
from alphacut.frame.structures.linear import Matrices
from alphacut.frame.structures.modes import state_matrix


@dataclass(frozen=True, eq=False)
class StepMap:
    """x[k+1] = T x[k] + G load[k] with x = [q; v].

    Args:
        transfer: T, shape (S, 2n, 2n).
        load: G, shape (S, 2n, L); of one-step methods L is twice the number of loads, for their
            values at the beginning of a step and then at its end, linear between.
    """

    transfer: Jet
    load: Jet


@dataclass(frozen=True)
class Midpoint:
    """Midpoint discrete Lagrangian with midpoint Lagrange–d'Alembert forcing.

    Eliminating the velocity gives (M/h + D/2 + hK/4) q[k+1] = (2M/h − hK/2) q[k] − (M/h − D/2 +
    hK/4) q[k−1]. On a linear structure this is Newmark's method with β = 1/4 and γ = 1/2.

    Example:
        >>> from alphacut.frame import LinearFlow, StoreyFrame
        >>> frame = StoreyFrame(masses=[1e3], stiffness=[4e4], q0=[0.1])
        >>> flow = LinearFlow(frame, ("m1",), duration=1.0, step=0.1, integrator=Midpoint())
        >>> flow.values([[1e3]])[0, -1].round(4).tolist()
        [0.0988]
    """

    name: ClassVar[str] = "midpoint"
    order: ClassVar[float] = 2
    stability_limit: ClassVar[float] = inf

    def step_map(self, matrices: Matrices, step: float, pushes: Jet) -> StepMap:
        """Return the map of one step, whose velocities are M⁻¹ times the discrete momenta.

        `pushes` are accelerations by a unit of each load, shape (S, n, L).
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
        return StepMap(transfer=concatenate([upper, lower], -2), load=load)


@dataclass(frozen=True)
class RungeKutta4:
    """The classical explicit method of order 4.

    Example:
        >>> from alphacut.frame import LinearFlow, StoreyFrame
        >>> frame = StoreyFrame(masses=[1e3], stiffness=[4e4], q0=[0.1])
        >>> flow = LinearFlow(frame, ("m1",), duration=1.0, step=0.1, integrator=RungeKutta4())
        >>> flow.values([[1e3]])[0, -1].round(4).tolist()
        [0.0995]
    """

    name: ClassVar[str] = "rk4"
    order: ClassVar[float] = 4
    stability_limit: ClassVar[float] = 2 * 2**0.5

    def step_map(self, matrices: Matrices, step: float, pushes: Jet) -> StepMap:
        """Return the map of one step, by the series of exp(A h) up to h⁴."""
        z = loaded_flow(matrices, step, pushes) * step
        z2 = z @ z
        return split(
            np.eye(z.value.shape[-1]) + z + z2 * 0.5 + z2 @ z * (1 / 6) + z2 @ z2 * (1 / 24),
            pushes.value.shape[-1],
        )


@dataclass(frozen=True)
class Exact:
    """Exact propagator exp(A h) by scaling and squaring, for a load linear in each step.

    Example:
        >>> from alphacut.frame import LinearFlow, StoreyFrame
        >>> frame = StoreyFrame(masses=[1e3], stiffness=[4e4], q0=[0.1])
        >>> flow = LinearFlow(frame, ("m1",), duration=1.0, step=0.1, integrator=Exact())
        >>> flow.values([[1e3]])[0, -1].round(4).tolist()
        [0.0999]
    """

    name: ClassVar[str] = "exact"
    order: ClassVar[float] = inf
    stability_limit: ClassVar[float] = inf

    def step_map(self, matrices: Matrices, step: float, pushes: Jet) -> StepMap:
        """Return the exact map of one step for loads that are linear in it."""
        flow = exponential(loaded_flow(matrices, step, pushes) * step)
        return split(flow, pushes.value.shape[-1])


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


def loaded_flow(m: Matrices, step: float, pushes: Jet) -> Jet:
    """Return the state matrix of [q; v; load; rise], shape (S, 2n + 2L, 2n + 2L).

    Its exponential over a step is the map of a step in which each of L loads is linear, with its
    rise. `pushes` are accelerations by a unit of each load, shape (S, n, L).
    """
    flow = state_matrix(m)
    n, count = pushes.value.shape[-2:]
    size = 2 * (n + count)
    extended = flow.like(np.zeros((len(flow.value), size, size)))
    for target, state_part, load_part in zip(  # values, first and second derivatives
        (extended.value, extended.first, extended.second),
        (flow.value, flow.first, flow.second),
        (pushes.value, pushes.first, pushes.second),
        strict=True,
    ):
        target[..., : 2 * n, : 2 * n] = state_part
        target[..., n : 2 * n, 2 * n : 2 * n + count] = load_part
    # the rate of each load is its rise over the step
    extended.value[:, 2 * n : 2 * n + count, 2 * n + count :] = np.eye(count) / step
    return extended


def split(extended: Jet, count: int) -> StepMap:
    """Return the step map of a propagator of states, `count` loads and their rises in a step."""
    # a load f at the beginning and f + rise at the end
    n = extended.value.shape[-1] - 2 * count
    old, rise = extended[..., :n, n : n + count], extended[..., :n, n + count :]
    return StepMap(extended[..., :n, :n], concatenate([old - rise, rise], -1))


Integrator = Midpoint | RungeKutta4 | Exact
INTEGRATORS: dict[str, Integrator] = {m.name: m for m in (Midpoint(), RungeKutta4(), Exact())}
