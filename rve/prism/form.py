"""The form on cell × θ: prism elements, weight f_Θ, strains and areas at quadrature points."""

from __future__ import annotations

import numpy as np

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.fuzzy.refused import FailedError, RefusedError
from alphacut.rve.fenicsx import MPI, at_points, basix, fem, mesh_of, ufl
from alphacut.rve.form import CellForm, strain
from alphacut.rve.mesh.jacobian import LEAST_RATIO
from alphacut.rve.mesh.prism_grid import PrismGrid
from alphacut.rve.mesh.wedge import POINTS, SLICES, slab_rule, slice_weights, wedge
from alphacut.rve.outline import is_round
from alphacut.stochastic import RadiusMap
from alphacut.stochastic.theta.quadrature import level_rule


class FoldedMeshError(FailedError):
    """The mesh folds over where it follows a map."""


class PrismForm:
    """Prism mesh, form and loads of one grid; positions and phases are set anew.

    Args:
        grid: Topology; the ranks divide its prisms among them.
        comm: Communicator.

    Attributes:
        mesh: DOLFINx's.
        space: Displacements, two at each node of a prism.
        node: Number in the grid of each of this rank's nodes, shape (n,).
        wedge: Number in the grid of each of this rank's prisms, shape (m,).
        layer: Layer of each of these prisms, shape (m,).
        dx: Measure of each phase by its name, with the rule of the prisms, for forms of the user.
        elastic: Stiffness and loads; `elastic.density` is f_Θ at the points.
        areas: Weights of the points in their slice, shape (cells, 3, points); a slice's sum is 4.
    """

    def __init__(self, grid: PrismGrid, comm: MPI.Intracomm) -> None:
        self.grid = grid
        self.mesh = mesh_of(comm, grid.cells, grid.nodes, wedge(3))
        self.space = fem.functionspace(self.mesh, wedge(2))
        self.wedge: Rows = np.asarray(self.mesh.topology.original_cell_index)
        self.layer = self.wedge // len(grid.plane.triangles)
        self.node = self._node_of_dof()
        self._compile()

    def _node_of_dof(self) -> Rows:
        sizes, geometry = self.space.dofmap.index_map, self.mesh.geometry
        nodes = np.empty(sizes.size_local + sizes.num_ghosts, np.int64)
        nodes[self.space.dofmap.list] = geometry.input_global_indices[geometry.dofmap]
        return nodes

    def _compile(self) -> None:
        points, weights = slab_rule()
        at_each = basix.ufl.quadrature_element("prism", points=points, weights=weights)
        rule = {
            "quadrature_rule": "custom",
            "quadrature_points": points,
            "quadrature_weights": weights,
        }
        phase = self.grid.phase[self.wedge]
        cells = [
            (k, np.flatnonzero(phase == k).astype(np.int32)) for k in range(len(self.grid.names))
        ]
        dx = ufl.Measure("dx", self.mesh, metadata=rule, subdomain_data=cells)
        self.dx = {name: dx(k) for k, name in enumerate(self.grid.names)}
        values = fem.functionspace(self.mesh, at_each)
        self.elastic = CellForm(
            self.space, values, list(self.dx.values()), mixed=not self.grid.conforming
        )
        self._u = fem.Function(self.space)
        self._strain = at_points(strain(self._u), points)
        self._volume = at_points(ufl.JacobianDeterminant(self.mesh), points)

    def move_to(self, radius: RadiusMap, thickness: float = 0.0) -> None:
        """Move the nodes to the cone of `radius` and mark the particle at the quadrature points.

        An interphase, of a grid that has one, gets its thickness.

        Raises:
            FoldedMeshError: An element is inverted.
            RefusedError: The density of θ is not positive at a quadrature point.

        After either error the form stays where it was.
        """
        names = ("_levels", "_law", "areas")
        nodes = self.mesh.geometry.x.copy()
        state = {name: getattr(self, name) for name in names if hasattr(self, name)}
        try:
            self._move(radius, thickness)
        except (FoldedMeshError, RefusedError):
            self.mesh.geometry.x[:] = nodes
            self.__dict__.update(state)
            raise

    def _move(self, radius: RadiusMap, thickness: float) -> None:
        """Moves the nodes, checks the elements, and marks the particle at the quadrature points."""
        positions, geometry = self.grid.positions(radius, thickness), self.mesh.geometry
        geometry.x[:] = positions[geometry.input_global_indices]
        self._levels = self.grid.levels(radius.distribution)
        self._law = radius.distribution
        theta, _ = self.slices()
        density = radius.distribution.pdf(theta)
        if not (density > 0).all():
            key = f"density of θ at {theta[~(density > 0)][0]:.4g}"
            cure = "shorten the support, or take the series"
            raise RefusedError(key, f"{density.min():g}", "positive densities", cure)
        self.areas = self._areas()
        self._require_valid_elements()
        self.elastic.density.x.array[:] = np.repeat(self.of_slices(density), POINTS)
        if not self.grid.conforming:
            self.elastic.share.x.array[:] = self._inside(positions, radius).ravel()

    def _require_valid_elements(self) -> None:
        """Refuse inverted elements, and nearly inverted ones about outlines that are not round.

        Raises:
            FoldedMeshError: There is one at a quadrature point.
        """
        determinants = self.areas / slice_weights()
        means = determinants.mean(axis=(1, 2), keepdims=True)
        least = 0.0 if is_round(self.grid.plane.outline) else LEAST_RATIO
        bad = (means <= 0) | (determinants <= least * means)
        if self.mesh.comm.allreduce(int(bad.any())):
            where = f"where it follows the radius through {self.grid.layers} layers in θ"
            cure = "take more layers or a smaller mesh size"
            raise FoldedMeshError(f"the mesh folds over {where}", cure)

    def _inside(self, positions: Array, radius: RadiusMap) -> Array:
        """Indicator of the particle, 1 inside and 0 elsewhere, at the points, (cells, points)."""
        shapes: Array = wedge(1).tabulate(0, slab_rule()[0])[0].reshape(-1, 15)
        x = np.einsum("qn,cnd->cqd", shapes, positions[self.grid.cells[self.wedge]])
        return np.asarray(self.grid.sign(x, radius))

    def strains(self, displacement: Array) -> Array:
        """(ε11, ε22, 2 ε12) at the points of the slices, shape (cells, 3, points, 3).

        Args:
            displacement: Of this rank's nodes, shape (nodes, 2).
        """
        self._u.x.array[:] = displacement.ravel()
        return self._at_points(self._strain, 3)

    def _areas(self) -> Array:
        heights = np.diff(self._levels)[self.layer]
        volume = self._at_points(self._volume, 1)[..., 0]
        return np.asarray(volume / heights[:, None, None] * slice_weights())

    def _at_points(self, expression: fem.Expression, size: int) -> Array:
        cells = np.arange(len(self.wedge), dtype=np.int32)
        values = np.asarray(expression.eval(self.mesh, cells))
        return values.reshape(len(cells), SLICES, -1, size)

    def phase_areas(self) -> Array:
        """`areas` of the phases, the others' being 0, shape (phases, cells, 3, points)."""
        if self.grid.conforming:
            phase = self.grid.phase[self.wedge][:, None, None]
            return np.array([self.areas * (phase == k) for k in range(len(self.grid.names))])
        share = self.elastic.share.x.array.reshape(len(self.wedge), SLICES, -1)
        return np.stack([self.areas * (1 - share), self.areas * share])

    def slices(self) -> tuple[Array, Array]:
        """θ of the slices at Gauss points of the layers, and their weights, shape (3 layers,)."""
        rule = level_rule(self._law, self._levels, points=SLICES)
        return rule.nodes, rule.weights

    def of_slices(self, values: Array) -> Array:
        """Values of the slices, (3 layers,), at this rank's prisms, shape (cells, 3)."""
        return np.asarray(values.reshape(-1, SLICES)[self.layer])

    def by_layer(self, values: Array) -> Array:
        """Sums over this rank's prisms of each layer of values (cells, …), shape (layers, …)."""
        member = np.equal.outer(np.arange(self.grid.layers), self.layer).astype(float)
        return np.asarray(np.tensordot(member, values, axes=1))
