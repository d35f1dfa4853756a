"""Guaranteed bounds over a box of the combined peaks of the response-spectrum method.

Let a mode k of a group have the output a_k, the participation factor β_k and the spectral
displacement S_k = S(λ_k), so that its peak is r_k = a_k β_k S_k. The sums s = Σ a_k β_k S_k,
A = Σ a_k² S_k and B = Σ β_k² S_k over the group do not depend on how its modes turn in their common
subspace. With w² = A B, Cauchy and Schwarz give Σ |r_k| ≤ w. What follows for the combined peak is
in `close_modes`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.bounds.box import parameters_over_box
from alphacut.frame.bounds.box_proof import ROUNDING_MARGIN
from alphacut.frame.bounds.close_modes import Moments, Squares, by_fit, by_signs, moments_of
from alphacut.frame.calculus.taylor_model import TaylorModel, concatenate
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.mode_groups import ModeGroup, mode_groups
from alphacut.frame.modes.model_fields import on_subbox
from alphacut.frame.modes.structure import with_classical_damping
from alphacut.frame.spectra.displacement_chord import displacement_chord, max_acceleration
from alphacut.frame.spectra.modal_combination import (
    Combination,
    QuadraticFit,
    correlation_range,
    decorrelation_fit,
)
from alphacut.frame.structures.linear import LinearSystem

GAP = 0.01
"""Fraction of a bound within which an attained value suffices (tuned)."""
MAX_SPLITS = 60
"""Largest number of bisections of boxes (tuned)."""
MAX_ENCLOSURES = 16
"""Largest number of boxes in which the modes are enclosed anew (tuned)."""
MAX_DEPTH = 4
"""Largest number of bisections in a row of a box over which nothing is known of the modes."""


class _Peaks(NamedTuple):
    """Peaks of a group of modes, for m outputs."""

    sum: TaylorModel  # s, (m,)
    sum_of_magnitudes: Array  # upper bound of w over the box, (m,)
    squared_magnitudes: TaylorModel  # w², (m,)
    moments: Moments | None = None  # of several modes


class _Correlations(NamedTuple):
    """Range of the correlation coefficients of modes of two groups, (groups, groups) each.

    On the diagonal it is that of different modes of one group. Below it there is nothing of use.
    """

    smallest: Array
    largest: Array


def _cross_terms(
    groups: Sequence[ModeGroup], peaks: Sequence[_Peaks], correlations: _Correlations
) -> TaylorModel:
    """Return 2 Σ ρ_ij r_i r_j over modes i and j of different groups, for m outputs, shape (m,).

    Args:
        groups: The groups, two or more.
        peaks: The peaks of each.
        correlations: Ranges of ρ of each pair of groups.
    """
    first, second = np.triu_indices(len(groups), 1)
    low = correlations.smallest[first, second]
    high = correlations.largest[first, second]
    # Of a group that is not whole no sum is known, and 0 stands for it.
    is_whole = np.array([group.is_whole for group in groups])
    are_whole = is_whole[first] & is_whole[second]
    radius = np.where(are_whole, high - low, 2 * high)
    largest = np.array([peak.sum_of_magnitudes for peak in peaks])
    error = radius @ (largest[first] * largest[second])
    sums = concatenate([peak.sum[None] for peak in peaks], -2)
    return ((low + high) @ (sums[first] * sums[second])).widened(error)


@dataclass(frozen=True, eq=False)
class _Problem:
    """A structure, the names of its inputs, and what is combined."""

    system: LinearSystem
    names: Sequence[str]
    combination: Combination

    def squares(self, groups: Sequence[ModeGroup]) -> Squares:
        """Return bounds of the squares of the combined peaks as Taylor models, shape (m,).

        Raises:
            UnprovedError: A period may lie outside the range of the spectrum, or a damping ratio
                may be zero with CQC.
        """
        periods = np.array([group.period_range for group in groups])
        first, last = self.combination.spectrum.periods[[0, -1]]
        if periods.min() < first * (1 - 1e-9) or periods.max() > last * (1 + 1e-9):
            raise UnprovedError("a period may lie outside the spectrum", "give a longer spectrum")
        correlations = self._correlations(groups, periods)
        periods = np.clip(periods, first, last)
        peaks = [self._peaks(x, ends) for x, ends in zip(groups, periods, strict=True)]
        lower = upper = peaks[0].sum * 0.0
        for j, group in enumerate(groups):
            smallest = float(correlations.smallest[j, j])
            of_group = self._squares_of_group(group, peaks[j], periods[j], smallest)
            lower = lower + of_group.lower
            upper = upper + of_group.upper
        if self.combination.rule == "CQC" and len(groups) > 1:
            cross_terms = _cross_terms(groups, peaks, correlations)
            lower = lower + cross_terms
            upper = upper + cross_terms
        return Squares(lower, upper)

    def _squares_of_group(
        self, group: ModeGroup, peaks: _Peaks, periods: Array, smallest: float
    ) -> Squares:
        """Return bounds of the squared combined peaks of the modes of one group alone.

        Args:
            group: The group.
            peaks: Its peaks.
            periods: Its shortest and longest period, shape (2,).
            smallest: Smallest correlation coefficient of two of its modes.
        """
        total = peaks.sum
        magnitudes = peaks.squared_magnitudes
        if not group.is_whole:
            # Correlation matrices are not indefinite, and their entries are at most 1.
            return Squares(total * 0.0, magnitudes)
        if peaks.moments is None:
            square = total * total
            return Squares(square, square)
        p = len(group.modes)
        found = by_signs(total, magnitudes, modes=p, d=1 - smallest)
        if self.combination.rule == "CQC":
            fit = self._fit(group, periods)
            fitted = by_fit(total, peaks.moments, magnitudes, modes=p, fit=fit)
            if np.mean(fitted.width / np.maximum(found.width, 1e-300)) < 1:
                return fitted
        return found

    def _correlations(self, groups: Sequence[ModeGroup], periods: Array) -> _Correlations:
        """Return ranges of the correlation coefficients; those of SRSS are 0.

        Args:
            groups: The groups, by rising first mode.
            periods: Shortest and longest period of each, shape (groups, 2).

        Raises:
            UnprovedError: A damping ratio may be zero.
        """
        count = len(groups)
        if self.combination.rule == "SRSS":
            return _Correlations(np.zeros((count, count)), np.zeros((count, count)))
        equal: Array = np.full(count, self.combination.spectrum.damping)
        damping = (equal, equal)
        if self.combination.own_ratios:
            low, high = np.transpose([group.ratio_range for group in groups])
            damping = (low, high)
            if low.min() <= 0:
                raise UnprovedError("a damping ratio may be zero", "combine by SRSS")
        smallest, largest = correlation_range((periods[:, 0], periods[:, 1]), damping)
        # The range is that of groups of which one has the longer periods.
        last = np.array([group.modes[-1] for group in groups])
        following = np.array([group.modes[0] for group in groups])
        is_ordered = (last[:, np.newaxis] < following) | np.eye(count, dtype=bool)
        return _Correlations(
            np.where(is_ordered, smallest, 0.0), np.where(is_ordered, largest, 1.0)
        )

    def _peaks(self, group: ModeGroup, periods: Array) -> _Peaks:
        """Return the peaks of a group.

        Args:
            group: The group.
            periods: Its shortest and longest period, within the range of the spectrum, shape (2,).
        """
        sums = group.sums
        shortest = float(periods[0])
        longest = float(periods[1])
        if not group.is_whole:
            # S(λ) is at most the largest acceleration over λ.
            acceleration = max_acceleration(self.combination.spectrum, shortest, longest)
            of_outputs = np.maximum(sums.output_squares_over_eigenvalue.bounds()[1], 0.0)
            of_ground = np.maximum(sums.source_squares_over_eigenvalue.bounds()[1], 0.0)
            squared = acceleration**2 * of_outputs * of_ground
            magnitudes = sums.products.like(squared)
            return _Peaks(sums.products * 0.0, np.sqrt(squared), magnitudes)
        # S(λ) = constant + slope/λ ± error
        chord = displacement_chord(self.combination.spectrum, shortest, longest)
        slope = 4 * np.pi**2 * chord.slope
        constant = chord.value - chord.slope * chord.midpoint
        error = chord.error

        def weighted(plain: TaylorModel, over_eigenvalue: TaylorModel) -> TaylorModel:
            """Return a sum with the weight S of the modes, but for the error of S."""
            return plain * constant + over_eigenvalue * slope

        outputs = weighted(sums.output_squares, sums.output_squares_over_eigenvalue)
        outputs = outputs.widened(error * sums.output_squares.magnitude())
        ground = weighted(sums.source_squares, sums.source_squares_over_eigenvalue)
        ground = ground.widened(error * sums.source_squares.magnitude())
        unweighted = np.sqrt(sums.output_squares.magnitude() * sums.source_squares.magnitude())
        squared_magnitudes = outputs * ground
        largest = np.maximum(squared_magnitudes.bounds()[1], 0.0)
        total = weighted(sums.products, sums.products_over_eigenvalue)
        moments = None
        if group.subspace is not None:
            radius = abs(chord.slope) * (longest**2 - shortest**2) / 2 + error
            moments = moments_of(
                group.subspace,
                chord.midpoint,
                (chord.value - radius, chord.value + radius),
                magnitude=unweighted,
                largest=longest**2 / chord.midpoint - 1,
            )
        return _Peaks(
            sum=total.widened(error * unweighted),
            sum_of_magnitudes=np.sqrt(largest),
            squared_magnitudes=squared_magnitudes,
            moments=moments,
        )

    def _fit(self, group: ModeGroup, periods: Array) -> QuadraticFit:
        """Return 1 − ρ of modes of a group as a quadratic function of their periods' squares."""
        shortest = float(periods[0])
        longest = float(periods[1])
        ratios = (self.combination.spectrum.damping, self.combination.spectrum.damping)
        if self.combination.own_ratios:
            ratios = group.ratio_range
        midpoint = (shortest**2 + longest**2) / 2
        return decorrelation_fit((shortest, longest), ratios, midpoint)

    def parts(self, low: Array, high: Array, depth: int) -> Iterator[_Part]:
        """Yield parts of a box, each with its modes.

        Args:
            low: Lower ends of the inputs, shape (d,).
            high: Upper ends, shape (d,).
            depth: How many bisections in a row are tried.

        Raises:
            UnprovedError: See `combined_bounds`.
        """
        try:
            parameters = parameters_over_box(self.system, self.names, low, high)
            structure = self.system.assembly(parameters)
            if self.combination.rule == "CQC" and self.combination.own_ratios:
                structure = with_classical_damping(structure)
            groups, along = mode_groups(structure, self.combination.modes)
            yield _Part(low, high, groups, self.squares(groups), along, is_enclosed=True)
            return
        except UnprovedError as error:
            if not depth:
                raise
            along = error.along
        active = np.flatnonzero(high > low)
        axis = depth % len(active) if along is None else along
        for half_low, half_high in _halves(low, high, int(active[axis])):
            yield from self.parts(half_low, half_high, depth - 1)


@dataclass(frozen=True, eq=False)
class _Part:
    """A sub-box: its modes, and the squares of the combined peaks of m outputs over it.

    Args:
        low: Lower ends of the inputs in SI units, shape (d,).
        high: Upper ends, shape (d,).
        groups: The modes.
        squares: Bounds of the squares.
        bisection_input: That of `ModeGroups`.
        is_enclosed: Whether the modes were enclosed over this box, and not over a wider one.
    """

    low: Array
    high: Array
    groups: list[ModeGroup]
    squares: Squares
    bisection_input: int | None = None
    is_enclosed: bool = False

    @property
    def may_gain(self) -> bool:
        """Whether modes of a group are likely to keep apart if they are enclosed anew."""
        return not self.is_enclosed and any(group.has_gap for group in self.groups)

    @property
    def is_narrow(self) -> bool:
        """Whether the sub-box is too narrow to be bisected."""
        return bool((self.high - self.low <= 1e-9 * np.abs(self.high)).all())

    def halves(self, problem: _Problem, output: int) -> list[_Part]:
        """Bisect the sub-box along the input that changes an output or the modes most."""
        axis = self._bisected_input(output)
        active = np.flatnonzero(self.high > self.low)
        ends = _halves(self.low, self.high, int(active[axis]))
        unit = np.ones(len(active))
        halves = []
        for half, (low, high) in zip(ends, _halves(-unit, unit, axis), strict=True):
            groups = on_subbox(self.groups, low, high)
            halves.append(_Part(*half, groups, problem.squares(groups)))
        return halves

    def _bisected_input(self, output: int) -> int:
        """Return the active input whose bisection promises most."""
        if self.bisection_input is not None:
            return self.bisection_input
        upper = self.squares.upper
        change = np.abs(upper.homogeneous_part(1)[:, output])
        change = change / max(float(upper.magnitude()[output]), 1e-300)
        for group in self.groups:
            diagonal = np.diagonal(group.eigenvalue_block.homogeneous_part(1), axis1=1, axis2=2)
            change = change + np.ptp(diagonal, axis=1) / group.eigenvalue_block.value[0, 0]
        return int(change.argmax())


def combined_bounds(
    system: LinearSystem,
    names: Sequence[str],
    ends: tuple[Array, Array],
    combination: Combination,
    attained: Array,
) -> Array:
    """Return guaranteed bounds of the combined peaks over a box, shape (outputs, 2).

    The modes are enclosed over the box as polynomials of the inputs with guaranteed remainders:
    each for itself, or those that come near one another as a group. The spectrum over the periods
    of a group is a line with a bound of its distance. So are bounds of the square of each combined
    peak polynomials with a remainder. The part of the box with the farthest bound is bisected until
    the bounds lie within 1 % of attained values, or for 60 times. Modes of a group that keep apart
    in such a part are enclosed anew.

    Args:
        system: The structure, whose outputs are of displacements.
        names: Names of its inputs, d of them.
        ends: Lower and upper ends of the inputs, shape (d,) each.
        combination: What is combined.
        attained: Smallest and largest attained combined peak of each output, shape (outputs, 2).

    Raises:
        UnprovedError: The structure may lose its stiffness in some part of the box, may have a
            period outside the range of the spectrum, or is to have damping ratios of its own where
            damping couples its modes.
    """
    low, high = ends
    if (low == high).all():
        # A box needs a width. A slightly wider one contains it.
        high = np.maximum(np.nextafter(low, np.inf), low + 1e-12 * np.abs(low))
    problem = _Problem(system, names, combination)
    parts = list(problem.parts(low, high, MAX_DEPTH))
    enclosures = 0
    for _ in range(MAX_SPLITS):
        bounds = _bounds(parts)  # (parts, outputs, 2)
        # Attained values within the bounds; all signs are such that larger values lie farther out.
        sign = np.array([-1.0, 1.0])
        excess = (sign * (bounds - attained)).max(axis=0)
        relative = excess / np.maximum(bounds[..., 1].max(axis=0), 1e-300)[:, np.newaxis]
        output, side = np.unravel_index(int(relative.argmax()), relative.shape)
        farthest = int((sign[side] * bounds[:, output, side]).argmax())
        part = parts[farthest]
        if relative[output, side] < GAP or part.is_narrow:
            break
        smaller: list[_Part] = []
        if part.may_gain and enclosures < MAX_ENCLOSURES:
            enclosures += 1
            with suppress(UnprovedError):  # then the enclosure over the wider box is bisected
                smaller = list(problem.parts(part.low, part.high, MAX_DEPTH))
        parts[farthest : farthest + 1] = smaller or part.halves(problem, int(output))
    bounds = _bounds(parts)
    return np.stack([bounds[..., 0].min(axis=0), bounds[..., 1].max(axis=0)], axis=-1)


def _bounds(parts: Sequence[_Part]) -> Array:
    """Return bounds of the combined peaks over each part, shape (parts, outputs, 2)."""
    squares = np.array(
        [
            np.stack([part.squares.lower.bounds()[0], part.squares.upper.bounds()[1]], axis=-1)
            for part in parts
        ]
    )
    # The margin covers all rounding, as that of peaks over time does.
    margin = ROUNDING_MARGIN * np.array([-1.0, 1.0]) * np.abs(squares[..., 1:])
    return np.asarray(np.sqrt(np.maximum(squares + margin, 0.0)))


def _halves(low: Array, high: Array, axis: int) -> Iterator[tuple[Array, Array]]:
    """Yield the ends, shape (d,) each, of both halves of a box bisected along an axis."""
    middle = (low[axis] + high[axis]) / 2
    below = high.copy()
    above = low.copy()
    below[axis] = above[axis] = middle
    yield low, below
    yield above, high
