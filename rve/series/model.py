"""Series model of the cell: exact for circles, and their fastest model.

It refuses, with the error it would have, where particles nearly touch (r > 0.9995 or so).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Cell, Phase
from alphacut.rve.result import Homogenised
from alphacut.rve.series.means import settled_means
from alphacut.rve.series.stiffness import square_stiffness
from alphacut.rve.series.truncation import CellModuli
from alphacut.rve.settings import require_accuracy, require_parts, require_points
from alphacut.rve.slices.curve import certified, with_errors
from alphacut.stochastic import RadiusMap


@dataclass(frozen=True)
class SeriesModel:
    """Multipole series at the nodes of a Gauss rule in θ.

    Args:
        points: Nodes of the rule, or None: as many as bring two successive rules within `accuracy`
            of one another.
        accuracy: Relative error allowed, of the series at each θ and, without `points`, of E by the
            rule in θ; in [1e-12, 0.1].

    Raises:
        RefusedError: A value lies outside its range.
    """

    points: int | None = None
    accuracy: float = 1e-11
    name = "series"

    def __post_init__(self) -> None:
        require_points(self.points)
        require_accuracy(self.accuracy, 1e-12, "accuracy of the series")

    def solve(
        self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> list[Homogenised]:
        """One result for each of `inclusions`, in their order.

        Raises:
            SeriesError: Particles nearly touch.
            RuleError: No rule in θ settles (a map that is not smooth).
        """
        require_parts(radius_map, matrix, inclusions)
        start = perf_counter()

        def cells(radii: Array) -> CellModuli:
            return square_stiffness(radii, matrix, inclusions, tolerance=self.accuracy)

        means = settled_means(radius_map, cells, points=self.points, accuracy=self.accuracy)
        seconds = {"total": perf_counter() - start}
        return [
            certified(
                Homogenised(
                    curve=with_errors(mean.curve, mean.nodes),
                    method=self.name,
                    unknowns=mean.terms,
                    seconds=seconds,
                    errors=mean.errors,
                    cell=Cell(matrix, inclusion, radius_map),
                )
            )
            for mean, inclusion in zip(means, inclusions, strict=True)
        ]
