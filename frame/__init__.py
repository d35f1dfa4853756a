"""Vibration of structures with fuzzy parameters."""

from frame.envelope import Envelope
from frame.flow import LinearFlow
from frame.graph_follower import GraphFollower
from frame.integrators import INTEGRATORS, Exact, Gauss4, Midpoint, Newmark, RungeKutta4
from frame.lagrangian import LagrangianSystem, pendulum
from frame.linear import Accelerogram
from frame.matrix_structure import MatrixStructure
from frame.nonlinear_flow import LagrangianFlow
from frame.propagation import METHODS, envelope
from frame.record import FollowerRecord, record
from frame.step_guard import StepGuard, guard
from frame.storey import StoreyFrame

__all__ = [
    "INTEGRATORS",
    "METHODS",
    "Accelerogram",
    "Envelope",
    "Exact",
    "FollowerRecord",
    "Gauss4",
    "GraphFollower",
    "LagrangianFlow",
    "LagrangianSystem",
    "LinearFlow",
    "MatrixStructure",
    "Midpoint",
    "Newmark",
    "RungeKutta4",
    "StepGuard",
    "StoreyFrame",
    "envelope",
    "guard",
    "pendulum",
    "record",
]
