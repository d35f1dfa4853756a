"""Inverse of the operator of one constant material, by Fourier transform; the spectrum it leaves.

With t the trace and d the deviator of a periodic fluctuation, ∫d² − ∫t² is the square of its
rotation for a displacement and zero for a stress of Airy's function. So a part of the coefficient
of d may stand with that of t, and of the other way round for stresses: the energy of one material
is at least the smaller of s/s₀ and (b + s)/(b₀ + s₀) times that of another, b being the coefficient
of t and s that of d. For displacements these are the moduli of shear and of longitudinal waves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from alphacut.fuzzy.arrays import Array
from alphacut.rve.image.fields.element import Element

Complex = NDArray[np.complex128]
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
    def between(cls, trace: Array, deviator: Array, *, stress: bool) -> Reference:
        """The material in the middle of those of an image, so that the spectrum is narrow.

        Args:
            trace: Coefficients of the pixels, shape (rows, columns).
            deviator: Same shape.
            stress: Only the sum of the coefficients counts; the least material's shares then let
                the sum decide in `least` too.
        """
        bulk, shear = float(trace.min()), float(deviator.min())
        largest = float(np.sqrt((bulk + shear) * (trace.max() + deviator.max())))
        middle = float(np.sqrt(shear * deviator.max()))
        if stress:
            middle = largest * shear / (bulk + shear)
        return cls(largest - middle, middle)

    def least(self, trace: Array, deviator: Array) -> float:
        """Energy of fluctuations of an image over that in this material, at least."""
        bulk, shear = float(trace.min()), float(deviator.min())
        ratios = shear / self.deviator, (bulk + shear) / (self.trace + self.deviator)
        return min(ratios) * (1 - ROUNDING)


@dataclass(frozen=True, eq=False)
class FourierPreconditioner:
    """Inverse of the constant-coefficient operator on a periodic grid.

    Args:
        inverse: Hermitian blocks, shape (unknowns, unknowns, rows, waves along x).
        shape: Rows and columns of the grid.
    """

    inverse: Complex
    shape: tuple[int, int]

    @classmethod
    def of_material(
        cls, element: Element, constant: Reference, shape: tuple[int, int]
    ) -> FourierPreconditioner:
        """The preconditioner for a constant material; uniform fields cause nothing."""
        ky, kx = 2 * np.pi * np.fft.fftfreq(shape[0]), 2 * np.pi * np.fft.rfftfreq(shape[1])
        blocks = symbol(element, constant, ky, kx)
        uniform = np.linalg.pinv(blocks[0, 0], rcond=1e-10, hermitian=True)
        blocks[0, 0] = np.eye(element.unknowns)
        inverse = np.linalg.inv(blocks)
        inverse[0, 0] = uniform
        inverse += np.conj(np.swapaxes(inverse, -1, -2))
        return cls(np.ascontiguousarray(np.moveaxis(inverse / 2, (-2, -1), (0, 1))), shape)

    def apply(self, fields: Array) -> Array:
        """The inverse on fields of shape (loads, unknowns, rows, columns)."""
        spectrum = np.einsum("abyx,nbyx->nayx", self.inverse, fft.rfft2(fields))
        return np.asarray(fft.irfft2(spectrum, s=self.shape, overwrite_x=True))


def symbol(element: Element, constant: Reference, ky: Array, kx: Array) -> Complex:
    """Hermitian blocks of the operator, shape (len(ky), len(kx), unknowns, unknowns)."""
    trace, deviator = (element.modes[part].T @ element.modes[part] for part in element.parts)
    matrix = constant.trace * trace + constant.deviator * deviator
    kind, up, right = np.array(element.local).T
    table = np.zeros((3, 3, element.unknowns, element.unknowns))  # by the distance in pixels
    rise, run = up - up[:, None] + 1, right - right[:, None] + 1
    np.add.at(table, (rise, run, kind[:, None], kind), matrix)
    waves_y, waves_x = (np.exp(1j * np.outer(k, (-1, 0, 1))) for k in (ky, kx))
    return np.asarray(np.einsum("yr,xs,rsab->yxab", waves_y, waves_x, table, optimize=True))
