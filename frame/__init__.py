"""Vibration of structures with fuzzy parameters."""

from alphacut.frame.checks.step_resolution import StepGuard, guard
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import INTEGRATORS, Exact, Midpoint, RungeKutta4
from alphacut.frame.dynamics.nonlinear import LagrangianFlow
from alphacut.frame.envelope import Envelope
from alphacut.frame.methods.follower_record import FollowerRecord, record
from alphacut.frame.methods.graph_follower import GraphFollower
from alphacut.frame.methods.named import METHODS
from alphacut.frame.propagation import envelope, plan
from alphacut.frame.structures.lagrangian import LagrangianSystem, pendulum
from alphacut.frame.structures.linear import Accelerogram
from alphacut.frame.structures.matrix import MatrixStructure
from alphacut.frame.structures.quantities import Output
from alphacut.frame.structures.storey import StoreyFrame

__all__ = [
    "INTEGRATORS", "METHODS", "Accelerogram", "Envelope", "Exact", "FollowerRecord",
    "GraphFollower", "LagrangianFlow", "LagrangianSystem", "LinearFlow", "MatrixStructure",
    "Midpoint", "Output", "RungeKutta4", "StepGuard", "StoreyFrame", "envelope", "guard",
    "pendulum", "plan", "record",
]  # fmt: skip
