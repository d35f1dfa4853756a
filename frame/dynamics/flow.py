"""Discrete deterministic mapping f_d(t_j; p) of eq. 19 for many parameter sets."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.integrators import Exact, Integrator, Midpoint
from alphacut.frame.dynamics.record_load import linear_load
from alphacut.frame.dynamics.transfer_powers import exact_response, trajectory
from alphacut.frame.structures.lagrangian import LagrangianSystem
from alphacut.frame.structures.linear import (
    LinearSystem,
    courses_of_forces,
    evaluate,
    frequencies,
    histories,
)
from alphacut.fuzzy.refused import (
    FailedError,
    RefusedError,
    checked_number,
    require,
    require_choice,
)

MOST_NODES = 10_000_000
"""Steps of a motion at most: bounds of one output at two levels are 320 MB of them."""


def nodes(duration: float, step: float) -> Array:
    """Time nodes from 0 to `duration` in s.

    Raises:
        RefusedError: One is no number, the step is not positive, or the duration is not a positive
            multiple of it, or of too many steps.
    """
    checked_number("step", step, positive=True)
    count = round(checked_number("duration", duration) / step)
    is_multiple = 1 <= count <= MOST_NODES and abs(count * step - duration) <= 1e-9 * duration
    require(
        is_multiple,
        "duration",
        value=f"{duration:g} s",
        allowed=f"1 to {MOST_NODES:,} whole steps of {step:g} s",
    )
    return np.arange(count + 1) * step


PARTS, MOST = 4, 64
"""Parts of a step that are looked at in a linear structure."""
PHASE = 0.8
"""Most phase in rad that the fastest mode takes in a part, up to the most parts."""
WITHIN = "keep the parameters where the motion exists, such as positive masses"


class StepError(FailedError):
    """A step of the integrator did not converge."""


@dataclass(frozen=True, eq=False)
class Flow(ABC):
    """Base of mappings from parameter sets to trajectories of the outputs, node by node.

    Args:
        system: The structure.
        names: Its uncertain parameters, in the order of the columns of points.
        duration: Length of the simulation, in s.
        step: Length of a step, in s.

    Raises:
        RefusedError: A name is unknown, or the duration is no multiple of the step.
    """

    system: LinearSystem | LagrangianSystem
    names: tuple[str, ...]
    duration: float
    step: float

    def __post_init__(self) -> None:
        for name in self.names:
            require_choice("parameter", name, self.system.parameters)
        nodes(self.duration, self.step)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the observed quantities."""
        return self.system.outputs

    @property
    @abstractmethod
    def method(self) -> str:
        """Name of the time stepping."""

    @property
    def exact(self) -> bool:
        """True if trajectories have no error but rounding."""
        return self.method == Exact.name

    @abstractmethod
    def finer(self) -> tuple[Flow, int]:
        """More accurate trajectories at nodes a part of a step apart, and how many parts."""

    @abstractmethod
    def deviations(self, points: Array) -> tuple[Array, Array]:
        """More accurate trajectories at points (S, d), and the errors of these, (S, T, m)."""

    @cached_property
    def time(self) -> Array:
        """Nodes t_j, shape (T,), in s."""
        return nodes(self.duration, self.step)

    def values(self, points: Array) -> Array:
        """Trajectories at `points` (S, d), shape (S, T, outputs).

        Raises:
            RefusedError: A trajectory does not exist, or leaves the range of floating-point
                numbers.
            StepError: A step did not converge.
        """
        return self._finite(points, derivatives=False).value

    def taylor(self, points: Array) -> Jet:
        """Trajectories with derivatives of the scheme, V = (S, T, outputs); raises as `values`."""
        return self._finite(points, derivatives=True)

    def _finite(self, points: Array, *, derivatives: bool) -> Jet:
        try:
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                motion = self._march(points, derivatives=derivatives)
        except StepError as failure:
            where = self._named(self._failing(points))
            raise StepError(f"{failure}; it failed at {where}") from None
        except np.linalg.LinAlgError:
            what = f"a singular matrix at {self._named(self._failing(points))}"
            raise RefusedError("trajectory", what, "motions that exist", WITHIN) from None
        finite = np.isfinite(motion.value).all(-1)
        if not finite.all():
            bad, node = np.argwhere(~finite)[0]
            what = f"not finite from t = {self.time[node]:g} s on at {self._named(points[bad])}"
            cure = f"{WITHIN}, or a smaller step"
            raise RefusedError("trajectory", what, "motions that exist", cure)
        return motion

    def _failing(self, points: Array) -> Array:
        """One of some points at which a motion fails, found by halving."""
        while len(points) > 1:
            half = points[: len(points) // 2]
            try:
                self._march(half, derivatives=False)
                points = points[len(half) :]
            except (np.linalg.LinAlgError, StepError):
                points = half
        return np.asarray(points[0])

    def _named(self, point: Array) -> str:
        pairs = zip(self.names, point, strict=True)
        return ", ".join(f"{name} = {x:g}" for name, x in pairs) or "the nominal parameters"

    @abstractmethod
    def _march(self, points: Array, *, derivatives: bool) -> Jet:
        """Trajectories at `points`, V = (S, T, outputs)."""


@dataclass(frozen=True)
class LinearFlow(Flow):
    """Trajectories of a linear structure by a one-step method.

    Args:
        integrator: The method; the other arguments are those of `Flow`.

    Example:
        >>> from alphacut.frame import StoreyFrame
        >>> frame = StoreyFrame(masses=[1e3], stiffness=[4e4], q0=[0.1])
        >>> LinearFlow(frame, ("m1",), duration=1.0, step=0.1).values([[900.0], [1100.0]]).shape
        (2, 11, 1)
    """

    system: LinearSystem
    integrator: Integrator = field(default_factory=Midpoint)

    @property
    def method(self) -> str:
        """Name of the time stepping."""
        return self.integrator.name

    def finer(self) -> tuple[LinearFlow, int]:
        """Exact trajectories at nodes a part of a step apart, and how many parts."""
        turn = float(frequencies(self.system)[-1]) * self.step
        parts = int(np.clip(np.ceil(turn / PHASE), PARTS, MOST))
        return replace(self, step=self.step / parts, integrator=Exact()), parts

    def deviations(self, points: Array) -> tuple[Array, Array]:
        """Exact trajectories at points (S, d), and the errors of these, (S, T, m)."""
        truth = replace(self, integrator=Exact()).values(points)
        return truth, np.abs(self.values(points) - truth)

    def _march(self, points: Array, *, derivatives: bool) -> Jet:
        matrices, rows = evaluate(self.system, self.names, points, derivatives=derivatives)
        loads, has_ground = list(histories(self.system).values()), self.system.ground is not None
        h, steps, load = self.step, len(self.time) - 1, None
        pushes = matrices.pushes(ground=has_ground)
        if self.exact and loads:
            step_map, load = exact_response(matrices, pushes, loads, step=h, steps=steps)
        else:
            step_map = self.integrator.step_map(matrices, h, pushes)
            if loads:
                loads_of_steps = np.stack([linear_load(x, h, steps) for x in loads], -1)
                load = loads_of_steps.reshape(steps, -1)
        motion = trajectory(step_map, matrices.start, rows, load=load, count=steps + 1)
        if matrices.feeds is None:
            return motion
        at_nodes = np.stack([x.values(self.time) for x in courses_of_forces(self.system)])
        return motion + (matrices.feeds @ at_nodes).map(lambda x: x.swapaxes(-1, -2))


def exact_flow(flow: object) -> LinearFlow:
    """The flow, if it is the exact motion of a linear structure.

    Raises:
        UnprovedError: It is none.
    """
    if not isinstance(flow, LinearFlow):
        raise UnprovedError("the system is not linear")
    if not isinstance(flow.integrator, Exact):
        raise UnprovedError(
            f"the motion is that of the scheme '{flow.integrator.name}', and a proof is of the"
            " exact one"
        )
    return flow
