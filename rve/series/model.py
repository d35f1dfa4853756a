"""Series model of the cell: exact for circles, and their fastest model.

It refuses, with the error it would have, where particles nearly touch (r > 0.9995 or so).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter

from alphacut.rve.cell import Phase
from alphacut.rve.result import Homogenised
from alphacut.rve.series.stiffness import square_stiffness
from alphacut.rve.slices.curve import certified
from alphacut.rve.slices.theta_rule import settle_rule
from alphacut.stochastic import RadiusMap
from alphacut.stochastic.theta.truncated_normal import Array


@dataclass(frozen=True)
class SeriesModel:
    """Multipole series at the nodes of a Gauss rule in θ.

    Args:
        points: Nodes of the rule, or None: as many as bring two successive rules within `accuracy`
            of one another.
        accuracy: Relative error allowed, of the series at each θ and, without `points`, of E by the
            rule in θ; in [1e-12, 0.1].

    Raises:
        ValueError: A value lies outside its range.
    """

    points: int | None = None
    accuracy: float = 1e-11
    name = "series"

    def __post_init__(self) -> None:
        if self.points is not None and self.points < 2:
            raise ValueError(f"the rule in θ has {self.points} points; it needs at least 2")
        if not 1e-12 <= self.accuracy <= 0.1:
            raise ValueError(
                f"the accuracy of the series is {self.accuracy:g}; it must lie in [1e-12, 0.1]"
            )

    def solve(
        self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> list[Homogenised]:
        """One result for each of `inclusions`, in their order.

        Raises:
            SeriesError: Particles nearly touch.
            RuleError: No rule in θ settles (a map that is not smooth).
        """
        start = perf_counter()
        used: dict[float, tuple[Array, Array]] = {}

        def stiffness_at(radii: Array) -> Array:
            cells = square_stiffness(radii, matrix, inclusions, tolerance=self.accuracy)
            used.update(
                (float(r), (e, n))
                for r, e, n in zip(radii, cells.error, cells.harmonics, strict=True)
            )
            return cells.matrix

        curves, gaps = settle_rule(
            radius_map, stiffness_at, points=self.points, accuracy=self.accuracy
        )
        spent = [[used[float(r)] for r in radius_map(curve.theta)] for curve in curves]
        error = [
            float(curve.weights @ [cell[0][k] for cell in spent[k]])
            for k, curve in enumerate(curves)
        ]
        harmonics = [max(int(cell[1][k]) for cell in spent[k]) for k in range(len(curves))]
        seconds = {"solve": perf_counter() - start, "total": perf_counter() - start}
        results = [
            Homogenised(
                curve=curve,
                method=self.name,
                unknowns=harmonics[k],
                seconds=seconds,
                error={"space": error[k], "theta": gaps[k]},
                reason=f"{curve.theta.size} nodes in θ, {harmonics[k]} harmonics",
            )
            for k, curve in enumerate(curves)
        ]
        return [
            certified(r, radius_map, matrix, phase)
            for r, phase in zip(results, inclusions, strict=True)
        ]
