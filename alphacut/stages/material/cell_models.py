"""From the name of a cell model to the model; may import DOLFINx."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path

from alphacut.io.problem import BadInput, Problem, missing
from alphacut.rve.anisotropy import AveragedPlane, averaged
from alphacut.rve.auto.model import TABLED, AutoModel, RefinedModel
from alphacut.rve.cell import Phase
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.spheres.series.model import SphereSeriesModel
from alphacut.rve.spheres.table.model import LEAST_ACCURACY, SphereTableModel
from alphacut.rve.table.model import TableModel
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
    ) -> list[AveragedPlane]:
        """One result for each inclusion material.

        Raises:
            ValueError: The model makes no whole plane stiffness.
        """
        return [averaged(one) for one in self.model.solve(radius_map, matrix, inclusions)]


def table_folder() -> Path | None:
    """Cache folder of the cell's tables; None if it cannot be made."""
    base = (
        os.environ.get("ALPHACUT_CACHE")
        or Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "alphacut"
    )
    folder = Path(base) / "tables"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder


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
        meshed = choice.method == "auto" and "series" in choice.exclude
        if choice.method in ("slices", "prism") or (meshed and choice.particles == "cylinders"):
            # libraries are loaded before the clock starts: times are those of computing
            room = "prism.model" if choice.method == "prism" else "planar.problem"
            import_module(f"alphacut.rve.{room}")
        if choice.particles == "spheres" and (meshed or choice.method == "table"):
            import_module("alphacut.rve.spheres.fem.stiffness")
        return made(choice)
    except ImportError as error:
        raise BadInput.of(
            "modulus.method", missing(error), choice.method, "series, which needs none of it"
        ) from None
    except ValueError as error:
        keys = {"exclude": "--exclude", "accuracy": "modulus.tolerance"}
        key = next((key for word, key in keys.items() if word in str(error)), "mesh")
        raise BadInput.of(key, str(error)) from None


def made(choice: CellChoice) -> CellModel:
    """The model itself.

    Raises:
        ValueError: An option of it is out of range.
        ImportError: It needs what is not installed.
    """
    tolerance = choice.tolerance
    if choice.particles == "spheres" and choice.method != "auto":
        if choice.method == "table":
            accuracy = SphereTableModel.accuracy if tolerance is None else TABLED * tolerance
            if accuracy < LEAST_ACCURACY:
                what = f"the accuracy of the table of spheres cannot keep {tolerance:g}"
                raise ValueError(f"{what}; take 1.2e-05 or more, or method series")
            return SphereTableModel(accuracy, table_folder(), choice.moduli, choice.parallel)
        own = SphereSeriesModel.accuracy if tolerance is None else max(SHARE * tolerance, 1e-11)
        return SphereSeriesModel(accuracy=own)
    if choice.method == "auto":
        return AutoModel(
            AutoModel.tolerance if tolerance is None else tolerance,
            choice.exclude,
            table_folder(),
            choice.moduli,
            particles=choice.particles,
        )
    if choice.method == "series":
        own = SeriesModel.accuracy if tolerance is None else max(SHARE * tolerance, 1e-12)
        return SeriesModel(accuracy=own)
    if choice.method == "table":
        accuracy = TableModel.accuracy if tolerance is None else tolerance
        return TableModel(accuracy, table_folder(), moduli=choice.moduli)
    if choice.method == "image":
        from alphacut.rve.image.round_particle import RasterModel

        return RasterModel()
    if tolerance is not None and not choice.named:
        return RefinedModel(choice.method, tolerance, choice.stiffness)
    return meshed(choice)


def meshed(choice: CellChoice) -> CellModel:
    """Finite elements of the resolution that is named."""
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
        cache=table_folder(),
    )
