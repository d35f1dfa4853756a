"""Fuzzy inputs through any model: α-cuts, plans of samples, fuzzy results."""

from fuzzy.campaign import CampaignError
from fuzzy.domain import Domain, levels
from fuzzy.known import Known
from fuzzy.monotone import Verification
from fuzzy.numbers import Crisp, Cut, FuzzyNumber, Interval, PiecewiseLinear, Trapezoidal, Triangular
from fuzzy.plan import Plan
from fuzzy.propagation import propagate
from fuzzy.response_surface import ResponseSurface
from fuzzy.result import FuzzyResult, Nature
from fuzzy.signed import Signed
from fuzzy.store import Store, StoreError
from fuzzy.transformation import Extended, General, Reduced

__all__ = [
    "CampaignError",
    "Crisp",
    "Cut",
    "Domain",
    "Extended",
    "FuzzyNumber",
    "FuzzyResult",
    "General",
    "Interval",
    "Known",
    "Nature",
    "PiecewiseLinear",
    "Plan",
    "Reduced",
    "ResponseSurface",
    "Signed",
    "Store",
    "StoreError",
    "Trapezoidal",
    "Triangular",
    "Verification",
    "levels",
    "propagate",
]
