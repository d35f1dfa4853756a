"""What a table of spheres interpolates: its range, and moduli by elements on one eighth."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from alphacut.rve.cell import Phase, with_ratio_errors
from alphacut.rve.spheres.bounds import mori_tanaka
from alphacut.rve.spheres.result import volume_fraction
from alphacut.rve.spheres.series.stiffness import cubic_stiffness
from alphacut.rve.table.build import TableError
from alphacut.rve.table.interpolant import TableRange
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    from alphacut.rve.spheres.fem.extrapolation import Meshes

LARGEST_RADIUS = 0.97  # meshes of spheres end there
_ROUGH, _FINEST = 0.25, 0.035  # mesh sizes


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

    def __post_init__(self) -> None:
        self._errors: dict[float, Array] = {}

    def moduli(self, radius: float, modulus: Array) -> Array:
        """K, (C11 − C12)/2 and C44 in Pa, shape (m, 3).

        Raises:
            TableError: The finest mesh is not fine enough.
        """
        from alphacut.rve.spheres.fem.extrapolation import Meshes

        meshes = Meshes(radius, self.span.matrix, size=_ROUGH)
        self._refine(meshes, self._phases(np.unique([modulus.min(), modulus.max()])))
        found = meshes.judged(self._phases(modulus))
        self._errors[radius] = found.errors.max(axis=0)
        radii = sorted(self._errors)
        errors = np.array([self._errors[r] for r in radii])
        self.space = np.vstack([radii, with_ratio_errors(errors).T])
        self.mesh_size = min(self.mesh_size, meshes.size)
        self.unknowns = max(self.unknowns, meshes.unknowns)
        self.systems += meshes.systems
        return found.moduli

    def _refine(self, meshes: Meshes, ends: list[Phase]) -> None:
        """Meshes until the extreme moduli keep the accuracy."""
        from alphacut.rve.spheres.fem.extrapolation import ORDER

        while (error := float(meshes.judged(ends).errors.max())) > self.accuracy:
            if meshes.size <= _FINEST:
                raise TableError(
                    f"elements about spheres leave a relative error of {error:.1e} on the finest"
                    f" mesh ({_FINEST:g}) and {self.accuracy:.1e} is wanted: allow a larger error,"
                    " or take the series"
                )
            finer = (0.8 * self.accuracy / error) ** (1 / ORDER)
            meshes.refine(max(_FINEST, meshes.size * min(0.75, max(0.25, finer))))

    def _phases(self, modulus: Array) -> list[Phase]:
        return [Phase(float(e), self.span.poisson) for e in modulus]

    def rough(self, radius: float, modulus: Array) -> Array:
        """The same on one coarse mesh."""
        from alphacut.rve.spheres.fem.stiffness import OctantCell

        cell = OctantCell(radius, size=_ROUGH)
        self.systems += 3 * modulus.size
        return np.array([cell.solve(self.span.matrix, p).moduli for p in self._phases(modulus)])


@dataclass
class SphereSeriesSource:
    """Moduli by multipole series: for tests of the table itself."""

    span: TableRange
    accuracy: float
    mesh_size: float = 0.0
    space: Array = field(default_factory=lambda: np.array([[0.5]] + 4 * [[1e-10]]))
    unknowns: int = 0
    systems: int = 0

    def moduli(self, radius: float, modulus: Array) -> Array:
        """To 1e-10."""
        phases = [Phase(float(e), self.span.poisson) for e in modulus]
        cell = cubic_stiffness(np.array([radius]), self.span.matrix, phases, tolerance=1e-10)
        return np.stack([cell.bulk[0], cell.deviator[0], cell.shear[0]], axis=-1)

    rough = moduli
