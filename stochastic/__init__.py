"""From particles to the random radius of the cell: law of θ, radius map, quadrature in θ."""

from alphacut.stochastic.radius_map import HermiteMap, RadiusMap
from alphacut.stochastic.theta.quadrature import ThetaRule, gauss_rule, layered_rule
from alphacut.stochastic.theta.truncated_normal import TruncatedNormal

__all__ = ["HermiteMap", "RadiusMap", "ThetaRule", "TruncatedNormal", "gauss_rule", "layered_rule"]
