"""Discrete deterministic mapping f_d(t_j; p) of eq. 19 for many parameter sets."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from alphacut.base.errors import (
    FailedError,
    RefusedError,
    checked_number,
    require,
    require_choice,
)
from alphacut.frame.calculus.jet import Array, Jet, concatenate
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.integrators import Exact, Integrator, Midpoint, StepMap, state_matrix
from alphacut.frame.dynamics.modal_trajectory import classical_trajectory, modal_trajectory
from alphacut.frame.records.history import History
from alphacut.frame.structures.linear import (
    LinearSystem,
    Matrices,
    evaluate,
    frequencies,
    histories,
)
from alphacut.frame.structures.loads import distinct_histories
from alphacut.frame.structures.model import Dynamics, StructureModel

MAX_STEPS = 10_000_000
"""Most steps of a motion: bounds of one output at two levels are 320 MB of them."""
MIN_SUBSTEPS, MAX_SUBSTEPS = 4, 64
"""Fewest and most parts of a step in `LinearFlow.finer`."""
MAX_PHASE = 0.8
"""Most phase in rad that the fastest mode takes in a part, up to the most parts."""
CURE = "keep the parameters where the motion exists, such as positive masses"


def time_nodes(duration: float, step: float) -> Array:
    """Return time nodes 0, step, 2 step … up to `duration`, shape (T,), in s.

    Raises:
        RefusedError: An argument is not a number, the step is not positive, or the duration is not
            a whole number of steps from 1 to `MAX_STEPS`.
    """
    checked_number("step", step, positive=True)
    count = round(checked_number("duration", duration) / step)
    is_multiple = 1 <= count <= MAX_STEPS and abs(count * step - duration) <= 1e-9 * duration
    require(
        is_multiple,
        "duration",
        value=f"{duration:g} s",
        allowed=f"1 to {MAX_STEPS:,} whole steps of {step:g} s",
    )
    return np.arange(count + 1) * step


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

    system: StructureModel
    names: tuple[str, ...]
    duration: float
    step: float

    def __post_init__(self) -> None:
        for name in self.names:
            require_choice("parameter", name, self.system.parameters)
        time_nodes(self.duration, self.step)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the observed quantities."""
        return self.system.outputs

    @property
    def exact(self) -> bool:
        """True if trajectories have no error but rounding; else they are by midpoint steps."""
        return False

    @abstractmethod
    def finer(self) -> tuple[Flow, int]:
        """Return a more accurate flow with steps divided into parts, and the number of parts."""

    def deviations(self, points: Array) -> tuple[Array, Array]:
        """Return more accurate trajectories at points (S, d) and this flow's errors, (S, T, m)."""
        values = self.values(points)  # of a flow that is exact
        return values, np.zeros_like(values)

    def reach(self) -> Array:
        """Size that outputs could have by the energy of the nominal motion, (m,); 0 if unknown."""
        return np.zeros(len(self.outputs))

    @cached_property
    def time(self) -> Array:
        """Nodes t_j, shape (T,), in s."""
        return time_nodes(self.duration, self.step)

    def values(self, points: Array) -> Array:
        """Return trajectories of the outputs at parameters (S, d), shape (S, T, outputs).

        Raises:
            RefusedError: A trajectory does not exist, or leaves the range of floating-point
                numbers.
            StepError: A step did not converge.
        """
        return self._finite(points, derivatives=False).value

    def taylor(self, points: Array) -> Jet:
        """Trajectories (S, T, outputs) with derivatives of the scheme; raises as `values`."""
        return self._finite(points, derivatives=True)

    def _finite(self, points: Array, *, derivatives: bool) -> Jet:
        """Trajectories at points (S, d), all of them finite; errors name the point."""
        try:
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                motion = self._march(points, derivatives=derivatives)
        except StepError as failure:
            raise StepError(f"{failure}; it failed at {self._failing_point(points)}") from None
        except np.linalg.LinAlgError:
            what = f"a singular matrix at {self._failing_point(points)}"
            raise RefusedError("trajectory", what, "motions that exist", CURE) from None
        finite = np.isfinite(motion.value)
        if not finite.all():
            row, node, _ = np.argwhere(~finite)[0]
            where = self._point_words(points[row])
            what = f"not finite from t = {self.time[node]:g} s on at {where}"
            cure = f"{CURE}, or a smaller step"
            raise RefusedError("trajectory", what, "motions that exist", cure)
        return motion

    def _failing_point(self, points: Array) -> str:
        for point in points:
            try:
                self._march(point[None], derivatives=False)
            except (np.linalg.LinAlgError, StepError):
                break
        return self._point_words(point)

    def _point_words(self, point: Array) -> str:
        pairs, unit = zip(self.names, point, strict=True), self.system.parameter
        numbers = (f"{name} = {x:g} {unit(name).unit}".rstrip() for name, x in pairs)
        return ", ".join(numbers) or "the nominal parameters"

    @abstractmethod
    def _march(self, points: Array, *, derivatives: bool) -> Jet:
        """Trajectories at `points`, shape (S, T, outputs)."""


@dataclass(frozen=True)
class LinearFlow(Flow):
    """Trajectories of a linear structure by a one-step method.

    Args:
        integrator: The method; the other arguments are those of `Flow`.
        by_modes: Whether compiled code superposes classical modes for values of exact motions. If
            not they are, to rounding, the same by powers of the step map, which loads no Numba.

    Example:
        >>> from alphacut.frame import StoreyFrame
        >>> frame = StoreyFrame(masses=[1e3], stiffness=[4e4], q0=[0.1])
        >>> LinearFlow(frame, ("m1",), duration=1.0, step=0.1).values([[900.0], [1100.0]]).shape
        (2, 11, 1)
    """

    system: LinearSystem
    integrator: Integrator = field(default_factory=Midpoint)
    by_modes: bool = True

    def __post_init__(self) -> None:
        """Refuse, besides, columns that yield, whose motion is not linear."""
        super().__post_init__()
        value, allowed = "of columns that yield", "make_flow, which takes them"
        is_linear = self.system.dynamics is Dynamics.LINEAR
        require(is_linear, "flow", value=value, allowed=allowed)

    @property
    def exact(self) -> bool:
        """True if the integrator is `Exact`."""
        return isinstance(self.integrator, Exact)

    def finer(self) -> tuple[LinearFlow, int]:
        """Return the exact flow with steps divided into equal parts, and the number of parts."""
        # parts in which the fastest mode turns by MAX_PHASE at most
        phase_per_step = float(frequencies(self.system)[-1]) * self.step
        parts = int(np.clip(np.ceil(phase_per_step / MAX_PHASE), MIN_SUBSTEPS, MAX_SUBSTEPS))
        return replace(self, step=self.step / parts, integrator=Exact()), parts

    def deviations(self, points: Array) -> tuple[Array, Array]:
        """Return exact trajectories at points (S, d) and this flow's errors, (S, T, m) each."""
        truth = replace(self, integrator=Exact()).values(points)
        return truth, np.abs(self.values(points) - truth)

    def reach(self) -> Array:
        """Size that outputs could have by the energy of the nominal motion, shape (m,).

        An output r q + s v is at most √(r K⁻¹ rᵀ + s M⁻¹ sᵀ) √(qᵀ K q + vᵀ M v).
        """
        nominal = np.array([[self.system.parameters[name] for name in self.names]], float)
        matrices, rows = evaluate(self.system, self.names, nominal, derivatives=False)
        n = matrices.mass.value.shape[-1]
        states = trajectory(
            self._step_map(matrices), matrices.start, rows.like(np.eye(2 * n)[None])
        )
        energy, size = np.zeros(len(self.time)), np.zeros(len(self.outputs))
        for k, matrix in enumerate((matrices.stiffness.value[0], matrices.mass.value[0])):
            part = slice(k * n, (k + 1) * n)
            x, row = states.value[0, :, part], rows.value[0, :, part]
            energy += np.einsum("ti,ij,tj->t", x, matrix, x, optimize=True)
            inverse = np.linalg.pinv(matrix, hermitian=True)
            size += np.einsum("oi,ij,oj->o", row, inverse, row, optimize=True)
        return np.asarray(np.sqrt(np.maximum(size, 0.0) * max(float(energy.max()), 0.0)))

    def _loads(self, matrices: Matrices) -> tuple[Jet, list[History]]:
        """Accelerations by a unit of each of L loads, (S, n, L), and their histories."""
        pushes = matrices.pushes(ground=self.system.ground is not None)
        return pushes, list(histories(self.system).values())

    def _step_map(self, matrices: Matrices) -> StepMap:
        steps = len(self.time) - 1
        return self.integrator.step_map(matrices, *self._loads(matrices), self.step, steps)

    def _march(self, points: Array, *, derivatives: bool) -> Jet:
        """Outputs of x[k+1] = T x[k] + G load[k] at points (S, d), shape (S, T, outputs)."""
        matrices, rows = evaluate(self.system, self.names, points, derivatives=derivatives)
        motion = self._from_modes(matrices, rows) if self.exact and self.by_modes else None
        if motion is None:
            motion = trajectory(self._step_map(matrices), matrices.start, rows)
        return with_feedthrough(motion, matrices, self.system, self.time)

    def _from_modes(self, matrices: Matrices, rows: Jet) -> Jet | None:
        """The same by classical modes, derivatives by complex ones; None where there are none."""
        pushes, loads = self._loads(matrices)
        if not rows.directions:
            values = classical_trajectory(matrices, rows, pushes, loads, self.time)
            return None if values is None else rows.like(values)
        columns = concatenate([matrices.start, concatenate([pushes * 0.0, pushes], -2)], -1)
        return modal_trajectory(state_matrix(matrices), columns, rows, loads, self.time)


def with_feedthrough(motion: Jet, matrices: Matrices, system: LinearSystem, time: Array) -> Jet:
    """Return outputs (S, T, m) whose accelerations also hold the forces over the masses."""
    feeds = matrices.feeds
    if feeds is None:
        return motion
    forces = np.stack([history.values(time) for history in distinct_histories(system.loads)])
    return motion + (feeds @ forces).map(lambda x: x.swapaxes(-1, -2))


def trajectory(step_map: StepMap, start: Jet, rows: Jet) -> Jet:
    """Return outputs C x[k], k = 0 … steps, of x[k+1] = T x[k] + G load[k].

    Nodes come in blocks of about √steps. Outputs of a block are C T^j times the state at its first
    node, j by doubling, and what loads add to a motion from rest, all blocks at once. The states at
    first nodes are a prefix scan of the states that rest and loads leave (Hillis, Steele 1986).

    The start has shape (S, N, 1), the rows C (S, m, N), and the outputs (S, steps + 1, m).
    """
    loads, power = step_map.loads, step_map.transfer
    count, samples, m = len(loads) + 1, len(start.value), rows.value.shape[-2]
    observed, size = rows, 1  # C T^j of the nodes j of a block, shape (S, size m, N)
    while 2 * size**2 < count:
        observed = concatenate([observed, observed @ power], -2)
        power, size = power @ power, 2 * size
    blocks = -(-count // size)
    starts, outputs = start @ np.eye(1, blocks), list[Jet]()
    if loads.shape[1]:
        padded = np.zeros((blocks * size, loads.shape[1]))
        padded[: len(loads)] = loads
        columns = padded.reshape(blocks, size, -1)
        state = step_map.load @ np.zeros((loads.shape[1], blocks))
        for k in range(size):
            outputs.append(rows @ state)  # eq. 18, of a linear structure
            state = step_map.transfer @ state + step_map.load @ columns[:, k].T
        starts = concatenate([start, state[..., :-1]], -1)
    shift = 1
    while shift < blocks:  # each state becomes the sum of T^(size i) times that i blocks before
        carried = power @ starts[..., :-shift]
        starts = concatenate([starts[..., :shift], starts[..., shift:] + carried], -1)
        power, shift = power @ power, 2 * shift
    out = observed @ starts  # (…, S, size m, blocks)
    if outputs:
        out = out + concatenate(outputs, -2)

    def in_time(x: Array) -> Array:
        lead = x.shape[:-3]
        ordered = np.moveaxis(x.reshape((*lead, samples, size, m, blocks)), -1, -3)
        return ordered.reshape((*lead, samples, blocks * size, m))[..., :count, :]

    return out.map(in_time)


def exact_flow(flow: object) -> LinearFlow:
    """Return a flow unchanged if it is the exact motion of a linear structure.

    Raises:
        UnprovedError: It is not.
    """
    if not isinstance(flow, LinearFlow):
        raise UnprovedError("the system is not linear")
    if not isinstance(flow.integrator, Exact):
        raise UnprovedError(
            f"the motion is that of the scheme '{flow.integrator.name}', and a proof is of the"
            " exact one"
        )
    return flow
