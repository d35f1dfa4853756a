"""Modes with dashpots as Taylor models over a box: q(t; p) = 2 Re Σ_k φ_k(p) exp(λ_k(p) t).

(λ² M + λ D + K) φ = 0 is solved degree by degree about the middle of the box (perturbation series;
Stewart, Sun 1990). The polynomials need no proof of their own: `bounds.model_error` bounds what
they miss in the equations of motion, whatever the distances of the eigenvalues.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.frame.boxes import Boxes
from alphacut.frame.calculus.monomials import matmul, product_part
from alphacut.frame.calculus.taylor_model import TaylorModel, concatenate, solution_series, solve
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.geometric_mean import geometric_mean
from alphacut.frame.records.history import History
from alphacut.frame.response.duhamel import absolute_moments
from alphacut.frame.structures.linear import LinearSystem

EQUAL = 1e-6
"""Relative distance of two eigenvalues below which they count as equal."""


@dataclass(frozen=True, eq=False)
class DampedStructure:
    """M q̈ + D q̇ + K q = f of N unknowns and m outputs over the unit box of the inputs.

    Coordinates are those in which the middle of the box has M = 1 and K = diag(ω²). What moves it
    are S sources: the start, then a unit impulse of the ground and of each history of forces. Each
    starts the motion by K q(0) = static and M q̇(0) = impulse.
    """

    mass: TaylorModel  # M, (N, N)
    damping: TaylorModel  # D, (N, N)
    stiffness: TaylorModel  # K, (N, N)
    omega: Array  # ω, rising, (N,), in rad/s
    static: TaylorModel  # forces of the sources, (N, S)
    impulse: TaylorModel  # impulses of the sources, (N, S)
    rows: TaylorModel  # what outputs take of [q, q̇], (m, 2N)
    # what a unit of each history of forces adds to outputs at once, (m, H); None if nothing
    feeds: TaylorModel | None

    @classmethod
    def over_box(cls, system: LinearSystem, boxes: Boxes, order: int) -> DampedStructure:
        """The structure over the widest of some boxes, as Taylor models of an order.

        Raises:
            UnprovedError: The mass in the middle, or a quantity that must be positive, is not so,
                or the structure can drift.
        """
        d, inputs = len(boxes.names), TaylorModel.variables(boxes.centre, boxes.radius, order)
        parameters = {x: TaylorModel.constant(v, d, order) for x, v in system.parameters.items()}
        parameters |= {name: inputs[i] for i, name in enumerate(boxes.names)}
        full = system.assembly(parameters)
        damping = full.dashpots
        for factor, matrix in zip(full.rayleigh, (full.mass, full.springs), strict=True):
            damping = damping + factor * matrix if factor.magnitude() > 0 else damping
        try:
            squared, basis = eigh(full.stiffness.value, full.mass.value)
        except np.linalg.LinAlgError:
            raise UnprovedError("the mean mass matrix is not positive definite") from None
        if not squared[0] > np.finfo(float).eps * squared[-1]:
            raise UnprovedError("a mode does not oscillate", "hold the structure by springs")
        M, D, K = (basis.T @ matrix @ basis for matrix in (full.mass, damping, full.stiffness))
        omega = np.sqrt(squared)
        if full.ratios and full.ratios[0].magnitude() > 0:  # one ζ of all modes
            D = D + full.ratios[0] * 2.0 * geometric_mean(M, K, omega)
        static, impulse = full.stiffness @ full.q0[:, None], full.mass @ full.v0[:, None]
        impulses = [impulse if full.impulse is None else impulse + full.impulse]
        if system.ground is not None:
            impulses.append(full.mass @ -full.pattern[:, None])
        if full.forces is not None:
            impulses.append(full.forces)
        statics = [static if full.static is None else static + full.static]
        statics += [impulse * 0.0 for impulse in impulses[1:]]
        factors = full.row_factors[:, None]
        rows = factors * (full.rows @ np.kron(np.eye(2), basis))
        feeds = None
        if full.accelerated.any():  # q̈ + ι a = M⁻¹ (b f − D q̇ − K q)
            reading = factors * solve(M, M.like((full.accelerated @ basis).T)).T
            rows = rows - concatenate([reading @ K, reading @ D], -1)
            feeds = None if full.forces is None else reading @ (basis.T @ full.forces)
        return cls(
            mass=M,
            damping=D,
            stiffness=K,
            omega=omega,
            static=basis.T @ concatenate(statics, -1),
            impulse=basis.T @ concatenate(impulses, -1),
            rows=rows,
            feeds=feeds,
        )


@dataclass(frozen=True, eq=False)
class DampedModes:
    """Polynomials of n modes of a structure with S sources, N unknowns, m outputs."""

    rate: TaylorModel  # λ_k, Im λ_k > 0, (n,), in 1/s
    shape: TaylorModel  # φ_k of each source, (S, n, N)
    velocity: TaylorModel  # w_k ≈ λ_k φ_k, (S, n, N)

    @classmethod
    def of_structure(cls, structure: DampedStructure, chosen: Ints) -> DampedModes:
        """Series of the modes in places `chosen` (n,) by rising |λ|, about the middle of the box.

        Raises:
            UnprovedError: One does not oscillate, or has the frequency of another one.
        """
        rate, shape = _eigen_series(structure, chosen)
        force = shape @ structure.impulse
        if structure.static.magnitude().any():
            force = force - (shape @ structure.static) * _reciprocal(rate[:, None])
        # near a pole (λ² M + λ D + K)⁻¹ is φ φᵀ / (φᵀ (2 λ M + D) φ (λ − λ_k))
        weighted = (rate * 2.0)[:, None] * (shape @ structure.mass)
        weighted = weighted + shape @ structure.damping
        norm = (weighted * shape) @ np.ones((len(structure.omega), 1))
        shape = ((force * _reciprocal(norm)).T[..., None] * shape).polynomial
        return cls(rate, shape, (rate[:, None] * shape).polynomial)

    def outputs(self, structure: DampedStructure) -> TaylorModel:
        """Outputs of the states [φ_k, w_k], shape (S, n, m)."""
        n = len(structure.omega)
        return self.shape @ structure.rows[:, :n].T + self.velocity @ structure.rows[:, n:].T


def needed_modes(
    structure: DampedStructure, loads: Sequence[History], time: Array, allowed: Array | float
) -> Ints:
    """Places (n,) by rising |λ| of the modes without which outputs miss at most `allowed` (m,).

    An output r q + s q̇ is at most √(r K⁻¹ rᵀ + s M⁻¹ sᵀ) times √(qᵀ K q + q̇ᵀ M q̇). All is that of
    the middle of the box: what is left out counts as an error of the start in the proof. `loads`
    are the histories of all sources but the start.
    """
    rate, shape, norm = _middle_modes(structure)
    omega, (r, s) = structure.omega, np.split(structure.rows.value, 2, axis=1)
    force = shape @ structure.impulse.value - shape @ structure.static.value / rate[:, None]
    amplitude = np.abs(force / norm[:, None])  # (2N, S)
    for k, history in enumerate(loads, start=1):  # |∫ exp(λ τ) a| ≤ min(∫ |a|, max |a| / −Re λ)
        steady = history.extremes[0] / np.maximum(-rate.real, 1e-300)
        amplitude[:, k] *= np.minimum(absolute_moments(0.0, history, time)[0, -1], steady)
    energy = np.hypot(norm_of(shape * omega), np.abs(rate) * norm_of(shape))
    reads = np.hypot(norm_of(r / omega), norm_of(s)) / np.maximum(allowed, 1e-300)
    size = 2 * energy * amplitude.sum(1) * reads.max()
    upper = np.flatnonzero(rate.imag >= 0)  # one of each conjugate pair
    order = upper[np.argsort(size[upper])]
    return np.setdiff1d(upper, order[:-1][np.cumsum(size[order[:-1]]) <= 1])


def _middle_modes(structure: DampedStructure) -> tuple[Array, Array, Array]:
    """λ (2N,), unit shapes φ as rows and φᵀ (2 λ M + D) φ in the middle; Im λ > 0 first, by |λ|."""
    omega, n = structure.omega, len(structure.omega)
    D = structure.damping.value
    lower = np.hstack([-np.diag(omega**2), -D])
    rate, X = np.linalg.eig(np.vstack([np.eye(n, 2 * n, n), lower]))
    group = np.where(_oscillates(rate), 0, np.where(_oscillates(rate.conj()), 2, 1))
    order = np.lexsort((np.abs(rate), group))
    rate, shape = rate[order], X[:n, order].T
    shape = shape / norm_of(shape)[:, None]
    for k in np.flatnonzero(_oscillates(rate)):
        alike = _equal_modes(rate, k)
        if len(alike) > 1 and k == alike[0]:
            shape[alike] = _orthogonal_shapes(shape[alike], rate[k], D)
    return rate, shape, ((2 * rate[:, None] * shape + shape @ D) * shape).sum(1)


def norm_of(vectors: Array) -> Array:
    """Euclidean norms along the last axis."""
    return np.asarray(np.linalg.norm(vectors, axis=-1))


def _eigen_series(structure: DampedStructure, chosen: Ints) -> tuple[TaylorModel, TaylorModel]:
    """λ (n,) and φ (n, N) with (λ² M + λ D + K) φ = 0 to the order of M, about the middle."""
    # in degree m, (λ₀² M₀ + λ₀ D₀ + K₀) φ_m + λ_m (2 λ₀ M₀ + D₀) φ₀ is known, and φ₀* φ_m = 0
    M, D, K = structure.mass, structure.damping, structure.stiffness
    rates, shapes, _ = _middle_modes(structure)
    lam, phi = rates[chosen], shapes[chosen]
    if not _oscillates(lam).all():
        raise UnprovedError("a mode does not oscillate", "take less damping, or graph-follower")
    N, d = phi.shape[1], M.inputs
    # of modes of equal λ all φ border the matrix, which is singular else; the others' parts of the
    # solution, `couplings`, are zero where one shape goes on through the whole box
    inverse, couplings = np.empty((len(lam), N + 1, N), complex), dict[int, Array]()
    for k, x in enumerate(lam):
        alike = _equal_modes(rates, chosen[k])
        border, zeros = shapes[alike], np.zeros((len(alike), len(alike)))
        pencil = x**2 * M.value + x * D.value + K.value
        columns = (2 * x * M.value + D.value) @ border.T
        solved = np.linalg.inv(np.block([[pencil, columns], [border.conj(), zeros]]))[:, :N]
        is_own = alike == chosen[k]
        inverse[k] = np.vstack([solved[:N], solved[N:][is_own]])
        couplings[k] = solved[N:][~is_own]
    # by degree: λ (n, 1), φ, w = λ φ and w M
    L, P, W = [lam[None, :, None]], [phi[None]], [lam[:, None] * phi[None]]
    U = [W[0] @ M.value]
    for m in range(1, M.order + 1):
        W.append(product_part(L, P, m, d, np.multiply, lowest=(1, 1)))  # of lower degrees alone
        U.append(product_part(W, M.parts, m, d, matmul))
        known = lam[:, None] * U[m] + product_part(L, U, m, d, np.multiply, lowest=(1, 1))
        known += product_part(W, D.parts, m, d, matmul) + product_part(P, K.parts, m, d, matmul)
        for k, rows in couplings.items():
            _require_uncoupled(known[:, k] @ rows.T, lam[k])
        found = np.einsum("kij,mkj->mki", inverse, -known)
        P.append(found[..., :N])
        L.append(found[..., N:])
        added = lam[:, None] * P[m] + L[m] * phi
        W[m] += added
        U[m] += added @ M.value
    rate = TaylorModel(tuple(L), np.zeros((len(lam), 1)), d, M.order)
    return rate[:, 0], TaylorModel(tuple(P), np.zeros(phi.shape), d, M.order)


def _oscillates(rate: Array) -> Mask:
    """Whether eigenvalues are the upper ones of a conjugate pair."""
    return np.asarray(rate.imag > 1e-9 * np.abs(rate))


def _equal_modes(rates: Array, k: int) -> Ints:
    """Places of all eigenvalues that equal number k, itself among them."""
    return np.flatnonzero(np.abs(rates - rates[k]) <= EQUAL * np.abs(rates[k]))


def _orthogonal_shapes(shape: Array, rate: complex, D: Array) -> Array:
    """Shapes φ (g, N) of the span of those of one λ, with φ_iᵀ (2 λ + D) φ_j = 0 for i ≠ j."""
    basis = np.linalg.qr(shape.T)[0]
    form, g = basis.T @ (2 * rate * basis + D @ basis), len(shape)
    # Takagi's form V S Vᵀ of a complex symmetric matrix (Horn, Johnson 2013, section 4.4)
    A, B = form.real, form.imag
    vectors = np.linalg.eigh(np.block([[A, B], [B, -A]]))[1][:, g:]
    V = vectors[:g] + 1j * vectors[g:]
    return np.asarray((basis @ V.conj()).T)


def _require_uncoupled(coupling: Array, rate: complex) -> None:
    """Refuse modes of one eigenvalue between which a change of the inputs chooses the shapes."""
    if (np.abs(coupling) > EQUAL * np.abs(rate)).any():
        what = f"modes have the same frequency, {np.abs(rate):.4g} rad/s, and the inputs part them"
        raise UnprovedError(what, "take the method auto or improved-graph-follower")


def _reciprocal(x: TaylorModel) -> TaylorModel:
    """Series of 1/x about the middle, entry by entry, without a remainder."""
    matrices = x[..., None, None]
    return solution_series(matrices, x.like(np.ones_like(matrices.value)))[..., 0, 0]


def require_dissipation(system: LinearSystem, boxes: Boxes) -> None:
    """Refuse structures that are not known to lose energy everywhere in the box.

    Raises:
        UnprovedError: A parameter leaves its range, or see `LinearSystem.require_dissipation`.
    """
    lowest = {**system.parameters, **dict(zip(boxes.names, boxes.lower[0].tolist(), strict=True))}
    for name, low, high in zip(boxes.names, boxes.lower[0], boxes.upper[0], strict=True):
        if not (parameter := system.parameter(name)).admits(low, high):
            what = f"{name} reaches from {low:g} to {high:g}"
            raise UnprovedError(f"{what}, and is known to be {parameter.range or 'finite'}")
    system.require_dissipation(lowest)
