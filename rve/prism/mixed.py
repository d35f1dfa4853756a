"""Nearly incompressible phases of the product space: stiffness, pressures and stresses.

The mean pressure of a triangle is continuous and piecewise linear along θ, one unknown for each
triangle and level; the form has no derivative along θ, so everything else stays in one slice.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from alphacut.rve.cell import Phase
from alphacut.rve.mesh.prism_grid import PrismGrid
from alphacut.rve.mesh.triangulation import Integers
from alphacut.rve.mesh.wedge import tabulate
from alphacut.rve.petsc import PETSc
from alphacut.rve.prism.mixed_element import MixedElements, mixed_elements, split_bulk
from alphacut.rve.solver.constraints import LevelNumbering, Overlap
from alphacut.rve.solver.theta_preconditioner import LevelPressures
from alphacut.stochastic import ThetaLaw
from alphacut.stochastic.theta.law import Array

_SIX = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0, 0.5], [0.5, 0.5]])
UNIT_STRAINS = np.eye(3)  # (ε11, ε22, 2 ε12)


@dataclass(frozen=True)
class MixedSlice:
    """The triangles of one phase at one θ inside a layer.

    Args:
        weight: Of the slice, with f_Θ inside.
        hats: Of the level below and above.
        trace: Displacements of the triangles' nodes from those of the wedges', shape (6, 15).
        elements: Their matrices.
    """

    weight: float
    hats: tuple[float, float]
    trace: Array
    elements: MixedElements

    def at_nodes(self, displacement: Array) -> Array:
        """Displacements of the triangles, shape (m, 12, loads), from wedges (m, 15, 2, loads)."""
        values = np.einsum("an,mnil->mail", self.trace, displacement)
        return np.asarray(values.reshape(len(values), 12, -1))


@dataclass(frozen=True)
class MixedPhase:
    """The wedges of one phase.

    Args:
        grid: Topology.
        positions: Of the nodes, shape (nodes, 3).
        law: Law of θ.
        triangles: Of the planar mesh, shape (m,).
        phase: Their material; the modulus scales everything.
    """

    grid: PrismGrid
    positions: Array
    law: ThetaLaw
    triangles: Integers
    phase: Phase

    def own(self, layer: int) -> slice:
        """Which of the triangles the grid has a wedge on in one layer."""
        part = self.grid.within(layer)[0]
        return slice(*np.searchsorted(self.triangles, [part.start, part.stop]))

    def wedges(self, layer: int) -> Integers:
        """Places of those wedges in the grid, shape (m,)."""
        places = layer * len(self.grid.plane.triangles) - self.grid.own.start + self.triangles
        return np.asarray(places[self.own(layer)])

    def nodes(self, layer: int) -> Integers:
        """Nodes of those wedges, shape (m, 15)."""
        return self.grid.cells[self.wedges(layer)]

    def slice(self, layer: int, place: float, weight: float = 0.0) -> MixedSlice:
        """The slice at `place` in [0, 1] of a layer."""
        trace = tabulate(np.column_stack([_SIX, np.full(6, place)]))
        corners = np.einsum("an,mnd->mad", trace, self.positions[self.nodes(layer), :2])
        return MixedSlice(weight, (1 - place, place), trace, mixed_elements(corners, self.phase))

    def slices(self, layer: int) -> Iterator[MixedSlice]:
        """The slices at the three Gauss points of a layer."""
        levels = self.grid.levels(self.law)
        height = levels[layer + 1] - levels[layer]
        for x, w in zip(*np.polynomial.legendre.leggauss(3), strict=True):
            place = float((x + 1) / 2)
            density = float(self.law.pdf(levels[layer] + place * height))
            yield self.slice(layer, place, w / 2 * height * density)


class MixedSystem:
    """Matrices of the nearly incompressible phases of one map, moduli of 1 Pa.

    Args:
        numbering: Displacements level by level.
        phases: By number of the phase, 0 the matrix and 1 the particle.
        affine: Displacements of the nodes under `UNIT_STRAINS`, shape (nodes, 2, 3).
        pattern: Zero matrix of the displacements.
        overlap: Displacements that each rank owns, and those of its wedges.
    """

    def __init__(
        self,
        numbering: LevelNumbering,
        phases: dict[int, MixedPhase],
        affine: Array,
        pattern: PETSc.Mat,
        overlap: Overlap,
    ) -> None:
        self.numbering, self.phases, self.affine, self.overlap = numbering, phases, affine, overlap
        first = 0
        self.places: dict[int, slice] = {}
        for k, part in phases.items():
            self.places[k] = slice(first, first + len(part.triangles))
            first += len(part.triangles)
        self.count, span = first, numbering.grid.span
        levels = len(span) + 1
        self.triangles = np.concatenate([part.triangles for part in phases.values()])
        self.stiffness = {k: pattern.duplicate(copy=False) for k in phases}
        self.loads = {k: np.zeros((len(overlap.works), 3)) for k in phases}
        self.pressure_loads = np.zeros((levels, self.count, 3))
        none = np.zeros(0, np.int64)
        self._entries: list[tuple[Array, Integers, Integers]] = [(np.zeros(0), none, none)]
        self._compliance = {
            k: np.zeros((levels, levels, len(p.triangles))) for k, p in phases.items()
        }
        for layer in span:
            for k in self._present(layer):
                self._add(layer, k)
        for one in self.stiffness.values():
            one.assemble()
        values, rows, columns = (np.concatenate(part) for part in zip(*self._entries, strict=True))
        shape = levels * self.count, len(overlap.works)
        self.flux = sp.csr_matrix((values, (rows, columns)), shape=shape)
        spans = [numbering.span_of(rows) for rows in overlap.wanted]
        works = [range(one.start, one.stop + 1) for one in spans]
        self.pressures = numbering.on_levels(self.count, overlap.ranks, works)

    def _add(self, layer: int, k: int) -> None:
        part, own, level = self.phases[k], self.phases[k].own(layer), self._level(layer)
        place = slice(self.places[k].start + own.start, self.places[k].start + own.stop)
        nodes = part.nodes(layer)
        first = self.numbering.unknown_of_node[nodes]
        unknown = first[:, :, None] + np.arange(2) - self.overlap.start
        unknown, kept = unknown.reshape(len(nodes), 30), np.repeat(first >= 0, 2, axis=1)
        total, fluxes = np.zeros((len(nodes), 30, 30)), np.zeros((2, len(nodes), 30))
        for one in part.slices(layer):
            spread = np.kron(one.trace, np.eye(2))
            total += one.weight * (spread.T @ one.elements.stiffness @ spread)
            for i, hat in enumerate(one.hats):
                fluxes[i] += one.weight * hat * (one.elements.flux @ spread)
                for j, other in enumerate(one.hats):
                    rest = split_bulk(part.phase)[2]
                    self._compliance[k][level + i, level + j, own] += (
                        one.weight * hat * other / rest * one.elements.area
                    )
        pairs = (first // 2).astype(PETSc.IntType)
        for rows, values in zip(pairs, total, strict=True):
            self.stiffness[k].setValuesBlocked(rows, rows, values, addv=PETSc.InsertMode.ADD_VALUES)
        affine = self.affine[nodes].reshape(len(nodes), 30, 3)
        np.add.at(self.loads[k], unknown[kept], -(total @ affine)[kept])
        for i in (0, 1):
            rows = (level + i) * self.count + np.arange(place.start, place.stop)
            row = np.broadcast_to(rows[:, None], unknown.shape)
            self._entries.append((fluxes[i][kept], row[kept], unknown[kept]))
            self.pressure_loads[level + i, place] -= np.einsum("mi,mil->ml", fluxes[i], affine)

    def compliance(self, phases: tuple[Phase, Phase]) -> sp.csr_matrix:
        """This rank's share of the mean pressures' compliance in 1/Pa, (levels · triangles)²."""
        levels = len(self.pressure_loads)
        found = np.zeros((levels, levels, self.count))
        for k, place in self.places.items():
            found[:, :, place] = self._compliance[k] / phases[k].modulus
        blocks = [
            [sp.diags(found[i, j]) if abs(i - j) < 2 else None for j in range(levels)]
            for i in range(levels)
        ]
        return sp.bmat(blocks, format="csr")

    def uniform_pressure(self, phases: tuple[Phase, Phase]) -> Array:
        """Pressures uniform in the plane under `UNIT_STRAINS`, shape (levels, triangles, 3), in Pa.

        Where every triangle has a pressure, a uniform one moves nothing, and is the only one to
        grow with the bulk moduli: taken out beforehand, it costs the others no digits.
        """
        levels, count, strains = self.pressure_loads.shape
        if count < len(self.numbering.grid.plane.triangles):
            return np.zeros((levels, count, strains))
        sums = sp.kron(sp.identity(levels), np.ones((1, count)), format="csr")
        span, every = self.numbering.grid.span, self.numbering.grid.layers + 1
        own = slice(span.start, span.stop + 1)
        mean, loads = np.zeros((every, every)), np.zeros((every, strains))
        mean[own, own] = (sums @ self.compliance(phases) @ sums.T).toarray()
        loads[own] = self.pressure_loads.sum(axis=1)
        parts = zip(*self.overlap.ranks.all((mean, loads)), strict=True)
        mean, loads = (sum(part[1:], part[0]) for part in parts)
        found = np.linalg.solve(mean, -loads)[own]
        return np.repeat(found[:, None], count, axis=1)

    @cached_property
    def wedges(self) -> Integers:
        """Places of all wedges of these phases in the grid."""
        span = self.numbering.grid.span
        return np.concatenate([p.wedges(layer) for layer in span for p in self.phases.values()])

    def at_levels(
        self, elements: Sequence[Array], corners: Sequence[Array], phases: tuple[Phase, Phase]
    ) -> LevelPressures:
        """Mixed elements put in place of others in planes of constant θ, and their pressures.

        Args:
            elements: Of each plane, shape (triangles, 12, 12); overwritten where mixed.
            corners: Of each plane, nodes of the triangles, shape (triangles, 6, 2).
            phases: Matrix and inclusion; its modulus is the unit of pressures.
        """
        flux, compliance = [], []
        for stiffness, x in zip(elements, corners, strict=True):
            found = [mixed_elements(x[p.triangles], phases[k]) for k, p in self.phases.items()]
            stiffness[self.triangles] = np.concatenate([one.stiffness for one in found])
            flux.append(phases[0].modulus * np.concatenate([one.flux for one in found]))
            rest = [split_bulk(phases[k])[2] for k in self.phases]
            areas = [one.area / bulk for one, bulk in zip(found, rest, strict=True)]
            compliance.append(phases[0].modulus ** 2 * np.concatenate(areas))
        return LevelPressures(self.triangles, flux, compliance)

    def means(
        self, layer: int, displacement: Array, pressure: Array, phases: tuple[Phase, Phase]
    ) -> tuple[Array, Array]:
        """Integrals of stress and of energy over the slices of a layer.

        Args:
            layer: The layer.
            displacement: Of all nodes for each load, shape (nodes, 2, loads).
            pressure: Shape (levels, triangles, loads), in Pa.
            phases: Matrix and inclusion.

        Returns:
            Shapes (3, 3, loads) and (3, loads, loads).
        """
        loads = displacement.shape[2]
        stress, energy = np.zeros((3, 3, loads)), np.zeros((3, loads, loads))
        for k in self._present(layer):
            part, (shear, own, _) = self.phases[k], split_bulk(phases[k])
            for s, one in enumerate(part.slices(layer)):
                u = one.at_nodes(displacement[part.nodes(layer)])
                mean = self._mean_pressure(k, layer, one, pressure)
                strain = np.einsum("mai,mil->mal", one.elements.strain, u)
                apart = shear * (strain[:, 0] - strain[:, 1]).sum(axis=0)
                volume = strain[:, 0] + strain[:, 1]
                both = own * volume.sum(axis=0) + one.elements.area @ mean
                stress[s] += [both + apart, both - apart, shear * strain[:, 2].sum(axis=0)]
                forces = phases[k].modulus * (one.elements.stiffness @ u)
                forces += one.elements.flux[:, :, None] * mean[:, None]
                energy[s] += np.einsum("mia,mib->ab", forces, u)
        return stress, energy

    def _present(self, layer: int) -> list[int]:
        """The phases of this rank's wedges in a layer."""
        return [k for k, part in self.phases.items() if len(part.wedges(layer))]

    def _level(self, layer: int) -> int:
        """Place of the level below a layer among those of the grid's span."""
        return layer - self.numbering.grid.span.start

    def _mean_pressure(self, k: int, layer: int, one: MixedSlice, pressure: Array) -> Array:
        """In a slice, shape (m, loads), from pressures on the levels."""
        own, level = self.phases[k].own(layer), self._level(layer)
        below, above = (pressure[level + i, self.places[k]][own] for i in (0, 1))
        return np.asarray(one.hats[0] * below + one.hats[1] * above)

    def pressure_at(
        self,
        k: int,
        layer: int,
        points: Array,
        displacement: Array,
        pressure: Array,
        modulus: float,
    ) -> Array:
        """In-plane mean stress at points of the reference wedge, shape (m, q, loads), in Pa.

        Args:
            k: Number of the phase.
            layer: The layer.
            points: Shape (q, 3).
            displacement: Of all nodes for each load, shape (nodes, 2, loads).
            pressure: Shape (levels, triangles, loads), in Pa.
            modulus: Of the phase, in Pa.
        """
        part = self.phases[k]
        own = split_bulk(part.phase)[1]
        found = np.empty((len(part.triangles), len(points), displacement.shape[2]))
        for place in np.unique(points[:, 2]):
            at = points[:, 2] == place
            one = part.slice(layer, float(place))
            u = one.at_nodes(displacement[part.nodes(layer)])
            volume = (one.elements.flux[:, None] @ u) / one.elements.area[:, None, None]
            slopes = one.elements.slopes @ u
            offset = points[at, :2] - one.elements.centre[:, None]
            mean = self._mean_pressure(k, layer, one, pressure)
            found[:, at] = modulus * (own * volume + offset @ slopes) + mean[:, None]
        return found
