"""Displacements that reflections leave on the faces of one eighth of the cell.

Under axial strains each face moves along its normal only by what the strain asks for. Under ε12 the
reflections at x1 and x2 change the load's sign: there the tangential displacements are given.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from alphacut.fuzzy.arrays import Array
from alphacut.rve.interruption import uninterrupted

with uninterrupted():
    from dolfinx import fem

Faces = Mapping[tuple[int, int], Mapping[int, float]]
"""Face (axis, side) → displacement components given there, and their value at unit strain."""

AXIAL: Faces = {(axis, side): {axis: float(side)} for axis in range(3) for side in (0, 1)}
SHEAR: Faces = {
    **{(0, side): {1: side / 2, 2: 0.0} for side in (0, 1)},
    **{(1, side): {0: side / 2, 2: 0.0} for side in (0, 1)},
    **{(2, side): {2: 0.0} for side in (0, 1)},
}


@dataclass(frozen=True)
class Load:
    """One macroscopic strain.

    Args:
        strain: Factors of the displacement components 1, 2, 3 on their faces.
        unit: Twice the energy over the modulus, in volumes of [0, 1]³.
    """

    strain: tuple[float, float, float]
    unit: float


LOADS: tuple[tuple[Faces, tuple[Load, ...]], ...] = (
    (AXIAL, (Load((1, 1, 1), 9.0), Load((-1, -1, 2), 12.0))),
    (SHEAR, (Load((1, 1, 1), 1.0),)),
)
"""Of K, (C11 − C12)/2 and C44, in the order of `rve.spheres.cubic.MODULI`."""


def on_faces(
    space: fem.FunctionSpace, faces: Faces, strain: tuple[float, float, float] = (1, 1, 1)
) -> tuple[NDArray[np.int32], Array]:
    """Local numbers of the displacements given on faces, and their values; none twice."""
    places, values = [], []
    x = space.tabulate_dof_coordinates()
    for (axis, side), given in faces.items():
        nodes = np.flatnonzero(np.isclose(x[:, axis], side, atol=1e-9))
        for component, value in given.items():
            places.append(3 * nodes + component)
            values.append(np.full(nodes.size, value * strain[component]))
    dofs, first = np.unique(np.concatenate(places), return_index=True)
    return dofs.astype(np.int32), np.concatenate(values)[first]
