"""Responses of a structure with classical modes at single inputs, and bounds of their rounding.

An output is Σ_k r_k c_k e(λ_k) over modes k of unit modal mass: r_k is the output's row times the
mode shape, c_k the mode's participation factor for a source, and e the response of its oscillator.
Computed modes X and λ are the exact ones of a pencil nearby: Xᵀ K X = diag λ + E and Xᵀ M X = I +
F, where the entries of E and F are bounded by the computed residuals and their γ_n (Higham 2002,
section 3.5). With G = |E| + |F| diag λ the outputs are off, to first order, by at most

    Σ_jk |r_j| G_jk |e[λ_j, λ_k]| |c_k| + Σ_jk |r_j e_j| |F_jk| |c_k|,

where e[·, ·] is a divided difference; this holds for close modes too. The entry of the slowest mode
in G is some n ε ω_max², so that its frequency has a relative error of n ε (ω_max/ω₁)². Rounding of
the response itself comes from the recursion over the record.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.frame.calculus.rounding import UNIT_ROUNDOFF, gamma
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.structure import ClassicalStructure
from alphacut.frame.modes.truncated_modes import response_slopes
from alphacut.frame.records.history import History
from alphacut.frame.response.duhamel import absolute_moments, responses_at_nodes
from alphacut.frame.response.oscillators import read_response
from alphacut.frame.structures.linear import LinearSystem, evaluate, histories, undamped_modes


class RoundedValues(NamedTuple):
    """Computed values, and bounds of their rounding in the same shape."""

    value: Array
    error: Array


@dataclass(frozen=True, eq=False)
class PointModes:
    """Modes of a structure at S points, with bounds of what rounding leaves of the pencil."""

    eigenvalues: Array  # λ, (S, n), rising, in 1/s²
    sigma: Array  # exponents −g + iω, (S, n), in 1/s
    has_one_ratio: Mask  # whether all modes of a point have one damping ratio, (S,)
    shapes: Array  # displacements of the modes, of unit modal mass, (S, unknowns n, modes n)
    participation: dict[str, RoundedValues]  # c of each source, by its name, (S, n)
    stiffness_error: Array  # G, (S, n, n)
    mass_error: Array  # |F|, (S, n, n)
    output_rows: Array  # rows of all outputs on the state, (S, m, 2 n)
    structure: ClassicalStructure  # the structure over the box
    entry_roundings: int  # of an entry of M, K and of output rows; see `LinearSystem`

    @property
    def sigma_slope(self) -> Array:
        """Bound of |dσ/dλ|, shape (S, n), in s; see `truncated_modes.response_slopes`."""
        return np.asarray(1 / (2 * self.sigma.imag))

    def output_coefficients(self, point: Ints, output: Ints) -> RoundedValues:
        """Return the coefficients r of n modes in one output at one point for each of N rows.

        r is the output's row times the mode shape. Outputs take displacements, velocities (order 1)
        or absolute accelerations (order 2) of the unknowns.

        Args:
            point: Index of the point of each row, shape (N,).
            output: Index of the output of each row, shape (N,).

        Returns:
            `value` and `error`, a bound of its rounding, shape (N, n) each.
        """
        n = self.shapes.shape[-1]
        order = self.structure.derivative_orders[output][:, np.newaxis]
        on_state = self.output_rows[point, output]
        rows = np.where(order == 1, on_state[:, n:], on_state[:, :n])
        # Accelerations are outputs of structures whose unknowns all have mass.
        rows = np.where(order == 2, self.structure.output_rows[output, :n], rows)
        shapes = self.shapes[point]
        value = np.einsum("si,sik->sk", rows, shapes)
        magnitude = np.einsum("si,sik->sk", np.abs(rows), np.abs(shapes))
        return RoundedValues(value, gamma(n + self.entry_roundings) * magnitude)


def modes_at(
    system: LinearSystem,
    structure: ClassicalStructure,
    names: Sequence[str],
    points: Array,
    unit: Array,
) -> PointModes:
    """Return the modes of a structure at S values of its inputs, with bounds of their rounding.

    Args:
        system: The structure.
        structure: The structure over the box. Damping is taken from it, but for a single mode.
        names: Names of the inputs.
        points: Values of the inputs, shape (S, inputs), in SI units.
        unit: The same values in the unit coordinates of the box, shape (S, d).

    Raises:
        UnprovedError: A mode does not oscillate.
    """
    matrices, rows = evaluate(system, names, points, derivatives=False, by_ratios=False)
    M = matrices.mass.value
    K = matrices.stiffness.value
    n = M.shape[-1]
    eigenvalues, shapes = undamped_modes(M, K)
    a, b = structure.rayleigh.at(unit).T[:, :, np.newaxis]
    decay = (a + b * eigenvalues) / 2
    if n == 1:
        # The factor a contains the dashpots over the mass, and is no polynomial of the inputs.
        decay = matrices.damping.value[..., 0] / M[..., 0] / 2
    ratios = structure.damping_ratios.at(unit)
    decay = decay + ratios * np.sqrt(np.maximum(eigenvalues, 1e-300))
    if not (eigenvalues > decay**2).all():
        raise UnprovedError("a mode may not oscillate", "take less damping, and hold the structure")

    # What each source sets in motion: displacements or velocities v, with c = φ·M v.
    q0, v0 = np.split(matrices.start.value[..., 0], 2, axis=-1)
    patterns = {"velocity": v0, "start": q0}
    impulses = matrices.pushes(ground=False).value
    forces = [name for name in histories(system) if name != "load"]
    for k, name in enumerate(forces):
        patterns[name] = impulses[..., k]
    if system.ground is not None:
        patterns["load"] = np.broadcast_to(matrices.rigid[:, 0], eigenvalues.shape)
    entry_roundings = system.entry_roundings
    participation = {}
    for name, v in patterns.items():
        value = np.einsum("sik,sij,sj->sk", shapes, M, v, optimize=True)
        magnitude = np.einsum("sik,sij,sj->sk", np.abs(shapes), np.abs(M), np.abs(v), optimize=True)
        error = gamma(2 * n + 2 * entry_roundings) * magnitude
        participation[name] = RoundedValues(value, error)

    unit_masses = np.ones_like(eigenvalues)
    mass_error = _residual(shapes, M, unit_masses, entry_roundings=entry_roundings)
    stiffness_error = _residual(shapes, K, eigenvalues, entry_roundings=entry_roundings)
    stiffness_error += mass_error * eigenvalues[:, np.newaxis]
    stiffness_error += gamma(8) * eigenvalues[:, np.newaxis] * np.eye(n)  # of σ from λ
    return PointModes(
        eigenvalues=eigenvalues,
        sigma=-decay + 1j * np.sqrt(eigenvalues - decay**2),
        has_one_ratio=(ratios == ratios[:, :1]).all(axis=1),
        shapes=shapes,
        participation=participation,
        stiffness_error=stiffness_error,
        mass_error=mass_error,
        output_rows=rows.value,
        structure=structure,
        entry_roundings=entry_roundings,
    )


def _residual(shapes: Array, matrix: Array, diagonal: Array, *, entry_roundings: int) -> Array:
    """Bound |Xᵀ A X − diag d| for the exact matrix A, entry by entry, shape (S, n, n).

    The bound contains the rounding of the products and that of the entries of A.

    Args:
        shapes: X at S points, shape (S, n, n), one mode in each column.
        matrix: A with rounded entries, shape (S, n, n).
        diagonal: d, shape (S, n).
        entry_roundings: Number of roundings of an entry of A.
    """
    n = shapes.shape[-1]
    transposed = shapes.swapaxes(-1, -2)
    residual = transposed @ matrix @ shapes - diagonal[:, np.newaxis] * np.eye(n)
    magnitude = np.abs(transposed) @ np.abs(matrix) @ np.abs(shapes)
    return np.asarray(np.abs(residual) + gamma(2 * n + entry_roundings) * magnitude)


@dataclass(frozen=True, eq=False)
class LoadAtNodes:
    """Responses ρ = ∫ exp(σ (t − s)) f(s) ds of n oscillators to a load f, each row at a node."""

    rho: Array  # ρ and its derivative ρ′ by σ, (2, N, n)
    error: Array  # bounds of the rounding of ρ, (N, n)
    impulse: Array  # bound of |ρ| for any σ that does not grow, ∫ |f| up to the node, (N,)
    value: Array  # f, (N,)


def load_at_nodes(
    sigma: Array, load: History, time: Array, node: Ints | None = None
) -> LoadAtNodes:
    """Return the responses ρ = ∫ exp(σ (t − s)) f(s) ds of oscillators to a load f at time nodes.

    Args:
        sigma: Exponents σ = −decay + i frequency of n oscillators, in 1/s: shape (N, n), each row
            for its node, or (n,) for all nodes.
        load: The load f.
        time: All nodes, shape (T,), in s.
        node: Index of the node of each row, shape (N,); all nodes, N = T, unless given.

    Returns:
        `rho`, ρ and dρ/dσ, shape (2, N, n); `error`, bounds of the rounding of ρ, shape (N, n);
        `impulse`, a bound of ∫ |f| up to the node, and `value`, f at the node, shape (N,) each.

    Raises:
        UnprovedError: An oscillator turns too far within a sample interval of the load, or grows
            too much.
    """
    at = slice(None) if node is None else node
    impulse = absolute_moments(0.0, load, time)[0]
    rho, error = responses_at_nodes(sigma, load, time, 1, node=node)
    return LoadAtNodes(rho, error, impulse[at], load.values(time[at]))


def outputs_at(
    modes: PointModes, point: Ints, output: Ints, time: Array, loads: Mapping[str, LoadAtNodes]
) -> RoundedValues:
    """Return one output at one point and time node for each of N rows, exact but for rounding.

    An output is Σ_k r_k c_k e_k over n modes: coefficient of the mode in the output, participation
    factor of the source, and response of the mode's oscillator; sources add up.

    Args:
        modes: Modes at all points.
        point: Index of the point of each row, shape (N,).
        output: Index of the output of each row, shape (N,).
        time: Time of the node of each row, shape (N,), in s.
        loads: Responses of the oscillators to each load at these points and nodes, by the name of
            the load; initial velocities and displacements need none.

    Returns:
        `value` in the units of the outputs and `error`, a bound of its rounding, shape (N,) each.
        Where rounding may shift the phase of a mode by a radian, the bound is huge.
    """
    sigma = modes.sigma[point]
    t = time[:, np.newaxis]
    exponential = np.exp(sigma * t)
    # A free response is ρ = exp(σ t), that to a unit impulse at the start.
    free = LoadAtNodes(
        rho=np.stack([exponential, t * exponential]),
        error=(gamma(4) + UNIT_ROUNDOFF * np.abs(sigma) * t) * np.abs(exponential),
        impulse=np.ones_like(time),
        value=np.zeros_like(time),
    )
    coefficients = modes.output_coefficients(point, output)
    orders = modes.structure.derivative_orders[output]
    total = np.zeros(len(point))
    error = np.zeros(len(point))
    for source, load in {"velocity": free, "start": free, **loads}.items():
        response = _mode_responses(sigma, orders, source, load, t)
        of_source = modes.participation[source]
        participation = RoundedValues(of_source.value[point], of_source.error[point])
        total += (coefficients.value * participation.value * response.value).sum(axis=-1)
        error += _superposition_error(modes, point, coefficients, participation, response)
    # Terms of second order in the residuals are at most this fraction of those of first order.
    diagonal = np.einsum("skk->sk", modes.stiffness_error[point])
    fraction = (diagonal * modes.sigma_slope[point] * t).max(axis=-1)
    return RoundedValues(total, error / np.maximum(1 - fraction, 1e-300))


class _ModeResponses(NamedTuple):
    """Responses e of n oscillators at N points and nodes, shape (N, n) each."""

    value: Array  # e
    error: Array  # bound of its rounding
    slope: Array  # bound of |de/dλ| at the eigenvalue of the mode
    slope_anywhere: Array  # bound of |de/dλ| at any eigenvalue of the same damping


def _mode_responses(
    sigma: Array, orders: Ints, source: str, load: LoadAtNodes, time: Array
) -> _ModeResponses:
    """Return the responses e of oscillators to one source, with bounds of rounding and of slopes.

    Args:
        sigma: Exponents σ = −decay + i frequency of n oscillators at N points, shape (N, n), in
            1/s.
        orders: Derivative by time of the displacements that the output of each row takes, shape
            (N,): 0, 1 or 2.
        source: "load" (the ground), "force1", …, "velocity" or "start" (initial displacements).
        load: ρ = ∫ exp(σ (t − s)) f(s) ds of the source with its derivative by σ, or exp(σ t) for
            an initial state.
        time: Times of the nodes, shape (N, 1), in s.

    Returns:
        `value` of e, `error`, a bound of its rounding, and bounds of |de/dλ| by the eigenvalue λ =
        |σ|²: `slope` at the mode itself and `slope_anywhere` at any eigenvalue of the same damping;
        shape (N, n) each.
    """
    omega = sigma.imag
    magnitude = np.abs(sigma)
    order = orders[:, np.newaxis]
    # The response is read off G = σ^ν ρ, where ν is the order.
    power = magnitude**order
    power_slope = order * magnitude ** np.maximum(order - 1, 0)
    G = sigma**order * load.rho[0]
    error = power * load.error + gamma(2 * order.max() + 6) * np.abs(G)
    feedthrough = np.zeros_like(time)
    if source.startswith("force"):  # of the relative acceleration
        feedthrough = np.where(order == 2, load.value[:, np.newaxis], 0.0)

    # Bounds of |G| and |dG/dσ| at the mode, and at any σ that does not grow, where |ρ| ≤ ∫ |f| and
    # |ρ′| ≤ t ∫ |f|.
    quotient = -sigma.real / omega

    def slope_bound(rho: Array, rho_slope: Array) -> Array:
        G_slope = power_slope * rho + power * rho_slope
        return response_slopes(source, power * rho, G_slope, omega, quotient)

    impulse = load.impulse[:, np.newaxis]
    error = error * (1 + quotient) if source == "start" else error / omega
    return _ModeResponses(
        value=read_response(source, sigma, G) + feedthrough,
        error=error + gamma(8) * np.abs(feedthrough),
        slope=slope_bound(np.abs(load.rho[0]), np.abs(load.rho[1])),
        slope_anywhere=slope_bound(impulse, time * impulse),
    )


def _superposition_error(
    modes: PointModes,
    point: Ints,
    coefficients: RoundedValues,
    participation: RoundedValues,
    response: _ModeResponses,
) -> Array:
    """Bound the rounding of Σ_k r_k c_k e_k, shape (N,), which computed modes and products cause.

    Computed modes are exact for a stiffness and a mass nearby, whose differences couple modes j and
    k by |r_j| G_jk |e[λ_j, λ_k]| |c_k| and |r_j e_j| |F_jk| |c_k|, e[·, ·] a divided difference.

    Args:
        modes: Modes at all points, with G, F and the eigenvalues λ.
        point: Index of the point of each row, shape (N,).
        coefficients: r of n modes in the output of each row, with rounding, shape (N, n).
        participation: c of the source, with rounding, shape (N, n).
        response: e with rounding, and bounds of |de/dλ|, shape (N, n).
    """
    r = np.abs(coefficients.value)
    c = np.abs(participation.value)
    e = np.abs(response.value)
    n = e.shape[-1]
    error = r * c * response.error
    error += (coefficients.error * c + r * participation.error) * e
    error = error.sum(axis=-1)
    error += gamma(n + 6) * (r * c * e).sum(axis=-1)

    # The divided difference e[λ_j, λ_k] is at most (|e_j| + |e_k|) / |λ_j − λ_k|, and between modes
    # of one damping ratio at most sup |de/dλ|.
    eigenvalues = modes.eigenvalues[point]
    gaps = np.abs(eigenvalues[:, :, np.newaxis] - eigenvalues[:, np.newaxis])
    sums = e[:, :, np.newaxis] + e[:, np.newaxis]
    by_gap = np.divide(sums, gaps, out=np.full_like(gaps, np.inf), where=gaps > 0)
    anywhere = response.slope_anywhere
    by_slope = np.maximum(anywhere[:, :, np.newaxis], anywhere[:, np.newaxis])
    has_one_ratio = modes.has_one_ratio[point][:, np.newaxis, np.newaxis]
    by_slope = np.where(has_one_ratio, by_slope, np.inf)
    is_diagonal = np.eye(n, dtype=bool)
    of_mode = response.slope[:, np.newaxis]
    divided_differences = np.where(is_diagonal, of_mode, np.minimum(by_gap, by_slope))

    couplings = modes.stiffness_error[point] * divided_differences
    error += np.einsum("sj,sjk,sk->s", r, couplings, c, optimize=True)
    error += np.einsum("sj,sjk,sk->s", r * e, modes.mass_error[point], c, optimize=True)
    return np.asarray(error)
