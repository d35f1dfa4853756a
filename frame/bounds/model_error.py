"""Proved bound of the error of a modal model, over the whole box and all times.

Polynomials φ_k, w_k, λ_k make q(t) = 2 Re Σ φ_k exp(λ_k t) a motion that nearly obeys the
equations. What it misses, λ_k φ_k − w_k and λ_k M w_k + D w_k + K φ_k, are Taylor models of which
hardly more than the remainder is left. Damping only takes energy, so the deviation from the true
motion, in the norm √(qᵀ K q + vᵀ M v), grows no faster than this defect: no eigenvalue problem is
solved anew, and nothing rests on a distance between eigenvalues.

Damping by one ratio ζ, D₀ + 2 ζ M √(M⁻¹K), is no polynomial. For any μ > 0 and vector w, in the
norm of M⁻¹, ‖2 ζ M √(M⁻¹K) w − 2 ζ √μ M w‖ ≤ 2 ζ ‖(K − μ M) w‖ / (√λ + √μ), λ the least eigenvalue
of K against M. With μ = |λ_k|² the motion is measured with 2 ζ √μ M w in place of the damping.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from alphacut.frame.bounds.remainder import largest_growth, parts, suprema
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.damped import DampedModes, DampedStructure, norm_of
from alphacut.frame.modes.modal_model import ModalModel
from alphacut.frame.response.load_tables import Direct
from alphacut.fuzzy.arrays import Array

ROUNDING = 1e-9
"""Relative rounding of the norms, some thousand operations."""


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
    by_ratio = _ratio_errors(structure, modes, norms)
    energy_rate = _energy_rates(structure, modes, norms, by_ratio)
    start, outputs = _start_errors(structure, modes, norms), modes.outputs(structure)
    deviation = np.zeros(len(model.time))
    output_error = np.zeros((len(model.time), len(model.outputs)))
    for s, part in enumerate(parts(model, largest_growth(model.eigenvalue, reach))):
        if isinstance(part.load, Direct):
            assert structure.feeds is not None
            error = (structure.feeds[:, s - len(start)] - part.share.real[0] * 2.0).size()
            output_error += part.waves[0][:, :1] * error
            continue
        deviation += part.push * start[s] + 2 * part.elapsed @ energy_rate[s]
        share_error = (outputs[s] - part.share).size() + by_ratio[s][:, None] * norms.reading
        largest = suprema(part.share, reach)[0]
        output_error += 2 * part.waves[0] @ (share_error + part.left_out[:, None] * largest)
    return (1 + ROUNDING) * (deviation[:, None] * norms.outputs + output_error)


@dataclass(frozen=True, eq=False)
class EnergyNorms:
    """Bounds of energy norms over the box, by M and K in its middle, the unit matrix and diag(ω²).

    (1 − μ) 1 ≤ M ≤ (1 + μ) 1 and (1 − κ) ω² ≤ K ≤ (1 + κ) ω² with spectral norms μ and κ of bounds
    of |M − 1| and |K − ω²| / (ω ωᵀ).

    Raises:
        UnprovedError: M or K is not shown to stay positive definite.
    """

    structure: DampedStructure

    def __post_init__(self) -> None:
        if not max(self.mass_spread, self.stiffness_spread) < 1:
            raise UnprovedError(
                "the box is so wide that mass and stiffness are not shown to stay positive definite"
            )

    @cached_property
    def mass_spread(self) -> float:
        """Number μ."""
        mass = self.structure.mass
        return float(np.linalg.norm((mass - np.eye(len(mass.value))).size(), 2))

    @cached_property
    def stiffness_spread(self) -> float:
        """Number κ."""
        omega, stiffness = self.structure.omega, self.structure.stiffness
        spread = (stiffness - np.diag(omega**2)).size() / (omega[:, None] * omega)
        return float(np.linalg.norm(spread, 2))

    def of_displacement(self, x: Array) -> Array:
        """Bound of √(x* K x) for vectors of entries up to x (…, N), shape (…,)."""
        return np.sqrt(1 + self.stiffness_spread) * norm_of(x * self.structure.omega)

    def of_spring_force(self, f: Array) -> Array:
        """Bound of √(f* K⁻¹ f)."""
        return norm_of(f / self.structure.omega) / np.sqrt(1 - self.stiffness_spread)

    def of_force(self, f: Array) -> Array:
        """Bound of √(f* M⁻¹ f)."""
        return norm_of(f) / np.sqrt(1 - self.mass_spread)

    @property
    def least_frequency(self) -> float:
        """Lower bound of the frequencies over the box, in rad/s."""
        ratio = (1 - self.stiffness_spread) / (1 + self.mass_spread)
        return float(self.structure.omega[0] * np.sqrt(ratio))

    @property
    def greatest_ratio(self) -> float:
        """Largest damping ratio."""
        ratio = self.structure.ratio
        return 0.0 if ratio is None else float(ratio.bounds()[1])

    @cached_property
    def reading(self) -> Array:
        """What outputs read of a force, over its norm of M⁻¹: √(r M rᵀ) of their rows, (m,)."""
        return np.sqrt(1 + self.mass_spread) * norm_of(self.structure.reading.size())

    @cached_property
    def outputs(self) -> Array:
        """Error of outputs over a deviation √(qᵀ K q + vᵀ M v) of the motion, shape (m,).

        Accelerations read the force of the damping by a ratio too, 2 ζ ω √(vᵀ M v) at most.
        """
        of_displacement, of_velocity = np.split(self.structure.rows.size(), 2, axis=1)
        ratio = (1 + self.stiffness_spread) / (1 - self.mass_spread)
        fastest = self.structure.omega[-1] * np.sqrt(ratio)
        by_ratio = 2 * self.greatest_ratio * fastest * self.reading
        return np.hypot(
            self.of_spring_force(of_displacement), self.of_force(of_velocity) + by_ratio
        )


def _energy_rates(
    structure: DampedStructure, modes: DampedModes, norms: EnergyNorms, by_ratio: Array
) -> Array:
    """Bounds of what the defects of modes add to the deviation over exp(λ t) and time, (S, n)."""
    rate, momentum = modes.rate[:, None], modes.velocity @ structure.mass
    kinematic = rate * modes.shape - modes.velocity
    dynamic = (
        rate * momentum + modes.velocity @ structure.damping + modes.shape @ structure.stiffness
    )
    if structure.ratio is not None:
        dynamic = dynamic + modes.ratio_force(structure)
    force = norms.of_force(dynamic.size()) + by_ratio
    return np.hypot(norms.of_displacement(kinematic.size()), force)


def _ratio_errors(structure: DampedStructure, modes: DampedModes, norms: EnergyNorms) -> Array:
    """Bounds of the damping forces by a ratio less 2 ζ |λ_k| M w_k, in the norm of M⁻¹, (S, n)."""
    if structure.ratio is None:
        return np.zeros(modes.shape.shape[:2])
    squared = modes.squared_frequency
    residual = modes.velocity @ structure.stiffness
    residual = residual - squared[:, None] * (modes.velocity @ structure.mass)
    sums = norms.least_frequency + np.sqrt(np.maximum(squared.bounds()[0], 0.0))
    return 2 * norms.greatest_ratio * norms.of_force(residual.size()) / sums


def _start_errors(structure: DampedStructure, modes: DampedModes, norms: EnergyNorms) -> Array:
    """Bounds of the sources' initial conditions' defects in the norm of energy, (S,)."""
    q, v = (2.0 * _sum_of_modes(x.real) for x in (modes.shape, modes.velocity))
    spring = q @ structure.stiffness - structure.static.T
    momentum = v @ structure.mass - structure.impulse.T
    return np.hypot(norms.of_spring_force(spring.size()), norms.of_force(momentum.size()))


def _sum_of_modes(x: TaylorModel) -> TaylorModel:
    """Sum over modes, (S, N) of (S, n, N)."""
    n = x.shape[1]
    return (np.ones((1, n)) @ x)[:, 0]
