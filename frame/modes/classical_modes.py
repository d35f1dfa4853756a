"""Classical modes over a box: oscillators, what couples them, and all other modes by sums."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.calculus.taylor_model import TaylorModel, concatenate
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.blocks import CentredMatrices
from alphacut.frame.modes.clusters import (
    BlockParticipation,
    centred_matrices,
    enclose_subspaces,
    oscillators,
    source_patterns,
)
from alphacut.frame.modes.modes import Excitation, Modes, Oscillator, TruncatedModes, feedthroughs
from alphacut.frame.modes.structure import ClassicalStructure
from alphacut.frame.modes.truncated_modes import (
    coupling_bounds,
    modal_sums_of_block,
    response_of_truncated_modes,
    truncated_modes,
)
from alphacut.frame.response.duhamel import responses_at_nodes
from alphacut.frame.response.tables import POWERS


def classical_modes(
    structure: ClassicalStructure,
    excitation: Excitation,
    truncation_tolerance: Array | None = None,
) -> Modes:
    """Return the modes of a structure without coupling dashpots over its box.

    The lowest modes are enclosed in blocks. A block of one mode is an oscillator. A larger one
    is an oscillator for each mode and a bound of their coupling or, where that is narrower,
    modes known by their sums, as all modes are that are not enclosed.

    Args:
        structure: The structure over the box.
        excitation: Time nodes and sources.
        truncation_tolerance: Allowed error of each output by truncated modes, shape (m,). All
            modes are enclosed, as precisely as possible, unless it is given.

    Raises:
        UnprovedError: None of its modes can be enclosed.
        numpy.linalg.LinAlgError: The mode shapes at the midpoint of the box are singular.
    """
    centre, used = centred_matrices(structure.mass, structure.stiffness)
    to_centred = np.asarray(np.linalg.inv(centre.basis), float)
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
            by_sums = response_of_truncated_modes(sums, bounds.ranges, structure, found, excitation)
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
    if (structure.derivative_orders == 2).any():
        truncated += _feedthroughs_of_forces(structure, excitation)
    return Modes(
        time=excitation.time,
        sources=excitation.sources,
        orders=structure.derivative_orders,
        oscillators=all_oscillators,
        truncated=truncated,
        open=coupling,
        open_between=interpolation_error,
    )


def _feedthroughs_of_forces(
    structure: ClassicalStructure, excitation: Excitation
) -> list[TruncatedModes]:
    """Return what forces add to accelerations at once, M⁻¹ b f; nothing without a force.

    Inertia forces of further components of the ground motion add nothing to absolute accelerations.

    Args:
        structure: The structure over the box.
        excitation: T time nodes and the sources.
    """
    forces = [source for source in excitation.sources if source.name.startswith("force")]
    if not forces:
        return []
    accelerations = [structure.force_accelerations[source.name][None] for source in forces]
    takes_acceleration = (structure.derivative_orders == 2).astype(float)
    factors = concatenate(accelerations, -2) @ structure.output_rows.T
    return [
        feedthroughs(
            factors * structure.output_factors * takes_acceleration,
            [source.load for source in forces if source.load],
            excitation.time,
        )
    ]


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
                errors = errors[1:]
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
    modes. At κ = 1 each a² and each β² is divided by λ. It is an estimate at the midpoint of the
    box, and no bound.

    Args:
        output_modes: Output row times mode shape a of n modes by rising frequency, shape (n,).
        participation: Participation factors β, shape (n,).
        response: Responses e of the modes at T times, shape (n, T).
        eigenvalues: λ, shape (n,), positive.
        power: κ: 0 or 1.
    """
    weights = eigenvalues**-power
    output_sums = np.cumsum((output_modes**2 * weights)[::-1])[::-1]  # over modes k and above
    source_sums = np.cumsum((participation**2 * weights)[::-1])[::-1]
    scaled = response * eigenvalues[:, np.newaxis] ** power
    high = np.maximum.accumulate(scaled[::-1])[::-1]
    minus_low = np.maximum.accumulate(-scaled[::-1])[::-1]
    # ranges reach down to the mode below, as frequencies vary
    mode_below = np.maximum(np.arange(len(high)) - 1, 0)
    radius = (high + minus_low)[mode_below] / 2
    return np.asarray(np.sqrt(output_sums * source_sums) * radius.max(axis=1))
