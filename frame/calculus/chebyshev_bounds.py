"""Ranges of polynomials over the unit box, bounded by the sizes of their Chebyshev coefficients."""

from __future__ import annotations

from dataclasses import dataclass
from math import prod

import numpy as np
from scipy.fft import dctn

from alphacut.frame.calculus.jet import Array


@dataclass(frozen=True)
class ChebyshevGrid:
    """The Gauss–Chebyshev points on which a polynomial of given degrees is known by its values.

    Args:
        degrees: Largest exponent along each axis, d of them.
    """

    degrees: tuple[int, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Points along each axis."""
        return tuple(degree + 1 for degree in self.degrees)

    def __len__(self) -> int:
        return prod(self.shape)

    @property
    def points(self) -> Array:
        """All points, shape (S, d)."""
        axes = [np.cos(np.pi * (np.arange(n) + 0.5) / n) for n in self.shape]
        return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(axes))

    def coefficients(self, values: Array) -> Array:
        """Chebyshev coefficients of values (S, …), same shape, the constant first.

        Since no product exceeds 1 on the box, Σ ‖c_j‖ bounds ‖polynomial‖ there, for any norm.
        """
        out = dctn(
            values.reshape(*self.shape, -1), type=2, axes=range(len(self.shape)), overwrite_x=True
        ) / len(self)
        for axis in range(len(self.shape)):
            out[(slice(None),) * axis + (0,)] /= 2
        coefficients: Array = out.reshape(values.shape)
        return coefficients
