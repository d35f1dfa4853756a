"""A planar cell whose stiffness DOLFINx assembles, as a reference for the program's own loop."""

import basix.ufl
import dolfinx
import numpy as np
import scipy.sparse as sp
import ufl
from dolfinx import fem
from mpi4py import MPI

from alphacut.rve.cell import Phase
from alphacut.rve.mesh.planar import curved_nodes


class ByDolfinx:
    """Unreduced stiffness of each phase, and P of K_per = Pᵀ K P, on a mesh's curved triangles."""

    def __init__(self, mesh, order):
        points, cells = curved_nodes(mesh, order)
        element = basix.ufl.element("Lagrange", "triangle", order, shape=(2,))
        domain = dolfinx.mesh.create_mesh(MPI.COMM_SELF, cells=cells, x=points, e=element)
        space = fem.functionspace(domain, element)
        inside = mesh.inside[domain.topology.original_cell_index].astype(np.int32)
        tags = dolfinx.mesh.meshtags(domain, 2, np.arange(inside.size, dtype=np.int32), inside)
        u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
        degree = {"quadrature_degree": max(2 * order - (order == 1), 1)}
        dx = ufl.Measure("dx", domain=domain, subdomain_data=tags, metadata=degree)
        self.lame = [fem.Constant(domain, np.float64(1)) for _ in range(2)]
        density = self.lame[0] * ufl.div(u) * ufl.div(v)
        density += 2 * self.lame[1] * ufl.inner(ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v)))
        self.forms = [fem.form(density * dx(tag)) for tag in (0, 1)]
        self.coordinates = space.tabulate_dof_coordinates()[:, :2]
        x, y = self.coordinates.T
        self.affine = np.zeros((2 * len(x), 3))
        self.affine[0::2, 0], self.affine[1::2, 1] = x, y
        self.affine[0::2, 2], self.affine[1::2, 2] = y / 2, x / 2
        wrapped = np.where(self.coordinates > 1 - 1e-9, -1.0, self.coordinates)
        _, node = np.unique(np.round(wrapped * 1e7), axis=0, return_inverse=True)
        target = (2 * node.ravel()[:, None] + np.arange(2)).ravel() - 2
        free = np.flatnonzero(target >= 0)
        shape = target.size, 2 * int(node.max())
        self.periodic = sp.csr_matrix((np.ones(free.size), (free, target[free])), shape=shape)

    def stiffness_of(self, tag, phase):
        """Unreduced stiffness of phase 0 or 1, in Pa."""
        unit = phase.stiffness
        self.lame[0].value, self.lame[1].value = unit[0, 1], unit[2, 2]
        return fem.assemble_matrix(self.forms[tag]).to_scipy().tocsr()

    def stiffness(self, matrix, inclusion):
        """Homogenised, shape (3, 3), in Pa."""
        whole = self.stiffness_of(0, matrix) + self.stiffness_of(1, inclusion)
        reduced = (self.periodic.T @ whole @ self.periodic).tocsc()
        load = self.periodic.T @ (whole @ self.affine)
        moved = self.affine - self.periodic @ sp.linalg.spsolve(reduced, load)
        return moved.T @ (whole @ moved) / 4


def cells():
    """Radii, orders, phases and mesh sizes to compare."""
    yield 0.6, 1, Phase(20e9), Phase(80e9), 0.3
    yield 0.6, 2, Phase(20e9, 0.1), Phase(80e9, 0.45), 0.3
    yield 0.85, 3, Phase(20e9, 0.3), Phase(2e5), 0.4
    yield 0.2, 4, Phase(20e9), Phase(2e14, 0.35), 0.5
