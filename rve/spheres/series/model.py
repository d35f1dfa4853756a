"""Series model of the cell with a sphere: exact for the simple cubic array, at nodes of θ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Phase
from alphacut.rve.result import StressCurve
from alphacut.rve.settings import require_accuracy, require_parts, require_points
from alphacut.rve.slices.theta_rule import settle_rule
from alphacut.rve.spheres.cubic import cubic_moduli
from alphacut.rve.spheres.result import HomogenisedSpheres, certified_spheres
from alphacut.rve.spheres.series.stiffness import cubic_stiffness
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
        used: dict[float, tuple[Array, Array]] = {}

        def stiffness_at(radii: Array) -> Array:
            cells = cubic_stiffness(radii, matrix, inclusions, tolerance=self.accuracy)
            used.update(zip(radii, zip(cells.errors, cells.degrees, strict=True), strict=True))
            return cells.matrix

        def space_error(curve: StressCurve, k: int) -> Array:
            """Declared errors of the mean moduli from those at the nodes, shape (3,)."""
            errors = [used[r][0][k] for r in radius_map(curve.theta)]
            moduli = curve.weights[:, None] * cubic_moduli(np.asarray(curve.stiffness))
            return np.asarray((moduli * errors).sum(axis=0) / moduli.sum(axis=0))

        curves, gaps, finest = settle_rule(
            radius_map,
            stiffness_at,
            points=self.points,
            accuracy=self.accuracy,
            moduli=cubic_moduli,
        )
        seconds, results = perf_counter() - start, []
        for k, (curve, gap, judge) in enumerate(zip(curves, gaps, finest, strict=True)):
            degree = max(int(used[r][1][k]) for r in radius_map(curve.theta))
            space = np.maximum(space_error(curve, k), space_error(judge, k))
            result = HomogenisedSpheres(
                curve=curve,
                method=self.name,
                unknowns=3 * (degree + 2) ** 2 // 16,
                seconds={"solve": seconds, "total": seconds},
                errors={"space": space, "theta": gap},
                reason=f"{curve.theta.size} nodes in θ, multipoles up to degree {degree}",
            )
            results.append(certified_spheres(result, radius_map, matrix, inclusions[k]))
        return results
