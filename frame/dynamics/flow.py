"""Trajectories of the outputs of a structure at time nodes, for many parameter sets at once.

A flow is the discrete deterministic mapping f_d(t_j; p) of the paper's eq. 19, with internal
differentiation by the parameters p.
"""

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
CURE = "keep the parameters where the motion exists, such as positive masses"


def time_nodes(duration: float, step: float) -> Array:
    """Return time nodes 0, step, 2 step … up to `duration`, shape (T,), in s.

    Raises:
        RefusedError: An argument is not a number, the step is not positive, or the duration is not
            a whole number of steps from 1 to `MAX_STEPS`.
    """
    checked_number("step", step, positive=True)
    # durations are given in decimal numbers, whose quotients are whole but for rounding
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
    """Base class of mappings from parameter sets to trajectories of the outputs at time nodes.

    Below, S is the number of parameter sets, d that of uncertain parameters, T that of time nodes
    and m that of outputs.

    Args:
        system: The structure.
        names: The d uncertain parameters, in the order of the columns of points (S, d).
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
        """Whether trajectories have no error but rounding; if not, they are by midpoint steps."""
        return False

    @abstractmethod
    def finer(self) -> tuple[Flow, int]:
        """Return a more accurate flow, and the number of substeps that it divides a step into."""

    def deviations(self, points: Array) -> tuple[Array, Array]:
        """Return more accurate trajectories at points (S, d), and the errors of this flow there.

        Both have shape (S, T, m). This base class is for exact flows, whose errors are zero.
        """
        values = self.values(points)
        return values, np.zeros_like(values)

    def reach(self) -> Array:
        """Return the size of each output that the energy of the nominal response allows, (m,).

        Zero means that it is not known.
        """
        return np.zeros(len(self.outputs))

    @cached_property
    def time(self) -> Array:
        """Time nodes t_j, shape (T,), in s."""
        return time_nodes(self.duration, self.step)

    def values(self, points: Array) -> Array:
        """Return trajectories of the outputs at parameter sets (S, d), shape (S, T, m).

        Raises:
            RefusedError: A trajectory does not exist, or leaves the range of floating-point
                numbers.
            StepError: A step did not converge.
        """
        return self._finite(points, derivatives=False).value

    def taylor(self, points: Array) -> Jet:
        """Return trajectories with first and second derivatives by the d uncertain parameters.

        It is the time-stepping scheme that is differentiated. The jet has shape (S, T, m).

        Args:
            points: Parameter sets, shape (S, d).

        Raises:
            RefusedError: As `values` does, or the flow has no derivatives.
            StepError: A step did not converge.
        """
        return self._finite(points, derivatives=True)

    def _finite(self, points: Array, *, derivatives: bool) -> Jet:
        """Return trajectories at points (S, d), and raise errors that name the point at fault."""
        # overflow and NaN are looked for in the result, so that the error can name time and point
        try:
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                motion = self._march(points, derivatives=derivatives)
        except StepError as failure:
            raise StepError(f"{failure}; it failed at {self._failing_point(points)}") from None
        except np.linalg.LinAlgError:
            what = f"a singular matrix at {self._failing_point(points)}"
            raise RefusedError("trajectory", what, "motions that exist", CURE) from None
        is_finite = np.isfinite(motion.value)
        if not is_finite.all():
            row, node, _ = np.argwhere(~is_finite)[0]
            where = self._point_words(points[row])
            what = f"not finite from t = {self.time[node]:g} s on at {where}"
            cure = f"{CURE}, or a smaller step"
            raise RefusedError("trajectory", what, "motions that exist", cure)
        return motion

    def _failing_point(self, points: Array) -> str:
        """Return, in words, the first point that fails alone, or the last one if none does."""
        for point in points:
            try:
                self._march(point[None], derivatives=False)
            except (np.linalg.LinAlgError, StepError):
                break
        return self._point_words(point)

    def _point_words(self, point: Array) -> str:
        """Return a parameter set (d,) as words, such as "k1 = 1.2e+08 N/m, m1 = 5e+04 kg"."""
        words = []
        for name, value in zip(self.names, point, strict=True):
            unit = self.system.parameter(name).unit
            words.append(f"{name} = {value:g} {unit}".rstrip())
        return ", ".join(words) or "the nominal parameters"

    @abstractmethod
    def _march(self, points: Array, *, derivatives: bool) -> Jet:
        """Return trajectories at `points` (S, d), shape (S, T, m), perhaps not finite.

        With `derivatives` the jet has first and second derivatives by the d parameters.
        """


@dataclass(frozen=True)
class LinearFlow(Flow):
    """Trajectories of a linear structure by a one-step method.

    Args:
        integrator: The method; the other arguments are those of `Flow`.
        by_modes: Whether compiled code superposes modes where the integrator is exact. If not, the
            same trajectories, to rounding, come from powers of the step map, without Numba.

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
        """Check the arguments; columns that yield are refused too, since they are not linear."""
        super().__post_init__()
        value = "of columns that yield"
        allowed = "make_flow, which takes them"
        is_linear = self.system.dynamics is Dynamics.LINEAR
        require(is_linear, "flow", value=value, allowed=allowed)

    @property
    def exact(self) -> bool:
        """Whether the integrator is `Exact`."""
        return isinstance(self.integrator, Exact)

    def finer(self) -> tuple[LinearFlow, int]:
        """Return the exact flow with 4 to 64 equal substeps in a step, and their number.

        Where 64 substeps suffice, the fastest mode turns by at most .8 rad in one of them, so that
        its curve is resolved. More substeps would cost memory only.
        """
        phase_per_step = float(frequencies(self.system)[-1]) * self.step
        substeps = int(np.clip(np.ceil(phase_per_step / 0.8), 4, 64))
        return replace(self, step=self.step / substeps, integrator=Exact()), substeps

    def deviations(self, points: Array) -> tuple[Array, Array]:
        """Return exact trajectories at points (S, d), and this flow's errors, (S, T, m) each."""
        exact_values = replace(self, integrator=Exact()).values(points)
        return exact_values, np.abs(self.values(points) - exact_values)

    def reach(self) -> Array:
        """Return the size of each output that the energy of the nominal response allows, (m,).

        An output r·q + s·v of displacements q and velocities v is at most
        √(r K⁻¹ rᵀ + s M⁻¹ sᵀ) √(qᵀ K q + vᵀ M v), by the inequality of Cauchy and Schwarz. The
        second factor is the root of twice the energy, here the largest one at a time node.
        """
        nominal = np.array([[self.system.parameters[name] for name in self.names]], float)
        matrices, rows = evaluate(self.system, self.names, nominal, derivatives=False)
        n = matrices.mass.value.shape[-1]
        all_states = rows.like(np.eye(2 * n)[None])
        states = trajectory(self._step_map(matrices), matrices.start, all_states).value[0]
        energy = np.zeros(len(self.time))
        squared_size = np.zeros(len(self.outputs))
        displacements = slice(0, n)
        velocities = slice(n, 2 * n)
        for half, matrix in (
            (displacements, matrices.stiffness.value[0]),
            (velocities, matrices.mass.value[0]),
        ):
            x = states[:, half]
            row = rows.value[0, :, half]
            energy += np.einsum("ti,ij,tj->t", x, matrix, x, optimize=True)
            # a pseudo-inverse, since massless unknowns make M singular
            inverse = np.linalg.pinv(matrix, hermitian=True)
            squared_size += np.einsum("oi,ij,oj->o", row, inverse, row, optimize=True)
        largest_energy = max(float(energy.max()), 0.0)
        return np.asarray(np.sqrt(np.maximum(squared_size, 0.0) * largest_energy))

    def _loads(self, matrices: Matrices) -> tuple[Jet, list[History]]:
        """Return accelerations by a unit of each of L loads, (S, n, L), and the load histories."""
        pushes = matrices.pushes(ground=self.system.ground is not None)
        return pushes, list(histories(self.system).values())

    def _step_map(self, matrices: Matrices) -> StepMap:
        """Return the map of the integrator over one step, for matrices of S parameter sets."""
        steps = len(self.time) - 1
        return self.integrator.step_map(matrices, *self._loads(matrices), self.step, steps)

    def _march(self, points: Array, *, derivatives: bool) -> Jet:
        matrices, rows = evaluate(self.system, self.names, points, derivatives=derivatives)
        outputs = None
        if self.exact and self.by_modes:
            outputs = self._by_superposition(matrices, rows)
        if outputs is None:
            outputs = trajectory(self._step_map(matrices), matrices.start, rows)
        return with_feedthrough(outputs, matrices, self.system, self.time)

    def _by_superposition(self, matrices: Matrices, rows: Jet) -> Jet | None:
        """Return exact trajectories by superposition of modes, without feedthrough, (S, T, m).

        Values come from classical modes, derivatives from complex ones. None is returned where
        these modes are coupled or too close to each other.

        Args:
            matrices: Of S parameter sets.
            rows: Rows of the outputs in the state [q; v], shape (S, m, 2n).
        """
        pushes, loads = self._loads(matrices)
        if not rows.directions:
            values = classical_trajectory(matrices, rows, pushes, loads, self.time)
            if values is None:
                return None
            return rows.like(values)
        load_columns = concatenate([pushes * 0.0, pushes], -2)
        columns = concatenate([matrices.start, load_columns], -1)
        return modal_trajectory(state_matrix(matrices), columns, rows, loads, self.time)


def with_feedthrough(outputs: Jet, matrices: Matrices, system: LinearSystem, time: Array) -> Jet:
    """Return outputs with the direct part of the forces, which accelerations have.

    Args:
        outputs: Trajectories C x(t) of states x, shape (S, T, m).
        matrices: Of the same S parameter sets. `feeds` has shape (S, m, distinct load histories).
        system: The structure, which says the loads.
        time: Time nodes, shape (T,), in s.
    """
    feedthrough = matrices.feeds
    if feedthrough is None:
        return outputs
    forces = np.stack([history.values(time) for history in distinct_histories(system.loads)])
    return outputs + (feedthrough @ forces).map(lambda x: x.swapaxes(-1, -2))


def trajectory(step_map: StepMap, start: Jet, rows: Jet) -> Jet:
    """Return the outputs C x[k] of x[k+1] = T x[k] + G load[k] at all nodes k = 0 … steps.

    The nodes are divided into blocks of about √steps nodes, since few products of large matrices
    are faster than many of small ones. Outputs in a block are C T^j times the state at its first
    node, plus what the loads add to a motion from rest at that node. All blocks are treated at
    once. The states at the first nodes of the blocks follow by a prefix scan (Hillis, Steele 1986).

    Args:
        step_map: T, G and the loads of each step.
        start: State at t = 0, shape (S, N, 1).
        rows: Rows C of the outputs, shape (S, m, N).

    Returns:
        Shape (S, steps + 1, m).
    """
    loads = step_map.loads
    power = step_map.transfer
    nodes = len(loads) + 1
    samples = len(start.value)
    m = rows.value.shape[-2]

    # C T^j for the nodes j of a block, by doubling: shape (S, size m, N)
    observed = rows
    size = 1
    while 2 * size**2 < nodes:
        observed = concatenate([observed, observed @ power], -2)
        power = power @ power
        size = 2 * size
    blocks = -(-nodes // size)

    # what the loads of a block add to its outputs, and to the state at the next block's first node
    first_states = start @ np.eye(1, blocks)
    from_rest = list[Jet]()
    if loads.shape[1]:
        padded = np.zeros((blocks * size, loads.shape[1]))
        padded[: len(loads)] = loads
        loads_of_blocks = padded.reshape(blocks, size, -1)
        state = step_map.load @ np.zeros((loads.shape[1], blocks))
        for k in range(size):
            from_rest.append(rows @ state)  # eq. 18, of a linear structure
            state = step_map.transfer @ state + step_map.load @ loads_of_blocks[:, k].T
        first_states = concatenate([start, state[..., :-1]], -1)

    # prefix scan: to each block's state add T^(size shift) times that of `shift` blocks before
    shift = 1
    while shift < blocks:
        carried = power @ first_states[..., :-shift]
        later = first_states[..., shift:] + carried
        first_states = concatenate([first_states[..., :shift], later], -1)
        power = power @ power
        shift = 2 * shift

    outputs = observed @ first_states  # (…, S, size m, blocks)
    if from_rest:
        outputs = outputs + concatenate(from_rest, -2)

    def in_time_order(x: Array) -> Array:
        derivative_axes = x.shape[:-3]
        by_block = x.reshape((*derivative_axes, samples, size, m, blocks))
        ordered = np.moveaxis(by_block, -1, -3)
        return ordered.reshape((*derivative_axes, samples, blocks * size, m))[..., :nodes, :]

    return outputs.map(in_time_order)


def exact_flow(flow: object) -> LinearFlow:
    """Return a flow unchanged if its trajectories are exact ones of a linear structure.

    Raises:
        UnprovedError: They are not.
    """
    if not isinstance(flow, LinearFlow):
        raise UnprovedError("the system is not linear")
    if not isinstance(flow.integrator, Exact):
        raise UnprovedError(
            f"the motion is that of the scheme '{flow.integrator.name}', and a proof is of the"
            " exact one"
        )
    return flow
