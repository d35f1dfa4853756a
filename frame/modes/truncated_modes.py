"""What an output has beside its oscillators: modes that are not enclosed, and coupling in blocks.

Modes known by sums. With a_k = r·φ_k and β_k = φ_k·M v, sums over all modes are known without the
modes: Σ a β = r·v, Σ a² = r·M⁻¹ r, Σ β² = v·M v, and with the eigenvalue λ_k in the denominator
r·K⁻¹ M v, r·K⁻¹ r and (M v)·K⁻¹ M v. What the enclosed modes leave of them is C = Σ a β, A = Σ a²
and B = Σ β² over the truncated modes, with or without λ in the denominator. Let e_k(t) be the
response of an oscillator with λ_k. By Cauchy and Schwarz the truncated modes add

    C m ± √(A B) r          with C, A and B without λ: m ± r contains e_k of all truncated modes;
    C m ± √(A B) r          with C, A and B over λ: m ± r contains λ_k e_k, and C m is the static
                            response.

The smaller of both is taken. √(A B) is replaced by (A t + B/t)/2 with a number t, which is
not smaller and a Taylor model: at inputs where A is large, B is often small.

Coupling in a block. A block contributes a e(L) β with a = r X and β = N⁻¹ Xᵀ M v, of which the
diagonal of L gives Σ_j a_j β_j e(L_jj). Let V be the eigenvectors of L, with N^½ V orthogonal, and
F = L off its diagonal. Then V⁻¹ (e(L) − e(diag L)) has the entries e[λ_i, L_jj] (V⁻¹ F)_ij with
divided differences of e (Daleckii, Krein 1965). So the coupling is at most |a N^-½| Σ_j |β_j| |N^½
F_j| sup |de/dλ|. With δ = ‖N − 1‖₂ < 1 the eigenvalues of N lie in [1 − δ, 1 + δ], so that |N^½ x|
≤ √(1 + δ) |x|. The eigenvalues λ_i lie in the discs of Gershgorin about L_jj.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.calculus.taylor_model import TaylorModel, solution_series, solve
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.blocks import eigenvalue_discs
from alphacut.frame.modes.clusters import (
    BlockParticipation,
    DampedRanges,
    Subspaces,
    column_products,
    damped_ranges,
)
from alphacut.frame.modes.model_fields import with_models
from alphacut.frame.modes.modes import Excitation, TruncatedModes
from alphacut.frame.modes.structure import ClassicalStructure
from alphacut.frame.response.tables import (
    Oscillators,
    Ranges,
    Source,
    grid_over,
    intervals,
    response_ranges,
)


class ModalSums(NamedTuple):
    """Sums over modes, without the factors of the outputs; m outputs."""

    products: TaylorModel  # Σ a β, (sources, m)
    products_over_eigenvalue: TaylorModel  # Σ a β / λ, (sources, m)
    output_squares: TaylorModel  # Σ a², (m,)
    output_squares_over_eigenvalue: TaylorModel  # Σ a² / λ, (m,)
    source_squares: TaylorModel  # Σ β², (sources,)
    source_squares_over_eigenvalue: TaylorModel  # Σ β² / λ, (sources,)


class WeightedSums(NamedTuple):
    """Sums over truncated modes with a weight λ^-κ, with the factors of the outputs."""

    participation: TaylorModel  # C = Σ a β λ^-κ, (sources, m)
    amplitude: TaylorModel  # R ≥ Σ |a β| λ^-κ, (sources, m)


def truncated_modes(
    structure: ClassicalStructure,
    found: Subspaces,
    participations: Sequence[BlockParticipation],
    rows: TaylorModel,
    patterns: TaylorModel,
    excitation: Excitation,
) -> TruncatedModes | None:
    """Bound the response of all modes that are not enclosed one by one or in blocks.

    Sums over all modes are found without computing modes. The sums over the enclosed modes are
    subtracted from them; the rest belongs to the truncated modes.

    Args:
        structure: The structure over the box.
        found: The enclosed modes, at least one block.
        participations: How each block takes part in the response.
        rows: Rows of the outputs in the coordinates of the modes, shape (m, n).
        patterns: Vectors of the sources in these coordinates, shape (sources, n).
        excitation: T time nodes and sources.

    Returns:
        None if all modes are enclosed. Else C m(t) ± R r(t) for each source and output:
        `participation` C and `amplitude` R, Taylor models of shape (sources, m),
        `response_midpoint` m and `response_radius` r, shape (sources, m, T), and
        `interpolation_error`, a bound of the distance from straight lines between nodes, shape (T,
        m).

    Raises:
        UnprovedError: One of these modes may not oscillate, or a matrix may be singular in the box.
    """
    modes = found.truncated_modes
    if not len(modes):
        return None
    order = max(x.block.modal_mass.order for x in participations)
    sums = sums_over_all_modes(found, rows, patterns, order)
    for of_block in participations:
        enclosed = modal_sums_of_block(of_block)
        sums = ModalSums(*(x - y for x, y in zip(sums, enclosed, strict=True)))
    low = float(found.eigenvalue_low[modes].min())
    high = float(found.eigenvalue_high[modes].max())
    ranges = damped_ranges(structure, low, high, modes)
    return response_of_truncated_modes(sums, ranges, structure, found, excitation)


def response_of_truncated_modes(
    sums: ModalSums,
    ranges: DampedRanges,
    structure: ClassicalStructure,
    found: Subspaces,
    excitation: Excitation,
) -> TruncatedModes:
    """Bound the response of modes by sums over them and by their ranges of ω and g/ω.

    Args:
        sums: Sums Σ a β, Σ a², Σ β² over the modes, with and without their eigenvalue λ in the
            denominator, a being the mode at an output and β its participation factor for a source.
        ranges: Ends of ω = √(λ − g²), in rad/s, and of the quotient of decay g and ω.
        structure: The structure over the box, with m outputs.
        found: The enclosed modes, for the inputs that `sums` are functions of.
        excitation: T time nodes and sources.

    Returns:
        C m(t) ± R r(t): Taylor models C and R, shape (sources, m), and m and r, shape (sources, m,
        T).
    """
    responses = response_ranges(
        ranges.omega,
        ranges.quotient,
        excitation.time,
        excitation.sources,
        structure.distinct_orders,
    )
    return _with_best_weights(structure, _weighted_sums(sums, structure, found), responses)


def sums_over_all_modes(
    found: Subspaces, rows: TaylorModel, patterns: TaylorModel, order: int
) -> ModalSums:
    """Return sums over all modes by solutions of M and K, as functions of the inputs of `patterns`.

    With a = r·φ and β = φ·M v for modes φ of unit modal mass and eigenvalue λ, these are Σ a β =
    r·v, Σ a² = r·M⁻¹ r, Σ β² = v·M v, and with λ in the denominator r·K⁻¹ M v, r·K⁻¹ r and (M
    v)·K⁻¹ M v.

    Args:
        found: Holds M and K in coordinates that are modal at the midpoint, modes with mass first.
        rows: Rows r of m outputs in these coordinates, shape (m, n), of the same inputs.
        patterns: Vectors v of the sources, shape (sources, n).
        order: Order of the Taylor models if `patterns` and `rows` depend on no input; else it is
            theirs.

    Returns:
        Sums of products (sources, m), and of squares (m,) and (sources,), each without and with λ.
        Σ a² is known up to 1e60 only for an output that takes unknowns without mass.
    """
    centre = found.centre
    mass = centre.mass
    stiffness = centre.stiffness
    if len(patterns.active_inputs()) or len(rows.active_inputs()):
        order = patterns.order
        mass = mass.truncated(order).embedded(found.used, patterns.inputs)
        stiffness = stiffness.truncated(order).embedded(found.used, patterns.inputs)
    else:
        patterns = mass.like(patterns.value).widened(patterns.remainder)
        mass = mass.truncated(order)
        stiffness = stiffness.truncated(order)
        rows = stiffness.like(rows.value).widened(rows.remainder)
    min_mass = 1 - found.mass_decrease
    min_stiffness = 1 - found.stiffness_decrease

    massive = slice(0, centre.mode_count)
    massive_rows = rows[:, massive]
    output_squares = _diagonal(
        inverse_form(mass[massive, massive], massive_rows, massive_rows, min_mass)
    )
    over_eigenvalue = _diagonal(inverse_form(stiffness, rows, rows, min_stiffness))
    if centre.mode_count < len(centre.basis):
        # What unknowns without mass move by themselves belongs to no mode. Σ a² has no bound for
        # outputs that take them: 1e60 stands for infinity.
        massless = slice(centre.mode_count, None)
        massless_rows = rows[:, massless]
        by_themselves = inverse_form(
            stiffness[massless, massless], massless_rows, massless_rows, min_stiffness
        )
        over_eigenvalue = over_eigenvalue - _diagonal(by_themselves)
        takes_massless = massless_rows.magnitude().any(axis=1)
        output_squares = output_squares.widened(np.where(takes_massless, 1e60, 0.0))

    forces = patterns @ mass  # M v
    by_stiffness = inverse_form(stiffness, forces, forces, min_stiffness)
    return ModalSums(
        products=patterns @ rows.T,
        products_over_eigenvalue=inverse_form(stiffness, forces, rows, min_stiffness),
        output_squares=output_squares,
        output_squares_over_eigenvalue=over_eigenvalue,
        source_squares=_diagonal(forces @ patterns.T),
        source_squares_over_eigenvalue=_diagonal(by_stiffness),
    )


def inverse_form(
    matrix: TaylorModel, left: TaylorModel, right: TaylorModel, min_eigenvalue: float
) -> TaylorModel:
    """Return left A⁻¹ rightᵀ over a box, with a remainder that is quadratic in small residuals.

    With series x ≈ left A⁻¹ and y ≈ right A⁻¹, and their residuals e = left − x A and f = right − y
    A, it is x rightᵀ + e yᵀ + e A⁻¹ fᵀ.

    Args:
        matrix: A, symmetric, shape (n, n), diagonal and positive at the midpoint of the box.
        left: Shape (l, n).
        right: Shape (r, n).
        min_eigenvalue: A number c > 0 with A(u) ≥ c A(0) over the box, as quadratic forms.

    Returns:
        Taylor model of shape (l, r).
    """
    x = solution_series(matrix, left.T).T
    y = solution_series(matrix, right.T).T
    e = (left - x @ matrix).magnitude()
    f = (right - y @ matrix).magnitude()
    # |e A⁻¹ fᵀ| ≤ |e| |f| / c with the norm √(e A(0)⁻¹ eᵀ).
    diagonal = np.diag(matrix.value)
    e_norm = np.sqrt((e**2 / diagonal).sum(axis=1))
    f_norm = np.sqrt((f**2 / diagonal).sum(axis=1))
    remainder = e @ y.magnitude().T + np.outer(e_norm, f_norm) / min_eigenvalue
    return (x @ right.T).widened(remainder)


def modal_sums_of_block(participation: BlockParticipation) -> ModalSums:
    """Return sums over the modes of a block, by its modal masses N = Xᵀ M X and Xᵀ K X = N L.

    Args:
        participation: X, N and L of K X = M X L for p modes, output rows times X, shape (p, m), and
            Xᵀ M v of the sources' vectors v, shape (p, sources).

    Returns:
        Taylor models of Σ a β (sources, m), Σ a² (m,) and Σ β² (sources,), each also with the
        eigenvalue in the denominator; a and β are output and participation factor of a mode of unit
        modal mass.

    Raises:
        UnprovedError: N or N L may be singular in the box.
    """
    block = participation.block
    modal_stiffness = block.modal_mass @ block.eigenvalue_block.T
    outputs = participation.output_modes
    forces = participation.modal_forces
    outputs_over_stiffness = solve(modal_stiffness, outputs)
    forces_over_stiffness = solve(modal_stiffness, forces)
    return ModalSums(
        products=participation.source_participation.T @ outputs,
        products_over_eigenvalue=forces.T @ outputs_over_stiffness,
        output_squares=participation.output_sums,
        output_squares_over_eigenvalue=column_products(outputs, outputs_over_stiffness),
        source_squares=participation.source_sums,
        source_squares_over_eigenvalue=column_products(forces, forces_over_stiffness),
    )


def _diagonal(matrix: TaylorModel) -> TaylorModel:
    """Return the diagonal of a square matrix, shape (n,)."""
    at = np.arange(len(matrix.remainder))
    return matrix[at, at]


def _weighted_sums(
    sums: ModalSums, structure: ClassicalStructure, found: Subspaces
) -> list[WeightedSums]:
    """Return C = Σ a β λ^-κ and R ≥ Σ |a β| λ^-κ for the exponents κ = 0 and 1, over the box.

    By Cauchy and Schwarz R = √(A B) with A = Σ a² and B = Σ β², each divided by λ at κ = 1. R is
    replaced by (A t + B/t)/2 with a number t > 0, which is not smaller and a Taylor model.

    Args:
        sums: The sums over modes with eigenvalues λ, as functions of the inputs of mass and
            stiffness, or of all inputs.
        structure: Its `output_factors`, shape (m,), multiply all sums.
        found: Says which of all inputs are those of mass and stiffness.

    Returns:
        For each exponent `participation` C and `amplitude` R, Taylor models of all inputs, shape
        (sources, m) each.
    """
    inputs = structure.initial_state.inputs
    order = structure.initial_state.order
    all_sums = with_models(sums, lambda x: x.truncated(order).embedded(found.used, inputs))
    factors = structure.output_factors
    without = _root_of_product(all_sums.output_squares, all_sums.source_squares)
    over_eigenvalue = _root_of_product(
        all_sums.output_squares_over_eigenvalue, all_sums.source_squares_over_eigenvalue
    )
    return [
        WeightedSums(all_sums.products * factors, without * factors),
        WeightedSums(all_sums.products_over_eigenvalue * factors, over_eigenvalue * factors),
    ]


def _root_of_product(A: TaylorModel, B: TaylorModel) -> TaylorModel:
    """Return a bound (A t + B/t)/2 of √(A B), shape (sources, m), for A (m,) and B (sources,)."""
    _, max_A = A.bounds()
    _, max_B = B.bounds()
    # Any positive t gives a bound; this one is the best for the largest A and B, which may be zero.
    t: Array = np.sqrt(np.maximum(max_B, 1e-300)[:, np.newaxis] / np.maximum(max_A, 1e-300))
    return A[None] * (t / 2) + B[:, None] * (0.5 / t)


def _with_best_weights(
    structure: ClassicalStructure,
    sums: Sequence[WeightedSums],
    ranges: Mapping[int, Ranges],
) -> TruncatedModes:
    """Bound the response of truncated modes, with the best weight for each source and output.

    If all λ_k^κ e_k(t) lie in an interval with the midpoint m(t) and the radius r(t), the truncated
    modes add C m(t) ± R r(t) with C = Σ a β λ^-κ and R ≥ Σ |a β| λ^-κ. The exponent κ is taken
    whose largest R r(t) over time is smallest.

    Args:
        structure: Structure whose outputs take the derivatives by time `derivative_orders`, shape
            (m,).
        sums: C and R for κ = 0 and 1, shape (sources, m) each.
        ranges: Lower and upper bounds of λ_k^κ e_k(t), and of its distance from straight lines
            between time nodes, shape (exponents, sources, T) each, by the order of the derivative.

    Returns:
        C and R as Taylor models (sources, m), m and r as arrays (sources, m, T), and
        `interpolation_error`, which bounds the distance of the sum over all sources from a straight
        line in the step before each node, shape (T, m).
    """
    # By output; the shape is then (exponents, sources, outputs, T).
    by_output = [ranges[int(order)] for order in structure.derivative_orders]
    low = np.stack([x.low for x in by_output], axis=2)
    high = np.stack([x.high for x in by_output], axis=2)
    line_errors = np.stack([x.line_deviation for x in by_output], axis=2)
    midpoint = (low + high) / 2
    radius = (high - low) / 2

    # The best exponent is the one with the smallest largest R r(t), shape (sources, outputs).
    max_amplitudes = np.stack([x.amplitude.magnitude() for x in sums])
    best = (max_amplitudes * radius.max(axis=-1)).argmin(axis=0)

    # Taylor models cannot be selected entry by entry, so those of all exponents are added with
    # weights that are 1 for the best exponent and 0 else.
    participation = sums[0].participation * 0.0
    amplitude = sums[0].amplitude * 0.0
    for exponent, of_exponent in enumerate(sums):
        weights = (best == exponent).astype(float)
        participation = participation + of_exponent.participation * weights
        amplitude = amplitude + of_exponent.amplitude * weights

    # The distance from a straight line is at most R times that of λ^κ e for every exponent, so the
    # smallest of these bounds holds in each step. Sources add up.
    line_bounds = max_amplitudes[..., np.newaxis] * line_errors
    source, output = np.indices(best.shape)
    return TruncatedModes(
        participation=participation,
        amplitude=amplitude,
        response_midpoint=midpoint[best, source, output],
        response_radius=radius[best, source, output],
        interpolation_error=line_bounds.min(axis=0).sum(axis=0).T,
    )


class CouplingBounds(NamedTuple):
    """Bounds of what couples the oscillators of a block."""

    at_nodes: Array  # bound of what the coupling adds to outputs at nodes, (T, m)
    # bound of the distance of that from a straight line in the step before each node, (T, m)
    interpolation_error: Array
    ranges: DampedRanges  # of the modes of the block


def coupling_bounds(
    structure: ClassicalStructure,
    participation: BlockParticipation,
    found: Subspaces,
    excitation: Excitation,
) -> CouplingBounds:
    """Bound what couples the oscillators of a block of several modes.

    The block spans an invariant subspace K X = M X L; its oscillators are the diagonal entries of
    L, and F, the rest of L, couples them: by at most |F| times the slope of responses by their
    eigenvalue.

    Args:
        structure: The structure over the box, with m outputs.
        participation: The block and how it takes part in the response.
        found: All enclosed modes, with ranges of their eigenvalues.
        excitation: T time nodes and sources.

    Returns:
        `at_nodes`, a bound of what the coupling adds to outputs, and `interpolation_error`, of its
        distance from a straight line in the step before each node, shape (T, m) each; and the
        `ranges` of frequency and damping of the block's modes.

    Raises:
        UnprovedError: One of the modes may not oscillate, or N = Xᵀ M X may be singular.
    """
    time, sources = excitation
    factors = _coupling_factors(structure, participation)
    block = participation.block
    modes = block.modes
    discs = eigenvalue_discs(block.eigenvalue_block)
    # Of the eigenvalues, within discs and bounds by Rayleigh quotients, and of the diagonal of L.
    low, high = block.eigenvalue_block[np.diag_indices(len(modes))].bounds()
    lowest = min(low.min(), max(discs[0].min(), found.eigenvalue_low[modes[0]]))
    highest = max(high.max(), min(discs[1].max(), found.eigenvalue_high[modes[-1]]))
    ranges = damped_ranges(structure, float(lowest), float(highest), modes)
    low_omega, high_omega = ranges.omega
    _, max_quotient = ranges.quotient

    # Over a fifth of the distance responses hardly change; 120 points along an axis at most limit
    # the time.
    along, across = np.clip(intervals(*ranges, time, fraction=0.2), 1, 120).astype(int) + 1
    points = int(along), int(across)
    orders = structure.distinct_orders
    table = Oscillators(grid_over(*ranges, points), time, orders)

    max_sigma = high_omega * float(np.sqrt(1 + max_quotient**2))
    shape = (len(time), len(structure.derivative_orders))
    at_nodes = np.zeros(shape)
    interpolation_error = np.zeros(shape)
    for order in orders:
        outputs = np.flatnonzero(structure.derivative_orders == order)
        for s, source in enumerate(sources):
            by_slope = factors.by_slope[s, outputs]
            largest = table.responses(source, order).largest
            G, G_slope = largest
            slope = response_slopes(source, G, G_slope, low_omega, max_quotient)
            at_nodes[:, outputs] += np.outer(slope, by_slope)
            # The coupling is the block's response a e(L) β less that of its oscillators, Σ a_j β_j
            # e(L_jj). With the interpolation error of e, its distance ℓ from a straight line, the
            # first is off a line by |a N^-½| |N^½ β| ℓ at most and the second by Σ |a_j β_j| ℓ,
            # hence the coupling by twice `by_line` ℓ; or by twice its own largest value within the
            # step.
            max_force = source.load.extremes[0] if source.load else 0.0
            G, G_slope = _largest_within_steps(
                largest, time, max_force=max_force, max_sigma=max_sigma, order=order
            )
            slope = response_slopes(source, G, G_slope, low_omega, max_quotient)
            by_line = np.outer(table.line_deviation(source, order), factors.by_line[s, outputs])
            interpolation_error[:, outputs] += 2 * np.minimum(by_line, np.outer(slope, by_slope))
    return CouplingBounds(at_nodes, interpolation_error, ranges)


class _CouplingFactors(NamedTuple):
    """Factors of the bounds of the coupling in a block of p modes, for m outputs."""

    by_slope: Array  # bound of the coupling over sup |de/dλ|, (sources, m)
    # bound of |a N^-½| |N^½ β|, and of Σ |a_j β_j|, which may be larger, (sources, m)
    by_line: Array


def _coupling_factors(
    structure: ClassicalStructure, participation: BlockParticipation
) -> _CouplingFactors:
    """Return the factors of the bounds of the coupling in a block of p modes over the box.

    Args:
        structure: Its `output_factors`, shape (m,).
        participation: The block, K X = M X L with N = Xᵀ M X, the rows a = r X of the outputs and β
            = N⁻¹ Xᵀ M v of the sources.

    Returns:
        `by_slope`, a bound of the coupling divided by sup |de/dλ| of responses e, shape (sources,
        m); and `by_line`, a bound of |a N^-½| |N^½ β| and of Σ |a_j β_j|, shape (sources, m).

    Raises:
        UnprovedError: N may be singular in the box.
    """
    block = participation.block
    off_diagonal = block.eigenvalue_block.magnitude() * (1.0 - np.eye(len(block.modes)))
    p = len(block.modes)
    # δ ≥ ‖N − 1‖₂ over the box. The norm of a matrix of magnitudes bounds that of the matrix.
    mass_change = (block.modal_mass - np.eye(p)).magnitude()
    delta = float(np.linalg.norm(mass_change, 2))
    if not delta < 1:
        raise UnprovedError("modal masses of a block may be singular", "take narrower inputs")
    outputs = np.sqrt(participation.output_sums.magnitude()) * structure.output_factors.magnitude()
    # |N^½ x| ≤ √(1 + δ) |x|
    of_columns = np.sqrt(1 + delta) * np.linalg.norm(off_diagonal, axis=1)
    by_source = participation.source_participation.magnitude().T @ of_columns
    # Σ |a_j β_j| ≤ |a| |β| with |a| ≤ √(1 + δ) |a N^-½| and |β| ≤ |N^½ β| / √(1 − δ). The bound is
    # not less than |a N^-½| |N^½ β| itself.
    of_masses = np.sqrt((1 + delta) / (1 - delta))
    of_sources = of_masses * np.sqrt(participation.source_sums.magnitude())
    return _CouplingFactors(
        by_slope=by_source[:, np.newaxis] * outputs,
        by_line=of_sources[:, np.newaxis] * outputs,
    )


def _largest_within_steps(
    largest: Array, time: Array, *, max_force: float, max_sigma: float, order: int
) -> Array:
    """Bound |G| and |dG/dσ| in the step to each time node by their bounds at nodes, shape (2, T).

    Here G = σ^n ρ with the order n of a derivative by time and the Duhamel integral ρ = ∫ exp(σ τ)
    f(t − τ) dτ over the past of the load f. With |exp(σ τ)| ≤ 1 for τ ≥ 0,

        G(t + τ) = exp(σ τ) G(t) + σ^n I,   I = ∫ exp(σ s) f(t + τ − s) ds over 0 ≤ s ≤ τ ≤ h,

    and with |f| ≤ `max_force`, |I| ≤ max_force h and |dI/dσ| ≤ max_force h²/2. Column 0 belongs to
    no step and has no meaning.

    Args:
        largest: Bounds of |G| and |dG/dσ| at the nodes, shape (2, T).
        time: Nodes, shape (T,), in s.
        max_force: Largest magnitude of the load f; 0 for an initial state.
        max_sigma: Largest |σ|, in 1/s.
        order: n.
    """
    h = np.diff(time, prepend=time[0])
    G, G_slope = np.roll(largest, 1, axis=1)  # at the beginning of each step
    # The derivative of σ^n I is n σ^(n − 1) I + σ^n dI/dσ.
    of_power = order * max_sigma ** (order - 1) if order else 0.0
    of_integral = max_force * (of_power * h + max_sigma**order * h**2 / 2)
    return np.stack([G + max_force * h * max_sigma**order, G_slope + h * G + of_integral])


def response_slopes(
    source: Source, G: Array, G_slope: Array, omega: Array | float, quotient: Array | float
) -> Array:
    """Bound |de/dλ| of the responses e of oscillators by their eigenvalue λ, in the shape of G.

    With the decay g = (a + b λ)/2 + ζ √λ, ω² = λ − g² and σ = −g + iω, 4 ω² |dσ/dλ|² = 1 + 4 g′ (g′
    λ − g) ≤ 1, since g′ λ ≤ g, and 2 ω³ |d(g/ω)/dλ| = |2 g′ λ − g| ≤ g.

    Args:
        source: The source.
        G: Bounds of |G| = |σ^ν ρ|, of any shape, where ν is the order of the derivative by time and
            ρ the Duhamel integral of the source, or exp(σ t).
        G_slope: Bounds of |dG/dσ|, same shape.
        omega: Smallest ω, in rad/s, positive; a number, or in the shape of G.
        quotient: Largest g/ω, likewise.
    """
    if source.is_displacement:  # e = Re G + (g/ω) Im G
        return (1 + quotient) * G_slope / (2 * omega) + G * quotient / (2 * omega**2)
    # e = ± Im G/ω, with |dω/dλ| ≤ |dσ/dλ|
    return G_slope / (2 * omega**2) + G / (2 * omega**3)
