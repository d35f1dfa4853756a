"""The matrix-free operator against DOLFINx's assembled biquadratic elements."""

import numpy as np
import pytest

from alphacut.rve.image.fields.element import Operator, displacement_element

pytest.importorskip("alphacut.rve.fenicsx")


@pytest.mark.parametrize("shape", [(4, 3), (5, 6)])
def test_forces_are_those_of_assembled_elements_folded_at_the_edges(shape):
    import ufl
    from dolfinx import fem, mesh
    from mpi4py import MPI

    rng = np.random.default_rng(0)
    rows, columns = shape
    aspect = 0.7
    bulk, shear = rng.uniform(1, 9, (2, rows, columns))
    fields = rng.normal(size=(8, rows, columns))
    corners = [np.zeros(2), np.array([columns, rows * aspect])]
    kind = mesh.CellType.quadrilateral
    grid = mesh.create_rectangle(MPI.COMM_SELF, corners, [columns, rows], cell_type=kind)
    space = fem.functionspace(grid, ("Lagrange", 2, (2,)))
    flat = fem.functionspace(grid, ("DG", 0))
    k, g = fem.Function(flat), fem.Function(flat)
    x, y = (flat.tabulate_dof_coordinates()[:, :2] / (1, aspect)).astype(int).T
    k.x.array[:], g.x.array[:] = bulk[y, x], shear[y, x]
    nodes = np.rint(2 * space.tabulate_dof_coordinates()[:, :2] / (1, aspect)).astype(int)
    half_x, half_y = nodes.T % 2
    place = (nodes[:, 1] // 2 % rows, nodes[:, 0] // 2 % columns)
    kinds = [4 * c + 2 * half_y + half_x for c in range(2)]
    u, v = fem.Function(space), ufl.TestFunction(space)
    u.x.array[:] = np.stack([fields[kind, *place] for kind in kinds], axis=1).ravel()
    strain, test = ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))
    stress = k * ufl.tr(strain) * ufl.Identity(2) + 2 * g * ufl.dev(strain)
    forces = fem.assemble_vector(fem.form(ufl.inner(stress, test) * ufl.dx)).array.reshape(-1, 2)
    folded = np.zeros_like(fields)
    for component, kind in enumerate(kinds):
        np.add.at(folded, (kind, *place), forces[:, component])
    operator = Operator(displacement_element(aspect), bulk, shear)
    found = aspect * operator.apply(fields[None])[0]  # modes are means over a pixel
    assert np.allclose(found, folded, rtol=1e-11, atol=1e-11)
