"""Guaranteed bounds of the error of a modal model in comparison with the true response.

Polynomials φ_k, ψ_k, λ_k make q(t) = 2 Re Σ φ_k exp(λ_k t) a response that nearly obeys the
equations of motion, with the velocity 2 Re Σ ψ_k exp(λ_k t). What it misses there, the defects
λ_k φ_k − ψ_k and λ_k M ψ_k + D ψ_k + K φ_k, are Taylor models of which hardly more than the
remainder is left. Damping only takes energy, so the deviation from the true response, in the energy
norm √(qᵀ K q + vᵀ M v), grows no faster than these defects push it: no eigenvalue problem is solved
anew, and nothing rests on a distance between eigenvalues.

Damping by one ratio ζ, 2 ζ (M # K), is no polynomial, but a Taylor model (`geometric_mean`), whose
remainder is contained in the defect.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.damped import DampedModes, DampedStructure, norm_of
from alphacut.frame.modes.modal_model import ModalModel
from alphacut.frame.response.duhamel import absolute_moments
from alphacut.frame.response.load_tables import Direct, LoadTables


def proved_error(model: ModalModel) -> Array:
    """Bound |modal model − true response| over the box of the inputs, in the units of the outputs.

    The model is q(t) = 2 Re Σ_k φ_k w_k(t) over n modes and S sources, with φ_k and λ_k polynomials
    of the inputs, w_k = exp(λ_k t) or its integral over a load, and the velocity 2 Re Σ_k ψ_k w_k.
    The true response obeys M q̈ + D q̇ + K q = f. Theorem: with the norm ‖η‖² = qᵀ K q + vᵀ M v of
    a deviation η = (q, v), and the defects of mode k in q̇ = v, d_k = λ_k φ_k − ψ_k, and in the
    balance of forces, p_k = λ_k M ψ_k + D ψ_k + K φ_k,

        ‖η(t)‖ ≤ ‖η(0)‖ + 2 Σ_k ∫₀ᵗ |w_k(s)| ds √(d_k* K d_k + p_k* M⁻¹ p_k),

    since damping only takes energy; for a load a, ‖η(0)‖ is the norm after a unit impulse times ∫
    |a|. An output takes at most its norm of this deviation, `EnergyNorms.outputs`; the errors of
    its coefficients add to it. The w_k of the model are exact: what their tables miss is in
    `bounds.remainders`.

    Args:
        model: Modal model of a structure that is known to lose energy everywhere in the box.

    Returns:
        Bounds at T time nodes for m outputs, shape (T, m).

    Raises:
        UnprovedError: The box is so wide that M or K may lose its definiteness.
    """
    structure = model.structure
    # The polynomials whose error is bounded are those that bounds are made of.
    modes = replace(model.modes, eigenvalue=model.eigenvalue)
    norms = EnergyNorms(structure)
    energy_rates = _energy_rates(structure, modes, norms)
    start_errors = _start_errors(structure, modes, norms)
    coefficients = modes.outputs(structure)
    deviation = np.zeros(len(model.flow.time))
    output_error = np.zeros((len(model.flow.time), len(model.flow.outputs)))
    growth = largest_growth(model.eigenvalue, np.ones(len(model.boxes.names)))
    for s, part in enumerate(response_parts(model, growth)):
        if isinstance(part.load, Direct):
            assert structure.feeds is not None
            feedthrough = structure.feeds[:, s - len(start_errors)]
            error = (feedthrough - part.coefficient.real[0] * 2.0).magnitude()
            output_error += part.waves[0][:, :1] * error
            continue
        deviation += part.impulse * start_errors[s] + 2 * part.elapsed @ energy_rates[s]
        coefficient_error = (coefficients[s] - part.coefficient).magnitude()
        output_error += 2 * part.waves[0] @ coefficient_error
    return deviation[:, np.newaxis] * norms.outputs + output_error


def error_between_nodes(model: ModalModel, error: Array) -> Array:
    """Return by how much a model's error within a step may exceed the smaller one at its ends.

    Args:
        model: The model, which tells the growth rates of its modes and the step.
        error: Bound of its error at the nodes, 0 or more, shape (times, outputs).

    Returns:
        Bound of the error in the step before each node minus the smaller one of the bounds at both
        its ends, same shape; 0 for the first node.
    """
    # The bound of the error is a sum of functions of time that either rise or are in proportion to
    # bounds of a mode's response, which decay no faster than exp(g t) with the upper bound g of its
    # growth rate. With the most negative g of all modes, the bound within a
    # step of the length h is at most exp(-g h) times its value at the end.
    rate = largest_growth(model.eigenvalue, np.ones(model.eigenvalue.inputs))
    swell = float(np.exp(np.maximum(-rate, 0.0).max() * model.flow.step))
    within = swell * np.maximum(error[1:], error[:-1])
    added = np.zeros_like(error)
    added[1:] = within - np.minimum(error[1:], error[:-1])
    return added


def error_fractions(model: ModalModel) -> Array:
    """Return an estimate of the fraction of each input in the error of a modal model.

    The error comes from the terms that the polynomials leave out. Its fractions are taken to be
    those of the inputs in the terms of the highest degree, where an input counts by its exponent.

    Args:
        model: The model, with polynomials in the inputs as eigenvalues and coefficients.

    Returns:
        Fractions, shape (inputs,), which add up to 1, or are 0 if there are no such terms.
    """
    exponents = model.eigenvalue.exponents  # (terms, inputs)
    weight = np.zeros(len(exponents))
    for polynomials in (model.eigenvalue, model.coefficient):
        magnitudes = np.abs(polynomials.coefficients).reshape(len(exponents), -1)
        largest = np.maximum(magnitudes.max(axis=0), 1e-300)
        # Polynomials of different units are compared by their coefficients over the largest one.
        weight += (magnitudes / largest).max(axis=1)
    is_highest = exponents.sum(axis=1) == model.degree
    by_input = weight[is_highest] @ exponents[is_highest]
    return np.asarray(by_input / max(float(by_input.sum()), 1e-300))


class EnergyNorms:
    """Bounds of energy norms over the box, by M and K at its midpoint, 1 and diag(ω²).

    Over the box (1 − μ) 1 ≤ M ≤ (1 + μ) 1 and (1 − κ) ω² ≤ K ≤ (1 + κ) ω², with the spectral norms
    μ and κ of bounds of |M − 1| and |K − ω²| / (ω ωᵀ).

    Raises:
        UnprovedError: M or K is not shown to stay positive definite.
    """

    def __init__(self, structure: DampedStructure) -> None:
        self.omega = structure.omega
        mass_change = (structure.mass - np.eye(len(self.omega))).magnitude()
        stiffness_change = (structure.stiffness - np.diag(self.omega**2)).magnitude()
        stiffness_change = stiffness_change / (self.omega[:, np.newaxis] * self.omega)
        self.mu = float(np.linalg.norm(mass_change, 2))
        self.kappa = float(np.linalg.norm(stiffness_change, 2))
        # The distance of 1e-9 from 1 is far above the rounding of both norms.
        if not max(self.mu, self.kappa) < 1 - 1e-9:
            raise UnprovedError(
                "the box is so wide that mass and stiffness are not shown to stay positive definite"
            )
        of_displacement, of_velocity = np.split(structure.output_rows.magnitude(), 2, axis=1)
        # error of outputs over a deviation √(qᵀ K q + vᵀ M v) of the response, (m,)
        self.outputs = np.hypot(self.of_spring_force(of_displacement), self.of_force(of_velocity))

    def of_displacement(self, x: Array) -> Array:
        """Bound √(x* K x) for vectors whose entries have magnitudes up to x (…, N), shape (…,)."""
        return np.asarray(np.sqrt(1 + self.kappa) * norm_of(x * self.omega))

    def of_spring_force(self, f: Array) -> Array:
        """Bound √(f* K⁻¹ f) for vectors whose entries have magnitudes up to f (…, N)."""
        return np.asarray(norm_of(f / self.omega) / np.sqrt(1 - self.kappa))

    def of_force(self, f: Array) -> Array:
        """Bound √(f* M⁻¹ f) for vectors whose entries have magnitudes up to f (…, N)."""
        return np.asarray(norm_of(f) / np.sqrt(1 - self.mu))


def _energy_rates(structure: DampedStructure, modes: DampedModes, norms: EnergyNorms) -> Array:
    """Bound the energy norm of each source's and mode's defects for |exp(λ t)| = 1, shape (S, n).

    The defects are d = λ φ − ψ in q̇ = v and p = λ M ψ + D ψ + K φ in the balance of forces, and
    their norm is √(d* K d + p* M⁻¹ p).

    Args:
        structure: M, D and K as Taylor models of N unknowns over the box.
        modes: Polynomials of n modes for each of S sources: eigenvalues λ (n,), displacements φ
            (`shape`) and velocities ψ (`velocity`), shape (S, n, N) each.
        norms: Bounds of these energy norms over the box.
    """
    eigenvalue = modes.eigenvalue[:, None]
    kinematic = eigenvalue * modes.shape - modes.velocity
    momentum = modes.velocity @ structure.mass
    dynamic = (
        eigenvalue * momentum
        + modes.velocity @ structure.damping
        + modes.shape @ structure.stiffness
    )
    return np.hypot(
        norms.of_displacement(kinematic.magnitude()), norms.of_force(dynamic.magnitude())
    )


def _start_errors(structure: DampedStructure, modes: DampedModes, norms: EnergyNorms) -> Array:
    """Bound the energy norm of what the modes miss of the initial state of each source, shape (S,).

    A source starts the response with K q(0) = static force and M v(0) = impulse. The modes give
    q(0) = 2 Re Σ_k φ_k and v(0) = 2 Re Σ_k ψ_k; the norm is √(qᵀ K q + vᵀ M v) of the difference.

    Args:
        structure: M and K as Taylor models over the box, and the static forces and impulses, shape
            (unknowns, S) each.
        modes: Polynomials of n modes: displacements φ (`shape`) and velocities ψ (`velocity`),
            shape (S, n, unknowns) each.
        norms: Bounds of the energy norm over the box.
    """
    twice = np.full((1, modes.shape.shape[1]), 2.0)  # the sum over modes and their conjugates
    displacement = (twice @ modes.shape.real)[:, 0]
    velocity = (twice @ modes.velocity.real)[:, 0]
    spring_force = displacement @ structure.stiffness - structure.static_forces.T
    momentum = velocity @ structure.mass - structure.impulses.T
    return np.hypot(
        norms.of_spring_force(spring_force.magnitude()), norms.of_force(momentum.magnitude())
    )


def largest_growth(eigenvalue: TaylorModel, reach: Array) -> Array:
    """Return upper bounds of Re λ_k over the box |u_i| ≤ reach_i, shape (n,), in 1/s."""
    return eigenvalue.real.on_subbox(-reach, reach).bounds()[1]


@dataclass(frozen=True, eq=False)
class ResponsePart:
    """The free response of a modal model, or what one load adds, with bounds over time."""

    coefficient: TaylorModel  # coefficients C_k, polynomials, (n, m)
    waves: Array  # bounds of the derivatives of w by λ, orders 0 to 3, (4, T, n)
    elapsed: Array  # bounds of ∫ |w| from 0 to t, (T, n)
    # bound of ∫ |a| of the load up to t, (T,), in m/s; 1 for the free response
    impulse: Array
    load: LoadTables | None = None  # the load; None for the free response


def response_parts(model: ModalModel, growth: Array) -> list[ResponsePart]:
    """Return the parts of a modal model's response, each with bounds over time.

    A part is 2 Re Σ_k C_k w_k(t) over n modes: the free response with w = exp(λ t) first, then that
    to each load a with w = ∫ exp(λ τ) a(t − τ) dτ, in the order of `model.loads`.

    Args:
        model: The modal model with T time nodes and m outputs.
        growth: Upper bounds of Re λ_k over the box, shape (n,), in 1/s; may be positive.

    Returns:
        For each part: `coefficient` C, polynomials of shape (n, m); `waves`, bounds of |∂^r w/∂λ^r|
        for r = 0 to 3, shape (4, T, n); `elapsed`, bounds of ∫ |w| from 0 to t, shape (T, n);
        and `impulse`, bounds of ∫ |a| up to t, shape (T,), 1 for the free response.
    """
    time = model.flow.time[:, np.newaxis]
    divisor = np.where(growth == 0, 1.0, growth)
    powers = time ** np.arange(4)[:, np.newaxis, np.newaxis]
    free = ResponsePart(
        coefficient=model.coefficient,
        waves=powers * np.exp(growth * time),
        elapsed=np.where(growth == 0, time, np.expm1(growth * time) / divisor),
        impulse=np.ones(len(time)),
    )
    return [free] + [_forced_part(model, growth, load) for load in model.loads]


def _forced_part(model: ModalModel, growth: Array, load: LoadTables) -> ResponsePart:
    """Return the response to one load a(t) as a part of a modal model, with bounds over time.

    The part is 2 Re Σ_k C_k R_k(t) over n modes, R = ∫ exp(λ τ) a(t − τ) dτ. For what a force adds
    to outputs at once, `Direct`, R of the first mode is a(t) itself and that of all others 0.

    Args:
        model: The modal model with T time nodes and m outputs.
        growth: Upper bounds of Re λ_k over the box, shape (n,), in 1/s.
        load: Tables of R, and C as polynomials, shape (n, m).

    Returns:
        C; `waves`, bounds of |∂^r R/∂λ^r| for r = 0 to 3, shape (4, T, n); `elapsed`, bounds of ∫
        |R| from 0 to t, shape (T, n), and `impulse`, of ∫ |a|, shape (T,), which are 0 for a direct
        part.
    """
    time = model.flow.time
    if isinstance(load, Direct):  # w of the first mode is a(t), and that of all others 0
        waves: Array = np.zeros((4, len(time), model.count))
        waves[0] = np.abs(load.at_nodes(np.zeros((1, model.count)))[0])
        return ResponsePart(
            coefficient=load.share,
            waves=waves,
            elapsed=np.zeros(waves[0].shape),
            impulse=np.zeros(len(time)),
            load=load,
        )

    def moments(decay: float) -> Array:
        """Bounds of ∫ τ^r exp(−decay τ) |a(t − τ)| dτ, (5, T)."""
        return absolute_moments(decay, load.history, time)

    undamped = moments(0.0)
    of_modes = np.stack([moments(-float(g)) for g in growth], axis=-1)  # (5, T, n)
    # ∫₀ᵗ |R| ≤ ∫ |a(t − τ)| ∫₀^τ exp(g s) ds dτ. The inner integral is at most τ and at most 1/|g|
    # where g < 0, and at most τ exp(g τ) else.
    by_decay = undamped[0] / np.maximum(-growth, 1e-300)[:, np.newaxis]
    decaying = np.minimum(undamped[1], by_decay).T
    return ResponsePart(
        coefficient=load.share,
        waves=of_modes[:4],
        elapsed=np.where(growth < 0, decaying, of_modes[1]),
        impulse=undamped[0],
        load=load,
    )
