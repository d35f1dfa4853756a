"""Proved bounds of the error of a modal model, and of what its quadratic Taylor models leave out.

Polynomials φ_k, w_k, λ_k make q(t) = 2 Re Σ φ_k exp(λ_k t) a motion that nearly obeys the
equations. What it misses, λ_k φ_k − w_k and λ_k M w_k + D w_k + K φ_k, are Taylor models of which
hardly more than the remainder is left. Damping only takes energy, so the deviation from the true
motion, in the norm √(qᵀ K q + vᵀ M v), grows no faster than this defect: no eigenvalue problem is
solved anew, and nothing rests on a distance between eigenvalues.

Damping by one ratio ζ, 2 ζ (M # K), is no polynomial, but a Taylor model (`geometric_mean`), whose
remainder is a part of the defect.

A part of a modal model is 2 Re Σ_k C_k(p) w(t; λ_k(p)) with w = exp(λ t) or w = R = ∫ exp(λ (t −
s)) a(s) ds; its r-th derivative by λ is bounded by t^r exp(g t), or by ∫ τ^r exp(g τ) |a(t − τ)|
dτ, with g a bound of Re λ. From these follow what quadratic Taylor models of it leave out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.calculus.monomials import count, exponents, product_part, product_places
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.damped import DampedModes, DampedStructure, norm_of
from alphacut.frame.modes.modal_model import ModalModel
from alphacut.frame.response.duhamel import absolute_moments
from alphacut.frame.response.load_tables import REACH, Direct, LoadTables

ROUNDING = 1e-9
"""Relative rounding of norms and of integrals over a load, of a million intervals at most."""
MAX_PARAMETERS = 6
"""Tensors of third derivatives grow with the cube of the number of parameters."""
SERIES_TERMS = 100
"""Terms of the series of a wave under a load, at most, as rounding counts them."""


def proved_error(model: ModalModel) -> Array:
    """Bound of |modal model − true motion| over the box, shape (T, m), in units of the outputs.

    Defects in the equations of motion push the motion off in the norm of energy; an output reads a
    part of this deviation, and its own defects add to it.

    Raises:
        UnprovedError: The box is so wide that M or K may lose its definiteness.
    """
    structure, reach = model.structure, np.ones(len(model.boxes.names))
    # what is proved are the polynomials that bounds are made of
    modes = replace(model.modes, rate=model.eigenvalue)
    norms = EnergyNorms(structure)
    energy_rate = _energy_rates(structure, modes, norms)
    start, outputs = _start_errors(structure, modes, norms), modes.outputs(structure)
    deviation = np.zeros(len(model.flow.time))
    output_error = np.zeros((len(model.flow.time), len(model.flow.outputs)))
    for s, part in enumerate(motion_parts(model, largest_growth(model.eigenvalue, reach))):
        if isinstance(part.load, Direct):
            assert structure.feeds is not None
            error = (structure.feeds[:, s - len(start)] - part.share.real[0] * 2.0).magnitude()
            output_error += part.waves[0][:, :1] * error
            continue
        deviation += part.push * start[s] + 2 * part.elapsed @ energy_rate[s]
        share_error = (outputs[s] - part.share).magnitude()
        left_out = part.left_out[:, None] * part.share.magnitude()
        output_error += 2 * part.waves[0] @ (share_error + left_out)
    return (1 + ROUNDING) * (deviation[:, None] * norms.outputs + output_error)


def direct_error_in_steps(model: ModalModel) -> Array:
    """Bound of the error of what forces add to outputs at once, within the step to each node.

    It is the error of the share times the largest |f| in the step, which may be zero at its ends:
    shape (T, m), in units of the outputs.
    """
    structure, error = model.structure, np.zeros((len(model.flow.time), len(model.flow.outputs)))
    n_sources = structure.static.shape[1]
    for number, load in enumerate(model.loads):
        if isinstance(load, Direct):
            assert structure.feeds is not None
            share = structure.feeds[:, number + 1 - n_sources] - load.share.real[0] * 2.0
            error += np.outer(load.history.largest_in_steps(model.flow.time), share.magnitude())
    return (1 + ROUNDING) * error


class EnergyNorms:
    """Bounds of energy norms over the box, by M and K in its middle, the unit matrix and diag(ω²).

    (1 − μ) 1 ≤ M ≤ (1 + μ) 1 and (1 − κ) ω² ≤ K ≤ (1 + κ) ω² with spectral norms μ and κ of bounds
    of |M − 1| and |K − ω²| / (ω ωᵀ).

    Raises:
        UnprovedError: M or K is not shown to stay positive definite.
    """

    def __init__(self, structure: DampedStructure) -> None:
        mass, stiffness, self.omega = structure.mass, structure.stiffness, structure.omega
        mass_off = (mass - np.eye(len(mass.value))).magnitude()
        stiffness_off = (stiffness - np.diag(self.omega**2)).magnitude()
        stiffness_off = stiffness_off / (self.omega[:, None] * self.omega)
        self.mu, self.kappa = (float(np.linalg.norm(x, 2)) for x in (mass_off, stiffness_off))
        if not max(self.mu, self.kappa) < 1:
            raise UnprovedError(
                "the box is so wide that mass and stiffness are not shown to stay positive definite"
            )
        of_displacement, of_velocity = np.split(structure.rows.magnitude(), 2, axis=1)
        # error of outputs over a deviation √(qᵀ K q + vᵀ M v) of the motion, (m,)
        self.outputs = np.hypot(self.of_spring_force(of_displacement), self.of_force(of_velocity))

    def of_displacement(self, x: Array) -> Array:
        """Bound of √(x* K x) for vectors of entries up to x (…, N), shape (…,)."""
        return np.sqrt(1 + self.kappa) * norm_of(x * self.omega)

    def of_spring_force(self, f: Array) -> Array:
        """Bound of √(f* K⁻¹ f)."""
        return norm_of(f / self.omega) / np.sqrt(1 - self.kappa)

    def of_force(self, f: Array) -> Array:
        """Bound of √(f* M⁻¹ f)."""
        return norm_of(f) / np.sqrt(1 - self.mu)


def _energy_rates(structure: DampedStructure, modes: DampedModes, norms: EnergyNorms) -> Array:
    """Bounds of what the defects of modes add to the deviation over exp(λ t) and time, (S, n)."""
    rate, momentum = modes.rate[:, None], modes.velocity @ structure.mass
    kinematic = rate * modes.shape - modes.velocity
    dynamic = (
        rate * momentum + modes.velocity @ structure.damping + modes.shape @ structure.stiffness
    )
    return np.hypot(
        norms.of_displacement(kinematic.magnitude()), norms.of_force(dynamic.magnitude())
    )


def _start_errors(structure: DampedStructure, modes: DampedModes, norms: EnergyNorms) -> Array:
    """Bounds of the sources' initial conditions' defects in the norm of energy, (S,)."""
    twice = np.full((1, modes.shape.shape[1]), 2.0)  # the sum over modes and their conjugates
    q, v = ((twice @ x.real)[:, 0] for x in (modes.shape, modes.velocity))
    spring = q @ structure.stiffness - structure.static.T
    momentum = v @ structure.mass - structure.impulse.T
    return np.hypot(norms.of_spring_force(spring.magnitude()), norms.of_force(momentum.magnitude()))


def majorant_parts(polynomials: TaylorModel, reach: Array) -> list[Array]:
    """Parts of degree 0 to 3 of Σ |coefficient| (reach + v)^e in v, shapes (monomials, *V).

    At v = 0 its derivatives bound those of the polynomials, shape V, over the box |u_i| ≤ reach_i.
    """
    sizes = replace(polynomials, parts=tuple(np.abs(part) for part in polynomials.parts))
    around = sizes.on_subbox(reach - 1, reach + 1)
    return [around.homogeneous_part(degree) for degree in range(4)]


def largest_growth(eigenvalue: TaylorModel, reach: Array) -> Array:
    """Upper bounds of the growth rates Re λ_k over the box |u_i| ≤ reach_i, shape (n,), in 1/s."""
    return eigenvalue.real.on_subbox(-reach, reach).bounds()[1]


@dataclass(frozen=True, eq=False)
class MotionPart:
    """The free part of a modal model, or what one load adds."""

    share: TaylorModel  # coefficients C_k, polynomials, (n, m)
    waves: Array  # bounds of the derivatives of w by λ, orders 0 to 3, (4, T, n)
    elapsed: Array  # bounds of ∫ |w| from 0 to t, (T, n)
    push: Array  # bound of the impulse ∫ |a| of the load up to t, (T,), in m/s; 1 of the free part
    left_out: Array  # bound of the model's error of w, over waves[0], (n,)
    load: LoadTables | None = None  # the load; None of the free part


def motion_parts(model: ModalModel, growth: Array) -> list[MotionPart]:
    """The free part of a model's motion, then the part of each load, with bounds over time.

    `growth` (n,) are upper bounds of Re λ_k, in 1/s.
    """
    time = model.flow.time[:, None]
    divisor = np.where(growth == 0, 1.0, growth)
    free = MotionPart(
        share=model.coefficient,
        waves=time ** np.arange(4)[:, None, None] * np.exp(growth * time),
        elapsed=np.where(growth == 0, time, np.expm1(growth * time) / divisor),
        push=np.ones(len(time)),
        left_out=np.zeros(model.count),
    )
    return [free, *(_forced_part(model, growth, load) for load in model.loads)]


def _forced_part(model: ModalModel, growth: Array, load: LoadTables) -> MotionPart:
    """Part of a model's motion that a load a(t) makes, w = R = ∫ exp(λ τ) a(t − τ) dτ."""
    if isinstance(load, Direct):  # w of the first mode is a(t)
        waves: Array = np.zeros((4, len(model.flow.time), model.count))
        waves[0] = np.abs(load.at_nodes(np.zeros((1, model.count)))[0])
        return MotionPart(
            load.share, waves, 0 * waves[0], 0 * model.flow.time, load.truncation, load
        )

    def moments(decay: float) -> Array:  # of exp(−decay τ) |a(t − τ)|
        return (1 + ROUNDING) * absolute_moments(decay, load.history, model.flow.time)

    undamped = moments(0.0)
    of_modes = np.stack([moments(-float(g)) for g in growth], -1)  # (5, T, n)
    # ∫₀ᵗ |R| ≤ ∫ |a(t − τ)| ∫₀^τ exp(g s) ds dτ, the inner one at most
    # τ and 1/|g| where g < 0, else τ exp(g τ)
    decaying = np.minimum(undamped[1], undamped[0] / np.maximum(-growth, 1e-300)[:, None]).T
    elapsed = np.where(growth < 0, decaying, of_modes[1])
    return MotionPart(load.share, of_modes[:4], elapsed, undamped[0], load.truncation, load)


class Remainder:
    """Bounds of what quadratic Taylor models of the outputs leave out in a box, and of rounding.

    They follow for the box [lower, upper] by majorants: derivatives of C exp(λ t) over exp(λ₀ t)
    are no larger than those of Σ_p t^p C ρ^p / p!, ρ = λ − λ₀, with majorants of C and λ.
    """

    def __init__(self, model: ModalModel, lower: Array, upper: Array) -> None:
        d, n, m, time = len(lower), model.count, len(model.flow.outputs), model.flow.time
        reach, width = np.maximum(np.abs(lower), np.abs(upper)), upper - lower
        growth = largest_growth(model.eigenvalue, reach)
        self.rate = majorant_parts(model.eigenvalue, reach)  # by degree, (monomials, n)
        cubic, margin = np.zeros((len(time), count(d, 3), m)), np.zeros((len(time), 1 + d, m))
        rho = [part[..., None] for part in self.rate]
        for part in motion_parts(model, growth):
            noise = _rounding_bound(model, self.rate[0][0], part.load)
            # of the last part, when all are done; by degree, (monomials, n, m)
            self.share = power = majorant_parts(part.share, reach)
            for p in range(4):  # power: the parts of C ρ^p / p!
                waves = 2 * part.waves[p]
                cubic += np.tensordot(waves, power[3], (1, 1))
                quadratic = TaylorModel(tuple(power[:3]), np.zeros((n, m)), d)
                largest = np.concatenate(majorant_parts(quadratic, width)[:2])  # values, slopes
                margin += np.tensordot(noise * waves, largest, (1, 1))
                power = [
                    product_part(power, rho, k, d, np.multiply, lowest=(0, 1)) / (p + 1)
                    for k in range(4)
                ]
            if part.load is None:  # the first part; at the start most of its modes cancel
                at_start = np.full(n, 2.0) @ part.share.real
                cubic[time == 0] = majorant_parts(at_start, reach)[3]
        of_exponents = np.array([1, 1, 2, 6])[exponents(d, 3)].prod(1)  # ∂³ u^e at 0, e!
        third = (1 + 1e-9) * (cubic * of_exponents[:, None]).swapaxes(1, 2)
        # bounds of |∂³ output / ∂u_i ∂u_j ∂u_k|, (T, m, d, d, d)
        places = product_places(d, 1, 2)[:, product_places(d, 1, 1)]
        self.tensor = np.ascontiguousarray(third[..., places])
        # rounding of values, and of slopes, (T, m, 1 + d)
        self.margin = np.ascontiguousarray(margin.swapaxes(1, 2))


def _rounding_bound(model: ModalModel, rate: Array, load: LoadTables | None) -> Array:
    """Relative rounding error of each mode's motion at each node, (T, n): ε times operations."""
    # that of λ enters exp(λ t) times |λ| t; terms of a load's series exceed its sum by exp(REACH)
    n_terms, d = model.eigenvalue.exponents.shape
    of_polynomial = n_terms + model.degree + 2
    phase = rate * model.flow.time[:, None]
    operations = of_polynomial * (2 + phase) + 12 * model.count + 4 * d**3 + 50
    if load is not None:
        operations = operations + (8 * len(model.flow.time) + SERIES_TERMS) * np.exp(REACH)
    return np.finfo(float).eps * operations
