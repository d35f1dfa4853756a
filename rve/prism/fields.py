"""Displacements and stresses at the nodes of the product space, for ParaView and other programs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.rve.cell.cell import THREE_LOADS, AnyPhase, Cell
from alphacut.rve.fenicsx import at_points, fem
from alphacut.rve.mesh.wedge import vertices_and_midpoints
from alphacut.rve.prism.model import PrismModel
from alphacut.rve.prism.own_mesh import MeshModel
from alphacut.rve.prism.problem import PrismProblem
from alphacut.rve.solver.form import strain
from alphacut.rve.solver.krylov import SolverOptions, solve
from alphacut.stochastic import RadiusMap, ThetaLaw

NODES = 15
VERTICES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]])
EDGES = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (3, 5), (4, 5)]
SIDES = np.array(
    [[0, 1, 3, 4, 6, 8, 10, 12], [0, 2, 3, 5, 7, 8, 11, 13], [1, 2, 4, 5, 9, 10, 11, 14]]
)
"""Corners of Basix's prism, ends of its edges, and of each side the corners and middle nodes."""


@dataclass(frozen=True)
class CellFields:
    """Total fields under each load; nodes on the interface stand twice, once for each phase.

    Args:
        points: (x1, x2, θ), shape (n, 3).
        cells: Nodes of the prisms in Basix's order, shape (m, 15).
        phase: Index of the phase of each prism in `names`, shape (m,).
        displacement: In halves of the cell's side, shape (n, 2, loads).
        stress: (σ11, σ22, σ12), means over the prisms of one phase that meet in a node, shape
            (n, 3, loads), in Pa.
        names: Names of the phases.
        node: Node of the mesh that each point is, shape (n,).
    """

    points: Array
    cells: Ints
    phase: Ints
    displacement: Array
    stress: Array
    names: tuple[str, ...]
    node: Ints

    def in_tetrahedra(self) -> CellFields:
        """The same with each prism as three quadratic tetrahedra in VTK's order, (3 m, 10).

        Centres of the prisms' sides, where diagonals have their middle nodes, come last among the
        points, with values interpolated as in the prism and −1 as their `node`.
        """
        columns = np.argsort(self.node[self.cells[:, :3]], axis=1)  # same diagonals from both sides
        prism_sides = self.cells[:, SIDES].reshape(-1, 8)
        corners = np.sort(prism_sides[:, :4], axis=1)
        _, first, number = np.unique(corners, axis=0, return_index=True, return_inverse=True)
        nodes = np.column_stack([self.cells, len(self.points) + number.reshape(-1, 3)])
        cells = np.empty((len(nodes), 3, 10), int)
        for order in permutations(range(3)):
            chosen = (columns == order).all(axis=1)
            cells[chosen] = nodes[chosen][:, _tetrahedra_nodes(order)]
        sides = prism_sides[first]
        points, displacement, stress = (
            np.concatenate([x, x[sides[:, 4:]].sum(axis=1) / 2 - x[sides[:, :4]].sum(axis=1) / 4])
            for x in (self.points, self.displacement, self.stress)
        )
        phase, names = np.repeat(self.phase, 3), self.names
        node = np.concatenate([self.node, np.full(len(sides), -1)])
        return CellFields(points, cells.reshape(-1, 10), phase, displacement, stress, names, node)


def _tetrahedra_nodes(columns: tuple[int, ...]) -> Ints:
    """Nodes, shape (3, 10), of a prism's tetrahedra; its diagonals rise along `columns`."""
    lower, upper = list(columns), [3 + column for column in columns]
    middles = {frozenset(edge): 6 + k for k, edge in enumerate(EDGES)}
    for k, (a, b, c, d, *_) in enumerate(SIDES):
        middles |= dict.fromkeys([frozenset((a, d)), frozenset((b, c))], 15 + k)
    tetrahedra = []
    for k in range(3):
        corners = lower[: k + 1] + upper[k:]
        if np.linalg.det(VERTICES[corners[1:]] - VERTICES[corners[0]]) < 0:
            corners[:2] = corners[1], corners[0]
        ends = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
        tetrahedra.append(corners + [middles[frozenset((corners[i], corners[j]))] for i, j in ends])
    return np.array(tetrahedra)


def cell_fields(
    model: PrismModel, radius_map: RadiusMap, matrix: AnyPhase, inclusion: AnyPhase
) -> CellFields:
    """Fields of one cell, on one rank, by a mesh that follows the interface.

    Raises:
        FoldedMeshError: The map bends more than the layers can follow.
    """
    cell = Cell(matrix, inclusion, radius_map, model.outline)
    return _solve_fields(
        model.problem(radius_map), cell.stiffness, model.loads(cell), model.options
    )


def mesh_fields(model: MeshModel, law: ThetaLaw, phases: Mapping[str, AnyPhase]) -> CellFields:
    """Displacements and stresses at the nodes of a mesh from a file, under three unit strains."""
    problem, named = model.problem_of(law, phases)
    stiffness = [phase.stiffness for phase in named.values()]
    return _solve_fields(problem, stiffness, THREE_LOADS, model.options)


def _solve_fields(
    problem: PrismProblem, stiffness: Sequence[Array], loads: Array, options: SolverOptions
) -> CellFields:
    """Solve for displacements and stresses under macroscopic strains of shape (loads, 3)."""
    grid = problem.grid
    problem.assemble(stiffness)
    vectors = solve(problem.solver(options, problem.matrix), problem.loads(loads)).vectors
    fluctuation = fem.Function(problem.space)
    rank_cells = np.arange(len(problem.wedge), dtype=np.int32)
    nodal_strain = at_points(strain(fluctuation), vertices_and_midpoints())
    positions = grid.positions(problem.map)
    displacement = np.empty((grid.nodes, 2, len(vectors)))
    prism_strains = np.empty((len(grid.cells), NODES, 3, len(vectors)))
    for k, vector in enumerate(vectors):
        u, uniform = problem.elimination.displacements(vector), np.asarray(loads[k], float)
        tensor = np.array([[uniform[0], uniform[2] / 2], [uniform[2] / 2, uniform[1]]])
        displacement[problem.node, :, k] = u + positions[problem.node, :2] @ tensor
        fluctuation.x.array[:] = u.ravel()
        strains = nodal_strain.eval(problem.mesh, rank_cells).reshape(len(rank_cells), NODES, 3)
        prism_strains[problem.wedge, ..., k] = strains + uniform
    stress = np.stack(stiffness)[grid.phase][:, None] @ prism_strains
    # one point for each node and phase, since stresses jump at the interface
    point_keys = grid.cells + grid.phase[:, None] * grid.nodes
    points, cells = np.unique(point_keys, return_inverse=True)
    cells = cells.reshape(point_keys.shape)
    mean_stress = np.zeros((len(points), 3, len(vectors)))
    np.add.at(mean_stress, cells, stress)
    mean_stress /= np.bincount(cells.ravel())[:, None, None]
    nodes = points % grid.nodes
    fields = displacement[nodes], mean_stress
    return CellFields(positions[nodes], cells, grid.phase, *fields, grid.names, nodes)
