"""DOLFINx behind the product-space cell: mesh of wedges, stiffness of each phase (eq. 7).

The form has no derivative along θ: div and D act on x alone, while the mesh is three-dimensional.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from time import perf_counter
from typing import Any

from alphacut.rve.interruption import uninterrupted
from alphacut.rve.petsc import PETSc

with uninterrupted():
    import basix.ufl
    import dolfinx
    from dolfinx import fem
    from dolfinx.fem import petsc

import numpy as np
import ufl
from mpi4py import MPI

from alphacut.rve.cell import Phase
from alphacut.rve.mesh.prism_grid import PrismGrid
from alphacut.rve.mesh.triangulation import Integers
from alphacut.rve.mesh.wedge import slab_rule, tabulate, vector_wedge
from alphacut.stochastic import RadiusMap, ThetaLaw
from alphacut.stochastic.theta.law import Array

# twice as fast as the default -O2, equal to round-off
JIT = {"cffi_extra_compile_args": ["-O3", "-ffast-math"], "timeout": 120}  # for other processes


@dataclass
class PrismForm:
    """Wedge mesh and stiffness forms of one grid; positions and phases are set anew for every map.

    On several ranks each has a mesh of its own wedges; matrices and vectors add up what they give.

    Args:
        grid: Topology.
    """

    grid: PrismGrid

    def __post_init__(self) -> None:
        self.mesh = dolfinx.mesh.create_mesh(
            MPI.COMM_SELF,
            cells=self.grid.cells,
            x=np.zeros((self.grid.nodes, 3)),
            e=vector_wedge(3),
        )
        self.points, self.weights = slab_rule()
        self.shapes = tabulate(self.points)
        started = perf_counter()
        self.space = fem.functionspace(self.mesh, vector_wedge(2))
        self._compile()
        self.jit_seconds = perf_counter() - started

    def _compile(self) -> None:
        u, v = ufl.TrialFunction(self.space), ufl.TestFunction(self.space)
        self._load = fem.Constant(self.mesh, np.zeros(3))
        self._stiffness = [fem.Constant(self.mesh, np.zeros(3)) for _ in range(2)]
        self._share, self._density = self._point_function(), self._point_function()
        weight = self._density  # f_Θ of eq. 1
        shares = (1.0, 1.0) if self.grid.conforming else (1 - self._share, self._share)
        measure = self._measure()
        phases = zip(self._stiffness, shares, strict=True)
        parts = [(c, weight * part, measure(k)) for k, (c, part) in enumerate(phases)]
        # eq. 7: the Galerkin projection (eq. 4) of −div σ (eq. 2, eq. 5) on wedges (eq. 3)
        self._forms = [
            self._jit(w * ufl.inner(_stress(c, _strain(u)), _strain(v)) * dx) for c, w, dx in parts
        ]
        self._loads = [
            self._jit(-w * ufl.inner(_stress(c, self._load), _strain(v)) * dx) for c, w, dx in parts
        ]

    @staticmethod
    def _jit(form: ufl.Form) -> fem.Form:
        # UFL signs a form by the printed quadrature points; they print in full
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Applying str")
            return fem.form(form, jit_options=JIT)

    def _point_function(self) -> fem.Function:
        """Function of one value at every quadrature point."""
        element = basix.ufl.quadrature_element("prism", points=self.points, weights=self.weights)
        return fem.Function(fem.functionspace(self.mesh, element))

    def _measure(self) -> Any:
        """Volume measure; part 0 the matrix and part 1 the particle on a conforming mesh."""
        rule = {
            "quadrature_rule": "custom",
            "quadrature_points": self.points,
            "quadrature_weights": self.weights,
        }
        inside = self.grid.inside[self.mesh.topology.original_cell_index]
        everywhere = np.ones_like(inside)
        parts = (~inside, inside) if self.grid.conforming else (everywhere, everywhere)
        data = [(k, np.flatnonzero(part).astype(np.int32)) for k, part in enumerate(parts)]
        return ufl.Measure("dx", domain=self.mesh, metadata=rule, subdomain_data=data)

    def place(self, radius: RadiusMap) -> Array:
        """Move the nodes to the cone of `radius`; returns their positions, shape (nodes, 3).

        Raises:
            ValueError: The density of θ is not positive at a quadrature point.
        """
        positions = self.grid.positions(radius)
        self.mesh.geometry.x[:] = positions[self.mesh.geometry.input_global_indices]
        self._weigh(radius.distribution)
        return positions

    def _weigh(self, law: ThetaLaw) -> None:
        """Set the density of θ at the quadrature points."""
        levels = self.grid.levels(law)
        theta = levels[:-1, None] + np.diff(levels)[:, None] * self.points[:, 2]
        density = law.pdf(theta)
        if not (density > 0).all():
            place = theta[~(density > 0)][0]
            raise ValueError(
                f"the density of θ is {law.pdf(place):g} at {place:.4g}, and every layer of the"
                " product space needs probability: shorten the support, or take the series or a"
                " table"
            )
        wedge = self.grid.own.start + self.mesh.topology.original_cell_index
        self._density.x.array[:] = density[wedge // len(self.grid.plane.triangles)].ravel()

    def mark(self, share: Array) -> None:
        """Set the particle's share at the quadrature points, shape (cells, points)."""
        self._share.x.array[:] = share[self.mesh.topology.original_cell_index].ravel()

    def node_of_dof(self) -> Integers:
        """Grid node of every node of the function space."""
        nodes = np.empty(self.space.dofmap.index_map.size_local, np.int64)
        nodes[self.space.dofmap.list] = self.mesh.geometry.input_global_indices[
            self.mesh.geometry.dofmap
        ]
        return nodes

    def set_poisson(self, phases: tuple[Phase, Phase]) -> None:
        """Take the phases' Poisson's ratios; Young's moduli stay 1."""
        for phase, constants in zip(phases, self._stiffness, strict=True):
            unit = Phase(1.0, phase.poisson).stiffness
            constants.value[:] = unit[0, 0], unit[0, 1], unit[2, 2]

    def add_stiffness(self, phase: int, matrix: PETSc.Mat) -> None:
        """Add K_m (phase 0) or K_i (phase 1) of eq. 7 for a unit modulus."""
        petsc.assemble_matrix(matrix, self._forms[phase])

    def load(self, phase: int, strain: Array) -> Array:
        """Nodal forces −⟨Bᵀ E ε̄⟩ of one phase for a unit modulus, shape (nodes · 2,).

        Args:
            phase: 0 the matrix, 1 the particle.
            strain: Macroscopic strain (ε11, ε22, 2 ε12).
        """
        self._load.value[:] = strain
        return np.array(fem.assemble_vector(self._loads[phase]).array)


def _strain(w: Any) -> Any:
    """In-plane strain (ε11, ε22, 2 ε12) on the product space; θ is not differentiated."""
    gradient = ufl.grad(w)
    return ufl.as_vector([gradient[0, 0], gradient[1, 1], gradient[0, 1] + gradient[1, 0]])


def _stress(c: Any, e: Any) -> Any:
    """In-plane stress of the strain `e` from the three constants C11, C12, C33."""
    return ufl.as_vector([c[0] * e[0] + c[1] * e[1], c[1] * e[0] + c[0] * e[1], c[2] * e[2]])
