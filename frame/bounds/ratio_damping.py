"""Defects of modes under one damping ratio ζ, D = D₀ + 2 ζ M √(M⁻¹K), which is no polynomial.

For any number μ > 0 and vector w, in the norm of M⁻¹,
‖2 ζ M √(M⁻¹K) w − 2 ζ √μ M w‖ ≤ 2 ζ / (√λ + √μ) ‖(K − μ M) w‖ with λ the least eigenvalue of K
against M. With polynomials μ and σ ≈ √μ the motion is measured with 2 ζ σ M w in place of the
damping; the rest is bounded by this and by |√μ − σ| ≤ |μ − σ²| / (√μ + σ).

The acceleration of a floor of mass m holds the damping force f on it over m, at most ‖f‖ / √m in
the norm of M⁻¹. Of a velocity v it is at most 2 ζ ω ‖v‖ / √m, in the norm of M, with the largest
frequency ω.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.polynomial import Polynomial, fit
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modal.fitting import analyse, fit_points
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.structures import polynomial_dependence


class LoewnerBounds:
    """Symmetric matrix A(p) against its mean A₀ = L Lᵀ: lowest A₀ ≤ A(p) ≤ highest A₀.

    Args:
        coefficients: Chebyshev coefficients of A, shape (J, N, N), the mean first.

    Attributes:
        factor: L, shape (N, N).

    Raises:
        UnprovedError: A(p) is not shown to stay positive definite.
    """

    def __init__(self, coefficients: Array) -> None:
        try:
            factor = np.linalg.cholesky(coefficients[0])
        except np.linalg.LinAlgError:
            raise UnprovedError(
                "the mean mass or stiffness matrix is not positive definite"
            ) from None
        inverse = np.linalg.inv(factor)
        spread = float(np.linalg.norm(np.abs(inverse @ coefficients[1:] @ inverse.T).sum(0), 2))
        if spread >= 1:
            raise UnprovedError(
                "the box is so wide that mass and stiffness are not shown to stay positive definite"
            )
        self.factor, self.lowest, self.highest = factor, 1 - spread, 1 + spread

    def least(self, base: LoewnerBounds) -> float:
        """Lower bound over the box of the eigenvalues μ of A x = μ B x, B the matrix of `base`.

        μ is at least lowest of A over highest of B times the least eigenvalue for A₀ and B₀.
        """
        middle = float(
            np.linalg.eigvalsh(
                np.linalg.solve(
                    base.factor, np.linalg.solve(base.factor, self.factor @ self.factor.T).T
                )
            )[0]
        )
        return self.lowest / base.highest * middle

    def most(self, base: LoewnerBounds) -> float:
        """Upper bound over the box of the eigenvalues μ of A x = μ B x, B the matrix of `base`."""
        between = np.linalg.solve(base.factor, self.factor)
        return self.highest / base.lowest * float(np.linalg.norm(between, 2)) ** 2

    def sup(self, coefficients: Array) -> float:
        """Bound of √(x* A x) over the box from the coefficients of x, shape (J, N)."""
        return float(
            np.sqrt(self.highest) * np.linalg.norm(coefficients @ self.factor, axis=-1).sum()
        )

    def sup_dual(self, coefficients: Array) -> float:
        """Bound of √(x* A⁻¹ x) over the box from the coefficients of x, shape (J, N)."""
        solved = np.linalg.solve(self.factor, coefficients.T)
        return float(np.linalg.norm(solved, axis=0).sum() / np.sqrt(self.lowest))


@dataclass(frozen=True, eq=False)
class RatioDamping:
    """The ratio of all modes and the polynomials that stand for their undamped frequencies.

    Args:
        ratio: ζ, a number, or the place of its parameter.
        largest: Its largest value in the box.
        model: The modal model.
        squared: μ_k ≈ |λ_k|², n polynomials.
        frequency: σ_k ≈ √μ_k, n polynomials.
    """

    ratio: float | int
    largest: float
    model: ModalModel
    squared: Polynomial
    frequency: Polynomial

    @classmethod
    def from_model(cls, model: ModalModel) -> Self | None:
        """Damping by a model's one ratio, with polynomials fitted; None if it has no ratio."""
        ratio = next(iter(model.flow.system.ratios), None)
        if ratio is None:
            return None
        value = model.flow.system.parameters[ratio] if isinstance(ratio, str) else ratio
        number_or_input: float | int = float(value)
        largest = float(value)
        if ratio in model.flow.names:
            index = model.flow.names.index(str(ratio))
            number_or_input, largest = index, float(model.boxes.upper[0, index])
        unit = fit_points(len(model.boxes.names), model.degree)
        rate = analyse(model.flow, model.boxes, unit, model.chosen).eigenvalue
        real, imaginary = rate.map(np.real), rate.map(np.imag)
        squared = real * real + imaginary * imaginary
        polynomials = (fit(unit, jet, model.degree) for jet in (squared, squared**0.5))
        return cls(number_or_input, largest, model, *polynomials)

    def defects(
        self, unit: Array, points: Array, speed: Array, M: Array, K: Array
    ) -> tuple[Array, dict[str, Array]]:
        """Polynomial damping force 2 ζ σ M w on each mode, and what bounds its error.

        Args:
            unit: Unit coordinates, shape (S, d).
            points: The same in SI units.
            speed: Velocities w of the modes, shape (S, n, N).
            M: Masses, shape (S, N, N).
            K: Stiffnesses, shape (S, N, N).

        Returns:
            The force, (S, n, N), and by name "residual" (K − μ M) w, (S, n, N), "root" μ − σ²,
            (S, n), and "speed" w; μ and σ are polynomials of the squared frequency and its root.
        """
        zeta = (
            points[:, self.ratio] if isinstance(self.ratio, int) else np.full(len(unit), self.ratio)
        )
        squared, frequency = self.squared(unit), self.frequency(unit)
        force = 2 * (zeta[:, None] * frequency)[..., None] * (speed @ M)
        residual = speed @ K - squared[..., None] * (speed @ M)
        return force, {"residual": residual, "root": squared - frequency**2, "speed": speed}

    def acceleration_gains(self, stiffness: LoewnerBounds, mass: LoewnerBounds) -> Array:
        """Bound of a floor's acceleration by the damping force over ‖v‖ in the norm of M, (m,)."""
        fastest = np.sqrt(stiffness.most(mass))
        return np.asarray(2 * self.largest * fastest / self.root_masses)

    @cached_property
    def root_masses(self) -> Array:
        """Root of the least floor mass over the box, of outputs that are its acceleration, (m,).

        It is ∞ of other outputs.
        """
        system, boxes = self.model.flow.system, self.model.boxes
        roots = np.full(len(self.model.outputs), np.inf)
        for row, floor in polynomial_dependence.accelerations(system).items():
            name, lower_ends = f"m{floor + 1}", dict(zip(boxes.names, boxes.lower[0], strict=True))
            roots[row] = np.sqrt(lower_ends.get(name, system.parameters[name]))
        return roots

    def damping_error(
        self, defect: dict[str, Array], mode: int, stiffness: LoewnerBounds, mass: LoewnerBounds
    ) -> float:
        """Bound of the error of a mode's polynomial damping force, in the norm of M⁻¹.

        2 ζ (|μ − σ²| / (√μ + σ) ‖w‖_M + ‖(K − μ M) w‖ / (√λ + √μ)), λ the least eigenvalue of K
        against M (module docstring); `defect` has Chebyshev coefficients of what `defects` returns.
        """
        root = np.sqrt(_lower_bounds(self.squared)[mode])
        root_error = float(np.abs(defect["root"][:, mode]).sum())
        root_error /= root + _lower_bounds(self.frequency)[mode]
        residual = mass.sup_dual(defect["residual"][:, mode])
        residual /= np.sqrt(stiffness.least(mass)) + root
        return float(
            2 * self.largest * (root_error * mass.sup(defect["speed"][:, mode]) + residual)
        )


def _lower_bounds(polynomial: Polynomial) -> Array:
    """Lower bounds of K real polynomials over the unit box, shape (K,).

    Raises:
        UnprovedError: One is not positive.
    """
    least: Array = polynomial.coefficients[0] - np.abs(polynomial.coefficients[1:]).sum(0)
    if not (least > 0).all():
        raise UnprovedError("the box is so wide that frequencies are not shown to stay positive")
    return least
