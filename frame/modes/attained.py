"""Responses of a structure with classical modes at single inputs, and bounds of their rounding.

An output is Σ_k r_k c_k e(λ_k), over modes of unit mass: r the output's coefficient of mode k,
c the mode's participation in a source, e the response of its oscillator. Computed modes X and λ
are the exact ones of a pencil near by: Xᵀ K X = diag λ + E and Xᵀ M X = I + F, whose entries are
bounded by the computed residuals and their γ_n (Higham 2002, section 3.5). With
G = |E| + |F| diag λ the outputs are off, to first order, by

    Σ_jk |r_j| G_jk |e[λ_j, λ_k]| |c_k| + Σ_jk |r_j e_j| |F_jk| |c_k|,

e[·, ·] a divided difference, which holds for close modes too. The entry of the slowest mode in G is
some n ε ω_max², so that its frequency is off by a share of n ε (ω_max/ω₁)². Rounding of the
response itself comes from the walk over the record.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from alphacut.frame.calculus.rounding import UNIT_ROUNDOFF, gamma
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.structure import Classical
from alphacut.frame.response.duhamel import (
    absolute_moments,
    responses_at_given_nodes,
    responses_at_nodes,
)
from alphacut.frame.structures.linear import LinearSystem, evaluate, histories
from alphacut.frame.structures.loads import History
from alphacut.fuzzy.arrays import Array, Mask, Rows

ENTRY_ROUNDINGS = 8
"""Roundings of an entry of M, K and of output rows, as a stiffness 12 c E I / l³ takes."""


@dataclass(frozen=True, eq=False)
class Modal:
    """Modes of a structure at S points, with bounds of what rounding leaves of the pencil.

    Args:
        squared: λ, shape (S, n), rising, in 1/s².
        sigma: Exponents −g + iω, shape (S, n), in 1/s.
        sigma_slope: Bound of |dσ/dλ|, the same shape.
        is_alike: Whether all modes of a point have one ratio of damping, shape (S,).
        shape: Displacements of the modes, of unit mass, shape (S, n, n).
        share: c of each source, by its name, shape (S, n).
        share_error: Bounds of their rounding.
        stiffness_error: G, shape (S, n, n).
        mass_error: |F|, shape (S, n, n).
        rows: Rows of all outputs on the state, shape (S, m, 2 n).
        order: Which derivative of the displacements each output reads, shape (m,).
        accelerated: What those of order 2 read of the accelerations, shape (m, n).
    """

    squared: Array
    sigma: Array
    sigma_slope: Array
    is_alike: Mask
    shape: Array
    share: dict[str, Array]
    share_error: dict[str, Array]
    stiffness_error: Array
    mass_error: Array
    rows: Array
    order: Rows
    accelerated: Array

    def output_coefficients(self, point: Rows, output: Rows) -> tuple[Array, Array]:
        """Coefficients r of modes in outputs (N,) at points (N,), and their rounding, (N, n)."""
        n, order = self.shape.shape[-1], self.order[output][:, None]
        rows, shape = self.rows[point, output], self.shape[point]
        row = np.where(order == 1, rows[:, n:], rows[:, :n])
        row = np.where(order == 2, self.accelerated[output], row)
        size = np.einsum("si,sik->sk", np.abs(row), np.abs(shape))
        coefficients = np.einsum("si,sik->sk", row, shape)
        return coefficients, gamma(n + ENTRY_ROUNDINGS) * size


def modes_at(
    system: LinearSystem,
    structure: Classical,
    names: Sequence[str],
    points: Array,
    unit: Array,
) -> Modal:
    """Modes of a structure at S values of its inputs `names`, with bounds of their rounding.

    The values are `points` (S, inputs) in SI units, and `unit` (S, d) in the unit coordinates of
    the box of `structure`, from which damping is taken.

    Raises:
        UnprovedError: A mode does not oscillate.
    """
    matrices, rows = evaluate(system, names, points, derivatives=False, by_ratios=False)
    M, K = matrices.mass.value, matrices.stiffness.value
    inverse_factor = np.linalg.inv(np.linalg.cholesky(M))
    transposed = inverse_factor.swapaxes(-1, -2)
    squared, U = np.linalg.eigh(inverse_factor @ K @ transposed)
    shape = transposed @ U
    a, b = structure.rayleigh.at(unit).T[:, :, None]
    ratio, positive = structure.ratio.at(unit), np.maximum(squared, 1e-300)
    decay = (a + b * squared) / 2 + ratio * np.sqrt(positive)
    if not (squared > decay**2).all():
        raise UnprovedError("a mode may not oscillate", "take less damping, and hold the structure")
    omega, decay_slope = np.sqrt(squared - decay**2), b / 2 + ratio / (2 * np.sqrt(positive))
    sigma_slope = decay_slope + np.abs(1 - 2 * decay * decay_slope) / (2 * omega)
    share, share_error, n = {}, {}, M.shape[-1]
    q0, v0 = np.split(matrices.start.value[..., 0], 2, axis=-1)
    patterns, pushes = {"velocity": v0, "start": q0}, matrices.pushes(ground=False).value
    for name, number in _numbers(system).items():
        patterns[name] = pushes[..., number]
    if system.ground is not None:
        patterns["load"] = np.broadcast_to(matrices.rigid[:, 0], squared.shape)
    for name, x in patterns.items():
        share[name] = np.einsum("sik,sij,sj->sk", shape, M, x, optimize=True)
        sizes = (np.abs(part) for part in (shape, M, x))
        size = np.einsum("sik,sij,sj->sk", *sizes, optimize=True)
        share_error[name] = gamma(2 * n + 2 * ENTRY_ROUNDINGS) * size
    of_stiffness, of_mass = _residual(shape, K, squared), _residual(shape, M, np.ones_like(squared))
    of_stiffness += of_mass * squared[:, None]
    of_stiffness += gamma(8) * squared[:, None] * np.eye(n)  # of σ from λ
    return Modal(
        squared=squared,
        sigma=-decay + 1j * omega,
        sigma_slope=sigma_slope,
        is_alike=(ratio == ratio[:, :1]).all(1),
        shape=shape,
        share=share,
        share_error=share_error,
        stiffness_error=of_stiffness,
        mass_error=of_mass,
        rows=rows.value,
        order=structure.order,
        # accelerations are read of structures whose unknowns all have mass
        accelerated=structure.rows[:, :n],
    )


def _numbers(system: LinearSystem) -> dict[str, int]:
    """Places of the forces' names among the forces."""
    return {name: i for i, name in enumerate(x for x in histories(system) if x != "load")}


def _residual(shape: Array, matrix: Array, diagonal: Array) -> Array:
    """Bound of |Xᵀ A X − diag| for the exact A, with the rounding of its product, (S, n, n)."""
    n, across = shape.shape[-1], shape.swapaxes(-1, -2)
    residual = across @ matrix @ shape - diagonal[:, None] * np.eye(n)
    size = np.abs(across) @ np.abs(matrix) @ np.abs(shape)
    return np.asarray(np.abs(residual) + gamma(2 * n + ENTRY_ROUNDINGS) * size)


@dataclass(frozen=True, eq=False)
class AttainedWaves:
    """Responses e of all modes to one source, at a node for each of N points, each (N, n).

    Args:
        value: e.
        error: Bound of its rounding.
        slope: Bound of |de/dλ| at the modes, λ the squared undamped angular frequency.
        slope_anywhere: The same at any λ, from bounds of ρ at any σ that does not grow.
    """

    value: Array
    error: Array
    slope: Array
    slope_anywhere: Array


def _waves(
    source: str,
    sigma: Array,
    sigma_slope: Array,
    order: Rows,
    rho: tuple[Array, ...],
    rho_bounds: Array,
) -> AttainedWaves:
    """Responses e of all modes to one source, with bounds of their rounding and of |de/dλ|.

    With G = σ^order ρ(σ; t), e is Re G + (γ/ω) Im G for a start, γ = −Re σ, and Im G/ω for the
    other sources, with the other sign for the ground's acceleration, which acts as −M a.

    Args:
        source: "load" (the ground), "velocity", "start" or the name of a force.
        sigma: Exponents σ of the n modes at N points, shape (N, n), in 1/s.
        sigma_slope: Bound of |dσ/dλ|, λ = |σ|² undamped, shape (N, n).
        order: Derivative of the motion that is read, shape (N,).
        rho: ρ(σ; t), its derivative by σ, and the rounding of ρ, each (N, n).
        rho_bounds: Bounds of |ρ| and |ρ′| at any σ that does not grow, shape (2, N).
    """
    value, slope, error = rho
    omega, order, size = sigma.imag, order[:, None], np.abs(sigma)
    power, power_slope = size**order, order * size ** np.maximum(order - 1, 0)
    G = sigma**order * value
    G_slope = power_slope * np.abs(value) + power * np.abs(slope)
    G_bound = power * rho_bounds[0][:, None]
    G_slope_bound = power_slope * rho_bounds[0][:, None] + power * rho_bounds[1][:, None]
    error = power * error + gamma(2 * order.max() + 6) * np.abs(G)
    quotient = -sigma.real / omega
    if source == "start":
        quotient_slope = sigma_slope * (1 + quotient) / omega
        return AttainedWaves(
            value=G.real + quotient * G.imag,
            error=(1 + quotient) * error,
            slope=sigma_slope * (1 + quotient) * G_slope + quotient_slope * np.abs(G),
            slope_anywhere=sigma_slope * (1 + quotient) * G_slope_bound + quotient_slope * G_bound,
        )
    sign = -1.0 if source == "load" else 1.0
    return AttainedWaves(
        value=sign * G.imag / omega,
        error=error / omega,
        slope=sigma_slope * (G_slope / omega + np.abs(G) / omega**2),
        slope_anywhere=sigma_slope * (G_slope_bound / omega + G_bound / omega**2),
    )


def outputs_at(
    modal: Modal,
    point: Rows,
    output: Rows,
    time: Array,
    loads: Mapping[str, LoadAtNodes],
) -> tuple[Array, Array]:
    """Exact values of outputs at points and nodes, and bounds of their rounding, (N,) each.

    A value is Σ_k r_k c_k e_k over modes k and sources: r the output's coefficient of the mode, c
    the source's participation in it, e the response of its oscillator.

    Args:
        modal: Modes at all points.
        point: Point of each value, shape (N,).
        output: Output of each value, shape (N,).
        time: Node of each value, shape (N,), in s.
        loads: The loads by name.
    """
    sigma, sigma_slope, t = modal.sigma[point], modal.sigma_slope[point], time[:, None]
    free = np.exp(sigma * t)
    of_free = free, t * free, (gamma(4) + UNIT_ROUNDOFF * np.abs(sigma) * t) * np.abs(free)
    free_bounds = np.stack([np.ones_like(time), time])
    rho = {"velocity": of_free, "start": of_free}
    rho_bounds = {"velocity": free_bounds, "start": free_bounds}
    for name, load in loads.items():
        rho[name] = load.rho[0], load.rho[1], load.error
        rho_bounds[name] = np.stack([load.impulse, time * load.impulse])
    read, read_error = modal.output_coefficients(point, output)
    total, total_error = np.zeros(len(point)), np.zeros(len(point))
    for source, values in rho.items():
        order, bounds = modal.order[output], rho_bounds[source]
        wave = _waves(source, sigma, sigma_slope, order, values, bounds)
        if source.startswith("force"):
            direct = np.where(order == 2, loads[source].value, 0.0)
            error = wave.error + gamma(8) * np.abs(direct)[:, None]
            wave = replace(wave, value=wave.value + direct[:, None], error=error)
        share, share_error = modal.share[source][point], modal.share_error[source][point]
        total += (read * share * wave.value).sum(-1)
        total_error += _error(modal, point, (read, read_error), (share, share_error), wave)
    # terms of second order in the residuals are at most this fraction of those of first order
    second_order = (np.einsum("skk->sk", modal.stiffness_error[point]) * sigma_slope * t).max(-1)
    return total, total_error / np.maximum(1 - second_order, 1e-300)


def _error(
    modal: Modal,
    point: Rows,
    read: tuple[Array, Array],
    share: tuple[Array, Array],
    wave: AttainedWaves,
) -> Array:
    """Bound of the rounding of Σ_k r_k c_k e_k over the modes k, shape (N,).

    Besides the rounding of the factors it bounds the effect of the residuals of the computed modes:
    the residual coupling of modes j and k times the difference quotient of e between them or, where
    that is less, a bound of |de/dλ|.

    Args:
        modal: Modes at all points.
        point: Point of each value, shape (N,).
        read: Output coefficients r and their rounding, each (N, n).
        share: Participations c in the source and their rounding, each (N, n).
        wave: Responses e.
    """
    (r, r_error), (c, c_error) = (tuple(np.abs(x) for x in pair) for pair in (read, share))
    e, n = np.abs(wave.value), wave.value.shape[-1]
    error = (r * c * wave.error + (r_error * c + r * c_error) * e).sum(-1)
    error += gamma(n + 6) * (r * c * e).sum(-1)
    squared, anywhere = modal.squared[point], wave.slope_anywhere
    gaps = np.abs(squared[:, :, None] - squared[:, None])
    # slopes hold between modes of one damping ratio alone
    of_ratios = np.where(modal.is_alike[point][:, None, None], 0.0, np.inf)
    cap = of_ratios + np.maximum(anywhere[:, :, None], anywhere[:, None])
    diagonal = np.eye(n, dtype=bool)
    unlimited = np.full_like(gaps, np.inf)
    quotient = np.divide(e[:, :, None] + e[:, None], gaps, out=unlimited, where=gaps > 0)
    difference_quotient = np.minimum(quotient, cap)
    difference_quotient = np.where(diagonal, wave.slope[:, None], difference_quotient)
    couplings = modal.stiffness_error[point] * difference_quotient
    error += np.einsum("sj,sjk,sk->s", r, couplings, c, optimize=True)
    error += np.einsum("sj,sjk,sk->s", r * e, modal.mass_error[point], c, optimize=True)
    return np.asarray(error)


@dataclass(frozen=True, eq=False)
class LoadAtNodes:
    """Responses to a load.

    Args:
        rho: ρ and ρ′, shape (2, N, n).
        error: Bounds of the rounding of ρ, shape (N, n).
        impulse: Bounds of ∫ |f| up to the node, shape (N,).
        value: f, shape (N,).
    """

    rho: Array
    error: Array
    impulse: Array
    value: Array


def load_at_given_nodes(sigma: Array, load: History, time: Array, node: Rows) -> LoadAtNodes:
    """Responses of oscillators σ (N, n) to a load, each row at its node (N,) of `time`."""
    responses = responses_at_given_nodes(sigma, load, time, node, 1)
    return LoadAtNodes(
        *responses, absolute_moments(0.0, load, time)[0, node], load.values(time[node])
    )


def load_at_nodes(sigma: Array, load: History, time: Array) -> LoadAtNodes:
    """Responses of oscillators σ (n,) to a load at all nodes."""
    responses = responses_at_nodes(sigma, load, time, 1)
    return LoadAtNodes(*responses, absolute_moments(0.0, load, time)[0], load.values(time))
