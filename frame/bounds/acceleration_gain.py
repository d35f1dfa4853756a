"""Bounds of floor accelerations under a ground acceleration whose integral alone is bounded.

The ground acceleration δ(t) acts on a structure at rest, and |D(t)| ≤ 1 m/s for D = ∫₀ᵗ δ dτ.
Below, r is the row of an output on the absolute accelerations, ι the influence vector, t the
duration, and the modes are scaled to φᵀ M φ = 1.

By modes. The impulse response of a mode's absolute acceleration has the amplitude ω²/ω_d, with
ω_d = ω √(1 − ζ²), and decays with ζ ω. One integration by parts turns δ into D and brings the
factor ω, so that mode k contributes at most

    |r φ_k| |φ_kᵀ M ι| ω_k (1 + 1/ζ_k) / √(1 − ζ_k²).

By the inequality of Cauchy and Schwarz

    Σ_k |r φ_k| |φ_kᵀ M ι| ω_k ≤ min(√(r M⁻¹ rᵀ · ιᵀ K ι), √(r M⁻¹ K M⁻¹ rᵀ · ιᵀ M ι)).

By energy, for any damping matrix C ≥ 0. With p = q' + ι D the equations are M p' + C p + K q =
C ι D and q' = p − ι D, and p' is the absolute acceleration. For s² = pᵀ M p + qᵀ K q it follows
that (s²)' ≤ ιᵀ C ι / 2 + 2 s √(ιᵀ K ι), since pᵀ C ι D ≤ pᵀ C p + D² ιᵀ C ι / 4. Hence
s ≤ √(ιᵀ K ι) t + √(ιᵀ C ι t / 2), and

    |r p'| ≤ (√(r M⁻¹ K M⁻¹ rᵀ) + √(r M⁻¹ C M⁻¹ C M⁻¹ rᵀ)) s + |r M⁻¹ C ι|.

Ratios of up to ζ add M Φ diag(2 ζ_k ω_k) Φᵀ M to C. The second root becomes larger by at most 2 ζ
times the first, and |r M⁻¹ C ι| and ιᵀ C ι by at most 2 ζ times √(r M⁻¹ rᵀ · ιᵀ K ι) and
√(ιᵀ M ι · ιᵀ K ι), by Cauchy and Schwarz again.

Unknowns without mass are condensed, which makes K no larger than its part on the others.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.bounds.box import parameters_over_box
from alphacut.frame.boxes import Boxes
from alphacut.frame.calculus.taylor_model import TaylorModel, solve
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.damped import require_dissipation
from alphacut.frame.structures.linear import Assembly, LinearSystem

MAX_RATIO = 0.9
"""Damping ratio of a mode up to which the bound by modes is used (tuned)."""


def acceleration_gain(
    system: LinearSystem, boxes: Boxes, duration: float, influence: Array | None = None
) -> Array:
    """Return bounds of accelerations over a box, for one unit of the ground's integrated one.

    Args:
        system: The structure; its outputs take absolute accelerations alone.
        boxes: Boxes of its inputs; the widest one counts.
        duration: Time in s up to which the bounds hold.
        influence: ι of a further component of the ground motion, shape (unknowns,); that of the
            structure unless given.

    Returns:
        Bounds in 1/s, shape (outputs,): times the largest |∫₀ᵗ δ dτ| they bound the outputs of all
        structures in the box under the ground acceleration δ, from rest.

    Raises:
        UnprovedError: Damping couples the modes or is too strong, and is not known to dissipate.
    """
    low, high = boxes.lower[0], boxes.upper[0]
    assembly = system.assembly(parameters_over_box(system, boxes.names, low, high))
    if influence is not None:
        assembly = replace(assembly, pattern=influence)
    parts = _Parts.of(assembly)
    try:
        return parts.by_modes()
    except UnprovedError as reason:
        try:
            require_dissipation(system, boxes)
            return parts.by_energy(duration)
        except UnprovedError as other:
            raise UnprovedError(f"{reason}; {other}") from None


@dataclass(frozen=True, eq=False)
class _Parts:
    """Parts of a structure's bounds over a box, for n unknowns with mass and m outputs.

    Args:
        assembly: The structure.
        mass: M, shape (n, n).
        stiffness: K without condensation, shape (n, n).
        loads: M⁻¹ rᵀ of all outputs, shape (n, m).
        influence: ι as a column, shape (n, 1).
        moved: Bound of ιᵀ M ι.
        strain: Bound of ιᵀ K ι, over all unknowns.
    """

    assembly: Assembly[TaylorModel]
    mass: TaylorModel
    stiffness: TaylorModel
    loads: TaylorModel
    influence: Array
    moved: float
    strain: float

    @classmethod
    def of(cls, assembly: Assembly[TaylorModel]) -> _Parts:
        """Return the parts; raise UnprovedError if the mass may be singular in the box."""
        massive = assembly.massive
        mass = assembly.mass[massive[:, np.newaxis], massive]
        every = assembly.pattern[:, np.newaxis]
        return cls(
            assembly=assembly,
            mass=mass,
            stiffness=assembly.stiffness[massive[:, np.newaxis], massive],
            loads=solve(mass, mass.like(assembly.accelerated[:, massive].T)),
            influence=every[massive],
            moved=_form(every[massive], mass)[0],
            strain=_form(every, assembly.stiffness)[0],
        )

    @property
    def _inverse_masses(self) -> Array:
        """Bounds of r M⁻¹ rᵀ, shape (m,)."""
        rows = self.assembly.accelerated[:, self.assembly.massive]
        return _diagonal(rows @ self.loads)

    def by_modes(self) -> Array:
        """Return the bounds by modes, shape (m,).

        Raises:
            UnprovedError: Damping couples the modes, or their damping ratios are not known to lie
                above 0 and up to 0.9.
        """
        low, high = self._damping_ratios()
        if not 0 < low <= high <= MAX_RATIO:
            what = f"damping ratios of {low:.3g} to {high:.3g}"
            raise UnprovedError(what, f"above 0 and up to {MAX_RATIO:g} can be proved")
        # The factor is convex in ζ, so that it is largest at an end.
        ratios = np.array([low, high])
        factor = float(((1 + 1 / ratios) / np.sqrt(1 - ratios**2)).max())
        by_strain = self._inverse_masses * self.strain
        by_mass = _form(self.loads, self.stiffness) * self.moved
        return np.asarray(factor * np.sqrt(np.minimum(by_strain, by_mass)))

    def by_energy(self, duration: float) -> Array:
        """Return the bounds by energy, shape (m,); that damping is dissipative is not checked."""
        assembly = self.assembly
        massive = assembly.massive[:, np.newaxis], assembly.massive
        a, b = assembly.rayleigh
        damping = assembly.dashpots[massive] + self.mass * a + assembly.springs[massive] * b
        by_ratios = 2 * max((float(ratio.bounds()[1]) for ratio in assembly.ratios), default=0.0)
        dissipated = _form(self.influence, damping)[0]
        dissipated += by_ratios * np.sqrt(self.moved * self.strain)
        speed = np.sqrt(self.strain) * duration + np.sqrt(dissipated * duration / 2)
        forces = damping @ self.loads
        of_damping = _diagonal(forces.T @ solve(self.mass, forces))
        size = (1 + by_ratios) * np.sqrt(_form(self.loads, self.stiffness)) + np.sqrt(of_damping)
        direct = (forces.T @ self.influence).magnitude()[:, 0]
        direct += by_ratios * np.sqrt(self._inverse_masses * self.strain)
        return np.asarray(size * speed + direct)

    def _damping_ratios(self) -> tuple[float, float]:
        """Return bounds of the damping ratios of all modes.

        They are ζ + a/(2 ω) + b ω/2 for Rayleigh's factors a, b, of which the first two terms need
        bounds of ω: ω² is an eigenvalue of M⁻¹ K, and 1/ω² of K⁻¹ M, and so at most a norm of them.

        Raises:
            UnprovedError: Dashpots, or weights beside damping by springs, couple the modes, or the
                stiffness may be singular in the box.
        """
        assembly = self.assembly
        factors = [model.bounds() for model in assembly.rayleigh]
        (a_low, a_high), (b_low, b_high) = (tuple(map(float, ends)) for ends in factors)
        if assembly.dashpots.magnitude().any():
            raise UnprovedError("dashpots couple the modes")
        if assembly.weights is not None and b_high > 0:
            raise UnprovedError("damping by the springs without the weights couples the modes")
        ends = [ratio.bounds() for ratio in assembly.ratios]
        low = min((float(end[0]) for end in ends), default=0.0)
        high = max((float(end[1]) for end in ends), default=0.0)
        if a_high > 0 or b_high > 0:
            fastest = np.sqrt(_row_sum(solve(self.mass, self.stiffness)))
            slowest = 1 / np.sqrt(_row_sum(solve(assembly.stiffness, assembly.mass)))
            a_low, b_low = max(a_low, 0.0), max(b_low, 0.0)
            low += max(np.sqrt(a_low * b_low), a_low / (2 * fastest), b_low * slowest / 2)
            high += max(a_high, 0.0) / (2 * slowest) + b_high * fastest / 2
        return low, high


def _form(vectors: TaylorModel | Array, matrix: TaylorModel) -> Array:
    """Return bounds of vᵀ A v for the columns v of an array (n, m), shape (m,)."""
    return _diagonal(vectors.T @ (matrix @ vectors))


def _diagonal(matrix: TaylorModel) -> Array:
    """Return bounds of the magnitudes on the diagonal of a square matrix (m, m), shape (m,)."""
    return np.asarray(matrix.magnitude().diagonal())


def _row_sum(matrix: TaylorModel) -> float:
    """Return a bound of the largest sum of magnitudes in a row, which no eigenvalue exceeds."""
    return float(matrix.magnitude().sum(axis=1).max())
