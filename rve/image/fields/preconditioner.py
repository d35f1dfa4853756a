"""Inverse of the operator of one constant material, by Fourier transform.

A constant isotropic material looks the same after an inversion of the plane. So, with the place of
each unknown in its phase and a factor i for unknowns that change sign, the blocks are real and
symmetric. It also looks the same after a reflection: half of the blocks give the others by changes
of sign.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft

from alphacut.rve.image.fields.element import Element
from alphacut.stochastic.theta.truncated_normal import Array

Complex = np.ndarray[tuple[int, ...], np.dtype[np.complex128]]


@dataclass(frozen=True)
class FourierPreconditioner:
    """Inverse of the constant-coefficient operator on a periodic grid.

    Args:
        inverse: Real blocks at wave numbers 0 … half of those along y, shape (half, types, types,
            waves along x).
        phases: Unit factors of the types, along y with shape (types, rows), along x with shape
            (types, waves along x).
        shape: Rows and columns of the grid.
    """

    inverse: Array
    phases: tuple[Complex, Complex]
    shape: tuple[int, int]

    @classmethod
    def of(
        cls, element: Element, bulk: float, shear: float, shape: tuple[int, int]
    ) -> FourierPreconditioner:
        """The preconditioner for a material of coefficients `bulk` and `shear`."""
        ky, kx = 2 * np.pi * np.fft.fftfreq(shape[0]), 2 * np.pi * np.fft.rfftfreq(shape[1])
        half = np.abs(ky[: shape[0] // 2 + 1])
        blocks = np.moveaxis(symbol(element, bulk, shear, half, kx), (0, 1), (-2, -1))
        inverse = np.empty((len(half), element.types, element.types, len(kx)))
        for row, block in enumerate(blocks):
            inverse[row] = np.moveaxis(_inverted(block, row == 0), 0, -1)
        return cls(inverse, phase_factors(element, ky, kx), shape)

    def apply(self, fields: Array) -> Array:
        """The inverse on fields of shape (…, types, rows, columns)."""
        spectrum = fft.rfft2(fields)
        flat = spectrum.reshape(-1, *spectrum.shape[-3:])
        along_y, along_x = self.phases
        for row in range(self.shape[0]):
            factor = along_y[:, row, None] * along_x
            turned = flat[..., row, :] * factor.conj()
            parts = np.stack([turned.real, turned.imag])
            result = np.einsum("abf,cnbf->cnaf", self.inverse[min(row, self.shape[0] - row)], parts)
            turned.real, turned.imag = result
            np.multiply(turned, factor, out=flat[..., row, :])
        return np.asarray(fft.irfft2(spectrum, s=self.shape, overwrite_x=True))


def _inverted(blocks: Array, first: bool) -> Array:
    """Symmetric inverses of blocks, shape (waves, types, types); uniform fields cause nothing."""
    inverse = np.empty_like(blocks)
    inverse[0] = (
        np.linalg.pinv(blocks[0], rcond=1e-10, hermitian=True)
        if first
        else np.linalg.inv(blocks[0])
    )
    inverse[1:] = np.linalg.inv(blocks[1:])
    return np.asarray(inverse + np.swapaxes(inverse, 1, 2)) / 2


def symbol(element: Element, bulk: float, shear: float, ky: Array, kx: Array) -> Array:
    """Real symmetric blocks of the constant operator, shape (types, types, len(ky), len(kx))."""
    modes, rows = element.modes, element.bulk_rows
    matrix = bulk * modes[:rows].T @ modes[:rows] + shear * modes[rows:].T @ modes[rows:]
    steps = np.arange(-2, 3) / 2
    table = np.zeros((element.types, element.types, 5, 5))
    for j, a in enumerate(element.local_types):
        for k, b in enumerate(element.local_types):
            y, x = np.rint(2 * (element.positions[k] - element.positions[j])).astype(int) + 2
            table[a, b, y, x] += matrix[j, k]
    waves_y, waves_x = np.exp(1j * np.outer(ky, steps)), np.exp(1j * np.outer(steps, kx))
    result = np.empty((element.types, element.types, len(ky), len(kx)))
    for a, b in np.ndindex(element.types, element.types):
        factor = (-1j if element.odd[a] else 1) * (1j if element.odd[b] else 1)
        result[a, b] = (factor * (waves_y @ table[a, b] @ waves_x)).real
    return result


def phase_factors(element: Element, ky: Array, kx: Array) -> tuple[Complex, Complex]:
    """Factors of the types along y and along x: the wave at the place in the pixel.

    The block at −ky is the one at ky with the signs of those types changed that change sign under a
    reflection of y.
    """
    along_y = np.empty((element.types, len(ky)), complex)
    along_x = np.empty((element.types, len(kx)), complex)
    for kind, (component, y, x, order_y, _) in enumerate(element.functionals):
        reflected = (component + order_y) % 2 == 1
        along_y[kind] = (
            np.exp(1j * ky * y)
            * (1j if element.odd[kind] else 1)
            * np.where((ky < 0) & reflected, -1, 1)
        )
        along_x[kind] = np.exp(1j * kx * x)
    return along_y, along_x
