"""Planar cell problem in DOLFINx: one mesh, any materials, three loads at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from time import perf_counter

import alphacut.rve.petsc  # noqa: F401
from alphacut.rve.interruption import uninterrupted

with uninterrupted():
    import basix.ufl
    import dolfinx
    from dolfinx import fem

import numpy as np
import scipy.sparse as sp
import ufl
from mpi4py import MPI

from alphacut.rve.cell import Phase
from alphacut.rve.mesh.planar import PlanarMesh, curved_nodes
from alphacut.rve.mesh.triangulation import Integers
from alphacut.rve.planar.system import ModulusBasis, Pencil
from alphacut.stochastic.theta.truncated_normal import Array


@dataclass
class PlanarCell:
    """Lagrange triangles of `order`, isoparametric, periodic by elimination.

    Args:
        mesh: Triangles of the cell.
        order: Polynomial degree of field and geometry, 1 to 4.
        seconds: Filled with the wall time of mesh, jit and assemble.
        factorisations: Counts those made.

    Raises:
        ValueError: `order` out of range.
    """

    mesh: PlanarMesh
    order: int
    seconds: dict[str, float] = field(default_factory=dict)
    factorisations: int = 0

    def __post_init__(self) -> None:
        if not 1 <= self.order <= 4:
            raise ValueError(
                f"the order of the planar elements is {self.order}; it must be 1, 2, 3 or 4"
            )
        started = perf_counter()
        points, cells = curved_nodes(self.mesh, self.order)
        element = basix.ufl.element("Lagrange", "triangle", self.order, shape=(2,))
        self.domain = dolfinx.mesh.create_mesh(MPI.COMM_SELF, cells=cells, x=points, e=element)
        self.space = fem.functionspace(self.domain, element)
        self.seconds["mesh"] = perf_counter() - started
        self._compile()

    @cached_property
    def tags(self) -> dolfinx.mesh.MeshTags:
        """Cell tags: 0 in the matrix, 1 in the particle."""
        inside = self.mesh.inside[self.domain.topology.original_cell_index].astype(np.int32)
        return dolfinx.mesh.meshtags(self.domain, 2, np.arange(inside.size, dtype=np.int32), inside)

    def _compile(self) -> None:
        """The stiffness form of each phase, Lamé's constants left open."""
        started = perf_counter()
        trial, test = ufl.TrialFunction(self.space), ufl.TestFunction(self.space)
        self._lame = [fem.Constant(self.domain, np.float64(1)) for _ in range(2)]
        degree = 2 * self.order if self.order > 1 else 1
        dx = ufl.Measure(
            "dx",
            domain=self.domain,
            subdomain_data=self.tags,
            metadata={"quadrature_degree": degree},
        )
        density = self._lame[0] * ufl.div(trial) * ufl.div(test)
        # eq. 7
        density += 2 * self._lame[1] * ufl.inner(ufl.sym(ufl.grad(trial)), ufl.sym(ufl.grad(test)))
        self._forms = [fem.form(density * dx(tag)) for tag in (0, 1)]
        self.seconds["jit"] = perf_counter() - started

    def _stiffness_of(self, tag: int, poisson: float) -> sp.bsr_matrix:
        """Unreduced stiffness of one phase for a modulus of 1 Pa."""
        unit = Phase(1.0, poisson).stiffness
        self._lame[0].value, self._lame[1].value = unit[0, 1], unit[2, 2]
        return fem.assemble_matrix(self._forms[tag]).to_scipy()

    @cached_property
    def coordinates(self) -> Array:
        """Positions of the nodes, shape (n, 2)."""
        return np.asarray(self.space.tabulate_dof_coordinates()[:, :2])

    @cached_property
    def periodic(self) -> sp.csr_matrix:
        """P of K_per = Pᵀ K P: nodes at 1 follow those at −1, the first node is fixed."""
        node = self.periodic_nodes
        target = (2 * node[:, None] + np.arange(2)).ravel() - 2
        free = np.flatnonzero(target >= 0)
        return sp.csr_matrix(
            (np.ones(free.size), (free, target[free])), shape=(target.size, 2 * int(node.max()))
        )

    @cached_property
    def periodic_nodes(self) -> Integers:
        """Number of each node in the periodic cell, shape (n,)."""
        wrapped = np.where(self.coordinates > 1 - 1e-9, -1.0, self.coordinates)
        _, node = np.unique(np.round(wrapped * 1e8).astype(np.int64), axis=0, return_inverse=True)
        return node.ravel()

    @cached_property
    def affine(self) -> Array:
        """Displacements of the three unit strains (11, 22, 12 with 2 ε12 = 1), shape (2n, 3)."""
        x, y = self.coordinates.T
        zero = np.zeros_like(x)
        return np.stack(
            [np.stack([x, zero, y / 2], axis=-1), np.stack([zero, y, x / 2], axis=-1)], axis=1
        ).reshape(-1, 3)

    def stiffness(
        self, matrix: Phase, inclusions: Sequence[Phase], *, share: bool = False
    ) -> Array:
        """Homogenised stiffness of m inclusions in Pa, shape (m, 3, 3).

        Args:
            matrix: Material outside the particle.
            inclusions: Materials of the particle; those of one Poisson's ratio share assembly and
                ordering.
            share: Whether many of them share a few full solutions too (`ModulusBasis`): faster, but
                the last digits of one then depend on which others come along.
        """
        found = np.empty((len(inclusions), 3, 3))
        for poisson in dict.fromkeys(p.poisson for p in inclusions):
            places = [k for k, p in enumerate(inclusions) if p.poisson == poisson]
            pencil = self._pencil(matrix, poisson)
            moduli = np.array([inclusions[k].modulus for k in places])
            if share and moduli.size > 2:
                basis = ModulusBasis(pencil)
                found[places] = basis.stiffness(moduli)
                self.factorisations += basis.size
            else:
                found[places] = [pencil.solve(float(e))[1] for e in moduli]
                self.factorisations += moduli.size
        return found

    def displacement(self, matrix: Phase, inclusion: Phase) -> Array:
        """Displacements under the three unit strains at the nodes, shape (2n, 3)."""
        pencil = self._pencil(matrix, inclusion.poisson)
        return np.asarray(self.affine - self.periodic @ pencil.solve(inclusion.modulus)[0])

    def _pencil(self, matrix: Phase, poisson: float) -> Pencil:
        """The cell's stiffness as an affine function of the particle's modulus."""
        started = perf_counter()
        fixed = matrix.modulus * self._stiffness_of(0, matrix.poisson)
        unit = self._stiffness_of(1, poisson)
        self.seconds["assemble"] = self.seconds.get("assemble", 0.0) + perf_counter() - started
        return Pencil(fixed, unit, self.periodic_nodes, self.periodic, self.affine)

    @property
    def unknowns(self) -> int:
        """Unknowns after elimination."""
        return int(self.periodic.shape[1])
