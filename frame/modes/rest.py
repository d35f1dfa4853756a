"""What an output has beside its oscillators: the modes not enclosed, and what couples blocks.

Modes known by sums. With a_k = r·φ_k and β_k = φ_k·M v, sums over all modes are known without
them: Σ a β = r·v, Σ a² = r·M⁻¹ r, Σ β² = v·M v, and with λ in the denominator r·K⁻¹ M v, r·K⁻¹ r,
(M v)·K⁻¹ M v. What the enclosed modes leave of them is C, A and B. By Cauchy and Schwarz the
others' motion is within

    C e ± √(A B) Δe            of mass:       e ± Δe holds all their responses;
    ± √(A B) sup |ω e|         of both:       A of stiffness, B of mass;
    C ε ± √(A B) Δε            of stiffness:  ε ± Δε holds all λ e, about the static motion C ε.

The least of the three is taken. For √(A B) stands (A t + B/t)/2, t a number, which is no less and
a Taylor model: at inputs where A is large B is often small.

Coupling of a block. It answers a e(L) β with a = r X, β = N⁻¹ Xᵀ M v, of which the diagonal of L
gives Σ_j a_j β_j e(L_jj). With V the eigenvectors of L, N^½ V orthogonal, and F = L off its
diagonal, V⁻¹ (e(L) − e(diag L)) has the entries e[λ_i, L_jj] (V⁻¹ F)_ij (Daleckii, Krein 1965). So
the rest is no more than |a N^-½| Σ_j |β_j| |N^½ F_j| sup |de/dλ|, nor than twice |a N^-½| |N^½ β|
times half the range of e, |β| and |a| with the norm of N; λ_i lie in the discs of Gershgorin about
L_jj.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.calculus.taylor_model import TaylorModel, solution_series, solve
from alphacut.frame.modes.clusters import Subspaces
from alphacut.frame.modes.intervening import (
    BlockShares,
    Ends,
    Excitation,
    column_products,
    damped_range,
)
from alphacut.frame.modes.structure import Classical
from alphacut.frame.response.oscillators import Oscillators, Ranges, grid_over, response_ranges

UNKNOWN = 1e60
"""Stands for a sum that is not known."""
STEP = 0.2
"""Distance of a table's points, as a share of the decay and of the inverse duration."""
MAX_POINTS = 120
"""Points along ω and along g/ω at most."""


@dataclass(frozen=True, eq=False)
class TruncatedModes:
    """Modes that are known by sums."""

    share: TaylorModel  # C, (sources, m)
    amplitude: TaylorModel  # bound of √(A B), (sources, m)
    middle: Array  # middle of the responses that the share is multiplied by, (sources, m, T)
    half: Array  # half their range, that the amplitude is multiplied by
    # bound of the motion's distance from straight lines between nodes, without what forces add to
    # accelerations at once, (T, m)
    line_deviation: Array

    @property
    def width(self) -> Array:
        """Bound of the half width at the node where it is greatest, shape (m,)."""
        return np.asarray((self.amplitude.magnitude()[..., None] * self.half).max(-1).sum(0))


Sums = list[tuple[TaylorModel, TaylorModel]]
"""Σ a β (sources, m), Σ a² (m,), Σ β² (sources,) over modes, and each with its terms over λ;
without the outputs' factors."""


def rest_of_modes(
    structure: Classical,
    found: Subspaces,
    shares: Sequence[BlockShares],
    coordinates: tuple[TaylorModel, TaylorModel],
    excitation: Excitation,
) -> TruncatedModes | None:
    """Bounds of the motion of all modes that are not enclosed; None if there are none.

    `shares` are those of the enclosed modes `found`; `coordinates` outputs (m, n) and sources
    (sources, n) in the coordinates of these.
    """
    other_modes = found.others
    if not len(other_modes):
        return None
    sums = _sums_over_modes(found, *coordinates, max(x.block.norm.order for x in shares))
    for of_block in shares:
        pairs = zip(sums, sums_over_block(of_block), strict=True)
        sums = [(a - c, b - d) for (a, b), (c, d) in pairs]
    low, high = float(found.low[other_modes].min()), float(found.high[other_modes].max())
    ends = damped_range(structure, low, high, other_modes)
    return truncated_modes(sums, ends, structure, found, excitation)


def truncated_modes(
    sums: Sums,
    ends: tuple[Ends, Ends],
    structure: Classical,
    found: Subspaces,
    excitation: Excitation,
) -> TruncatedModes:
    """Bounds of the motion of modes by sums over them; `ends` bound their ω and g/ω."""
    orders = sorted({int(order) for order in structure.order})
    (omega, quotient), (loads, time, sources) = ends, excitation
    ranges = response_ranges(omega, quotient, loads, time, sources, orders)
    return _with_best_powers(structure, _amplitude_bounds(sums, structure, found), ranges)


def _sums_over_modes(found: Subspaces, read: TaylorModel, excited: TaylorModel, order: int) -> Sums:
    """Sums over all modes, of outputs `read` (m, n) and sources `excited` (sources, n)."""
    centre, mass, stiffness = found.centre, found.centre.mass, found.centre.stiffness
    if len(excited.active_inputs()):
        order, d = excited.order, excited.inputs
        mass, stiffness = (x.embedded(found.used, d) for x in (mass, stiffness))
    else:
        excited = mass.like(excited.value).widened(excited.remainder)
    mass, stiffness = mass.truncated(order), stiffness.truncated(order)
    rows = stiffness.like(read.value).widened(read.remainder)
    massive, light = slice(0, centre.modes), slice(centre.modes, None)
    least_mass, least_stiffness = (1 - variation for variation in found.variation)
    forces = excited @ mass
    mass_rows = rows[:, massive]
    of_mass = _diagonal(inverse_form(mass[massive, massive], mass_rows, mass_rows, least_mass))
    of_stiffness = _diagonal(inverse_form(stiffness, rows, rows, least_stiffness))
    if centre.modes < len(centre.basis):  # without what massless unknowns move by themselves
        light_rows = rows[:, light]
        massless = inverse_form(stiffness[light, light], light_rows, light_rows, least_stiffness)
        of_stiffness = of_stiffness - _diagonal(massless)
        of_mass = of_mass.widened(np.where(light_rows.magnitude().any(1), UNKNOWN, 0.0))
    by_stiffness = inverse_form(stiffness, forces, forces, least_stiffness)
    return [
        (excited @ rows.T, inverse_form(stiffness, forces, rows, least_stiffness)),
        (of_mass, of_stiffness),
        (_diagonal(forces @ excited.T), _diagonal(by_stiffness)),
    ]


def inverse_form(
    matrix: TaylorModel, left: TaylorModel, right: TaylorModel, least: float
) -> TaylorModel:
    """Taylor model of left A⁻¹ rightᵀ, shape (l, r), with a remainder quadratic in small residuals.

    With series x ≈ left A⁻¹ and y ≈ right A⁻¹ of residuals e = left − x A and f = right − y A it is
    x rightᵀ + e yᵀ + e A⁻¹ fᵀ. A (n, n) is diagonal in the middle of the box, left (l, n) and right
    (r, n) are rows, and A(u) ≥ least · A(0) over the box, as quadratic forms.
    """
    x, y = (solution_series(matrix, rows.T).T for rows in (left, right))
    e, f = (left - x @ matrix).magnitude(), (right - y @ matrix).magnitude()
    # |e A⁻¹ fᵀ| ≤ |e| |f| / least in the norm of A(0)⁻¹
    norms = (np.sqrt((size**2 / np.diag(matrix.value)).sum(1)) for size in (e, f))
    return (x @ right.T).widened(e @ y.magnitude().T + np.outer(*norms) / least)


def sums_over_block(of_block: BlockShares) -> Sums:
    """Sums over a block's modes, by X, N = Xᵀ M X and Xᵀ K X = N L."""
    projected_stiffness = of_block.block.norm @ of_block.block.rate.T
    read, forces = of_block.read, of_block.source_forces
    read_over_stiffness = solve(projected_stiffness, read)
    return [
        (of_block.participation.T @ read, forces.T @ read_over_stiffness),
        (of_block.of_outputs, column_products(read, read_over_stiffness)),
        (of_block.of_sources, column_products(forces, solve(projected_stiffness, forces))),
    ]


def _diagonal(matrix: TaylorModel) -> TaylorModel:
    at = np.arange(len(matrix.remainder))
    return matrix[at, at]


def _amplitude_bounds(
    sums: Sums, structure: Classical, found: Subspaces
) -> list[tuple[TaylorModel, TaylorModel]]:
    """C and the bound of √(A B) for each power 0, ½, 1 of λ, with the outputs' factors."""
    d, order = structure.start.inputs, structure.start.order
    (C0, C1), (A0, A1), (B0, B1) = (
        [x.truncated(order).embedded(found.used, d) for x in pair] for pair in sums
    )
    pairs = ((C0, A0, B0), (C0 * 0.0, A1, B0), (C1, A1, B1))
    factor = structure.factor
    return [(C * factor, _root(A, B) * factor) for C, A, B in pairs]


def _root(A: TaylorModel, B: TaylorModel) -> TaylorModel:
    """Bound (A t + B/t)/2 of √(A B), shape (sources, m), for A (m,) and B (sources,)."""
    _, of_A = A.bounds()
    _, of_B = B.bounds()
    # t is the least bound's; any other positive number is allowed, where a sum may be zero
    t: Array = np.sqrt(np.maximum(of_B, 1e-300)[:, None] / np.maximum(of_A, 1e-300))
    return A[None] * (t / 2) + B[:, None] * (0.5 / t)


def _with_best_powers(
    structure: Classical, bounds: list[tuple[TaylorModel, TaylorModel]], ranges: dict[int, Ranges]
) -> TruncatedModes:
    """Bounds of truncated modes' motion, for each source and output by the best power of λ."""
    of_outputs = [ranges[int(order)] for order in structure.order]
    low, high, deviation = (  # (powers, sources, m, T)
        np.stack(arrays, 2)
        for arrays in zip(*((x.low, x.high, x.line_deviation) for x in of_outputs), strict=True)
    )
    middle, half = (low + high) / 2, (high - low) / 2
    middle[1], half[1] = 0.0, np.abs(middle[1]) + half[1]  # Σ a β is not known with √λ
    amplitudes = np.stack([amplitude.magnitude() for _, amplitude in bounds])
    best = (amplitudes * half.max(-1)).argmin(0)
    share, amplitude = bounds[0][0] * 0.0, bounds[0][1] * 0.0
    for k, pair in enumerate(bounds):
        share, amplitude = share + pair[0] * (best == k), amplitude + pair[1] * (best == k)
    s, o = np.indices(best.shape)
    deviations = (amplitudes[..., None] * deviation).min(0).sum(0)
    return TruncatedModes(
        share=share,
        amplitude=amplitude,
        middle=middle[best, s, o],
        half=half[best, s, o],
        line_deviation=deviations.T,
    )


def coupling_bounds(
    structure: Classical, shares: BlockShares, found: Subspaces, excitation: Excitation
) -> tuple[Array, Array, tuple[Ends, Ends]]:
    """Bounds of what couples a block's oscillators, by L of K X = M X L off its diagonal.

    Returns:
        Bounds of what the coupling adds to outputs at nodes, and of how far the block's motion
        strays from a straight line in the step to a node, (T, m) each; its ranges of ω and of g/ω.
    """
    loads, time, sources = excitation
    block, modes = shares.block, shares.block.modes
    # bounds of the coupling over sup |de/dλ|, and of |a N^-½| |N^½ β|, (sources, m) each
    off = block.rate.magnitude() * (1.0 - np.eye(len(modes)))
    norm = 1 + float(np.linalg.norm(block.norm.deviation(), 2))
    read = np.sqrt(shares.of_outputs.magnitude()) * structure.factor.magnitude()
    of_columns = np.sqrt(norm) * np.linalg.norm(off, axis=1)
    by_slope = (shares.participation.magnitude().T @ of_columns)[:, None] * read
    size = norm * np.sqrt(shares.of_sources.magnitude())[:, None] * read  # of |a| |β|, too
    j = np.arange(len(off))
    low, high = block.rate[j, j].bounds()  # the λ lie in Gershgorin's discs about L_jj
    lambda_low = max(float((low - off.sum(1)).min()), float(found.low[modes[0]]))
    lambda_high = min(float((high + off.sum(1)).max()), float(found.high[modes[-1]]))
    lambda_low, lambda_high = min(lambda_low, float(low.min())), max(lambda_high, float(high.max()))
    (low_omega, high_omega), (least, most) = ends = damped_range(
        structure, lambda_low, lambda_high, modes
    )
    reach = STEP * (least * low_omega + 2 / max(float(time[-1]), 1e-300))
    points = (high_omega - low_omega) / reach, (most - least) * high_omega / reach
    along, across = (int(np.clip(x, 1, MAX_POINTS)) + 1 for x in points)
    orders = sorted({int(x) for x in structure.order})
    table = Oscillators(grid_over(*ends, (along, across)), loads, time, orders)
    fastest = high_omega * float(np.sqrt(1 + most**2))
    added, deviation = (np.zeros((len(time), len(structure.order))) for _ in range(2))
    for order in orders:
        o = np.flatnonzero(structure.order == order)
        for s, source in enumerate(sources):
            response = table.responses(source, order)
            G, G_slope = response.largest
            slope = response_slopes(source, G, G_slope, low_omega, most)
            half = np.ptp(response.value, axis=(1, 2)) / 2 + response.error
            bounds = np.outer(slope, by_slope[s, o]), 2 * np.outer(half, size[s, o])
            added[:, o] += np.minimum(*bounds)
            # The coupling is the block's motion less its oscillators'. Either strays from a line by
            # `straying` at most, so that the coupling does by twice that; or by twice its largest
            # value within the step.
            force = loads[source].extremes[0] if source in loads else 0.0
            G, G_slope = _within_steps(response.largest, time, force, fastest, order)
            slope = response_slopes(source, G, G_slope, low_omega, most)
            straying = np.outer(response.line_deviation, size[s, o])
            deviation[:, o] += 2 * np.minimum(straying, np.outer(slope, by_slope[s, o]))
    return added, deviation, ends


def _within_steps(largest: Array, time: Array, force: float, fastest: float, order: int) -> Array:
    """Bounds of |G| and |G′| in the step to each node by those at nodes (2, T); G = σ^order ρ."""
    # With |exp(σ τ)| ≤ 1, |f| ≤ force and |σ| ≤ fastest in
    #     G(t + τ) = exp(σ τ) G(t) + σ^n I,   I = ∫ exp(σ s) f(t + τ − s) ds from 0 to τ ≤ h,
    # |I| ≤ force h and |dI/dσ| ≤ force h²/2; the derivative of σ^n I is n σ^(n − 1) I + σ^n dI/dσ.
    h = np.diff(time, prepend=time[0])
    G, G_slope = np.roll(largest, 1, axis=1)
    of_power = order * fastest ** (order - 1) if order else 0.0
    of_integral = force * (of_power * h + fastest**order * h**2 / 2)
    return np.stack([G + force * h * fastest**order, G_slope + h * G + of_integral])


def response_slopes(
    source: str, G: Array, G_slope: Array, omega: Array | float, quotient: Array | float
) -> Array:
    """Bounds of |de/dλ| of responses e to a source, in the shape of G and G_slope.

    G are bounds of |σ^ν ρ|, G_slope of its derivative by σ; ω is the least, `quotient` the greatest
    g/ω.
    """
    # of g = (a + b λ)/2 + ζ √λ, ω² = λ − g²: 4 ω² |dσ/dλ|² = 1 + 4 g′ (g′ λ − g) ≤ 1, since
    # g′ λ ≤ g, and 2 ω³ |d(g/ω)/dλ| = |2 g′ λ − g| ≤ g
    if source == "start":  # e = Re G + (g/ω) Im G
        return (1 + quotient) * G_slope / (2 * omega) + G * quotient / (2 * omega**2)
    return G_slope / (2 * omega**2) + G / (2 * omega**3)  # e = ± Im G/ω, with |dω/dλ| ≤ |dσ/dλ|
