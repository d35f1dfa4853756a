"""Displacements and stresses at the nodes of the product space, from solutions on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import require
from alphacut.rve.fenicsx import at_points, fem, ufl
from alphacut.rve.mesh.prism_grid import NAMES, LevelSet
from alphacut.rve.mesh.wedge import vertices_and_midpoints
from alphacut.rve.prism.cell_fields import CellFields
from alphacut.rve.prism.problem import PrismProblem
from alphacut.rve.solver.form import strain
from alphacut.rve.solver.krylov import SolverOptions, solve


def solved_fields(
    problem: PrismProblem, stiffness: Sequence[Array], loads: Array, options: SolverOptions
) -> CellFields:
    """Solve a cell and return its displacements and stresses under macroscopic strains.

    All ranks of the problem must call, and get the fields of the whole cell.

    Args:
        problem: The cell, moved to its radius map.
        stiffness: Stiffness of each phase in Voigt order (11, 22, 12 with 2 ε12), (3, 3) each, in
            Pa, in the order of the problem's phases.
        loads: Macroscopic strains (ε11, ε22, 2 ε12), shape (loads, 3).
        options: PETSc's options of the linear solver.

    Returns:
        Total displacements in halves of the cell's side and stresses in Pa at the nodes, for each
        load. A node where phases meet stands once for each of them.

    Raises:
        ConvergenceError: The linear solver did not reach its tolerance.
        RefusedError: PETSc does not use one of the options.
    """
    matrix = problem.assemble(stiffness)
    solutions = solve(problem.solver(options, matrix), problem.loads(loads))
    u = fem.Function(problem.space)
    fluctuations, prism_strains = [], []
    for vector, load in zip(solutions.vectors, loads, strict=True):
        values = problem.elimination.displacements(vector)
        u.x.array[:] = values.ravel()
        fluctuations.append(values)
        prism_strains.append(_at_nodes_of_prisms(problem, strain(u)) + load)
    phase = phase_at_nodes(problem)
    stress = np.stack(stiffness)[phase] @ np.stack(prism_strains, axis=-1)
    return nodal_fields(problem, np.stack(fluctuations, axis=-1), loads, stress, phase)


def fields_of_solution(
    problem: PrismProblem,
    u: fem.Function,
    stress: Mapping[str, ufl.core.expr.Expr],
    load: Array,
    scalars: Mapping[str, ufl.core.expr.Expr],
) -> CellFields:
    """Return displacements and stresses at the nodes, for a solution of a material law of the user.

    All ranks of the problem must call, and get the fields of the whole cell.

    Args:
        problem: The cell that it was solved on.
        u: Fluctuation of the displacements, without the displacements of the macroscopic strain,
            in halves of the cell's side.
        stress: (σ11, σ22, σ12) of each phase by its name, UFL expressions of three components, in
            Pa.
        load: Macroscopic strain (ε11, ε22, 2 ε12), shape (3,).
        scalars: Further fields by name, scalar UFL expressions.

    Returns:
        Total displacements in halves of the cell's side, stresses in Pa and scalars at the nodes,
        for the one load. A stress or scalar is the mean over the prisms of one phase that meet in
        the node.

    Raises:
        RefusedError: The names in `stress` are not exactly those of the phases, or an expression
            has not three components, or of `scalars` not one.
    """
    names = problem.grid.names
    require(set(stress) == set(names), "stress of phases", list(stress), ", ".join(names))
    for name, expression in stress.items():
        shape = expression.ufl_shape
        require(shape == (3,), f"shape of the stress of {name}", shape, "(3,): σ11, σ22, σ12")
    for name, expression in scalars.items():
        shape = getattr(expression, "ufl_shape", type(expression).__name__)
        require(shape == (), f"shape of the scalar {name}", shape, "(), a UFL expression")
    phase = phase_at_nodes(problem)
    # Every phase's stress is evaluated in all prisms, since a level set may cut a prism; shape
    # (phases, prisms, 15, 3). Then the stress of the phase at each node is taken.
    of_phases = np.stack([_at_nodes_of_prisms(problem, stress[name]) for name in names])
    prism, node = np.indices(phase.shape)
    values = of_phases[phase, prism, node][..., np.newaxis]
    fluctuation = u.x.array.reshape(-1, 2, 1)
    fields = nodal_fields(problem, fluctuation, np.array([load], float), values, phase)
    order = np.argsort(np.concatenate(problem.comm.allgather(problem.wedge)))
    points = fields.cells.ravel()
    means = {}
    for name, expression in scalars.items():
        of_ranks = problem.comm.allgather(_at_nodes_of_prisms(problem, expression))
        at_nodes = np.concatenate(of_ranks)[order]
        means[name] = np.bincount(points, at_nodes.ravel()) / np.bincount(points)
    return replace(fields, scalars=means)


def phase_at_nodes(problem: PrismProblem) -> Ints:
    """Return the index of the phase at each node of this rank's prisms, shape (prisms, 15).

    It is the phase of the prism. For a level set z(x1, x2, θ) it is 1 (inclusion) at nodes with z <
    0 and 0 (matrix) at all others (eq. 14).

    Args:
        problem: The cell, moved to its radius map or level set.

    Raises:
        RefusedError: The level set does not give a number at each node.
    """
    grid = problem.grid
    if isinstance(problem.map, LevelSet):
        positions = grid.positions(problem.map)[grid.cells[problem.wedge]]
        return np.asarray(problem.map.values(positions) < 0, int)
    shape = len(problem.wedge), grid.cells.shape[1]
    return np.broadcast_to(grid.phase[problem.wedge, np.newaxis], shape)


def _at_nodes_of_prisms(problem: PrismProblem, expression: ufl.core.expr.Expr) -> Array:
    """Return an expression at the nodes of prisms, shape (prisms, 15, …), … its own shape."""
    cells = np.arange(len(problem.wedge), dtype=np.int32)
    values = at_points(expression, vertices_and_midpoints()).eval(problem.mesh, cells)
    return np.asarray(values).reshape(len(cells), 15, *expression.ufl_shape)


def nodal_fields(
    problem: PrismProblem, fluctuation: Array, loads: Array, stress: Array, phase: Ints
) -> CellFields:
    """Return total displacements, and stresses as means over the prisms that meet in a node.

    Only prisms of the same phase at a node enter a mean, since stresses jump between phases. All
    ranks of the problem must call.

    Args:
        problem: The cell.
        fluctuation: Displacements at this rank's nodes of DOLFINx, without the displacements of the
            macroscopic strain, in halves of the cell's side, shape (nodes, 2, loads).
        loads: Macroscopic strains (ε11, ε22, 2 ε12), shape (loads, 3).
        stress: (σ11, σ22, σ12) at the 15 nodes of each of this rank's prisms, shape (prisms, 15, 3,
            loads), in Pa.
        phase: Index of the phase at the nodes of these prisms, shape (prisms, 15).

    Returns:
        Fields of the whole cell on all ranks, with one point for each pair of a node and a phase
        that meets there, sorted by phase and then by node; `cells` are indices of these points, in
        the order of the grid. The phase of a prism that a level set cuts is the phase of most of
        its 15 nodes.
    """
    grid = problem.grid
    positions = grid.positions(problem.map)
    wedge, stress, phase, node, fluctuation = [
        np.concatenate(problem.comm.allgather(of_rank))
        for of_rank in (problem.wedge, stress, phase, problem.node, fluctuation)
    ]
    order = np.argsort(wedge)
    stress = stress[order]
    phase = phase[order]
    eps11, eps22, gamma12 = np.moveaxis(loads, -1, 0)
    tensors = np.array([[eps11, gamma12 / 2], [gamma12 / 2, eps22]])  # (2, 2, loads)
    uniform = np.einsum("nj,ijl->nil", positions[node, :2], tensors)
    displacement = np.empty((grid.nodes, 2, len(loads)))
    displacement[node] = fluctuation + uniform

    # A point is a pair of a phase and a node, numbered phase · nodes + node.
    point_keys = grid.cells + phase * grid.nodes
    points, cells = np.unique(point_keys, return_inverse=True)
    cells = cells.reshape(point_keys.shape)
    node = points % grid.nodes
    mean_stress = np.zeros((len(points), 3, len(loads)))
    np.add.at(mean_stress, cells, stress)
    mean_stress /= np.bincount(cells.ravel())[:, np.newaxis, np.newaxis]
    return CellFields(
        points=positions[node],
        cells=cells,
        # Only level sets cut prisms, and they have the phases 0 and 1.
        phase=np.rint(phase.mean(axis=1)).astype(int),
        displacement=displacement[node],
        stress=mean_stress,
        names=NAMES if isinstance(problem.map, LevelSet) else grid.names,
        node=node,
        writes=problem.comm.rank == 0,
    )
