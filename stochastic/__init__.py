"""From particles to the random radius of the cell: law of θ, radius map, quadrature in θ."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from alphacut.stochastic.radius_map import HermiteMap, RadiusMap, require_map
from alphacut.stochastic.theta.law import ThetaLaw, TruncatedNormal
from alphacut.stochastic.theta.quadrature import ThetaRule, gauss_rule

if TYPE_CHECKING:
    from alphacut.stochastic.fraction_map import FractionMap

__all__ = [
    "FractionMap",
    "HermiteMap",
    "RadiusMap",
    "ThetaLaw",
    "ThetaRule",
    "TruncatedNormal",
    "gauss_rule",
    "require_map",
]
AT_FIRST_USE = {"FractionMap": "fraction_map"}
"""Module of each exported name that is imported at its first use."""


def __getattr__(name: str) -> Any:
    """Return an exported name of `AT_FIRST_USE` (PEP 562)."""
    if name in AT_FIRST_USE:
        return getattr(import_module(f"alphacut.stochastic.{AT_FIRST_USE[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
