"""Fuzzy inputs through any model: α-cuts, methods of search, bounds."""

from alphacut.base.errors import FailedError, RefusedError
from alphacut.fuzzy.campaign.store import Store
from alphacut.fuzzy.knowledge.from_data import from_data
from alphacut.fuzzy.knowledge.joint import jointly
from alphacut.fuzzy.knowledge.known import Knowledge
from alphacut.fuzzy.plans.automatic import Automatic
from alphacut.fuzzy.plans.transformation import General, Reduced, Signed
from alphacut.fuzzy.propagation import propagate, width_shares
from alphacut.fuzzy.result import Bounds, Nature
from alphacut.fuzzy.sets.boxes import levels
from alphacut.fuzzy.sets.numbers import (
    Crisp,
    FuzzyNumber,
    Interval,
    PiecewiseLinear,
    Trapezoidal,
    Triangular,
)

__all__ = [
    "Automatic", "Bounds", "Crisp", "FailedError", "FuzzyNumber", "General", "Interval",
    "Knowledge", "Nature", "PiecewiseLinear", "Reduced", "RefusedError", "Signed",
    "Store", "Trapezoidal", "Triangular", "from_data", "jointly", "levels", "propagate",
    "width_shares",
]  # fmt: skip
