"""Table model: the cell's stiffness as an interpolant over radius and modulus."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TypeVar

import numpy as np

from alphacut.rve.cell import Phase
from alphacut.rve.result import Homogenised
from alphacut.rve.settings import require_accuracy, require_parts
from alphacut.rve.slices.curve import certified, mean_errors, with_errors
from alphacut.rve.slices.theta_rule import extreme_radii, settle_rule
from alphacut.rve.table.build import PlanarSource
from alphacut.rve.table.cache import stored_table
from alphacut.rve.table.interpolant import Table, TableRange
from alphacut.stochastic import RadiusMap
from alphacut.stochastic.theta.truncated_normal import Array

R = TypeVar("R", bound=Homogenised)
_POINTWISE = 1.5  # safety of a single θ, where errors do not average
_THETA_SHARE = 0.05  # of the accuracy; nodes in θ cost nothing here


@dataclass(frozen=True)
class TableModel:
    """Chebyshev interpolant of planar solves over (r, E_i), averaged over θ.

    Args:
        accuracy: Relative error of E allowed, in [1e-9, 0.1].
        cache: Folder where tables are kept from run to run; None keeps them in the process.
        radii: Radii that the table covers; None: those of the map, rounded outwards so that similar
            maps share a table.
        moduli: Moduli of the particle that it covers, in Pa; None: those asked for, rounded
            outwards if they are several.
        progress: Called with the fraction done while a table is built.

    Raises:
        ValueError: A value lies outside its range.
    """

    accuracy: float = 5e-8
    cache: Path | None = None
    radii: tuple[float, float] | None = None
    moduli: tuple[float, float] | None = None
    progress: Callable[[float], None] | None = None
    name = "table"

    def __post_init__(self) -> None:
        require_accuracy(self.accuracy, 1e-9, "accuracy of the table")

    def solve(
        self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> list[Homogenised]:
        """One result for each of `inclusions`, in their order.

        Raises:
            TableError: The accuracy is not reached.
            RuleError: No rule in θ settles (a map that is not smooth).
            ValueError: The map or a modulus leaves the range that was given.
        """
        require_parts(radius_map, matrix, inclusions)

        def made(poisson: float, moduli: Array) -> list[Homogenised]:
            started = perf_counter()
            span = self._span(radius_map, matrix, poisson, moduli)
            table, found = stored_table(
                span, self.cache, accuracy=self.accuracy, make=PlanarSource, progress=self.progress
            )
            built = perf_counter() - started
            return self._evaluate(table, radius_map, moduli, built=built, found=found)

        pairs = zip(each_poisson(inclusions, made), inclusions, strict=True)
        return [certified(result, radius_map, matrix, phase) for result, phase in pairs]

    def _span(
        self, radius_map: RadiusMap, matrix: Phase, poisson: float, moduli: Array
    ) -> TableRange:
        low, high = (float(r) for r in extreme_radii(radius_map))
        radii = self.radii or ((low, high) if high - low < 1e-12 else rounded_radii(low, high))
        between = self.moduli or rounded_moduli(float(moduli.min()), float(moduli.max()))
        return TableRange(matrix, poisson, radii, between)

    def _evaluate(
        self, table: Table, radius_map: RadiusMap, moduli: Array, *, built: float, found: bool
    ) -> list[Homogenised]:
        started = perf_counter()

        def stiffness_at(radii: Array) -> Array:
            return table.stiffness(radii, moduli)

        curves, gaps, _ = settle_rule(
            radius_map, stiffness_at, points=None, accuracy=max(_THETA_SHARE * self.accuracy, 1e-13)
        )
        seconds = {
            "table": built,
            "solve": perf_counter() - started,
            "total": built + perf_counter() - started,
        }
        origin = table_in_words(table, found=found)
        results = []
        for curve, gap in zip(curves, gaps, strict=True):
            space = table.space_error(radius_map(curve.theta))
            errors = {
                "space": mean_errors(curve, space),
                "theta": gap,
                "table": table.interpolation,
            }
            results.append(
                Homogenised(
                    curve=with_errors(curve, _POINTWISE * (space + table.interpolation)),
                    method=self.name,
                    solver="none",
                    unknowns=table.unknowns,
                    seconds=seconds,
                    errors=errors,
                    reason=f"{origin}; {curve.theta.size} nodes in θ",
                )
            )
        return results


def table_in_words(table: Table, *, found: bool) -> str:
    """The table in words, and whether it was kept from before."""
    radii, moduli = table.coefficients.shape[:2]
    made = f"built in {table.seconds:.2f} s from {table.systems} linear solves"
    return (
        f"table of {radii} radii by {moduli} moduli, mesh size {table.mesh_size:.3g},"
        f" {'kept' if found else made}"
    )


def each_poisson(inclusions: Sequence[Phase], solve: Callable[[float, Array], list[R]]) -> list[R]:
    """Results in the order of `inclusions`, from a call for each Poisson's ratio and its moduli."""
    results: dict[int, R] = {}
    for poisson in dict.fromkeys(p.poisson for p in inclusions):
        places = [k for k, p in enumerate(inclusions) if p.poisson == poisson]
        moduli = np.array([inclusions[k].modulus for k in places])
        results |= dict(zip(places, solve(poisson, moduli), strict=True))
    return [results[k] for k in range(len(inclusions))]


def rounded_radii(low: float, high: float) -> tuple[float, float]:
    """Outwards to fortieths; below 1/40, and of the gap 1 − r below 1/40, to powers of 2."""
    least = np.floor(low * 40 + 1e-9) / 40 or 2.0 ** np.floor(np.log2(low))
    gap = np.floor((1 - high) * 40 + 1e-9) / 40 or 2.0 ** np.floor(np.log2(1 - high))
    return float(least), float(1 - gap)


def rounded_moduli(low: float, high: float) -> tuple[float, float]:
    """Outwards to eighths of an octave; a single modulus stays as it is."""
    if low == high:
        return low, high
    return float(2 ** (np.floor(8 * np.log2(low) + 1e-9) / 8)), float(
        2 ** (np.ceil(8 * np.log2(high) - 1e-9) / 8)
    )
