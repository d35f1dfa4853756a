"""Cubic part of the stiffness of a periodic cube of spheres, on one grid of voxels.

Conjugate gradients on displacements, one field for each of six loads. The energy falls towards the
grid's own from above; with a reference no stiffer than any voxel it lacks at most (residual ·
preconditioned residual), which ends the iteration.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.rve.cell import Phase
from alphacut.rve.spheres.bounds import bulk_and_shear
from alphacut.stochastic.theta.truncated_normal import Array
from benchmarks.rve.voxels.fourier import FourierGrid
from benchmarks.rve.voxels.laminate import VoxelStiffness, voxel_stiffness
from benchmarks.rve.voxels.voxels import Voxels

LIMIT = 1000  # iterations of one load
# strains 11, 22, 33, 23, 13, 12, and what divides their energy ε : C : ε into a modulus
_LOADS = (
    ((1, 1, 1, 0, 0, 0), 9.0),
    ((1, -1, 0, 0, 0, 0), 4.0),
    ((1, 1, -2, 0, 0, 0), 12.0),
    ((0, 0, 0, 1, 0, 0), 4.0),
    ((0, 0, 0, 0, 1, 0), 4.0),
    ((0, 0, 0, 0, 0, 1), 4.0),
)
_DOUBLE = np.array([1.0, 1, 1, 2, 2, 2])  # a tensor's component 23 stands for 32 too


@dataclass(frozen=True)
class GridStiffness:
    """Moduli of one cube on one grid.

    Args:
        moduli: K, (C11 − C12)/2 and C44 of the cubic part, shape (3,), in Pa.
        solver_error: How far they may lie above the grid's own, relative, at most.
        iterations: Of conjugate gradients, one number a load.
        grid: Voxels along an edge.
    """

    moduli: Array
    solver_error: float
    iterations: tuple[int, ...]
    grid: int


def stiffness_of(
    voxels: Voxels, matrix: Phase, inclusion: Phase, *, accuracy: float = 1e-6
) -> GridStiffness:
    """Moduli of a periodic cube of spheres, on one grid.

    Args:
        voxels: The cube.
        matrix: Material between the spheres.
        inclusion: Material of the spheres.
        accuracy: Relative error of the energy allowed to the solver, in (0, 0.1].

    Raises:
        ValueError: The accuracy lies outside its range.
        RuntimeError: The iteration does not converge.
    """
    if not 0 < accuracy <= 0.1:
        raise ValueError(f"the solver's accuracy is {accuracy:g}; it must lie in (0, 0.1]")
    material = voxel_stiffness(voxels, matrix, inclusion)
    softest = np.min([bulk_and_shear(phase) for phase in (matrix, inclusion)], axis=0)
    bulk, shear = (float(modulus) for modulus in softest)
    space = FourierGrid.of(len(voxels.fraction), bulk - 2 / 3 * shear, shear)
    found, steps = [], []
    for strain, divisor in _LOADS:
        energy, iterations = _energy(space, material, np.array(strain, float), accuracy)
        found.append(energy / divisor)
        steps.append(iterations)
    moduli = np.array([found[0], np.mean(found[1:3]), np.mean(found[3:])])
    return GridStiffness(moduli, accuracy, tuple(steps), space.size)


def _energy(
    space: FourierGrid, material: VoxelStiffness, strain: Array, accuracy: float
) -> tuple[float, int]:
    """Mean of ε : C : ε under a mean strain, relatively at most `accuracy` above the least."""
    uniform = np.broadcast_to(strain[:, None, None, None], (6, *material.shear.shape))
    stress = material.stress(uniform)
    energy = float(_DOUBLE * strain @ stress.mean(axis=(1, 2, 3)))
    residual = -space.force(stress)
    image = space.green(residual)
    direction, gap = image, space.inner(residual, image)
    for step in range(LIMIT):
        if gap <= accuracy * (energy - gap):
            return energy, step
        pulled = space.force(material.stress(space.strain(direction)))
        length = gap / space.inner(direction, pulled)
        energy -= length * gap  # conjugate gradients lower twice the potential by this
        residual = residual - length * pulled
        image = space.green(residual)
        gap, before = space.inner(residual, image), gap
        direction = image + gap / before * direction
    raise RuntimeError(
        f"conjugate gradients have not reached a relative error of {accuracy:g} after {LIMIT}"
        " iterations: take a lower contrast of the phases"
    )
