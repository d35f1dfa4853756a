"""Stiffness of voxels: of one phase, or of two as a laminate across the surface between them.

A voxel of both phases takes the strains of a laminate of its shares whose layers lie along the
surface of the sphere: continuous displacement and traction (composite voxels; Kabel, Merkert &
Schneider, Comput. Methods Appl. Mech. Engrg. 294, 168, 2015). With the jump of strain a ⊗ n,

    (c K' + c' K) a = −n · ΔC : ε,    σ = ⟨C⟩ : ε + c c' ΔC : (a ⊗ n),

K = n · C · n. Tensors have six components: 11, 22, 33, 23, 13, 12, without factors of 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.rve.cell import Phase
from alphacut.rve.spheres.bounds import bulk_and_shear
from alphacut.stochastic.theta.truncated_normal import Array
from benchmarks.rve.voxels.voxels import Voxels

PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


@dataclass(frozen=True, eq=False)
class VoxelStiffness:
    """Stiffness of each voxel of a grid.

    Args:
        lame: Mean first Lamé constant of each voxel, shape (n, n, n), in Pa.
        shear: Mean shear modulus, same shape.
        mixed: Flat indices of the voxels with a correction, shape (m,).
        correction: What a laminate takes from the mean stiffness, shape (m, 6, 6), in Pa; maps
            tensor components of strain to stress.
    """

    lame: Array
    shear: Array
    mixed: Array
    correction: Array

    def stress(self, strain: Array) -> Array:
        """Stress in Pa of a strain, both (6, n, n, n)."""
        stress = 2 * self.shear * strain
        stress[:3] += self.lame * (strain[0] + strain[1] + strain[2])
        flat = stress.reshape(6, -1)
        here = strain.reshape(6, -1)[:, self.mixed]
        flat[:, self.mixed] -= np.einsum("mij,jm->im", self.correction, here)
        return stress


def voxel_stiffness(voxels: Voxels, matrix: Phase, inclusion: Phase) -> VoxelStiffness:
    """Stiffness of voxels of two isotropic phases."""
    (lame, shear), (inner_lame, inner_shear) = (lame_constants(p) for p in (matrix, inclusion))
    share, mixed = voxels.fraction, voxels.mixed
    jump = inner_lame - lame, inner_shear - shear
    inside = share.ravel()[mixed]
    crossed = [  # harmonic weights: each phase's constants with the other's share
        (1 - inside) * inner + inside * outer
        for inner, outer in ((inner_lame, lame), (inner_shear, shear))
    ]
    return VoxelStiffness(
        lame + share * jump[0],
        shear + share * jump[1],
        mixed,
        (inside * (1 - inside))[:, None, None]
        * _laminate(voxels.normals, jump, (crossed[0], crossed[1])),
    )


def lame_constants(phase: Phase) -> tuple[float, float]:
    """λ and μ in Pa."""
    bulk, shear = bulk_and_shear(phase)
    return bulk - 2 / 3 * shear, shear


def _laminate(normals: Array, jump: tuple[float, float], crossed: tuple[Array, Array]) -> Array:
    """ΔC : n ⊗ (c K' + c' K)⁻¹ n · ΔC for unit normals (m, 3), shape (m, 6, 6), in Pa."""
    lame, shear = jump
    traction = np.zeros((len(normals), 3, 6))  # n · ΔC : ε
    stress = np.zeros((len(normals), 6, 3))  # ΔC : (a ⊗ n)
    for component, (i, j) in enumerate(PAIRS):
        if i == j:
            traction[:, :, component] += lame * normals
            stress[:, component, :] += lame * normals
        for a, b in {(i, j), (j, i)}:
            traction[:, a, component] += 2 * shear * normals[:, b]
        stress[:, component, i] += shear * normals[:, j]
        stress[:, component, j] += shear * normals[:, i]
    return np.asarray(stress @ _inverse_acoustic(normals, *crossed) @ traction)


def _inverse_acoustic(normals: Array, lame: Array, shear: Array) -> Array:
    """Inverses of μ 1 + (λ + μ) n ⊗ n, shape (m, 3, 3), in 1/Pa."""
    along = ((lame + shear) / (lame + 2 * shear))[:, None, None]
    outer = normals[:, :, None] * normals[:, None, :]
    return np.asarray((np.eye(3) - along * outer) / shear[:, None, None])
