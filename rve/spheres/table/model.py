"""Table model of spheres: elements' moduli as an interpolant over radius and modulus."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

from alphacut.rve.cell import Phase
from alphacut.rve.settings import require_accuracy
from alphacut.rve.slices.theta_rule import extreme_radii, settle_rule
from alphacut.rve.spheres.cubic import cubic_moduli, cubic_voigt
from alphacut.rve.spheres.result import HomogenisedSpheres, certified_spheres
from alphacut.rve.spheres.table.source import (
    LARGEST_RADIUS,
    OctantSource,
    SphereRange,
    SphereSeriesSource,
)
from alphacut.rve.table.cache import stored_table
from alphacut.rve.table.interpolant import Table
from alphacut.rve.table.model import by_poisson, rounded_moduli, rounded_radii, table_in_words
from alphacut.stochastic import RadiusMap
from alphacut.stochastic.theta.truncated_normal import Array

_THETA_SHARE = 0.05  # of the accuracy; nodes in θ cost nothing here
_SOURCES = {"octant": OctantSource, "sphere series": SphereSeriesSource}


@dataclass(frozen=True)
class SphereTableModel:
    """Chebyshev interpolant of elements over (r, E_i), averaged over θ.

    Args:
        accuracy: Relative error of the moduli allowed, in [1e-5, 0.1].
        cache: Folder where tables are kept from run to run; None keeps them in the process.
        moduli: Moduli of the particle that the table covers, in Pa; None: those asked for, rounded
            outwards if they are several.
        source: "octant", or "sphere series" to test the table itself.

    Raises:
        ValueError: A value lies outside its range.
    """

    accuracy: float = 1e-4
    cache: Path | None = None
    moduli: tuple[float, float] | None = None
    source: str = "octant"
    name = "table"

    def __post_init__(self) -> None:
        require_accuracy(self.accuracy, 1e-5, "accuracy of the table of spheres")
        if self.source not in _SOURCES:
            allowed = " or ".join(_SOURCES)
            raise ValueError(f"the source of the table is {self.source!r}; it must be {allowed}")

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
        results: dict[int, HomogenisedSpheres] = {}
        for poisson, places, moduli in by_poisson(inclusions):
            started = perf_counter()
            table, found = stored_table(
                self._span(radius_map, matrix, poisson, moduli),
                self.cache,
                accuracy=self.accuracy,
                source=self.source,
                make=_SOURCES[self.source],
            )
            built = perf_counter() - started
            evaluated = self._evaluate(table, radius_map, moduli, built=built, found=found)
            results |= {
                k: certified_spheres(r, radius_map, matrix, inclusions[k])
                for k, r in zip(places, evaluated, strict=True)
            }
        return [results[k] for k in range(len(inclusions))]

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

        curves, gaps = settle_rule(
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
