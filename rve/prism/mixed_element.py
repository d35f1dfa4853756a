"""Quadratic triangle that does not lock where its material is nearly incompressible.

Crouzeix and Raviart's element (RAIRO 7(R3), 33, 1973): quadratic displacements and a cubic bubble
with discontinuous linear pressures. The bubble and the two slopes of the pressure are eliminated in
each triangle, uniformly in Poisson's ratio; the mean pressure stays an unknown.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from alphacut.rve.cell import Phase
from alphacut.rve.interruption import uninterrupted
from alphacut.rve.solver.level_stiffness import gradients
from alphacut.stochastic.theta.truncated_normal import Array

with uninterrupted():
    import basix

NEARLY_INCOMPRESSIBLE = 0.45  # Poisson's ratio above which the mixed element is taken
_AUGMENTED = 2.5  # share of the bulk modulus that stays with the displacements, over μ


@dataclass(frozen=True)
class MixedElements:
    """Matrices of m triangles of one phase, 12 displacements each.

    Args:
        stiffness: Energy without that of the mean pressure, shape (m, 12, 12), in Pa.
        strain: Integrals of (ε11, ε22, 2 ε12), shape (m, 3, 12).
        area: Shape (m,).
        slopes: Slopes of the pressure in the reference triangle, shape (m, 2, 12), in Pa.
        centre: Centroids in the reference triangle, shape (m, 2).
    """

    stiffness: Array
    strain: Array
    area: Array
    slopes: Array
    centre: Array

    @property
    def flux(self) -> Array:
        """Integral of the divergence, shape (m, 12)."""
        return np.asarray(self.strain[:, 0] + self.strain[:, 1])


def split_bulk(phase: Phase) -> tuple[float, float, float]:
    """Shear modulus, bulk modulus of the displacements' own and that of the mean pressure, in Pa.

    The last two add up to the plane bulk modulus λ + μ.
    """
    shear = phase.modulus / (2 * (1 + phase.poisson))
    return shear, _AUGMENTED * shear, shear / (1 - 2 * phase.poisson) - _AUGMENTED * shear


def mixed_elements(positions: Array, phase: Phase) -> MixedElements:
    """Matrices of triangles, straight or curved.

    Args:
        positions: Nodes of each triangle, shape (m, 6, 2).
        phase: Their material.
    """
    points, weights, table = _rule()
    jacobian = np.einsum("qan,mnx->mqax", table[:, :, :6], positions)
    slope = np.linalg.inv(jacobian) @ table  # (m, q, 2, 7)
    weight = np.linalg.det(jacobian) * weights
    strain = np.zeros((*weight.shape, 3, 14))
    strain[..., 0, 0::2] = strain[..., 2, 1::2] = slope[..., 0, :]
    strain[..., 1, 1::2] = strain[..., 2, 0::2] = slope[..., 1, :]
    area, divergence = weight.sum(axis=1), strain[..., 0, :] + strain[..., 1, :]
    shear, own, rest = split_bulk(phase)
    sheared = _deviator(strain) * (shear * weight[..., None, None])
    full = _sum(strain, sheared)
    mean = (weight[..., None, None] * strain[..., :12]).sum(axis=1)
    centre = weight @ points / area[:, None]
    offset = (points - centre[:, None]) * weight[..., None]  # (m, q, 2)
    coupling = offset.transpose(0, 2, 1) @ divergence
    mass = offset.transpose(0, 2, 1) @ (points - centre[:, None]) / (own + rest)
    inner = np.block(
        [[full[:, 12:, 12:], coupling[:, :, 12:].transpose(0, 2, 1)], [coupling[:, :, 12:], -mass]]
    )
    sides = np.concatenate([full[:, 12:, :12], coupling[:, :, :12]], axis=1)
    answer = -np.linalg.solve(inner, sides)  # bubble and slopes of the pressure
    flux = mean[:, 0] + mean[:, 1]
    volume = flux[:, :, None] * (own / area)[:, None, None] * flux[:, None]
    stiffness = full[:, :12, :12] + sides.transpose(0, 2, 1) @ answer + volume
    return MixedElements(stiffness, mean, area, answer[:, 2:], centre)


@cache
def _rule() -> tuple[Array, Array, Array]:
    """Points (q, 2), weights and derivatives (q, 2, 7) of six nodes and the bubble."""
    points, weights = basix.make_quadrature(basix.CellType.triangle, 4)
    x, y = points.T
    z = 1 - x - y
    bubble = 27 * np.stack([y * (z - x), x * (z - y)], axis=-1)
    return points, weights, np.concatenate([gradients(points), bubble[:, :, None]], axis=-1)


def _deviator(strain: Array) -> Array:
    """Stress over μ of the strain's deviator in the plane, shape (…, 3, k)."""
    apart = strain[..., 0, :] - strain[..., 1, :]
    return np.stack([apart, -apart, strain[..., 2, :]], axis=-2)


def _sum(left: Array, right: Array) -> Array:
    """Sum of leftᵀ right over points, shapes (m, q, 3, k) to (m, k, k)."""
    m, _, _, k = left.shape
    return np.asarray(left.reshape(m, -1, k).transpose(0, 2, 1) @ right.reshape(m, -1, k))
