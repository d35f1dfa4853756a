"""The series model of the cell: exact for circles, so the project's own truth, and for circles its fastest model.

It refuses, with the error it would have, where particles nearly touch (r > 0.9995 or so).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter

from rve.cell import STRAIN, Phase
from rve.result import Homogenised, StressCurve, effective_modulus
from rve.series_stiffness import square_stiffness
from rve.slices_rule import theta_rule
from stochastic import RadiusMap, ThetaRule
from stochastic.truncated_normal import Array

_MOST_POINTS = 512


@dataclass(frozen=True)
class SeriesModel:
    """Multipole series at the nodes of a Gauss rule in θ.

    Args:
        points: Nodes of the rule, or None: as many as bring two successive rules within `accuracy` of one another.
        accuracy: Relative error allowed, of the series at each θ and, without `points`, of E by the rule in θ; in [1e-12, 0.1].

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
            raise ValueError(f"the accuracy of the series is {self.accuracy:g}; it must lie in [1e-12, 0.1]")

    def solve(self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]) -> list[Homogenised]:
        """One result for each of `inclusions`, in their order.

        Raises:
            SeriesError: Particles nearly touch, or the rule in θ is out of nodes (a map that is not smooth).
        """
        start = perf_counter()
        points = self.points or 16
        coarse = self._curves(theta_rule(radius_map, points=-(-3 * points // 4)), radius_map, matrix, inclusions)
        while True:
            fine = self._curves(theta_rule(radius_map, points=points), radius_map, matrix, inclusions)
            gaps = [_gap(a, b) for a, b in zip(coarse[0], fine[0], strict=True)]
            if self.points or max(gaps) <= self.accuracy or points >= _MOST_POINTS:
                break
            coarse, points = fine, 2 * points
        seconds = {"solve": perf_counter() - start, "total": perf_counter() - start}
        curves, error, harmonics = fine
        return [
            Homogenised(
                curve=curve,
                method=self.name,
                unknowns=int(harmonics[k]),
                seconds=seconds,
                error={"space": float(error[k]), "theta": gap},
                reason=f"{curve.theta.size} nodes in θ, {harmonics[k]} harmonics",
            )
            for k, (curve, gap) in enumerate(zip(curves, gaps, strict=True))
        ]

    def _curves(
        self, rule: ThetaRule, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> tuple[list[StressCurve], Array, Array]:
        """Curve, truncation error and harmonics of each inclusion."""
        cells = square_stiffness(radius_map(rule.nodes), matrix, inclusions, tolerance=self.accuracy)
        s11, s12 = STRAIN * cells.bulk, 2 * STRAIN * cells.shear  # eq. 15
        curves = [StressCurve(rule.nodes, rule.weights, s11[:, k], s12[:, k], stiffness=cells.matrix[:, k]) for k in range(len(inclusions))]
        return curves, rule.mean(cells.error), cells.harmonics.max(axis=0)


def _gap(coarse: StressCurve, fine: StressCurve) -> float:
    """Relative difference in E of eq. 16 between two rules."""
    a, b = (effective_modulus(*curve.mean)[0] for curve in (coarse, fine))
    return abs(a - b) / abs(b)
