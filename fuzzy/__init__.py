"""Fuzzy inputs through any model: α-cuts, plans of samples, fuzzy results."""

from fuzzy.arithmetic import DependencyError, apply
from fuzzy.branch_and_bound import BranchAndBound
from fuzzy.campaign import CampaignError
from fuzzy.chebyshev import Chebyshev
from fuzzy.domain import Domain, levels
from fuzzy.enclosure import gradient_range
from fuzzy.explain import Explanation, explain
from fuzzy.interaction import Ellipsoidal, Linear
from fuzzy.interval_sampling import IntervalQuasiMonteCarlo, IntervalResponse, RandomInput
from fuzzy.known import Known
from fuzzy.metamodel import Metamodel, TrainedBounds
from fuzzy.monotone import Verification
from fuzzy.numbers import Crisp, Cut, FuzzyNumber, Interval, PiecewiseLinear, Trapezoidal, Triangular
from fuzzy.optimisation import Optimisation
from fuzzy.plan import Plan
from fuzzy.polymorphic import RandomResponse
from fuzzy.propagation import propagate
from fuzzy.response_surface import ResponseSurface
from fuzzy.result import FuzzyResult, Nature
from fuzzy.sampling import MonteCarlo, QuasiMonteCarlo
from fuzzy.sets import FuzzySet, from_data
from fuzzy.shares import Shares, width_shares
from fuzzy.signed import Signed
from fuzzy.store import Store, StoreError
from fuzzy.transformation import Extended, General, Reduced, Vertex

__all__ = [
    "BranchAndBound",
    "CampaignError",
    "Chebyshev",
    "Crisp",
    "Cut",
    "DependencyError",
    "Domain",
    "Ellipsoidal",
    "Explanation",
    "Extended",
    "FuzzyNumber",
    "FuzzyResult",
    "FuzzySet",
    "General",
    "Interval",
    "IntervalQuasiMonteCarlo",
    "IntervalResponse",
    "Known",
    "Linear",
    "Metamodel",
    "MonteCarlo",
    "Nature",
    "Optimisation",
    "PiecewiseLinear",
    "Plan",
    "QuasiMonteCarlo",
    "RandomInput",
    "RandomResponse",
    "Reduced",
    "ResponseSurface",
    "Shares",
    "Signed",
    "Store",
    "StoreError",
    "TrainedBounds",
    "Trapezoidal",
    "Triangular",
    "Verification",
    "Vertex",
    "apply",
    "explain",
    "from_data",
    "gradient_range",
    "levels",
    "propagate",
    "width_shares",
]
