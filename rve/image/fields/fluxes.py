"""Fluxes of two points beside insulators: a lower bound of the conductivity wherever pores are.

Between neighbouring voxels flows what two resistors in series let through, with the harmonic mean
of their conductivities; temperatures of voxels balance the fluxes. So fluxes vanish at insulators,
whether these percolate or not. In a voxel the flux is linear along each axis between those of its
two faces (Raviart and Thomas 1977), so that nothing arises or vanishes inside. It is exactly so:
fluxes are whole multiples of a power of two, and what is left of the balance is swept down the
trees of `forest`. The theory pages say why this bound is above the value of finite volumes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import FailedError
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient, System
from alphacut.rve.image.fields.energy import (
    COEFFICIENT,
    SAFETY,
    UNIT,
    Energies,
    bound_of_trials,
)
from alphacut.rve.image.fields.forest import Forest, sweep_fluxes, unit_of
from alphacut.rve.image.fields.grid import Fields
from alphacut.rve.image.fields.preconditioner import FourierPreconditioner
from alphacut.rve.image.fields.split import SideSolution


def solve_fluxes(
    conductivity: Array,
    sides: Sequence[float],
    *,
    solver: ConjugateGradient,
    start: Fields | None = None,
) -> SideSolution:
    """Return fluxes without sources that vanish in insulators, and the bound that they prove.

    Args:
        conductivity: Conductivity of each voxel, finite, 0 in insulators, shape (y, x) or (z, y,
            x).
        sides: Sides of a voxel along these axes, over that along x.
        solver: Solver of the temperatures with its stopping rule. How far it gets changes the
            bound, but not its validity.
        start: Temperatures to start from, in the shape of the result's fields; None for zero.

    Returns:
        `fields`, temperatures of voxels for a mean drop of 1 from voxel to voxel along each axis,
        shape (axes, 1, *grid), and `bound`, below the conductivity in the Loewner order, with the
        components x, y and, in space, z. A direction in which nothing percolates has 0 there.

    Raises:
        FailedError: The solver does not converge.
    """
    links = _links(conductivity, sides)
    fields = _temperatures(links, solver, start)
    trees = Forest.of_mask(conductivity > 0)
    flowing = np.empty((len(links), *links.shape))  # (load, axis, *grid)
    for load, temperature in enumerate(fields[:, 0]):
        for axis, link in enumerate(links):
            flowing[load, axis] = link * (np.roll(temperature, -1, axis) - temperature)
        flowing[load, load] += links[load]
    # One unit serves all loads: what rounding leaves of a load that nothing carries stays small.
    unit = unit_of(max(links.max(), abs(flowing).max()) or 1.0)
    fluxes = np.rint(flowing / unit).astype(int).reshape(len(links), len(links), -1)
    for whole in fluxes:
        sweep_fluxes(trees.shape, trees.order, trees.parents, whole)
        _require_balance(whole.reshape(links.shape))
    means, energy = _means_and_energy(fluxes, unit, conductivity, sides)
    # The axes of the grid are (z, y, x), those of the tensor x, y, z.
    return SideSolution(fields, bound_of_trials(means, energy)[::-1, ::-1], True)


def _links(conductivity: Array, sides: Sequence[float]) -> Array:
    """Return the flux through each upper face at a drop of 1, over the side along its axis.

    That is the harmonic mean of two voxels over the square of the side; 0 beside insulators. Axis
    by axis such fluxes balance where their plain sums over the faces of a voxel do.

    Returns:
        Array of shape (axes, *grid).
    """
    links = np.zeros((conductivity.ndim, *conductivity.shape))
    for axis, side in enumerate(sides):
        above = np.roll(conductivity, -1, axis)
        is_open = (conductivity > 0) & (above > 0)
        # of sums of resistances, since a product of two conductivities might overflow
        resistance = 1 / conductivity[is_open] + 1 / above[is_open]
        links[axis, is_open] = 2 / (resistance * side**2)
    return links


def _temperatures(links: Array, solver: ConjugateGradient, start: Fields | None) -> Fields:
    """Return temperatures of voxels that balance the fluxes under a mean drop along each axis.

    Args:
        links: Flux through the upper face of each voxel at a drop of 1, shape (axes, *grid).
        solver: Solver with its stopping rule.
        start: First guess, in the shape of the result; None for zero.

    Returns:
        Array of shape (loads, 1, *grid); 0 in voxels without an open face.

    Raises:
        FailedError: The solver does not converge.
    """
    axes = range(len(links))
    is_linked = sum(link + np.roll(link, 1, axis) for axis, link in enumerate(links)) > 0

    def balance(x: Fields) -> Fields:
        """Return what flows out of each voxel, with minus sign, at given temperatures."""
        total = np.zeros_like(x)
        for axis in axes:
            flux = links[axis] * (np.roll(x, -1, axis + 2) - x)
            total -= flux
            total += np.roll(flux, 1, axis + 2)
        return total

    # The preconditioner is the inverse in a homogeneous grid without insulators, taken at the
    # linked voxels alone: it solves for the extension of least energy into the others.
    of_axis = [link[link > 0] for link in links]
    flat = np.concatenate(of_axis)
    if not flat.size:
        return np.zeros((len(links), 1, *links.shape[1:]))
    typical = float(np.sqrt(flat.min() * flat.max()))
    means = [float(np.sqrt(x.min() * x.max())) if x.size else typical for x in of_axis]
    inverse = _homogeneous_inverse(means, links.shape[1:])
    fields = np.zeros((len(links), 1, *links.shape[1:]))
    for axis in axes:
        system = System(
            operator=balance,
            preconditioner=lambda residual: is_linked * inverse.apply(residual),
            load=(links[axis] - np.roll(links[axis], 1, axis))[np.newaxis, np.newaxis],
            scale=float(links[axis].sum()),
            # No bound of the spectrum is known beside insulators. This fraction of the smallest
            # conductivity's is a guess, on which accuracy alone depends.
            min_energy_ratio=0.03
            * min(x.min() / m for x, m in zip(of_axis, means, strict=True) if x.size),
            start=None if start is None else start[axis : axis + 1],
        )
        fields[axis : axis + 1] = solver.solve(system)
    return fields


def _homogeneous_inverse(links: Sequence[float], shape: tuple[int, ...]) -> FourierPreconditioner:
    """Return the inverse of the balance of a grid with one link for each axis."""
    symbol: Array = np.zeros(())
    for axis, link in enumerate(links):
        real = axis == len(links) - 1
        frequencies = np.fft.rfftfreq(shape[axis]) if real else np.fft.fftfreq(shape[axis])
        symbol = symbol[..., np.newaxis] + link * (2 - 2 * np.cos(2 * np.pi * frequencies))
    symbol[(0,) * len(shape)] = np.inf  # a constant temperature needs no flux
    scale = float(2.0 ** np.round(np.log2(max(links))))
    precision = np.float32 if len(shape) == 3 else np.float64
    inverse = (scale / symbol).astype(precision)[np.newaxis, np.newaxis]
    phases = np.ones((1, *symbol.shape), np.complex64 if len(shape) == 3 else np.complex128)
    return FourierPreconditioner(inverse, phases, shape, scale)


def _require_balance(fluxes: Ints) -> None:
    """Raise a FailedError unless whole fluxes of shape (axes, *grid) balance in every voxel.

    With magnitudes below 2⁵² sums of six are exact, and the fluxes and twice them are doubles.
    """
    excess = sum(flux - np.roll(flux, 1, axis) for axis, flux in enumerate(fluxes))
    if np.any(excess) or not np.abs(fluxes).max() < 1 << 52:
        what = "fluxes beside insulators do not balance"
        raise FailedError(f"the proof is wrong: {what}", "keep the case and report it")


def _means_and_energy(
    fluxes: Ints, unit: float, conductivity: Array, sides: Sequence[float]
) -> tuple[Array, Energies]:
    """Return the mean fluxes along the axes, and the mean of flux²/conductivity of all pairs.

    In a voxel with the fluxes a and b through the faces of an axis the mean square is
    (a² + a b + b²)/3 = ((a + b)/2)² + (a − b)²/12.

    Args:
        fluxes: Whole fluxes over the side along their axis, below 2⁵², shape (loads, axes, voxels).
        unit: Their unit, a power of two.
        conductivity: Conductivity of each voxel, shape (y, x) or (z, y, x).
        sides: Sides of a voxel along these axes.

    Returns:
        Means, each off by at most 4 rounding units, shape (axes, loads); and the energies.
    """
    shape = conductivity.shape
    cells = conductivity.size
    loads = len(fluxes)
    by_load = fluxes.reshape(loads, len(sides), *shape)
    weight = np.divide(1.0, conductivity, out=np.zeros(shape), where=conductivity > 0)
    value = np.zeros((loads, loads))
    for layer in range(shape[0]):
        for axis, side in enumerate(sides):
            above = by_load[:, axis, layer]
            below = by_load[:, 0, layer - 1] if axis == 0 else np.roll(above, 1, axis)
            for part, factor in ((above + below, side**2 / 4), (above - below, side**2 / 12)):
                mode = part.reshape(loads, -1).astype(float)
                value += (factor * weight[layer].ravel() * mode) @ mode.T
    value *= unit**2 / cells
    # Each product has fewer than 8 roundings, with those of the coefficient; see `energies`.
    additions = cells // shape[0] + 2 * len(sides) * shape[0]
    summed = SAFETY * (additions + COEFFICIENT + 8) * UNIT
    # Sums of halves of 26 bits are exact: there are fewer than 2³⁷ voxels.
    low = fluxes & ((1 << 26) - 1)
    high = (fluxes - low) >> 26
    totals = high.sum(axis=2).astype(object) * (1 << 26) + low.sum(axis=2).astype(object)
    means = totals.astype(float).T * unit * np.array(sides)[:, np.newaxis] / cells
    energy = Energies((value + value.T)[np.newaxis] / 2, np.zeros((1, loads)), summed)
    return means, energy
