"""Table model of spheres: elements' moduli as an interpolant over radius and modulus."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from alphacut.rve.cell import Phase, with_ratio_errors
from alphacut.rve.settings import require_accuracy
from alphacut.rve.slices.theta_rule import extreme_radii, settle_rule
from alphacut.rve.spheres.bounds import mori_tanaka
from alphacut.rve.spheres.cubic import cubic_moduli, cubic_voigt
from alphacut.rve.spheres.result import HomogenisedSpheres, certified_spheres, volume_fraction
from alphacut.rve.table.build import TableError, larger_error
from alphacut.rve.table.cache import stored_table
from alphacut.rve.table.interpolant import Table, TableRange
from alphacut.rve.table.model import each_poisson, rounded_moduli, rounded_radii, table_in_words
from alphacut.stochastic import RadiusMap
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    from alphacut.rve.spheres.fem.extrapolation import Meshes
    from alphacut.rve.spheres.fem.modulus_basis import ModulusBasis

_THETA_SHARE = 0.05  # of the accuracy; nodes in θ cost nothing here
LEAST_ACCURACY = 1e-5
LARGEST_RADIUS = 0.97  # meshes of spheres end there
_COARSE, _ROUGH, _FINEST = 0.4, 0.25, 0.035  # mesh sizes
_BASIS_SHARE = 0.02  # of the accuracy, for what a few solutions miss of others


@dataclass(frozen=True)
class SphereRange(TableRange):
    """Range of a table of spheres, see `TableRange`; K, (C11 − C12)/2 and C44 are tabled."""

    def dilute(self, radius: Array, modulus: Array) -> Array:
        """The three moduli by Mori and Tanaka in Pa, shape (n, m, 3)."""
        share, phases = volume_fraction(radius), [Phase(float(e), self.poisson) for e in modulus]
        pairs = [mori_tanaka(share, self.matrix, phase) for phase in phases]
        return np.stack([np.stack([k, g, g], axis=-1) for k, g in pairs], axis=1)


@dataclass
class OctantSource:
    """Moduli by curved quadratic tetrahedra, at each radius on meshes as fine as it needs."""

    span: TableRange
    accuracy: float
    mesh_size: float = _ROUGH
    space: Array = field(init=False)
    unknowns: int = 0
    systems: int = 0
    parallel: bool = False
    progress: Callable[[float], None] | None = None

    def __post_init__(self) -> None:
        from alphacut.rve.spheres.fem.modulus_basis import basis_between
        from alphacut.rve.spheres.fem.stiffness import OctantCell

        # isort: split
        from mpi4py import MPI

        self._comm = MPI.COMM_WORLD if self.parallel else MPI.COMM_SELF
        self._errors: dict[float, Array] = {}
        self._rough: dict[float, ModulusBasis] = {}
        least, greatest = self._phases(np.array(self.span.moduli))
        self._basis, self._missed = basis_between(
            OctantCell(self.span.radii[1], size=_COARSE, comm=self._comm),
            self.span.matrix,
            (least, greatest),
            error=_BASIS_SHARE * self.accuracy,
        )

    def moduli(self, radii: Sequence[float], modulus: Array) -> list[Array]:
        """K, (C11 − C12)/2 and C44 in Pa at each radius, shape (m, 3) each.

        Raises:
            TableError: The finest mesh is not fine enough.
        """
        found = []
        for radius in radii:
            found.append(self._at(radius, modulus))
            if self.progress:
                self.progress(len(found) / len(radii))
        return found

    def _at(self, radius: float, modulus: Array) -> Array:
        from alphacut.rve.spheres.fem.extrapolation import Meshes

        meshes = Meshes(radius, self.span.matrix, size=_ROUGH, basis=self._basis, comm=self._comm)
        self._refine(meshes)
        found = meshes.judged(self._phases(modulus))
        self._errors[radius] = found.errors.max(axis=0) + self._missed
        radii = sorted(self._errors)
        errors = np.array([self._errors[r] for r in radii])
        self.space = np.vstack([radii, with_ratio_errors(errors).T])
        self.mesh_size = min(self.mesh_size, meshes.size)
        self.unknowns = max(self.unknowns, meshes.unknowns)
        self.systems += meshes.systems
        return found.moduli

    def _refine(self, meshes: Meshes) -> None:
        """Finer meshes until the extreme moduli keep the accuracy."""
        from alphacut.rve.spheres.fem.extrapolation import ORDER

        ends, allowed = self._phases(np.array(self.span.moduli)), self.accuracy - self._missed
        while (error := float(meshes.judged(ends).errors.max())) > allowed:
            if meshes.size <= _FINEST:
                raise TableError(
                    f"elements about spheres leave a relative error of {error:.1e} on the finest"
                    f" mesh ({_FINEST:g}) and {self.accuracy:.1e} is wanted: {larger_error(error)}"
                )
            finer = (0.8 * allowed / error) ** (1 / ORDER)
            meshes.refine(max(_FINEST, meshes.size * min(0.75, max(0.25, finer))))

    def _phases(self, modulus: Array) -> list[Phase]:
        return [Phase(float(e), self.span.poisson) for e in modulus]

    def rough(self, radius: float, modulus: Array) -> Array:
        """The same on one coarse mesh."""
        from alphacut.rve.spheres.fem.modulus_basis import ModulusBasis
        from alphacut.rve.spheres.fem.stiffness import OctantCell

        if radius not in self._rough:
            cell = OctantCell(radius, size=_COARSE, comm=self._comm)
            self._rough[radius] = ModulusBasis(cell, self.span.matrix, self._basis)
        return np.array([self._rough[radius].moduli(float(e)) for e in modulus])


@dataclass(frozen=True)
class SphereTableModel:
    """Chebyshev interpolant of elements over (r, E_i), averaged over θ.

    As `TableModel`, but `accuracy`, in [1e-5, 0.1], is that of the moduli, and all MPI ranks share
    each mesh if `parallel`; a cache is then none.

    Raises:
        ValueError: A value lies outside its range.
    """

    accuracy: float = 1e-4
    cache: Path | None = None
    moduli: tuple[float, float] | None = None
    parallel: bool = False
    name = "table"

    def __post_init__(self) -> None:
        require_accuracy(self.accuracy, LEAST_ACCURACY, "accuracy of the table of spheres")

    def solve(
        self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> list[HomogenisedSpheres]:
        """One result for each of `inclusions`, in their order.

        Raises:
            TableError: The accuracy is not reached.
            RuleError: No rule in θ settles (a map that is not smooth).
            TouchingError: Spheres nearly touch.
            ValueError: A modulus leaves the range that was given.
        """

        def made(poisson: float, moduli: Array) -> list[HomogenisedSpheres]:
            started = perf_counter()
            table, found = stored_table(
                self._span(radius_map, matrix, poisson, moduli),
                None if self.parallel else self.cache,  # ranks might not all find it
                accuracy=self.accuracy,
                make=partial(OctantSource, parallel=self.parallel),
            )
            built = perf_counter() - started
            return self._evaluate(table, radius_map, moduli, built=built, found=found)

        pairs = zip(each_poisson(inclusions, made), inclusions, strict=True)
        return [certified_spheres(result, radius_map, matrix, phase) for result, phase in pairs]

    def _span(
        self, radius_map: RadiusMap, matrix: Phase, poisson: float, moduli: Array
    ) -> SphereRange:
        low, high = (float(r) for r in extreme_radii(radius_map))
        least, greatest = (low, high) if high - low < 1e-12 else rounded_radii(low, high)
        radii = least, max(high, min(greatest, LARGEST_RADIUS))
        between = self.moduli or rounded_moduli(float(moduli.min()), float(moduli.max()))
        return SphereRange(matrix, poisson, radii, between)

    def _evaluate(
        self, table: Table, radius_map: RadiusMap, moduli: Array, *, built: float, found: bool
    ) -> list[HomogenisedSpheres]:
        started = perf_counter()

        def stiffness_at(radii: Array) -> Array:
            return cubic_voigt(*np.moveaxis(table.moduli(radii, moduli), -1, 0))

        curves, gaps, _ = settle_rule(
            radius_map,
            stiffness_at,
            points=None,
            accuracy=max(_THETA_SHARE * self.accuracy, 1e-13),
            moduli=cubic_moduli,
        )
        solve = perf_counter() - started
        results = []
        for curve, gap in zip(curves, gaps, strict=True):
            space = table.space_error(radius_map(curve.theta))[:, :3]
            own = cubic_moduli(np.asarray(curve.stiffness))
            mean = curve.weights @ (own * space) / (curve.weights @ own)
            errors = {"space": mean, "theta": gap, "table": table.interpolation[:3]}
            results.append(
                HomogenisedSpheres(
                    curve=curve,
                    method=self.name,
                    unknowns=table.unknowns,
                    seconds={"table": built, "solve": solve, "total": built + solve},
                    errors=errors,
                    reason=f"{table_in_words(table, found=found)}; {curve.theta.size} nodes in θ",
                )
            )
        return results
