"""Displacements and stress functions over prisms, which bound the stiffness from both sides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from alphacut.base.arrays import Array
from alphacut.rve.fenicsx import PETSc, basix, compiled, fem, ufl
from alphacut.rve.mesh.wedge import POINTS_PER_SLICE, SLICES_PER_LAYER, prism_rule
from alphacut.rve.prism.problem import PrismProblem
from alphacut.rve.solver.form import strain
from alphacut.rve.solver.krylov import SolverOptions, solve

LOADS: Array = np.eye(3)
"""Unit mean strains (ε11, ε22, 2 ε12), the rows."""


@dataclass(frozen=True, eq=False)
class PrismFields:
    """Displacements and stress functions under unit mean strains in this rank's prisms.

    The stress of a stress function ψ has the rows σ_i1 = Σ_i1 + ∂ψ_i/∂x2 and σ_i2 = Σ_i2 −
    ∂ψ_i/∂x1, with a symmetric Σ that depends on θ alone. It has no divergence at any θ, and
    continuous tractions, since ψ is continuous and periodic; it need not be symmetric.

    Args:
        nodes: Positions (x1, x2), shape (prisms, 15, 2).
        displacement: Periodic part of the displacements, shape (prisms, 15, 2, loads).
        potential: ψ in Pa times the unit of length, of the same shape.
        mean_stress: Σ as (σ11, σ22, σ12) in Pa at the Gauss points of each layer, shape (layers, 3,
            3, loads). Between them it is quadratic in θ.
    """

    nodes: Array
    displacement: Array
    potential: Array
    mean_stress: Array

    def mean_stress_at(self, z: float) -> Array:
        """Return Σ of each layer at the height z in [0, 1] within it, shape (layers, 3, loads)."""
        gauss = prism_rule()[0][::POINTS_PER_SLICE, 2]
        weights = []
        for k, height in enumerate(gauss):
            others = np.delete(gauss, k)
            weights.append(np.prod((z - others) / (height - others)))
        return np.asarray(np.tensordot(weights, self.mean_stress, axes=(0, 1)))


def solved_fields_of_bounds(
    problem: PrismProblem,
    stiffness: Sequence[Array],
    *,
    rotation_factor: float,
    options: SolverOptions,
) -> PrismFields:
    """Solve for displacements, and for stress functions whose stress is near to theirs.

    With the displacements v under a mean strain, the stress functions in the space of v minimise
    the mean over cell and θ of

        (sym σ − C ε(v)) : C⁻¹ (sym σ − C ε(v)) + λ A : A,

    where A is the skew part of σ. Σ is the mean stress of v.

    Args:
        problem: The cell, moved to its distribution of θ. Its stiffness matrix is overwritten.
        stiffness: Stiffness C of each phase in Voigt order, positive definite, (3, 3), in Pa.
        rotation_factor: λ in 1/Pa, positive.
        options: PETSc's options of the linear solver.

    Raises:
        ConvergenceError: The linear solver did not reach its tolerance.
        RefusedError: PETSc does not use one of the options.
    """
    matrix = problem.assemble(stiffness)
    displacements = solve(problem.solver(options, matrix), problem.loads(LOADS)).vectors
    slices = problem.slice_strains(LOADS, displacements).stress(stiffness)
    mean_stress = slices.reshape(-1, SLICES_PER_LAYER, *slices.shape[1:])

    compliance = fem.Function(fem.functionspace(problem.mesh, ("DG", 0, (3, 3))))
    phase = problem.grid.phase[problem.wedge]
    compliance.x.array[:] = np.linalg.inv(np.array(stiffness))[phase].ravel()
    points, weights = prism_rule()
    element = basix.ufl.quadrature_element(
        "prism", value_shape=(3,), points=points, weights=weights
    )
    uniform_stress = fem.Function(fem.functionspace(problem.mesh, element))
    uniform_strain = fem.Constant(problem.mesh, np.zeros(3))
    v = fem.Function(problem.space)

    trial = ufl.TrialFunction(problem.space)
    test = ufl.TestFunction(problem.space)
    dx = next(iter(problem.dx.values()))("everywhere")
    # A : A = (σ12 − σ21)²/2
    energy = ufl.dot(compliance * _symmetric_stress(trial), _symmetric_stress(test))
    energy += rotation_factor / 2 * _asymmetry(trial) * _asymmetry(test)
    difference = uniform_strain + strain(v) - compliance * uniform_stress
    work = ufl.dot(difference, _symmetric_stress(test))
    operator = problem.assemble_operator(compiled(problem.density * energy * dx))
    load = compiled(problem.density * work * dx)
    loads = []
    for k, vector in enumerate(displacements):
        uniform_strain.value[:] = LOADS[k]
        v.x.array[:] = problem.elimination.displacements(vector).ravel()
        of_slices = mean_stress[problem.layer, ..., k]
        uniform_stress.x.array[:] = np.repeat(of_slices, POINTS_PER_SLICE, axis=1).ravel()
        loads.append(problem.elimination.forces(fem.assemble_vector(load).array))
    potentials = solve(problem.solver(options, operator), loads).vectors

    positions = problem.grid.positions(problem.map)[:, :2]
    nodes = problem.space.dofmap.list
    return PrismFields(
        nodes=positions[problem.node[nodes]],
        displacement=_at_nodes(problem, displacements),
        potential=_at_nodes(problem, potentials),
        mean_stress=mean_stress,
    )


def _symmetric_stress(potential: Any) -> Any:
    """Return (σ11, σ22, (σ12 + σ21)/2) of a stress function, a UFL expression."""
    gradient = ufl.grad(potential)
    shear = (gradient[1, 1] - gradient[0, 0]) / 2
    return ufl.as_vector([gradient[0, 1], -gradient[1, 0], shear])


def _asymmetry(potential: Any) -> Any:
    """Return σ12 − σ21 of a stress function, a UFL expression."""
    gradient = ufl.grad(potential)
    return -gradient[0, 0] - gradient[1, 1]


def _at_nodes(problem: PrismProblem, vectors: Sequence[PETSc.Vec]) -> Array:
    """Return fields at the nodes of this rank's prisms, shape (prisms, 15, 2, fields)."""
    values = [problem.elimination.displacements(vector) for vector in vectors]
    return np.asarray(np.stack(values, axis=-1)[problem.space.dofmap.list])
