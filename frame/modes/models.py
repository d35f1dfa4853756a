"""Motion of a structure over a box: oscillators, what couples them, and all other modes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from alphacut.frame.calculus.rounding import gamma
from alphacut.frame.calculus.taylor_model import TaylorModel, all_within
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.clusters import Subspaces, centred_matrices, subspaces
from alphacut.frame.modes.coupling import coupling_of
from alphacut.frame.modes.intervening import BlockShares, Oscillator, oscillators, sources_of
from alphacut.frame.modes.rest import Excitation, TruncatedModes, rest_of_block, rest_of_modes
from alphacut.frame.modes.structure import Classical
from alphacut.frame.modes.wanted import modes_wanted
from alphacut.fuzzy.arrays import Array


@dataclass(frozen=True, eq=False)
class MotionModels:
    """A structure's motion over a box.

    Args:
        oscillators: Oscillators, one a mode that is enclosed.
        truncated: Modes that are known by sums: those of a block, and all that are not enclosed.
        added: Bound of what couples the oscillators of blocks, shape (T, m).
        line_deviation: Bound of how far what blocks of several modes add strays from straight
            lines between nodes, shape (T, m).
    """

    oscillators: list[Oscillator]
    truncated: list[TruncatedModes]
    added: Array
    line_deviation: Array

    def within(self, low: Array, high: Array) -> MotionModels:
        """The models over the part low ≤ u ≤ high of the box, in unit coordinates of the part."""
        models = [x for mode in self.oscillators for x in mode.models]
        models += [
            x for truncated in self.truncated for x in (truncated.share, truncated.amplitude)
        ]
        restricted = iter(all_within(models, low, high))  # in the same order
        single = [
            mode.on_part([next(restricted) for _ in mode.models]) for mode in self.oscillators
        ]
        rests = [
            replace(truncated, share=next(restricted), amplitude=next(restricted))
            for truncated in self.truncated
        ]
        return replace(self, oscillators=single, truncated=rests)

    @classmethod
    def from_structure(
        cls, structure: Classical, excitation: Excitation, allowed: Array | None = None
    ) -> MotionModels:
        """Models of a structure's motion over its box: enclosed blocks of modes, and all others.

        Args:
            structure: The structure.
            excitation: The loads, the nodes and the names of the sources.
            allowed: Truncation error of each output that is allowed, shape (m,); none unless given.

        Raises:
            UnprovedError: None of its modes can be enclosed.
        """
        centre, used = centred_matrices(structure.mass, structure.stiffness)
        excited = sources_of(structure, excitation[2]) @ inverse(centre.basis, structure.start).T
        wanted, tolerances = centre.modes, np.asarray(np.zeros(centre.modes))  # all, closely
        if allowed is not None:
            wanted, tolerances = modes_wanted(structure, centre, excited, excitation, allowed)
        found = subspaces(centre, used, wanted, tolerances)
        if not found.blocks:
            raise UnprovedError(
                "no mode keeps clear of the others", "take narrower inputs", found.along
            )
        rows = structure.start.like(structure.rows) @ centre.basis
        shares = [BlockShares.from_block(block, rows, excited, used) for block in found.blocks]
        zero = np.zeros((len(excitation[1]), len(structure.order)))
        models = cls(oscillators=[], truncated=[], added=zero, line_deviation=zero)
        for of_block in shares:
            models = models.with_block(structure, of_block, found, excitation, allowed)
        truncated = rest_of_modes(structure, found, shares, (rows, excited), excitation)
        if truncated is None:
            return models
        return replace(models, truncated=[*models.truncated, truncated])

    def with_block(
        self,
        structure: Classical,
        of_block: BlockShares,
        found: Subspaces,
        excitation: Excitation,
        allowed: Array | None,
    ) -> MotionModels:
        """Models with a block of close modes added.

        A block of one mode is an oscillator. A larger one is an oscillator for each mode and a
        bound of their coupling or, where that is narrower, truncated modes known by their sums.

        Args:
            structure: The structure.
            of_block: What the block takes from the sources and gives to the outputs.
            found: All enclosed blocks.
            excitation: The loads, the nodes and the names of the sources.
            allowed: Error of each output by which both are compared, shape (m,); None for the bound
                of the coupling.
        """
        all_oscillators = self.oscillators + oscillators(structure, of_block, found)
        if len(of_block.block.modes) == 1:
            return replace(self, oscillators=all_oscillators)
        coupling = coupling_of(structure, of_block, found)
        added, deviation = coupling.bounds(structure.order, excitation)
        ends = coupling.omega_range, coupling.quotient_range
        truncated = rest_of_block(structure, found, of_block, ends, excitation)
        scale = np.maximum(added.max(0) if allowed is None else allowed, 1e-300)
        if (truncated.width / scale).max() < (added.max(0) / scale).max():
            return replace(self, truncated=[*self.truncated, truncated])
        added, deviation = self.added + added, self.line_deviation + deviation
        return replace(self, oscillators=all_oscillators, added=added, line_deviation=deviation)


def inverse(basis: Array, like: TaylorModel) -> TaylorModel:
    """The inverse of a matrix of numbers with its rounding, of the inputs of a model `like`."""
    found, n = np.linalg.inv(basis), len(basis)
    left = np.abs(np.eye(n) - basis @ found) + gamma(n + 1) * (np.abs(basis) @ np.abs(found))
    # B⁻¹ − C = C (I − B C) + …, of which the terms beyond the first are far below a tenth
    return like.like(found).loosened(1.1 * np.abs(found) @ left)
