"""Stresses beside pores in exact equilibrium: a lower bound of the stiffness wherever pores are.

The stresses are those of `macro_element`, given by the moments of the tractions on the faces of
pixels or voxels; on faces of pores there are none. The best of them solves a system for linear
displacements of faces (a hybrid method: Fraeijs de Veubeke 1965). A few steps of conjugate
gradients, with products of linear displacements of nodes as coarse space, come near it. What
remains unbalanced is parted among the faces that meet at a node (Ladevèze and Leguillon 1983), and
what rounding and unfinished solutions leave is swept down the trees of `forest` in whole numbers:
then equilibrium is exact, and the energy alone is rounded. Axes and units are those of
`macro_element`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from itertools import product
from typing import NamedTuple, Self

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.errors import FailedError
from alphacut.base.kernels import compiled
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient, System, inner
from alphacut.rve.image.fields.element import element_of
from alphacut.rve.image.fields.energy import (
    SAFETY,
    UNIT,
    Energies,
    bound_of_trials,
    solved_loads,
)
from alphacut.rve.image.fields.forest import Forest, unit_of
from alphacut.rve.image.fields.grid import finished_fields
from alphacut.rve.image.fields.macro_element import (
    TABLE_ERROR,
    MacroElement,
    affine_displacements,
    component_pairs,
    corners,
    face_axes,
    trace_matrix,
)
from alphacut.rve.image.fields.nodes import NodeCopies, corner_groups
from alphacut.rve.image.fields.preconditioner import FourierPreconditioner
from alphacut.rve.image.fields.split import SideSolution

MAX_STEPS = 8
"""Largest number of steps of conjugate gradients towards the best stress."""
LEAST_GAIN = 3e-3
"""Part of the energy of the uniform strain below which a step is the last one, from the second on.
Each gains about a third of the one before. Tuned: one solid takes two to four, two of 1:20 five."""
MAX_RATIO = 1e4
"""Largest ratio of two moduli of a voxel; the larger one is lowered to it, which lowers the bound
by less than 1e-4 of it and keeps its table well conditioned."""
MAX_TABLES = 64
"""Number of ratios of moduli from which on they are rounded down to powers of 2^(1/32)."""
CHUNK = 4096
"""Voxels or nodes that are worked on at once, which bounds the memory."""
ByVoxels = Callable[[slice], Array]
"""Function to the numbers of some of the voxels outside pores."""


def solve_stresses(
    moduli: Array, sides: tuple[float, ...], *, solver: ConjugateGradient
) -> SideSolution:
    """Return stresses in equilibrium that vanish in pores, and the bound that they prove.

    Args:
        moduli: Bulk modulus (in the plane K + G/3) and shear modulus of each voxel, finite, shape
            (2, y, x) or (2, z, y, x). A voxel in which one is 0 is a pore.
        sides: Sides of a voxel along the axes of the grid, over that along x.
        solver: Solver of the coarse systems with its stopping rule. How far it gets changes the
            bound, but not its validity.

    Returns:
        `fields`, means over each voxel of the stress under each unit mean stress, in Voigt's order,
        shape (loads, components, *grid), 0 under a mean stress that nothing carries; and `bound`,
        below the stiffness in the Loewner order, of the shape (3, 3) or (6, 6).

    Raises:
        FailedError: The solver does not converge.
    """
    grid = _Grid.of_moduli(moduli, sides)
    hybrid = _Hybrid.of_grid(grid)
    pairs = component_pairs(len(sides))
    order = voigt_order(len(sides))
    # Loads near the eigenvectors of an isotropic material, in strains of the unit cube.
    scale = np.array([sides[i] * sides[j] for i, j in pairs])
    strains = np.empty((len(pairs), len(pairs)))
    strains[:, order] = solved_loads(element_of(sides, dual=False))
    strains *= scale
    shear = float(grid.shear.max(initial=0))
    reference = shear * max(abs(hybrid.uniform_moments(strain)).max() for strain in strains)
    d = grid.dimension
    # What is finished waits in a file where it is large: a load takes 27 moments a voxel.
    finished = finished_fields((len(strains), len(grid.shear), d, d**2), grid.shape, int)
    stresses = []
    for load, strain in enumerate(strains):
        tractions = hybrid.tractions(strain, solver)
        unit = unit_of(max(reference, abs(tractions).max())) * 2.0**10
        tractions /= unit
        whole = np.rint(tractions, out=tractions).astype(int)
        del tractions
        balanced = grid.balanced(whole, unit)
        finished[load] = balanced.tractions
        stresses.append(WholeStress(finished[load], balanced.unit))
    means, energy = grid.means_and_energy(stresses)
    bound = bound_of_trials(means * scale[:, np.newaxis], energy)
    # Index k of Voigt's order is component `order[k]` of the grid's.
    fields = grid.voxel_means(stresses, scale, means)[:, order][order]
    return SideSolution(fields, bound[np.ix_(order, order)], beside_pores=True)


def voigt_order(dimension: int) -> list[int]:
    """Return the number in `component_pairs` of each of Voigt's components.

    The axes of a grid are (y, x) or (z, y, x): those of the tensor, reversed.
    """
    return [1, 0, 2] if dimension == 2 else [2, 1, 0, 3, 4, 5]


class WholeStress(NamedTuple):
    """A stress in exact equilibrium.

    Attributes:
        tractions: Moments of the tractions on the upper faces of the S voxels outside pores, as
            whole numbers, of which those along the face count twice the moments; shape (S, axes,
            dimension²).
        unit: What they are multiples of.
    """

    tractions: Ints
    unit: float


@dataclass(frozen=True, eq=False)
class _Grid:
    """The S voxels outside pores, with the tables of their materials.

    Args:
        shape: Shape of the grid.
        copies: Their numbers in the grid, and the copies of nodes at their corners.
        trees: Trees of voxels.
        number: Number of each voxel of the grid among the S, −1 in pores.
        above: Number of the upper neighbour of each along each axis, −1 at a pore, (axes, S).
        below: That of the lower neighbour.
        shear: Shear modulus of each.
        kind: Number of the table of each.
        tables: The tables.
    """

    shape: tuple[int, ...]
    copies: NodeCopies
    trees: Forest
    number: Ints
    above: Ints
    below: Ints
    shear: Array
    kind: Ints
    tables: list[MacroElement]

    @classmethod
    def of_moduli(cls, moduli: Array, sides: Sequence[float]) -> Self:
        """Return the voxels where both moduli are positive; see `solve_stresses`."""
        is_solid: Mask = np.logical_and(moduli[0] > 0, moduli[1] > 0)
        copies = NodeCopies.of_mask(is_solid)
        number = np.full(is_solid.size, -1)
        number[copies.cells] = np.arange(len(copies.cells))
        by_place = number.reshape(is_solid.shape)
        axes = range(is_solid.ndim)
        above = [np.roll(by_place, -1, axis).ravel()[copies.cells] for axis in axes]
        below = [np.roll(by_place, 1, axis).ravel()[copies.cells] for axis in axes]
        bulk, shear = moduli.reshape(2, -1)[:, copies.cells]
        # A softer material makes a softer cell: moduli may be lowered.
        shear = np.minimum(shear, MAX_RATIO * bulk)
        ratio = np.minimum(bulk / shear, MAX_RATIO)
        ratios, kind = np.unique(ratio, return_inverse=True)
        if len(ratios) > MAX_TABLES:
            # reduced by more than the rounding of the logarithm
            lowered = np.exp2(np.floor(32 * np.log2(ratio)) / 32) * (1 - 1e-12)
            ratios, kind = np.unique(lowered, return_inverse=True)
        tables = [MacroElement.of_ratio(float(x), sides) for x in ratios]
        return cls(is_solid.shape, copies, Forest.of_mask(is_solid), number, np.array(above),
                   np.array(below), shear, kind, tables)  # fmt: skip

    @property
    def dimension(self) -> int:
        """2 in the plane, 3 in space."""
        return len(self.shape)

    def multiply(self, tables: Sequence[Array], vectors: Array, rows: slice) -> Array:
        """Return shear modulus times table times vector of some voxels, shape (voxels, …)."""
        shear = self.shear[rows, np.newaxis]
        if len(tables) == 1:
            return np.asarray(shear * (vectors @ tables[0].T))
        result = np.empty((len(vectors), len(tables[0])))
        of_rows = self.kind[rows]
        for kind in np.unique(of_rows):
            here = np.flatnonzero(of_rows == kind)
            result[here] = vectors[here] @ tables[kind].T
        return np.asarray(shear * result)

    def chunks(self) -> Iterator[slice]:
        """Yield groups of the voxels that are worked on at once."""
        for start in range(0, len(self.shear), CHUNK):
            yield slice(start, min(start + CHUNK, len(self.shear)))

    def balanced(self, tractions: Ints, unit: float) -> WholeStress:
        """Return whole tractions in equilibrium near given ones, which are changed.

        What is left after the sweep is a torque on the root of a piece that meets its own image,
        that is, a mean stress that is not symmetric: forces around loops take it away.

        Args:
            tractions: Whole moments; see `WholeStress`.
            unit: Their unit.

        Raises:
            FailedError: They are not in equilibrium in the end.
        """
        order = self.number[self.trees.order]
        parents = self.trees.parents[self.copies.cells]
        _sweep(order, parents, self.above, self.below, tractions)
        _, torques = self._resultants(tractions)
        roots = order[parents[order] < 0]
        turned = roots[torques[roots].any(axis=1)]
        loops = self._loops()
        forces = []
        factor = 1
        for root in turned:
            of_piece = loops.get(int(self.trees.labels[self.copies.cells[root]]), [])
            found = _loop_forces([loop.period for loop in of_piece], torques[root])
            denominator = math.lcm(*(x.denominator for force in found for x in force))
            if denominator * factor > 1 << 16:  # too fine a unit: this piece carries nothing
                is_in = (
                    self.trees.labels[self.copies.cells]
                    == self.trees.labels[self.copies.cells[root]]
                )
                tractions[is_in] = 0
                continue
            factor = math.lcm(factor, denominator)
            forces += list(zip(of_piece, found, strict=True))
        tractions *= factor
        for loop, force in forces:
            tractions[loop.voxel, loop.axis, : self.dimension] += [int(x * factor) for x in force]
        if forces:
            _sweep(order, parents, self.above, self.below, tractions)
        excess, torques = self._resultants(tractions)
        # Sums of up to 24 numbers below 2⁵⁸ are exact.
        if excess.any() or torques.any() or not abs(tractions).max(initial=0) < 1 << 58:
            what = "stresses beside pores are not in equilibrium"
            raise FailedError(f"the proof is wrong: {what}", "keep the case and report it")
        return WholeStress(tractions, unit / factor)

    def _resultants(self, tractions: Ints) -> tuple[Ints, Ints]:
        """Return the force and twice the torque about its centre on each voxel.

        Twice the torque has the components x_i t_j − x_j t_i for i < j.

        Returns:
            Whole numbers of shape (S, axes) and (S, pairs).
        """
        d = self.dimension
        pairs = component_pairs(d)[d:]
        force = np.zeros((len(tractions), d), int)
        torque = np.zeros((len(tractions), len(pairs)), int)
        for axis in range(d):
            lower = self._lower(tractions, axis)
            upper = tractions[:, axis]
            force += upper[:, :d] - lower[:, :d]
            both = upper[:, :d] + lower[:, :d]
            change = (upper - lower).reshape(-1, d, d)
            along = face_axes(d, axis)
            for k, (i, j) in enumerate(pairs):
                if i == axis:
                    torque[:, k] += both[:, j]
                else:
                    torque[:, k] += change[:, 1 + along.index(i), j]
                if j == axis:
                    torque[:, k] -= both[:, i]
                else:
                    torque[:, k] -= change[:, 1 + along.index(j), i]
        return force, torque

    def _lower(self, tractions: Ints | Array, axis: int) -> Ints | Array:
        """Return the moments on the lower face of each voxel, as on the voxel below; 0 at pores."""
        below = self.below[axis]
        return np.where((below >= 0)[:, np.newaxis], tractions[below, axis], 0)

    def _loops(self) -> dict[int, list[_Loop]]:
        """Return independent loops from each piece to its images, by the number of its tree."""
        axes, voxels, _, periods = self.trees.windings()
        found: dict[int, list[_Loop]] = {}
        labels = self.trees.labels[voxels]
        keys = np.column_stack([labels, periods])
        _, first = np.unique(keys, axis=0, return_index=True)
        for k in first:
            loops = found.setdefault(int(labels[k]), [])
            period = periods[k] * self.shape
            known = [loop.period for loop in loops]
            if np.linalg.matrix_rank(np.array([*known, period])) > len(loops):
                loops.append(_Loop(int(axes[k]), int(self.number[voxels[k]]), period))
        return found

    def means_and_energy(self, stresses: Sequence[WholeStress]) -> tuple[Array, Energies]:
        """Return the mean stresses, one a column, and the energies of all pairs.

        The mean over a voxel of σ_ij is ∮ t_i x_j. Over the grid the moments along faces cancel,
        and each force on a face counts half in either voxel.

        Returns:
            Means in the order of `component_pairs`, each off by at most 4 rounding units, shape
            (components, loads); and the energies over the mean of the unit cube.
        """
        d = self.dimension
        cells = math.prod(self.shape)
        loads = len(stresses)
        means = np.empty((len(component_pairs(d)), loads))
        for load, stress in enumerate(stresses):
            forces = stress.tractions[:, :, :d]
            # Sums of halves of 30 bits are exact.
            low = forces & ((1 << 30) - 1)
            high = (forces - low) >> 30
            total = high.sum(axis=0).astype(object) * (1 << 30) + low.sum(axis=0).astype(object)
            for k, (i, j) in enumerate(component_pairs(d)):
                means[k, load] = float(total[j, i]) * stress.unit / cells
        value = np.zeros((loads, loads))
        squared_errors = np.zeros(loads)
        relative = TABLE_ERROR + (2 * d**3 + 4) * UNIT
        chunks = list(self.chunks())
        for rows in chunks:
            moments = np.stack([self._moments(stress, rows) for stress in stresses])
            root = np.sqrt(self.shear[rows])
            for kind in np.unique(self.kind[rows]):
                table = self.tables[kind]
                here = np.flatnonzero(self.kind[rows] == kind)
                of_kind = moments[:, here] / root[here, np.newaxis]
                modes = (of_kind @ table.modes.T).reshape(loads, -1)
                value += modes @ modes.T
                squared_errors += (relative * table.norm) ** 2 * (of_kind**2).sum(axis=(1, 2))
        # A sum is off by n units if no term takes part in more than n additions; see `energies`.
        additions = 2 * d**3 * CHUNK + len(chunks) * len(self.tables)
        energy = Energies(
            value=(value + value.T)[np.newaxis] / (2 * cells),
            mode_errors=SAFETY * np.sqrt(squared_errors / cells)[np.newaxis],
            summed=SAFETY * (additions + 16) * UNIT,
        )
        return means, energy

    def _moments(self, stress: WholeStress, rows: slice) -> Array:
        """Return the moments on all faces of some voxels, shape (voxels, faces × dimension²)."""
        d = self.dimension
        factor = np.repeat([1.0] + [0.5] * (d - 1), d) * stress.unit
        moments = np.empty((len(self.shear[rows]), d, 2, d**2))
        for axis in range(d):
            below = self.below[axis, rows]
            lower = np.where((below >= 0)[:, np.newaxis], stress.tractions[below, axis], 0)
            moments[:, axis, 0] = -factor * lower
            moments[:, axis, 1] = factor * stress.tractions[rows, axis]
        return moments.reshape(len(moments), -1)

    def voxel_means(self, stresses: Sequence[WholeStress], scale: Array, means: Array) -> Array:
        """Return the mean stress of each voxel under unit mean stresses.

        Args:
            stresses: The stresses of the loads.
            scale: Factor of each component from the unit cube to the voxel.
            means: Mean stresses of the loads in the unit cube, one a column.

        Returns:
            Shape (loads, components, *grid), both in the order of `component_pairs`.
        """
        d = self.dimension
        pairs = component_pairs(d)
        found = finished_fields((len(stresses), len(pairs), math.prod(self.shape)), self.shape)
        found[:] = 0.0
        for load, stress in enumerate(stresses):
            for axis in range(d):
                lower = self._lower(stress.tractions, axis).astype(float)
                upper = stress.tractions[:, axis].astype(float)
                force = (upper + lower)[:, :d] / 2
                moment = (upper - lower).reshape(-1, d, d) / 2
                # ∮ t_i x_j has the forces on both faces for j = axis, else the moments along j
                for k, (i, j) in enumerate(pairs):
                    if j == axis:
                        of_face = force[:, i]
                    else:
                        of_face = moment[:, 1 + face_axes(d, axis).index(j), i]
                    found[load, k, self.copies.cells] += stress.unit * of_face
        combinations = np.linalg.pinv(means, rcond=1e-6).T / scale[:, np.newaxis]
        for start in range(0, found.shape[2], CHUNK):  # in place, which saves memory
            rows = slice(start, start + CHUNK)
            found[:, :, rows] = np.tensordot(
                combinations, scale[:, np.newaxis] * found[:, :, rows], axes=1
            )
        return found.reshape(len(pairs), len(pairs), *self.shape)


class _Loop(NamedTuple):
    """A loop from a piece to its image: up through a face, and back along its tree.

    Attributes:
        axis: Axis of the face.
        voxel: Number of the voxel below it.
        period: Whole vector to the image in voxels, along the axes.
    """

    axis: int
    voxel: int
    period: Ints


def _loop_forces(periods: Sequence[Ints], torque: Ints) -> list[list[Fraction]]:
    """Return forces around loops whose torques take away a given one.

    A force F that passes around a loop with the period V adds V_i F_j − V_j F_i, twice, to twice
    the torque on the root. These equations are solved by Gauss's elimination with rational numbers.

    Args:
        periods: Periods V of the loops.
        torque: Twice the torque on the root, by pairs i < j.

    Returns:
        A force along the axes for each loop.

    Raises:
        FailedError: No forces do it.
    """
    d = 2 if len(torque) == 1 else 3
    rows: list[list[Fraction]] = []
    for k, (i, j) in enumerate(component_pairs(d)[d:]):
        row = [Fraction(0)] * (d * len(periods))
        for loop, period in enumerate(periods):
            row[loop * d + j] += 2 * int(period[i])
            row[loop * d + i] -= 2 * int(period[j])
        rows.append([*row, Fraction(-int(torque[k]))])
    solution = [Fraction(0)] * (d * len(periods))
    pivots: list[tuple[int, list[Fraction]]] = []
    for row in rows:
        for column, pivot in pivots:
            factor = row[column]
            row = [x - factor * y for x, y in zip(row, pivot, strict=True)]
        column = next((k for k, x in enumerate(row[:-1]) if x), -1)
        if column < 0:
            if row[-1]:
                what = "a torque beside pores has no loop that carries it"
                raise FailedError(f"the proof is wrong: {what}", "keep the case and report it")
            continue
        row = [x / row[column] for x in row]
        pivots = [
            (other, [x - old[column] * y for x, y in zip(old, row, strict=True)])
            for other, old in pivots
        ]
        pivots.append((column, row))
    for column, row in pivots:  # free forces are 0
        solution[column] = row[-1]
    return [solution[loop * d : (loop + 1) * d] for loop in range(len(periods))]


@compiled
def _sweep(order: Ints, parents: Ints, above: Ints, below: Ints, tractions: Ints) -> None:
    """Balance force and torque of every voxel but the roots, in place, from leaves to roots.

    What a voxel has too much is taken from the moments on the face to its parent: a linear traction
    carries all six resultants. Numbers stay whole, since moments count twice.

    Args:
        order: Numbers of the voxels, each after its parent.
        parents: Direction of the parent of each; see `Forest`.
        above: Number of the upper neighbour along each axis, −1 at a pore, shape (axes, voxels).
        below: That of the lower neighbour.
        tractions: Moments on the upper faces, shape (voxels, axes, dimension²); changed.
    """
    d = len(above)
    force = np.zeros(d, np.int64)
    torque = np.zeros((d, d), np.int64)
    for number in range(len(order) - 1, -1, -1):
        voxel = order[number]
        if parents[voxel] < 0:
            continue
        force[:] = 0
        torque[:] = 0
        for axis in range(d):
            for side in range(2):
                if side == 1:
                    on = tractions[voxel, axis]
                    sign = 1
                    if above[axis, voxel] < 0:
                        continue
                else:
                    if below[axis, voxel] < 0:
                        continue
                    on = tractions[below[axis, voxel], axis]
                    sign = -1
                for j in range(d):
                    force[j] += sign * on[j]
                    torque[axis, j] += on[j]
                    torque[j, axis] -= on[j]
                    row = 0
                    for i in range(d):  # moments along the axes i of the face
                        if i != axis:
                            row += 1
                            torque[i, j] += sign * on[row * d + j]
                            torque[j, i] -= sign * on[row * d + j]
        axis = parents[voxel] // 2
        sign = 2 * (parents[voxel] % 2) - 1
        face = voxel if sign == 1 else below[axis, voxel]
        on = tractions[face, axis]
        for j in range(d):
            change = -sign * force[j]
            on[j] += change
            torque[axis, j] += change
            torque[j, axis] -= change
        row = 0
        for i in range(d):
            if i == axis:
                continue
            row += 1
            # x_i t_axis, the moment of the normal traction along i
            on[row * d + axis] -= sign * torque[i, axis]
            # twisting: parted between the two moments along the face
            other_row = 0
            for j in range(d):
                if j != axis:
                    other_row += 1
                if j != axis and j > i:
                    half = torque[i, j] // 2
                    on[row * d + j] -= sign * half
                    on[other_row * d + i] += sign * (torque[i, j] - half)


@compiled
def _add_at_corners(forces: Array, copies: Ints, total: Array) -> None:
    """Add forces of the shape (voxels, corners, axes) to the total at each copy of a node.

    Args:
        forces: The forces.
        copies: Number of the copy at each corner, shape (voxels, corners).
        total: Sums, shape (copies, axes); changed. Compiled, as the coarse systems spend a quarter
            of their time in this loop where NumPy makes it.
    """
    for voxel in range(copies.shape[0]):
        for corner in range(copies.shape[1]):
            for axis in range(total.shape[1]):
                total[copies[voxel, corner], axis] += forces[voxel, corner, axis]


@dataclass(frozen=True, eq=False)
class _Hybrid:
    """The system for displacements of faces, and its coarse system for those of nodes.

    Args:
        grid: The voxels.
        faces: Number of each of their faces, 2 · axis + side, shape (S, faces).
        owned: Whether each voxel is the first one of the face, of the same shape.
        n_faces: Number of faces.
        blocks: Inverse of the blocks of the system on a face of each kind of voxel: on its lower
            and upper side alone, and on both, shape (kinds, axes, 3, dimension², dimension²).
        preconditioner: Inverse for a grid of one material without pores, for the coarse system.
        diagonal: Diagonal of the coarse system, shape (copies, axes).
        min_energy_ratio: Guess of the smallest eigenvalue of the preconditioned coarse system, on
            which accuracy alone depends.
    """

    grid: _Grid
    faces: Ints
    owned: Array
    n_faces: int
    blocks: Array
    preconditioner: FourierPreconditioner
    diagonal: Array
    min_energy_ratio: float

    @classmethod
    def of_grid(cls, grid: _Grid) -> Self:
        """Return the systems of a grid."""
        d = grid.dimension
        count = len(grid.shear)
        faces = np.empty((count, 2 * d), int)
        owned = np.ones((count, 2 * d))
        total = 0
        for axis in range(d):
            faces[:, 2 * axis + 1] = total + np.arange(count)
            total += count
        for axis in range(d):
            below = grid.below[axis]
            is_free = below < 0
            faces[:, 2 * axis] = faces[below, 2 * axis + 1]
            faces[is_free, 2 * axis] = total + np.arange(np.count_nonzero(is_free))
            owned[:, 2 * axis] = is_free
            total += np.count_nonzero(is_free)
        n = d**2
        blocks = np.empty((len(grid.tables), d, 3, n, n))
        for kind, table in enumerate(grid.tables):
            for axis in range(d):
                first = slice(2 * axis * n, (2 * axis + 1) * n)
                second = slice((2 * axis + 1) * n, (2 * axis + 2) * n)
                lower = table.stiffness[first, first]
                upper = table.stiffness[second, second]
                blocks[kind, axis] = np.linalg.inv([lower, upper, (lower + upper) / 2])
        typical = float(np.sqrt(grid.shear.min() * grid.shear.max()))
        table = grid.tables[int(np.argmax(np.bincount(grid.kind)))]
        inverse = _homogeneous_inverse(typical, table, grid.shape)
        trace = trace_matrix(d)
        diagonal = np.zeros((len(grid.copies.places), d))
        for kind, table in enumerate(grid.tables):
            rows = np.flatnonzero(grid.kind == kind)
            entries = np.diagonal(trace.T @ table.stiffness @ trace).reshape(-1, d)
            for corner, entry in enumerate(entries):
                diagonal[grid.copies.copies[rows, corner]] += grid.shear[rows, np.newaxis] * entry
        # Slender ligaments bend by a thousandth of their material's stiffness.
        least = 1e-3 * float(grid.shear.min()) / typical
        return cls(grid, faces, owned, total, blocks, inverse, diagonal, least)

    def uniform_moments(self, strain: Array) -> Array:
        """Return the moments of a uniform strain of the unit cube, shape (kinds, moments).

        They are those of a voxel of each kind with a shear modulus of 1.
        """
        displacement = (
            trace_matrix(self.grid.dimension) @ affine_displacements(self.grid.dimension) @ strain
        )
        return np.array([table.stiffness @ displacement for table in self.grid.tables])

    def tractions(self, strain: Array, solver: ConjugateGradient) -> Array:
        """Return moments of tractions on upper faces, balanced but for an unfinished solution.

        Args:
            strain: Mean strain of the unit cube.
            solver: Solver of coarse systems with its stopping rule.

        Returns:
            Moments as in `WholeStress`, those along the face doubled, shape (S, axes, dimension²).

        Raises:
            FailedError: The solver does not converge.
        """
        of_kind = self.uniform_moments(strain)

        def uniform(rows: slice) -> Array:
            return np.asarray(self.grid.shear[rows, np.newaxis] * of_kind[self.grid.kind[rows]])

        residual = -self._to_faces(uniform)
        # The energy of the uniform strain is the scale of accuracies and the floor of solutions.
        shape = trace_matrix(self.grid.dimension) @ affine_displacements(self.grid.dimension)
        shear = np.bincount(self.grid.kind, self.grid.shear, len(of_kind))
        scale = float(shear @ of_kind @ shape @ strain)
        x = self._coarse(residual, solver, scale, relative=1e-3)
        residual -= self._apply(x)
        direction = np.zeros_like(x)
        gamma = 1.0
        for number in range(MAX_STEPS):
            step = self._block_inverse(residual)
            step += self._coarse(residual, solver, scale, relative=1e-2)
            last_gamma = gamma
            gamma = float(np.vdot(residual, step))
            direction *= gamma / last_gamma
            direction += step
            del step  # leaves memory for the next one
            forces = self._apply(direction)
            curvature = float(np.vdot(direction, forces))
            if not curvature > 1e-14 * scale:  # nothing but rounding is left to gain
                break
            length = gamma / curvature
            forces *= length
            residual -= forces
            x += np.multiply(length, direction, out=forces)
            del forces
            if number > 0 and gamma * length < LEAST_GAIN * scale:
                break
        del direction
        # Here every load left counts, since it is swept down long trees: tuned.
        precise = replace(solver, accuracy=1e-3 * solver.accuracy)
        x += self._coarse(residual, precise, scale)
        del residual
        return self._parted(lambda rows: self._moments(x, rows) + uniform(rows))

    def _to_faces(self, moments: ByVoxels) -> Array:
        """Return the sums of moments over the voxels of each face, shape (faces, dimension²).

        Args:
            moments: Function to the moments on the faces of some voxels, shape (voxels, moments).
        """
        total = np.zeros((self.n_faces, self.grid.dimension**2))
        for rows in self.grid.chunks():
            by_face = moments(rows).reshape(*self.faces[rows].shape, -1)
            for face in range(self.faces.shape[1]):  # no two voxels have one face on one side
                total[self.faces[rows, face]] += by_face[:, face]
        return total

    def _moments(self, x: Array, rows: slice) -> Array:
        """Return the moments on the faces of some voxels under displacements of faces."""
        tables = [table.stiffness for table in self.grid.tables]
        displacements = x[self.faces[rows]]
        return self.grid.multiply(tables, displacements.reshape(len(displacements), -1), rows)

    def _apply(self, x: Array) -> Array:
        """Return the moments on faces under displacements of faces, both (faces, dimension²)."""
        return self._to_faces(lambda rows: self._moments(x, rows))

    def _block_inverse(self, moments: Array) -> Array:
        """Return the approximate inverse of the blocks of faces, both (faces, dimension²)."""
        d = self.grid.dimension
        weight = np.zeros(self.n_faces)
        for face in range(2 * d):
            weight[self.faces[:, face]] += self.grid.shear
        result = np.zeros_like(moments)
        for face in range(2 * d):
            axis, side = divmod(face, 2)
            neighbour = (self.grid.below, self.grid.above)[side][axis]
            # 0 and 1: the voxel's face alone; 2: a face of two voxels, of the upper side
            case = np.where(neighbour >= 0, 2, side)
            for kind in range(len(self.grid.tables)):
                is_owner = (self.grid.kind == kind) & (self.owned[:, face] > 0)
                for number in np.unique(case[is_owner]):
                    own = self.faces[is_owner & (case == number), face]
                    block = self.blocks[kind, axis, number]
                    result[own] = moments[own] @ block / weight[own, np.newaxis]
        return result

    def _coarse(
        self, load: Array, solver: ConjugateGradient, scale: float, relative: float | None = None
    ) -> Array:
        """Return displacements of faces, products of linear ones at nodes, that balance a load.

        Args:
            load: Moments on faces, shape (faces, dimension²).
            solver: Solver with its stopping rule.
            scale: Energy that accuracies refer to.
            relative: Fraction of the energy of this load that may be left; None for the accuracy of
                the solver.

        Raises:
            FailedError: The solver does not converge.
        """
        trace = trace_matrix(self.grid.dimension)
        tables = [trace.T @ table.stiffness @ trace for table in self.grid.tables]

        def of_corners(rows: slice) -> Array:
            own = load[self.faces[rows]] * self.owned[rows, :, np.newaxis]
            return np.asarray(own.reshape(len(own), -1) @ trace)

        nodal = self._to_copies(of_corners)

        def operator(u: Array) -> Array:
            at_nodes = np.ascontiguousarray(u[0].T)
            return self._to_copies(
                lambda rows: self.grid.multiply(tables, self._at_corners(at_nodes, rows), rows)
            )

        system = System(
            operator=operator,
            preconditioner=self._precondition,
            load=nodal,
            scale=scale,
            min_energy_ratio=self.min_energy_ratio,
        )
        if relative is not None:
            # Below the floor nothing is left but rounding, as of pieces that float freely.
            own_scale = inner(nodal, self._precondition(nodal)) * relative
            floor = 1e-3 * solver.accuracy * scale
            system = replace(system, scale=max(own_scale, floor), min_energy_ratio=1.0)
            solver = replace(solver, accuracy=1.0)
        nodes = solver.solve(system)[0].T
        x = np.empty((self.n_faces, self.grid.dimension**2))
        for rows in self.grid.chunks():
            of_faces = self._at_corners(nodes, rows) @ trace.T
            x[self.faces[rows]] = of_faces.reshape(*self.faces[rows].shape, -1)
        return x

    def _at_corners(self, nodes: Array, rows: slice) -> Array:
        """Return displacements at the corners of some voxels, (copies, axes) to (voxels, …)."""
        local = nodes.take(self.grid.copies.copies[rows], axis=0)
        return np.asarray(local.reshape(len(local), -1))

    def _to_copies(self, forces: ByVoxels) -> Array:
        """Return the sums of forces at the corners of voxels, shape (1, axes, copies).

        Args:
            forces: Function to the forces at the corners of some voxels, shape (voxels, …).
        """
        d = self.grid.dimension
        copies = self.grid.copies.copies
        total = np.zeros((len(self.grid.copies.places), d))
        for rows in self.grid.chunks():
            _add_at_corners(forces(rows).reshape(*copies[rows].shape, d), copies[rows], total)
        return np.ascontiguousarray(total.T)[np.newaxis]

    def _precondition(self, forces: Array) -> Array:
        """Return the inverse in a homogeneous grid, plus that of the diagonal at split nodes."""
        places = self.grid.copies.places
        d = self.grid.dimension
        cells = math.prod(self.grid.shape)
        on_grid = np.array([np.bincount(places, x, minlength=cells) for x in forces[0]])
        is_split = self.grid.copies.is_split
        solved = self.preconditioner.apply(on_grid.reshape(1, d, *self.grid.shape))
        result = solved.reshape(d, -1).take(places, axis=1)
        result[:, is_split] += forces[0][:, is_split] / self.diagonal.T[:, is_split]
        return np.asarray(result[np.newaxis])

    def _parted(self, moments: ByVoxels) -> Array:
        """Return tractions with the same moments on both sides of a face, and none on pores.

        Moments are averaged over the two voxels of a face. What each voxel loses by that acts on
        its corners; around a node these forces balance, and are handed on through the faces that
        meet there by the least forces that do it.

        Args:
            moments: Function to the moments on the faces of some voxels, in equilibrium in each
                voxel, shape (voxels, moments).

        Returns:
            Moments as in `WholeStress`, doubled along the face, shape (S, axes, dimension²).
        """
        d = self.grid.dimension
        jumps = self._to_faces(moments)
        for axis in range(d):
            jumps[self.faces[self.grid.above[axis] >= 0, 2 * axis + 1]] *= 0.5
        trace = trace_matrix(d)
        tractions = np.empty((len(self.faces), d, d**2))
        nodal = np.empty((len(self.faces), 2**d, d))
        for rows in self.grid.chunks():
            excess = jumps[self.faces[rows]]
            by_face = moments(rows).reshape(excess.shape)
            tractions[rows] = (by_face - excess)[:, 1::2]
            nodal[rows] = (excess.reshape(len(excess), -1) @ trace).reshape(-1, 2**d, d)
        by_place = self.grid.number.reshape(self.grid.shape)
        points = corners(d)
        axes = tuple(range(d))
        around = np.array([np.roll(by_place, point, axes).ravel() for point in points])
        patterns = self.grid.copies.patterns
        links, inverses = _link_inverses(d)
        busy = np.flatnonzero(patterns)
        for start in range(0, len(busy), CHUNK):
            nodes = busy[start : start + CHUNK]
            voxels = around[:, nodes]  # (corners, nodes)
            forces = nodal[voxels, np.arange(len(points))[:, np.newaxis]]
            forces *= (voxels >= 0)[:, :, np.newaxis]
            through = inverses[patterns[nodes]] @ np.swapaxes(forces, 0, 1)
            for link, (axis, upper, lower) in enumerate(links):
                is_open = (voxels[upper] >= 0) & (voxels[lower] >= 0)
                voxel = voxels[lower, is_open]
                force = through[is_open, link]
                tractions[voxel, axis, :d] += force
                for t, along in enumerate(face_axes(d, axis)):
                    arm = points[lower][along] - 0.5
                    tractions[voxel, axis, (t + 1) * d : (t + 2) * d] += arm * force
        tractions[:, :, d:] *= 2.0
        for axis in range(d):
            tractions[self.grid.above[axis] < 0, axis] = 0.0
        return tractions


def _homogeneous_inverse(
    shear: float, table: MacroElement, shape: tuple[int, ...]
) -> FourierPreconditioner:
    """Return the inverse of the coarse system of a grid of one material without pores."""
    d = len(shape)
    points = corners(d)
    trace = trace_matrix(d)
    matrix = (trace.T @ table.stiffness @ trace).reshape(len(points), d, len(points), d)
    # A cell is alike where space is mirrored at its middle, so that the symbol is real.
    coupling = np.zeros((3,) * d + (d, d))
    for row, column in product(range(len(points)), repeat=2):
        coupling[(*(points[column] - points[row] + 1),)] += matrix[row, :, column]
    symbol = coupling
    alternating: Array = np.array(0.01 * abs(matrix).max())
    for axis, size in enumerate(shape):
        frequencies = np.fft.rfftfreq(size) if axis == d - 1 else np.fft.fftfreq(size)
        turns = np.exp(2j * np.pi * np.outer(frequencies, [-1, 0, 1]))
        symbol = np.moveaxis(np.tensordot(turns, symbol, axes=1), 0, d - 1)
        alternating = np.multiply.outer(alternating, np.sin(np.pi * frequencies) ** 2)
    # Displacements of voxels that alternate along all axes have no linear part on faces, and so no
    # energy: a small one is added, without which their blocks would be singular.
    blocks = symbol.real + alternating[..., np.newaxis, np.newaxis] * np.eye(d)
    blocks[(0,) * d] = np.eye(d)
    inverse = np.linalg.inv(blocks)
    inverse[(0,) * d] = 0.0  # a uniform displacement needs no force
    scale = float(2.0 ** np.round(np.log2(shear)))
    precision = (np.float32, np.complex64) if d == 3 else (np.float64, np.complex128)
    by_block = np.moveaxis(inverse * (scale / shear), (-2, -1), (0, 1))
    phases = np.ones((d, *by_block.shape[2:]), precision[1])
    return FourierPreconditioner(by_block.astype(precision[0]), phases, shape, scale)


@cache
def _link_inverses(dimension: int) -> tuple[list[tuple[int, int, int]], Array]:
    """Return which voxels around a node share a face, and how forces are handed on among them.

    Returns:
        For each link its axis and the corners, numbered as by `corners`, of the voxels on its upper
        and lower side; and for each pattern of solids the matrix from forces of the voxels, whose
        sum is 0 in each group, to those through the links, on the voxel below, shape (patterns,
        links, corners).
    """
    points = corners(dimension)
    links = []
    for axis in range(dimension):
        for upper in range(len(points)):
            if points[upper, axis] == 0:  # the node is the lower corner of the voxel above
                links.append((axis, upper, upper + (1 << (dimension - 1 - axis))))
    on_voxels = np.zeros((len(points), len(links)))
    for link, (_, upper, lower) in enumerate(links):
        on_voxels[upper, link] = -1
        on_voxels[lower, link] = 1
    groups = corner_groups(dimension)
    inverses = np.zeros((len(groups), len(links), len(points)))
    for pattern in range(len(groups)):
        is_in: Mask = groups[pattern] >= 0
        is_open = [bool(is_in[upper] and is_in[lower]) for _, upper, lower in links]
        open_links = on_voxels * is_open
        inverses[pattern] = open_links.T @ np.linalg.pinv(open_links @ open_links.T, rcond=1e-9)
    return links, inverses
