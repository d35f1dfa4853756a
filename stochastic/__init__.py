"""From particles to the random radius of the cell: law of θ, radius map, quadrature in θ."""

from stochastic.quadrature import ThetaRule, gauss_rule, layered_rule
from stochastic.radius_map import HermiteMap, RadiusMap
from stochastic.truncated_normal import TruncatedNormal

__all__ = ["HermiteMap", "RadiusMap", "ThetaRule", "TruncatedNormal", "gauss_rule", "layered_rule"]
