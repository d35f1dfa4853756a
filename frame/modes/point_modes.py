"""Exact outputs of a linear structure at single inputs, times and outputs, by complex modes.

An output is Re Σ_k r_k c_k ρ(t; σ_k) over modes k: r_k is the output's row times the mode shape,
c_k what the initial state or a unit of a load gives the mode, and ρ = exp(σ t) or its Duhamel
integral.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.records.history import History
from alphacut.frame.response.chord_deviation import line_deviations, load_deviation
from alphacut.frame.response.duhamel import responses_at_nodes
from alphacut.frame.structures.linear import LinearSystem, evaluate, histories, undamped_modes
from alphacut.frame.structures.loads import distinct_histories


@dataclass(frozen=True, eq=False)
class PointModes:
    """Modes of a structure at S points of its inputs: p complex ones, m outputs, L loads."""

    sigma: Array  # exponents σ, of a conjugate pair the upper one, (S, p), in 1/s
    outputs: Array  # r, twice that of modes whose conjugate is left out, complex, (S, m, p)
    starts: Array  # c of the initial state, then of a unit of each load, complex, (S, p, 1 + L)
    loads: list[History]  # histories of the L loads
    feeds: Array  # what a unit of each force adds to outputs at once, (S, m, H)
    forces: list[History]  # histories of the H forces, some of which are loads of the ground

    @classmethod
    def of_system(cls, system: LinearSystem, names: Sequence[str], points: Array) -> PointModes:
        """Return the modes of a structure at S points, whose inputs have the given names.

        In coordinates y = (Ω η, η̇) of the undamped modes, q = Φ η with Φᵀ M Φ = 1 and the
        frequencies Ω, the structure is ẏ = A y, A = [[0, Ω], [−Ω, −ΦᵀDΦ]]. Without damping A is
        skew-symmetric, so that its modes are well conditioned.

        Args:
            system: The structure.
            names: Names of its inputs; other parameters are nominal.
            points: Values of the inputs, shape (S, inputs), in SI units.

        Raises:
            UnprovedError: The stiffness lets the structure drift, or modes are nearly defective.
            numpy.linalg.LinAlgError: A mass matrix is not positive definite.
        """
        matrices, rows = evaluate(system, names, points, derivatives=False)
        squared, shapes = undamped_modes(matrices.mass.value, matrices.stiffness.value)
        if not (squared[:, 0] > 0).all():
            raise UnprovedError("a mode does not oscillate", "hold the structure by springs")
        omega = np.sqrt(squared)
        n = omega.shape[-1]
        transposed = shapes.swapaxes(-1, -2)
        damping = transposed @ matrices.damping.value @ shapes
        to_modes = transposed @ matrices.mass.value
        displacement_rows, velocity_rows = np.split(rows.value @ _twice(shapes), 2, axis=-1)
        start_displacement, start_velocity = np.split(matrices.start.value, 2, axis=1)
        pushes = to_modes @ matrices.pushes(ground=system.ground is not None).value
        start_displacement = to_modes @ start_displacement
        start_velocity = to_modes @ start_velocity

        decay = np.einsum("skk->sk", damping) / 2
        coupling = np.abs(damping - 2 * decay[:, np.newaxis] * np.eye(n)).max()
        is_classical = coupling <= 1e-13 * 2 * np.abs(decay).max()
        # frequencies below 1e-3 of the undamped ones would lose three digits
        if is_classical and (squared - decay**2 > 1e-6 * squared).all():
            # η = Im(z/ω) with ż = σ z + force, z(0) = η̇₀ − σ̄ η₀
            damped = np.sqrt(squared - decay**2)
            sigma = -decay + 1j * damped
            columns = sigma[..., np.newaxis]
            of_start = start_velocity - columns.conj() * start_displacement
            starts = np.concatenate([of_start, pushes], axis=-1)
            outputs = displacement_rows + velocity_rows * sigma[:, np.newaxis]
            outputs = outputs / (1j * damped[:, np.newaxis])
        else:
            state = np.zeros((len(omega), 2 * n, 2 * n))
            place = np.arange(n)
            state[:, place, n + place] = omega
            state[:, n + place, place] = -omega
            state[:, n:, n:] = -damping
            sigma, vectors = np.linalg.eig(state.astype(complex))
            # Rounding grows with the square of the condition of the modes, above 1e4 beyond 1e-8.
            if not np.linalg.cond(vectors).max() < 1e4:
                raise UnprovedError("modes are nearly defective", "take less or more damping")
            on_state = np.concatenate(
                [displacement_rows / omega[:, np.newaxis], velocity_rows], axis=-1
            )
            started = np.concatenate(
                [omega[..., np.newaxis] * start_displacement, start_velocity], axis=1
            )
            pushed = np.concatenate([0 * pushes, pushes], axis=1)
            order = np.argsort(-sigma.imag, axis=-1, kind="stable")
            sigma = np.take_along_axis(sigma, order, -1)
            vectors = np.take_along_axis(vectors, order[:, np.newaxis], -1)
            starts = np.linalg.solve(vectors, np.concatenate([started, pushed], axis=-1))
            # Of conjugate pairs the upper ones stay, with twice their outputs; real modes stay.
            weight = 1 + np.sign(
                np.where(np.abs(sigma.imag) < 1e-12 * omega[:, -1:], 0, sigma.imag)
            )
            outputs = weight[:, np.newaxis] * (on_state @ vectors)
            kept = int((weight > 0).sum(axis=-1).max())
            sigma = sigma[:, :kept]
            outputs = outputs[..., :kept]
            starts = starts[:, :kept]
        feeds = np.zeros((len(points), outputs.shape[1], 0))
        forces = list[History]()
        if matrices.feeds is not None:
            feeds = matrices.feeds.value
            forces = distinct_histories(system.loads)
        loads = list(histories(system).values())
        return cls(sigma, outputs, starts, loads, feeds, forces)

    def values(self, point: Ints, node: Ints, output: Ints, time: Array) -> Array:
        """Return one output at one point and time node for each of N rows, shape (N,).

        Args:
            point: Index of the point of each row, shape (N,).
            node: Index of the time node of each row, shape (N,).
            output: Index of the output of each row, shape (N,).
            time: All nodes, rising, shape (T,), in s.

        Raises:
            UnprovedError: A mode turns too far within a sample interval of a load, or grows too
                much.
        """
        sigma = self.sigma[point]
        at_output = self.outputs[point, output]
        starts = self.starts[point]
        wave = np.exp(sigma * time[node, np.newaxis])
        total = (at_output * starts[..., 0] * wave).real.sum(axis=-1)
        for k, load in enumerate(self.loads, start=1):
            rho = responses_at_nodes(sigma, load, time, node=node)
            total += (at_output * starts[..., k] * rho[0]).real.sum(axis=-1)
        for k, force in enumerate(self.forces):
            total += self.feeds[point, output, k] * force.values(time[node])
        return np.asarray(total)

    def response(self, time: Array) -> Array:
        """Return all outputs of the first point at T rising times in s, shape (T, m)."""
        sigma = self.sigma[0]
        waves = [np.exp(sigma * time[:, np.newaxis])]
        waves += [responses_at_nodes(sigma, load, time)[0] for load in self.loads]
        total = np.zeros((len(time), self.outputs.shape[1]))
        for wave, start in zip(waves, self.starts[0].T, strict=True):
            total += ((wave * start) @ self.outputs[0].T).real
        for force, feed in zip(self.forces, self.feeds[0].T, strict=True):
            total += np.outer(force.values(time), feed)
        return total

    def interpolation_error(self, time: Array) -> Array:
        """Bound how far the outputs of the first point lie from straight lines within steps.

        The magnitudes of all modes are added.

        Args:
            time: T rising times in s.

        Returns:
            Shape (T, m); row j belongs to the step that ends at time j, and row 0 is 0.

        Raises:
            UnprovedError: A mode turns too far within a sample interval of a load.
        """
        error = np.zeros((len(time), self.outputs.shape[1]))
        for wave, load in enumerate([None, *self.loads]):
            for k, sigma in enumerate(self.sigma[0]):
                factor = np.abs(self.outputs[0, :, k] * self.starts[0, k, wave])
                if factor.any():
                    # The bound divides by the frequency: a real σ is moved by 1e-9 of it.
                    moved = complex(sigma.real, max(sigma.imag, 1e-9 * abs(sigma)))
                    deviation = line_deviations(np.array([[moved]]), load, time, (0,))[0]
                    error += np.outer(deviation[0], factor)
        for force, feed in zip(self.forces, self.feeds[0].T, strict=True):
            error += np.outer(load_deviation(force, time), np.abs(feed))
        return error


def _twice(shapes: Array) -> Array:
    """Return block diagonal matrices of two equal blocks (S, n, n), shape (S, 2 n, 2 n)."""
    return np.asarray(np.kron(np.eye(2), shapes))
