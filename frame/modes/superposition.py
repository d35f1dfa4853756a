"""Responses of a structure with classical modes at single inputs, and bounds of their rounding.

An output is Σ_k r_k c_k e(λ_k) over modes k of unit modal mass: r_k is the output's row times the
mode shape, c_k the mode's participation factor for a source, and e the response of its oscillator.
Computed modes X and λ are the exact ones of a pencil nearby: Xᵀ K X = diag λ + E and Xᵀ M X = I +
F, where the entries of E and F are bounded by the computed residuals and their γ_n (Higham 2002,
section 3.5). With G = |E| + |F| diag λ the outputs are off by at most

    Σ_jk |r_j| G_jk |e[λ_j, λ_k]| |c_k| + Σ_jk |r_j e_j| |F_jk| |c_k| + terms of second order,

where e[·, ·] is a divided difference; this holds for close modes too. The entry of the slowest mode
in G is some n ε ω_max², so that its frequency has a relative error of n ε (ω_max/ω₁)². Rounding of
the response itself comes from the recursion over the record.

Terms of second order. In the basis X the pencil is Λ + E, N = 1 + F, and the output r e(A) c′ with
A = N⁻¹ (Λ + E) = Λ + B and c′ = N⁻¹ c, in place of r e(Λ) c. With Frobenius norms φ of F and b of
B, b ≤ ‖G‖/(1 − φ):

1. c′ − c is −F c but for φ²/(1 − φ) |c|, and B is E − F Λ but for φ b.
2. If all modes have one damping ratio, e is one function. Column k of e(A) − e(Λ) is g_k(A) B_k
   with g_k(x) = e[x, λ_k], since (A − λ_k) times the unit vector k is B_k. Likewise column j of
   g_k(A) − g_k(Λ) is h(A) B_j with h(x) = e[x, λ_j, λ_k]. So r (e(A) − e(Λ)) c′ is Σ r_j
   e[λ_j, λ_k] B_jk c′_k but for Σ_jk r h(A) B_j B_jk c′_k. As N^½ A N^-½ is symmetric, the latter
   is at most √((1 + φ)/(1 − φ)) |r| b² |c′| sup |e″|/2 over all eigenvalues and between them.
3. If not, the response is Σ_k e_k(μ_k) r P_k c′ with the eigenvalues μ_k and projectors P_k of A.
   Let d_k be the distance of λ_k from all others and θ_k = 2 b/d_k < 1. Neumann's series of the
   resolvent on the circle of radius d_k/2 about λ_k (Kato 1966, chapter 2) bounds what is of second
   order in P_k by θ_k²/(1 − θ_k), P_k − P_k(Λ) by θ_k/(1 − θ_k), and μ_k − λ_k − B_kk by n b
   θ_k/(1 − θ_k); and |μ_k − λ_k| ≤ b (Bauer, Fike 1960).
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
        impulse = np.einsum("sij,sj->si", M, v)
        value = np.einsum("sik,si->sk", shapes, impulse)
        impulse_magnitude = np.einsum("sij,sj->si", np.abs(M), np.abs(v))
        magnitude = np.einsum("sik,si->sk", np.abs(shapes), impulse_magnitude)
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
        Where rounding may shift an eigenvalue by a hundredth of the smallest one, the bound is
        1e300, which stands for infinity.
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
    # the rounding of the bounds themselves
    return RoundedValues(total, (1 + 1e-9) * error)


class _ModeResponses(NamedTuple):
    """Responses e of n oscillators at N points and nodes, shape (N, n) each."""

    value: Array  # e
    error: Array  # bound of its rounding
    slope: Array  # bound of |de/dλ| at the eigenvalue of the mode
    slope_anywhere: Array  # bound of |de/dλ| at any eigenvalue of the same damping
    # bound of |d²e/dλ²| at all eigenvalues of the structure and between them, the same for all
    # modes, (N, 1)
    curvature: Array


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
        shape (N, n) each. And `curvature`, a bound of |d²e/dλ²|, shape (N, 1).
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
    slope_anywhere = slope_bound(impulse, time * impulse)
    # ρ′ is rounded in each interval of the load by some (12 + |σ h|) u of at most t ∫ |f|: together
    # less than a millionth of it for 1e8 intervals.
    slope = slope_bound(np.abs(load.rho[0]), np.abs(load.rho[1])) + 1e-6 * slope_anywhere
    return _ModeResponses(
        value=read_response(source, sigma, G) + feedthrough,
        error=error + gamma(8) * np.abs(feedthrough),
        slope=slope,
        slope_anywhere=slope_anywhere,
        curvature=_curvature_bound(source, sigma, order, impulse, time),
    )


EIGENVALUE_SHIFT = 0.01
"""Largest shift of an eigenvalue by rounding, over the smallest one, for which errors are bounded;
far above any shift by which a response would be of use."""


def _curvature_bound(source: str, sigma: Array, order: Ints, impulse: Array, time: Array) -> Array:
    """Bound |d²e/dλ²| over the eigenvalues of a structure at N points, shape (N, 1).

    With the decay g = (a + b λ)/2 + ζ √λ and q = g/ω one has λ g′ ≤ g, 4 λ² |g″| ≤ g and λ = ω²
    (1 + q²). From ω² = λ − g² follow 2 ω |ω′| ≤ 1 (see `truncated_modes.response_slopes`), ω³ |ω″|
    ≤ 9/16 and ω³ |σ″| ≤ 0.6 for σ = −g + iω. Hence for G = σ^ν ρ as a function of σ

        |(G/ω)″| ≤ |G_σσ|/(4 ω³) + 1.1 |G_σ|/ω⁴ + 1.1 |G|/ω⁵,
        |G″| ≤ |G_σσ|/(4 ω²) + 0.6 |G_σ|/ω³,  2 ω² |q′| ≤ q,  ω⁴ |q″| ≤ 0.6 + 1.1 q.

    With |ρ| ≤ I, |ρ′| ≤ t I and |ρ″| ≤ t² I these bounds do not rise with ω at constant q for ν ≤
    2. So the smallest ω and the largest q of all eigenvalues are taken. g/√λ is convex in √λ, and
    thus largest at the smallest or largest λ. Eigenvalues off by `EIGENVALUE_SHIFT` times the
    smallest one are included.

    Args:
        source: Name of the source; "start" for initial displacements.
        sigma: σ of n modes at each point, shape (N, n), in 1/s.
        order: ν, shape (N, 1).
        impulse: I, a bound of ∫ |f| of the load up to the time, shape (N, 1).
        time: t, shape (N, 1), in s.
    """
    magnitude = np.abs(sigma)
    # the largest g/√λ, which changes by less than the square root of the eigenvalue
    ratio = (1 + EIGENVALUE_SHIFT) * (-sigma.real / magnitude).max(axis=-1, keepdims=True)
    is_oscillating = ratio < 1
    root = np.sqrt(np.where(is_oscillating, 1 - ratio**2, 1.0))
    q = ratio / root
    omega = np.sqrt(1 - EIGENVALUE_SHIFT) * magnitude.min(axis=-1, keepdims=True) * root
    s = omega * np.sqrt(1 + q**2)  # |σ|
    G = s**order * impulse
    G_slope = (order * s ** np.maximum(order - 1, 0) + s**order * time) * impulse
    G_curvature = order * (order - 1) + 2 * order * s ** np.maximum(order - 1, 0) * time
    G_curvature = (G_curvature + s**order * time**2) * impulse
    if source == "start":  # e = Re G + q Im G
        bound = (1 + q) * (G_curvature / (4 * omega**2) + 0.6 * G_slope / omega**3)
        bound += q * G_slope / (2 * omega**3) + (0.6 + 1.1 * q) * G / omega**4
    else:  # e = ± Im G/ω
        bound = G_curvature / (4 * omega**3) + 1.1 * (G_slope / omega**4 + G / omega**5)
    return np.asarray(np.where(is_oscillating, bound, np.inf))


def _superposition_error(
    modes: PointModes,
    point: Ints,
    coefficients: RoundedValues,
    participation: RoundedValues,
    response: _ModeResponses,
) -> Array:
    """Bound the rounding of Σ_k r_k c_k e_k, shape (N,), which computed modes and products cause.

    Computed modes are exact for a stiffness and a mass nearby, whose differences couple modes j and
    k by |r_j| G_jk |e[λ_j, λ_k]| |c_k| and |r_j e_j| |F_jk| |c_k|, e[·, ·] a divided difference,
    and by terms of second order (see the head of this file).

    Args:
        modes: Modes at all points, with G, F and the eigenvalues λ.
        point: Index of the point of each row, shape (N,).
        coefficients: r of n modes in the output of each row, with rounding, shape (N, n).
        participation: c of the source, with rounding, shape (N, n).
        response: e with rounding, and bounds of |de/dλ|, shape (N, n).
    """
    # Magnitudes with their rounding, so that no products of errors are left out.
    r = np.abs(coefficients.value) + coefficients.error
    c = np.abs(participation.value) + participation.error
    e = np.abs(response.value) + response.error
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
    has_one_ratio = modes.has_one_ratio[point]
    by_slope = np.where(has_one_ratio[:, np.newaxis, np.newaxis], by_slope, np.inf)
    is_diagonal = np.eye(n, dtype=bool)
    of_mode = response.slope[:, np.newaxis]
    divided_differences = np.where(is_diagonal, of_mode, np.minimum(by_gap, by_slope))

    G = modes.stiffness_error[point]
    F = modes.mass_error[point]
    error += np.einsum("sj,sj->s", r, np.einsum("sjk,sk->sj", G * divided_differences, c))
    error += np.einsum("sj,sj->s", r * e, np.einsum("sjk,sk->sj", F, c))

    # Terms of second order, with the norms φ of F and b of B ≤ G/(1 − φ).
    phi = np.linalg.norm(F, axis=(1, 2))
    is_small = phi < EIGENVALUE_SHIFT
    phi = np.where(is_small, phi, 0.0)
    b = np.linalg.norm(G, axis=(1, 2)) / (1 - phi)
    is_small &= b <= EIGENVALUE_SHIFT * eigenvalues[:, 0]
    curvature = response.curvature[:, 0]
    of_mass = e.max(axis=-1) * phi**2 / (1 - phi)
    largest = divided_differences.max(axis=(1, 2))
    of_both = largest * phi * b * (1 + 1 / (1 - phi))
    of_one_function = np.sqrt((1 + phi) / (1 - phi)) * b**2 * curvature / 2 / (1 - phi)

    distances = np.where(is_diagonal, np.inf, gaps).min(axis=-1)  # d
    theta = 2 * b[:, np.newaxis] / np.maximum(distances, 1e-300)
    is_apart = theta < 1
    theta = np.where(is_apart, theta, 0.0)
    of_projector = theta / (1 - theta)
    shift = b[:, np.newaxis]
    change = response.slope * shift + response.curvature * shift**2 / 2  # of e_k by μ_k − λ_k
    of_each = e * theta * of_projector + response.slope * n * shift * of_projector
    of_each += response.curvature * shift**2 / 2 + change * of_projector
    of_functions = of_each.sum(axis=-1) / (1 - phi)
    of_stiffness = np.where(has_one_ratio, of_one_function, of_functions)
    is_small &= has_one_ratio | is_apart.all(axis=-1)

    r_norm = np.linalg.norm(r, axis=-1)
    c_norm = np.linalg.norm(c, axis=-1)
    error += r_norm * c_norm * (of_mass + of_both + of_stiffness)
    return np.asarray(np.where(is_small & np.isfinite(error), error, 1e300))
