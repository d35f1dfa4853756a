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
    """One constant material: coefficients of trace and deviator, positive."""

    trace: float
    deviator: float

    @classmethod
    def of_image(cls, trace: Array, deviator: Array, *, stress: bool) -> Reference:
        """Constant material at the geometric mean of an image's extremes, for a narrow spectrum."""
        min_trace, min_deviator = float(trace.min()), float(deviator.min())
        min_sum, max_sum = min_trace + min_deviator, trace.max() + deviator.max()
        mean_sum = float(np.sqrt(min_sum * max_sum))
        mean_deviator = float(np.sqrt(min_deviator * deviator.max()))
        if stress:
            mean_deviator = mean_sum * min_deviator / min_sum
        return cls(mean_sum - mean_deviator, mean_deviator)

    def lowest_energy_ratio(self, trace: Array, deviator: Array) -> float:
        """Lower bound of the energy of fluctuations in an image over that in this material."""
        bulk, shear = float(trace.min()), float(deviator.min())
        ratios = shear / self.deviator, (bulk + shear) / (self.trace + self.deviator)
        return min(ratios) * (1 - ROUNDING)


@dataclass(frozen=True, eq=False)
class FourierPreconditioner:
    """Inverse of the constant-coefficient operator on a periodic grid of `shape` (rows, columns).

    `inverse` has Hermitian blocks, shape (unknowns, unknowns, rows, waves along x).
    """

    inverse: Complex
    shape: tuple[int, int]

    @classmethod
    def of_material(
        cls, element: Element, constant: Reference, shape: tuple[int, int]
    ) -> FourierPreconditioner:
        """Inverse operator of a constant material; its rigid fields have a pseudo-inverse."""
        ky, kx = 2 * np.pi * np.fft.fftfreq(shape[0]), 2 * np.pi * np.fft.rfftfreq(shape[1])
        blocks = fourier_blocks(element, constant, ky, kx)
        pseudo_inverse = np.linalg.pinv(blocks[0, 0], rcond=1e-10, hermitian=True)
        blocks[0, 0] = np.eye(element.unknowns)
        inverse = np.linalg.inv(blocks)
        inverse[0, 0] = pseudo_inverse
        hermitian = (inverse + np.conj(np.swapaxes(inverse, -1, -2))) / 2
        return cls(np.ascontiguousarray(np.moveaxis(hermitian, (-2, -1), (0, 1))), shape)

    def apply(self, fields: Array) -> Array:
        """The inverse on fields of shape (loads, unknowns, rows, columns)."""
        spectrum = np.einsum("abyx,nbyx->nayx", self.inverse, fft.rfft2(fields))
        return np.asarray(fft.irfft2(spectrum, s=self.shape, overwrite_x=True))


def fourier_blocks(element: Element, constant: Reference, ky: Array, kx: Array) -> Complex:
    """Fourier symbol of a constant material at waves per pixel, (ky, kx, unknowns, unknowns)."""
    # forms of the strain's trace and of its deviator on a pixel
    trace, deviator = (element.modes[part].T @ element.modes[part] for part in element.parts)
    matrix = constant.trace * trace + constant.deviator * deviator
    # of each local unknown: its number in the pixel to which it belongs, rows up, columns right
    unknown, up, right = np.array(element.local).T
    # coupling of unknowns a and b of pixels whose distance in rows and columns is −1, 0 or 1
    coupling = np.zeros((3, 3, element.unknowns, element.unknowns))
    row_step, column_step = up - up[:, None] + 1, right - right[:, None] + 1
    np.add.at(coupling, (row_step, column_step, unknown[:, None], unknown), matrix)
    waves_y, waves_x = (np.exp(1j * np.outer(k, (-1, 0, 1))) for k in (ky, kx))
    return np.asarray(np.einsum("yr,xs,rsab->yxab", waves_y, waves_x, coupling, optimize=True))
