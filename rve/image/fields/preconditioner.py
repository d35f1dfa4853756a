"""Inverse of the operator of one constant material, by Fourier transform; the spectrum it leaves.

With t the trace and d the deviator of a periodic fluctuation, ∫d² = c ∫t² (`trace_in_deviator`)
plus a third square. So a part of the coefficient of d may stand with that of t: the energy of one
material is at least the smaller of s/s₀ and (b + c s)/(b₀ + c s₀) times that of another, b being
the coefficient of t and s that of d. For displacements these are the moduli of shear and of
longitudinal waves.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType

import numpy as np
import scipy.fft

from alphacut.base.arrays import Array
from alphacut.rve.image.fields.element import Element
from alphacut.rve.image.fields.grid import Fields, namespace, slabs
from alphacut.rve.image.fields.kernels import multiply_by_blocks

ROUNDING = 1e-3  # of the preconditioner
GAUGE = 1e-6
"""Part of a block's trace below which potentials count as without stress: at 16³ voxels stresses
have 1e-5 of it or more, rounding 1e-16. A larger one costs iterations; no bound rests on it."""


@dataclass(frozen=True)
class Reference:
    """One constant material: coefficients of trace and deviator, the latter positive.

    `part` is the element's `trace_in_deviator`.
    """

    trace: float
    deviator: float
    part: float

    @classmethod
    def of_grid(cls, element: Element, trace: Fields, deviator: Fields) -> Reference:
        """Constant material at the geometric mean of a grid's extremes, for a narrow spectrum."""
        part = element.trace_in_deviator
        (min_trace, max_trace), (min_deviator, max_deviator) = (
            (float(x.min()), float(x.max())) for x in (trace, deviator)
        )
        min_sum = min_trace + part * min_deviator
        mean_sum = float(np.sqrt(min_sum * (max_trace + part * max_deviator)))
        mean_deviator = float(np.sqrt(min_deviator * max_deviator))
        if element.stress and element.dimension == 2:  # where nothing is left beside the trace
            mean_deviator = mean_sum * min_deviator / min_sum
        return cls(mean_sum - part * mean_deviator, mean_deviator, part)

    def lowest_energy_ratio(self, trace: Fields, deviator: Fields) -> float:
        """Lower bound of the energy of fluctuations in a grid over that in this material."""
        bulk, shear = float(trace.min()), float(deviator.min())
        sums = bulk + self.part * shear, self.trace + self.part * self.deviator
        return min(shear / self.deviator, sums[0] / sums[1]) * (1 - ROUNDING)


@dataclass(frozen=True, eq=False)
class FourierPreconditioner:
    """Inverse of the constant-coefficient operator on a periodic grid.

    A cell is alike where space is mirrored at a point, so that blocks are real once each unknown is
    taken at its place in the cell, and odd ones times i: half the memory of Hermitian blocks.

    Voxels are transformed in single precision: each application is off by 1e-7 of the residual
    then, and by less than `ROUNDING` of its energy, however small the residual has become.

    Args:
        inverse: Real symmetric blocks, shape (unknowns, unknowns, *waves); along x the waves are
            those of a real transform; times the scale.
        phases: exp(i k·place), by i for odd unknowns, along each axis; they broadcast to
            (unknowns, *waves).
        shape: Shape of the grid.
        scale: Magnitude of a material of voxels, a power of two; 1 for pixels.
    """

    inverse: Fields
    phases: tuple[Fields, ...]
    shape: tuple[int, ...]
    scale: float

    @classmethod
    def of_material(
        cls, element: Element, constant: Reference, shape: tuple[int, ...], xp: ModuleType = np
    ) -> FourierPreconditioner:
        """Inverse operator of a constant material; what has no energy has a pseudo-inverse."""
        waves = [2 * np.pi * np.fft.fftfreq(size) for size in shape[:-1]]
        waves.append(2 * np.pi * np.fft.rfftfreq(shape[-1]))
        n, phases = element.unknowns, []
        is_odd = np.array([odd for _, odd in element.places])
        for axis, k in enumerate(waves):
            places = [place[axis] for place, _ in element.places]
            phase = (
                np.exp(1j * np.outer(places, k)) * np.where(is_odd & (axis == 0), 1j, 1)[:, None]
            )
            ones = (1,) * (len(shape) - 1 - axis)
            phases.append(xp.asarray(phase.reshape(n, *(1,) * axis, k.size, *ones)))
        # what does not vary from cell to cell: of splines alone it has no energy but rounding
        uniform = fourier_blocks(element, constant, [k[:1] for k in waves]).real.reshape(n, n)
        greatest = float(np.sum(element.magnitude**2)) * max(constant.trace, constant.deviator)
        first_block = np.zeros((n, n))
        if np.linalg.norm(uniform, 2) > GAUGE * greatest:
            first_block = np.linalg.pinv(uniform, rcond=1e-10, hermitian=True)
        first_wave = (0,) * len(shape)
        kind, scale = xp.float64, 1.0
        if element.dimension == 3:
            kind, scale = xp.float32, float(2.0 ** np.round(np.log2(constant.deviator)))
        inverse = xp.empty((n, n, *(k.size for k in waves)), dtype=kind)
        for slab in slabs(inverse):
            phase = xp.moveaxis(_product(phases, slab), 0, -1)
            symbol = fourier_blocks(element, constant, [waves[0][slab], *waves[1:]], xp)
            real = (xp.conj(phase)[..., :, None] * symbol * phase[..., None, :]).real
            if slab.start == 0:
                real[first_wave] = xp.eye(n)  # set below
            # pixels' blocks span many orders of energy at long waves, and have no gauge
            has_gauge = element.stress and element.dimension == 3
            solved = _pseudo_inverse(xp, real) if has_gauge else xp.linalg.inv(real)
            solved = xp.moveaxis((solved + xp.swapaxes(solved, -1, -2)) / 2, (-2, -1), (0, 1))
            if slab.start == 0:
                solved[(slice(None), slice(None), *first_wave)] = xp.asarray(first_block)
            inverse[:, :, slab] = scale * solved
        return cls(inverse, tuple(phases), shape, scale)

    def apply(self, fields: Fields) -> Fields:
        """The inverse on fields of shape (loads, unknowns, *grid)."""
        xp = namespace(fields)
        axes = tuple(range(2, fields.ndim))
        fft = scipy.fft if isinstance(fields, np.ndarray) else xp.fft
        if self.scale != 1:
            fields = (fields / self.scale).astype(self.inverse.dtype)
        spectrum = fft.rfftn(fields, axes=axes)
        if isinstance(fields, np.ndarray) and len(self.shape) == 3:
            blocks, waves = (x.reshape(*x.shape[:2], -1) for x in (self.inverse, spectrum))
            multiply_by_blocks(blocks, waves)  # places are alike: no phases
            return fft.irfftn(spectrum, s=self.shape, axes=axes).astype(float, copy=False)
        for slab in slabs(spectrum):
            phase = _product(self.phases, slab)
            part = xp.conj(phase) * spectrum[:, :, slab]
            spectrum[:, :, slab] = phase * xp.einsum(
                "ab...,nb...->na...", self.inverse[:, :, slab], part
            )
        return fft.irfftn(spectrum, s=self.shape, axes=axes).astype(float, copy=False)


def _product(phases: tuple[Fields, ...] | list[Fields], slab: slice) -> Fields:
    """Product of the phases along the axes, in a slab of the first."""
    result = phases[0][:, slab]
    for phase in phases[1:]:
        result = result * phase
    return result


def _pseudo_inverse(xp: ModuleType, blocks: Fields) -> Fields:
    """Inverse of symmetric positive blocks, (…, n, n), and nearly none of what has no energy.

    Potentials without stress have none. With X = (B + ε)⁻¹ they are large in X and gone in X B X.
    """
    size = blocks.shape[-1]
    trace = xp.einsum("...ii->...", blocks)[..., None, None]
    inverse = xp.linalg.inv(blocks + GAUGE * trace * xp.eye(size))
    return inverse @ blocks @ inverse


def fourier_blocks(
    element: Element, constant: Reference, waves: list[Array], xp: ModuleType = np
) -> Fields:
    """Fourier symbol of a constant material at waves per cell, (*waves, unknowns, unknowns)."""
    # forms of the strain's trace and of its deviator on a cell
    trace, deviator = (element.modes[part].T @ element.modes[part] for part in element.parts)
    matrix = constant.trace * trace + constant.deviator * deviator
    unknown = np.array([u for u, _ in element.local])
    offsets = np.array([offset for _, offset in element.local])
    reach = element.reach
    # coupling of unknowns a and b of cells at a distance from −reach to reach along each axis
    coupling = np.zeros((2 * reach + 1,) * len(waves) + (element.unknowns,) * 2)
    steps = np.moveaxis(offsets - offsets[:, None] + reach, -1, 0)
    np.add.at(coupling, (*steps, unknown[:, None], unknown), matrix)
    symbol = xp.asarray(coupling)
    for k in waves:  # each turns the first axis, a distance, into the last but two, a wave
        factors = xp.asarray(np.exp(1j * np.outer(k, np.arange(-reach, reach + 1))))
        symbol = xp.moveaxis(xp.tensordot(factors, symbol, axes=1), 0, len(waves) - 1)
    return symbol
