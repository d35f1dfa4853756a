"""Series model of the cell with a sphere: exact for the simple cubic array, at nodes of θ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Cell, Phase
from alphacut.rve.series.means import Mean
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.series.truncation import CellModuli
from alphacut.rve.spheres.result import HomogenisedSpheres, spheres_with_checks
from alphacut.rve.spheres.series.energies import mean_energies
from alphacut.rve.spheres.series.stiffness import cubic_stiffness, unknowns


@dataclass(frozen=True)
class SphereSeriesModel(SeriesModel):
    """As `SeriesModel`, for spheres; `accuracy` is that of the mean moduli."""

    accuracy: float = 1e-9
    LEAST: ClassVar[float] = 1e-11
    _energies = staticmethod(mean_energies)

    def _moduli(self, radii: Array, matrix: Phase, inclusions: Sequence[Phase]) -> CellModuli:
        return cubic_stiffness(radii, matrix, inclusions, tolerance=self.accuracy)

    def _result(self, mean: Mean, cell: Cell, seconds: float) -> HomogenisedSpheres:
        """Result of one inclusion from its means over θ, with its checks."""
        return spheres_with_checks(
            HomogenisedSpheres(
                curve=mean.curve,
                method=self.name,
                unknowns=unknowns(mean.terms),
                seconds={"total": seconds},
                errors=mean.errors,
                cell=cell,
            )
        )
