"""The periodic cell: four models of its homogenised stiffness behind one result type."""

from rve.cell import LOADS, STRAIN, Cell, Phase
from rve.result import Homogenised, StressCurve, effective_modulus

__all__ = ["LOADS", "STRAIN", "Cell", "Homogenised", "Phase", "StressCurve", "effective_modulus"]
