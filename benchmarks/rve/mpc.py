"""The same planar cells by dolfinx_mpc, for comparison."""

from __future__ import annotations

from time import process_time
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from alphacut.rve.cell import Phase
from alphacut.rve.result import effective_modulus
from alphacut.rve.slices.theta_rule import theta_rule
from alphacut.stochastic import RadiusMap
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    from alphacut.rve.mesh.planar import PlanarMesh

LOADS = np.array([[[1.0, 0.0], [0.0, 1.0]], [[0.0, 1.0], [1.0, 0.0]]])  # eq. 15 for unit strains
AREA = 4.0


def mpc_modulus(
    radius_map: RadiusMap,
    matrix: Phase,
    inclusion: Phase,
    *,
    order: int,
    mesh_size: float,
    points: int,
) -> tuple[float, float, int]:
    """E in Pa by Gauss nodes in θ, processor seconds, and largest unknowns."""
    rule = theta_rule(radius_map, points=points)
    solved = [
        _cell(float(r), matrix, inclusion, order=order, mesh_size=mesh_size)
        for r in radius_map(rule.nodes)
    ]
    bulk, shear = (float(rule.weights @ np.array([cell[0][k] for cell in solved])) for k in (0, 1))
    return (
        effective_modulus(0.01 * bulk, 0.01 * shear)[0],
        sum(cell[1] for cell in solved),
        max(cell[2] for cell in solved),
    )


def _cell(
    radius: float, matrix: Phase, inclusion: Phase, *, order: int, mesh_size: float
) -> tuple[Array, float, int]:
    """σ11 and σ12 of unit loads, in Pa, processor seconds, and unknowns."""
    import dolfinx_mpc
    from alphacut.rve.mesh.planar import planar_mesh
    from petsc4py import PETSc

    started = process_time()
    space, tags = _space(planar_mesh(radius, size=mesh_size), order)
    constraint, fixed = _periodic(space)
    # forms anew for every cell are this comparison's own cost of convenience: left out
    begun = process_time()
    forms = _forms(space, tags, constraint, (matrix, inclusion))
    compiled = process_time() - begun
    system = dolfinx_mpc.assemble_matrix(forms.bilinear, constraint, bcs=[fixed])
    solver = PETSc.KSP().create(space.mesh.comm)
    solver.setOperators(system)
    solver.setType("preonly")
    solver.getPC().setType("lu")
    found = np.array([_mean_stress(forms, k, solver, constraint, fixed) for k in range(len(LOADS))])
    return found, process_time() - started - compiled, int(system.getSize()[0])


def _space(mesh: PlanarMesh, order: int) -> tuple[Any, Any]:
    """Displacements on curved triangles, and tags: 0 in the matrix, 1 in the particle."""
    import basix.ufl
    import dolfinx
    from alphacut.rve.mesh.planar import curved_nodes
    from mpi4py import MPI

    points, cells = curved_nodes(mesh, order)
    element = basix.ufl.element("Lagrange", "triangle", order, shape=(2,))
    domain = dolfinx.mesh.create_mesh(MPI.COMM_SELF, cells=cells, x=points, e=element)
    inside = mesh.inside[domain.topology.original_cell_index].astype(np.int32)
    tags = dolfinx.mesh.meshtags(domain, 2, np.arange(inside.size, dtype=np.int32), inside)
    return dolfinx.fem.functionspace(domain, element), tags


def _periodic(space: Any) -> tuple[Any, Any]:
    """The periodic constraint, and the corners fixed."""
    import dolfinx_mpc
    from dolfinx import fem

    corner = fem.locate_dofs_geometrical(
        space, lambda x: np.isclose(np.abs(x[0]), 1) & np.isclose(np.abs(x[1]), 1)
    )
    fixed = fem.dirichletbc(np.zeros(2), corner, space)
    constraint = dolfinx_mpc.MultiPointConstraint(space)
    for axis in (0, 1):
        constraint.create_periodic_constraint_geometrical(
            space, _side(axis), _partner(axis), [fixed]
        )
    constraint.finalize()
    return constraint, fixed


class _Forms(NamedTuple):
    """Compiled forms of a cell: stiffness, load, and mean stresses."""

    bilinear: Any
    linear: Any
    means: list[Any]
    strain: Any
    displacement: Any


def _forms(space: Any, tags: Any, constraint: Any, phases: tuple[Phase, Phase]) -> _Forms:
    import ufl
    from dolfinx import fem

    strain = fem.Constant(space.mesh, LOADS[0])
    degree = {"quadrature_degree": 2 * space.element.basix_element.degree}
    dx = ufl.Measure("dx", domain=space.mesh, subdomain_data=tags, metadata=degree)
    trial, test = ufl.TrialFunction(space), ufl.TestFunction(space)
    parts = [(dx(k), phase.stiffness) for k, phase in enumerate(phases)]

    def stress(e: Any, c: Array) -> Any:  # plane strain, eq. 6
        return c[0, 1] * ufl.tr(e) * ufl.Identity(2) + 2 * c[2, 2] * e

    bilinear = fem.form(
        sum(
            ufl.inner(stress(ufl.sym(ufl.grad(trial)), c), ufl.sym(ufl.grad(test))) * dv
            for dv, c in parts
        )
    )
    linear = fem.form(
        -sum(ufl.inner(stress(strain, c), ufl.sym(ufl.grad(test))) * dv for dv, c in parts)
    )
    displacement = fem.Function(constraint.function_space)
    total = strain + ufl.sym(ufl.grad(displacement))
    means = [fem.form(sum(stress(total, c)[0, k] * dv for dv, c in parts)) for k in (0, 1)]
    return _Forms(bilinear, linear, means, strain, displacement)


def _mean_stress(forms: _Forms, load: int, solver: Any, constraint: Any, fixed: Any) -> float:
    """σ11 under the first load, σ12 under the second, in Pa."""
    import dolfinx_mpc
    from dolfinx import fem

    forms.strain.value[:] = LOADS[load]
    right = dolfinx_mpc.assemble_vector(forms.linear, constraint)
    dolfinx_mpc.apply_lifting(right, [forms.bilinear], [[fixed]], constraint)
    fem.petsc.set_bc(right, [fixed])
    solver.solve(right, forms.displacement.x.petsc_vec)
    forms.displacement.x.scatter_forward()
    constraint.backsubstitution(forms.displacement)
    return float(fem.assemble_scalar(forms.means[load]) / AREA)


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
