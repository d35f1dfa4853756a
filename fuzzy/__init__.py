"""Fuzzy inputs through any model: α-cuts, plans of samples, fuzzy results."""

from alphacut.fuzzy.campaign.campaign import CampaignError
from alphacut.fuzzy.campaign.store import Store, StoreError
from alphacut.fuzzy.dry_run import Explanation, explain
from alphacut.fuzzy.knowledge.enclosure import gradient_range
from alphacut.fuzzy.knowledge.from_data import from_data
from alphacut.fuzzy.knowledge.joint import JointClaim, jointly
from alphacut.fuzzy.knowledge.known import Known
from alphacut.fuzzy.knowledge.order_statistics import least_alpha, values_needed
from alphacut.fuzzy.plans.alpha_cut_optimisation import Optimisation
from alphacut.fuzzy.plans.automatic import Automatic
from alphacut.fuzzy.plans.branch_and_bound import BranchAndBound
from alphacut.fuzzy.plans.interval_quasi_monte_carlo import (
    IntervalQuasiMonteCarlo,
    IntervalResponse,
    RandomInput,
)
from alphacut.fuzzy.plans.metamodel import Metamodel, TrainedBounds
from alphacut.fuzzy.plans.monotonicity import Verification
from alphacut.fuzzy.plans.monte_carlo import MonteCarlo, QuasiMonteCarlo
from alphacut.fuzzy.plans.plan import Plan
from alphacut.fuzzy.plans.signed import Signed
from alphacut.fuzzy.plans.sparse_chebyshev import Chebyshev
from alphacut.fuzzy.plans.transformation import Extended, General, Reduced, Vertex
from alphacut.fuzzy.propagation import propagate
from alphacut.fuzzy.random_response import RandomResponse
from alphacut.fuzzy.samples.nature import Nature
from alphacut.fuzzy.samples.result import FuzzyResult
from alphacut.fuzzy.sets.arithmetic import DependencyError, apply
from alphacut.fuzzy.sets.boxes import Domain, levels
from alphacut.fuzzy.sets.claimed import Claim, Claimed
from alphacut.fuzzy.sets.interaction import Ellipsoidal, Linear
from alphacut.fuzzy.sets.membership import FuzzySet
from alphacut.fuzzy.sets.numbers import (
    Crisp,
    Cut,
    FuzzyNumber,
    Interval,
    PiecewiseLinear,
    Trapezoidal,
    Triangular,
)
from alphacut.fuzzy.sets.stepwise import Stepwise
from alphacut.fuzzy.surrogates.response_surface import ResponseSurface
from alphacut.fuzzy.width_contributions import Shares, width_shares

__all__ = [
    "Automatic",
    "BranchAndBound",
    "CampaignError",
    "Chebyshev",
    "Claim",
    "Claimed",
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
    "JointClaim",
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
    "Stepwise",
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
    "jointly",
    "least_alpha",
    "levels",
    "propagate",
    "values_needed",
    "width_shares",
]
