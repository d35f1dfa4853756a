"""From the name of a cell model to the model; may import DOLFINx."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from alphacut.io.problem import BadInput, Problem, missing
from alphacut.rve.cell import Phase
from alphacut.rve.result import Homogenised
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.spheres.series.model import SphereSeriesModel
from alphacut.stages.material.cell import CellChoice, CellModel
from alphacut.stochastic import RadiusMap

SHARE = 0.4
"""Of the tolerance, for the series at each θ and again for its rule in θ."""


@dataclass(frozen=True)
class AveragedModel:
    """A model whose results have E and ν of the isotropic average of the plane stiffness.

    Args:
        model: Makes the whole plane stiffness.
    """

    model: CellModel

    def solve(
        self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> list[Homogenised]:
        """One result for each inclusion material.

        Raises:
            ValueError: The model makes no whole plane stiffness.
        """
        return [
            one.averaged("isotropic") for one in self.model.solve(radius_map, matrix, inclusions)
        ]


def cell_model(choice: CellChoice) -> CellModel:
    """The model that `choice` names, with those of its options that the model has.

    Raises:
        BadInput: The model needs what is not installed, or refuses an option.
    """
    if choice.petsc and choice.method != "prism":
        what = f"method {choice.method} does not use PETSc"
        raise BadInput(
            [Problem(f"-rve_{name}", what, allowed="--method prism") for name in choice.petsc]
        )
    try:
        if choice.averages:
            return AveragedModel(cell_model(replace(choice, average="axes")))
        return made(choice)
    except ImportError as error:
        raise BadInput.of(
            "modulus.method", missing(error), choice.method, "series, which needs none of it"
        ) from None
    except ValueError as error:
        raise BadInput.of("mesh", str(error)) from None


def made(choice: CellChoice) -> CellModel:
    """The model itself; auto is the series, exact for round particles.

    Raises:
        ValueError: An option of it is out of range.
        ImportError: It needs what is not installed.
    """
    tolerance = choice.tolerance
    if choice.particles == "spheres":
        own = SphereSeriesModel.accuracy if tolerance is None else max(SHARE * tolerance, 1e-11)
        return SphereSeriesModel(accuracy=own)
    if choice.method in ("auto", "series"):
        own = SeriesModel.accuracy if tolerance is None else max(SHARE * tolerance, 1e-12)
        return SeriesModel(accuracy=own)
    if choice.method == "slices":
        from alphacut.rve.slices.model import SlicesModel

        return SlicesModel(mesh_size=choice.size)
    from alphacut.rve.prism.model import PrismModel

    return PrismModel(
        choice.size,
        choice.layers,
        choice.interface,
        petsc=dict(choice.petsc),
        parallel=choice.parallel,
        stiffness=choice.stiffness,
        estimate=choice.estimate,
        moduli=choice.moduli,
    )
