"""The boxes P_α of the uncertain parameters, and trajectories over the unit box."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from alphacut.base.arrays import Ints, Mask
from alphacut.base.errors import require_numbers
from alphacut.frame.calculus.jet import Array, Jet
from alphacut.frame.dynamics.flow import Flow
from alphacut.frame.envelope import Envelope
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy import FuzzyNumber, Interval
from alphacut.fuzzy.knowledge.joint import joined_inputs
from alphacut.fuzzy.sets.boxes import corners
from alphacut.fuzzy.sets.numbers import checked_levels

ALPHA = (0.0, 0.25, 0.5, 0.75, 1.0)
GEOMETRIC_RATIO = 1.5
"""Ratio of an input's ends above which it is bisected at their geometric mean."""
DEFAULT_TOLERANCE = 1e-3
"""Error wanted unless one is given, as a fraction of each output's peak."""
AT_REST = 1e-9
"""Peak of an output, as a fraction of what the energy of the motion allows it, up to which rounding
alone moves it; rounding is some ε (ω_max/ω₁)² of the latter."""
MAX_PROBED_CORNERS = 16
"""Corners of the widest box at which peaks are read for their size."""


@dataclass(frozen=True, eq=False)
class Boxes:
    """Nested boxes, one per level, in physical and in unit coordinates.

    The unit coordinate of a parameter runs over [−1, 1] on its widest cut: p = centre + radius u.

    Args:
        names: Parameters, d of them.
        alpha: Levels, rising, shape (A,).
        lower: Lower ends, shape (A, d), in SI units.
        upper: Upper ends, shape (A, d).
        nominal: Values of membership 1, shape (d,).
        numbers: Fuzzy numbers whose cuts they are, by name; intervals where there are none.
    """

    names: tuple[str, ...]
    alpha: Array
    lower: Array
    upper: Array
    nominal: Array
    numbers: Mapping[str, FuzzyNumber] = field(default_factory=dict)

    @property
    def inputs(self) -> Mapping[str, FuzzyNumber]:
        """Fuzzy numbers by name."""
        ends = zip(self.names, self.lower[0].tolist(), self.upper[0].tolist(), strict=True)
        return self.numbers or {name: Interval(low, high) for name, low, high in ends}

    def bisect(self, axis: int) -> list[tuple[Boxes, Ints]]:
        """Both halves along an input, each with the rows of the levels that intersect it.

        The boxes of a half are those of these levels alone.
        """
        low, high = self.lower[0, axis], self.upper[0, axis]
        # the geometric mean, since frequencies are powers of stiffnesses and masses
        middle = (
            np.sqrt(low * high) if low > 0 and high > GEOMETRIC_RATIO * low else (low + high) / 2
        )
        halves = []
        for ends in ((-np.inf, middle), (middle, np.inf)):
            intersects = (self.lower[:, axis] <= ends[1]) & (self.upper[:, axis] >= ends[0])
            levels = np.flatnonzero(intersects)
            low, high = np.full((2, len(self.names)), [[-np.inf], [np.inf]])
            low[axis], high[axis] = ends
            halves.append((self.on_levels(levels).intersect(low, high), levels))
        return halves

    def on_levels(self, levels: Ints | Sequence[int]) -> Boxes:
        """The boxes of some levels, given by their rows in `alpha`."""
        levels = np.asarray(levels)
        ends = self.lower[levels], self.upper[levels]
        return Boxes(self.names, self.alpha[levels], *ends, self.nominal, self.numbers)

    def intersect(self, low: Array, high: Array) -> Boxes:
        """The intersection of each box with the box from `low` to `high`, (d,) each, in SI."""
        lower, upper, nominal = (
            np.asarray(np.clip(x, low, high)) for x in (self.lower, self.upper, self.nominal)
        )
        return Boxes(self.names, self.alpha, lower, upper, nominal)

    def without_repetitions(self) -> tuple[Boxes, Array]:
        """The boxes that differ from that of the level below, and each level's row in them, (A,).

        The cuts of intervals are the same at every level and need be searched once.
        """
        ends = np.concatenate([self.lower, self.upper], axis=1)
        is_new = np.append(True, (np.diff(ends, axis=0) != 0).any(axis=1))
        ends_of_new = {"lower": self.lower[is_new], "upper": self.upper[is_new]}
        return replace(self, alpha=self.alpha[is_new], **ends_of_new), np.cumsum(is_new) - 1

    @property
    def probes(self) -> Array:
        """Nominal inputs and some corners of the widest box, shape (S, d), in SI units."""
        d = len(self.names)
        if 2**d <= MAX_PROBED_CORNERS:
            ends = corners(-np.ones(d), np.ones(d))
        else:  # two opposite corners, others at random
            random_corners = np.random.default_rng(7).choice(
                [-1.0, 1.0], (MAX_PROBED_CORNERS - 2, d)
            )
            ends = np.vstack([-np.ones(d), np.ones(d), random_corners])
        return np.asarray(np.unique(np.vstack([self.nominal, self.to_physical(ends)]), axis=0))

    @property
    def centre(self) -> Array:
        """Middle of the widest box, shape (d,), in SI units."""
        return np.asarray((self.lower[0] + self.upper[0]) / 2)

    @property
    def radius(self) -> Array:
        """Half widths of the widest box, shape (d,), in SI units."""
        return np.asarray((self.upper[0] - self.lower[0]) / 2)

    def to_unit(self, points: Array) -> Array:
        """Unit coordinates of physical points (…, d); a parameter without width is at 0."""
        return np.asarray((points - self.centre) / np.where(self.radius > 0, self.radius, 1.0))

    def to_physical(self, unit: Array) -> Array:
        """Physical points of unit coordinates (…, d), never outside the widest box."""
        return np.asarray(np.clip(self.centre + self.radius * unit, self.lower[0], self.upper[0]))

    def unit_ends(self, level: int) -> tuple[Array, Array]:
        """Lower and upper ends (d,) of the box in row `level`, in unit coordinates."""
        return self.to_unit(self.lower[level]), self.to_unit(self.upper[level])


def boxes(inputs: Mapping[str, FuzzyNumber | float], alpha: Sequence[float] = ALPHA) -> Boxes:
    """The α-cuts of fuzzy inputs as nested boxes.

    Args:
        inputs: Fuzzy numbers by name, in SI units; a plain number is a crisp one.
        alpha: Levels, rising within [0, 1].

    Raises:
        RefusedError: There is no input, one is no number, or levels do not rise within [0, 1].
    """
    require_numbers("alpha", alpha)
    levels, numbers = np.array(checked_levels(alpha)), joined_inputs(inputs)
    cuts = np.array([[number.cut(a) for number in numbers.values()] for a in levels], float)
    nominal = np.array([number.nominal for number in numbers.values()])
    return Boxes(tuple(numbers), levels, cuts[..., 0], cuts[..., 1], nominal, numbers)


@dataclass(frozen=True, eq=False)
class UnitFlow:
    """Motion of a structure as a function of unit coordinates of its fuzzy parameters.

    Args:
        flow: The motion as a function of physical parameters.
        boxes: The boxes; its names must be those of `flow`.
        relative: Whether tolerances are fractions of each output's peak instead of lengths.
    """

    flow: Flow
    boxes: Boxes
    relative: bool = True

    @property
    def time(self) -> Array:
        """Nodes, shape (T,), in s."""
        return self.flow.time

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the observed quantities."""
        return self.flow.outputs

    @property
    def units(self) -> tuple[str, ...]:
        """SI unit of each output; empty where it is not known."""
        return tuple(Output(name).unit.removeprefix("SI") for name in self.outputs)

    def tolerance(self, value: float | None) -> float:
        """A tolerance: `value` if given, else `DEFAULT_TOLERANCE` of the peak.

        It is in units of each output's peak or, where tolerances are not relative, in the unit of
        output `reference`.
        """
        unit = 1.0 if self.relative else float(self.peak[self.reference])
        return value or DEFAULT_TOLERANCE * unit

    @property
    def reference(self) -> int:
        """Index of the output that a tolerance is meant for: the first displacement, else 0."""
        return self.units.index("m") if "m" in self.units else 0

    @cached_property
    def _peak_and_rest(self) -> tuple[Array, Mask]:
        peak, reach = np.abs(self.flow.values(self.boxes.probes)).max((0, 1)), self.flow.reach()
        at_rest = peak <= AT_REST * reach
        size = np.where(reach > 0, reach, float(peak.max()) or 1.0)
        return np.where(at_rest, size, peak), at_rest

    @property
    def peak(self) -> Array:
        """Peak of each output at the nominal parameters and the probes, shape (m,).

        Of an output at rest it is what the energy of the motion allows.
        """
        return self._peak_and_rest[0]

    @property
    def at_rest(self) -> Mask:
        """Outputs that rounding alone moves, shape (m,)."""
        return self._peak_and_rest[1]

    @cached_property
    def scale(self) -> Array:
        """Factor from a tolerance to the allowed error of each output, shape (m,).

        For a relative tolerance it is the output's peak. An absolute one is meant for output
        `reference`: the factor is 1 if all outputs have its unit, else the ratio of the peaks.
        """
        if self.relative:
            return self.peak
        if len(set(self.units)) == 1:
            return np.ones(len(self.outputs))
        return np.asarray(self.peak / self.peak[self.reference])

    def values(self, unit: Array) -> Array:
        """Outputs at unit coordinates (S, d) and all nodes, shape (S, T, m)."""
        return self.flow.values(self.boxes.to_physical(unit))

    def taylor(self, unit: Array) -> Jet:
        """Outputs, (S, T, m), with first and second derivatives by the d unit coordinates."""
        return self.flow.taylor(self.boxes.to_physical(unit)).rescaled(self.boxes.radius)

    def envelope(
        self, bounds: Array, at: Array, error: Array | None = None, **fields: Any
    ) -> Envelope:
        """The envelope of upper bounds of (−output, output), shape (A, T, m, 2).

        Inputs `at` (A, T, m, 2, n) in SI units reach them; their `error` (A, T, m) is 0 if None.
        Further `fields` of `Envelope` are given by name.
        """
        return Envelope(
            alpha=self.boxes.alpha,
            time=self.time,
            outputs=self.outputs,
            inputs=self.boxes.inputs,
            lower=-bounds[..., 0],
            upper=bounds[..., 1],
            lower_at=at[..., 0, :],
            upper_at=at[..., 1, :],
            error=np.zeros(bounds.shape[:-1]) if error is None else error,
            units=self.units,
            **fields,
        )
