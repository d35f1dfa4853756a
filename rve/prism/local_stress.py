"""Stresses inside the cell: their spread over cell and θ, and the tractions on the interface.

The paper names them (section 4.2) as what the one-particle model controls besides the mean.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.rve.cell import Phase
from alphacut.rve.mesh.wedge import tabulate
from alphacut.rve.prism.system import PrismSystem
from alphacut.stochastic import layered_rule
from alphacut.stochastic.theta.truncated_normal import Array

COMPONENTS = ("s11", "s22", "s12")


@dataclass(frozen=True)
class Spread:
    """Stress component over cell and θ at the quadrature points, in Pa, shape (3, loads).

    Args:
        mean: Mean under f_Θ.
        deviation: Standard deviation.
        least: Smallest sampled value.
        greatest: Largest sampled value.
    """

    mean: Array
    deviation: Array
    least: Array
    greatest: Array


@dataclass(frozen=True)
class InterfaceStress:
    """Tractions on the interface, in Pa, at points of n slices and m angles.

    Args:
        theta: θ of the slices, shape (n,).
        angle: Angle of the points, in radians, shape (n, m).
        normal: σ_n from the matrix's side, shape (n, m, loads).
        shear: τ from the matrix's side, same shape.
        jump: Root mean square of the tractions' difference between the two sides over that of the
            tractions: zero for the exact solution, a measure of the discretisation error.
    """

    theta: Array
    angle: Array
    normal: Array
    shear: Array
    jump: float


@dataclass(frozen=True)
class LocalStress:
    """Local results of one cell.

    Args:
        whole: Spread over the cell.
        matrix: Spread over the matrix alone.
        particle: Spread over the particle alone.
        interface: Tractions on the interface; None if the mesh does not follow it.
    """

    whole: Spread
    matrix: Spread
    particle: Spread
    interface: InterfaceStress | None


def local_stress(
    system: PrismSystem, displacement: Array, phases: tuple[Phase, Phase]
) -> LocalStress:
    """Local results from total displacements of the nodes, shape (nodes, 2, loads)."""
    slices, layers = system.slice_stress, system.grid.layers
    rule = layered_rule(system.map.distribution, layers=layers, points=slices.slices)
    stiffness = system.stiffness_at_points(phases)
    parts = list(slices.layers(displacement, stiffness))
    stress = np.stack(
        [part.stress for part in parts]
    )  # (layers, triangles, slices, points, 3, loads)
    weight = np.stack([part.area for part in parts]) * rule.weights.reshape(
        layers, 1, slices.slices, 1
    )
    share = np.broadcast_to(system.share, (len(system.share), len(slices.points))).reshape(
        weight.shape
    )
    on_interface = (
        _interface(system, displacement, phases, rule.nodes) if system.grid.conforming else None
    )
    return LocalStress(
        _spread(stress, weight),
        _spread(stress, weight * (1 - share)),
        _spread(stress, weight * share),
        on_interface,
    )


def _spread(stress: Array, weight: Array) -> Spread:
    kept = weight > 0
    values, weights = stress[kept], weight[kept] / weight[kept].sum()
    mean = np.tensordot(weights, values, axes=1)
    return Spread(
        mean,
        np.sqrt(np.tensordot(weights, (values - mean) ** 2, axes=1)),
        values.min(axis=0),
        values.max(axis=0),
    )


def _interface(
    system: PrismSystem, displacement: Array, phases: tuple[Phase, Phase], theta: Array
) -> InterfaceStress:
    """Tractions at two Gauss points of every arc edge, slice by slice, from both sides."""
    sides = [_side(system, displacement, phases[k].stiffness, inside=bool(k)) for k in (0, 1)]
    difference = [a - b for a, b in zip(sides[0][1:], sides[1][1:], strict=True)]
    size = sum(float((t**2).sum()) for t in sides[0][1:])
    jump = float(np.sqrt(sum(float((d**2).sum()) for d in difference) / size)) if size else 0.0
    return InterfaceStress(theta, *sides[0], jump)


def _side(
    system: PrismSystem, displacement: Array, stiffness: Array, *, inside: bool
) -> tuple[Array, Array, Array]:
    """Angle (n, m), normal traction and shear (n, m, loads) seen from one phase, angles rising."""
    angles, normals, shears = [], [], []
    for edge, (start, end) in enumerate(((0, 1), (0, 2), (1, 2))):
        plane = system.grid.plane
        chosen = np.flatnonzero(plane.arc[plane.triangles[:, 3 + edge]] & (plane.inside == inside))
        if len(chosen):
            angle, normal, shear = _tractions(
                system, displacement, stiffness, chosen, _edge_points(system, start, end)
            )
            angles.append(angle)
            normals.append(normal)
            shears.append(shear)
    angle, normal, shear = (np.concatenate(parts, axis=1) for parts in (angles, normals, shears))
    order = np.argsort(angle, axis=1)
    normal, shear = (np.take_along_axis(field, order[..., None], 1) for field in (normal, shear))
    return np.take_along_axis(angle, order, 1), normal, shear


def _edge_points(system: PrismSystem, start: int, end: int) -> Array:
    """Two Gauss points of a triangle's edge at each slice of the layer, shape (slices · 2, 3)."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    heights = np.unique(system.slice_stress.points[:, 2])
    along = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3)
    return np.array(
        [
            [*(corners[start] + s * (corners[end] - corners[start])), z]
            for z in heights
            for s in along
        ]
    )


def _tractions(
    system: PrismSystem, displacement: Array, stiffness: Array, triangles: Array, points: Array
) -> tuple[Array, Array, Array]:
    """Angle (n, m), normal traction and shear (n, m, loads) on chosen triangles."""
    grid, slices = system.grid, system.slice_stress
    cells = grid.cells.reshape(grid.layers, -1, grid.cells.shape[1])[:, triangles].reshape(
        -1, grid.cells.shape[1]
    )
    stress = stiffness @ slices.strain(cells, displacement, points)[0]
    x = np.einsum("qn,cnd->cqd", tabulate(points), system.positions[cells, :2])
    c, s = (x / np.linalg.norm(x, axis=-1, keepdims=True)).transpose(2, 0, 1)[..., None]
    s11, s22, s12 = stress.transpose(2, 0, 1, 3)
    normal = s11 * c * c + s22 * s * s + 2 * s12 * s * c
    shear = (s22 - s11) * s * c + s12 * (c * c - s * s)
    angle = np.arctan2(s[..., 0], c[..., 0])

    def by_slice(field: Array) -> Array:
        table = field.reshape(grid.layers, len(triangles), slices.slices, 2, *field.shape[2:])
        return np.moveaxis(table, 2, 1).reshape(grid.layers * slices.slices, -1, *field.shape[2:])

    return by_slice(angle), by_slice(normal), by_slice(shear)
