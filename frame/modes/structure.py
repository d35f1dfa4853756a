"""Structures with classical modes over a box, and modes of any linear structure at single inputs.

Over the unit box M(u), K(u), rows and damping are Taylor models. Covered is M q̈ + D q̇ + K q = −M
ι a(t) + Σ b f(t) with D = a M + b K + 2 M Φ diag(ζ_k ω_k) Φᵀ M, whose undamped modes uncouple the
equations of motion. Other structures are refused, with the reason. A structure of one unknown has
one mode, whatever its damping.

At single inputs outputs are exact, by complex modes. An output is Re Σ_k r_k c_k ρ(t; σ_k) over
modes k: r_k is the output's row times the mode shape, c_k what the initial state or a unit of a
load gives the mode, and ρ = exp(σ t) or its Duhamel integral.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.frame.calculus.taylor_model import ORDER, TaylorModel, solve
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.records.history import History
from alphacut.frame.response.chord_deviation import Grid, line_deviations, load_deviation
from alphacut.frame.response.duhamel import responses_at_nodes
from alphacut.frame.structures.linear import (
    Assembly,
    LinearSystem,
    evaluate,
    histories,
    stack,
    undamped_modes,
)
from alphacut.frame.structures.loads import distinct_histories


class CoupledModesError(UnprovedError):
    """Undamped modes do not uncouple a structure or its outputs, and damped ones may do."""


@dataclass(frozen=True, eq=False)
class ClassicalStructure:
    """A structure with classical modes over a box of d inputs; n unknowns, m outputs."""

    mass: TaylorModel  # M, (n, n)
    stiffness: TaylorModel  # K, (n, n)
    output_rows: Array  # rows of the outputs on the displacements or a derivative, (m, n)
    output_factors: TaylorModel  # what the outputs are multiplied by, (m,)
    # derivative of the displacements that each output takes, (m,): 0, 1, or 2 for the absolute
    # acceleration
    derivative_orders: Ints
    initial_state: TaylorModel  # initial displacements, then velocities, (2, n)
    ground_pattern: Array  # ι, how the unknowns move with the ground, (n,)
    rayleigh: TaylorModel  # a and b, (2,)
    damping_ratios: TaylorModel  # ζ_k of the modes with mass by rising frequency, (modes,)
    # accelerations M⁻¹ b by each history of forces, by its name, (n,)
    force_accelerations: dict[str, TaylorModel]

    @property
    def unknowns(self) -> int:
        """Number n of unknowns."""
        return len(self.ground_pattern)

    @property
    def distinct_orders(self) -> list[int]:
        """Derivatives of the displacements that some output takes, rising."""
        return [int(order) for order in np.unique(self.derivative_orders)]


def parameter_models(
    system: LinearSystem,
    names: Sequence[str],
    midpoint: Array,
    radius: Array,
    order: int = ORDER,
    *,
    fixed: Mapping[str, float] | None = None,
) -> dict[str, TaylorModel]:
    """Return all parameters of a structure by name, as scalar Taylor models of d inputs.

    Args:
        system: The structure.
        names: Names of the inputs, d of them.
        midpoint: Midpoints of their ranges, shape (d,), in SI units.
        radius: Half-widths of their ranges, shape (d,).
        order: Order of the models.
        fixed: Values of other parameters by name, where they are not nominal.
    """
    inputs = TaylorModel.variables(midpoint, radius, order)
    values = {**system.parameters, **(fixed or {})}
    parameters = {name: inputs.like(value) for name, value in values.items()}
    return parameters | {name: inputs[i] for i, name in enumerate(names)}


def classical_structure(
    system: LinearSystem, parameters: Mapping[str, TaylorModel]
) -> ClassicalStructure:
    """Return a structure whose parameters are Taylor models, if undamped modes uncouple it.

    Initial displacements contain those under static forces, and initial velocities those by
    impulses at t = 0.

    Args:
        system: The structure.
        parameters: Value of each of its parameters, by name, as a scalar Taylor model of the
            inputs.

    Raises:
        UnprovedError: Dashpots, or damping by springs without the weights, couple the modes; an
            output row depends on the inputs or takes displacements and velocities; or mass or
            stiffness may be singular in the box.
    """
    assembly = system.assembly(parameters)
    assembly = with_classical_damping(assembly)
    displacements = assembly.q0
    velocities = assembly.v0
    if assembly.static is not None:
        displacements = displacements + solve(assembly.stiffness, assembly.static)[:, 0]
    if assembly.impulse is not None:
        velocities = velocities + _accelerations(assembly, assembly.impulse)[:, 0]
    force_accelerations = {}
    if assembly.forces is not None:
        accelerations = _accelerations(assembly, assembly.forces)
        names = [name for name in histories(system) if name != "load"]
        force_accelerations = {name: accelerations[:, k] for k, name in enumerate(names)}
    displacement_rows, velocity_rows = _constant_rows(assembly)
    takes_velocity = velocity_rows.any(axis=1)
    takes_acceleration = assembly.accelerated.any(axis=1)
    return ClassicalStructure(
        mass=assembly.mass,
        stiffness=assembly.stiffness,
        output_rows=displacement_rows + velocity_rows + assembly.accelerated,
        output_factors=assembly.row_factors,
        derivative_orders=np.where(takes_acceleration, 2, takes_velocity.astype(int)),
        initial_state=stack([displacements, velocities]).T,
        ground_pattern=assembly.pattern,
        rayleigh=stack(assembly.rayleigh),
        damping_ratios=modal_ratios(assembly),
        force_accelerations=force_accelerations,
    )


def modal_ratios(assembly: Assembly[TaylorModel]) -> TaylorModel:
    """Return the damping ratio of each mode with mass by rising frequency, shape (modes,)."""
    ratios = assembly.ratios or [assembly.rayleigh[0] * 0.0]
    if len(ratios) == 1:
        ratios = ratios * len(assembly.massive)
    return stack(ratios)


def with_classical_damping(assembly: Assembly[TaylorModel]) -> Assembly[TaylorModel]:
    """Return the structure if undamped modes uncouple it; that of one unknown without dashpots.

    Raises:
        UnprovedError: Dashpots, or damping by springs without the weights, couple the modes.
    """
    if len(assembly.pattern) == 1:
        assembly = _with_damping_by_mass(assembly)
    _require_classical(assembly)
    return assembly


def _with_damping_by_mass(assembly: Assembly[TaylorModel]) -> Assembly[TaylorModel]:
    """Return the same structure of one unknown with its dashpots as damping by the mass.

    With the dashpots d and the weights W, D = d + a M + b K_springs, and K = K_springs − W. Hence D
    = (a + (d + b W)/M) M + b K. The new structure has no dashpots and no weights, K as its springs,
    and the factor of M as Rayleigh's a.

    Args:
        assembly: Mass, springs, weights (None for none) and dashpots as Taylor models of shape (1,
            1), and Rayleigh's factors a in 1/s and b in s. Not changed.

    Raises:
        UnprovedError: The mass may be zero in the box.
    """
    a, b = assembly.rayleigh
    dashpots = assembly.dashpots
    if assembly.weights is not None:
        dashpots = dashpots + assembly.weights * b
    return replace(
        assembly,
        springs=assembly.stiffness,
        weights=None,
        dashpots=dashpots * 0.0,
        rayleigh=(a + solve(assembly.mass, dashpots)[0, 0], b),
    )


def _accelerations(assembly: Assembly[TaylorModel], forces: TaylorModel) -> TaylorModel:
    """Return accelerations M⁻¹ b by forces b, shape (n, k); zero for unknowns without mass."""
    massive = assembly.massive
    mass = assembly.mass[massive[:, np.newaxis], massive]
    selection = np.eye(len(assembly.pattern))[:, massive]
    return selection @ solve(mass, forces[massive])


def _require_classical(assembly: Assembly[TaylorModel]) -> None:
    """Check that damping does not couple the undamped modes of a structure.

    Args:
        assembly: The structure; its dashpots must be zero, and Rayleigh's factor of the springs,
            too, where weights reduce its stiffness (P-Delta).

    Raises:
        UnprovedError: The dashpots or this factor may differ from zero in the box.
    """
    if assembly.dashpots.magnitude().any():
        raise CoupledModesError(
            "dashpots couple the modes", "give damping ratios or Rayleigh's factors in their place"
        )
    if assembly.weights is not None and assembly.rayleigh[1].magnitude() > 0:
        raise CoupledModesError(
            "Rayleigh's damping by the springs without the weights couples the modes",
            "give a damping ratio, or leave gravity out",
        )


def _constant_rows(assembly: Assembly[TaylorModel]) -> tuple[Array, Array]:
    """Return the rows of m outputs on n displacements and on their velocities, shape (m, n) each.

    Args:
        assembly: `rows` holds the coefficients on displacements and then velocities, (m, 2n):
            numbers, or a Taylor model where they depend on inputs.

    Raises:
        UnprovedError: Rows depend on inputs, as only those of a frame's overturning moment do, or
            an output takes two of displacements, velocities and accelerations.
    """
    if not isinstance(assembly.rows, np.ndarray):
        cure = "take the method proof with few inputs, or leave the overturning moment out"
        raise CoupledModesError("the overturning moment adds storeys by factors of inputs", cure)
    displacements, velocities = np.split(assembly.rows, 2, axis=1)
    derivatives = [displacements, velocities, assembly.accelerated]
    taken = np.count_nonzero([rows.any(axis=1) for rows in derivatives], axis=0)
    if (taken > 1).any():
        what = "an output mixes displacements, velocities or accelerations"
        raise CoupledModesError(what, "observe them apart")
    return displacements, velocities


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
                    omega = np.array([max(sigma.imag, 1e-9 * abs(sigma))])
                    grid = Grid(omega, -sigma.real / omega)
                    deviation = line_deviations(grid, load, time, (0,))[0]
                    error += np.outer(deviation[0], factor)
        for force, feed in zip(self.forces, self.feeds[0].T, strict=True):
            error += np.outer(load_deviation(force, time), np.abs(feed))
        return error


def _twice(shapes: Array) -> Array:
    """Return block diagonal matrices of two equal blocks (S, n, n), shape (S, 2 n, 2 n)."""
    return np.asarray(np.kron(np.eye(2), shapes))
