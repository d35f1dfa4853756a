"""Trajectories of linear structures by superposition of modes.

`modal_trajectory` takes complex modes of the state matrix A and gives derivatives by the parameters
as well. With A v_k = λ_k v_k the outputs are Re Σ_k C v_k (w_k·b) ρ(t; λ_k) over all modes. C are
the rows of the outputs, w_k the rows of the inverse of the matrix of all v_k, b the initial state
with ρ = exp(λ t), or the column of a load with its Duhamel integral ρ. Where eigenvalues are apart,
λ_k and v_k are smooth, and their derivatives follow from those of A (Stewart, Sun 1990).

`classical_trajectory` takes classical modes, of structures whose damping does not couple them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from alphacut.base.kernels import compiled
from alphacut.frame.calculus.polynomials import Array, Jet, inverse
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.records.history import History
from alphacut.frame.response.duhamel import responses_at_nodes, step_integrals
from alphacut.frame.structures.linear import Matrices, undamped_modes


def modal_trajectory(
    state_matrix: Jet, columns: Jet, rows: Jet, loads: Sequence[History], time: Array
) -> Jet | None:
    """Return outputs at time nodes with first and second derivatives, by complex modes.

    Arguments and result are jets: values at S parameter sets with derivatives by d parameters.

    Args:
        state_matrix: A of ẋ = A x, shape (S, N, N).
        columns: The initial state, then what a unit of each of L loads adds to the rate of the
            state, shape (S, N, 1 + L).
        rows: Rows C of the outputs C x, shape (S, outputs, N).
        loads: Histories of the L loads.
        time: Time nodes, equally spaced from 0 on, shape (nodes,), in s.

    Returns:
        Jet of shape (S, nodes, outputs). None if two eigenvalues of A are too close, or a mode
        grows or turns beyond the range of the recursion of Duhamel's integral.
    """
    modes = _complex_modes(state_matrix)
    if modes is None:
        return None
    # A is real, so that its modes are real or come in conjugate pairs, whose sum is twice the real
    # part of one. Of each pair the first one is kept, with weight 2; real modes have weight 1.
    weight = 1.0 + np.sign(modes.rate.value.imag)
    kept = int((weight > 0).sum(1).max())
    rate = modes.rate[:, :kept]
    weight = weight[:, :kept]
    at_outputs = (rows @ modes.shapes)[..., :kept]
    of_columns = (modes.adjoint @ columns)[:, :kept]

    # Each mode is a sum of amplitudes times responses ρ(λ, t): exp(λ t) of the initial state, and
    # ∫ exp(λ τ) f(t − τ) dτ of a load f. Here are ρ and its derivatives ρ′ and ρ″ by λ of each,
    # shape (S, 3, modes, T).
    free = np.exp(rate.value[..., None] * time)
    waves = [np.stack([free, time * free, time**2 * free], 1)]
    for load in loads:
        try:
            found = responses_at_nodes(rate.value.ravel(), load, time, 2)
        except UnprovedError:
            return None
        by_mode = found.reshape(3, len(time), *rate.value.shape)
        waves.append(by_mode.transpose(2, 0, 3, 1))
    table = np.concatenate(waves, 1).reshape(len(weight), -1, len(time))
    # Re(a ρ) = Re a Re ρ − Im a Im ρ by one real product, half the work of a complex one
    real_table = np.concatenate([table.real, -table.imag], -2)

    factors_by_column = []
    for column in range(1 + len(loads)):
        amplitude = at_outputs * of_columns[:, None, :, column] * weight[:, None]
        factors_by_column.append(_factors_of_waves(amplitude, rate[:, None]))
    derivatives = list[Array]()
    for factors in zip(*factors_by_column, strict=True):
        factor = np.concatenate(factors, -1)
        outputs = np.concatenate([factor.real, factor.imag], -1) @ real_table  # the real part
        derivatives.append(np.asarray(outputs.swapaxes(-1, -2)))
    return Jet.of(*derivatives)


def _factors_of_waves(a: Jet, rate: Jet) -> list[Array]:
    """Return what multiplies ρ, ρ′ and ρ″ in a ρ(λ) and in its derivatives by d parameters.

    ρ(λ) is a response at all times that depends on the parameters through an eigenvalue λ alone,
    and ρ′ and ρ″ are its derivatives by λ. With subscripts for derivatives by parameters, (a ρ)_i =
    a_i ρ + a λ_i ρ′ and (a ρ)_ij = a_ij ρ + (a_i λ_j + a_j λ_i + a λ_ij) ρ′ + a λ_i λ_j ρ″.

    Args:
        a: Amplitudes, a jet of shape (S, outputs, modes).
        rate: Eigenvalues λ, a jet of shape (S, 1, modes).

    Returns:
        Factors of the values, of the first and of the second derivatives, shapes (S, outputs, 3
        modes), (d, S, outputs, 3 modes) and (d, d, S, outputs, 3 modes). Along the last axis stand
        the factors of ρ for all modes, then those of ρ′, then those of ρ″.
    """
    slope = rate.first
    zero = 0.0 * a.value
    of_value = a.value, zero, zero
    of_first = a.first, a.value * slope, 0.0 * a.first
    cross = a.first[:, None] * slope
    mixed = cross + cross.swapaxes(0, 1) + a.value * rate.second
    of_second = a.second, mixed, a.value * slope[:, None] * slope
    return [np.concatenate(factors, -1) for factors in (of_value, of_first, of_second)]


class _ComplexModes(NamedTuple):
    """Modes of S state matrices with derivatives by the parameters.

    `rate` are the eigenvalues, shape (S, N), with falling imaginary parts. `shapes` holds the modes
    as columns, `adjoint` is the inverse of this matrix; both have shape (S, N, N).
    """

    rate: Jet
    shapes: Jet
    adjoint: Jet


def _complex_modes(A: Jet) -> _ComplexModes | None:
    """Return the modes of real state matrices with derivatives, or None if two are too close.

    The derivatives of a mode v_k are chosen without a component along v_k itself.

    Args:
        A: State matrices, a jet of shape (S, N, N).

    Returns:
        Complex jets: `rate`, the eigenvalues, shape (S, N), with falling imaginary parts, so that
        of each conjugate pair the one above the real axis comes first; `shapes`, the modes as
        columns, shape (S, N, N); and `adjoint`, the inverse of this matrix. None if at any set the
        distance of two eigenvalues is below 1e-4 of one of them plus 1e-7 of the largest.
    """
    # Below a relative distance of 1e-4 the second derivatives of modes lose more than eight digits.
    # Double eigenvalues at zero split by the root of the rounding, 1e-7 of the largest one.
    relative_distance = 1e-4
    of_largest = 1e-7
    values, vectors = np.linalg.eig(A.value)
    order = np.argsort(-values.imag, axis=-1, kind="stable")
    values = np.take_along_axis(values, order, -1)
    V = np.take_along_axis(vectors, order[:, None], -1).astype(complex)
    gaps = values[:, None] - values[:, :, None]  # λ_k − λ_l in row l, column k
    is_diagonal = np.eye(values.shape[-1], dtype=bool)
    size = np.abs(values[:, None])
    min_gap = relative_distance * size + of_largest * size.max(-1, keepdims=True)
    if (np.abs(gaps) < min_gap)[:, ~is_diagonal].any():
        return None

    # With W = V⁻¹ and B_i = W A_i V: λ_i = diag B_i and V_i = V U_i, where U_i = B_i / gaps off the
    # diagonal. Once more: with C_ij = W A_ij V + (B_i U_j − U_j λ_i) + (B_j U_i − U_i λ_j),
    # λ_ij = diag C_ij and V_ij = V (C_ij / gaps) off the diagonal.
    inverse_gaps = np.where(is_diagonal, 0.0, 1 / np.where(is_diagonal, 1.0, gaps))
    W = np.linalg.inv(V)
    B = W @ A.first @ V
    C = W @ A.second @ V
    rate_first = np.diagonal(B, axis1=-2, axis2=-1)
    U = B * inverse_gaps
    cross = B[:, None] @ U - U * rate_first[:, None, :, None, :]
    C = C + cross + cross.swapaxes(0, 1)
    rate_second = np.diagonal(C, axis1=-2, axis2=-1)
    shapes = Jet.of(V, V @ U, V @ (C * inverse_gaps))
    return _ComplexModes(Jet.of(values, rate_first, rate_second), shapes, inverse(shapes))


def classical_trajectory(
    matrices: Matrices, rows: Jet, pushes: Jet, loads: Sequence[History], time: Array
) -> Array | None:
    """Return outputs at time nodes of structures whose undamped modes stay uncoupled.

    Each mode with ΦᵀMΦ = 1, decay δ and frequency ω has σ = −δ + iω. From ż = σ z + ΦᵀM b f(t) and
    z(0) = ΦᵀM (v₀ − σ̄ q₀) follow q = Φ Im(z/ω) and v = Φ Im(σ z/ω), b the accelerations by a unit
    of a load f. This is exact where f is linear in each of equal intervals.

    Args:
        matrices: Of S structures with n unknowns.
        rows: Rows of the m outputs in [q; v], shape (S, m, 2n).
        pushes: Accelerations b by a unit of each of L loads, shape (S, n, L).
        loads: Histories of the L loads.
        time: T time nodes, shape (T,), in s.

    Returns:
        Shape (S, T, m). None where the modes are coupled or hardly oscillate, where a mass matrix
        is not positive definite, or where no division of a step into 16 equal intervals or fewer
        has all samples of the loads at its ends.
    """
    step = float(time[1])
    intervals = _intervals_of_step(loads, step)
    if intervals is None:
        return None
    try:
        squared, shapes = undamped_modes(matrices.mass.value, matrices.stiffness.value)
    except np.linalg.LinAlgError:
        return None
    transposed = shapes.swapaxes(-1, -2)
    # ΦᵀDΦ is diagonal if the modes are uncoupled (classical damping), with entries 2 δ
    damping = transposed @ matrices.damping.value @ shapes
    decay = np.einsum("skk->sk", damping) / 2
    coupling = np.abs(damping - 2 * decay[:, None] * np.eye(decay.shape[-1]))
    # damping between modes of 1e-13 of the largest decay is rounding: it changes the motion by this
    # fraction times damping times duration, however close the modes are
    is_coupled = coupling.max() > 1e-13 * 2 * np.abs(decay).max()
    squared_omega = squared - decay**2
    # ω below 1e-3 of the undamped frequency would lose three digits in z/ω
    oscillates = (squared_omega > 1e-3**2 * squared).all()
    if is_coupled or not oscillates:
        return None

    omega = np.sqrt(squared_omega)
    sigma = -decay + 1j * omega
    to_modes = transposed @ matrices.mass.value
    q0, v0 = np.split(matrices.start.value, 2, axis=1)
    start = (to_modes @ v0)[..., 0] - sigma.conj() * (to_modes @ q0)[..., 0]
    q_rows, v_rows = np.split(rows.value, 2, axis=-1)
    at_outputs = (q_rows @ shapes + sigma[:, None] * (v_rows @ shapes)) / omega[:, None]

    # the line of each load in each interval, from its values at two inner times, which are no jumps
    h = step / intervals
    begins = np.arange((len(time) - 1) * intervals) * h
    at_quarters = []
    for fraction in (0.25, 0.75):
        values = np.array([load.values(begins + fraction * h) for load in loads])
        at_quarters.append(values.reshape(len(loads), len(begins)).T)
    first_quarter, last_quarter = at_quarters
    slopes = (last_quarter - first_quarter) * (2 / h)
    ends = last_quarter + slopes * (h / 4)
    of_loads = to_modes @ pushes.value
    outputs = np.empty((len(sigma), len(time), at_outputs.shape[1]))
    integrals = np.zeros((*sigma.shape, 4), complex)
    if loads:  # else nothing is compiled for them
        for place in np.ndindex(*sigma.shape):
            step_integrals(sigma[place], h, integrals[place])
    by_end = of_loads * integrals[..., :1]
    by_slope = -of_loads * integrals[..., 1:2]
    factor = np.exp(sigma * h)
    _march_modes(factor, intervals, start, by_end, by_slope, ends, slopes, at_outputs, outputs)
    return outputs


def _intervals_of_step(loads: Sequence[History], step: float) -> int | None:
    """Return the least number of equal intervals of a step in which all loads are linear.

    None if it is above 16.
    """
    for intervals in range(1, 17):
        if all(_is_linear(load, step / intervals) for load in loads):
            return intervals
    return None


def _is_linear(load: History, interval: float) -> bool:
    """Return whether a load is linear in each of equal intervals from t = 0 on.

    It is if its samples begin at the end of an interval, their step is a whole number of intervals,
    both to 1e-9, and it is not multiplied by a sine. It may jump between two intervals.

    Args:
        load: The load.
        interval: Length of an interval, in s.
    """
    if load.frequency:
        return False
    ratios = np.array([load.step, load.start]) / interval
    # decimal steps are whole multiples but for rounding; a load shorter than an interval is none
    is_multiple = np.abs(ratios - np.round(ratios)).max() < 1e-9 * max(1.0, ratios.max())
    return bool(is_multiple) and bool(ratios[0] > 0.5)


@compiled
def _march_modes(
    factor: Array,
    intervals: int,
    start: Array,
    by_end: Array,
    by_slope: Array,
    ends: Array,
    slopes: Array,
    read: Array,
    out: Array,
) -> None:
    """Write the outputs Im Σ_k read_ok z_k at time nodes to `out`, in place.

    The modal coordinates z_k obey ż_k = σ_k z_k + Σ_l moved_kl f_l(t). Over an interval of length
    h, z_k(t + h) = exp(σ_k h) z_k(t) + Σ_l moved_kl (J₀ end_l − J₁ slope_l), where J_j = ∫ exp(σ_k
    τ) τ^j dτ over the interval, and load l is end_l − slope_l τ a time τ before the end of the
    interval.

    Args:
        factor: exp(σ h) of n modes at S parameter sets, complex, shape (S, n).
        intervals: Number of intervals in a step, from one time node to the next.
        start: Complex z at t = 0, shape (S, n).
        by_end: moved times J₀, where moved is ΦᵀM b, what a unit of each of L loads adds to ż,
            shape (S, n, L).
        by_slope: moved times −J₁, of the same shape.
        ends: Values of the loads at the ends of the intervals, shape (intervals in all steps, L).
        slopes: Slopes of the loads in the intervals, of the same shape.
        read: Complex output rows times mode shapes, shape (S, outputs, n).
        out: Receives the outputs, shape (S, time nodes, outputs).
    """
    samples, n_nodes, m = out.shape
    n, n_loads = by_end.shape[1:]
    real = np.empty(n)
    imaginary = np.empty(n)
    for s in range(samples):
        for k in range(n):
            real[k] = start[s, k].real
            imaginary[k] = start[s, k].imag
        for node in range(n_nodes):
            for i in range((node - 1) * intervals if node else 0, node * intervals):
                for k in range(n):
                    before = real[k]
                    w = factor[s, k]
                    real[k] = w.real * before - w.imag * imaginary[k]
                    imaginary[k] = w.real * imaginary[k] + w.imag * before
                for load in range(n_loads):
                    a = ends[i, load]
                    slope = slopes[i, load]
                    for k in range(n):
                        change = a * by_end[s, k, load] + slope * by_slope[s, k, load]
                        real[k] += change.real
                        imaginary[k] += change.imag
            for o in range(m):
                total = 0.0
                for k in range(n):
                    total += read[s, o, k].real * imaginary[k] + read[s, o, k].imag * real[k]
                out[s, node, o] = total
