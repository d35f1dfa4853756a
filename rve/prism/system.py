"""One product-space system: its mesh, its constraints, and its results."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI

from alphacut.rve.cell import Phase
from alphacut.rve.mesh.periodicity import identify
from alphacut.rve.mesh.prism_grid import PrismGrid
from alphacut.rve.petsc import PETSc
from alphacut.rve.prism.form import PrismForm
from alphacut.rve.prism.mixed_element import NEARLY_INCOMPRESSIBLE
from alphacut.rve.prism.slice_stress import CELL_AREA, SliceStress
from alphacut.rve.ranks import Ranks
from alphacut.rve.solver.constraints import LevelNumbering, Overlap
from alphacut.rve.solver.level_stiffness import element_stiffness
from alphacut.rve.solver.theta_preconditioner import LevelPressures, ThetaPreconditioner
from alphacut.stochastic import RadiusMap, ThetaRule, layered_rule
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    from alphacut.rve.prism.mixed import MixedSystem

_DEVIATOR = np.array([[0.5, -0.5, 0], [-0.5, 0.5, 0], [0, 0, 1]])  # of (σ11, σ22, σ12)


class FoldedMeshError(RuntimeError):
    """The mesh folds over where it follows a map."""


@dataclass(frozen=True)
class SliceMeans:
    """Means over the slices at the Gauss points of the layers.

    Args:
        rule: θ of the slices and their weights, sum 1, n of them.
        stress: Homogenised (σ11, σ22, σ12) for each load, shape (n, 3, loads), in Pa.
        fraction: Area fraction of the particle, shape (n,).
        energy: Mean of σ_a : ε_b over cell and θ for loads a and b, shape (loads, loads), in Pa.
    """

    rule: ThetaRule
    stress: Array
    fraction: Array
    energy: Array


@dataclass(frozen=True)
class PhaseMeans:
    """Means over the slices, apart by phase, of fields in phases of 1 Pa.

    Args:
        rule: θ of the slices and their weights.
        stress: Shape (2, n, 3, fields).
        fraction: Area fraction of the particle, shape (n,).
        energy: Shape (2, fields, fields).
    """

    rule: ThetaRule
    stress: Array
    fraction: Array
    energy: Array

    def combined(self, moduli: tuple[float, float], coefficients: Array) -> SliceMeans:
        """Means of sums of the fields, coefficients (fields, loads), for moduli in Pa."""
        stress, energy = (
            moduli[0] * of[0] + moduli[1] * of[1] for of in (self.stress, self.energy)
        )
        return SliceMeans(
            self.rule, stress @ coefficients, self.fraction, coefficients.T @ energy @ coefficients
        )


class PrismSystem:
    """The product-space system of one grid; positions and materials are set anew for each map.

    Each rank has the wedges of its own grid, their nodes, and the unknowns of its levels.

    Args:
        grid: Topology, whole.
        comm: Communicator.

    Raises:
        ValueError: There are more ranks than wedges.
    """

    def __init__(self, grid: PrismGrid, comm: MPI.Intracomm) -> None:
        self.ranks, wedges = Ranks(comm), len(grid.own)
        if comm.size > wedges:
            raise ValueError(
                f"{comm.size} MPI ranks for {wedges} wedges; every rank needs a wedge: use fewer"
                " ranks or a finer mesh"
            )
        first = [wedges * rank // comm.size for rank in range(comm.size + 1)]
        dealt = [range(*pair) for pair in pairwise(first)]
        self.grid = replace(grid, wedges=dealt[comm.rank])
        self.numbering = LevelNumbering(self.grid, identify(grid.plane))
        around = [self.numbering.around(part) for part in dealt]
        self.overlap = Overlap(self.ranks, self.numbering.owned(comm.size), around)
        near = self.numbering.around_rows(self.ranks)
        self.pattern, places = near.matrix(self.ranks)
        self.form = PrismForm(near.grid, near.pairs, self.overlap.own, places)
        self.mixed: MixedSystem | None = None
        self._used = False  # the matrix
        self._jit = self.form.jit_seconds

    def take_jit_seconds(self) -> float:
        """Seconds of just-in-time compilation, reported once."""
        seconds, self._jit = self._jit, 0.0
        return seconds

    def move(self, radius_map: RadiusMap) -> None:
        """Move the nodes to the cone of a map and mark the particle at the quadrature points.

        Raises:
            FoldedMeshError: An element is inverted.
        """
        self.map = radius_map
        near, places = self.form.grid, self.form.place(radius_map)
        self.positions = places if near is self.grid else self.grid.part(places, near)
        self.share = self._share(self.grid, self.positions)
        if not self.grid.conforming:
            self.form.mark(self.share if near is self.grid else self._share(near, places))
        elif not all(self.ranks.all(bool((self.slice_stress.determinants() > 0).all()))):
            raise FoldedMeshError(
                f"the mesh folds over where it follows the radius through {self.grid.layers} layers"
                " in θ: take more layers or a smaller mesh size"
            )

    def _share(self, grid: PrismGrid, positions: Array | None = None) -> Array:
        """Particle's share, shape (cells, 1), or (cells, points) from the sign of z (eq. 13)."""
        if grid.conforming:
            return grid.inside[:, None].astype(float)
        nodes = (grid.positions(self.map) if positions is None else positions)[grid.cells]
        x = np.einsum("qn,cnd->cqd", self.form.shapes, nodes)
        # z < 0 in eq. 14
        return np.asarray(np.hypot(x[..., 0], x[..., 1]) < self.map(x[..., 2]), float)

    def set_poisson(self, phases: tuple[Phase, Phase]) -> None:
        """Take the phases' Poisson's ratios; nearly incompressible ones get mixed elements."""
        self.form.set_poisson(phases)
        ratios = {k: phase.poisson for k, phase in enumerate(phases)}
        near = {k: ratio for k, ratio in ratios.items() if ratio > NEARLY_INCOMPRESSIBLE}
        self.mixed = self._mixed(near) if near and self.grid.conforming else None

    def _mixed(self, near: dict[int, float]) -> MixedSystem:
        from alphacut.rve.prism.mixed import UNIT_STRAINS, MixedPhase, MixedSystem

        grid, parts = self.grid, dict[int, MixedPhase]()
        for k, ratio in near.items():
            own, one = np.flatnonzero(grid.plane.inside == bool(k)), Phase(1.0, ratio)
            parts[k] = MixedPhase(grid, self.positions, self.map.distribution, own, one)
        affine = self.affine(UNIT_STRAINS)
        return MixedSystem(self.numbering, parts, affine, self.pattern, self.overlap)

    def stiffness(self, phase: int) -> PETSc.Mat:
        """Reduced K_m (phase 0) or K_i (phase 1) for a unit modulus, less mean pressures."""
        if self.mixed is not None and phase in self.mixed.phases:
            return self.mixed.stiffness[phase]
        matrix = self.pattern.duplicate(copy=False)
        self.form.add_stiffness(phase, matrix)
        matrix.assemble()
        return matrix

    def stiffness_of(self, phases: tuple[Phase, Phase]) -> PETSc.Mat:
        """Reduced stiffness of ordinary phases, in the one matrix that this system always has."""
        if self._used:
            self.pattern.zeroEntries()
        self._used = True
        for k, phase in enumerate(phases):
            self.form.add_stiffness(k, self.pattern, phase.modulus)
        self.pattern.assemble()
        return self.pattern

    def load(self, phase: int, strain: Array) -> PETSc.Vec:
        """Reduced load under a strain (ε11, ε22, 2 ε12) of a phase whose stiffness was made."""
        vector = self.pattern.createVecLeft()
        if self.mixed is not None and phase in self.mixed.phases:
            load = self.mixed.loads[phase] @ strain
            vector.array[:] = self.overlap.give(load[:, None], 1)[:, 0]
        else:
            vector.array[:] = self.form.load(phase, strain)
        return vector

    def at_nodes(self, values: Array) -> Array:
        """Displacements of this rank's nodes, shape (nodes, 2, k), from its unknowns (size, k)."""
        return self.numbering.to_nodes(self.overlap.fetch(values), self.overlap.start)

    @property
    def slice_stress(self) -> SliceStress:
        """Evaluates stresses at the present positions."""
        return SliceStress(self.grid, self.positions, self.form.points, self.form.weights)

    def stiffness_at_points(self, phases: tuple[Phase, Phase]) -> Array:
        """Voigt stiffness, shape (cells, points or 1, 3, 3), in Pa."""
        return _mixed(self.share, phases)

    def means(
        self, displacement: Array, phases: tuple[Phase, Phase], pressure: Array | None = None
    ) -> SliceMeans:
        """Stress of the slices and mean energy.

        Args:
            displacement: Shape (nodes, 2, loads).
            phases: Matrix and inclusion.
            pressure: Of nearly incompressible triangles, shape (levels, triangles, loads), in Pa.
        """
        slices, stiffness = self.slice_stress, self.stiffness_at_points(phases)
        if self.mixed is not None:
            stiffness[self.mixed.wedges] = 0.0
        rule = layered_rule(self.map.distribution, layers=self.grid.layers, points=slices.slices)
        weights = rule.weights / rule.weights.sum()
        shares = np.broadcast_to(self.share, (len(self.share), len(self.form.points)))
        loads, count = displacement.shape[2], self.grid.layers * slices.slices
        stress, fraction = np.zeros((count, 3, loads)), np.zeros(count)
        energy = np.zeros((loads, loads))
        for k, some, layer in slices.layers(displacement, stiffness):
            own = slice(k * slices.slices, (k + 1) * slices.slices)
            share = shares[some].reshape(layer.area.shape)
            fraction[own] += np.einsum("msp,msp->s", layer.area, share) / CELL_AREA
            stress[own] += layer.mean
            energy += np.tensordot(weights[own], layer.energy, axes=1)
        if self.mixed is not None and pressure is not None:
            for k in self.grid.span:
                own = slice(k * slices.slices, (k + 1) * slices.slices)
                mean, work = self.mixed.means(k, displacement, pressure, phases)
                stress[own] += mean / CELL_AREA
                energy += np.tensordot(weights[own], work, axes=1) / CELL_AREA
        parts = zip(*self.ranks.all((stress, fraction, energy)), strict=True)
        return SliceMeans(
            ThetaRule(rule.nodes, weights), *(sum(part[1:], part[0]) for part in parts)
        )

    def means_by_phase(self, displacement: Array, phases: tuple[Phase, Phase]) -> PhaseMeans:
        """Means of fields (nodes, 2, fields) on a mesh that follows the interface.

        Args:
            displacement: The fields.
            phases: Their Poisson's ratios count; moduli are 1 Pa.
        """
        slices, inside, fields = self.slice_stress, self.grid.inside, displacement.shape[2]
        stiffness = self.stiffness_at_points(
            (replace(phases[0], modulus=1.0), replace(phases[1], modulus=1.0))
        )
        rule = layered_rule(self.map.distribution, layers=self.grid.layers, points=slices.slices)
        weights, count = rule.weights / rule.weights.sum(), len(rule.nodes)
        stress, energy = np.zeros((2, count, 3, fields)), np.zeros((2, fields, fields))
        fraction = np.zeros(count)
        for k, some, layer in slices.layers(displacement, stiffness):
            own = slice(k * slices.slices, (k + 1) * slices.slices)
            within = layer.of(inside[some])
            for phase, part in enumerate((layer.of(~inside[some]), within)):
                stress[phase, own] += part.mean
                energy[phase] += np.tensordot(weights[own], part.energy, axes=1)
            fraction[own] += within.area.sum(axis=(0, 2)) / CELL_AREA
        return PhaseMeans(ThetaRule(rule.nodes, weights), stress, fraction, energy)

    def stress(
        self,
        displacement: Array,
        phases: tuple[Phase, Phase],
        points: Array,
        pressure: Array | None = None,
    ) -> Array:
        """(σ11, σ22, σ12) at points (q, 3) of every wedge, shape (cells, q, 3, loads), in Pa."""
        strain, _ = self.slice_stress.strain(self.grid.cells, displacement, points)
        found = np.asarray(_mixed(self.share[:, :1], phases) @ strain)
        if self.mixed is None or pressure is None:
            return found
        found[self.mixed.wedges] = _DEVIATOR @ found[self.mixed.wedges]
        for layer in range(self.grid.layers):
            for k, part in self.mixed.phases.items():
                mean = self.mixed.pressure_at(
                    k, layer, points, displacement, pressure, phases[k].modulus
                )
                cells = layer * len(self.grid.plane.triangles) + part.triangles
                found[cells, :, :2] += mean[:, :, None]
        return found

    def affine(self, loads: Array) -> Array:
        """Displacements ε̄·x of the nodes, shape (nodes, 2, loads)."""
        x = self.positions[:, :2]
        tensors = np.array([[[e[0], e[2] / 2], [e[2] / 2, e[1]]] for e in loads])
        return np.asarray(np.einsum("lij,nj->nil", tensors, x))

    def preconditioner(self, phases: tuple[Phase, Phase]) -> ThetaPreconditioner:
        """θ-preconditioner for these phases; cut triangles take their wedges' mean stiffness.

        Pressures count in units of the matrix's modulus.
        """
        levels = self.numbering.shares(self.ranks.size)[self.ranks.rank].levels
        grid = self.form.grid
        share = self.share if grid is self.grid else self._share(grid)
        between = share.reshape(len(grid.span), len(grid.plane.triangles), -1).mean(axis=2)
        on = (np.concatenate([between[:1], between]) + np.concatenate([between, between[-1:]])) / 2
        own = levels, range(levels.start, min(levels.stop, grid.layers))
        elements: list[Iterable[Array]] = []
        pressures: LevelPressures | None = None
        for planes, share, places in zip(grid.planes(self.map), (on, between), own, strict=True):
            at = [k - grid.span.start for k in places]
            corners = [planes[k][grid.plane.triangles] for k in at]
            found: Iterable[Array] = map(element_stiffness, corners, _mixed(share[at], phases))
            if self.mixed is not None:
                found = list(found)
                mixed = self.mixed.at_levels(found, corners, phases)
                pressures = pressures or mixed
            elements.append(found)
        return ThetaPreconditioner(
            self.numbering, elements[0], elements[1], self.map.distribution, self.ranks, pressures
        )


def _mixed(share: Array, phases: tuple[Phase, Phase]) -> Array:
    """Voigt stiffness, shape (…, 3, 3), in Pa, of matrix with a `share` (…) of particle."""
    share = share[..., None, None]
    return np.asarray((1 - share) * phases[0].stiffness + share * phases[1].stiffness)
