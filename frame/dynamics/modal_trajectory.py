"""Trajectories of a linear structure and their derivatives by parameters, from its complex modes.

With A v_k = λ_k v_k the outputs are Re Σ_k C v_k (w_k·b) ρ(t; λ_k) over all modes of the state
matrix, w_k the rows of the inverse of the matrix of all v_k, b the start or the push of a load and
ρ = exp(λ t) or the Duhamel integral of the load. λ_k and v_k are smooth where eigenvalues are
apart, and their derivatives follow from those of A (Stewart, Sun 1990); ρ has its own by λ.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alphacut.base.kernels import compiled
from alphacut.frame.calculus.jet import Array, Jet, inverse
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.records.history import History
from alphacut.frame.response.duhamel import responses_at_nodes, step_integrals
from alphacut.frame.structures.linear import Matrices, undamped_modes

MIN_DISTANCE = 1e-4
"""Relative distance of two eigenvalues below which second derivatives of their modes lose more than
eight digits."""
MAX_COUPLING = 1e-13
"""Damping between two modes, as a fraction of the largest of one mode, that is rounding: it changes
the motion by this fraction times damping times duration, however near the modes are."""
LEAST_TURN = 1e-3
"""Least ω/ω₀ of a mode; the motion of one that hardly oscillates loses this factor of digits."""
MAX_INTERVALS = 16
"""Most intervals in a step whose ends are samples of all loads."""
ROUND_OFF = 1e-7
"""The same over the largest eigenvalue: double ones at 0 part by the root of rounding."""


def modal_trajectory(
    state_matrix: Jet, columns: Jet, rows: Jet, loads: Sequence[History], time: Array
) -> Jet | None:
    """Return outputs at nodes with two derivatives, shape (S, T, m); None where modes are too near.

    A is the state matrix (S, N, N), C are the rows (S, m, N), and columns (S, N, 1 + L) the initial
    state and what a unit of each of L loads pushes.
    """
    modes = _modes(state_matrix)
    if modes is None:
        return None
    rate, shapes, adjoint = modes
    # one of each conjugate pair, which stand first, twice
    weight = 1.0 + np.sign(rate.value.imag)
    count = int((weight > 0).sum(1).max())
    rate, weight = rate[:, :count], weight[:, :count]
    read, moved = (rows @ shapes)[..., :count], (adjoint @ columns)[:, :count]
    free = np.exp(rate.value[..., None] * time)
    # ρ with two derivatives, (S, 3, n, T) each
    waves = [np.stack([free, time * free, time**2 * free], 1)]
    for load in loads:
        try:
            found, _ = responses_at_nodes(rate.value.ravel(), load, time, 2)
        except UnprovedError:  # a motion grows, or turns, out of the range of the recursion
            return None
        waves.append(found.reshape(3, len(time), *rate.value.shape).transpose(2, 0, 3, 1))
    amplitudes = [
        read * moved[:, None, :, source] * weight[:, None] for source in range(1 + len(loads))
    ]
    table = np.concatenate(waves, 1).reshape(len(weight), -1, len(time))
    table = np.concatenate([table.real, -table.imag], -2)
    derivatives = list[Array]()
    for factors in zip(*(_chain(x, rate[:, None]) for x in amplitudes), strict=True):
        factor = np.concatenate(factors, -1)
        motion = np.concatenate([factor.real, factor.imag], -1) @ table  # its real part
        derivatives.append(np.asarray(motion.swapaxes(-1, -2)))
    return Jet.of(*derivatives)


def _chain(a: Jet, rate: Jet) -> list[Array]:
    """Factors of ρ, ρ′ and ρ″ in a ρ(λ) and its derivatives, (…, S, m, 3 n), for a (S, m, n)."""
    slope, zero = rate.first, 0.0 * a.value
    first = a.first, a.value * slope, 0.0 * a.first
    cross = a.first[:, None] * slope
    mixed = cross + cross.swapaxes(0, 1) + a.value * rate.second
    second = a.second, mixed, a.value * slope[:, None] * slope
    return [np.concatenate(x, -1) for x in ((a.value, zero, zero), first, second)]


def _modes(A: Jet) -> tuple[Jet, Jet, Jet] | None:
    """Eigenvalues (S, N), modes as columns and the inverse of their matrix, (S, N, N), with jets.

    Eigenvalues fall with their imaginary part. A mode's derivatives have no part of the mode
    itself. None where two eigenvalues are nearer than `MIN_DISTANCE`.
    """
    values, vectors = np.linalg.eig(A.value)
    order = np.argsort(-values.imag, axis=-1, kind="stable")
    values = np.take_along_axis(values, order, -1)
    V = np.take_along_axis(vectors, order[:, None], -1).astype(complex)
    gaps = values[:, None] - values[:, :, None]  # λ_k − λ_l in row l, column k
    same = np.eye(values.shape[-1], dtype=bool)
    size = np.abs(values[:, None])
    least_gap = MIN_DISTANCE * size + ROUND_OFF * size.max(-1, keepdims=True)
    if (np.abs(gaps) < least_gap)[:, ~same].any():
        return None
    quotient = np.where(same, 0.0, 1 / np.where(same, 1.0, gaps))
    W = np.linalg.inv(V)
    B, bend = W @ A.first @ V, W @ A.second @ V
    slope = np.diagonal(B, axis1=-2, axis2=-1)
    U = B * quotient
    cross = B[:, None] @ U - U * slope[:, None, :, None, :]
    bend = bend + cross + cross.swapaxes(0, 1)
    curve = np.diagonal(bend, axis1=-2, axis2=-1)
    shapes = Jet.of(V, V @ U, V @ (bend * quotient))
    return Jet.of(values, slope, curve), shapes, inverse(shapes)


def classical_trajectory(
    matrices: Matrices, rows: Jet, pushes: Jet, loads: Sequence[History], time: Array
) -> Array | None:
    """Return outputs at nodes, shape (S, T, m), of structures whose undamped modes are uncoupled.

    With ΦᵀMΦ = 1 the motion is q = Φ Im(z/ω), v = Φ Im(σ z/ω) of ż = σ z + ΦᵀM b f(t) and
    z(0) = ΦᵀM (v₀ − σ̄ q₀), exact where f is linear in each of equal intervals.

    `pushes` are the accelerations b by a unit of each of L loads, shape (S, n, L). None where modes
    are coupled or do not oscillate, or where loads have other intervals.
    """
    step = float(time[1])
    counts = (k for k in range(1, MAX_INTERVALS + 1) if all(_fits(x, step / k) for x in loads))
    intervals = next(counts, 0)  # in a step
    try:
        squared, shapes = undamped_modes(matrices.mass.value, matrices.stiffness.value)
    except np.linalg.LinAlgError:  # a mass is not positive definite
        return None
    across = shapes.swapaxes(-1, -2)
    damping = across @ matrices.damping.value @ shapes
    decay = np.einsum("skk->sk", damping) / 2
    coupling = np.abs(damping - 2 * decay[:, None] * np.eye(decay.shape[-1]))
    turn = squared - decay**2  # ω²
    is_coupled = coupling.max() > MAX_COUPLING * 2 * np.abs(decay).max()
    if not intervals or is_coupled or not (turn > LEAST_TURN**2 * squared).all():
        return None
    omega = np.sqrt(turn)
    sigma = -decay + 1j * omega
    weight, (q0, v0) = across @ matrices.mass.value, np.split(matrices.start.value, 2, axis=1)
    start = (weight @ v0)[..., 0] - sigma.conj() * (weight @ q0)[..., 0]
    q_rows, v_rows = np.split(rows.value, 2, axis=-1)
    read = (q_rows @ shapes + sigma[:, None] * (v_rows @ shapes)) / omega[:, None]
    h, out = step / intervals, np.empty((len(sigma), len(time), read.shape[1]))
    # a load's line in each interval, (I, L), from two of its values, which are no jumps
    begins = np.arange((len(time) - 1) * intervals) * h
    quarters = np.array([[x.values(begins + share * h) for x in loads] for share in (0.25, 0.75)])
    quarters = quarters.reshape(2, len(loads), len(begins)).swapaxes(1, 2)
    slopes = (quarters[1] - quarters[0]) * (2 / h)
    ends, moved = quarters[1] + slopes * (h / 4), weight @ pushes.value
    _march_modes(sigma, h, intervals, start, moved, ends, slopes, read, out)
    return out


def _fits(load: History, interval: float) -> bool:
    """Whether a load is linear in intervals that begin at t = 0."""
    ratios = np.array([load.step, load.start]) / interval
    is_multiple = np.abs(ratios - np.round(ratios)).max() < 1e-9 * max(1.0, ratios.max())
    return not load.frequency and bool(is_multiple) and ratios[0] > 0.5


@compiled
def _march_modes(
    sigma: Array,
    h: float,
    intervals: int,
    start: Array,
    moved: Array,
    ends: Array,
    slopes: Array,
    read: Array,
    out: Array,
) -> None:
    """Write Im Σ_k read_ok z_k, z(t + h) = exp(σ h) z(t) + moved (J₀ end − J₁ slope), (S, T, m)."""
    (samples, n_nodes, m), n, n_loads = out.shape, sigma.shape[1], moved.shape[2]
    integrals, factor = np.empty(4, np.complex128), np.empty(n, np.complex128)
    by_end, by_slope = np.empty((2, n_loads, n), np.complex128)
    for s in range(samples):
        for k in range(n):
            step_integrals(sigma[s, k], h, integrals)
            factor[k] = np.exp(sigma[s, k] * h)
            for load in range(n_loads):
                by_end[load, k] = moved[s, k, load] * integrals[0]
                by_slope[load, k] = -moved[s, k, load] * integrals[1]
        real, imaginary = start[s].real.copy(), start[s].imag.copy()
        for node in range(n_nodes):
            for i in range((node - 1) * intervals if node else 0, node * intervals):
                for k in range(n):
                    before = real[k]
                    real[k] = factor[k].real * before - factor[k].imag * imaginary[k]
                    imaginary[k] = factor[k].real * imaginary[k] + factor[k].imag * before
                for load in range(n_loads):
                    a, slope = ends[i, load], slopes[i, load]
                    for k in range(n):
                        real[k] += a * by_end[load, k].real + slope * by_slope[load, k].real
                        imaginary[k] += a * by_end[load, k].imag + slope * by_slope[load, k].imag
            for o in range(m):
                total = 0.0
                for k in range(n):
                    total += read[s, o, k].real * imaginary[k] + read[s, o, k].imag * real[k]
                out[s, node, o] = total
