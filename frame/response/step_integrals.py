"""Integrals of a step, J_n = ∫₀ʰ τⁿ exp(σ τ) dτ for n = 0 … 3, at every σ h.

With z = σ h and φ_n(z) = ∫₀¹ sⁿ exp(z s) ds, J_n = hⁿ⁺¹ φ_n(z), and by parts

    φ_n = (exp(z) − n φ_{n−1}) / z.

This recurrence divides rounding by |z| in each step and multiplies it by n, so that it serves from
|z| = `FROM_RECURRENCE` on; below, the power series Σ z^k / (k! (n + 1 + k)) does, whose terms fall
at once. Far to the left exp(z) is 0 and the recurrence gives n! / (−z)ⁿ⁺¹. To the right the
integrals grow like exp(z) and are scaled by it: z reaches up to `LARGEST_GROWTH`.
"""

from __future__ import annotations

import numpy as np

from alphacut.frame.calculus.kernels import compiled
from alphacut.frame.calculus.rounding import UNIT_ROUNDOFF
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.fuzzy.arrays import Array

TERMS = 26
"""Terms of the power series; from |z| ≤ 2 the rest is below 2²⁶/26! = 2e-19."""
FROM_RECURRENCE = 2.0
"""|z| from which the recurrence is used. It loses 3! / 2³ of a digit there, the series exp(2)."""
LARGEST_TURN = 1e8
"""|σ h| at most: beyond, rounding of the phase σ h alone passes 1e-8."""
LARGEST_GROWTH = 700.0
"""Re σ t at most: exp(709.8) is the largest floating-point number."""
ERROR_OF_INTEGRALS = 12.0
"""Error of φ_n at small |z| and Re z ≤ 0 at most, in u / (n + 1); a test reaches 6."""


def require_in_range(sigma: Array, step: float, duration: float) -> None:
    """Refuse exponents σ (1/s) whose responses are not computed to round-off.

    Args:
        sigma: Exponents.
        step: Longest interval h over which they are integrated at once, in s.
        duration: Time over which they may grow, in s.

    Raises:
        UnprovedError: An exponent is not finite, |σ h| passes `LARGEST_TURN`, or
            exp(σ t) grows by more than exp(`LARGEST_GROWTH`).
    """
    turn = float(np.abs(sigma).max(initial=0.0)) * step
    growth = float(sigma.real.max(initial=-np.inf)) * duration
    if not (turn <= LARGEST_TURN and growth <= LARGEST_GROWTH):
        raise UnprovedError(
            f"a motion turns by {turn:.3g} rad within {step:g} s and grows by exp({growth:.3g})"
            f" within {duration:g} s; allowed: {LARGEST_TURN:g} rad, exp({LARGEST_GROWTH:g})",
            "take a shorter step of the record, or less stiff members",
        )


@compiled
def step_integrals(sigma: complex, h: float, out: Array) -> None:
    """Write J_n = ∫₀ʰ τⁿ exp(σ τ) dτ, n = 0 … 3, to `out` (4,); see `require_in_range` for σ h."""
    z = sigma * h
    if abs(z) < FROM_RECURRENCE:
        for n in range(4):
            term = 1.0 + 0.0j
            total = term / (n + 1)
            for k in range(1, TERMS):
                term *= z / k
                total += term / (n + 1 + k)
            out[n] = total * h ** (n + 1)
        return
    grown = np.exp(z)
    integral = (grown - 1.0) / z
    out[0] = integral * h
    for n in range(1, 4):
        integral = (grown - n * integral) / z
        out[n] = integral * h ** (n + 1)


@compiled
def error_of_integrals(sigma: complex, h: float) -> float:
    """Return a bound of the rounding of J₀ and of 2 J₁ / h, J_n = ∫₀ʰ τⁿ exp(σ τ) dτ, in s.

    From |σ h| = `FROM_RECURRENCE` on it is less than that at σ = 0: the rounding of exp(σ h), whose
    phase is rounded by u |σ h|, and of the sums, both over |σ h|.
    """
    size, growth = abs(sigma) * h, sigma.real * h
    factor = 1.0
    if size >= FROM_RECURRENCE:
        factor = min(1.0, np.exp(min(growth, 0.0)) / 4 + 4 / size)
    return ERROR_OF_INTEGRALS * UNIT_ROUNDOFF * h * factor * np.exp(max(growth, 0.0))
