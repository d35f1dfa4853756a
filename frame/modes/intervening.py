"""Intervening variables of the modes (section 7) as Taylor models with proved remainders.

Intervening variables are functions of the inputs of which the response is made (Barthelemy, Haftka
1993). An output is Σ_k Σ_s c_ks e_s(ω_k, g_k; t) over modes k and sources s (loads, velocity,
start), with few numbers for each mode: its frequency ω_k, its decay g_k and its participation
factors c_ks = (r·x)(x·M v_s)/(x·M x). Here x is the mode shape, r the row of the output, and v_s
the pattern of the ground or the initial state. These numbers bend little over the box, however many
inputs it has.

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

from alphacut.base.arrays import Array, Ints
from alphacut.frame.calculus.taylor_model import TaylorModel, concatenate, solve
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.blocks import Block
from alphacut.frame.modes.clusters import Subspaces
from alphacut.frame.modes.structure import ClassicalStructure
from alphacut.frame.response.oscillators import Grid, Source

Ends = tuple[float, float]
"""Lower and upper end of a range."""


class Excitation(NamedTuple):
    """What moves a structure, and when its response is wanted."""

    time: Array  # time nodes, (T,), in s
    sources: Sequence[Source]


@dataclass(frozen=True, eq=False)
class Oscillator:
    """Intervening variables of one mode, or of one diagonal entry of a block."""

    omega: TaylorModel  # damped frequency ω, a scalar, in rad/s
    decay: TaylorModel  # g, a scalar, in 1/s
    quotient: TaylorModel  # g/ω, a scalar
    participation: TaylorModel  # participation factors c, (sources, m)
    omega_range: Ends  # range of ω over the box, which may be narrower than that of the model
    quotient_range: Ends  # range of g/ω

    @property
    def models(self) -> list[TaylorModel]:
        """All its models: ω, g, g/ω, c."""
        return [self.omega, self.decay, self.quotient, self.participation]

    def on_subbox(self, models: Sequence[TaylorModel]) -> Oscillator:
        """Return the oscillator over a sub-box of the box of the inputs.

        Its ranges are the intersections of those of the whole box with those of the models over the
        sub-box.

        Args:
            models: Its models over the sub-box, four of them, in the order of the property
                `models`: frequency ω, decay g and g/ω, scalars, and participation factors (sources,
                m).

        Raises:
            ValueError: There are not four models.
        """
        omega, decay, quotient, participation = models
        return Oscillator(
            omega=omega,
            decay=decay,
            quotient=quotient,
            participation=participation,
            omega_range=_overlap(range_of(omega), self.omega_range),
            quotient_range=_overlap(range_of(quotient), self.quotient_range),
        )

    def table_cell(self, grid: Grid) -> Ints:
        """Return the first and last points of a grid that enclose ω, then g/ω, shape (4,)."""
        first, last = _enclosing_points(grid.omega, self.omega_range)
        low, high = _enclosing_points(grid.quotient, self.quotient_range)
        return np.array([first, last, low, high])


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
        block = block.truncated(min(degree, block.modal_mass.order))
        has_constant_rows = not len(rows.active_inputs())
        if has_constant_rows and not len(patterns.active_inputs()):
            patterns = block.modal_mass.like(patterns.value).widened(patterns.remainder)
        else:
            block = block.truncated(patterns.order).embedded(used, patterns.inputs)
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
            omega_range=_overlap(range_of(omega), (lowest_omega, high)),
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
        low: In 1/s², positive.
        high: In 1/s².
        modes: Indices of the modes, shape (p,), p ≥ 1, for their damping ratios.

    Returns:
        `omega`, lower and upper end in rad/s, and `quotient`, those of g/ω.

    Raises:
        UnprovedError: One of them may not oscillate, since g/√λ may reach 1.
    """
    rayleigh_low, rayleigh_high = structure.rayleigh.bounds()
    a_low, b_low = np.maximum(rayleigh_low, 0.0)
    a_high, b_high = np.maximum(rayleigh_high, 0.0)
    ratio_low, ratio_high = structure.damping_ratios[modes].bounds()
    slow = np.sqrt(low)
    fast = np.sqrt(high)
    # The ratio of damping of a mode is g/√λ = a/(2 √λ) + b √λ/2 + ζ.
    max_damping = float(a_high / (2 * slow) + b_high * fast / 2 + np.maximum(ratio_high, 0.0).max())
    min_damping = float(a_low / (2 * fast) + b_low * slow / 2 + np.maximum(ratio_low, 0.0).min())
    if max_damping >= 1:
        raise UnprovedError("a mode may not oscillate", "take less damping")
    min_ratio = np.sqrt(1 - max_damping**2)  # the smallest ω/√λ
    return DampedRanges(
        omega=(float(slow * min_ratio), float(fast)),
        quotient=(min_damping, float(max_damping / min_ratio)),
    )


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


def range_of(x: TaylorModel) -> Ends:
    """Return the range of a scalar Taylor model over the box."""
    low, high = x.bounds()
    return float(low), float(high)


def _overlap(first: Ends, second: Ends) -> Ends:
    """Return the intersection of two ranges."""
    return max(first[0], second[0]), min(first[1], second[1])


def _enclosing_points(points: Array, ends: Ends) -> tuple[int, int]:
    """Return the indices of two of some points that enclose a range as closely as possible.

    A range that reaches beyond the points is enclosed up to the first or last of them.

    Args:
        points: Rising, shape (N,), N ≥ 1.
        ends: Lower and upper end of the range.
    """
    low, high = ends
    first = int(np.searchsorted(points, low, side="right")) - 1
    last = int(np.searchsorted(points, high))
    return max(first, 0), min(last, len(points) - 1)
