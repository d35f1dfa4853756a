"""The periodic cell: its models of the homogenised stiffness behind one result type.

Each model is a frozen dataclass of its resolution with ``solve(radius_map, matrix, inclusions)``
or, on a mesh or level set of the user's own, ``solve(law, phases)``.

Example:
    >>> from alphacut.rve import LOADS, STRAIN
    >>> [load.tolist() for load in LOADS], STRAIN  # eq. 15, Voigt order (11, 22, 12 with 2 ε12)
    ([[0.01, 0.01, 0.0], [0.0, 0.0, 0.02]], 0.01)
"""

from typing import TYPE_CHECKING

from alphacut.base.first_use import at_first_use

if TYPE_CHECKING:
    from alphacut.rve.cell.cell import LOADS, STRAIN, Cell, Phase, VoigtPhase
    from alphacut.rve.cell.outline import Ellipse
    from alphacut.rve.engineering import constants
    from alphacut.rve.fuzzy_cell import FuzzyStiffness, fuzzy_stiffness
    from alphacut.rve.image.conductivity import FuzzyImageConductivity, fuzzy_image_conductivity
    from alphacut.rve.image.model import solve_conduction, solve_image
    from alphacut.rve.image.study import (
        FuzzyImageStiffness,
        GreyImage,
        fuzzy_image_stiffness,
        read_image,
    )
    from alphacut.rve.image.thermal_expansion import (
        ThermalBounds,
        declared_bounds,
        fuzzy_thermal_bounds,
        thermal_bounds,
    )
    from alphacut.rve.image.vti import ImageFields, image_fields
    from alphacut.rve.prism.cell_fields import CellFields
    from alphacut.rve.prism.model import PrismModel
    from alphacut.rve.prism.own_mesh import LevelSetModel, MeshModel
    from alphacut.rve.prism.product_space import ProductSpace
    from alphacut.rve.result.loss_factors import loss_factors
    from alphacut.rve.result.reference_bounds import ReferenceBounds, reference_bounds
    from alphacut.rve.result.result import HomogenisedStiffness, StressCurve, effective_modulus
    from alphacut.rve.series.fibre_constants import fibre_conductivity
    from alphacut.rve.series.model import SeriesModel
    from alphacut.rve.slices.model import SlicesModel
    from alphacut.rve.spheres.conduction import sphere_conductivity
    from alphacut.rve.spheres.model import SpheresModel

__all__ = [
    "LOADS", "STRAIN", "Cell", "CellFields", "Ellipse", "FuzzyImageConductivity",
    "FuzzyImageStiffness", "FuzzyStiffness", "GreyImage", "HomogenisedStiffness", "ImageFields",
    "LevelSetModel", "MeshModel", "Phase", "PrismModel", "ProductSpace", "ReferenceBounds",
    "SeriesModel", "SlicesModel", "SpheresModel", "StressCurve", "ThermalBounds", "VoigtPhase",
    "constants", "declared_bounds", "effective_modulus", "fibre_conductivity",
    "fuzzy_image_conductivity", "fuzzy_image_stiffness", "fuzzy_stiffness", "fuzzy_thermal_bounds",
    "image_fields", "loss_factors", "read_image", "reference_bounds", "solve_conduction",
    "solve_image", "sphere_conductivity", "thermal_bounds",
]  # fmt: skip
AT_FIRST_USE = {
    "LOADS": "cell.cell",
    "STRAIN": "cell.cell",
    "Cell": "cell.cell",
    "CellFields": "prism.cell_fields",
    "Ellipse": "cell.outline",
    "FuzzyImageConductivity": "image.conductivity",
    "FuzzyImageStiffness": "image.study",
    "FuzzyStiffness": "fuzzy_cell",
    "GreyImage": "image.study",
    "HomogenisedStiffness": "result.result",
    "ImageFields": "image.vti",
    "LevelSetModel": "prism.own_mesh",
    "MeshModel": "prism.own_mesh",
    "Phase": "cell.cell",
    "PrismModel": "prism.model",
    "ProductSpace": "prism.product_space",
    "ReferenceBounds": "result.reference_bounds",
    "SeriesModel": "series.model",
    "SlicesModel": "slices.model",
    "SpheresModel": "spheres.model",
    "StressCurve": "result.result",
    "ThermalBounds": "image.thermal_expansion",
    "VoigtPhase": "cell.cell",
    "constants": "engineering",
    "declared_bounds": "image.thermal_expansion",
    "effective_modulus": "result.result",
    "fibre_conductivity": "series.fibre_constants",
    "fuzzy_image_conductivity": "image.conductivity",
    "fuzzy_image_stiffness": "image.study",
    "fuzzy_stiffness": "fuzzy_cell",
    "fuzzy_thermal_bounds": "image.thermal_expansion",
    "image_fields": "image.vti",
    "loss_factors": "result.loss_factors",
    "read_image": "image.study",
    "reference_bounds": "result.reference_bounds",
    "solve_conduction": "image.model",
    "solve_image": "image.model",
    "sphere_conductivity": "spheres.conduction",
    "thermal_bounds": "image.thermal_expansion",
}
"""Module of each exported name that is imported at its first use: some need DOLFINx."""

__getattr__, __dir__ = at_first_use(__name__, AT_FIRST_USE)
