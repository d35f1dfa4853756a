"""Displacements and stresses of a case's cell on its prism mesh, for ParaView and for pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.case.case import Case
from alphacut.export.prism_mesh import ORDER
from alphacut.io.problem import BadInput, Problem
from alphacut.stages.cell import modal_values, parts
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    import meshio

    from alphacut.rve.prism.system import PrismSystem

VERTICES = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)]
EDGES = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (3, 5), (4, 5)]  # Basix's order
COMPONENTS = ("11", "22", "12")


def reference_nodes() -> Array:
    """The 15 nodes of the reference wedge in Basix's order of vertices and edges, shape (15, 3)."""
    vertices = np.array(VERTICES, float)
    return np.concatenate([vertices, [(vertices[a] + vertices[b]) / 2 for a, b in EDGES]])


def cell_fields(case: Case) -> meshio.Mesh:
    """Total displacements and stresses under both loads at modal values.

    Stresses are means over the wedges of one phase that meet in a node; nodes on the interface
    stand twice, once for each phase, since
    stresses jump there. Point data: ``displacement_1_in_half_sides``,
    ``displacement_2_in_half_sides`` (halves of the cell's side) and ``stress_1_11_Pa`` … under ε11
    = ε22 = 0.01 (load 1) and ε12 = 0.01 (load 2); cell data: ``phase``.

    Raises:
        BadInput: The mesh does not follow the interface.
    """
    import meshio
    from meshio._mesh import topological_dimension
    from mpi4py import MPI

    from alphacut.rve.cell import LOADS
    from alphacut.rve.mesh.prism_grid import PrismGrid
    from alphacut.rve.mesh.triangulation import triangulate
    from alphacut.rve.prism.model import reference_radius
    from alphacut.rve.prism.system import PrismSystem
    from alphacut.rve.prism.task import PrismTask
    from alphacut.rve.solver.options import SolverOptions
    from alphacut.rve.solver.stopwatch import Stopwatch

    if case.text("mesh.interface") != "conforming":
        raise BadInput(
            Problem(
                "mesh.interface",
                "fields need a mesh that follows the interface",
                case.text("mesh.interface"),
                "conforming",
            )
        )
    radius, matrix, inclusion = parts(modal_values(case), case.numbers("radius.theta"))
    plane = triangulate(size=case.number("mesh.size"), radius=reference_radius(radius))
    system = PrismSystem(PrismGrid(plane, case.integer("mesh.layers")), MPI.COMM_SELF)
    system.move(radius)
    solved = PrismTask(system, SolverOptions("theta"), LOADS, Stopwatch()).solve(
        (matrix, inclusion)
    )
    phase = np.tile(plane.inside.astype(np.int64), system.grid.layers)
    stiffness = np.array([matrix.stiffness, inclusion.stiffness])[phase][:, None]
    stress = (
        stiffness
        @ system.slice_stress.strain(system.grid.cells, solved.total, reference_nodes())[0]
    )
    nodes, cells, mean = by_phase(system, phase, stress)
    data: dict[str, Array] = {
        f"displacement_{load + 1}_in_half_sides": np.pad(
            solved.total[nodes, :, load], ((0, 0), (0, 1))
        )
        for load in (0, 1)
    }
    data |= {
        f"stress_{load + 1}_{name}_Pa": mean[:, row, load]
        for load in (0, 1)
        for row, name in enumerate(COMPONENTS)
    }
    topological_dimension.setdefault("wedge15", 3)  # see alphacut.prism_mesh
    return meshio.Mesh(
        system.positions[nodes], [("wedge15", cells[:, ORDER])], data, {"phase": [phase]}
    )


def by_phase(system: PrismSystem, phase: Array, stress: Array) -> tuple[Array, Array, Array]:
    """Node of each wedge corner apart by phase, and mean stresses there, (n, 3, loads)."""
    numbered = system.grid.cells + phase[:, None] * len(system.positions)
    kept, cells = np.unique(numbered, return_inverse=True)
    cells = cells.reshape(numbered.shape)
    total = np.zeros((len(kept), *stress.shape[2:]))
    np.add.at(total, cells, stress)
    count = np.bincount(cells.ravel(), minlength=len(kept))
    return kept % len(system.positions), cells, total / count[:, None, None]
