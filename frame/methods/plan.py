"""Seconds that methods are expected to take, before any of them starts."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.box_quadratic import local_maximum
from alphacut.frame.calculus.low_discrepancy import chebyshev_points
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.modal.fitting import MANY, fit_modes
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.optima import Response
from alphacut.frame.modal.proportional_response import exact_response
from alphacut.frame.structures.modes import ModalError

PROBED = 800
"""Problems on which a step of Newton's method is timed."""
STEPS = 140
"""Steps a problem takes on polynomials among `NODES` in time; neighbours share what they find."""
NODES = 250
LIGHT = 290  # the same with the least effort
RISE = 3.0  # cost of the final polynomials beside those of degree 2, less 1 an input
GUIDING, POLISHING = 680, 100
"""The steps of more than six inputs: on polynomials that guide, with all that is not a step counted
as so many, and on exact trajectories."""
GRAPHS = 1500
"""Trajectories that the Graph Follower takes on all levels, where its budget does not end it."""


@dataclass(frozen=True, repr=False)
class Candidate:
    """A way to the envelope, and what it is expected to cost.

    Args:
        name: Of the method.
        seconds: Estimate, seldom wrong by a factor of four; infinite where it cannot be applied.
        words: What would be done, or why it cannot be.
    """

    name: str
    seconds: float
    words: str

    def __str__(self) -> str:
        """One line."""
        cost = (
            f"about {float(f'{self.seconds:.1g}'):g} s"
            if np.isfinite(self.seconds)
            else "not possible"
        )
        return f"{self.name}: {cost}; {self.words}"

    __repr__ = __str__


def candidates(flow: UnitFlow, budget: int) -> tuple[Candidate, ...]:
    """What auto may take in its order, given the most trajectories of the Graph Follower."""
    follower = _follower("improved-graph-follower", flow, budget)
    return (_modal(flow), follower) if isinstance(flow.flow, LinearFlow) else (follower,)


def planned(name: str, method: object, flow: UnitFlow) -> tuple[Candidate, ...]:
    """What a method would do; of auto each that it may take."""
    if hasattr(method, "plan"):
        found: tuple[Candidate, ...] = method.plan(flow)
        return found
    if name == "modal":
        return (_modal(flow, light=getattr(method, "passes", 0) == 1),)
    if name.endswith("graph-follower"):
        return (_follower(name, flow, getattr(method, "budget", None) or GRAPHS),)
    d, levels = len(flow.boxes.names), len(flow.boxes.alpha)
    runs = levels * int(getattr(method, "samples", 2**d))
    centre = np.zeros((1, d))
    flow.values(centre)
    each = _seconds(lambda: flow.values(centre))
    return (Candidate(name, runs * each, f"{runs} trajectories of {each:.1g} s each"),)


def _follower(name: str, flow: UnitFlow, budget: int) -> Candidate:
    centre = np.zeros((1, len(flow.boxes.names)))
    if not isinstance(flow.flow, LinearFlow):
        flow.taylor(centre)  # writes and compiles what is kept
    each, graphs = _seconds(lambda: flow.taylor(centre)), min(budget, GRAPHS)
    words = f"some {graphs} trajectories with derivatives of {each:.1g} s each"
    return Candidate(name, graphs * each, words)


def _modal(flow: UnitFlow, *, light: bool = False) -> Candidate:
    assert isinstance(flow.flow, LinearFlow)
    d, begun = len(flow.boxes.names), time.process_time()
    try:
        model = fit_modes(flow.flow, flow.boxes, tolerance=np.inf, budget=1000)
    except ModalError as error:
        return Candidate("modal", np.inf, str(error))
    fitting = time.process_time() - begun
    wide = sum(
        (np.diff(flow.boxes.unit(level), axis=0) > 0).any()
        for level in range(len(flow.boxes.alpha))
    )
    problems = 2 * len(flow.time) * len(flow.outputs) * wide
    among = (NODES / len(flow.time)) ** 0.5
    steps = LIGHT if light else GUIDING if d > MANY else STEPS * (RISE + d) * among
    seconds = fitting * (1 if d > MANY else 10) + problems * steps * _step(model, d)
    words = f"{problems} bounds by polynomials of the modes"
    if d > MANY and not light:
        seconds += problems * POLISHING * _step(exact_response(model, flow.scale), d)
        words += f", since {d} inputs are many polished on exact trajectories"
    return Candidate("modal", seconds, words)


def _step(model: ModalModel | Response, d: int) -> float:
    """Seconds of one step of Newton's method for one problem."""
    unit = chebyshev_points(d, PROBED)
    node = np.arange(PROBED) * (len(model.time) - 1) // PROBED
    output = np.arange(PROBED) % len(model.outputs)

    def step() -> None:
        _, g, H = model.at(unit, node, output)
        local_maximum(g, H, -1 - unit, 1 - unit, rounds=2)

    step()  # makes what is kept
    return _seconds(step) / PROBED


def _seconds(call: Callable[[], object]) -> float:
    begun = time.process_time()
    call()
    return max(time.process_time() - begun, 1e-6)
