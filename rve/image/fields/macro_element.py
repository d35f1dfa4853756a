"""Stresses of a pixel or voxel in equilibrium, by the moments of the tractions on its faces.

A pixel is divided into 4 triangles about its centre, a voxel into 24 tetrahedra (centre, middle of
a face, edge). In each the stress is symmetric and linear, without divergence; tractions pass from
one to the next, and on each face of the voxel the traction is linear. These are macro-elements of
equilibrium (in the plane Johnson and Mercier 1978). The moments of the tractions on the faces fix
all that neighbours see: on each face the resultant and the first moments along its axes, about its
middle. All moments in equilibrium are attained, which a test proves by rational numbers.

Axes are those of the grid, (y, x) or (z, y, x), and a voxel is a unit cube: with the sides h a
stress σ_ij is h_i h_j times one of the unit cube, again symmetric and without divergence.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from math import factorial
from typing import Any, NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import FailedError

TABLE_ERROR = 2.0**-33
"""Bound of the relative error of the modes of a table; a test finds it below 2⁻⁴⁰."""


def component_pairs(dimension: int) -> list[tuple[int, int]]:
    """Return the indices of the components of a tensor: normal ones first, then shears."""
    normal = [(i, i) for i in range(dimension)]
    return normal + [(i, j) for i in range(dimension) for j in range(i + 1, dimension)]


def corners(dimension: int) -> Ints:
    """Return the corners of a unit pixel or voxel, shape (2^dimension, dimension)."""
    return np.array(list(product((0, 1), repeat=dimension)))


def face_axes(dimension: int, axis: int) -> list[int]:
    """Return the axes along a face that is normal to `axis`."""
    return [other for other in range(dimension) if other != axis]


class StressBasis(NamedTuple):
    """A basis of all stresses of the class on a unit pixel or voxel.

    Attributes:
        values: Components at the vertices of each simplex, shape (simplices, vertices, components,
            basis).
        volumes: Volume of each simplex.
        moments: Moments of the tractions on the faces, shape (faces × dimension², basis). A face,
            numbered 2 · axis + (1 on the upper side), has the resultant and the moments along its
            axes, each with a component along every axis.
    """

    values: Array
    volumes: Array
    moments: Array


def constraints(dimension: int) -> tuple[list[Array], Array]:
    """Return what stresses of the class obey, and the simplices.

    Returns:
        The vertices of each simplex; and rows that vanish, shape (rows, columns), in units that
        make all entries whole multiples of 1/4. Columns are the components at the vertices of all
        simplices, then the coefficients of the linear tractions on the faces: 1 and the coordinates
        along the face from its middle, each with a component along every axis.
    """
    d = dimension
    centre = np.full(d, 0.5)
    ring = [(0, 0), (1, 0), (1, 1), (0, 1)]
    simplices: list[Array] = []
    if d == 2:
        for i in range(4):
            simplices.append(np.array([centre, ring[i], ring[(i + 1) % 4]], float))
    else:
        for axis, side, i in product(range(3), (0, 1), range(4)):
            on_face = [(0.5, 0.5), ring[i], ring[(i + 1) % 4]]
            placed = [np.insert(np.array(x, float), axis, side) for x in on_face]
            simplices.append(np.array([centre, *placed]))
    pairs = component_pairs(d)
    size = len(simplices) * (d + 1) * len(pairs)

    def traction(simplex: int, vertex: int, normal: Array) -> Array:
        """Return the rows of the stress at a vertex times a vector, shape (d, columns)."""
        result = np.zeros((d, size + 2 * d**3))
        for k, (i, j) in enumerate(pairs):
            column = (simplex * (d + 1) + vertex) * len(pairs) + k
            result[i, column] += normal[j]
            if i != j:
                result[j, column] += normal[i]
        return result

    all_rows: list[Array] = []
    faces: dict[tuple[Any, ...], list[tuple[int, int, Array]]] = {}
    for e, points in enumerate(simplices):
        # gradients of the barycentric coordinates, one a column
        gradients = np.linalg.inv(np.c_[points, np.ones(d + 1)])[:d]
        all_rows.append(np.sum([traction(e, v, gradients[:, v]) for v in range(d + 1)], axis=0))
        for v in range(d + 1):
            others = [tuple(2 * points[w]) for w in range(d + 1) if w != v]
            normal = -gradients[:, v]
            faces.setdefault(tuple(sorted(others)), []).append((e, v, normal))
    for sharing in faces.values():
        e, v, normal = sharing[0]
        for w in set(range(d + 1)) - {v}:
            if len(sharing) == 2:  # inside: the traction is continuous
                f = sharing[1][0]
                same = [tuple(x) for x in simplices[f]].index(tuple(simplices[e][w]))
                all_rows.append(traction(e, w, normal) - traction(f, same, normal))
                continue
            axis = int(np.argmax(abs(normal)))
            face = 2 * axis + int(normal[axis] > 0)
            row = traction(e, w, normal / np.linalg.norm(normal))
            point = np.array([1.0, *(np.delete(simplices[e][w], axis) - 0.5)])
            for t, i in product(range(d), range(d)):
                row[i, size + face * d**2 + t * d + i] = -point[t]
            all_rows.append(row)
    return simplices, np.concatenate(all_rows)


@cache
def stress_basis(dimension: int) -> StressBasis:
    """Return an orthonormal basis of the stresses of the class; see `StressBasis`."""
    d = dimension
    simplices, rows = constraints(d)
    n_pairs = len(component_pairs(d))
    eigenvalues, vectors = np.linalg.eigh(rows.T @ rows)
    basis = vectors[:, eigenvalues < 1e-10 * eigenvalues[-1]]
    size = len(simplices) * (d + 1) * n_pairs
    values = basis[:size].reshape(len(simplices), d + 1, n_pairs, -1)
    # ∫ s² over a face of side 1 is 1/12 about its middle.
    weights = np.tile(np.repeat([1.0] + [1 / 12] * (d - 1), d), 2 * d)
    volumes = [abs(np.linalg.det(x[1:] - x[0])) / factorial(d) for x in simplices]
    return StressBasis(values, np.array(volumes), weights[:, np.newaxis] * basis[size:])


@dataclass(frozen=True, eq=False)
class MacroElement:
    """Tables of a voxel of one material with the shear modulus 1.

    Args:
        stiffness: From displacements of faces, dual to the moments, to the moments of the stress of
            least energy, shape (moments, moments).
        modes: Matrix B from moments in equilibrium to numbers whose squares sum to the least energy
            of stresses with these moments, within `TABLE_ERROR` times |B| |moments|.
        norm: Largest singular value of B.
    """

    stiffness: Array
    modes: Array
    norm: float

    @classmethod
    def of_ratio(cls, ratio: float, sides: Sequence[float]) -> MacroElement:
        """Return the tables of a voxel.

        Args:
            ratio: Bulk over shear modulus; in the plane of K + G/3.
            sides: Sides of a voxel along the axes of the grid, over that along x.

        Raises:
            FailedError: The moments of the stresses are not those asked for.
        """
        d = len(sides)
        basis = stress_basis(d)
        # σ:S:σ = tr²/(n² K) + (σ:σ − tr²/n)/(2 G)
        compliance = np.diag([0.5] * d + [1.0] * (len(component_pairs(d)) - d))
        compliance[:d, :d] += 1 / (d**2 * ratio) - 1 / (2 * d)
        scale = np.array([sides[i] * sides[j] for i, j in component_pairs(d)])
        compliance *= np.outer(scale, scale)
        # ∫ of two linear functions over a simplex is volume/((d + 1)(d + 2)) (1 + δ) by vertices.
        mass = (1 + np.eye(d + 1)) / ((d + 1) * (d + 2))
        energy = np.einsum("e,vw,evkb,kl,ewlc->bc", basis.volumes, mass, basis.values, compliance,
                           basis.values, optimize=True)  # fmt: skip
        stress = np.linalg.solve(energy, basis.moments.T)
        stiffness = basis.moments @ stress
        # Moments in equilibrium are those without the d (d + 1)/2 rigid motions.
        rigid = d * (d + 1) // 2
        kept = np.linalg.svd(basis.moments)[0][:, : 2 * d**3 - rigid]
        of_moments = stress @ kept @ np.linalg.inv(kept.T @ stiffness @ kept) @ kept.T
        # These are the coefficients of a stress whose moments are the given ones, in equilibrium.
        # Any such coefficients bound the least energy, so that what their moments are off is made
        # up by the shortest ones, whatever has become of the least energy in rounding.
        projection = kept @ kept.T
        shortest = np.linalg.pinv(basis.moments, rcond=1e-10)
        for _ in range(2):
            of_moments += shortest @ (projection - basis.moments @ of_moments)
        defect = abs(basis.moments @ of_moments - projection).max()
        scale_of_moments = abs(of_moments).max()
        if not defect < 2.0**-40 * max(1.0, scale_of_moments):
            raise FailedError("the proof is wrong: a table of stresses is off", "report the case")
        roots, axes = np.linalg.eigh(of_moments.T @ energy @ of_moments)
        modes = np.sqrt(np.maximum(roots[rigid:], 0))[:, np.newaxis] * axes[:, rigid:].T
        return cls(stiffness, modes, float(np.linalg.norm(modes, 2)))


@cache
def trace_matrix(dimension: int) -> Array:
    """Return the matrix from displacements of corners to those of faces, dual to the moments.

    Displacements are products of linear functions; on a face their projection on linear functions
    counts. The transpose turns moments into forces at corners with the same resultants.

    Returns:
        Shape (faces × dimension², corners × dimension).
    """
    d = dimension
    points = corners(d)
    matrix = np.zeros((d, 2, d, d, len(points), d))
    for axis, c in product(range(d), range(len(points))):
        point = points[c]
        for t, along in enumerate([None, *face_axes(d, axis)]):
            value = 2.0 ** (1 - d)
            if along is not None:
                value = (2 * point[along] - 1) * 2.0 ** (2 - d)
            matrix[axis, point[axis], t, range(d), c, range(d)] = value
    return matrix.reshape(2 * d**3, -1)


@cache
def affine_displacements(dimension: int) -> Array:
    """Return displacements of corners under unit strains, (corners × dimension, components).

    Strains are in the order of `component_pairs`, with shears twice those of the tensor.
    """
    eye = np.eye(dimension)
    columns = []
    for i, j in component_pairs(dimension):
        strain = (np.outer(eye[i], eye[j]) + np.outer(eye[j], eye[i])) / 2
        columns.append(((corners(dimension) - 0.5) @ strain).ravel())
    return np.stack(columns, axis=1)
