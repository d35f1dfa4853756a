"""Spheres of a periodic cube on a grid of voxels: exact partial volumes, and normals.

Chords along one axis are exact, their mean over the other two by the midpoint rule; voxels that a
sphere cuts are then changed so that its volume is exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.stochastic.spheres.spheres import Spheres
from alphacut.stochastic.theta.truncated_normal import Array

_CHORDS = 6  # along each of two edges of a voxel
_WHOLE = 1e-9  # a share of a voxel that counts as none


@dataclass(frozen=True, eq=False)
class Voxels:
    """Two phases on a cubic grid.

    Args:
        fraction: Share of spheres in each voxel, shape (n, n, n), in [0, 1].
        normals: Unit normals in the voxels that hold both phases, shape (mixed, 3), in C order.
    """

    fraction: Array
    normals: Array

    @property
    def mixed(self) -> Array:
        """Flat indices of the voxels that hold both phases, shape (mixed,)."""
        return np.flatnonzero(_is_mixed(self.fraction))


def _is_mixed(fraction: Array) -> Array:
    return np.asarray((fraction > _WHOLE) & (fraction < 1 - _WHOLE))


def voxels_of(spheres: Spheres, grid: int) -> Voxels:
    """Voxels of a cube of `grid` along each edge.

    Raises:
        ValueError: `grid` is not an odd number of at least 3, or a sphere is wider than the cube.
    """
    if grid < 3 or grid % 2 == 0:
        raise ValueError(f"the grid has {grid} voxels along an edge; take an odd number from 3 on")
    if 2 * spheres.radii.max() > spheres.side:
        raise ValueError(
            f"a sphere of radius {spheres.radii.max():g} m is wider than its periodic cube of"
            f" {spheres.side:g} m: take a larger cube"
        )
    scale = grid / spheres.side
    fraction, normals = np.zeros((grid,) * 3), np.zeros((3, *(grid,) * 3))
    for centre, radius in zip(spheres.centres, spheres.radii, strict=True):
        places, shares, outward = _one(scale * centre, scale * float(radius))
        block = np.ix_(*(np.mod(along, grid) for along in places))
        # a sphere as wide as the grid may meet a voxel on both of its sides
        np.add.at(fraction, block, shares)
        for axis in range(3):
            np.add.at(normals[axis], block, shares * (1 - shares) * outward[axis])
    exact = _to_volume(np.clip(fraction, 0, 1), spheres.volume_fraction * grid**3)
    return Voxels(exact, _unit(normals[:, _is_mixed(exact)]).T)


def _one(centre: Array, radius: float) -> tuple[list[Array], Array, Array]:
    """Voxels about one sphere, its shares of them, and directions from its centre; in voxels."""
    first, last = np.floor(centre - radius).astype(int), np.ceil(centre + radius).astype(int)
    places = [np.arange(a, b) for a, b in zip(first, last, strict=True)]
    inner = (np.arange(_CHORDS) + 0.5) / _CHORDS
    x, y = (
        (along[:, None] + inner).ravel() - c
        for along, c in zip(places[:2], centre[:2], strict=True)
    )
    half = np.sqrt(np.maximum(radius**2 - x[:, None] ** 2 - y**2, 0))[..., None]
    edges = np.append(places[2], places[2][-1] + 1) - centre[2]
    chords = np.diff(np.clip(edges, -half, half), axis=-1)
    shape = (places[0].size, _CHORDS, places[1].size, _CHORDS, places[2].size)
    shares = _to_volume(chords.reshape(shape).mean(axis=(1, 3)), 4 / 3 * np.pi * radius**3)
    middles = [along + 0.5 - c for along, c in zip(places, centre, strict=True)]
    return places, shares, _unit(np.stack(np.meshgrid(*middles, indexing="ij")))


def _to_volume(shares: Array, volume: float) -> Array:
    """Shares in [0, 1] whose sum is `volume`, changed most where both phases are present."""
    room = shares * (1 - shares)
    return np.asarray(shares + (volume - shares.sum()) * room / max(room.sum(), 1e-300))


def _unit(vectors: Array) -> Array:
    """Vectors along the first axis over their lengths; e1 where there is none."""
    length = np.linalg.norm(vectors, axis=0)
    first = np.eye(3)[0].reshape(3, *(1,) * length.ndim)
    return np.where(length > 0, vectors / np.maximum(length, 1e-300), first)
