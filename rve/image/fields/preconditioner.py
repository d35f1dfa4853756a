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
from alphacut.rve.image.fields.element import Element, blocks

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

    A pixel is alike turned by 180°, so that blocks are real once each unknown is taken at its
    place in the pixel, and odd ones times i: half the memory of Hermitian blocks.

    Args:
        inverse: Real symmetric blocks, shape (unknowns, unknowns, rows, waves along x).
        phases: exp(i k·place), by i for odd unknowns, along y and x; they broadcast to
            (unknowns, rows, waves along x).
        shape: Rows and columns of the grid.
    """

    inverse: Array
    phases: tuple[Complex, Complex]
    shape: tuple[int, int]

    @classmethod
    def of_material(
        cls, element: Element, constant: Reference, shape: tuple[int, int]
    ) -> FourierPreconditioner:
        """Inverse operator of a constant material; its rigid fields have a pseudo-inverse."""
        ky, kx = 2 * np.pi * np.fft.fftfreq(shape[0]), 2 * np.pi * np.fft.rfftfreq(shape[1])
        y, x, is_odd = np.array(element.places).T
        along_y = np.exp(1j * (y[:, None, None] * ky[:, None] + np.pi / 2 * is_odd[:, None, None]))
        along_x = np.exp(1j * x[:, None, None] * kx)
        n = element.unknowns
        inverse = np.empty((n, n, ky.size, kx.size))
        for rows in blocks((n, n, ky.size, kx.size)):
            phase = np.moveaxis(along_y[:, rows] * along_x, 0, -1)
            symbol = fourier_blocks(element, constant, ky[rows], kx)
            real = (np.conj(phase)[..., :, None] * symbol * phase[..., None, :]).real
            if rows.start == 0:
                rigid = np.linalg.pinv(real[0, 0], rcond=1e-10, hermitian=True)
                real[0, 0] = np.eye(n)
            solved = np.linalg.inv(real)
            if rows.start == 0:
                solved[0, 0] = rigid
            symmetric = (solved + np.swapaxes(solved, -1, -2)) / 2
            inverse[:, :, rows] = np.moveaxis(symmetric, (-2, -1), (0, 1))
        return cls(inverse, (along_y, along_x), shape)

    def apply(self, fields: Array) -> Array:
        """The inverse on fields of shape (loads, unknowns, rows, columns)."""
        spectrum = fft.rfft2(fields)
        for rows in blocks(spectrum.shape):
            phase = self.phases[0][:, rows] * self.phases[1]
            part = np.conj(phase) * spectrum[:, :, rows]
            spectrum[:, :, rows] = phase * np.einsum(
                "abyx,nbyx->nayx", self.inverse[:, :, rows], part
            )
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
