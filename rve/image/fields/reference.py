"""The constant material of the preconditioner, and the spectrum that it leaves.

With t the trace and d the deviator of a periodic fluctuation, ∫d² − ∫t² is the square of its
rotation for a displacement and zero for a stress of Airy's function. So a part of the coefficient
of d may stand with that of t, and of the other way round for stresses: the energy of one material
is at least the smaller of s/s₀ and (b + s)/(b₀ + s₀) times that of another, b being the coefficient
of t and s that of d. For displacements these are the moduli of shear and of longitudinal waves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array

ROUNDING = 1e-3  # of the preconditioner


@dataclass(frozen=True)
class Reference:
    """One constant material.

    Args:
        trace: Coefficient of the trace, positive.
        deviator: Coefficient of the deviator, positive.
    """

    trace: float
    deviator: float

    @classmethod
    def between(cls, trace: Array, deviator: Array, *, exchange: bool) -> Reference:
        """The material in the middle of those of an image, so that the spectrum is narrow.

        Args:
            trace: Coefficients of the pixels, shape (rows, columns).
            deviator: Same shape.
            exchange: Only the sum of the coefficients counts (stresses); the least material's
                shares then let the sum decide in `least` too.
        """
        bulk, shear = float(trace.min()), float(deviator.min())
        whole = float(np.sqrt((bulk + shear) * (trace.max() + deviator.max())))
        middle = float(np.sqrt(shear * deviator.max()))
        if exchange:
            middle = whole * shear / (bulk + shear)
        return cls(whole - middle, middle)

    def least(self, trace: Array, deviator: Array) -> float:
        """Energy of fluctuations of an image over that in this material, at least."""
        bulk, shear = float(trace.min()), float(deviator.min())
        ratios = shear / self.deviator, (bulk + shear) / (self.trace + self.deviator)
        return min(ratios) * (1 - ROUNDING)
