"""Which modes form blocks, those that meet or come near in the box, and what they respond by.

Intervening variables (section 7 of the paper) are functions of the inputs of which the response is
made (Barthelemy, Haftka 1993). They are Taylor models with proved remainders. An output is Σ_k Σ_s
c_ks e_s(ω_k, g_k; t) over modes k and sources s (loads, velocity, start), with few numbers for each
mode: its frequency ω_k, its decay g_k and its participation factors c_ks = (r·x)(x·M v_s)/(x·M x).
Here x is the mode shape, r the row of the output, and v_s the pattern of the ground or the initial
state. These numbers bend little over the box, however many inputs it has.

A block of p modes with the invariant subspace K X = M X L contributes a e(L) β, with a = r X and
β = N⁻¹ Xᵀ M v, N = Xᵀ M X. Each diagonal entry of L is an oscillator with the participation factor
a_j β_j, as if it were a mode; what couples the oscillators is bounded
(`truncated_modes.coupling_bounds`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.frame.calculus.taylor_model import TaylorModel, concatenate, solve
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.blocks import (
    Block,
    CentredMatrices,
    max_eigenvalue_decrease,
    narrowest_block,
)
from alphacut.frame.modes.model_fields import with_models
from alphacut.frame.modes.modes import Ends, Oscillator, overlap, range_of
from alphacut.frame.modes.structure import ClassicalStructure
from alphacut.frame.response.tables import Source
from alphacut.frame.structures.linear import undamped_modes


@dataclass(frozen=True, eq=False)
class Subspaces:
    """Enclosed blocks of a structure over its box."""

    blocks: list[Block]  # functions of the inputs at `used`
    used: Ints  # inputs that mass and stiffness depend on
    centre: CentredMatrices  # mass and stiffness in the coordinates of the blocks
    # range of the eigenvalue of every mode, by number from below, (modes,), in 1/s²
    eigenvalue_low: Array
    eigenvalue_high: Array
    # bounds μ and κ of M ≥ (1 − μ) M(0) and K ≥ (1 − κ) K(0) over the box
    mass_decrease: float
    stiffness_decrease: float
    # input whose bisection separates the closest pair that is not enclosed; None if all are
    bisection_input: int | None

    @property
    def truncated_modes(self) -> Ints:
        """Numbers of the modes that are not enclosed, rising."""
        enclosed = [block.modes for block in self.blocks]
        return np.setdiff1d(np.arange(self.centre.mode_count), np.concatenate([[], *enclosed]))


def enclose_subspaces(
    centre: CentredMatrices, used: Ints, count: int, tolerances: Array | None = None
) -> Subspaces:
    """Enclose the lowest modes over the box, in blocks, from below until one is not enclosed.

    A block that cannot be enclosed is joined by the mode nearest to it, and tried again.

    Args:
        centre: Mass and stiffness as functions of the inputs that they depend on.
        used: Which of all inputs these are.
        count: Number of modes to enclose.
        tolerances: Relative errors of the eigenvalue of each mode that suffice, shape (modes,); 0
            unless given.

    Raises:
        UnprovedError: The box is so wide that the structure may lose its mass or stiffness.
    """
    tolerances = np.zeros(centre.mode_count) if tolerances is None else tolerances
    couplings = _couplings(centre, np.arange(centre.mode_count))
    slopes = np.diagonal(couplings, axis1=1, axis2=2).T  # ∂λ_j/∂u_i at the midpoint, (modes, d)
    relative_slopes = np.abs(slopes) / centre.eigenvalues[:, np.newaxis]
    steepest_input = int(used[relative_slopes.max(axis=0).argmax()])
    mass_decrease, stiffness_decrease = _decreases(centre, steepest_input)
    # Rayleigh quotients φᵀKφ / φᵀMφ, with K between (1 ± κ) K(0) and M between (1 ± μ) M(0), and
    # Courant's minimum principle.
    low_factor = (1 - stiffness_decrease) / (1 + mass_decrease)
    high_factor = (1 + stiffness_decrease) / (1 - mass_decrease)

    nearness = _nearness(centre, couplings)
    # From a nearness of 2 on modes are one block without an attempt to enclose them alone, which
    # fails at some number between 1 and 2.
    is_linked = nearness > 2.0
    blocks = list[Block]()
    bisection_input = None
    free: Ints = np.arange(centre.mode_count)
    while len(free) and free[0] < count and bisection_input is None:
        modes = _linked(is_linked, free[:1], free)
        block = None
        while block is None:
            tolerance = float(tolerances[modes].min())
            block = narrowest_block(modes, rotation(centre, modes), centre, tolerance)
            if block is not None:
                blocks.append(block)
                free = np.setdiff1d(free, modes)
                break
            outside = np.where(np.isin(free, modes), 0.0, nearness[np.ix_(modes, free)])
            inner, outer = np.unravel_index(int(outside.argmax()), outside.shape)
            # Both limits are tuned: the nearness from which a mode may be what hinders the
            # enclosure, and the number of modes of a block, with which the effort grows.
            if outside[inner, outer] < 0.4 or len(modes) >= 12:
                drift = slopes[modes[inner]] - slopes[free[outer]]
                bisection_input = int(used[np.abs(drift).argmax()])
                break
            modes = _linked(is_linked, np.append(modes, free[outer]), free)
    return Subspaces(
        blocks=blocks,
        used=used,
        centre=centre,
        eigenvalue_low=low_factor * centre.eigenvalues,
        eigenvalue_high=high_factor * centre.eigenvalues,
        mass_decrease=mass_decrease,
        stiffness_decrease=stiffness_decrease,
        bisection_input=bisection_input,
    )


def _decreases(centre: CentredMatrices, steepest_input: int) -> tuple[float, float]:
    """Return μ and κ with |M − M(0)| ≤ μ M(0) and |K − K(0)| ≤ κ K(0) over the box.

    The inequalities are those of quadratic forms.

    Args:
        centre: Mass M and stiffness K as Taylor models that are diagonal at the midpoint.
        steepest_input: Index of the input that changes eigenvalues most, for the error.

    Raises:
        UnprovedError: μ or κ is not below 1. Its attribute `along` is `steepest_input`, as the
            input to bisect.
    """
    # S M(0) S and S K(0) S are the identity, but for coordinates without mass
    mass_scale = centre.has_mass
    stiffness_scale = np.diag(centre.stiffness.value) ** -0.5
    signs = (1.0, -1.0)
    mass = max(max_eigenvalue_decrease(centre.mass, mass_scale, sign=x) for x in signs)
    stiffness = max(
        max_eigenvalue_decrease(centre.stiffness, stiffness_scale, sign=x) for x in signs
    )
    if not (mass < 1 and stiffness < 1):
        what = "the structure may lose its stiffness"
        raise UnprovedError(what, "take narrower inputs", steepest_input)
    return mass, stiffness


def centred_matrices(mass: TaylorModel, stiffness: TaylorModel) -> tuple[CentredMatrices, Ints]:
    """Return M and K in coordinates that make both diagonal at the midpoint of the box.

    Unknowns b without mass follow the others a there, x_b = −K_bb⁻¹ K_ba x_a, and have coordinates
    of their own, in which K is as large as the largest eigenvalue. The first coordinates are the
    modes with mass, by rising eigenvalues.

    Args:
        mass: M, a Taylor model of shape (n, n). Its rows are zero where unknowns have no mass.
        stiffness: K, shape (n, n), in the same inputs.

    Returns:
        The matrices as functions of the inputs that M or K depends on, or of the first input if
        they depend on none; and the indices of these inputs, rising.

    Raises:
        UnprovedError: The structure can move rigidly, or is unstable, at the midpoint.
    """
    is_massive = np.asarray(mass.magnitude().any(axis=1))
    M = mass.value
    K = stiffness.value
    n = len(is_massive)
    a = np.flatnonzero(is_massive)
    b = np.flatnonzero(~is_massive)
    massless_values, massless_vectors = np.linalg.eigh(K[np.ix_(b, b)])
    _require_stiff(massless_values, K)
    follow = -(massless_vectors / massless_values) @ massless_vectors.T @ K[np.ix_(b, a)]
    condensed_stiffness = K[np.ix_(a, a)] + K[np.ix_(a, b)] @ follow
    eigenvalues, shapes = undamped_modes(M[np.ix_(a, a)], condensed_stiffness)
    _require_stiff(eigenvalues, eigenvalues)
    basis: Array = np.zeros((n, n))
    basis[a, : len(a)] = shapes
    basis[b, : len(a)] = follow @ shapes
    basis[b, len(a) :] = massless_vectors * np.sqrt(eigenvalues[-1] / massless_values)

    used = np.union1d(mass.active_inputs(), stiffness.active_inputs())
    if not len(used):
        used = np.arange(1)
    modal_mass = basis.T @ mass.restricted_to(used) @ basis
    modal_stiffness = basis.T @ stiffness.restricted_to(used) @ basis
    has_mass = (np.arange(n) < len(a)).astype(float)
    centre = CentredMatrices(
        mass=_with_midpoint(modal_mass, has_mass),
        stiffness=_with_midpoint(modal_stiffness, np.diag(modal_stiffness.value)),
        basis=basis,
        mode_count=len(a),
    )
    return centre, used


def _with_midpoint(matrix: TaylorModel, diagonal: Array) -> TaylorModel:
    """Return a matrix that is exactly diagonal at the midpoint, where it was so but for rounding.

    The difference is added to the remainder, so that the Taylor model contains the same matrices.

    Args:
        matrix: Taylor model of shape (n, n).
        diagonal: The diagonal at the midpoint, shape (n,).
    """
    midpoint = np.diag(diagonal)
    remainder = matrix.remainder + np.abs(matrix.value - midpoint)
    return TaylorModel((midpoint[None], *matrix.parts[1:]), remainder, matrix.inputs, matrix.order)


def _require_stiff(eigenvalues: Array, scale: Array) -> None:
    """Raise UnprovedError unless all eigenvalues are positive by more than rounding of `scale`."""
    if len(eigenvalues) and eigenvalues.min() <= 1e-12 * np.abs(scale).max():
        what = "the structure may move rigidly or lose its stiffness"
        raise UnprovedError(what, "take the method improved-graph-follower")


def _couplings(centre: CentredMatrices, modes: Ints) -> Array:
    """Return first-order changes over the box of K − λ M between some modes, shape (d, p, p).

    λ is the mean of the eigenvalues of both modes. Entry (i, j, k) is the change from the midpoint
    to the end u_i = 1 of input i, in 1/s²; for j = k it is that of the eigenvalue of mode j.

    Args:
        centre: M and K as Taylor models of d inputs, diagonal at the midpoint of the box.
        modes: Indices of p modes, shape (p,).
    """
    rows = modes[:, np.newaxis]
    stiffness = centre.stiffness.homogeneous_part(1)[:, rows, modes]
    mass = centre.mass.homogeneous_part(1)[:, rows, modes]
    eigenvalues = centre.eigenvalues[modes]
    mean = (eigenvalues[:, np.newaxis] + eigenvalues) / 2
    return np.asarray(stiffness - mean * mass)


def _nearness(centre: CentredMatrices, couplings: Array) -> Array:
    """Return how near any two modes come over the box, shape (modes, modes); 0 on the diagonal.

    It is the first-order change of λ_j − λ_k over the box, with their coupling, divided by the
    distance of both at the midpoint. From 1 on two modes may meet at complex inputs of magnitude up
    to 1, and their series diverge. It is infinite for modes of equal frequencies, which have no
    shapes of their own, whether their frequencies separate in the box or not.

    Args:
        centre: The eigenvalues λ at the midpoint, rising, shape (modes,).
        couplings: First-order changes of K − λ M between the modes by each input, shape (d, modes,
            modes).
    """
    slopes = np.diagonal(couplings, axis1=1, axis2=2).T
    of_slopes = np.abs(slopes[:, np.newaxis] - slopes).sum(axis=-1)
    change = of_slopes + 2 * np.abs(couplings).sum(axis=0)
    eigenvalues = centre.eigenvalues
    distance = np.abs(eigenvalues[:, np.newaxis] - eigenvalues)
    # A relative distance of 1e-9 is that of their rounding and some more.
    is_equal = distance <= 1e-9 * np.maximum(eigenvalues[:, np.newaxis], eigenvalues)
    nearness = np.where(is_equal, np.inf, change / np.where(is_equal, 1.0, distance))
    nearness[np.diag_indices_from(nearness)] = 0.0
    return nearness


def _linked(pairs: Mask, modes: Ints, free: Ints) -> Ints:
    """Return the free modes that are linked to some modes, directly or through others, rising.

    The given modes are among them, whether free or not.

    Args:
        pairs: Which modes are linked to which, shape (modes, modes), symmetric.
        modes: Indices of the modes to begin with, shape (begun,), without repetitions.
        free: Indices of the modes that may be added, shape (free,).

    Returns:
        Indices of the modes, rising, shape (linked,).
    """
    while True:
        neighbours = np.intersect1d(free, np.flatnonzero(pairs[modes].any(axis=0)))
        extended = np.union1d(modes, neighbours)
        if len(extended) == len(modes):
            return np.sort(modes)
        modes = extended


def rotation(centre: CentredMatrices, modes: Ints) -> Array:
    """Return a rotation R of p modes after which K − λ M is nearly diagonal over the box, (p, p).

    It is the joint diagonalisation of K − λ M at the midpoint and of its derivatives by all inputs,
    by Jacobi rotations (Cardoso, Souloumiac 1996). So modes that cross keep their shapes at the
    crossing. Any rotation gives valid enclosures: nothing rests on the convergence of at most 12
    sweeps. For p = 1 it is [[1]].

    Args:
        centre: M and K as Taylor models, diagonal at the midpoint of the box.
        modes: Indices of the modes, shape (p,).

    Returns:
        Orthogonal matrix; its column j is the j-th new mode in the present ones.
    """
    p = len(modes)
    at_midpoint = np.diag(centre.eigenvalues[modes])
    matrices = np.concatenate([at_midpoint[None], _couplings(centre, modes)])
    total = np.eye(p)
    for _ in range(12):  # sweeps; Jacobi's method converges quadratically
        largest_angle = 0.0
        for i in range(p):
            for j in range(i):
                # A rotation by φ turns the vector (A_ii − A_jj, 2 A_ij) of each matrix by 2 φ. The
                # sum of its squared second entries is smallest at this angle.
                difference = matrices[:, i, i] - matrices[:, j, j]
                coupling = 2 * matrices[:, i, j]
                on = float(difference @ difference - coupling @ coupling)
                off = float(2 * difference @ coupling)
                angle = np.arctan2(off, on + np.hypot(on, off)) / 2
                step = np.eye(p)
                step[i, i] = step[j, j] = np.cos(angle)
                step[j, i] = np.sin(angle)
                step[i, j] = -np.sin(angle)
                matrices = step.T @ matrices @ step
                total = total @ step
                largest_angle = max(largest_angle, abs(angle))
        if largest_angle < 1e-12:
            break
    return total


@dataclass(frozen=True, eq=False)
class BlockParticipation:
    """How a block of p modes takes part in the response, without the factors of the outputs."""

    block: Block  # X, L and N as functions of the inputs of the other fields
    output_modes: TaylorModel  # a, output rows times mode shapes, (p, m)
    modal_forces: TaylorModel  # Xᵀ M v, (p, sources)
    source_participation: TaylorModel  # β = N⁻¹ Xᵀ M v, (p, sources)

    @classmethod
    def from_block(
        cls, block: Block, rows: TaylorModel, patterns: TaylorModel, used: Ints
    ) -> BlockParticipation:
        """Return how a block of p modes takes part in the response to sources.

        The block has the shapes X and modal masses N = Xᵀ M X. The degree of its polynomials may be
        lowered, so that products stay cheap; what is dropped goes into their remainders.

        Args:
            block: The block, as a function of the inputs of mass and stiffness alone.
            rows: Rows r of the outputs in the coordinates of the block, shape (m, n), as functions
                of all inputs.
            patterns: Vectors v of the sources in the same coordinates, shape (sources, n), as
                functions of all inputs.
            used: Indices, among all inputs, of those of the block, rising, shape (inputs of the
                block,).

        Returns:
            r X (p, m), Xᵀ M v and N⁻¹ Xᵀ M v (p, sources) as functions of all inputs; of the inputs
            of the block alone if no pattern and no row depends on an input.

        Raises:
            UnprovedError: N may be singular in the box.
        """
        # The degree is the largest for which a product of two polynomials has at most 100,000 pairs
        # of coefficients, at 3 ns each. Degrees above 6 are not worth it: what is above the third
        # degree ends in the remainder.
        d = block.modal_mass.inputs
        degree = 4
        while degree < 6 and comb(2 * d + degree + 1, degree + 1) <= 100_000:
            degree += 1
        degree = min(degree, block.modal_mass.order)
        block = with_models(block, lambda model: model.truncated(degree))
        has_constant_rows = not len(rows.active_inputs())
        if has_constant_rows and not len(patterns.active_inputs()):
            patterns = block.modal_mass.like(patterns.value).widened(patterns.remainder)
        else:
            order = patterns.order
            inputs = patterns.inputs
            block = with_models(block, lambda x: x.truncated(order).embedded(used, inputs))
        # Constant rows are numbers but for rounding, and their product is one with numbers.
        if has_constant_rows:
            rounding = block.shapes.magnitude() @ rows.remainder.T
            output_modes = (block.shapes @ rows.value.T).widened(rounding)
        else:
            output_modes = block.shapes @ rows.T
        modal_forces = block.mass_times_shapes @ patterns.T
        return cls(
            block=block,
            output_modes=output_modes,
            modal_forces=modal_forces,
            source_participation=solve(block.modal_mass, modal_forces),
        )

    @property
    def participation(self) -> TaylorModel:
        """Participation factors a_j β_j of each oscillator j, shape (p, sources, m)."""
        return self.source_participation[:, :, None] * self.output_modes[:, None, :]

    @property
    def output_sums(self) -> TaylorModel:
        """Sums a N⁻¹ aᵀ of each output, shape (m,): Σ a_k² over modes of unit modal mass."""
        return column_products(self.output_modes, solve(self.block.modal_mass, self.output_modes))

    @property
    def source_sums(self) -> TaylorModel:
        """Sums β·N β of each source, shape (sources,): Σ β_k² over modes of unit modal mass."""
        return column_products(self.modal_forces, self.source_participation)


def oscillators(
    structure: ClassicalStructure, participation: BlockParticipation, found: Subspaces
) -> list[Oscillator]:
    """Return an oscillator for each mode of a block, with guaranteed ranges of ω and damping.

    The block spans an invariant subspace K X = M X L of p modes. With λ = L_jj the decay of
    oscillator j is g = a/2 + b λ/2 + ζ √λ with Rayleigh's factors a and b, and its frequency ω =
    √(λ − g²). What L has off its diagonal couples the oscillators, and is bounded elsewhere.

    Args:
        structure: The structure over the box, with its damping and factors of the m outputs.
        participation: The block and its participation in the response.
        found: All enclosed modes, with ranges of every eigenvalue over the box.

    Returns:
        Taylor models of ω, g, g/ω and of the participation factors, shape (sources, m), in all
        inputs, and ranges of ω and of g/ω.

    Raises:
        UnprovedError: Modes of the block have different damping ratios, or a mode is not known to
            oscillate in the whole box.
    """
    modes = participation.block.modes
    inputs = structure.initial_state.inputs
    order = structure.initial_state.order

    def over_all_inputs(model: TaylorModel) -> TaylorModel:
        """Return a model of the block's inputs as one of all inputs, of their degree."""
        return model.truncated(order).embedded(found.used, inputs)

    factors = over_all_inputs(participation.participation)
    eigenvalue_block = over_all_inputs(participation.block.eigenvalue_block)
    # Modes of a block may cross, so they must have one damping ratio: the same coefficients.
    ratios = structure.damping_ratios[modes]
    if any((part[:, 1:] != part[:, :-1]).any() for part in ratios.parts):
        raise UnprovedError(
            "modes of different damping ratios may cross", "take one ratio for all modes"
        )
    # Range of √λ by Rayleigh quotients, which belongs to one mode alone.
    low = 0.0
    high = np.inf
    if len(modes) == 1:
        low = float(np.sqrt(found.eigenvalue_low[modes[0]]))
        high = float(np.sqrt(found.eigenvalue_high[modes[0]]))
    a, b = structure.rayleigh[0], structure.rayleigh[1]
    result = []
    for j in range(len(modes)):
        eigenvalue = eigenvalue_block[j, j]
        decay = a * 0.5 + b * eigenvalue * 0.5 + ratios[j] * eigenvalue**0.5
        squared = eigenvalue - decay * decay
        if range_of(squared)[1] <= 0:
            raise UnprovedError("a mode does not oscillate", "take less damping")
        omega = squared**0.5
        quotient = decay * omega**-1.0
        q_low, q_high = range_of(quotient)
        lowest_omega = float(low / np.sqrt(1 + q_high**2))  # ω² = λ / (1 + (g/ω)²)
        oscillator = Oscillator(
            omega=omega,
            decay=decay,
            quotient=quotient,
            participation=factors[j] * structure.output_factors,
            omega_range=overlap(range_of(omega), (lowest_omega, high)),
            quotient_range=(max(q_low, 0.0), q_high),
        )
        result.append(oscillator)
    return result


class DampedRanges(NamedTuple):
    """Ranges of damped oscillators."""

    omega: Ends  # of ω = √(λ − g²), in rad/s
    quotient: Ends  # of g/ω


def damped_ranges(
    structure: ClassicalStructure, low: float, high: float, modes: Ints
) -> DampedRanges:
    """Return the ranges of ω and g/ω of some modes whose eigenvalues λ lie in [low, high].

    With the decay g = a/2 + b λ/2 + ζ √λ the frequency is ω = √(λ − g²). Lower ends of a, b and ζ
    below 0, to which remainders of Taylor models may lead, are taken as 0.

    Args:
        structure: The structure over the box, whose damping factors a, b and ζ vary in it.
        low: In 1/s².
        high: In 1/s².
        modes: Indices of the modes, shape (p,), p ≥ 1, for their damping ratios.

    Returns:
        `omega`, lower and upper end in rad/s, and `quotient`, those of g/ω.

    Raises:
        UnprovedError: One of them may not oscillate, since λ may be zero or g/√λ may reach 1.
    """
    if low <= 0:
        raise UnprovedError("the structure may lose its stiffness", "take narrower inputs")
    slow = float(np.sqrt(low))
    fast = float(np.sqrt(high))
    ratios = structure.damping_ratios[modes]
    min_damping, max_damping = damping_range(structure.rayleigh, ratios, (slow, fast))
    if max_damping >= 1:
        raise UnprovedError("a mode may not oscillate", "take less damping")
    min_ratio = float(np.sqrt(1 - max_damping**2))  # the smallest ω/√λ
    return DampedRanges((slow * min_ratio, fast), (min_damping, max_damping / min_ratio))


def damping_range(rayleigh: TaylorModel, ratios: TaylorModel, omega: Ends) -> Ends:
    """Return the ends of the ratios a/(2 √λ) + b √λ/2 + ζ of modes over the box.

    Args:
        rayleigh: Rayleigh's factors a in 1/s and b in s, shape (2,).
        ratios: Stated damping ratios ζ of the modes, shape (p,).
        omega: Smallest and largest √λ, in rad/s, positive.
    """
    slow, fast = omega
    rayleigh_low, rayleigh_high = rayleigh.bounds()
    a_low, b_low = np.maximum(rayleigh_low, 0.0)
    a_high, b_high = np.maximum(rayleigh_high, 0.0)
    ratio_low, ratio_high = ratios.bounds()
    smallest = a_low / (2 * fast) + b_low * slow / 2 + np.maximum(ratio_low, 0.0).min()
    largest = a_high / (2 * slow) + b_high * fast / 2 + np.maximum(ratio_high, 0.0).max()
    return float(smallest), float(largest)


def source_patterns(structure: ClassicalStructure, sources: Sequence[Source]) -> TaylorModel:
    """Return the vectors v of sources on the n unknowns, in the order given, shape (sources, n).

    v is the initial displacements of "start", the initial velocities of "velocity", the
    displacements ι under a unit displacement of the ground of "load", and the accelerations M⁻¹ b
    of "force1", "force2", …; a mode φ of unit modal mass takes part by φ·M v.

    Args:
        structure: The structure as Taylor models over the box.
        sources: The sources, at least one.

    Raises:
        KeyError: The structure has no source of a name.
    """
    displacements = structure.initial_state[0]
    vectors = {
        # the numbers of ι as a Taylor model of the same inputs
        "load": displacements * 0.0 + structure.ground_pattern,
        "velocity": structure.initial_state[1],
        "start": displacements,
        **structure.force_accelerations,
    }
    return concatenate([vectors[source.name][None] for source in sources], -2)


def column_products(a: TaylorModel, b: TaylorModel) -> TaylorModel:
    """Return Σ_j a_js b_js of matrices of equal shape (p, s), shape (s,)."""
    return (a * b).T @ np.ones(a.shape[0])
