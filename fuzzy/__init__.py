"""Fuzzy inputs through any model: α-cuts, methods of search, bounds."""

from typing import TYPE_CHECKING

from alphacut.base.errors import FailedError, RefusedError
from alphacut.base.first_use import at_first_use
from alphacut.fuzzy.sets.numbers import (
    Crisp,
    FuzzyNumber,
    Interval,
    PiecewiseLinear,
    Trapezoidal,
    Triangular,
)

if TYPE_CHECKING:
    from alphacut.fuzzy.campaign.store import Store
    from alphacut.fuzzy.knowledge.from_data import from_data
    from alphacut.fuzzy.knowledge.joint import jointly
    from alphacut.fuzzy.knowledge.known import Knowledge
    from alphacut.fuzzy.plans.automatic import Automatic
    from alphacut.fuzzy.plans.transformation import General, Reduced, Signed
    from alphacut.fuzzy.propagation import propagate, width_fractions
    from alphacut.fuzzy.result import Bounds, Nature
    from alphacut.fuzzy.sets.boxes import levels

__all__ = [
    "Automatic", "Bounds", "Crisp", "FailedError", "FuzzyNumber", "General", "Interval",
    "Knowledge", "Nature", "PiecewiseLinear", "Reduced", "RefusedError", "Signed",
    "Store", "Trapezoidal", "Triangular", "from_data", "jointly", "levels", "propagate",
    "width_fractions",
]  # fmt: skip
AT_FIRST_USE = {
    "Automatic": "plans.automatic",
    "Bounds": "result",
    "General": "plans.transformation",
    "Knowledge": "knowledge.known",
    "Nature": "result",
    "Reduced": "plans.transformation",
    "Signed": "plans.transformation",
    "Store": "campaign.store",
    "from_data": "knowledge.from_data",
    "jointly": "knowledge.joint",
    "levels": "sets.boxes",
    "propagate": "propagation",
    "width_fractions": "propagation",
}
"""Module of each exported name that is imported at its first use, since a case file needs fuzzy
numbers alone. Campaigns, with SQLite and processes, take .04 s of processor time."""

__getattr__, __dir__ = at_first_use(__name__, AT_FIRST_USE)
