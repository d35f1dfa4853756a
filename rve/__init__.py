"""The periodic cell: its models of the homogenised stiffness behind one result type.

Each model is a frozen dataclass of its resolution with ``solve(radius_map, matrix, inclusions)``.

Example:
    >>> [load.tolist() for load in LOADS], STRAIN  # eq. 15, Voigt order (11, 22, 12 with 2 ε12)
    ([[0.01, 0.01, 0.0], [0.0, 0.0, 0.02]], 0.01)
"""

from typing import TYPE_CHECKING, Any

from alphacut.rve.cell.cell import LOADS, STRAIN, Cell, Interphase, Phase, VoigtPhase
from alphacut.rve.cell.outline import Ellipse
from alphacut.rve.result.result import HomogenisedStiffness, StressCurve, effective_modulus
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.slices.model import SlicesModel

if TYPE_CHECKING:
    from alphacut.rve.prism.fields import cell_fields
    from alphacut.rve.prism.model import PrismModel
    from alphacut.rve.prism.product_space import ProductSpace

__all__ = [
    "LOADS",
    "STRAIN",
    "Cell",
    "Ellipse",
    "HomogenisedStiffness",
    "Interphase",
    "Phase",
    "PrismModel",
    "ProductSpace",
    "SeriesModel",
    "SlicesModel",
    "StressCurve",
    "VoigtPhase",
    "cell_fields",
    "effective_modulus",
]


def __getattr__(name: str) -> Any:
    """Return an exported name whose import needs DOLFINx, imported at its first use (PEP 562)."""
    if name == "PrismModel":
        from alphacut.rve.prism.model import PrismModel

        return PrismModel
    if name == "ProductSpace":
        from alphacut.rve.prism.product_space import ProductSpace

        return ProductSpace
    if name == "cell_fields":
        from alphacut.rve.prism.fields import cell_fields

        return cell_fields
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
