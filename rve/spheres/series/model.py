"""Series model of the cell with a sphere: exact for the simple cubic array, at nodes of θ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Cell, Phase
from alphacut.rve.series.means import settled_means
from alphacut.rve.series.truncation import CellModuli
from alphacut.rve.settings import require_accuracy, require_parts, require_points
from alphacut.rve.spheres.result import HomogenisedSpheres, certified_spheres
from alphacut.rve.spheres.series.stiffness import cubic_stiffness, unknowns
from alphacut.stochastic import RadiusMap


@dataclass(frozen=True)
class SphereSeriesModel:
    """As `SeriesModel`, for spheres; `accuracy`, in [1e-11, 0.1], is that of the mean moduli.

    Raises:
        RefusedError: A value lies outside its range.
    """

    points: int | None = None
    accuracy: float = 1e-9
    name = "series"

    def __post_init__(self) -> None:
        require_points(self.points)
        require_accuracy(self.accuracy, 1e-11, "accuracy of the series of spheres")

    def solve(
        self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> list[HomogenisedSpheres]:
        """One result for each of `inclusions`, in their order.

        Raises:
            SeriesError: Spheres nearly touch.
            RuleError: No rule in θ settles (a map that is not smooth).
        """
        require_parts(radius_map, matrix, inclusions)
        start = perf_counter()

        def cells(radii: Array) -> CellModuli:
            return cubic_stiffness(radii, matrix, inclusions, tolerance=self.accuracy)

        means = settled_means(radius_map, cells, points=self.points, accuracy=self.accuracy)
        seconds = {"total": perf_counter() - start}
        return [
            certified_spheres(
                HomogenisedSpheres(
                    curve=mean.curve,
                    method=self.name,
                    unknowns=unknowns(mean.terms),
                    seconds=seconds,
                    errors=mean.errors,
                    cell=Cell(matrix, inclusion, radius_map),
                )
            )
            for mean, inclusion in zip(means, inclusions, strict=True)
        ]
