"""Discrete deterministic mapping f_d(t_j; p) of eq. 19 for many parameter sets."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from math import isqrt
from typing import NoReturn, Protocol

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet, concatenate
from alphacut.frame.calculus.numbers import require_number
from alphacut.frame.dynamics.integrators import Exact, Integrator, Midpoint, StepMap
from alphacut.frame.dynamics.spectral import LARGE, NearlyCriticalError, spectral_trajectory
from alphacut.frame.structures.linear import LinearSystem, check_names, evaluate


class Flow(Protocol):
    """Maps parameter sets to trajectories of the outputs."""

    @property
    def names(self) -> tuple[str, ...]:
        """The uncertain parameters, in the order of the columns of `points`."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the observed quantities."""

    @property
    def time(self) -> Array:
        """Nodes t_j, shape (T,), in s."""

    def values(self, points: Array) -> Array:
        """Trajectories at `points` (S, d), shape (S, T, outputs)."""

    def taylor(self, points: Array) -> Jet:
        """Trajectories with internal first and second derivatives, V = (S, T, outputs)."""


def nodes(duration: float, step: float) -> Array:
    """Time nodes from 0 to `duration` in s.

    Raises:
        ValueError: One is no number, the step is not positive, or the duration is not a positive
            multiple of it.
    """
    require_number("step", step, "s")
    require_number("duration", duration, "s")
    if not (np.isfinite(step) and step > 0):
        raise ValueError(f"step: {step:g} s is not allowed; it must be positive")
    count = round(duration / step) if np.isfinite(duration) else 0
    if count < 1 or abs(count * step - duration) > 1e-9 * duration:
        raise ValueError(
            f"duration: {duration:g} s is not a positive multiple of the step {step:g} s"
        )
    return np.arange(count + 1) * step


WITHIN = "keep the parameters where the motion exists, such as positive masses"


class StepError(RuntimeError):
    """A step of the integrator did not converge."""


class March(ABC):
    """Base of flows that march from node to node."""

    names: tuple[str, ...]

    duration: float
    step: float

    @cached_property
    def time(self) -> Array:
        """Nodes t_j, shape (T,), in s."""
        return nodes(self.duration, self.step)

    def values(self, points: Array) -> Array:
        """Trajectories at `points` (S, d), shape (S, T, outputs).

        Raises:
            ValueError: A trajectory does not exist, or leaves the range of floating-point numbers.
            StepError: A step did not converge.
        """
        return self._finite(points, derivatives=False).value

    def taylor(self, points: Array) -> Jet:
        """Trajectories with derivatives of the scheme, V = (S, T, outputs); raises as `values`."""
        return self._finite(points, derivatives=True)

    def _finite(self, points: Array, *, derivatives: bool) -> Jet:
        try:
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                found = self._march(points, derivatives=derivatives)
        except (np.linalg.LinAlgError, StepError) as failure:
            self._locate(points, failure)
        if not np.isfinite(found.value).all():
            bad, node = np.argwhere(~np.isfinite(found.value).all(-1))[0]
            when = f"not finite from t = {self.time[node]:g} s on"
            raise ValueError(
                f"trajectory: {when} at {self._named(points[bad])}; {WITHIN}, or take a smaller"
                " step"
            )
        return found

    def _locate(self, points: Array, failure: Exception) -> NoReturn:
        """Raise a failure with its parameters, found by halving the set of points."""
        while len(points) > 1:
            half = points[: len(points) // 2]
            try:
                self._march(half, derivatives=False)
                points = points[len(half) :]
            except (np.linalg.LinAlgError, StepError):
                points = half
        where = f"at {self._named(points[0])}"
        if isinstance(failure, StepError):
            raise StepError(f"{failure}; it failed {where}") from None
        raise ValueError(f"trajectory: a matrix is singular {where}; {WITHIN}") from None

    def _named(self, point: Array) -> str:
        return (
            ", ".join(f"{name} = {value:g}" for name, value in zip(self.names, point, strict=True))
            or "the modal parameters"
        )

    @abstractmethod
    def _march(self, points: Array, *, derivatives: bool) -> Jet:
        """Trajectories at `points`, V = (S, T, outputs)."""


@dataclass(frozen=True)
class LinearFlow(March):
    """Trajectories of a linear structure by a one-step method.

    Args:
        system: The structure.
        names: Its uncertain parameters.
        duration: Length of the simulation, in s.
        step: Length of a step, in s.
        integrator: The method.

    Raises:
        ValueError: A name is unknown, or the duration is no multiple of the step.
    """

    system: LinearSystem
    names: tuple[str, ...]
    duration: float
    step: float
    integrator: Integrator = field(default_factory=Midpoint)

    def __post_init__(self) -> None:
        check_names(self.system, self.names)
        nodes(self.duration, self.step)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the observed quantities."""
        return self.system.outputs

    def _march(self, points: Array, *, derivatives: bool) -> Jet:
        matrices, rows = evaluate(self.system, self.names, points, derivatives=derivatives)
        load, every = self._load()
        h = self.step / every
        if isinstance(self.integrator, Exact) and rows.value.shape[-1] >= LARGE:
            try:
                return spectral_trajectory(
                    matrices, rows, load=load, step=h, every=every, count=len(self.time)
                )
            except NearlyCriticalError:
                pass  # powers of the transfer matrix need no eigenvectors
        step_map = self.integrator.step_map(matrices, h)
        start = concatenate([matrices.q0, matrices.v0], -2)
        found = trajectory(step_map, start, rows, load=load, count=(len(self.time) - 1) * every + 1)
        return found if every == 1 else found[:, ::every]

    def _load(self) -> tuple[Array | None, int]:
        """Ground acceleration at the nodes, and for the exact propagator between them."""
        ground = self.system.ground
        if ground is None:
            return None, 1
        every = ground.intervals(self.step) if isinstance(self.integrator, Exact) else 1
        return ground.at(np.arange((len(self.time) - 1) * every + 1) * (self.step / every)), every


def trajectory(step_map: StepMap, start: Jet, rows: Jet, *, load: Array | None, count: int) -> Jet:
    """Outputs at `count` nodes, by powers of the step map in blocks of √count steps.

    Args:
        step_map: One step.
        start: Initial state, V = (S, N, 1).
        rows: Observation rows, V = (S, m, N).
        load: Ground acceleration at the nodes, shape (count,), or None.
        count: Number of nodes.

    Returns:
        Outputs, V = (S, count, m).
    """
    size = isqrt(count - 1) + 1
    blocks = -(-count // size)
    powers = _powers(step_map.transfer, size)
    jump = step_map.transfer @ powers[:, -1]
    observed = rows[:, None] @ powers  # C T^j, V = (S, size, m, N)
    samples, m, n = len(start.value), rows.value.shape[-2], start.value.shape[-2]
    flat = observed.map(lambda x: x.reshape((*x.shape[:-3], size * m, n)))
    if load is None:
        starts = _starts(jump, start, None, blocks)
        out = flat @ starts
    else:
        steps = np.zeros((2 * size, blocks))  # a(t_k), a(t_{k+1}) for the steps of each block
        padded = np.concatenate([load, np.zeros(size * blocks + 1 - count)])
        steps[0::2], steps[1::2] = (
            padded[i : i + size * blocks].reshape(blocks, size).T for i in (0, 1)
        )
        impulse = powers @ step_map.load[:, None]  # T^k G, V = (S, size, N, 2)
        last = impulse.map(
            lambda x: np.moveaxis(x[..., ::-1, :, :], -3, -2).reshape((*x.shape[:-3], n, 2 * size))
        )
        starts = _starts(jump, start, last @ steps, blocks)
        out = flat @ starts + _convolution(rows[:, None] @ impulse, size) @ steps

    def in_time(x: Array) -> Array:
        lead = x.shape[:-3]
        ordered = np.moveaxis(x.reshape((*lead, samples, size, m, blocks)), -1, -3)
        cut: Array = ordered.reshape((*lead, samples, blocks * size, m))[..., :count, :]
        return cut

    return out.map(in_time)


def _powers(transfer: Jet, count: int) -> Jet:
    """T^0 … T^(count − 1) by doubling, V = (S, count, N, N)."""
    eye = np.broadcast_to(np.eye(transfer.value.shape[-1]), transfer.value.shape)
    powers = Jet.constant(eye, transfer.directions)[:, None]
    top = transfer
    while powers.value.shape[1] < count:
        powers = concatenate([powers, powers @ top[:, None]], -3)
        top = top @ top
    return powers[:, :count]


def _starts(jump: Jet, start: Jet, forced: Jet | None, blocks: int) -> Jet:
    """States at the first node of every block, V = (S, N, blocks)."""
    states = [start]
    for b in range(blocks - 1):
        following = jump @ states[-1]
        states.append(following if forced is None else following + forced[..., b : b + 1])
    return concatenate(states, -1)


def _convolution(impulse: Jet, size: int) -> Jet:
    """Response in a block to loads of earlier steps, V = (S, size, m, 2)."""
    lag = np.arange(size)[:, None] - 1 - np.arange(size)[None, :]

    def spread(x: Array) -> Array:
        taken = x[..., np.maximum(lag, 0), :, :] * (lag >= 0)[:, :, None, None]  # (…, j, i, m, 2)
        moved = np.moveaxis(taken, -2, -3)
        toeplitz: Array = moved.reshape((*x.shape[:-3], size * x.shape[-2], 2 * size))
        return toeplitz

    return impulse.map(spread)
