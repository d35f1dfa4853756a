"""Series model of the cell: exact for circles, and their fastest model.

It refuses, with the error it would have, where particles nearly touch (r > 0.9995 or so).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Cell, Phase
from alphacut.rve.result import Homogenised
from alphacut.rve.series.stiffness import square_stiffness
from alphacut.rve.settings import require_accuracy, require_parts, require_points
from alphacut.rve.slices.curve import certified, mean_errors, with_errors
from alphacut.rve.slices.theta_rule import settle_rule
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
        used: dict[float, tuple[Array, Array]] = {}

        def stiffness_at(radii: Array) -> Array:
            cells = square_stiffness(radii, matrix, inclusions, tolerance=self.accuracy)
            used.update(zip(radii, zip(cells.errors, cells.harmonics, strict=True), strict=True))
            return cells.matrix

        curves, gaps, finest = settle_rule(
            radius_map, stiffness_at, points=self.points, accuracy=self.accuracy
        )
        seconds = {"solve": perf_counter() - start, "total": perf_counter() - start}
        results = []
        for k, (curve, gap, judge) in enumerate(zip(curves, gaps, finest, strict=True)):
            own, other = ([used[float(r)] for r in radius_map(c.theta)] for c in (curve, judge))
            error, harmonics = np.array([e[k] for e, _ in own]), max(int(n[k]) for _, n in own)
            left = mean_errors(judge, np.array([e[k] for e, _ in other]))
            results.append(
                Homogenised(
                    curve=with_errors(curve, error),
                    method=self.name,
                    unknowns=harmonics,
                    seconds=seconds,
                    errors={"space": np.maximum(mean_errors(curve, error), left), "theta": gap},
                    reason=f"{curve.theta.size} nodes in θ, {harmonics} harmonics",
                )
            )
        pairs = zip(results, inclusions, strict=True)
        return [certified(result, Cell(matrix, phase, radius_map)) for result, phase in pairs]
