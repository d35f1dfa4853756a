"""The periodic cell: its models of the homogenised stiffness behind one result type."""

from alphacut.rve.cell import LOADS, STRAIN, Cell, Phase
from alphacut.rve.model import Model, cross_check, named
from alphacut.rve.result import Homogenised, StressCurve, effective_modulus

__all__ = [
    "LOADS", "STRAIN", "Cell", "Homogenised", "Model", "Phase", "StressCurve", "cross_check",
    "effective_modulus", "named",
]  # fmt: skip
