"""Response over a box from polynomials λ_k(p), C_k(p), the intervening variables of section 7.

Displacements oscillate in the inputs, the more the later; λ_k and C_k do not. Every value and
derivative follows from q(t; p) = 2 Re Σ_k C_k(p) w(t; λ_k(p)), with the wave w = exp(λ t) for the
free response, and w = R(t; λ) = ∫ exp(λ (t − s)) a(s) ds for that to a load. The free response and
the response to each load are the parts of the model.

Its error in comparison with the true response is bounded as follows. Polynomials φ_k, ψ_k, λ_k make
q(t) = 2 Re Σ φ_k exp(λ_k t) a response that nearly obeys the equations of motion, with the velocity
2 Re Σ ψ_k exp(λ_k t). What it misses there, the defects λ_k φ_k − ψ_k and λ_k M ψ_k + D ψ_k + K
φ_k, are Taylor models of which hardly more than the remainder is left. Damping only takes energy,
so the deviation from the true response, in the energy norm √(qᵀ K q + vᵀ M v), grows no faster than
these defects push it: no eigenvalue problem is solved anew, and nothing rests on a distance between
eigenvalues.

Damping by one ratio ζ, 2 ζ (M # K), is no polynomial, but a Taylor model (`geometric_mean`), whose
remainder is contained in the defect.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.frame.boxes import Boxes
from alphacut.frame.calculus.taylor_model import TaylorModel, concatenate
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import LinearFlow, exact_flow
from alphacut.frame.modes.damped import (
    DampedModes,
    DampedStructure,
    needed_modes,
    norm_of,
    require_dissipation,
)
from alphacut.frame.response.duhamel import absolute_moments
from alphacut.frame.response.tables import Direct, LoadTables
from alphacut.frame.structures.linear import histories
from alphacut.frame.structures.loads import distinct_histories


class OutputJets(NamedTuple):
    """An output at N points, with derivatives by d unit coordinates."""

    value: Array  # (N,)
    gradient: Array  # (N, d)
    hessian: Array  # (N, d, d)


@dataclass(frozen=True, eq=False)
class ModalModel:
    """Outputs over the unit box from polynomials of n modes in the d inputs; m outputs."""

    flow: LinearFlow  # the structure's exact response, which it approximates
    boxes: Boxes  # the inputs' boxes
    structure: DampedStructure  # the structure over the widest of them
    modes: DampedModes  # its modes
    eigenvalue: TaylorModel  # λ_k, polynomials without remainders, (n,), in 1/s
    coefficient: TaylorModel  # C_k of the free response, the same, (n, m)
    loads: tuple[LoadTables, ...]  # responses to the loads, and what these add to outputs at once

    @classmethod
    def from_modes(
        cls, flow: LinearFlow, boxes: Boxes, structure: DampedStructure, modes: DampedModes
    ) -> ModalModel:
        """Return the model of a structure's response that some of its damped modes give.

        Args:
            flow: The structure's exact response, with T time nodes and m outputs.
            boxes: Nested boxes of the inputs, the widest first.
            structure: The structure as Taylor models over the widest box.
            modes: Polynomials of n modes over this box, for each source: the initial state first,
                then the loads in the order of `histories(flow.system)`.
        """
        coefficients = modes.outputs(structure).polynomial  # (sources, n, m)
        loads = [
            LoadTables(history, flow.time, modes.eigenvalue, coefficients[k])
            for k, history in enumerate(histories(flow.system).values(), start=1)
        ]
        if structure.feeds is not None:
            # The wave of the first mode is the load a(t) then, so that 2 Re C_1 a(t) is the
            # feedthrough with half of it as C_1.
            half_of_first = np.zeros((coefficients.shape[1], 1))
            half_of_first[0] = 0.5
            for h, history in enumerate(distinct_histories(flow.system.loads)):
                feedthrough = (structure.feeds[:, h] * half_of_first).polynomial
                loads.append(Direct(history, flow.time, modes.eigenvalue, feedthrough))
        return cls(flow, boxes, structure, modes, modes.eigenvalue, coefficients[0], tuple(loads))

    @classmethod
    def of_degree(
        cls,
        flow: LinearFlow,
        boxes: Boxes,
        degree: int,
        tolerance: Array | float = 0.0,
        *,
        fixed: Mapping[str, float] | None = None,
    ) -> ModalModel:
        """Return the model by polynomials of one degree over the widest of some nested boxes.

        Args:
            flow: The structure's response by an exact integrator, with T time nodes and m outputs.
            boxes: Nested boxes of the inputs, one for each α-level, the widest first.
            degree: Total degree of the polynomials.
            tolerance: Modes are left out that are together worth no more than this in each output,
                shape (m,), or one number for all. At 0 no mode is left out that adds anything.
            fixed: Values of other parameters by name, where they are not nominal.

        Raises:
            UnprovedError: The integrator is not the exact one, the structure is not known to have a
                mass and to lose energy, a mode does not oscillate or has the frequency of another
                one, or the mass may be singular in the box.
            numpy.linalg.LinAlgError: A mode is defective at the midpoint of the box.
        """
        require_dissipation(exact_flow(flow).system, boxes, fixed)
        structure = DampedStructure.over_box(flow.system, boxes, degree, fixed)
        loads = list(histories(flow.system).values())
        chosen = needed_modes(structure, loads, flow.time, tolerance)
        return cls.from_modes(flow, boxes, structure, DampedModes.of_structure(structure, chosen))

    @property
    def count(self) -> int:
        """Number of modes n."""
        return len(self.eigenvalue.value)

    @property
    def degree(self) -> int:
        """Total degree of the polynomials."""
        return len(self.eigenvalue.parts) - 1

    def in_units(self, scale: Array) -> ModalModel:
        """Return the model with every output divided by its scale (m,)."""
        loads = tuple(replace(load, share=load.share * (1 / scale)) for load in self.loads)
        return replace(self, coefficient=self.coefficient * (1 / scale), loads=loads)

    @cached_property
    def has_free_response(self) -> bool:
        """Whether there is a free response: an initial state, or no load at all."""
        return not self.loads or bool(self.coefficient.coefficients.any())

    @property
    def coefficients(self) -> list[TaylorModel]:
        """C_k of each part, shape (n, m): of the free response, if there is one, then of loads."""
        of_loads = [load.share for load in self.loads]
        return [self.coefficient, *of_loads] if self.has_free_response else of_loads

    @cached_property
    def together(self) -> TaylorModel:
        """Polynomials λ_k, n of them, then C_k of each part, n m."""
        flat = [coefficient.reshaped(-1) for coefficient in self.coefficients]
        return concatenate([self.eigenvalue, *flat], -1)

    @cached_property
    def by_output(self) -> list[TaylorModel]:
        """For each output the polynomials λ_k, n of them, then C_k of each part, n."""
        models = []
        for o in range(len(self.flow.outputs)):
            of_output = [coefficient[:, o] for coefficient in self.coefficients]
            models.append(concatenate([self.eigenvalue, *of_output], -1))
        return models

    def values(self, unit: Array) -> Array:
        """Return outputs at all time nodes for S points, shape (S, T, m).

        They are 2 Re Σ_k C_k w(t; λ_k) over n modes and all parts of the response, free and by
        loads; errors of the model are not contained.

        Args:
            unit: Unit coordinates of the points, shape (S, d), in [−1, 1] over the widest box.
        """
        n = self.count
        polynomials = self.together.at(unit)
        eigenvalues = polynomials[:, :n]
        waves = []  # of each part, (S, T, n)
        if self.has_free_response:
            waves.append(np.exp(eigenvalues[:, np.newaxis] * self.flow.time[:, np.newaxis]))
        waves += [load.at_nodes(eigenvalues) for load in self.loads]
        C = polynomials[:, n:].reshape(len(unit), len(waves) * n, -1)
        w = np.concatenate(waves, axis=-1)
        return np.asarray(2 * (w.real @ C.real - w.imag @ C.imag))

    def at(self, unit: Array, node: Ints, output: Ints) -> OutputJets:
        """Return one output at one time node for each of N points, with derivatives by the inputs.

        Args:
            unit: Unit coordinates of the points, shape (N, d), in [−1, 1] over the widest box.
            node: Index of the time node of each point, shape (N,).
            output: Index of the output of each point, shape (N,).

        Returns:
            `value` (N,), `gradient` (N, d) and `hessian` (N, d, d), by the unit coordinates, in the
            units of the outputs.
        """
        n = self.count
        d = unit.shape[1]
        row, column = np.triu_indices(d)
        jets = np.zeros((len(unit), 1 + d + len(row)))  # value, gradient, packed Hessian
        for o in np.unique(output):
            points = np.flatnonzero(output == o)
            polynomials = self.by_output[o].jets(unit[points]).swapaxes(0, 1)
            eigenvalues = polynomials[..., :n]
            coefficients = polynomials[..., n:].reshape(*polynomials.shape[:2], -1, n, 1)
            factors = wave_factors(eigenvalues, coefficients, d)[:, 0]
            waves = self.waves(eigenvalues[0], node[points])
            jets[points] = (waves[:, np.newaxis] @ factors)[:, 0]
        hessian = np.empty((len(unit), d, d))
        hessian[:, row, column] = jets[:, 1 + d :]
        hessian[:, column, row] = jets[:, 1 + d :]
        return OutputJets(jets[:, 0], jets[:, 1 : 1 + d], hessian)

    def waves(self, eigenvalues: Array, node: Ints) -> Array:
        """Return w(t; λ), dw/dλ and d²w/dλ² of all parts of the response, for N points.

        A part is the free response, w = exp(λ t), if the structure has one, or the response to a
        load a, w = ∫ exp(λ (t − s)) a(s) ds; parts stand in this order.

        Args:
            eigenvalues: λ of n modes, shape (N, n), in 1/s.
            node: Index of the time node t of each point, shape (N,).

        Returns:
            Real numbers, shape (N, 6 parts n). The second axis runs over parts, then w, dw/dλ,
            d²w/dλ², then modes, then real and imaginary parts.
        """
        parts = list[Array]()
        if self.has_free_response:
            t = self.flow.time[node][:, np.newaxis]
            wave = np.exp(eigenvalues * t)
            parts.append(np.stack([wave, t * wave, t * t * wave]))
        parts += [load.response(eigenvalues, node) for load in self.loads]
        waves = np.moveaxis(np.stack(parts), 2, 0)  # (N, parts, 3, n)
        return _real_and_imaginary(waves).reshape(len(eigenvalues), -1)


def wave_factors(eigenvalues: Array, C: Array, d: int) -> Array:
    """Return the factors of w, w′ and w″ in 2 Re Σ_k C_k w(λ_k) and its first two derivatives.

    The eigenvalues λ_k and coefficients C_k depend on d inputs u, and w is a function of λ, such as
    exp(λ t). By the chain rule, with w′ = dw/dλ and derivatives by the inputs u_i as indices,

        (C w)_i = C_i w + C λ_i w′,
        (C w)_ij = C_ij w + (C_i λ_j + C_j λ_i + C λ_ij) w′ + C λ_i λ_j w″.

    Args:
        eigenvalues: λ_k of n modes with first and second derivatives at B points, shape (q, B, n)
            with q = 1 + d + d (d + 1)/2: value, gradient, and second derivatives by u_i and u_j for
            i ≤ j, packed by rows.
        C: Complex C_k of m outputs for each of several parts of the response (free, to a load, …),
            with the same derivatives, shape (q, B, parts, n, m).
        d: Number of inputs.

    Returns:
        Real numbers, shape (B, m, 6 parts n, q). The third axis runs over parts, then w, w′, w″,
        then modes, then real and imaginary parts. The scalar product along it with the values of w,
        w′ and w″ in this order gives value and derivatives of the outputs.
    """
    rate = eigenvalues[..., np.newaxis, :, np.newaxis]
    _, points, parts, n, m = C.shape
    factors = np.zeros((points, parts, 3, n, m, len(C)), complex)
    of_wave = factors[:, :, 0]
    of_first_derivative = factors[:, :, 1]
    of_second_derivative = factors[:, :, 2]
    of_wave[:] = np.moveaxis(C, 0, -1)
    for a in range(1, 1 + d):
        of_first_derivative[..., a] = C[0] * rate[a]
    row, column = np.triu_indices(d)
    for a, (i, j) in enumerate(zip(row, column, strict=True), start=1 + d):
        rate_i = rate[1 + i]
        rate_j = rate[1 + j]
        of_first_derivative[..., a] = C[1 + i] * rate_j + C[1 + j] * rate_i + C[0] * rate[a]
        of_second_derivative[..., a] = C[0] * rate_i * rate_j
    # 2 Re (z w) = 2 Re z Re w − 2 Im z Im w
    doubled = 2 * np.stack([factors.real, -factors.imag], axis=4)
    flat = doubled.reshape(points, -1, m, len(C))
    return np.ascontiguousarray(flat.swapaxes(1, 2))


def _real_and_imaginary(x: Array) -> Array:
    """Return the real and imaginary parts of complex numbers along a new last axis, (…, 2)."""
    return np.ascontiguousarray(x).view(float).reshape(*x.shape, 2)


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
    `bounds.branch_and_bound`.

    Args:
        model: Modal model of a structure that is known to lose energy everywhere in the box.

    Returns:
        Bounds at T time nodes for m outputs, shape (T, m); infinite where modes may grow so fast
        that their waves overflow.

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
    growth = largest_growth(model.eigenvalue, np.ones(len(model.boxes.names)))
    deviation = np.zeros(len(model.flow.time))
    output_error = np.zeros((len(model.flow.time), len(model.flow.outputs)))
    with np.errstate(over="ignore", invalid="ignore"):  # of waves that grow without end
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
        error = deviation[:, np.newaxis] * norms.outputs + output_error
    return np.where(np.isfinite(error), error, np.inf)


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
