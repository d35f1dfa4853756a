"""From particles to the random radius of the cell: law of θ, radius map, quadrature in θ."""

from alphacut.stochastic.radius_map import HermiteMap, RadiusMap, require_map
from alphacut.stochastic.theta.law import ThetaLaw, TruncatedNormal
from alphacut.stochastic.theta.quadrature import ThetaRule, gauss_rule

__all__ = [
    "HermiteMap",
    "RadiusMap",
    "ThetaLaw",
    "ThetaRule",
    "TruncatedNormal",
    "gauss_rule",
    "require_map",
]
