"""Fuzzy inputs through any model: α-cuts, plans of samples, fuzzy results."""

from alphacut.fuzzy.campaign.campaign import CampaignError
from alphacut.fuzzy.campaign.store import Store
from alphacut.fuzzy.decisions.limits import decide, safe_scale
from alphacut.fuzzy.dry_run import explain
from alphacut.fuzzy.knowledge.from_data import from_data
from alphacut.fuzzy.knowledge.joint import jointly
from alphacut.fuzzy.knowledge.known import Known
from alphacut.fuzzy.plans.alpha_cut_optimisation import Optimisation
from alphacut.fuzzy.plans.automatic import Automatic
from alphacut.fuzzy.plans.branch_and_bound import BranchAndBound
from alphacut.fuzzy.plans.interval_quasi_monte_carlo import IntervalQuasiMonteCarlo, RandomInput
from alphacut.fuzzy.plans.metamodel import Metamodel
from alphacut.fuzzy.plans.monte_carlo import MonteCarlo, QuasiMonteCarlo
from alphacut.fuzzy.plans.sparse_chebyshev import Chebyshev
from alphacut.fuzzy.plans.transformation import Extended, General, Reduced, Signed
from alphacut.fuzzy.propagation import propagate
from alphacut.fuzzy.random_response import RandomResponse
from alphacut.fuzzy.sets.arithmetic import DependencyError, apply
from alphacut.fuzzy.sets.boxes import levels
from alphacut.fuzzy.sets.interaction import Ellipsoidal, Linear
from alphacut.fuzzy.sets.numbers import (
    Crisp,
    FuzzyNumber,
    Interval,
    PiecewiseLinear,
    Trapezoidal,
    Triangular,
)
from alphacut.fuzzy.width_contributions import width_shares

__all__ = [
    "Automatic", "BranchAndBound", "CampaignError", "Chebyshev", "Crisp", "DependencyError",
    "Ellipsoidal", "Extended", "FuzzyNumber", "General", "Interval", "IntervalQuasiMonteCarlo",
    "Known", "Linear", "Metamodel", "MonteCarlo", "Optimisation", "PiecewiseLinear",
    "QuasiMonteCarlo", "RandomInput", "RandomResponse", "Reduced", "Signed", "Store", "Trapezoidal",
    "Triangular", "apply", "decide", "explain", "from_data", "jointly", "levels", "propagate",
    "safe_scale", "width_shares",
]  # fmt: skip
