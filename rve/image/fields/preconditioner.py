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

from alphacut.fuzzy.arrays import Array
from alphacut.rve.image.fields.element import Element
from alphacut.rve.image.fields.reference import Reference

Complex = np.ndarray[tuple[int, ...], np.dtype[np.complex128]]


@dataclass(frozen=True, eq=False)
class FourierPreconditioner:
    """Inverse of the constant-coefficient operator on a periodic grid.

    Args:
        inverse: Real blocks at wave numbers 0 … half of those along y, shape (half, unknowns,
            unknowns, waves along x).
        phases: Unit factors of the unknowns, along y with shape (unknowns, rows), along x with
            shape (unknowns, waves along x).
        shape: Rows and columns of the grid.
    """

    inverse: Array
    phases: tuple[Complex, Complex]
    shape: tuple[int, int]

    @classmethod
    def of(
        cls, element: Element, constant: Reference, shape: tuple[int, int]
    ) -> FourierPreconditioner:
        """The preconditioner for a constant material."""
        ky, kx = 2 * np.pi * np.fft.fftfreq(shape[0]), 2 * np.pi * np.fft.rfftfreq(shape[1])
        half, count = np.abs(ky[: shape[0] // 2 + 1]), len(element.unknowns)
        inverse = np.empty((len(half), count, count, len(kx)))
        for row, block in enumerate(symbol(element, constant, half, kx)):
            inverse[row] = np.moveaxis(_inverted(block, row == 0), 0, -1)
        return cls(inverse, phase_factors(element, ky, kx), shape)

    def apply(self, fields: Array) -> Array:
        """The inverse on fields of shape (loads, unknowns, rows, columns)."""
        spectrum = fft.rfft2(fields)
        along_y, along_x = self.phases
        for row in range(self.shape[0]):
            factor = along_y[:, row, None] * along_x
            turned = spectrum[..., row, :] * factor.conj()
            parts = np.stack([turned.real, turned.imag])
            result = np.einsum("abf,cnbf->cnaf", self.inverse[min(row, self.shape[0] - row)], parts)
            turned.real, turned.imag = result
            np.multiply(turned, factor, out=spectrum[..., row, :])
        return np.asarray(fft.irfft2(spectrum, s=self.shape, overwrite_x=True))


def _inverted(blocks: Array, first: bool) -> Array:
    """Symmetric inverses of blocks, (waves, unknowns, unknowns); uniform fields cause nothing."""
    inverse = np.empty_like(blocks)
    uniform = np.linalg.pinv(blocks[:1], rcond=1e-10, hermitian=True)
    inverse[:1] = uniform if first else np.linalg.inv(blocks[:1])
    inverse[1:] = np.linalg.inv(blocks[1:])
    return np.asarray(inverse + np.swapaxes(inverse, 1, 2)) / 2


def symbol(element: Element, constant: Reference, ky: Array, kx: Array) -> Array:
    """Real symmetric blocks of the operator, shape (len(ky), len(kx), unknowns, unknowns)."""
    trace, deviator = (element.modes[part].T @ element.modes[part] for part in element.parts)
    matrix = constant.trace * trace + constant.deviator * deviator
    count, steps = len(element.unknowns), np.arange(-2, 3) / 2
    table = np.zeros((count, count, 5, 5))  # by the distance of two unknowns in half pixels
    places = [np.add(element.unknowns[kind].place, shift) for kind, *shift in element.local]
    for j, k in np.ndindex(matrix.shape):
        y, x = np.rint(2 * (places[k] - places[j])).astype(int) + 2
        table[element.local[j][0], element.local[k][0], y, x] += matrix[j, k]
    waves_y, waves_x = np.exp(1j * np.outer(ky, steps)), np.exp(1j * np.outer(steps, kx))
    turn = np.array([1j if unknown.odd else 1 for unknown in element.unknowns])
    factor = (turn.conj()[:, None] * turn)[..., None, None]
    return np.moveaxis((factor * (waves_y @ table @ waves_x)).real, (0, 1), (-2, -1))


def phase_factors(element: Element, ky: Array, kx: Array) -> tuple[Complex, Complex]:
    """Factors of the unknowns along y and along x: the wave at the place in the pixel.

    The block at −ky is the one at ky with the signs of those unknowns changed that change sign
    under a reflection of y.
    """
    along_y, along_x = [], []
    for unknown in element.unknowns:
        (y, x), (slope, _) = unknown.place, unknown.slopes
        reflected = (unknown.component + slope) % 2 == 1
        sign = np.where((ky < 0) & reflected, -1, 1)
        along_y.append(np.exp(1j * ky * y) * (1j if unknown.odd else 1) * sign)
        along_x.append(np.exp(1j * kx * x))
    return np.array(along_y), np.array(along_x)
