"""The stiffness operator of a periodic grid of pixels or voxels, in arrays of any library.

Fields have the shape (loads, unknowns, *grid), coefficients that of the grid. The work is done in
slabs along the first axis of the grid, which bound the memory. Arrays may be NumPy's or, on a
device, CuPy's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require
from alphacut.rve.image.fields.element import Element
from alphacut.rve.image.fields.kernels import apply_by_rows

SLAB_CELLS = 6144  # cells times loads worked on at once: what the second cache holds
DEVICE_SLAB_CELLS = 1 << 20  # the same on a device, which has more to do at once: a few GB

Fields = Any
"""Array of NumPy or of a device."""


def namespace(array: Fields) -> ModuleType:
    """The library of an array, with the functions of the array standard."""
    if isinstance(array, np.ndarray):
        return np
    from array_api_compat import array_namespace

    library: ModuleType = array_namespace(array)
    return library


def on_host(array: Fields) -> Array:
    """The array as NumPy's, wherever it is."""
    return np.asarray(array.get() if hasattr(array, "get") else array)


def device_array(device: str) -> Callable[[Array], Fields]:
    """Function that takes NumPy's arrays to a device, "cpu" or "cuda".

    Raises:
        RefusedError: CuPy or a device is missing, or the name is another.
    """
    if device == "cpu":
        return np.asarray
    require(device == "cuda", "device", value=device, allowed="cpu or cuda")
    cure = "take cpu, or install cupy and array-api-compat where an NVIDIA device is"
    try:
        import array_api_compat  # noqa: F401  # `namespace` needs it
        import cupy

        cupy.zeros(1)
    except Exception as error:  # no package, no driver, no device
        reason = str(error).splitlines()[0]
        raise RefusedError("device", f"cuda ({reason})", "cpu", cure) from None
    to_device: Callable[[Array], Fields] = cupy.asarray
    return to_device


@dataclass(frozen=True, eq=False)
class Operator:
    """Stiffness of a grid: element matrices times coefficients of trace and deviator.

    Both coefficients are positive and have the shape of the grid.
    """

    element: Element
    trace: Fields
    deviator: Fields

    def apply(self, fields: Fields) -> Fields:
        """Nodal forces of fields, both of shape (loads, unknowns, *grid)."""
        if isinstance(fields, np.ndarray) and self.element.dimension == 3:
            none = np.zeros((len(self.element.modes), len(fields)))
            return apply_by_rows(self.element, self.trace, self.deviator, fields, none)
        return self.apply_by_matrices(fields)

    def apply_by_matrices(self, fields: Fields) -> Fields:
        """As `apply`, with the element's matrices, in any library: what kernels are judged by."""
        xp = namespace(fields)
        result = xp.zeros_like(fields)
        trace_modes, deviator_modes = (self.element.modes[rows] for rows in self.element.parts)
        matrix = np.hstack([trace_modes.T @ trace_modes, deviator_modes.T @ deviator_modes])
        matrix = xp.asarray(matrix)
        for slab in slabs(fields):
            local = gather(self.element, fields, slab)
            # (trace Tᵀ T + deviator Dᵀ D) times the local unknowns of each cell
            weighted = xp.stack([self.trace[slab] * local, self.deviator[slab] * local])
            forces = matrix @ xp.reshape(weighted, (matrix.shape[1], -1))
            scatter(self.element, xp.reshape(forces, local.shape), result, slab)
        return result

    def load(self, mean_modes: Fields) -> Fields:
        """Minus the nodal forces of mean modes (modes, loads), (loads, unknowns, *grid)."""
        xp = namespace(self.trace)
        shape = (mean_modes.shape[1], self.element.unknowns, *self.trace.shape)
        result = xp.zeros(shape)
        if xp is np and self.element.dimension == 3:
            return apply_by_rows(self.element, self.trace, self.deviator, result, -mean_modes)
        trace_force, deviator_force = (
            xp.reshape(
                xp.asarray(-(self.element.modes[part].T @ mean_modes[part])),
                (-1, shape[0]) + (1,) * self.element.dimension,
            )
            for part in self.element.parts
        )
        for slab in slabs(result):
            local = trace_force * self.trace[slab] + deviator_force * self.deviator[slab]
            scatter(self.element, local, result, slab)
        return result


def slabs(fields: Fields) -> Iterator[slice]:
    """Slices of the first axis of the grid, each of about `SLAB_CELLS` cells times loads."""
    first, *last_axes = fields.shape[2:]
    size = SLAB_CELLS if isinstance(fields, np.ndarray) else DEVICE_SLAB_CELLS
    count = max(1, size // (fields.shape[0] * math.prod(last_axes)))
    for start in range(0, first, count):
        yield slice(start, min(first, start + count))


def gather(element: Element, fields: Fields, slab: slice) -> Fields:
    """Local unknowns of the cells of a slab, shape (local unknowns, loads, *slab)."""
    xp = namespace(fields)
    first, *last_axes = fields.shape[2:]
    local = xp.empty((len(element.local), fields.shape[0], slab.stop - slab.start, *last_axes))
    for k, (unknown, offset) in enumerate(element.local):
        part = fields[:, unknown, _layers(slab, offset[0], first)]
        local[k] = _roll(xp, part, [-shift for shift in offset[1:]])
    return local


def scatter(element: Element, forces: Fields, result: Fields, slab: slice) -> None:
    """Adds element forces, (local unknowns, loads, *slab), to `result` (loads, unknowns, *grid)."""
    xp = namespace(result)
    for k, (unknown, offset) in enumerate(element.local):
        layers = _layers(slab, offset[0], result.shape[2])
        result[:, unknown, layers] += _roll(xp, forces[k], offset[1:])


def _layers(slab: slice, offset: int, size: int) -> slice | list[int]:
    """The layers of a slab moved by an offset along a periodic axis: a slice if none wraps."""
    start, stop = slab.start + offset, slab.stop + offset
    return slice(start, stop) if stop <= size else [k % size for k in range(start, stop)]


def _roll(xp: ModuleType, part: Fields, shifts: Any) -> Fields:
    """The part rolled along the last axes, where a shift is not zero."""
    if not any(shifts):
        return part
    return xp.roll(part, tuple(shifts), axis=tuple(range(-len(shifts), 0)))
