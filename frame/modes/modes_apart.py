"""Periods and participation of modes that keep apart from one another in the whole box."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.clusters import centred_matrices, enclose_subspaces
from alphacut.frame.modes.intervening import BlockParticipation, source_patterns
from alphacut.frame.modes.models import inverse_with_rounding
from alphacut.frame.modes.structure import ClassicalStructure


class ModeApart(NamedTuple):
    """A mode as functions of the inputs over the unit box, for m outputs."""

    period: TaylorModel  # natural period, a scalar, in s
    ratio: TaylorModel  # damping ratio, a scalar
    factors: TaylorModel  # participation factor in the ground motion times output, (m,)


def modes_apart(structure: ClassicalStructure, count: int | None) -> list[ModeApart]:
    """Return the lowest modes of a structure over its box, by falling period.

    Args:
        structure: The structure over the box.
        count: Number of modes; all if it is None or larger than their number.

    Raises:
        UnprovedError: Two of the modes, or one of them and a higher one, are not known to keep
            apart in the box.
    """
    centre, used = centred_matrices(structure.mass, structure.stiffness)
    count = min(count or centre.mode_count, centre.mode_count)
    found = enclose_subspaces(centre, used, count)
    blocks = {int(block.modes[0]): block for block in found.blocks if len(block.modes) == 1}
    if not set(range(count)) <= set(blocks):
        cure = "take narrower inputs, or fewer modes"
        raise UnprovedError("modes may come near one another", cure, found.bisection_input)
    to_centred = inverse_with_rounding(centre.basis, like=structure.initial_state)
    patterns = source_patterns(structure, ["load"]) @ to_centred.T
    rows = structure.initial_state.like(structure.output_rows) @ centre.basis
    inputs = structure.initial_state.inputs
    order = structure.initial_state.order
    modes = []
    for k in range(count):
        participation = BlockParticipation.from_block(blocks[k], rows, patterns, used)
        factors = participation.participation.truncated(order).embedded(used, inputs)
        eigenvalue = blocks[k].eigenvalue_block.truncated(order).embedded(used, inputs)
        period = eigenvalue[0, 0] ** -0.5 * (2 * np.pi)
        # a/(2 ω) + b ω/2 + ζ with Rayleigh's factors a and b
        by_mass = structure.rayleigh[0] * period / (4 * np.pi)
        by_stiffness = structure.rayleigh[1] * period**-1.0 * np.pi
        mode = ModeApart(
            period=period.with_rounding(2),
            ratio=structure.damping_ratios[k] + by_mass + by_stiffness,
            factors=factors[0, 0] * structure.output_factors,
        )
        modes.append(mode)
    return modes


def ranges(models: list[TaylorModel]) -> tuple[Array, Array]:
    """Return lower and upper bounds over the box of scalar Taylor models, shape (models,) each."""
    return TaylorModel.stack(models).bounds()
