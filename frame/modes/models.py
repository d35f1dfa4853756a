"""Response of a structure over a box: oscillators, what couples them, and all other modes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.calculus.rounding import gamma
from alphacut.frame.calculus.taylor_model import TaylorModel, all_on_subbox
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.blocks import CentredMatrices
from alphacut.frame.modes.clusters import centred_matrices, enclose_subspaces
from alphacut.frame.modes.intervening import (
    BlockParticipation,
    Excitation,
    Oscillator,
    oscillators,
    source_patterns,
)
from alphacut.frame.modes.structure import ClassicalStructure
from alphacut.frame.modes.truncated_modes import (
    POWER_SQRT,
    TruncatedModes,
    coupling_bounds,
    modal_sums_of_block,
    response_of_truncated_modes,
    truncated_modes,
)
from alphacut.frame.response.chord_deviation import load_deviation
from alphacut.frame.response.duhamel import responses_at_nodes
from alphacut.frame.response.oscillators import POWERS, Source


@dataclass(frozen=True, eq=False)
class ModalResponseModels:
    """Models of a structure's response over a box, for T time nodes and m outputs."""

    oscillators: list[Oscillator]  # one for each mode that is enclosed as such
    # modes that are known by sums: those of a block, and all that are not enclosed
    truncated: list[TruncatedModes]
    coupling: Array  # bound of what couples the oscillators of blocks, (T, m)
    # bound of the distance from straight lines between nodes of what blocks of several modes add,
    # (T, m)
    interpolation_error: Array

    def on_subbox(self, low: Array, high: Array) -> ModalResponseModels:
        """Return the models over the sub-box low ≤ u ≤ high, in its own unit coordinates.

        Bounds of the coupling of oscillators and between time nodes stay those of the whole box,
        which are valid in the sub-box, too.

        Args:
            low: Lower ends, shape (d,), not below −1.
            high: Upper ends, shape (d,), not above 1.
        """
        models = [x for mode in self.oscillators for x in mode.models]
        for modes in self.truncated:
            models += [modes.participation, modes.amplitude]
        restricted = iter(all_on_subbox(models, low, high))  # in the same order
        oscillators = []
        for mode in self.oscillators:
            own_models = [next(restricted) for _ in mode.models]
            oscillators.append(mode.on_subbox(own_models))
        truncated = []
        for modes in self.truncated:
            participation = next(restricted)
            amplitude = next(restricted)
            truncated.append(replace(modes, participation=participation, amplitude=amplitude))
        return replace(self, oscillators=oscillators, truncated=truncated)

    @classmethod
    def from_structure(
        cls,
        structure: ClassicalStructure,
        excitation: Excitation,
        truncation_tolerance: Array | None = None,
    ) -> ModalResponseModels:
        """Return models of a structure's response over its box.

        The lowest modes are enclosed in blocks. A block of one mode is an oscillator. A larger one
        is an oscillator for each mode and a bound of their coupling or, where that is narrower,
        modes known by their sums, as all modes are that are not enclosed.

        Args:
            structure: The structure over the box.
            excitation: Time nodes and sources.
            truncation_tolerance: Allowed error of each output by truncated modes, shape (m,). All
                modes are enclosed, as precisely as possible, unless it is given.

        Raises:
            UnprovedError: None of its modes can be enclosed, or the mode shapes at the midpoint of
                the box are ill conditioned.
        """
        centre, used = centred_matrices(structure.mass, structure.stiffness)
        to_centred = inverse_with_rounding(centre.basis, like=structure.initial_state)
        patterns = source_patterns(structure, excitation.sources) @ to_centred.T
        selection = ModeSelection(centre.mode_count, np.zeros(centre.mode_count))
        if truncation_tolerance is not None:
            selection = required_modes(
                structure, centre, patterns, excitation, tolerance=truncation_tolerance
            )
        found = enclose_subspaces(centre, used, selection.count, selection.eigenvalue_tolerances)
        if not found.blocks:
            raise UnprovedError(
                "no mode keeps clear of the others", "take narrower inputs", found.bisection_input
            )
        rows = structure.initial_state.like(structure.output_rows) @ centre.basis
        participations = [
            BlockParticipation.from_block(block, rows, patterns, used) for block in found.blocks
        ]

        all_oscillators = list[Oscillator]()
        truncated = list[TruncatedModes]()
        shape = (len(excitation.time), len(structure.derivative_orders))
        coupling: Array = np.zeros(shape)
        interpolation_error: Array = np.zeros(shape)
        for of_block in participations:
            of_modes = oscillators(structure, of_block, found)
            if len(of_modes) > 1:
                bounds = coupling_bounds(structure, of_block, found, excitation)
                sums = modal_sums_of_block(of_block)
                by_sums = response_of_truncated_modes(
                    sums, bounds.ranges, structure, found, excitation
                )
                # The narrower of both is taken, in comparison with what is allowed. One oscillator
                # at least must be left.
                by_coupling = bounds.at_nodes.max(axis=0)
                allowed = by_coupling if truncation_tolerance is None else truncation_tolerance
                scale = np.maximum(allowed, 1e-300)
                is_narrower = (by_sums.radius / scale).max() < (by_coupling / scale).max()
                if is_narrower and (all_oscillators or of_block is not participations[-1]):
                    truncated.append(by_sums)
                    continue
                coupling = coupling + bounds.at_nodes
                interpolation_error = interpolation_error + bounds.interpolation_error
            all_oscillators += of_modes
        others = truncated_modes(structure, found, participations, rows, patterns, excitation)
        if others is not None:
            truncated.append(others)
        # The tables of oscillators contain what forces add at once through these.
        for s, source in enumerate(excitation.sources):
            if source.is_force and source.load:
                of_others = _feedthrough_of_others(structure, source, all_oscillators, s)
                deviation = load_deviation(source.load, excitation.time)
                interpolation_error = interpolation_error + np.outer(deviation, of_others)
        return cls(all_oscillators, truncated, coupling, interpolation_error)


def _feedthrough_of_others(
    structure: ClassicalStructure, source: Source, enclosed: list[Oscillator], index: int
) -> Array:
    """Bound what a unit of a force adds to outputs at once by modes not enclosed one by one, (m,).

    A force acts on accelerations at once, by M⁻¹ b f, of which the participation factors of the
    oscillators are a part. Bounds of outputs that are no accelerations are 0.

    Args:
        structure: The structure over the box.
        source: The force.
        enclosed: The oscillators.
        index: Index of the force among the sources.
    """
    coefficient = structure.force_accelerations[source.name][None] @ structure.output_rows.T
    feedthrough = coefficient[0] * structure.output_factors
    midpoint: Array = feedthrough.value
    radius = feedthrough.deviation()
    for mode in enclosed:
        participation = mode.participation[index]
        midpoint = midpoint - participation.value
        radius = radius + participation.deviation()
    return np.where(structure.derivative_orders == 2, np.abs(midpoint) + radius, 0.0)


def inverse_with_rounding(basis: Array, *, like: TaylorModel) -> TaylorModel:
    """Return the inverse of a matrix of numbers with a bound of its rounding, shape (n, n).

    Args:
        basis: Shape (n, n).
        like: A Taylor model of the inputs that the result, a constant, is given as a function of.

    Raises:
        UnprovedError: The matrix is so ill conditioned that the error is not bounded.
        numpy.linalg.LinAlgError: The matrix is singular.
    """
    found = np.linalg.inv(basis)
    n = len(basis)
    residual = np.abs(np.eye(n) - basis @ found)
    residual += gamma(n + 1) * (np.abs(basis) @ np.abs(found))
    # With the computed inverse C and R = I − B C, B⁻¹ − C = C R + C R² + …. If ρ, the largest sum
    # of a row of |R|, is below 1, the series converges. Entries of |x R| for a row x add up to at
    # most ρ times those of |x|, so that the terms beyond the first are at most ρ/(1 − ρ) times the
    # sum of a row of |C| |R|.
    rho = float(residual.sum(axis=1).max())
    if not rho < 1:
        what = "the mode shapes at the midpoint of the box are ill conditioned"
        raise UnprovedError(what, "take masses of less different magnitudes")
    first = np.abs(found) @ residual
    others = first.sum(axis=1, keepdims=True) * rho / (1 - rho)
    return like.like(found).widened((1 + gamma(8 * n + 8)) * (first + others))


@dataclass(frozen=True, eq=False)
class ModeSelection:
    """How many of the lowest modes must be enclosed, and how precisely."""

    count: int
    # relative error of each eigenvalue that changes some output by its tolerance, (modes,)
    eigenvalue_tolerances: Array


def required_modes(
    structure: ClassicalStructure,
    centre: CentredMatrices,
    patterns: TaylorModel,
    excitation: Excitation,
    *,
    tolerance: Array,
) -> ModeSelection:
    """Estimate how many of the lowest modes must be enclosed, and how precisely.

    The count is the smallest one for which the estimated error of truncating all higher modes stays
    below the tolerance of every output. The estimate takes sums and responses at the midpoint of
    the box; it only chooses the count and proves nothing.

    Args:
        structure: The structure over the box.
        centre: Its mass and stiffness in coordinates that are modal at the midpoint.
        patterns: Vectors of the sources in these coordinates, shape (sources, n).
        excitation: Time nodes and sources.
        tolerance: Largest allowed error of each output in its own unit, shape (m,).
    """
    time, sources = excitation
    time = time[:: -(-len(time) // 500)]  # 500 nodes at most, which suffice for an estimate
    eigenvalues = centre.eigenvalues
    n = centre.mode_count
    rows = structure.output_rows @ centre.basis
    output_modes = rows[:, :n] * structure.output_factors.value[:, np.newaxis]
    participation = patterns.value[:, :n]
    takes_massless = np.any(rows[:, n:], axis=1)
    a, b = structure.rayleigh.value
    decay = (a + b * eigenvalues) / 2 + structure.damping_ratios.value[:n] * np.sqrt(eigenvalues)
    omega = np.sqrt(np.maximum(eigenvalues - decay**2, 1e-6 * eigenvalues))
    sigma = (-decay + 1j * omega)[:, np.newaxis]
    error = np.zeros((n, len(tolerance)))  # of truncating mode k and all above it
    sensitivity = np.zeros((n, len(tolerance)))  # of outputs to ln λ_k
    for s, source in enumerate(sources):
        # ρ and its derivative by σ, (2, modes, T)
        if source.load:
            rho = responses_at_nodes(sigma[:, 0], source.load, time, 1).swapaxes(1, 2)
        else:
            rho = np.stack([np.exp(sigma * time), time * np.exp(sigma * time)])
        for o, order in enumerate(structure.derivative_orders):
            response = source.read(sigma, sigma**order * rho[0])
            response = response + source.feedthrough(int(order), time)
            # λ |de/dλ|, as |dσ/dλ| ≈ 1/(2 ω)
            largest = np.abs(rho[1]).max(axis=1)
            slope = largest * omega**order / 2
            if source.is_displacement:  # whose response is not divided by ω
                slope = slope * omega
            sensitivity[:, o] += np.abs(output_modes[o] * participation[s]) * slope
            errors = [
                _truncation_error(
                    output_modes[o], participation[s], response, eigenvalues, power=power
                )
                for power in POWERS
            ]
            # The power 0 needs Σ a², which is unknown where outputs take massless unknowns.
            if takes_massless[o]:
                errors = errors[POWER_SQRT:]
            error[:, o] += np.min(errors, axis=0)
    sufficient = np.flatnonzero((error <= tolerance).all(axis=1))
    count = max(int(sufficient[0]), 1) if len(sufficient) else n
    relative_errors = tolerance / np.maximum(sensitivity, 1e-300)
    return ModeSelection(count, np.min(relative_errors, axis=1))


def _truncation_error(
    output_modes: Array, participation: Array, response: Array, eigenvalues: Array, *, power: float
) -> Array:
    """Estimate the error of an output without the modes from k on, for each k, shape (n,).

    By Cauchy and Schwarz it is √(Σ a² Σ β²) times the radius of the range of λ^κ e over these
    modes. At κ = ½ each a² is divided by λ, and at κ = 1 each a² and each β². It is an estimate at
    the midpoint of the box, and no bound.

    Args:
        output_modes: Output row times mode shape a of n modes by rising frequency, shape (n,).
        participation: Participation factors β, shape (n,).
        response: Responses e of the modes at T times, shape (n, T).
        eigenvalues: λ, shape (n,), positive.
        power: κ: 0, ½ or 1.
    """
    output_terms = output_modes**2 / eigenvalues ** float(power > 0)
    source_terms = participation**2 / eigenvalues ** float(power == 1)
    output_sums = np.cumsum(output_terms[::-1])[::-1]  # over modes k and above
    source_sums = np.cumsum(source_terms[::-1])[::-1]
    scaled = response * eigenvalues[:, np.newaxis] ** power
    high = np.maximum.accumulate(scaled[::-1])[::-1]
    minus_low = np.maximum.accumulate(-scaled[::-1])[::-1]
    if power == POWERS[POWER_SQRT]:  # the range must be centred at zero
        radius = np.maximum(high, minus_low)
    else:  # ranges reach down to the mode below, as frequencies vary
        mode_below = np.maximum(np.arange(len(high)) - 1, 0)
        radius = (high + minus_low)[mode_below] / 2
    return np.asarray(np.sqrt(output_sums * source_sums) * radius.max(axis=1))
