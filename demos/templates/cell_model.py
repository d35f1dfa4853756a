"""A model of a cell to copy: the series at a fixed accuracy, `modulus.method = "rough"` of a case.

Register its `ENTRY` in `MODELS` of `rve/models.py`, or as an entry point ``rough = "MODULE:ENTRY"``
of your own distribution in the group "alphacut.cells". `alphacut.rve.result.check` has the check
that it must pass.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

from alphacut.rve.models import ModelEntry
from alphacut.rve.result.cell_model import Resolution
from alphacut.rve.series.model import SeriesModel


@dataclass(frozen=True)
class RoughModel(SeriesModel):
    """The series to six digits, whatever the tolerance.

    A model that is no series inherits from `CellModel` of `alphacut.rve.result.cell_model`, and has
    a `solve` of its own, which returns a `HomogenisedStiffness` for each inclusion.
    """

    name: ClassVar[str] = "rough"

    @classmethod
    def with_resolution(cls, resolution: Resolution) -> Self:
        """Return the model that a resolution asks for; it takes what concerns it."""
        return cls(accuracy=1e-6, energies=resolution.energies, lattice=resolution.lattice)


ENTRY = ModelEntry("rough", f"{__name__}:RoughModel", frozenset({"cylinders"}), True)
