"""From particles to the random radius of the cell: law of θ, radius map, quadrature in θ."""

from typing import TYPE_CHECKING

from alphacut.base.first_use import at_first_use
from alphacut.stochastic.radius_map import HermiteMap, RadiusMap, require_map
from alphacut.stochastic.theta.distribution import ThetaDistribution, TruncatedNormal
from alphacut.stochastic.theta.quadrature import ThetaRule, gauss_rule

if TYPE_CHECKING:
    from alphacut.stochastic.fraction_map import FractionMap
    from alphacut.stochastic.microstructure import FittedRadiusMap, fit_radius_map
    from alphacut.stochastic.particles.measured import read_particles
    from alphacut.stochastic.particles.packings import Packings, pack
    from alphacut.stochastic.particles.particles import Particles
    from alphacut.stochastic.particles.radius_distributions import LogNormalRadii, MeasuredRadii
    from alphacut.stochastic.particles.shapes import DISCS, SPHERES

__all__ = [
    "DISCS",
    "SPHERES",
    "FittedRadiusMap",
    "FractionMap",
    "HermiteMap",
    "LogNormalRadii",
    "MeasuredRadii",
    "Packings",
    "Particles",
    "RadiusMap",
    "ThetaDistribution",
    "ThetaRule",
    "TruncatedNormal",
    "fit_radius_map",
    "gauss_rule",
    "pack",
    "read_particles",
    "require_map",
]
AT_FIRST_USE = {
    "DISCS": "particles.shapes",
    "FittedRadiusMap": "microstructure",
    "FractionMap": "fraction_map",
    "LogNormalRadii": "particles.radius_distributions",
    "MeasuredRadii": "particles.radius_distributions",
    "Packings": "particles.packings",
    "Particles": "particles.particles",
    "SPHERES": "particles.shapes",
    "fit_radius_map": "microstructure",
    "pack": "particles.packings",
    "read_particles": "particles.measured",
}
"""Module of each exported name that is imported at its first use."""

__getattr__, __dir__ = at_first_use(__name__, AT_FIRST_USE)
