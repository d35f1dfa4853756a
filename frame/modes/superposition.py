"""Responses of a structure with classical modes at single inputs, and bounds of their rounding.

An output is Σ_k r_k c_k e(λ_k), over modes of unit mass: r the output's coefficient of mode k,
c the mode's participation in a source, e the response of its oscillator. Computed modes X and λ
are the exact ones of a pencil near by: Xᵀ K X = diag λ + E and Xᵀ M X = I + F, whose entries are
bounded by the computed residuals and their γ_n (Higham 2002, section 3.5). With
G = |E| + |F| diag λ the outputs are off, to first order, by

    Σ_jk |r_j| G_jk |e[λ_j, λ_k]| |c_k| + Σ_jk |r_j e_j| |F_jk| |c_k|,

e[·, ·] a divided difference, which holds for close modes too. The entry of the slowest mode in G is
some n ε ω_max², so that its frequency is off by a share of n ε (ω_max/ω₁)². Rounding of the
response itself comes from the recursion over the record.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.frame.calculus.rounding import UNIT_ROUNDOFF, gamma
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.rest import response_slopes
from alphacut.frame.modes.structure import Classical
from alphacut.frame.records.history import History
from alphacut.frame.response.duhamel import absolute_moments, responses_at_nodes
from alphacut.frame.response.oscillators import read_response
from alphacut.frame.structures.linear import LinearSystem, evaluate, histories, undamped_modes


@dataclass(frozen=True, eq=False)
class Modal:
    """Modes of a structure at S points, with bounds of what rounding leaves of the pencil."""

    squared: Array  # λ, (S, n), rising, in 1/s²
    sigma: Array  # exponents −g + iω, (S, n), in 1/s
    is_alike: Mask  # whether all modes of a point have one ratio of damping, (S,)
    shape: Array  # displacements of the modes, of unit mass, (S, n, n)
    share: dict[str, Array]  # c of each source, by its name, (S, n)
    share_error: dict[str, Array]  # bounds of their rounding
    stiffness_error: Array  # G, (S, n, n)
    mass_error: Array  # |F|, (S, n, n)
    rows: Array  # rows of all outputs on the state, (S, m, 2 n)
    structure: Classical  # the structure over the box
    entry_roundings: int  # of an entry of M, K and of output rows; see `LinearSystem`

    @property
    def sigma_slope(self) -> Array:
        """Bound of |dσ/dλ|, shape (S, n), in s; see `rest.response_slopes`."""
        return np.asarray(1 / (2 * self.sigma.imag))

    def output_coefficients(self, point: Ints, output: Ints) -> tuple[Array, Array]:
        """Coefficients r of modes in outputs (N,) at points (N,), and their rounding, (N, n)."""
        n, order = self.shape.shape[-1], self.structure.order[output][:, None]
        rows, shape = self.rows[point, output], self.shape[point]
        row = np.where(order == 1, rows[:, n:], rows[:, :n])
        # accelerations are read of structures whose unknowns all have mass
        row = np.where(order == 2, self.structure.rows[output, :n], row)
        size = np.einsum("si,sik->sk", np.abs(row), np.abs(shape))
        return np.einsum("si,sik->sk", row, shape), gamma(n + self.entry_roundings) * size


def modes_at(
    system: LinearSystem, structure: Classical, names: Sequence[str], points: Array, unit: Array
) -> Modal:
    """Modes of a structure at S values of its inputs `names`, with bounds of their rounding.

    The values are `points` (S, inputs) in SI units, and `unit` (S, d) in the unit coordinates of
    the box of `structure`, from which damping is taken, but for that of a single mode.

    Raises:
        UnprovedError: A mode does not oscillate.
    """
    matrices, rows = evaluate(system, names, points, derivatives=False, by_ratios=False)
    M, K = matrices.mass.value, matrices.stiffness.value
    squared, shape = undamped_modes(M, K)
    a, b = structure.rayleigh.at(unit).T[:, :, None]
    ratio, positive = structure.ratio.at(unit), np.maximum(squared, 1e-300)
    decay = (a + b * squared) / 2
    if M.shape[-1] == 1:  # where a has the dashpots over the mass, and is no polynomial of inputs
        decay = matrices.damping.value[..., 0] / M[..., 0] / 2
    decay = decay + ratio * np.sqrt(positive)
    if not (squared > decay**2).all():
        raise UnprovedError("a mode may not oscillate", "take less damping, and hold the structure")
    n, (q0, v0) = M.shape[-1], np.split(matrices.start.value[..., 0], 2, axis=-1)
    patterns, pushes = {"velocity": v0, "start": q0}, matrices.pushes(ground=False).value
    forces = [name for name in histories(system) if name != "load"]
    patterns |= {name: pushes[..., k] for k, name in enumerate(forces)}
    if system.ground is not None:
        patterns["load"] = np.broadcast_to(matrices.rigid[:, 0], squared.shape)
    share, share_error, product = {}, {}, "sik,sij,sj->sk"
    entry_roundings = system.entry_roundings
    for name, x in patterns.items():
        share[name] = np.einsum(product, shape, M, x, optimize=True)
        size = np.einsum(product, *(np.abs(part) for part in (shape, M, x)), optimize=True)
        share_error[name] = gamma(2 * n + 2 * entry_roundings) * size
    of_stiffness = _residual(shape, K, squared, entry_roundings=entry_roundings)
    of_mass = _residual(shape, M, np.ones_like(squared), entry_roundings=entry_roundings)
    of_stiffness += of_mass * squared[:, None]
    of_stiffness += gamma(8) * squared[:, None] * np.eye(n)  # of σ from λ
    return Modal(
        squared=squared,
        sigma=-decay + 1j * np.sqrt(squared - decay**2),
        is_alike=(ratio == ratio[:, :1]).all(1),
        shape=shape,
        share=share,
        share_error=share_error,
        stiffness_error=of_stiffness,
        mass_error=of_mass,
        rows=rows.value,
        structure=structure,
        entry_roundings=entry_roundings,
    )


def _residual(shape: Array, matrix: Array, diagonal: Array, *, entry_roundings: int) -> Array:
    """Bound of |Xᵀ A X − diag| for the exact A, with the rounding of its product, (S, n, n)."""
    n, across = shape.shape[-1], shape.swapaxes(-1, -2)
    residual = across @ matrix @ shape - diagonal[:, None] * np.eye(n)
    size = np.abs(across) @ np.abs(matrix) @ np.abs(shape)
    return np.asarray(np.abs(residual) + gamma(2 * n + entry_roundings) * size)


@dataclass(frozen=True, eq=False)
class LoadAtNodes:
    """Responses ρ of oscillators to a load, each row at a node."""

    rho: Array  # ρ and its derivative ρ′ by σ, (2, N, n)
    error: Array  # bounds of the rounding of ρ, (N, n)
    impulse: Array  # bound of |ρ| at any σ that does not grow, ∫ |f| up to the node, (N,)
    value: Array  # f, (N,)


def load_at_nodes(
    sigma: Array, load: History, time: Array, node: Ints | None = None
) -> LoadAtNodes:
    """Responses of oscillators σ (N, n) to a load, each row at its node (N,); (n,) at all nodes."""
    at, impulse = slice(None) if node is None else node, absolute_moments(0.0, load, time)[0]
    responses = responses_at_nodes(sigma, load, time, 1, node=node)
    return LoadAtNodes(*responses, impulse[at], load.values(time[at]))


def outputs_at(
    modal: Modal, point: Ints, output: Ints, time: Array, loads: Mapping[str, LoadAtNodes]
) -> tuple[Array, Array]:
    """Exact values of outputs at points and nodes, and bounds of their rounding, (N,) each.

    Each value has a point of `modal`, an output and a node `time` in s, (N,) each.
    """
    sigma, slope, t = modal.sigma[point], modal.sigma_slope[point], time[:, None]
    exp = np.exp(sigma * t)
    rounding = (gamma(4) + UNIT_ROUNDOFF * np.abs(sigma) * t) * np.abs(exp)
    unit_load = np.ones_like(time)
    free = LoadAtNodes(np.stack([exp, t * exp]), rounding, unit_load, 0 * unit_load)
    read = modal.output_coefficients(point, output)
    total, error = np.zeros((2, len(point)))
    for source, load in {"velocity": free, "start": free, **loads}.items():
        order = modal.structure.order[output]
        response = _mode_responses(sigma, order, source, load, t)
        share = modal.share[source][point], modal.share_error[source][point]
        total += (read[0] * share[0] * response[0]).sum(-1)
        error += _superposition_error(modal, point, read, share, response)
    # terms of second order in the residuals are at most this fraction of those of first order
    diagonal = np.einsum("skk->sk", modal.stiffness_error[point])
    return total, error / np.maximum(1 - (diagonal * slope * t).max(-1), 1e-300)


def _mode_responses(
    sigma: Array, orders: Ints, source: str, load: LoadAtNodes, time: Array
) -> tuple[Array, Array, Array, Array]:
    """Responses e, their rounding, and bounds of |de/dλ| at the modes and at any λ, (N, n) each."""
    omega, size, order = sigma.imag, np.abs(sigma), orders[:, None]
    power, power_slope = size**order, order * size ** np.maximum(order - 1, 0)
    G = sigma**order * load.rho[0]
    error = power * load.error + gamma(2 * order.max() + 6) * np.abs(G)
    direct = np.zeros_like(time)
    if source.startswith("force"):  # of the relative acceleration
        direct = np.where(order == 2, load.value[:, None], 0.0)
    # |G| and |dG/dσ| at the modes, and anywhere, where |ρ| ≤ ∫ |f| and |ρ′| ≤ t ∫ |f|
    impulse, quotient = load.impulse[:, None], -sigma.real / omega
    slopes = [
        response_slopes(source, power * rho, power_slope * rho + power * rho_slope, omega, quotient)
        for rho, rho_slope in (np.abs(load.rho), (impulse, time * impulse))
    ]
    error = error * (1 + quotient) if source == "start" else error / omega
    error = error + gamma(8) * np.abs(direct)
    return read_response(source, sigma, G) + direct, error, slopes[0], slopes[1]


def _superposition_error(
    modal: Modal,
    point: Ints,
    read: tuple[Array, Array],
    share: tuple[Array, Array],
    response: tuple[Array, Array, Array, Array],
) -> Array:
    """Bound of the rounding of Σ_k r_k c_k e_k, (N,), by r, c and e with their errors, (N, n)."""
    (r, r_error), (c, c_error) = (tuple(np.abs(x) for x in pair) for pair in (read, share))
    value, e_error, slope, anywhere = response
    e, n = np.abs(value), value.shape[-1]
    error = (r * c * e_error + (r_error * c + r * c_error) * e).sum(-1)
    error += gamma(n + 6) * (r * c * e).sum(-1)
    # e[λ_j, λ_k] is no more than (|e_j| + |e_k|) / |λ_j − λ_k|, nor than sup |de/dλ| between modes
    # of one damping ratio
    squared = modal.squared[point]
    gaps = np.abs(squared[:, :, None] - squared[:, None])
    of_ratios = np.where(modal.is_alike[point][:, None, None], 0.0, np.inf)
    cap = of_ratios + np.maximum(anywhere[:, :, None], anywhere[:, None])
    unlimited = np.full_like(gaps, np.inf)
    quotient = np.divide(e[:, :, None] + e[:, None], gaps, out=unlimited, where=gaps > 0)
    diagonal = np.eye(n, dtype=bool)
    divided_differences = np.where(diagonal, slope[:, None], np.minimum(quotient, cap))
    couplings = modal.stiffness_error[point] * divided_differences
    error += np.einsum("sj,sjk,sk->s", r, couplings, c, optimize=True)
    error += np.einsum("sj,sjk,sk->s", r * e, modal.mass_error[point], c, optimize=True)
    return np.asarray(error)
