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
        self._known: dict[tuple[float, float, float], Array] = {}
        self._judged: dict[tuple[float, float], Array] = {}
        radii = np.unique(self.span.nodes((3, 1))[0])  # of the table too: solved once
        size, errors = _ROUGH, self._errors(radii, _ROUGH)
        while errors.max() > self.accuracy:  # a finer mesh gains more at one than at another
            worst = int(errors.max(axis=1).argmax())
            size = self._fine_enough(radii[[worst]], size, float(errors[worst].max()))
            errors = self._errors(radii, size)
        self.mesh_size = size
        self.space = np.vstack([radii, with_ratio_errors(errors).T])

    def _fine_enough(self, radius: Array, size: float, error: float) -> float:
        """Mesh size at which one radius keeps the accuracy, from a rougher one and its error."""
        while error > self.accuracy:
            if size <= _FINEST:
                raise TableError(
                    f"elements about spheres leave a relative error of {error:.1e} on the finest"
                    f" mesh ({_FINEST:g}) and {self.accuracy:.1e} is wanted: allow a larger error,"
                    " or take the series"
                )
            finer = (0.8 * self.accuracy / error) ** (1 / _RATE)
            size = max(_FINEST, size * min(0.9, max(0.5, finer)))
            error = float(self._errors(radius, size).max())
        return size

    def _errors(self, radii: Array, size: float) -> Array:
        """Declared relative errors at radii, the larger of both extreme moduli, shape (n, 3)."""
        return np.array([self._error(float(radius), size) for radius in radii])

    def _error(self, radius: float, size: float) -> Array:
        """At one radius, shape (3,); the solutions are kept."""
        from alphacut.rve.spheres.fem.stiffness import on_two_meshes

        ends = np.unique(self.span.moduli)
        key = (round(radius, 9), size)
        if key not in self._judged:
            phases = self._phases(ends)
            solved, error, unknowns = on_two_meshes(radius, self.span.matrix, phases, size=size)
            self.unknowns = max(self.unknowns, unknowns)
            self.systems += 6 * len(phases)
            self._known |= {(*key, round(e, 3)): row for e, row in zip(ends, solved, strict=True)}
            self._judged[key] = error.max(axis=0)
        return self._judged[key]

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

        keys = [(round(radius, 9), size, round(float(e), 3)) for e in modulus]
        left = [(k, e) for k, e in zip(keys, modulus, strict=True) if k not in self._known]
        if left:
            cell = OctantCell(radius, size=size)
            self.unknowns = max(self.unknowns, cell.unknowns)
            self.systems += 3 * len(left)
            phases = self._phases(np.array([e for _, e in left]))
            solved = [cell.solve(self.span.matrix, phase).moduli for phase in phases]
            self._known |= {k: one for (k, _), one in zip(left, solved, strict=True)}
        return np.array([self._known[k] for k in keys])


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
