"""Periodic displacements on a grid of voxels, derived and preconditioned by Fourier transform.

Trigonometric polynomials with collocation in the voxels' centres (Moulinec & Suquet, Comput.
Methods Appl. Mech. Engrg. 157, 69, 1998). The number of voxels along an edge is odd, so no wave is
its own mirror image.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft

from alphacut.stochastic.theta.truncated_normal import Array
from benchmarks.rve.voxels.laminate import PAIRS

Waves = np.ndarray[tuple[int, ...], np.dtype[np.complex128]]  # half of a real field's spectrum


@dataclass(frozen=True, eq=False)
class FourierGrid:
    """Wave numbers of an odd grid and the Green operator of one isotropic material.

    Args:
        waves: Wave vectors, shape (3, n, n, n // 2 + 1), in 1/voxel.
        shear: Shear modulus μ of the material, in Pa.
        along: (λ + μ)/(λ + 2 μ) of it.
    """

    waves: Array
    shear: float
    along: float

    @classmethod
    def of(cls, grid: int, lame: float, shear: float) -> FourierGrid:
        """The grid with `grid` voxels along an edge and a material of λ and μ, in Pa."""
        whole, half = 2 * np.pi * np.fft.fftfreq(grid), 2 * np.pi * np.fft.rfftfreq(grid)
        waves = np.stack(np.meshgrid(whole, whole, half, indexing="ij"))
        return cls(waves, shear, (lame + shear) / (lame + 2 * shear))

    @property
    def size(self) -> int:
        """Voxels along an edge."""
        return int(self.waves.shape[1])

    def strain(self, motion: Waves) -> Array:
        """Strain, shape (6, n, n, n), of a displacement (3, …) by its waves."""
        q = self.waves
        parts = np.stack([1j / 2 * (q[i] * motion[j] + q[j] * motion[i]) for i, j in PAIRS])
        return np.asarray(fft.irfftn(parts, s=(self.size,) * 3, axes=(1, 2, 3), overwrite_x=True))

    def force(self, stress: Array) -> Waves:
        """Minus divergence of a stress, by waves, shape (3, …): the adjoint of `strain`."""
        s = fft.rfftn(stress, axes=(1, 2, 3))
        q = self.waves
        rows = ((0, 5, 4), (5, 1, 3), (4, 3, 2))
        return np.stack([-1j * sum(q[j] * s[k] for j, k in enumerate(row)) for row in rows])

    def green(self, force: Waves) -> Waves:
        """Displacement of the uniform material under a force, without its mean."""
        square = (self.waves**2).sum(axis=0)
        square[0, 0, 0] = np.inf
        straight = self.along * (self.waves * force).sum(axis=0) / square
        return np.asarray((force - self.waves * straight) / (self.shear * square))

    def inner(self, first: Waves, second: Waves) -> float:
        """Mean over the cell of the product of two real fields, by waves."""
        product = (first.conj() * second).real
        total = 2 * product.sum() - product[..., 0].sum()
        return float(total) / self.size**6
