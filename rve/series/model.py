"""Series model of the cell: exact for circles, and their fastest model.

It refuses, with the error it would have, where particles nearly touch (r > 0.9995 or so).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter
from typing import Any, ClassVar

from alphacut.fuzzy.refused import RefusedError
from alphacut.rve.cell.cell import Cell, Phase
from alphacut.rve.cell.settings import require_parts, require_points
from alphacut.rve.result.checks import with_checks
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.rve.series.means import Series, converged_means, mean_energies
from alphacut.rve.series.multipoles import CIRCLES
from alphacut.stochastic import RadiusMap


@dataclass(frozen=True)
class SeriesModel:
    """Multipole series at the nodes of a Gauss rule in θ.

    Args:
        points: Nodes of the rule, or None: as many as bring two successive rules within `accuracy`
            of one another.
        accuracy: Relative error allowed, of the series at each θ and, without `points`, of E by the
            rule in θ; from `LEAST` to 0.1.
        energies: Whether to compute the energies of the phases, for loss factors.

    Example:
        >>> from alphacut.rve import Phase
        >>> from alphacut.stochastic import HermiteMap
        >>> model = SeriesModel(points=8)
        >>> [result] = model.solve(HermiteMap(0.2, 0.1, 0.6, 0.1), Phase(20e9), [Phase(80e9)])
        >>> f"{result.modulus / 1e9:.3f} GPa"
        '22.773 GPa'
    """

    points: int | None = None
    accuracy: float = 1e-11
    energies: bool = False
    name: ClassVar[str] = "series"
    LEAST: ClassVar[float] = 1e-12
    series: ClassVar[Series] = CIRCLES

    def __post_init__(self) -> None:
        require_points(self.points)
        if not self.LEAST <= self.accuracy <= 0.1:
            allowed = f"values in [{self.LEAST:g}, 0.1]"
            raise RefusedError("the accuracy of the series", f"{self.accuracy:g}", allowed)

    def solve(
        self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> list[HomogenisedStiffness]:
        """Homogenised stiffness for each of `inclusions`, in their order.

        Raises:
            SeriesError: Particles nearly touch.
            RuleError: No rule in θ converges (a map that is not smooth).
        """
        require_parts(radius_map, matrix, inclusions)
        start = perf_counter()

        moduli = partial(
            self.series.converged_moduli,
            matrix=matrix,
            inclusions=inclusions,
            tolerance=self.accuracy,
        )
        means = converged_means(radius_map, moduli, points=self.points, accuracy=self.accuracy)
        seconds = perf_counter() - start
        results = []
        for mean, inclusion in zip(means, inclusions, strict=True):
            cell = Cell(matrix, inclusion, radius_map)
            result = self._checked_result(
                curve=mean.curve,
                method=self.name,
                unknowns=self.series.unknowns(int(mean.terms.max())),
                seconds={"total": seconds},
                errors=mean.errors,
                cell=cell,
            )
            if self.energies:
                result = replace(result, energies=mean_energies(self.series, cell, mean))
            results.append(result)
        return results

    def _checked_result(self, **parts: Any) -> HomogenisedStiffness:
        return with_checks(HomogenisedStiffness(**parts))
