"""Series model of the cell: exact for circles, and their fastest model.

It refuses, with the error it would have, where particles nearly touch (r > 0.9995 or so).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import ClassVar

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError
from alphacut.rve.cell.cell import Cell, Phase
from alphacut.rve.cell.settings import require_parts, require_points
from alphacut.rve.result.checks import with_checks
from alphacut.rve.result.result import HomogenisedStiffness, PhaseEnergies
from alphacut.rve.series.means import CellModuli, Mean, converged_means, mean_energies
from alphacut.rve.series.multipoles import TRUNCATION, material_moduli, square_stiffness
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

        def moduli(radii: Array) -> CellModuli:
            return self._moduli(radii, matrix, inclusions)

        means = converged_means(radius_map, moduli, points=self.points, accuracy=self.accuracy)
        seconds = perf_counter() - start
        results = []
        for mean, inclusion in zip(means, inclusions, strict=True):
            cell = Cell(matrix, inclusion, radius_map)
            result = self._result(mean, cell, seconds)
            if self.energies:
                result = replace(result, energies=self._energies(cell, mean))
            results.append(result)
        return results

    def _moduli(self, radii: Array, matrix: Phase, inclusions: Sequence[Phase]) -> CellModuli:
        return square_stiffness(radii, matrix, inclusions, tolerance=self.accuracy)

    def _energies(self, cell: Cell, mean: Mean) -> PhaseEnergies:
        return mean_energies(cell, mean, material_moduli, TRUNCATION)

    def _result(self, mean: Mean, cell: Cell, seconds: float) -> HomogenisedStiffness:
        """Result of one inclusion from its means over θ, with its checks."""
        return with_checks(
            HomogenisedStiffness(
                curve=mean.curve,
                method=self.name,
                unknowns=int(mean.terms.max()),
                seconds={"total": seconds},
                errors=mean.errors,
                cell=cell,
            )
        )
