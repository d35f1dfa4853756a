"""The boxes of the uncertain parameters, and responses as functions over the unit box."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Ints, Mask
from alphacut.base.errors import require_numbers
from alphacut.base.progress_bar import Progress, nth_subprogress
from alphacut.frame.calculus.polynomials import Array, Jet
from alphacut.frame.dynamics.flow import Flow
from alphacut.frame.result import Envelope
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy import FuzzyNumber, Interval
from alphacut.fuzzy.knowledge.joint import joined_inputs
from alphacut.fuzzy.sets.boxes import corners
from alphacut.fuzzy.sets.numbers import checked_levels

ALPHA = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Levels α by default, those of the paper."""
DEFAULT_TOLERANCE = 1e-3
"""Error that is wanted by default, as a fraction of the peak of each output (conventional)."""
MAX_PARAMETERS = 6
"""Most inputs of a branch and bound: tensors of third derivatives grow with the cube of their
number."""
AT_REST = 1e-9
"""Peak of an output, as a fraction of what the energy of the response permits, up to which the
output is taken to be moved by rounding alone. Rounding is some units ε (ω_max/ω₁)² of this peak."""


@dataclass(frozen=True, eq=False)
class Boxes:
    """Nested boxes of parameters, one on each level.

    The unit coordinate u of a parameter runs over [-1, 1] on its widest cut: it is (p - midpoint) /
    radius.

    Args:
        names: Names of the parameters.
        alpha: Levels, rising, shape (levels,).
        lower: Lower ends, shape (levels, parameters), in SI units.
        upper: Upper ends, same shape.
        nominal: Values of membership 1, shape (parameters,).
        numbers: The fuzzy numbers whose cuts the boxes are, by name; empty if there are none.
    """

    names: tuple[str, ...]
    alpha: Array
    lower: Array
    upper: Array
    nominal: Array
    numbers: Mapping[str, FuzzyNumber] = field(default_factory=dict)

    @property
    def inputs(self) -> Mapping[str, FuzzyNumber]:
        """Fuzzy numbers by name; the widest cuts as intervals if there are none."""
        ends = zip(self.names, self.lower[0].tolist(), self.upper[0].tolist(), strict=True)
        return self.numbers or {name: Interval(low, high) for name, low, high in ends}

    def bisect(self, axis: int) -> list[tuple[Boxes, Ints]]:
        """Cut all boxes at one value of a parameter, and return both sides.

        The value is the midpoint of the parameter's range in the widest box, or the geometric mean
        of the ends if both are positive and their ratio is above 1.5. A box that only touches this
        value also gives a box without width to the other side. A box that lies on one side alone
        gives nothing to the other side. Nominal values outside a side are moved to its nearest end.

        Args:
            axis: Index of the parameter in `names`.

        Returns:
            Two pairs, first of the smaller and then of the larger values: the boxes, and the rows
            of these boxes in `alpha`, rising. The sides know no fuzzy numbers any more.
        """
        low = self.lower[0, axis]
        high = self.upper[0, axis]
        middle = (low + high) / 2
        # Frequencies are powers of stiffnesses and masses, so that the geometric mean divides their
        # ranges better. Below a ratio of 1.5 it is within 2 % of the midpoint (tuned).
        if low > 0 and high > 1.5 * low:
            middle = np.sqrt(low * high)
        halves = []
        for end_below, end_above in ((-np.inf, middle), (middle, np.inf)):
            intersects = (self.lower[:, axis] <= end_above) & (self.upper[:, axis] >= end_below)
            levels = np.flatnonzero(intersects)
            # The half-space of this side; infinite ends leave the other parameters as they are.
            lower = np.full(len(self.names), -np.inf)
            upper = np.full(len(self.names), np.inf)
            lower[axis] = end_below
            upper[axis] = end_above
            halves.append((self.on_levels(levels).intersect(lower, upper), levels))
        return halves

    def on_levels(self, levels: Ints | Sequence[int]) -> Boxes:
        """Return the boxes on the levels with given rows in `alpha`."""
        rows = np.asarray(levels)
        return replace(self, alpha=self.alpha[rows], lower=self.lower[rows], upper=self.upper[rows])

    def intersect(self, low: Array, high: Array) -> Boxes:
        """Return the intersection of each box with another box.

        Each box must meet the other one, which is not checked. The nominal values are moved into
        the other box, too, and the fuzzy numbers are left out.

        Args:
            low: Lower ends of the other box, shape (parameters,), in SI units; -∞ for none.
            high: Upper ends; +∞ for none.
        """
        return Boxes(
            self.names,
            self.alpha,
            lower=np.clip(self.lower, low, high),
            upper=np.clip(self.upper, low, high),
            nominal=np.clip(self.nominal, low, high),
        )

    def without_repetitions(self) -> tuple[Boxes, Ints]:
        """Return the boxes without those that are equal to the box on the next lower level.

        The cuts of intervals, for example, are the same on all levels, so that one box remains.

        Returns:
            The different boxes, and for each row of `alpha` the row of its box among the different
            ones, shape (levels,).
        """
        ends = np.concatenate([self.lower, self.upper], axis=1)
        # The lowest level is always new.
        is_new = np.append(True, (np.diff(ends, axis=0) != 0).any(axis=1))
        return self.on_levels(np.flatnonzero(is_new)), np.cumsum(is_new) - 1

    def inside_out(self, progress: Progress | None) -> Iterator[tuple[int, Progress]]:
        """Yield the rows of the boxes from the narrowest (the last) to the widest (row 0).

        In this order what is attained in a box can be taken over by the next one, which contains
        it. With each row comes a function that reports the progress of its computation, a number
        from 0 to 1, as the row's equal part of the whole to `progress`; None reports nothing.
        """
        count = len(self.alpha)
        for done in range(count):
            yield count - 1 - done, nth_subprogress(progress, done, count)

    @property
    def probes(self) -> Array:
        """The nominal point and at most 16 corners of the widest box, in SI units.

        The shape is (points, parameters), without repeated points and sorted by the coordinates.
        Up to four parameters have all their corners. With more there are the corner of all lower
        ends, that of all upper ends and 14 random ones, the same in every call.
        """
        d = len(self.names)
        # Probes only scale tolerances and look for inadmissible values, where some responses tell
        # enough; all 2^d corners would cost more than many an analysis.
        max_corners = 16
        if 2**d <= max_corners:
            ends = corners(-np.ones(d), np.ones(d))
        else:
            # The seed is fixed, so that repeated runs have equal bits.
            random = np.random.default_rng(7).choice([-1.0, 1.0], (max_corners - 2, d))
            ends = np.vstack([-np.ones(d), np.ones(d), random])
        return np.asarray(np.unique(np.vstack([self.nominal, self.to_physical(ends)]), axis=0))

    @property
    def centre(self) -> Array:
        """Midpoint of the widest box, shape (parameters,), in SI units."""
        return np.asarray((self.lower[0] + self.upper[0]) / 2)

    @property
    def radius(self) -> Array:
        """Radii of the widest box, shape (parameters,), in SI units."""
        return np.asarray((self.upper[0] - self.lower[0]) / 2)

    def to_unit(self, points: Array) -> Array:
        """Return the unit coordinates of points in SI units, shape (…, parameters).

        The unit coordinate of a parameter without width is 0.
        """
        # A radius of zero is replaced by 1, which gives 0 / 1 for the only point.
        return np.asarray((points - self.centre) / np.where(self.radius > 0, self.radius, 1.0))

    def to_physical(self, unit: Array) -> Array:
        """Return the points in SI units for unit coordinates, shape (…, parameters).

        They never lie outside the widest box.
        """
        # Rounding of the sum must not leave the support, which may end at a limit of the parameter.
        return np.asarray(np.clip(self.centre + self.radius * unit, self.lower[0], self.upper[0]))

    def unit_ends(self, level: int) -> tuple[Array, Array]:
        """Return the ends of the box in a row of `alpha` in the unit coordinates of the widest box.

        The lower and the upper ends have the shape (parameters,) each.
        """
        return self.to_unit(self.lower[level]), self.to_unit(self.upper[level])


def boxes(inputs: Mapping[str, FuzzyNumber | float], alpha: Sequence[float] = ALPHA) -> Boxes:
    """Return the α-cuts of fuzzy inputs as nested boxes.

    Inputs that carry claims of coverage are joined first, unless they have been: their cuts are
    widened until all claims hold at once with the probability 1 - α.

    Args:
        inputs: Fuzzy numbers by name, in SI units; a plain number is a crisp one.
        alpha: Levels, rising within [0, 1]; at least one.

    Returns:
        Boxes whose rows are the levels and whose columns are the inputs in the given order.

    Raises:
        RefusedError: There is no input, an input is no number, the levels do not rise within
            [0, 1], or claims of different kinds cannot be joined.
    """
    require_numbers("alpha", alpha)
    levels = np.array(checked_levels(alpha))
    numbers = joined_inputs(inputs)
    cuts = np.array([[number.cut(a) for number in numbers.values()] for a in levels], float)
    nominal = np.array([number.nominal for number in numbers.values()])
    return Boxes(tuple(numbers), levels, cuts[..., 0], cuts[..., 1], nominal, numbers)


class OutputSizes(NamedTuple):
    """Sizes of the outputs.

    Args:
        peak: Peak of each output, shape (outputs,); for an output at rest what the energy permits.
        at_rest: Whether rounding alone moves the output, shape (outputs,).
    """

    peak: Array
    at_rest: Mask


@dataclass(frozen=True, eq=False)
class UnitFlow:
    """Response of a structure as a function of the unit coordinates of its fuzzy parameters.

    Args:
        flow: The response as a function of parameters in SI units.
        boxes: The boxes; the names of their parameters must be those of `flow`.
        relative: Whether tolerances are fractions of the peak of each output instead of lengths.
    """

    flow: Flow
    boxes: Boxes
    relative: bool = True

    @property
    def time(self) -> Array:
        """Time nodes, shape (times,), in s."""
        return self.flow.time

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.flow.outputs

    @property
    def units(self) -> tuple[str, ...]:
        """SI unit of each output; empty if it is not known."""
        return tuple(Output(name).unit.removeprefix("SI") for name in self.outputs)

    def tolerance(self, value: float | None) -> float:
        """Return a tolerance, or the default one if it is None or 0.

        If `relative`, a tolerance is a fraction of the peak of each output, by default 1e-3. If
        not, it is in the SI unit of the first displacement (of the first output if there is none),
        by default 1e-3 of the peak of this output.
        """
        if value:
            return value
        unit = 1.0 if self.relative else float(self.peak[self.reference])
        return DEFAULT_TOLERANCE * unit

    @property
    def reference(self) -> int:
        """Index of the output in whose unit tolerances are: the first displacement, else 0."""
        return self.units.index("m") if "m" in self.units else 0

    @cached_property
    def _sizes(self) -> OutputSizes:
        """Peak of each output over the nominal point and some corners, and which are at rest.

        An output is at rest if its peak is at most 1e-9 of the amplitude that the energy of the
        nominal response permits. This amplitude is then given in place of its peak. If it is not
        known, the output is at rest only if it is zero, and gets the largest peak of all outputs,
        or 1 if all are zero.

        Raises:
            RefusedError: A response does not exist or is not finite.
            StepError: A time step of a response did not converge.
        """
        # The peak is needed for scales and tolerances only; a few responses tell it well enough.
        responses = self.flow.values(self.boxes.probes)  # (points, times, outputs)
        peak = np.abs(responses).max(axis=(0, 1))
        permitted_amplitude = self.flow.reach()  # (outputs,); 0 where it is not known
        # Rounding of the solution is some units ε (ω_max/ω₁)² of the permitted amplitude, with the
        # precision ε = 2e-16 and the ratio of the extreme frequencies; 1e-9 allows a ratio of 1000.
        at_rest = peak <= AT_REST * permitted_amplitude
        is_known = permitted_amplitude > 0
        permitted = np.where(is_known, permitted_amplitude, float(peak.max()) or 1.0)
        return OutputSizes(peak=np.where(at_rest, permitted, peak), at_rest=at_rest)

    @property
    def peak(self) -> Array:
        """Peak of each output at the nominal point and some corners, shape (outputs,).

        For an output at rest it is what the energy of the response permits.
        """
        return self._sizes.peak

    @property
    def at_rest(self) -> Mask:
        """Whether rounding alone moves an output, shape (outputs,)."""
        return self._sizes.at_rest

    @cached_property
    def scale(self) -> Array:
        """Factor from a tolerance to the allowed error of each output, shape (outputs,).

        For a tolerance that is a fraction of the peaks it is the peak of the output. An absolute
        tolerance is in the unit of the output with the index `reference`, the first displacement
        or else the first output. The factor is then 1 if all outputs have one unit, and else the
        peak of the output over that of the reference output.
        """
        if self.relative:
            return self.peak
        if len(set(self.units)) == 1:
            return np.ones(len(self.outputs))
        return np.asarray(self.peak / self.peak[self.reference])

    def values(self, unit: Array) -> Array:
        """Return the outputs at all nodes for unit coordinates, shape (points, parameters).

        The shape of the outputs is (points, times, outputs).
        """
        return self.flow.values(self.boxes.to_physical(unit))

    def taylor(self, unit: Array) -> Jet:
        """Return the outputs as `values` with first and second derivatives by unit coordinates."""
        return self.flow.taylor(self.boxes.to_physical(unit)).rescaled(self.boxes.radius)

    def envelope(
        self, bounds: Array, at: Array, error: Array | None = None, **fields: object
    ) -> Envelope:
        """Return the envelope of this problem with given bounds.

        Args:
            bounds: Upper bounds, shape (levels, times, outputs, 2): on the last axis first of the
                output with its sign changed, then of the output itself.
            at: Inputs in SI units that attain them, shape (levels, times, outputs, 2, parameters).
            error: Error of the bounds, shape (levels, times, outputs); 0 by default.
            fields: Further fields of `Envelope` by name: at least `method`, the name of the
                method, and `nature`, the guarantee of the bounds.

        Raises:
            RefusedError: Shapes differ, a bound is not finite or an error negative.
            FailedError: Attained bounds exceed guaranteed ones, or the bounds of a level exceed
                those of a lower level by more than errors and rounding.
        """
        if error is None:
            error = np.zeros(bounds.shape[:-1])
        return Envelope(
            alpha=self.boxes.alpha,
            time=self.time,
            outputs=self.outputs,
            inputs=self.boxes.inputs,
            lower=-bounds[..., 0],
            upper=bounds[..., 1],
            lower_at=at[..., 0, :],
            upper_at=at[..., 1, :],
            error=error,
            units=self.units,
            **fields,  # type: ignore[arg-type]
        )
