"""The operator of a periodic grid of pixels or voxels, in arrays of any library.

Fields have the shape (fields, unknowns, *grid), coefficients that of the grid. The work is done in
slabs along the first axis of the grid, which bound the memory. Arrays may be NumPy's or, on a
device, CuPy's.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from tempfile import TemporaryFile
from types import ModuleType
from typing import Any

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require
from alphacut.base.extras import install_command
from alphacut.rve.image.fields.element import Element
from alphacut.rve.image.fields.kernels import apply_by_rows
from alphacut.rve.image.memory import is_large

SLAB_CELLS = 6144
"""Cells times fields that are worked on at once: what the second cache holds. More are slower."""

Fields = Any
"""Array of NumPy or of a device."""


def finished_fields(shape: tuple[int, ...], grid: Sequence[int], kind: type = float) -> Array:
    """Return an array for fields that are solved one load after another, and then read once.

    That of a large grid lies in a file without a name in the folder of temporary files, and its
    pages take memory only while nothing else needs it.

    Args:
        shape: Its shape.
        grid: Shape of the grid of the fields.
        kind: Type of its numbers, of eight bytes.

    Raises:
        OSError: The folder has no room.
    """
    if not is_large(grid):
        return np.empty(shape, kind)
    with TemporaryFile() as file:
        # A mapping that is written where the disk is full would end the process.
        os.posix_fallocate(file.fileno(), 0, 8 * math.prod(shape))
        return np.asanyarray(np.memmap(file, np.dtype(kind), "r+", shape=shape))


def namespace(array: Fields) -> ModuleType:
    """Return the module of an array's library, with the functions of the array standard.

    NumPy's own module for its arrays; for CuPy's arrays the one in array_api_compat.
    ImportError without that package, TypeError for an object that is no array of any library.
    """
    if isinstance(array, np.ndarray):
        return np
    # Imported only for arrays of a device: the package is needed by nobody else.
    from array_api_compat import array_namespace

    library: ModuleType = array_namespace(array)
    return library


def on_host(array: Fields) -> Array:
    """Return an array of any library as NumPy's."""
    return np.asarray(array.get() if hasattr(array, "get") else array)


def device_array(device: str) -> Callable[[Array], Fields]:
    """Return the function that takes NumPy's arrays to a device.

    Args:
        device: "cpu", for the arrays as they are, or "cuda" for CuPy's arrays on the first device.

    Raises:
        RefusedError: Another name; or CuPy, array-api-compat, the driver or the device is missing.
    """
    if device == "cpu":
        return np.asarray
    require(device == "cuda", "device", value=device, allowed="cpu or cuda")
    cure = f"take cpu, or {install_command('cupy')} where an NVIDIA device is"
    try:
        import array_api_compat  # noqa: F401  # `namespace` needs it
        import cupy

        cupy.zeros(1)
    # CuPy raises errors of many kinds without a package, a driver or a device.
    except Exception as error:
        reason = str(error).splitlines()[0]
        raise RefusedError("device", f"cuda ({reason})", "cpu", cure) from None
    to_device: Callable[[Array], Fields] = cupy.asarray
    return to_device


@dataclass(frozen=True, eq=False)
class Operator:
    """Matrix of a grid: element matrices of each part of the modes times the part's coefficient.

    There is one coefficient for each of `element.parts`: of trace and deviator, or of a gradient or
    flux. All are positive and have the shape of the grid.
    """

    element: Element
    coefficients: Sequence[Fields]

    def apply(self, fields: Fields) -> Fields:
        """Return the nodal forces of fields, both of shape (fields, unknowns, *grid)."""
        if isinstance(fields, np.ndarray) and self.element.dimension == 3:
            no_modes = np.zeros((len(self.element.modes), len(fields)))
            return apply_by_rows(self.element, self.coefficients, fields, no_modes)
        return self.apply_by_matrices(fields)

    def apply_by_matrices(self, fields: Fields) -> Fields:
        """Return the nodal forces of fields by the element's matrices.

        This is the reference of the compiled kernels for voxels, and takes arrays of NumPy or CuPy.
        The forces are the derivatives of half the energy, the sum over the parts of coefficient
        times squared modes.

        Args:
            fields: Unknowns, shape (fields, unknowns of a cell, *grid), where the grid has the
                shape of the coefficients.

        Returns:
            New array in the shape of `fields`.
        """
        xp = namespace(fields)
        result = xp.zeros_like(fields)
        modes = [self.element.modes[rows] for rows in self.element.parts]
        matrix = xp.asarray(np.hstack([of_part.T @ of_part for of_part in modes]))
        for slab in slabs(fields):
            local = gather(self.element, fields, slab)
            # (trace Tᵀ T + deviator Dᵀ D) times the local unknowns of each cell, with the rows T
            # and D of the element's matrix to modes; likewise of one part
            weighted = xp.stack([coefficient[slab] * local for coefficient in self.coefficients])
            forces = matrix @ xp.reshape(weighted, (matrix.shape[1], -1))
            scatter(self.element, xp.reshape(forces, local.shape), result, slab)
        return result

    def load(self, mean_modes: Array) -> Fields:
        """Return minus the nodal forces of uniform fields: the load of their fluctuations.

        Args:
            mean_modes: Modes of the uniform fields, shape (modes, fields): coefficients of the
                element's parts in polynomials that are orthonormal on a cell.

        Returns:
            New array of shape (fields, unknowns of a cell, *grid), in the library of the
            coefficients.
        """
        grid = self.coefficients[0]
        xp = namespace(grid)
        count = mean_modes.shape[1]
        result = xp.zeros((count, self.element.unknowns, *grid.shape))
        if xp is np and self.element.dimension == 3:
            return apply_by_rows(self.element, self.coefficients, result, -mean_modes)
        ones = (1,) * self.element.dimension
        # Forces on the local unknowns of a cell with a coefficient of 1, alike for all cells.
        unit_forces = []
        for rows in self.element.parts:
            force = xp.asarray(-(self.element.modes[rows].T @ mean_modes[rows]))
            unit_forces.append(xp.reshape(force, (-1, count, *ones)))
        for slab in slabs(result):
            pairs = zip(unit_forces, self.coefficients, strict=True)
            forces = sum(force * coefficient[slab] for force, coefficient in pairs)
            scatter(self.element, forces, result, slab)
        return result


def slabs(fields: Fields) -> Iterator[slice]:
    """Yield slices of the first axis of the grid, which bound the memory of work on fields.

    Args:
        fields: Array of shape (fields, unknowns, *grid) whose grid has one axis or more.

    Yields:
        Slices that cover the axis in its order. Each has as many layers as make 6144 cells times
        fields in NumPy and 2²⁰ on a device, but one at least; the last one may be shorter.
    """
    layers = fields.shape[2]
    size = SLAB_CELLS
    if not isinstance(fields, np.ndarray):
        size = 1 << 20  # a device works on more at once; a larger number takes more than a few GB
    cells_of_layer = fields.shape[0] * math.prod(fields.shape[3:])
    count = max(1, size // cells_of_layer)
    for start in range(0, layers, count):
        yield slice(start, min(layers, start + count))


def gather(element: Element, fields: Fields, slab: slice) -> Fields:
    """Return the local unknowns of the cells of a slab: their own, and some of cells further on.

    Args:
        element: Element, whose local unknowns k are the unknown `local[k].unknown` of the cell that
            lies `local[k].offset` further along each axis of the periodic grid.
        fields: Unknowns, shape (fields, unknowns of a cell, *grid).
        slab: Slice of the first axis of the grid, with explicit ends.

    Returns:
        New array of shape (local unknowns, fields, layers of the slab, *rest of the grid).
    """
    xp = namespace(fields)
    local = xp.empty((len(element.local), *fields[:, 0, slab].shape))
    for k, (unknown, offset) in enumerate(element.local):
        layers = fields[:, unknown, _layers(slab, offset[0], fields.shape[2])]
        local[k] = _roll(xp, layers, [-shift for shift in offset[1:]])
    return local


def scatter(element: Element, forces: Fields, result: Fields, slab: slice) -> None:
    """Add the forces on the cells of a slab to the nodal forces of the periodic grid, in place.

    Args:
        element: Element, whose local unknowns k are the unknown `local[k].unknown` of the cell that
            lies `local[k].offset` further along each axis.
        forces: Forces on the local unknowns, shape (local unknowns, fields, layers of the slab,
            *rest of the grid).
        result: Nodal forces, shape (fields, unknowns of a cell, *grid); changed.
        slab: Slice of the first axis of the grid, with explicit ends.
    """
    xp = namespace(result)
    # A single indexed sum would add one force alone where several local unknowns are the same
    # unknown of the grid.
    for k, (unknown, offset) in enumerate(element.local):
        layers = _layers(slab, offset[0], result.shape[2])
        result[:, unknown, layers] += _roll(xp, forces[k], offset[1:])


def _layers(slab: slice, offset: int, size: int) -> slice | list[int]:
    """Return the layers of a slab moved along a periodic axis: a slice where none wraps."""
    # a slice is a view, a list of indices a copy
    start = slab.start + offset
    stop = slab.stop + offset
    return slice(start, stop) if stop <= size else [k % size for k in range(start, stop)]


def _roll(xp: ModuleType, layers: Fields, shifts: Sequence[int]) -> Fields:
    """Return an array rolled along its last axes, as it is where all shifts are zero."""
    if not any(shifts):
        return layers
    return xp.roll(layers, tuple(shifts), axis=tuple(range(-len(shifts), 0)))
