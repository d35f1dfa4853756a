"""Modes with dashpots as Taylor models over a box: q(t; p) = 2 Re Σ_k φ_k(p) exp(λ_k(p) t).

(λ² M + λ D + K) φ = 0 is solved degree by degree about the midpoint of the box (perturbation
series; Stewart, Sun 1990). The polynomials need no proof of their own: `modal_model` bounds
what they miss in the equations of motion, whatever the distances of the eigenvalues.

Damping of all modes by one ratio ζ is 2 ζ M Φ diag(ω) Φᵀ M = 2 ζ (M # K), with the geometric mean
M # K of two positive definite matrices. It is the positive definite X with X M⁻¹ X = K (Pusz,
Woronowicz 1975; Bhatia 2007, section 4.1), X = M √(M⁻¹K), and is enclosed as a Taylor model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.frame.boxes import Boxes
from alphacut.frame.calculus.polynomials import matmul, product_part
from alphacut.frame.calculus.taylor_model import TaylorModel, concatenate, solution_series, solve
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.structure import parameter_models
from alphacut.frame.records.history import History
from alphacut.frame.response.duhamel import absolute_moments
from alphacut.frame.structures.linear import LinearSystem
from alphacut.frame.structures.loads import adds_at_once

EQUAL = 1e-6
"""Relative distance of two eigenvalues below which they count as equal: series of modes that are
closer than this would have coefficients without accuracy. Tuned."""


@dataclass(frozen=True, eq=False)
class DampedStructure:
    """M q̈ + D q̇ + K q = f of N unknowns and m outputs over the unit box of the inputs.

    Coordinates are those in which the midpoint of the box has M = 1 and K = diag(ω²). It is moved
    by S sources: the initial state, then a unit impulse of the ground and of each history of
    forces. Each starts the response by K q(0) = static force and M q̇(0) = impulse.
    """

    mass: TaylorModel  # M, (N, N)
    damping: TaylorModel  # D, (N, N)
    stiffness: TaylorModel  # K, (N, N)
    omega: Array  # ω, rising, (N,), in rad/s
    static_forces: TaylorModel  # of the sources, (N, S)
    impulses: TaylorModel  # of the sources, (N, S)
    output_rows: TaylorModel  # rows of the outputs on [q, q̇], (m, 2N)
    # what a unit of each history of forces adds to outputs at once, (m, H); None if nothing
    feeds: TaylorModel | None

    @classmethod
    def over_box(
        cls,
        system: LinearSystem,
        boxes: Boxes,
        order: int,
        fixed: Mapping[str, float] | None = None,
    ) -> DampedStructure:
        """Return the structure over the widest of some boxes, as Taylor models of an order.

        Other parameters have the values in `fixed`, or else nominal ones.

        Raises:
            UnprovedError: The mass at the midpoint, or a quantity that must be positive, is not so,
                or the structure can drift.
        """
        from scipy.linalg import eigh  # takes time to import

        full = system.assembly(
            parameter_models(system, boxes.names, boxes.centre, boxes.radius, order, fixed=fixed)
        )
        a, b = full.rayleigh
        damping = full.dashpots
        if a.magnitude() > 0:
            damping = damping + a * full.mass
        if b.magnitude() > 0:
            damping = damping + b * full.springs

        # Coordinates of the undamped modes at the midpoint.
        try:
            eigenvalues, basis = eigh(full.stiffness.value, full.mass.value)
        except np.linalg.LinAlgError:
            raise UnprovedError("the mean mass matrix is not positive definite") from None
        if not eigenvalues[0] > np.finfo(float).eps * eigenvalues[-1]:
            raise UnprovedError("a mode does not oscillate", "hold the structure by springs")
        omega = np.sqrt(eigenvalues)
        M = basis.T @ full.mass @ basis
        D = basis.T @ damping @ basis
        K = basis.T @ full.stiffness @ basis
        if full.ratios and full.ratios[0].magnitude() > 0:  # one ζ of all modes
            D = D + full.ratios[0] * 2.0 * geometric_mean(M, K, omega)

        # The first source is the initial state.
        static = full.stiffness @ full.q0[:, None]
        if full.static is not None:
            static = static + full.static
        impulse = full.mass @ full.v0[:, None]
        if full.impulse is not None:
            impulse = impulse + full.impulse
        impulses = [impulse]
        if system.ground is not None:
            impulses.append(full.mass @ -full.pattern[:, None])
        if full.forces is not None:
            impulses.append(full.forces)
        statics = [static]
        statics += [impulse * 0.0 for impulse in impulses[1:]]

        factors = full.row_factors[:, None]
        rows = factors * (full.rows @ np.kron(np.eye(2), basis))
        feeds = None
        if full.accelerated.any():  # q̈ + ι a = M⁻¹ (b f − D q̇ − K q)
            right_sides = M.like((full.accelerated @ basis).T)
            over_mass = factors * solve(M, right_sides).T
            rows = rows - concatenate([over_mass @ K, over_mass @ D], -1)
            at_once = adds_at_once(full.loads)
            if full.forces is not None and at_once.any():
                feeds = over_mass @ (basis.T @ full.forces) * at_once
        return cls(
            mass=M,
            damping=D,
            stiffness=K,
            omega=omega,
            static_forces=basis.T @ concatenate(statics, -1),
            impulses=basis.T @ concatenate(impulses, -1),
            output_rows=rows,
            feeds=feeds,
        )


@dataclass(frozen=True, eq=False)
class DampedModes:
    """Polynomials of n modes of a structure with S sources, N unknowns, m outputs."""

    eigenvalue: TaylorModel  # λ_k, Im λ_k > 0, (n,), in 1/s
    shape: TaylorModel  # φ_k for each source, (S, n, N)
    velocity: TaylorModel  # ψ_k ≈ λ_k φ_k, (S, n, N)

    @classmethod
    def of_structure(cls, structure: DampedStructure, chosen: Ints) -> DampedModes:
        """Return series of some modes about the midpoint of the box, for each source.

        Args:
            structure: The structure as Taylor models over the box: N unknowns and S sources.
            chosen: Indices of the modes, shape (n,), among those at the midpoint with Im λ ≥ 0: the
                oscillating ones first, each kind by rising |λ|.

        Returns:
            Polynomials of the eigenvalues λ (n,), of the displacements φ (S, n, N), scaled so that
            the response to a unit of the source is 2 Re Σ φ exp(λ t), and of the velocities λ φ,
            shape (S, n, N).

        Raises:
            UnprovedError: One of them does not oscillate, or has the frequency of another one, from
                which the inputs separate it.
            numpy.linalg.LinAlgError: One of them is defective at the midpoint.
        """
        eigenvalue, shape = _eigen_series(structure, chosen)
        force = shape @ structure.impulses
        if structure.static_forces.magnitude().any():
            static = (shape @ structure.static_forces) * _reciprocal(eigenvalue[:, None])
            force = force - static
        # Near a pole (λ² M + λ D + K)⁻¹ is φ φᵀ / (φᵀ (2 λ M + D) φ (λ − λ_k)).
        weighted = (eigenvalue * 2.0)[:, None] * (shape @ structure.mass)
        weighted = weighted + shape @ structure.damping
        norm = (weighted * shape) @ np.ones((len(structure.omega), 1))  # φᵀ (2 λ M + D) φ, (n, 1)
        of_sources = (force * _reciprocal(norm)).T[..., None]
        shape = (of_sources * shape).polynomial
        return cls(eigenvalue, shape, (eigenvalue[:, None] * shape).polynomial)

    def outputs(self, structure: DampedStructure) -> TaylorModel:
        """Return the outputs of the states [φ_k, ψ_k], shape (S, n, m)."""
        n = len(structure.omega)
        on_displacements = structure.output_rows[:, :n]
        on_velocities = structure.output_rows[:, n:]
        return self.shape @ on_displacements.T + self.velocity @ on_velocities.T


def needed_modes(
    structure: DampedStructure, loads: Sequence[History], time: Array, tolerance: Array | float
) -> Ints:
    """Return the indices of the modes that are needed for outputs within a tolerance.

    An output r q + s q̇ is at most √(r K⁻¹ rᵀ + s M⁻¹ sᵀ) √(qᵀ K q + q̇ᵀ M q̇). All is estimated at
    the midpoint of the box; what is left out counts as an error of the initial state in the proof.

    Args:
        structure: The structure, whose sources are the initial state and then these loads.
        loads: Histories of all sources but the initial state, in their order.
        time: Time nodes, shape (T,), in s.
        tolerance: Allowed error of each output by all omitted modes together, shape (m,), or one of
            all. At 0 all modes are needed that add anything.

    Returns:
        Rising indices, shape (n,), n ≥ 1, in the list of modes with Im λ ≥ 0. In this list
        oscillating modes stand before real ones, each kind by rising |λ|.
    """
    modes = _midpoint_modes(structure)
    rate = modes.eigenvalue
    shape = modes.shape
    static = shape @ structure.static_forces.value / rate[:, np.newaxis]
    force = shape @ structure.impulses.value - static
    amplitude = np.abs(force / modes.norm[:, np.newaxis])  # (2N, S)
    for k, history in enumerate(loads, start=1):
        amplitude[:, k] *= absolute_moments(0.0, history, time)[0, -1]  # ∫ |a|, as in the proof
    energy = np.hypot(norm_of(shape * structure.omega), np.abs(rate) * norm_of(shape))
    r, s = np.split(structure.output_rows.value, 2, axis=1)
    output_norms = np.hypot(norm_of(r / structure.omega), norm_of(s))
    # 1e-200 stands for 0, without an overflow by the products below
    output_norms = output_norms / np.maximum(tolerance, 1e-200)
    # by each mode with its conjugate, the error over the tolerance of the most affected output
    size = 2 * energy * amplitude.sum(axis=1) * output_norms.max()

    # The smallest ones are omitted as long as their sum stays below the tolerance.
    upper = np.flatnonzero(rate.imag >= 0)  # one of each conjugate pair
    by_size = upper[np.argsort(size[upper])]
    candidates = by_size[:-1]
    omitted = candidates[np.cumsum(size[candidates]) <= 1]
    return np.setdiff1d(upper, omitted)


class _MidpointModes(NamedTuple):
    """All 2N modes of a structure at the midpoint of the box, those with Im λ > 0 first, by |λ|."""

    eigenvalue: Array  # λ, (2N,)
    shape: Array  # φ of unit length as rows, (2N, N)
    norm: Array  # φᵀ (2 λ M + D) φ, (2N,)


def _midpoint_modes(structure: DampedStructure) -> _MidpointModes:
    """Return all 2N modes of a damped structure at the midpoint of the box: M = 1, K = diag(ω²).

    Modes of equal eigenvalues that oscillate get shapes that are orthogonal in the sense φ_iᵀ (2 λ
    + D) φ_j = 0.

    Args:
        structure: N unknowns in coordinates with this mass and stiffness at the midpoint; D is its
            damping there.

    Returns:
        `eigenvalue` λ (2N,), those with Im λ > 0 first, then real ones, then conjugates, each by
        rising |λ|; `shape` φ as rows of unit length (2N, N); and `norm` φᵀ (2 λ + D) φ (2N,), which
        is about 0 where the mode is defective.
    """
    omega = structure.omega
    n = len(omega)
    D = structure.damping.value
    lower_rows = np.hstack([-np.diag(omega**2), -D])
    rate, vectors = np.linalg.eig(np.vstack([np.eye(n, 2 * n, n), lower_rows]))
    # Upper eigenvalues of conjugate pairs come first, lower ones last, real ones between them.
    is_upper = _oscillates(rate)
    is_lower = _oscillates(rate.conj())
    group = np.select([is_upper, is_lower], [0, 2], 1)
    order = np.lexsort((np.abs(rate), group))
    rate = rate[order]
    shape = vectors[:n, order].T
    shape = shape / norm_of(shape)[:, np.newaxis]
    for k in np.flatnonzero(_oscillates(rate)):
        equal = _equal_modes(rate, k)
        if len(equal) > 1 and k == equal[0]:
            shape[equal] = _orthogonal_shapes(shape[equal], rate[k], D)
    norm = ((2 * rate[:, np.newaxis] * shape + shape @ D) * shape).sum(axis=1)
    return _MidpointModes(rate, shape, norm)


def norm_of(vectors: Array) -> Array:
    """Return Euclidean norms along the last axis."""
    return np.asarray(np.linalg.norm(vectors, axis=-1))


def _eigen_series(structure: DampedStructure, chosen: Ints) -> tuple[TaylorModel, TaylorModel]:
    """Return series about the midpoint of λ, shape (n,), and φ, shape (n, N), of n damped modes.

    They solve (λ² M + λ D + K) φ = 0 degree by degree, without a bound of their error. In degree m,
    (λ₀² M₀ + λ₀ D₀ + K₀) φ_m + λ_m (2 λ₀ M₀ + D₀) φ₀ is known from lower degrees, and φ₀* φ_m = 0
    is chosen.

    Args:
        structure: M, D and K as Taylor models of N unknowns.
        chosen: Indices of the modes, shape (n,), among those at the midpoint with Im λ ≥ 0: the
            oscillating ones first, each kind by rising |λ|.

    Raises:
        UnprovedError: One of the modes does not oscillate, or modes of equal eigenvalues are
            separated by the inputs.
        numpy.linalg.LinAlgError: A mode is defective at the midpoint.
    """
    M = structure.mass
    D = structure.damping
    K = structure.stiffness
    d = M.inputs
    at_midpoint = _midpoint_modes(structure)
    rate = at_midpoint.eigenvalue[chosen]
    shape = at_midpoint.shape[chosen]
    if not _oscillates(rate).all():
        raise UnprovedError("a mode does not oscillate", "take less damping, or graph-follower")
    bordered = [_bordered_inverse(structure, at_midpoint, k) for k in chosen]
    inverses = np.stack([x.inverse for x in bordered])

    # By degree: λ (n, 1), φ, w = λ φ and w M (n, N).
    N = shape.shape[1]
    eigenvalues = [rate[np.newaxis, :, np.newaxis]]
    shapes = [shape[np.newaxis]]
    velocities = [rate[:, np.newaxis] * shape[np.newaxis]]
    momenta = [velocities[0] @ M.value]
    for m in range(1, M.order + 1):
        # Products of lower degrees alone; the terms with λ_m and φ_m are added below.
        velocities.append(product_part(eigenvalues, shapes, m, d, np.multiply, lowest=(1, 1)))
        momenta.append(product_part(velocities, M.parts, m, d, matmul))
        known = rate[:, np.newaxis] * momenta[m]
        known += product_part(eigenvalues, momenta, m, d, np.multiply, lowest=(1, 1))
        of_damping = product_part(velocities, D.parts, m, d, matmul)
        known += of_damping + product_part(shapes, K.parts, m, d, matmul)
        # What couples modes of one eigenvalue would be divided by their difference, which is 0.
        for k, x in enumerate(bordered):
            _require_uncoupled(known[:, k] @ x.couplings.T, rate[k])
        found = np.einsum("kij,mkj->mki", inverses, -known)  # φ_m, then λ_m, (monomials, n, N + 1)
        shapes.append(found[..., :N])
        eigenvalues.append(found[..., N:])
        added = rate[:, np.newaxis] * shapes[m] + eigenvalues[m] * shape
        velocities[m] += added
        momenta[m] += added @ M.value
    eigenvalue = TaylorModel(tuple(eigenvalues), np.zeros((len(rate), 1)), d, M.order)
    return eigenvalue[:, 0], TaylorModel(tuple(shapes), np.zeros(shape.shape), d, M.order)


class _BorderedInverse(NamedTuple):
    """Rows of the inverse of λ² M + λ D + K at an eigenvalue, bordered by its modes."""

    inverse: Array  # rows for φ_m and λ_m of the mode, (N + 1, N)
    # rows for the parts of the right side along the other modes of the same eigenvalue, (g − 1, N);
    # they must give 0, so that one shape goes on through the whole box
    couplings: Array


def _bordered_inverse(
    structure: DampedStructure, modes: _MidpointModes, k: int
) -> _BorderedInverse:
    """Return rows of the inverse of λ² M + λ D + K, bordered by its modes, at one eigenvalue.

    The matrix is singular at an eigenvalue. Bordered by the shapes φ of all g modes of this
    eigenvalue, as rows φ* below and columns (2 λ M + D) φ beside, it is regular. All is taken at
    the midpoint of the box.

    Args:
        structure: M, D and K of N unknowns.
        modes: All modes at the midpoint.
        k: Index of the mode.

    Returns:
        `inverse`, the rows for the shape and for the eigenvalue of the mode, shape (N + 1, N); and
        `couplings`, those for the other modes of the same eigenvalue, shape (g − 1, N).

    Raises:
        numpy.linalg.LinAlgError: The bordered matrix is singular, since a mode is defective.
    """
    x = modes.eigenvalue[k]
    M = structure.mass.value
    D = structure.damping.value
    K = structure.stiffness.value
    N = len(M)
    equal = _equal_modes(modes.eigenvalue, k)
    border = modes.shape[equal]
    columns = (2 * x * M + D) @ border.T
    zeros = np.zeros((len(equal), len(equal)))
    pencil = x**2 * M + x * D + K
    inverse = np.linalg.inv(np.block([[pencil, columns], [border.conj(), zeros]]))[:, :N]
    is_own = equal == k
    of_border = inverse[N:]
    return _BorderedInverse(np.vstack([inverse[:N], of_border[is_own]]), of_border[~is_own])


def _oscillates(rate: Array) -> Mask:
    """Return whether eigenvalues are the upper ones of a conjugate pair."""
    return np.asarray(rate.imag > 1e-9 * np.abs(rate))


def _equal_modes(rates: Array, k: int) -> Ints:
    """Return the numbers of all eigenvalues that equal number k, itself among them."""
    return np.flatnonzero(np.abs(rates - rates[k]) <= EQUAL * np.abs(rates[k]))


def _orthogonal_shapes(shape: Array, rate: complex, D: Array) -> Array:
    """Return shapes φ of g modes of one eigenvalue λ with φ_iᵀ (2 λ + D) φ_j = 0 for i ≠ j.

    They span the same space as the given ones, have unit length, and follow from Takagi's form V S
    Vᵀ of the complex symmetric matrix of this bilinear form (Horn, Johnson 2013, section 4.4). The
    mass is 1.

    Args:
        shape: Linearly independent shapes as rows, complex, shape (g, N).
        rate: λ, in 1/s.
        D: Damping, symmetric, shape (N, N).

    Returns:
        Shape (g, N).
    """
    g = len(shape)
    basis = np.linalg.qr(shape.T)[0]
    form = basis.T @ (2 * rate * basis + D @ basis)
    real = form.real
    imag = form.imag
    # For A = V S Vᵀ with a unitary V the columns v of V obey A v̄ = s v, s ≥ 0. In real and
    # imaginary parts of v this is an eigenvalue problem of a symmetric matrix, whose eigenvalues
    # are ± s: the upper half of them, which NumPy puts last, belongs to V.
    vectors = np.linalg.eigh(np.block([[real, imag], [imag, -real]]))[1][:, g:]
    V = vectors[:g] + 1j * vectors[g:]
    return np.asarray((basis @ V.conj()).T)


def _require_uncoupled(coupling: Array, rate: complex) -> None:
    """Raise UnprovedError where a change of the inputs separates modes of one eigenvalue."""
    if (np.abs(coupling) > EQUAL * np.abs(rate)).any():
        what = f"modes have the same frequency, {np.abs(rate):.4g} rad/s, and the inputs part them"
        raise UnprovedError(what, "take the method auto or improved-graph-follower")


def _reciprocal(x: TaylorModel) -> TaylorModel:
    """Return series of 1/x about the midpoint, entry by entry, without a remainder."""
    matrices = x[..., None, None]
    ones = x.like(np.ones_like(matrices.value))
    return solution_series(matrices, ones)[..., 0, 0]


def require_dissipation(
    system: LinearSystem, boxes: Boxes, fixed: Mapping[str, float] | None = None
) -> None:
    """Check that a structure is known to lose energy everywhere in the widest of some nested boxes.

    Args:
        system: The structure.
        boxes: Boxes of its inputs, the widest one first.
        fixed: Values of other parameters by name, where they are not nominal.

    Raises:
        UnprovedError: A parameter leaves the range in which it has a meaning, unknowns have no
            mass, or a term of the damping may feed energy into the structure.
    """
    lowest = {**system.parameters, **(fixed or {})}
    for name, low, high in zip(boxes.names, boxes.lower[0], boxes.upper[0], strict=True):
        lowest[name] = float(low)
        parameter = system.parameter(name)
        if not parameter.admits(low, high):
            what = f"{name} reaches from {low:g} to {high:g}"
            raise UnprovedError(f"{what}, and is known to be {parameter.range or 'finite'}")
    system.require_dissipation(lowest)


def geometric_mean(mass: TaylorModel, stiffness: TaylorModel, omega: Array) -> TaylorModel:
    """Enclose the geometric mean X = M # K over the box, shape (n, n), by Brouwer's theorem.

    It is the positive definite X with X M⁻¹ X = K. Let X = X̃ + E with the series X̃ of X about the
    midpoint. With W = M⁻¹, P = X̃ W − diag(ω) and Δ = K − X̃ W X̃ the remainder E obeys

        (ω_i + ω_j) E_ij = (Δ − E Pᵀ − P E − E W E)_ij.

    Where a bound |E| ≤ B gives itself back through this equation, Brouwer's theorem gives such an E
    at every u of the box (as Rump 2001). The map contracts (`right_side_bound`): E is the only one
    there and continuous in u; as Eᵀ solves the equation, too, E is symmetric. The squares of the
    eigenvalues of M⁻¹ X are those of M⁻¹ K, which are positive, so that no eigenvalue of X passes
    zero. On the way from u to the midpoint, and from the rounded matrices there to M = 1 and K =
    diag(ω²), whose terms lie within the same bounds and whose solution is E = 0, X thus stays as
    definite as diag(ω) is: it is the positive definite solution.

    Args:
        mass: M, shape (n, n), at the midpoint of the box the identity but for rounding.
        stiffness: K, at the midpoint diag(ω²) but for rounding. Both are positive definite.
        omega: ω, shape (n,), positive.

    Raises:
        UnprovedError: The box is so wide that no bound gives itself back, or that M may be
            singular.
    """
    sums = omega[:, np.newaxis] + omega
    inverse_mass = solve(mass, mass.like(np.eye(len(omega))))
    series = _mean_series(inverse_mass, stiffness, omega)
    product = series @ inverse_mass
    defect = (stiffness - product @ series).magnitude()
    coupling = (product - np.diag(omega)).magnitude()
    inverse_magnitude = inverse_mass.magnitude()
    # The bound is widened by a factor of 1.02 a round until it holds; the factor 1.001 makes the
    # rounding of the bound itself harmless. All three numbers are tuned.
    bound = np.zeros_like(defect)
    for _ in range(60):
        right = right_side_bound(defect, coupling, inverse_mass=inverse_magnitude, bound=bound)
        found = right / sums
        found = np.maximum(found, found.T)
        # Bounds that have grown to ω_i + ω_j, or are not finite, will not give themselves back; the
        # rounds are ended early, and nothing rests on this.
        if not (found < sums).all():
            break
        holds = 1.001 * found <= bound
        if holds.all():
            return series.widened(bound)
        # What holds stays: an entry that follows others would never come up with them.
        bound = np.where(holds, bound, 1.02 * np.maximum(found, bound))
    what = "the box is so wide that the damping by a ratio is not enclosed"
    raise UnprovedError(what, "take narrower inputs")


def right_side_bound(defect: Array, coupling: Array, *, inverse_mass: Array, bound: Array) -> Array:
    """Bound |Δ − E Pᵀ − P E − E W E| for all E with |E| ≤ `bound`, shape (n, n).

    Where E changes by at most θ `bound`, the expression changes by at most θ times the result. This
    takes twice the product of the unknowns, since |E W E − E′ W E′| ≤ |E − E′| |W| |E| + |E′| |W|
    |E − E′|.

    Args:
        defect: Bound of |Δ|, shape (n, n), as all others.
        coupling: Bound of |P|.
        inverse_mass: Bound of |W|.
        bound: Bound of |E|, symmetric.
    """
    of_coupling = coupling @ bound
    of_unknowns = 2 * bound @ inverse_mass @ bound
    return np.asarray(defect + of_coupling + of_coupling.T + of_unknowns)


def _mean_series(inverse_mass: TaylorModel, stiffness: TaylorModel, omega: Array) -> TaylorModel:
    """Return the series X̃ of X W X = K about the midpoint of the box, without a bound of its error.

    In degree m, (ω_i + ω_j) X_ij is that of K less what lower degrees of X give.

    Args:
        inverse_mass: W, a Taylor model of shape (n, n); at the midpoint the identity.
        stiffness: K, shape (n, n); at the midpoint diag(ω²).
        omega: ω, shape (n,), positive.

    Returns:
        Polynomials of shape (n, n) up to the order of K, with a remainder of zero.
    """
    d = inverse_mass.inputs
    sums = omega[:, np.newaxis] + omega
    X = [np.diag(omega)[np.newaxis]]  # coefficients by degree
    XW = [np.diag(omega)[np.newaxis]]
    for m in range(1, stiffness.order + 1):
        lower = product_part(X, inverse_mass.parts, m, d, matmul)
        XW.append(lower)
        known = product_part(XW, X, m, d, matmul)
        X.append((stiffness.homogeneous_part(m) - known) / sums)
        XW[m] = lower + X[m]
    return TaylorModel(tuple(X), np.zeros(sums.shape), d, stiffness.order)
