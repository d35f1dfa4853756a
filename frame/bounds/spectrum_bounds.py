"""Guaranteed bounds over a box of the combined peaks of the response-spectrum method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.bounds.box import over_box
from alphacut.frame.calculus.taylor_model import TaylorModel, all_on_subbox
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.modes_apart import ModeApart, modes_apart, ranges
from alphacut.frame.spectra.displacement_chord import displacement_chord
from alphacut.frame.spectra.modal_combination import correlation_range
from alphacut.frame.spectra.target import TargetSpectrum
from alphacut.frame.structures.linear import LinearSystem

GAP = 0.01
"""Fraction of a bound within which an attained value suffices (tuned)."""
MAX_SPLITS = 60
"""Largest number of bisections of boxes over which modes are known (tuned)."""
MAX_DEPTH = 4
"""Largest number of bisections in a row of a box in which modes are not known to keep apart."""


@dataclass(frozen=True)
class Combination:
    """What is combined: the spectrum, the rule, and the number of modes.

    Args:
        spectrum: Pseudo-acceleration over the period.
        rule: "SRSS" or "CQC".
        modes: Number of the lowest modes that are combined; None for all.
        own_ratios: Whether CQC takes the damping ratio of each mode; else that of the spectrum.
    """

    spectrum: TargetSpectrum
    rule: str
    modes: int | None
    own_ratios: bool

    def squares(self, modes: Sequence[ModeApart]) -> TaylorModel:
        """Return the squares of the combined peaks of m outputs as Taylor models, shape (m,).

        Raises:
            UnprovedError: A period may lie outside the range of the spectrum, or a damping ratio
                may be zero with CQC.
        """
        periods = ranges([mode.period for mode in modes])
        first, last = self.spectrum.periods[[0, -1]]
        if periods[0].min() < first * (1 - 1e-9) or periods[1].max() > last * (1 + 1e-9):
            raise UnprovedError("a period may lie outside the spectrum", "give a longer spectrum")
        peaks = []
        for mode, low, high in zip(modes, *np.clip(periods, first, last), strict=True):
            chord = displacement_chord(self.spectrum, float(low), float(high))
            displacement = chord.value + chord.slope * (mode.period - chord.midpoint)
            peaks.append(mode.factors * displacement.widened(chord.error))
        total = peaks[0] * peaks[0]
        for peak in peaks[1:]:
            total = total + peak * peak
        if self.rule == "SRSS":
            return total

        equal: Array = np.full(len(modes), self.spectrum.damping)
        damping = (equal, equal)
        if self.own_ratios:
            damping = ranges([mode.ratio for mode in modes])
            if damping[0].min() <= 0:
                raise UnprovedError("a damping ratio may be zero", "combine by SRSS")
        smallest, largest = correlation_range(periods, damping)
        for i, j in zip(*np.triu_indices(len(modes), 1), strict=True):
            product = peaks[i] * peaks[j]
            middle = smallest[i, j] + largest[i, j]
            # The factor covers the rounding of sum and difference.
            radius = (largest[i, j] - smallest[i, j]) * (1 + 1e-12) + 1e-15
            total = total + (product * middle).widened(radius * product.magnitude())
        return total


@dataclass(frozen=True, eq=False)
class _Part:
    """A sub-box: its modes, and the squares of the combined peaks of m outputs over it."""

    modes: Sequence[ModeApart]
    squares: TaylorModel

    def halves(self, combination: Combination, output: int) -> list[_Part]:
        """Bisect the sub-box along the input that changes an output most."""
        slopes = np.abs(self.squares.homogeneous_part(1)[:, output])
        axis = int(slopes.argmax())
        models = [model for mode in self.modes for model in mode]
        halves = []
        for low_end, high_end in ((-1.0, 0.0), (0.0, 1.0)):
            low = np.full(len(slopes), -1.0)
            high = np.full(len(slopes), 1.0)
            low[axis] = low_end
            high[axis] = high_end
            moved = iter(all_on_subbox(models, low, high))
            modes = [ModeApart(*three) for three in zip(moved, moved, moved, strict=True)]
            halves.append(_Part(modes, combination.squares(modes)))
        return halves


def combined_bounds(
    system: LinearSystem,
    names: Sequence[str],
    ends: tuple[Array, Array],
    combination: Combination,
    attained: Array,
) -> Array:
    """Return guaranteed bounds of the combined peaks over a box, shape (outputs, 2).

    Each of the modes is enclosed over the box, or over parts of it, as polynomials of the inputs
    with guaranteed remainders: participation times output, and the period. The spectrum over the
    range of the period is a line with a bound of its distance. So is the square of each combined
    peak a polynomial with a remainder. The part with the farthest bound is bisected until the
    bounds lie within 1 % of attained values, or for 60 times.

    Args:
        system: The structure, whose outputs are of displacements.
        names: Names of its inputs, d of them.
        ends: Lower and upper ends of the inputs, shape (d,) each.
        combination: What is combined.
        attained: Smallest and largest attained combined peak of each output, shape (outputs, 2).

    Raises:
        UnprovedError: Modes are not known to keep apart in some part of the box, the structure has
            no classical modes, or a period may lie outside the range of the spectrum.
    """
    low, high = ends
    if (low == high).all():
        # A box needs a width. A slightly wider one contains it.
        high = np.maximum(np.nextafter(low, np.inf), low + 1e-12 * np.abs(low))
    parts = _parts(system, names, (low, high), combination, MAX_DEPTH)
    for _ in range(MAX_SPLITS):
        bounds = _bounds(parts)  # (parts, outputs, 2)
        # Attained values within the bounds; all signs are such that larger values lie farther out.
        sign = np.array([-1.0, 1.0])
        excess = (sign * (bounds - attained)).max(axis=0)
        relative = excess / np.maximum(bounds[..., 1].max(axis=0), 1e-300)[:, np.newaxis]
        output, side = np.unravel_index(int(relative.argmax()), relative.shape)
        if relative[output, side] < GAP:
            break
        farthest = int((sign[side] * bounds[:, output, side]).argmax())
        parts += parts.pop(farthest).halves(combination, int(output))
    bounds = _bounds(parts)
    return np.stack([bounds[..., 0].min(axis=0), bounds[..., 1].max(axis=0)], axis=-1)


def _bounds(parts: Sequence[_Part]) -> Array:
    """Return bounds of the combined peaks over each part, shape (parts, outputs, 2)."""
    squares = np.array([np.stack(part.squares.bounds(), axis=-1) for part in parts])
    # The factors cover the rounding of the root.
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)) * [1 - 1e-15, 1 + 1e-15])


def _parts(
    system: LinearSystem,
    names: Sequence[str],
    ends: tuple[Array, Array],
    combination: Combination,
    depth: int,
) -> list[_Part]:
    """Return the parts of a box in each of which the modes are known to keep apart.

    Args:
        system: The structure.
        names: Names of its inputs.
        ends: Lower and upper ends of the inputs, shape (d,) each.
        combination: What is combined.
        depth: How many bisections in a row are tried.

    Raises:
        UnprovedError: See `combined_bounds`.
    """
    low, high = ends
    try:
        modes = modes_apart(over_box(system, names, low, high), combination.modes)
        return [_Part(modes, combination.squares(modes))]
    except UnprovedError as error:
        if not depth:
            raise
        along = error.along
    active = np.flatnonzero(high > low)
    axis = active[depth % len(active) if along is None else along]
    middle = (low[axis] + high[axis]) / 2
    below, above = high.copy(), low.copy()
    below[axis] = above[axis] = middle
    first = _parts(system, names, (low, below), combination, depth - 1)
    return first + _parts(system, names, (above, high), combination, depth - 1)
