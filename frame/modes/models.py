"""Motion of a structure over a box: oscillators, what couples them, and all other modes."""

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
    BlockShares,
    Excitation,
    Oscillator,
    oscillators,
    source_patterns,
)
from alphacut.frame.modes.rest import (
    TruncatedModes,
    coupling_bounds,
    rest_of_modes,
    sums_over_block,
    truncated_modes,
)
from alphacut.frame.modes.structure import Classical
from alphacut.frame.response.duhamel import responses_at_nodes
from alphacut.frame.response.oscillators import POWERS, feedthrough, read_response

MAX_NODES = 500
"""Nodes at most at which the number of modes that are worth enclosing is estimated."""


@dataclass(frozen=True, eq=False)
class MotionModels:
    """A structure's motion over a box."""

    oscillators: list[Oscillator]  # one for each mode that is enclosed
    # modes that are known by sums: those of a block, and all that are not enclosed
    truncated: list[TruncatedModes]
    added: Array  # bound of what couples the oscillators of blocks, (T, m)
    # bound of how far what blocks of several modes add strays from straight lines between nodes,
    # (T, m)
    line_deviation: Array

    def on_subbox(self, low: Array, high: Array) -> MotionModels:
        """The models over the part low ≤ u ≤ high of the box, in unit coordinates of the part."""
        models = [x for mode in self.oscillators for x in mode.models]
        models += [x for rest in self.truncated for x in (rest.share, rest.amplitude)]
        restricted = iter(all_on_subbox(models, low, high))  # in the same order
        return replace(
            self,
            oscillators=[x.on_part([next(restricted) for _ in x.models]) for x in self.oscillators],
            truncated=[
                replace(x, share=next(restricted), amplitude=next(restricted))
                for x in self.truncated
            ],
        )

    @classmethod
    def from_structure(
        cls, structure: Classical, excitation: Excitation, allowed: Array | None = None
    ) -> MotionModels:
        """Models of a structure's motion over its box.

        The lowest modes are enclosed in blocks. A block of one mode is an oscillator. A larger one
        is an oscillator for each mode and a bound of their coupling or, where that is narrower,
        modes known by their sums, as all modes are that are not enclosed.

        `allowed` is the truncation error of each output that is allowed, (m,); none unless given.

        Raises:
            UnprovedError: None of its modes can be enclosed.
        """
        centre, used = centred_matrices(structure.mass, structure.stiffness)
        excited = (
            source_patterns(structure, excitation[2]) @ inverse(centre.basis, structure.start).T
        )
        wanted, tolerances = centre.modes, np.asarray(np.zeros(centre.modes))  # all, closely
        if allowed is not None:
            wanted, tolerances = modes_wanted(structure, centre, excited, excitation, allowed)
        found = enclose_subspaces(centre, used, wanted, tolerances)
        if not found.blocks:
            raise UnprovedError(
                "no mode keeps clear of the others", "take narrower inputs", found.along
            )
        rows = structure.start.like(structure.rows) @ centre.basis
        shares = [BlockShares.from_block(block, rows, excited, used) for block in found.blocks]
        single, truncated = list[Oscillator](), list[TruncatedModes]()
        added, deviation = np.zeros((2, len(excitation[1]), len(structure.order)))
        for of_block in shares:
            of_modes = oscillators(structure, of_block, found)
            if len(of_modes) > 1:
                more, straying, ends = coupling_bounds(structure, of_block, found, excitation)
                sums = sums_over_block(of_block)
                by_sums = truncated_modes(sums, ends, structure, found, excitation)
                scale = np.maximum(more.max(0) if allowed is None else allowed, 1e-300)
                is_narrower = (by_sums.width / scale).max() < (more.max(0) / scale).max()
                if is_narrower and (single or of_block is not shares[-1]):  # one oscillator is left
                    truncated.append(by_sums)
                    continue
                added, deviation = added + more, deviation + straying
            single += of_modes
        others = rest_of_modes(structure, found, shares, (rows, excited), excitation)
        truncated += [] if others is None else [others]
        return cls(single, truncated, np.asarray(added), np.asarray(deviation))


def inverse(basis: Array, like: TaylorModel) -> TaylorModel:
    """The inverse of a matrix of numbers with its rounding, of the inputs of a model `like`."""
    found, n = np.linalg.inv(basis), len(basis)
    left = np.abs(np.eye(n) - basis @ found) + gamma(n + 1) * (np.abs(basis) @ np.abs(found))
    # B⁻¹ − C = C (I − B C) + …, of which the terms beyond the first are far below a tenth
    return like.like(found).widened(1.1 * np.abs(found) @ left)


def modes_wanted(
    structure: Classical,
    centre: CentredMatrices,
    excited: TaylorModel,
    excitation: Excitation,
    allowed: Array,
) -> tuple[int, Array]:
    """Least number of lowest modes to enclose, so that what truncating the others errs is allowed.

    It is an estimate by the bounds of `TruncatedModes`, with sums and responses in the middle of
    the box. Sources `excited` (sources, n) are in the coordinates of `centre`.

    Returns:
        The number, and the relative error of each mode's λ that changes an output by its allowed
        error, shape (n,).
    """
    loads, time, sources = excitation
    time = time[:: -(-len(time) // MAX_NODES)]
    squared, n = centre.squared, centre.modes
    rows = structure.rows @ centre.basis
    read = rows[:, :n] * structure.factor.value[:, None]
    participation = excited.value[:, :n]
    reads_massless = np.any(rows[:, n:], axis=1)
    a, b = structure.rayleigh.value
    decay = (a + b * squared) / 2 + structure.ratio.value[:n] * np.sqrt(squared)
    omega = np.sqrt(np.maximum(squared - decay**2, 1e-6 * squared))
    sigma = (-decay + 1j * omega)[:, None]
    error, sensitivity = np.zeros((2, n, len(allowed)))
    for s, source in enumerate(sources):
        if source in loads:  # ρ and its derivative by σ, (modes, T) each
            rho = responses_at_nodes(sigma[:, 0], loads[source], time, 1)[0].swapaxes(1, 2)
        else:
            rho = np.stack([np.exp(sigma * time), time * np.exp(sigma * time)])
        for o, order in enumerate(structure.order):
            response = read_response(source, sigma, sigma**order * rho[0])
            response = response + feedthrough(source, loads, int(order), time)
            # λ |de/dλ|, as |dσ/dλ| ≈ 1/(2 ω)
            slope = np.abs(rho[1]).max(1) * omega ** (order + (source == "start")) / 2
            sensitivity[:, o] += np.abs(read[o] * participation[s]) * slope
            errors = [
                _truncation_error(read[o], participation[s], response, squared, x) for x in POWERS
            ]
            # the first power needs Σ read², which is unknown where massless unknowns are read
            error[:, o] += np.min(errors[int(reads_massless[o]) :], axis=0)
    sufficient = np.flatnonzero((error <= allowed).all(1))
    wanted = max(int(sufficient[0]), 1) if len(sufficient) else n
    return wanted, np.min(allowed / np.maximum(sensitivity, 1e-300), axis=1)


def _truncation_error(
    read: Array, participation: Array, response: Array, squared: Array, power: float
) -> Array:
    """Error of an output without the modes from k on, for each k, shape (n,)."""
    # √(Σ a² Σ β²) times half the range of λ^power e (Cauchy, Schwarz); from power ½ on a² is over λ
    outputs = np.cumsum((read**2 / squared ** float(power > 0))[::-1])[::-1]
    sources = np.cumsum((participation**2 / squared ** float(power == 1))[::-1])[::-1]
    scaled = response * squared[:, None] ** power
    high, low = (np.maximum.accumulate(sign * scaled[::-1])[::-1] for sign in (1, -1))
    half = np.maximum(high, low)
    if power != POWERS[1]:  # ranges reach down to the mode below, as frequencies vary
        half = (high + low)[np.maximum(np.arange(len(high)) - 1, 0)] / 2
    return np.asarray(np.sqrt(outputs * sources) * half.max(1))
