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
from alphacut.frame.calculus.polynomials import Array, Jet, concatenate
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


def time_nodes(duration: float, step: float) -> Array:
    """Return the time nodes 0, step, 2 step … up to `duration`, shape (steps + 1,), in s.

    Args:
        duration: Last node, in s: a whole number of steps to 1e-9 of it.
        step: Distance of neighbouring nodes, in s.

    Raises:
        RefusedError: An argument is not a number, the step is not positive, or the duration is not
            1 to 10,000,000 whole steps.
    """
    checked_number("step", step, positive=True)
    # More steps are a mistake in a unit: bounds of one output at two levels are 320 MB of them.
    max_steps = 10_000_000
    # Durations are given in decimal numbers, whose quotients are whole but for rounding
    count = round(checked_number("duration", duration) / step)
    is_multiple = 1 <= count <= max_steps and abs(count * step - duration) <= 1e-9 * duration
    require(
        is_multiple,
        "duration",
        value=f"{duration:g} s",
        allowed=f"1 to {max_steps:,} whole steps of {step:g} s",
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
        """Raise RefusedError if a name is unknown, or the duration is no multiple of the step."""
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
        """Return trajectories of the outputs at S sets of the uncertain parameters.

        Args:
            points: Parameter sets in SI units, shape (S, d): a column for each of the d names in
                `self.names`. Other parameters have their nominal values.

        Returns:
            Array of shape (S, time nodes, outputs), in the SI units of the outputs.

        Raises:
            RefusedError: A trajectory does not exist, or leaves the range of floating-point
                numbers.
            StepError: A step did not converge.
        """
        return self._finite(points, derivatives=False).value

    def taylor(self, points: Array) -> Jet:
        """Return trajectories with first and second derivatives by the uncertain parameters.

        It is the time-stepping scheme that is differentiated, so that the derivatives are those of
        what `values` returns, to rounding.

        Args:
            points: Parameter sets in SI units, shape (S, d): a column for each of the d names in
                `self.names`. Other parameters have their nominal values.

        Returns:
            A jet: its `value`, the trajectories, has the shape (S, time nodes, outputs), in SI
            units; `first` and `second` have one and two axes of length d in front, in the order of
            the names.

        Raises:
            RefusedError: A trajectory does not exist, or leaves the range of floating-point
                numbers, or the flow has no derivatives.
            StepError: A step did not converge.
        """
        return self._finite(points, derivatives=True)

    def _finite(self, points: Array, *, derivatives: bool) -> Jet:
        """Return trajectories, or raise an error that names the parameter set at fault.

        Args:
            points: Parameter sets in SI units, shape (S, d): a column for each uncertain parameter.
            derivatives: Whether the result has first and second derivatives by the d parameters.
                Their values are not checked.

        Returns:
            Trajectories with their derivatives (a jet), shape (S, time nodes, outputs), in the
            units of the outputs; all values are finite.

        Raises:
            RefusedError: A matrix is singular, or a value is not finite; the message names the
                first parameter set and time node. Or the flow has no derivatives.
            StepError: A step did not converge.
        """
        cure = "keep the parameters where the motion exists, such as positive masses"
        # Overflow and NaN are looked for in the result, so that the error can name time and point;
        # all parameter sets are computed at once, and one bad set must not stop NumPy with a
        # warning.
        try:
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                motion = self._march(points, derivatives=derivatives)
        except StepError as failure:
            raise StepError(f"{failure}; it failed at {self._failing_point(points)}") from None
        except np.linalg.LinAlgError:
            what = f"a singular matrix at {self._failing_point(points)}"
            raise RefusedError("trajectory", what, "motions that exist", cure) from None
        is_finite = np.isfinite(motion.value)
        if not is_finite.all():
            row, node, _ = np.argwhere(~is_finite)[0]
            where = self._point_words(points[row])
            what = f"not finite from t = {self.time[node]:g} s on at {where}"
            cure += ", or a smaller step"
            raise RefusedError("trajectory", what, "motions that exist", cure)
        return motion

    def _failing_point(self, points: Array) -> str:
        """Return, in words, the first parameter set that fails alone, or the last one if none does.

        A set fails alone if its trajectory raises LinAlgError or StepError. Other errors are not
        caught.

        Args:
            points: At least one parameter set, shape (S, d), all of which together have failed.
        """
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

        The number is such that the fastest undamped mode at the nominal parameters turns by at most
        0.8 rad in a substep, so that its curve is resolved, unless this would take more than 64.
        More substeps would cost memory only.
        """
        phase_per_step = float(frequencies(self.system)[-1]) * self.step
        substeps = int(np.clip(np.ceil(phase_per_step / 0.8), 4, 64))
        return replace(self, step=self.step / substeps, integrator=Exact()), substeps

    def deviations(self, points: Array) -> tuple[Array, Array]:
        """Return exact trajectories at points (S, d), and this flow's errors, (S, T, m) each."""
        exact_values = replace(self, integrator=Exact()).values(points)
        return exact_values, np.abs(self.values(points) - exact_values)

    def reach(self) -> Array:
        """Return the size of each output that the energy of the nominal response allows.

        An output r·q + s·v of displacements q and velocities v is at most √(r K⁻¹ rᵀ + s M⁻¹ sᵀ)
        √(qᵀ K q + vᵀ M v), by the inequality of Cauchy and Schwarz. The second factor is the root
        of twice the energy, here the largest one at a time node of the response at the nominal
        parameters. What forces add to accelerations at once is left out, and so are displacements
        without strain energy where K is singular.

        Returns:
            Array of shape (outputs,), in the units of the outputs, not negative.

        Raises:
            numpy.linalg.LinAlgError: A matrix is singular at the nominal parameters.
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
            energy += np.einsum("ti,ti->t", x @ matrix, x)
            # A pseudo-inverse serves, since free unknowns make K singular: they store no energy,
            # and an output on them has no bound from it.
            inverse = np.linalg.pinv(matrix, hermitian=True)
            squared_size += np.einsum("oi,oi->o", row @ inverse, row)
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
        """Return trajectories at parameter sets, perhaps not finite.

        Args:
            points: Parameter sets in SI units, shape (S, d): a column for each uncertain parameter.
            derivatives: Whether the jet has first and second derivatives by the d parameters.

        Returns:
            Trajectories with their derivatives (a jet), shape (S, time nodes, outputs), in the
            units of the outputs.

        Raises:
            RefusedError: Damping is given by ratios, and the stiffness is not positive definite; or
                an exact step would take more than 4096 substeps.
            numpy.linalg.LinAlgError: A matrix is singular.
        """
        matrices, rows = evaluate(self.system, self.names, points, derivatives=derivatives)
        # Superposition is the fastest way. Where modes are coupled or too close it gives None, and
        # powers of the map of a step, which need no modes, give the same trajectories to rounding.
        outputs = None
        if self.exact and self.by_modes:
            outputs = self._by_superposition(matrices, rows)
        if outputs is None:
            outputs = trajectory(self._step_map(matrices), matrices.start, rows)
        return with_feedthrough(outputs, matrices, self.system, self.time)

    def _by_superposition(self, matrices: Matrices, rows: Jet) -> Jet | None:
        """Return exact trajectories of the outputs C [q; v] by superposition of modes.

        What forces add to accelerations at once is not in them. Without derivatives the modes are
        the undamped ones, which must stay uncoupled by damping; with derivatives they are the
        complex ones of the state matrix.

        Args:
            matrices: Matrices of the structure at S parameter sets.
            rows: Rows C of the outputs, shape (S, outputs, 2n), with or without derivatives.

        Returns:
            Trajectories with their derivatives (a jet), shape (S, time nodes, outputs); there are
            as many derivatives as `rows` has. None if damping couples the modes, two of them are
            too close, or a mode does not oscillate or grows.
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
    """Return outputs with what forces add to accelerations at once.

    Args:
        outputs: Trajectories C x(t) of the states x of a structure, with their derivatives by
            parameters (a jet), shape (S, nodes, outputs).
        matrices: Matrices of the structure at the same S parameter sets.
        system: The structure, which has the loads.
        time: Time nodes, shape (nodes,), in s.

    Returns:
        Jet of the shape of `outputs`. Each distinct load history f adds its feedthrough, the
        accelerations of the outputs under a unit of it, times f(t), the value after a jump. It is
        `outputs` itself if no output observes accelerations, or no force has a history.
    """
    feedthrough = matrices.feeds  # (S, outputs, histories)
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

    # Zero loads fill the last block up; the nodes that they lead to are cut off at the end.
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
        """Return (…, S, size m, blocks) as (…, S, nodes, m), without the nodes behind the last."""
        derivative_axes = x.shape[:-3]
        by_block = x.reshape((*derivative_axes, samples, size, m, blocks))
        ordered = np.moveaxis(by_block, -1, -3)
        return ordered.reshape((*derivative_axes, samples, blocks * size, m))[..., :nodes, :]

    return outputs.map(in_time_order)


def exact_flow(flow: object) -> LinearFlow:
    """Return a flow unchanged if its trajectories are exact ones of a linear structure.

    Args:
        flow: A mapping from parameter sets to trajectories.

    Raises:
        UnprovedError: It is not linear, as with columns that yield, or it integrates by another
            scheme than the exact one.
    """
    if not isinstance(flow, LinearFlow):
        raise UnprovedError("the system is not linear")
    if not isinstance(flow.integrator, Exact):
        raise UnprovedError(
            f"the motion is that of the scheme '{flow.integrator.name}', and a proof is of the"
            " exact one"
        )
    return flow
