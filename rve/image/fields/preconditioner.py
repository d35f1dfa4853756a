"""Inverse of the operator of one constant material, by Fourier transform; the spectrum it leaves.

With t the trace and d the deviator of a periodic strain or stress, ∫d² = c ∫t²
(`trace_in_deviator`) plus a third square. So a part of the coefficient of d may stand with that of
t: the energy of one material is at least the smaller of s/s₀ and (b + c s)/(b₀ + c s₀) times that
of another, b being the coefficient of t and s that of d. For displacements these are the moduli of
shear and of longitudinal waves. Of conduction there is one coefficient, whose ratio is that of the
energies.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from alphacut.base.arrays import Array
from alphacut.rve.image.fields.element import Element
from alphacut.rve.image.fields.grid import Fields, namespace, slabs

GAUGE = 1e-6
"""Fraction of the trace of a block below which potentials count as without stress: at 16³ voxels
stresses have 1e-5 of it or more, rounding 1e-16. A larger one costs iterations; no bound rests on
it."""


@dataclass(frozen=True)
class Reference:
    """A constant material.

    Args:
        coefficients: Coefficient of the square of each of the element's parts: trace and deviator,
            of which the latter is positive; or one positive number of conduction.
        trace_in_deviator: The element's number c of this name.
    """

    coefficients: tuple[float, ...]
    trace_in_deviator: float

    @classmethod
    def of_grid(cls, element: Element, coefficients: Sequence[Fields]) -> Reference:
        """Return the constant material of a preconditioner, between the extremes of a grid.

        Let b and s be the coefficients of the squared trace and deviator, and c the largest number
        with ∫ deviator² ≥ c ∫ trace² for all fluctuations. The ratios of s and of b + c s in the
        grid to those in the material bound the spectrum. The material has the geometric means of
        their extremes in the grid, which make the spectrum narrow.

        Args:
            element: Element of the fields, which knows c.
            coefficients: Coefficients b, not negative, and s, positive, in each cell; or the one of
                conduction; of the grid's shape.

        Returns:
            The material's coefficients, and c.
        """
        c = element.trace_in_deviator
        trace = coefficients[0]
        deviator = coefficients[-1]
        if element.conduction:
            return cls((float(np.sqrt(trace.min() * trace.max())),), c)
        min_deviator = float(deviator.min())
        max_deviator = float(deviator.max())
        min_sum = float(trace.min()) + c * min_deviator
        max_sum = float(trace.max()) + c * max_deviator
        mean_sum = float(np.sqrt(min_sum * max_sum))
        mean_deviator = float(np.sqrt(min_deviator * max_deviator))
        # For the stress of the plane ∫ deviator² = c ∫ trace² exactly, so that b + c s alone
        # counts; s then keeps the ratio of the grid's smallest coefficients.
        if element.dual and element.dimension == 2:
            mean_deviator = mean_sum * min_deviator / min_sum
        return cls((mean_sum - c * mean_deviator, mean_deviator), c)

    def min_energy_ratio(self, coefficients: Sequence[Fields]) -> float:
        """Return a lower bound of the energy of fluctuations in a grid over that in this material.

        For a fluctuation ∫ deviator² = c ∫ trace² + a third square, with the number c of
        `self.trace_in_deviator`. So its energy is (b + c s) ∫ trace² + s times the third square,
        with the coefficients b of the trace and s of the deviator; the ratio of two materials is at
        least the smaller ratio of s and of b + c s. It is reduced by .001, more than the rounding
        of a preconditioner in single precision.

        Args:
            coefficients: Coefficients of the squares of trace, not negative, and deviator,
                positive, in each cell; or the one of conduction; of the grid's shape.
        """
        rounding = 1e-3
        c = self.trace_in_deviator
        least = [float(coefficient.min()) for coefficient in coefficients]
        ratio = least[-1] / self.coefficients[-1]
        if len(least) == 2:
            trace, deviator = self.coefficients
            ratio = min(ratio, (least[0] + c * least[1]) / (trace + c * deviator))
        return ratio * (1 - rounding)


@dataclass(frozen=True, eq=False)
class FourierPreconditioner:
    """Inverse of the constant-coefficient operator on a periodic grid.

    A cell is alike where space is mirrored at a point. So the blocks of the Fourier symbol are real
    once each unknown is taken at its place in the cell, and odd unknowns times i: this takes half
    the memory of Hermitian blocks.

    Voxels are transformed in single precision: each application is off by 1e-7 of the residual
    then, and by less than 1e-3 of its energy, however small the residual has become.

    Args:
        inverse: Real symmetric blocks, times the scale, shape (unknowns, unknowns, *waves). Along x
            the waves are those of a real transform.
        phases: exp(i k·place), times i for odd unknowns, shape (unknowns, *waves).
        shape: Shape of the grid.
        scale: Magnitude of a material of voxels, a power of two; 1 for pixels.
    """

    inverse: Fields
    phases: Fields
    shape: tuple[int, ...]
    scale: float

    @classmethod
    def of_material(
        cls, element: Element, constant: Reference, shape: tuple[int, ...], xp: ModuleType = np
    ) -> FourierPreconditioner:
        """Return the inverse of the stiffness operator of a constant material on a periodic grid.

        Fields without energy, such as potentials without stress, have a pseudo-inverse.

        Args:
            element: Element of the fields.
            constant: The material.
            shape: Numbers of cells along each axis of the grid, (y, x) or (z, y, x).
            xp: Module of the library of the arrays that the inverse is applied to.

        Returns:
            Object with `inverse`, real blocks by wave number, shape (unknowns, unknowns, *waves),
            and `phases` of the unknowns, which make them real, shape (unknowns, *waves). Both are
            in double precision for pixels, and in single precision for voxels, where blocks are
            multiplied by `scale`, a power of two.
        """
        waves = [2 * np.pi * np.fft.fftfreq(size) for size in shape[:-1]]
        waves.append(2 * np.pi * np.fft.rfftfreq(shape[-1]))
        # Blocks of pixels span many orders of energy at long waves: they need doubles. Voxels have
        # coarser grids, and take half the memory and time.
        real_type = xp.float64
        complex_type = xp.complex128
        scale = 1.0
        if element.dimension == 3:
            real_type = xp.float32
            complex_type = xp.complex64
            scale = float(2.0 ** np.round(np.log2(constant.coefficients[-1])))
        first_block = _block_of_uniform_fields(element, constant, waves)
        n = element.unknowns
        half = *shape[:-1], waves[-1].size
        inverse = xp.empty((n, n, *half), dtype=real_type)
        phases = xp.empty((n, *half), dtype=complex_type)
        # Six potentials in space are more than stresses need, and three more than fluxes need: some
        # fields of potentials have no stress or flux, and so no energy.
        has_gauge = element.dual and element.dimension == 3
        for slab in slabs(inverse):
            slab_waves = [waves[0][slab], *waves[1:]]
            phase = _phases(element, slab_waves, xp)
            symbol = fourier_blocks(element, constant, slab_waves, xp)
            blocks = (xp.conj(phase)[..., :, None] * symbol * phase[..., None, :]).real
            if slab.start == 0:
                blocks[(0,) * len(shape)] = xp.eye(n)  # replaced by `first_block` below
            solved = _pseudo_inverse(xp, blocks) if has_gauge else xp.linalg.inv(blocks)
            solved = (solved + xp.swapaxes(solved, -1, -2)) / 2
            if slab.start == 0:
                solved[(0,) * len(shape)] = xp.asarray(first_block)
            inverse[:, :, slab] = scale * xp.moveaxis(solved, (-2, -1), (0, 1))
            phases[:, slab] = xp.moveaxis(phase, -1, 0)
        return cls(inverse, phases, shape, scale)

    def apply(self, fields: Fields) -> Fields:
        """Return the inverse of the operator applied to fields, by fast Fourier transforms.

        For voxels it is in single precision: off by 1e-7 of the argument.

        Args:
            fields: Nodal forces, shape (fields, unknowns of a cell, *grid), with the grid that the
                inverse was made for.

        Returns:
            New array of doubles in the shape of `fields`.
        """
        import scipy.fft  # takes time to import

        xp = namespace(fields)
        axes = tuple(range(2, fields.ndim))
        # SciPy transforms several axes faster than NumPy, and takes no arrays of a device.
        fft = scipy.fft if isinstance(fields, np.ndarray) else xp.fft
        scaled = (fields / self.scale).astype(self.inverse.dtype)
        spectrum = xp.conj(self.phases) * fft.rfftn(scaled, axes=axes)
        spectrum = self.phases * xp.einsum("ab...,nb...->na...", self.inverse, spectrum)
        return fft.irfftn(spectrum, s=self.shape, axes=axes).astype(float, copy=False)


def _phases(element: Element, waves: Sequence[Array], xp: ModuleType) -> Fields:
    """Return exp(i k·place) of each unknown of a cell, times i for odd unknowns.

    With these phases the blocks of the Fourier symbol are real. An unknown is odd if it changes its
    sign when space is mirrored at a point, as a slope does.

    Args:
        element: Element, with the place of each unknown in its cell.
        waves: Wave numbers k along each axis of the grid, in radians per cell, shape (waves,) each.
        xp: Module of the result's array library.

    Returns:
        Complex array of shape (*waves along each axis, unknowns of a cell).
    """
    phases = xp.asarray(np.where(element.is_odd, 1j, 1.0))
    for axis, k in enumerate(waves):
        along_axis = np.exp(1j * np.outer(k, element.places[:, axis]))  # (waves, unknowns)
        phases = phases[..., None, :] * xp.asarray(along_axis)
    return phases


def _block_of_uniform_fields(
    element: Element, constant: Reference, waves: Sequence[Array]
) -> Array:
    """Return the pseudo-inverse of the Fourier block of fields that do not vary from cell to cell.

    In space such fields have no energy but rounding; the result is then zero.

    Args:
        element: Element of the fields.
        constant: The constant material.
        waves: Wave numbers along each axis of the grid, whose first one is 0; only that is used.

    Returns:
        Symmetric matrix of shape (unknowns of a cell, unknowns of a cell).
    """
    n = element.unknowns
    block = fourier_blocks(element, constant, [k[:1] for k in waves]).real.reshape(n, n)
    # The sum of the squared entries of a matrix M is at least the largest eigenvalue of MᵀM. It is
    # the scale of what counts as no energy.
    max_energy = float(np.sum(element.magnitude**2)) * max(constant.coefficients)
    if np.linalg.norm(block, 2) <= GAUGE * max_energy:
        return np.zeros((n, n))
    # In a plane's block, fields without energy have eigenvalues of 1e-16 of the largest one, by
    # rounding; the others had 1e-8 or more at sides of ratio 100. No bound rests on the limit.
    return np.asarray(np.linalg.pinv(block, rcond=1e-10, hermitian=True))


def _pseudo_inverse(xp: ModuleType, blocks: Fields) -> Fields:
    """Return nearly the pseudo-inverse of symmetric positive semidefinite blocks B.

    It is X B X with X = (B + ε)⁻¹, where ε is 1e-6 of the trace of each block. For potentials with
    energy this is near B⁻¹; for those without stress, which have no energy, it vanishes.

    Args:
        xp: Module of the array library of `blocks`.
        blocks: Blocks B, real, not zero, shape (…, n, n).

    Returns:
        New array of the shape of `blocks`.
    """
    size = blocks.shape[-1]
    trace = xp.einsum("...ii->...", blocks)[..., None, None]
    inverse = xp.linalg.inv(blocks + GAUGE * trace * xp.eye(size))
    return inverse @ blocks @ inverse


def fourier_blocks(
    element: Element, constant: Reference, waves: Sequence[Array], xp: ModuleType = np
) -> Fields:
    """Return the Fourier symbol of the stiffness operator of a constant material on a grid.

    A field u(cell) = exp(i k·cell) U has the nodal forces exp(i k·cell) S(k) U with the block S(k).

    Args:
        element: Element of the fields.
        constant: The constant material.
        waves: Wave numbers k along each axis of the grid, in radians per cell, shape (waves,) each.
        xp: Module of the result's array library.

    Returns:
        Hermitian blocks, shape (*waves along each axis, unknowns of a cell, unknowns of a cell).
    """
    # energy of the local unknowns of a cell
    matrix = np.zeros((len(element.local), len(element.local)))
    for rows, coefficient in zip(element.parts, constant.coefficients, strict=True):
        matrix += coefficient * element.modes[rows].T @ element.modes[rows]
    unknown = np.array([local.unknown for local in element.local])
    offsets = np.array([local.offset for local in element.local])
    reach = element.reach
    # coupling of unknowns a and b of cells at a distance from −reach to reach along each axis
    coupling = np.zeros((2 * reach + 1,) * len(waves) + (element.unknowns,) * 2)
    distances = np.moveaxis(offsets - offsets[:, None] + reach, -1, 0)
    np.add.at(coupling, (*distances, unknown[:, None], unknown), matrix)
    symbol = xp.asarray(coupling)
    for k in waves:  # each turns the first axis, a distance, into the last but two, a wave
        factors = xp.asarray(np.exp(1j * np.outer(k, np.arange(-reach, reach + 1))))
        symbol = xp.moveaxis(xp.tensordot(factors, symbol, axes=1), 0, len(waves) - 1)
    return symbol
