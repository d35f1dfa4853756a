"""What a table of spheres interpolates: its range, and moduli by elements on one eighth."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from alphacut.rve.cell import Phase, with_ratio_errors
from alphacut.rve.spheres.bounds import mori_tanaka
from alphacut.rve.spheres.result import volume_fraction
from alphacut.rve.spheres.series.stiffness import cubic_stiffness
from alphacut.rve.table.build import TableError
from alphacut.rve.table.interpolant import TableRange
from alphacut.stochastic.theta.truncated_normal import Array

LARGEST_RADIUS = 0.97  # meshes of spheres end there
_ROUGH, _FINEST = 0.4, 0.035  # mesh sizes
_RATE = 3.5  # of the moduli in the mesh size


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
    """Moduli by curved quadratic tetrahedra on meshes as fine as `accuracy` needs."""

    span: TableRange
    accuracy: float
    mesh_size: float = field(init=False)
    space: Array = field(init=False)
    unknowns: int = 0
    systems: int = 0

    def __post_init__(self) -> None:
        low, high = self.span.radii
        radii = np.unique([low, (low + 2 * high) / 3, high])
        size, errors = _ROUGH, self._errors(radii, _ROUGH)
        while errors.max() > self.accuracy:
            if size <= _FINEST:
                raise TableError(
                    f"elements about spheres leave a relative error of {errors.max():.1e} on the"
                    f" finest mesh ({_FINEST:g}) and {self.accuracy:.1e} is wanted: allow a larger"
                    " error, or take the series"
                )
            finer = (0.8 * self.accuracy / errors.max()) ** (1 / _RATE)
            size = max(_FINEST, size * min(0.9, finer))
            errors = self._errors(radii, size)
        self.mesh_size = size
        self.space = np.vstack([radii, with_ratio_errors(errors).T])

    def _errors(self, radii: Array, size: float) -> Array:
        """Declared relative errors at radii, the larger of both extreme moduli, shape (n, 3)."""
        from alphacut.rve.spheres.fem.stiffness import cubic_stiffness_by_elements

        phases = self._phases(np.unique(self.span.moduli))
        found = []
        for radius in radii:
            _, error = cubic_stiffness_by_elements(radius, self.span.matrix, phases, size=size)
            found.append(error.max(axis=0))
            self.systems += 6 * len(phases)
        return np.array(found)

    def _phases(self, modulus: Array) -> list[Phase]:
        return [Phase(float(e), self.span.poisson) for e in modulus]

    def moduli(self, radius: float, modulus: Array) -> Array:
        """K, (C11 − C12)/2 and C44 in Pa at the chosen mesh size, shape (m, 3)."""
        return self._solve(radius, modulus, self.mesh_size)

    def rough(self, radius: float, modulus: Array) -> Array:
        """The same on the first mesh."""
        return self._solve(radius, modulus, _ROUGH)

    def _solve(self, radius: float, modulus: Array, size: float) -> Array:
        from alphacut.rve.spheres.fem.stiffness import OctantCell

        cell = OctantCell(radius, size=size)
        self.systems += 3 * len(modulus)
        self.unknowns = max(self.unknowns, cell.unknowns)
        matrix = self.span.matrix
        return np.array([cell.solve(matrix, phase).moduli for phase in self._phases(modulus)])


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
