"""Vibration of structures with fuzzy parameters.

Example:
    >>> sorted(INTEGRATORS), len(METHODS)  # by the words of a case file
    (['exact', 'midpoint'], 6)
"""

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
    "INTEGRATORS", "METHODS", "Accelerogram", "Auto", "DualProof", "Envelope", "Exact", "Force",
    "GraphFollower", "History", "Identified", "ImprovedFollower", "LagrangianFlow",
    "LagrangianSystem", "LearnedInputs", "LinearFlow", "MatrixStructure", "MeasuredMode",
    "Midpoint", "Output", "Parameter", "Prediction", "Predictions", "Proof", "RefutedError",
    "Sampled", "StoreyFrame", "damping_from_loss", "envelope", "identify", "measured_mode",
    "pendulum", "read_matrix", "read_modes", "read_record", "read_suite", "require_envelope",
]  # fmt: skip
