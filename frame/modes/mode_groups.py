"""Periods and participation of the lowest modes over a box, in groups that keep apart.

A group is one mode, several that meet or come near one another in the box, or all modes that are
not enclosed. Of a group the sums over its modes are known, however the modes turn in their common
subspace (see `truncated_modes`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Ints
from alphacut.frame.calculus.taylor_model import TaylorModel, solve
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.blocks import eigenvalue_discs
from alphacut.frame.modes.clusters import (
    BlockParticipation,
    centred_matrices,
    damping_range,
    enclose_subspaces,
)
from alphacut.frame.modes.model_fields import with_models
from alphacut.frame.modes.modes import Ends
from alphacut.frame.modes.structure import modal_ratios
from alphacut.frame.modes.truncated_modes import ModalSums, modal_sums_of_block, sums_over_all_modes
from alphacut.frame.structures.linear import Assembly, stack


class Subspace(NamedTuple):
    """What several modes span: an output of a function f of the eigenvalues is a f(L) β."""

    output_modes: TaylorModel  # a, output rows times shapes, with the factors of outputs, (p, m)
    participation: TaylorModel  # β, of the motion of the ground, (p,)
    inverse_eigenvalues: TaylorModel  # L⁻¹, (p, p), in s²


@dataclass(frozen=True, eq=False)
class ModeGroup:
    """A group of modes as functions of the inputs over the unit box, for m outputs.

    Args:
        modes: Their numbers from below, from 0, rising, shape (p,).
        is_whole: Whether `sums` are over these modes alone; else they are over more modes, and
            bound what these add.
        eigenvalue_block: Matrix that has the eigenvalues ω² of the modes, shape (p, p), in 1/s²; of
            modes that are not enclosed a range of them, shape (1, 1).
        ratios: Modal damping ratios that the structure states, shape (p,).
        rayleigh: Rayleigh's factors a in 1/s and b in s, shape (2,).
        sums: Sums over the modes of output and participation in the motion of the ground, with
            the factors of the outputs.
        subspace: That of several modes; None for others.
    """

    modes: Ints
    is_whole: bool
    eigenvalue_block: TaylorModel
    ratios: TaylorModel
    rayleigh: TaylorModel
    sums: ModalSums
    subspace: Subspace | None = None

    @property
    def has_gap(self) -> bool:
        """Whether the modes are not enclosed, or some keep apart from the others in the box."""
        low, high = eigenvalue_discs(self.eigenvalue_block)
        order = low.argsort()
        reached = np.maximum.accumulate(high[order])
        return not self.is_whole or bool((low[order][1:] > reached[:-1]).any())

    @property
    def period_range(self) -> Ends:
        """The shortest and the longest period in s that a mode of the group may have in the box.

        Raises:
            UnprovedError: An eigenvalue may be zero.
        """
        low, high = eigenvalue_discs(self.eigenvalue_block)
        if low.min() <= 0:
            raise UnprovedError("the structure may lose its stiffness", "take narrower inputs")
        return float(2 * np.pi / np.sqrt(high.max())), float(2 * np.pi / np.sqrt(low.min()))

    @property
    def ratio_range(self) -> Ends:
        """Ends of the damping ratios a/(2 ω) + b ω/2 + ζ of the modes of the group in the box."""
        shortest, longest = self.period_range
        return damping_range(
            self.rayleigh, self.ratios, (2 * np.pi / longest, 2 * np.pi / shortest)
        )


class ModeGroups(NamedTuple):
    """The lowest modes of a structure over its box, in groups by rising first mode."""

    groups: list[ModeGroup]
    # input whose bisection separates a pair of modes that hinder an enclosure; None if none do
    bisection_input: int | None


def mode_groups(structure: Assembly[TaylorModel], count: int | None) -> ModeGroups:
    """Return the lowest modes of a structure over its box, in groups.

    Args:
        structure: The structure over the box, whose outputs take displacements alone. Its damping
            plays no part.
        count: Number of modes; all if it is None or larger than their number.

    Raises:
        UnprovedError: The structure may lose mass or stiffness in the box.
    """
    centre, used = centred_matrices(structure.mass, structure.stiffness)
    count = min(count or centre.mode_count, centre.mode_count)
    found = enclose_subspaces(centre, used, count)
    patterns = structure.mass.like(structure.pattern @ np.linalg.inv(centre.basis).T)[None]
    output_rows = structure.rows
    if isinstance(output_rows, np.ndarray):
        output_rows = structure.mass.like(output_rows)
    rows = output_rows[:, : len(structure.pattern)] @ centre.basis

    groups = []
    enclosed = []
    remaining: Ints = np.arange(count)
    for block in found.blocks:
        if block.modes[-1] >= count:
            continue  # only some of its modes are wanted, whose own sums are not known
        participation = BlockParticipation.from_block(block, rows, patterns, used)
        sums = modal_sums_of_block(participation)
        enclosed.append(sums)
        group = _group(structure, used, block.modes, block.eigenvalue_block, sums)
        if len(block.modes) > 1:
            group = replace(group, subspace=_subspace(structure, used, participation))
        groups.append(group)
        remaining = np.setdiff1d(remaining, block.modes)
    if len(remaining):
        # What the enclosed groups leave of the sums over all modes.
        order = max((x.products.order for x in enclosed), default=structure.mass.order)
        others = sums_over_all_modes(found, rows, patterns, order)
        for sums in enclosed:
            others = ModalSums(*(x - y for x, y in zip(others, sums, strict=True)))
        low = found.eigenvalue_low[remaining].min()
        high = found.eigenvalue_high[remaining].max()
        radius = (high - low) / 2
        eigenvalues = centre.mass.like([[(low + high) / 2]]).widened([[radius]])
        rough = _group(structure, used, remaining, eigenvalues, others)
        groups.append(replace(rough, is_whole=False))
    groups.sort(key=lambda group: int(group.modes[0]))
    return ModeGroups(groups, found.bisection_input)


def _group(
    structure: Assembly[TaylorModel],
    used: Ints,
    modes: Ints,
    eigenvalue_block: TaylorModel,
    sums: ModalSums,
) -> ModeGroup:
    """Return a group of modes as functions of all inputs, with the factors of the outputs.

    Args:
        structure: The structure over the box, with m outputs.
        used: Indices of the inputs that mass and stiffness depend on, rising.
        modes: Numbers of the modes from below, shape (p,).
        eigenvalue_block: As in `ModeGroup`, as functions of the used inputs.
        sums: Sums over the modes for one source, the motion of the ground, without the factors, as
            functions of the used inputs or of all.
    """
    factors = structure.row_factors
    found = with_models(sums, lambda x: _of_all_inputs(x, structure, used))
    return ModeGroup(
        modes=modes,
        is_whole=True,
        eigenvalue_block=_of_all_inputs(eigenvalue_block, structure, used),
        ratios=modal_ratios(structure)[modes],
        rayleigh=stack(structure.rayleigh),
        sums=found._replace(
            products=found.products[0] * factors,
            products_over_eigenvalue=found.products_over_eigenvalue[0] * factors,
            output_squares=found.output_squares * factors * factors,
            output_squares_over_eigenvalue=found.output_squares_over_eigenvalue * factors * factors,
        ),
    )


def _subspace(
    structure: Assembly[TaylorModel], used: Ints, participation: BlockParticipation
) -> Subspace:
    """Return the subspace of a block of several modes as functions of all inputs.

    Args:
        structure: The structure over the box.
        used: Indices of the inputs that mass and stiffness depend on, rising.
        participation: How the block takes part in the motion of the ground.
    """
    block = participation.block.eigenvalue_block.T
    models = (
        participation.output_modes,
        participation.source_participation[:, 0],
        solve(block, block.like(np.eye(len(block.remainder)))),
    )
    found = Subspace(*(_of_all_inputs(x, structure, used) for x in models))
    return found._replace(output_modes=found.output_modes * structure.row_factors)


def _of_all_inputs(model: TaylorModel, structure: Assembly[TaylorModel], used: Ints) -> TaylorModel:
    """Return a model of the used inputs, or of all, as a function of all, of their degree."""
    return model.truncated(structure.mass.order).embedded(used, structure.mass.inputs)
