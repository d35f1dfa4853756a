"""Vibration of structures with fuzzy parameters.

Example:
    >>> sorted(INTEGRATORS), len(METHODS)  # by the words of a case file
    (['exact', 'midpoint'], 6)
"""

from alphacut.frame.analyses.decision import Decision, decide
from alphacut.frame.analyses.fragility import Fragility, fragility
from alphacut.frame.analyses.incremental import ScaledPeaks, incremental
from alphacut.frame.analyses.limits import Limit
from alphacut.frame.analyses.peaks import Peak, peaks
from alphacut.frame.analyses.probability import Probability, probability
from alphacut.frame.analyses.sensitivity import Sensitivity, sensitivity
from alphacut.frame.analyses.spectral import spectral_acceleration
from alphacut.frame.analyses.suites import SuitePeaks, over_records
from alphacut.frame.analyses.tolerances import Tolerances, tolerances
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import INTEGRATORS, Exact, Midpoint
from alphacut.frame.dynamics.nonlinear import LagrangianFlow
from alphacut.frame.envelope import Envelope
from alphacut.frame.identify import (
    Identified,
    LearnedInputs,
    MeasuredMode,
    Prediction,
    Predictions,
    RefutedError,
    identify,
    measured_mode,
    read_modes,
)
from alphacut.frame.methods.auto import Auto
from alphacut.frame.methods.dual import DualProof
from alphacut.frame.methods.graph_follower import GraphFollower
from alphacut.frame.methods.improved_follower import ImprovedFollower
from alphacut.frame.methods.proof import Proof
from alphacut.frame.methods.sampled import Sampled
from alphacut.frame.propagation import METHODS, envelope, require_envelope
from alphacut.frame.records.history import Accelerogram, History
from alphacut.frame.records.suite import read_record, read_suite
from alphacut.frame.structures.lagrangian import LagrangianSystem, pendulum
from alphacut.frame.structures.loads import Force
from alphacut.frame.structures.material_damping import damping_from_loss
from alphacut.frame.structures.matrix import MatrixStructure
from alphacut.frame.structures.quantities import Output, Parameter
from alphacut.frame.structures.read_matrix import read_matrix
from alphacut.frame.structures.storey import StoreyFrame

__all__ = [
    "INTEGRATORS", "METHODS", "Accelerogram", "Auto", "Decision", "DualProof", "Envelope",
    "Exact", "Force", "Fragility", "GraphFollower", "History", "Identified", "ImprovedFollower",
    "LagrangianFlow", "LagrangianSystem", "LearnedInputs", "Limit", "LinearFlow",
    "MatrixStructure", "MeasuredMode", "Midpoint", "Output", "Parameter", "Peak", "Prediction",
    "Predictions", "Probability", "Proof", "RefutedError", "Sampled", "ScaledPeaks",
    "Sensitivity", "StoreyFrame", "SuitePeaks", "Tolerances", "UnprovedError",
    "damping_from_loss", "decide", "envelope", "fragility", "identify", "incremental",
    "measured_mode", "over_records", "peaks", "pendulum", "probability", "read_matrix",
    "read_modes", "read_record", "read_suite", "require_envelope", "sensitivity",
    "spectral_acceleration", "tolerances",
]  # fmt: skip
