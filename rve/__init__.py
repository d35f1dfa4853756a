"""The periodic cell: its models of the homogenised stiffness behind one result type.

Each model is a frozen dataclass of its resolution with ``solve(radius_map, matrix, inclusions)``
or, on a mesh or level set of the user's own, ``solve(law, phases)``.

Example:
    >>> [load.tolist() for load in LOADS], STRAIN  # eq. 15, Voigt order (11, 22, 12 with 2 ε12)
    ([[0.01, 0.01, 0.0], [0.0, 0.0, 0.02]], 0.01)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from alphacut.rve.cell.cell import LOADS, STRAIN, Cell, Phase, VoigtPhase
from alphacut.rve.cell.outline import Ellipse
from alphacut.rve.result.result import HomogenisedStiffness, StressCurve, effective_modulus
from alphacut.rve.series.model import SeriesModel

if TYPE_CHECKING:
    from alphacut.rve.prism.fields import cell_fields
    from alphacut.rve.prism.model import PrismModel
    from alphacut.rve.prism.own_mesh import LevelSetModel, MeshModel
    from alphacut.rve.prism.product_space import ProductSpace
    from alphacut.rve.slices.model import SlicesModel

__all__ = [
    "LOADS", "STRAIN", "Cell", "Ellipse", "HomogenisedStiffness", "LevelSetModel",
    "MeshModel", "Phase", "PrismModel", "ProductSpace", "SeriesModel", "SlicesModel",
    "StressCurve", "VoigtPhase", "cell_fields", "effective_modulus",
]  # fmt: skip
WITH_DOLFINX = {
    "LevelSetModel": "prism.own_mesh",
    "MeshModel": "prism.own_mesh",
    "PrismModel": "prism.model",
    "ProductSpace": "prism.product_space",
    "SlicesModel": "slices.model",
    "cell_fields": "prism.fields",
}
"""Module of each exported name whose import needs DOLFINx."""


def __getattr__(name: str) -> Any:
    """Return an exported name that needs DOLFINx, imported at its first use (PEP 562)."""
    if name in WITH_DOLFINX:
        return getattr(import_module(f"alphacut.rve.{WITH_DOLFINX[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
