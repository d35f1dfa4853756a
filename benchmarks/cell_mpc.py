"""The same planar cells by dolfinx_mpc: its periodic constraint and LU, for comparison in the charts alone."""

from __future__ import annotations

from time import process_time

import numpy as np

from rve.cell import Phase
from rve.result import effective_modulus
from rve.slices_rule import theta_rule
from stochastic import RadiusMap
from stochastic.truncated_normal import Array

LOADS = np.array([[[1.0, 0.0], [0.0, 1.0]], [[0.0, 1.0], [1.0, 0.0]]])  # eq. 15 for unit strains
AREA = 4.0


def mpc_modulus(
    radius_map: RadiusMap, matrix: Phase, inclusion: Phase, *, order: int, mesh_size: float, points: int
) -> tuple[float, float, int]:
    """E in Pa by Gauss nodes in θ, the processor seconds without compilation, and the unknowns of the largest cell."""
    rule = theta_rule(radius_map, points=points)
    solved = [_cell(float(r), matrix, inclusion, order=order, mesh_size=mesh_size) for r in radius_map(rule.nodes)]
    bulk, shear = (float(rule.weights @ np.array([cell[0][k] for cell in solved])) for k in (0, 1))
    return effective_modulus(0.01 * bulk, 0.01 * shear)[0], sum(cell[1] for cell in solved), max(cell[2] for cell in solved)


def _cell(radius: float, matrix: Phase, inclusion: Phase, *, order: int, mesh_size: float) -> tuple[Array, float, int]:
    """σ11 for ε11 = ε22 = 1 and σ12 for ε12 = 1, in Pa."""
    import dolfinx_mpc
    import ufl
    from dolfinx import fem
    from petsc4py import PETSc

    from rve.planar import PlanarCell
    from rve.planar_mesh import planar_mesh

    started = process_time()
    cell = PlanarCell(planar_mesh(radius, size=mesh_size), order)
    space, domain = cell.space, cell.domain
    corner = fem.locate_dofs_geometrical(space, lambda x: np.isclose(np.abs(x[0]), 1) & np.isclose(np.abs(x[1]), 1))
    fixed = fem.dirichletbc(np.zeros(2), corner, space)
    constraint = dolfinx_mpc.MultiPointConstraint(space)
    for axis in (0, 1):
        constraint.create_periodic_constraint_geometrical(space, _side(axis), _partner(axis), [fixed])
    constraint.finalize()

    strain = fem.Constant(domain, LOADS[0])
    dx = ufl.Measure("dx", domain=domain, subdomain_data=cell.tags, metadata={"quadrature_degree": 2 * order})
    trial, test = ufl.TrialFunction(space), ufl.TestFunction(space)
    phases = [p.stiffness for p in (matrix, inclusion)]

    def stress(e, c):  # plane strain, eq. 6
        return c[0, 1] * ufl.tr(e) * ufl.Identity(2) + 2 * c[2, 2] * e

    begun = process_time()  # forms anew for every cell are this comparison's own cost of convenience: left out
    bilinear = fem.form(sum(ufl.inner(stress(ufl.sym(ufl.grad(trial)), c), ufl.sym(ufl.grad(test))) * dx(k) for k, c in enumerate(phases)))
    linear = fem.form(-sum(ufl.inner(stress(strain, c), ufl.sym(ufl.grad(test))) * dx(k) for k, c in enumerate(phases)))
    displacement = fem.Function(constraint.function_space)
    means = [fem.form(sum(stress(strain + ufl.sym(ufl.grad(displacement)), c)[0, k] * dx(t) for t, c in enumerate(phases))) for k in (0, 1)]
    compiled = process_time() - begun

    system = dolfinx_mpc.assemble_matrix(bilinear, constraint, bcs=[fixed])
    solver = PETSc.KSP().create(domain.comm)
    solver.setOperators(system)
    solver.setType("preonly")
    solver.getPC().setType("lu")
    found = np.empty(2)
    for k, load in enumerate(LOADS):
        strain.value[:] = load
        right = dolfinx_mpc.assemble_vector(linear, constraint)
        dolfinx_mpc.apply_lifting(right, [bilinear], [[fixed]], constraint)
        fem.petsc.set_bc(right, [fixed])
        solver.solve(right, displacement.x.petsc_vec)
        displacement.x.scatter_forward()
        constraint.backsubstitution(displacement)
        found[k] = fem.assemble_scalar(means[k]) / AREA
    return found, process_time() - started - compiled, int(system.getSize()[0])


def _side(axis: int):
    def on_side(x: Array) -> Array:
        return np.isclose(x[axis], 1) & ((axis == 0) | ~np.isclose(x[0], 1))

    return on_side


def _partner(axis: int):
    def partner(x: Array) -> Array:
        moved = x.copy()
        moved[axis] -= 2
        return moved

    return partner
