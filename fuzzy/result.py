"""Bounds: the result of all methods of fuzzy analysis, for numbers and for responses over time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import FailedError, require, require_choice
from alphacut.base.extras import extra_named
from alphacut.base.nature import Nature as Nature
from alphacut.base.nature import rounded as rounded
from alphacut.fuzzy.knowledge.joint import JointClaim
from alphacut.fuzzy.sets.claimed import ClaimedNumber
from alphacut.fuzzy.sets.numbers import (
    Stepwise,
    checked_levels,
    enclosed_set,
    new_axes,
    outer_steps,
)

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

    from alphacut.fuzzy.campaign.call import Samples
    from alphacut.fuzzy.sets.numbers import FuzzyNumber

ROUND_OFF = 1e-9
"""Fraction of an output's magnitude by which bounds may miss each other for reasons of rounding: it
is far above that of thousands of additions, 1e-13, and far below the six digits that are shown."""


class Ends(NamedTuple):
    """Lower and upper ends, two arrays of one shape."""

    lower: Array
    upper: Array


class Extremes(NamedTuple):
    """Lower and upper bounds of an output over time, and their error, shape (levels,) each."""

    lower: Array
    upper: Array
    error: Array


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Bounds:
    """Ranges of the outputs of a function of fuzzy inputs: an α-cut on each level, or at each time.

    The nature of an output says what its ends are worth:

    - attained: `lower_at` and `upper_at` are inputs that reach them. The true range may be wider.
      Values of a scheme, such as time steps, hold to its `error`.
    - estimated: each true end lies within `error` of the stated one, as far as samples, descents or
      an independent search can tell. Nothing is proved.
    - guaranteed: the true range is proved to lie inside, from what `basis` names. `error` is the
      gap to what is attained, inside the ends; NaN where that is not known.

    Args:
        alpha: Levels, rising within [0, 1], shape (A,).
        lower: Lower ends, in `units`, shape (A, m), or (A, T, m) over time.
        upper: Upper ends, same shape.
        lower_at: Inputs that reach the lower ends, in their own units, shape (…, m, n); NaN where
            they are not known.
        upper_at: The same for the upper ends.
        error: Error or gap, as the nature says, in `units`, 0 or more, shape of `lower`.
        nature: Nature of all outputs, the weakest where `natures` differ.
        outputs: Names of the outputs, m of them.
        inputs: Fuzzy numbers by name, n of them, in the order of the last axis of `lower_at`.
        method: Name of the method, the word that a case file has for it.
        units: Unit of each output; empty for none.
        evaluations: All evaluations of the model, those that verify or estimate among them.
        seconds: Wall time, in s.
        natures: Nature of each output; empty where all are `nature`.
        basis: Knowledge that a guarantee or an estimate rests on.
        time: Time nodes, shape (T,), in s; None where there is no time.
        inner: Attained ends inside guaranteed ones, less the scheme's error, if known.
        outer: Guaranteed ends outside attained or estimated ones, if known.
        notes: Remarks of the method, one sentence each.
        budget: Evaluations that were allowed; 0 for no limit.
        samples: Points and values from which the bounds were taken, if stored.

    Raises:
        RefusedError: Levels do not rise within [0, 1], shapes differ, an end is not finite or an
            error negative.
        FailedError: Attained bounds leave guaranteed ones, or cuts are not nested: the method is
            wrong.

    Example:
        >>> from alphacut.fuzzy import Interval, Reduced, propagate
        >>> bounds = propagate(lambda x: 2 * x, {"x": Interval(1, 3)}, Reduced(), alpha=[0])
        >>> bounds.bounds().lower.item(), bounds.bounds().upper.item()
        (2.0, 6.0)
    """

    alpha: Array
    lower: Array
    upper: Array
    lower_at: Array
    upper_at: Array
    error: Array
    nature: Nature
    outputs: tuple[str, ...]
    inputs: Mapping[str, FuzzyNumber]
    method: str
    units: tuple[str, ...] = ()
    evaluations: int = 0
    seconds: float = 0.0
    natures: tuple[Nature, ...] = ()
    basis: tuple[str, ...] = ()
    time: Array | None = None
    inner: Ends | None = None
    outer: Ends | None = None
    notes: tuple[str, ...] = ()
    budget: int = 0
    samples: Samples | None = None

    def __post_init__(self) -> None:
        """Check shapes and values of the fields, and replace the levels `alpha` by an array.

        With A levels, m outputs and n inputs, `lower`, `upper` and `error` must have the shape
        (A, m), or (A, T, m) if there are T times; `lower_at` and `upper_at` have a further axis n.

        Raises:
            RefusedError: Levels do not rise within [0, 1], a shape is another one, an end is not
                finite, or an error is negative, or NaN where the output is not guaranteed.
            FailedError: Cuts are not nested, or attained ends lie outside guaranteed ones.
        """
        object.__setattr__(self, "alpha", np.array(checked_levels(self.alpha)))
        shape: tuple[int, ...] = (len(self.alpha), len(self.outputs))
        if self.time is not None:
            shape = (len(self.alpha), len(self.time), len(self.outputs))
        for name in ("lower", "upper", "error"):
            _require_shape(name, getattr(self, name).shape, shape)
        for name in ("lower_at", "upper_at"):
            _require_shape(name, getattr(self, name).shape, (*shape, len(self.inputs)))
        for ends in (self.inner, self.outer):
            if ends is not None:
                _require_shape("inner and outer", ends.lower.shape, shape)
                _require_shape("inner and outer", ends.upper.shape, shape)
        for texts in (self.natures, self.units):
            if texts:
                _require_shape("natures, units", (len(texts),), shape[-1:])
        is_finite = np.isfinite(self.lower) & np.isfinite(self.upper)
        # A gap of NaN is unknown. Only a guarantee holds without it: of other natures the error is
        # part of the statement.
        has_error = (self.error >= 0) | (np.isnan(self.error) & self._guaranteed)
        require(
            (is_finite & has_error).all(),
            "lower, upper and error",
            value="not finite, or negative",
            allowed="finite ends, errors of 0 or more, or NaN where guaranteed",
        )
        self._check_proof()

    def _check_proof(self) -> None:
        """Raise `FailedError` if the bounds contradict one another: a method is wrong then.

        A lower bound must not lie above the upper one. The cut of a level must lie in the cut of
        the level before. Ends that inputs reach (`attained`, NaN if unknown) must lie inside ends
        that are proved (`proved`, infinite if unknown). Differences up to the stated errors, and
        rounding of 1e-9 of the output's largest magnitude, are allowed.
        """
        magnitudes = np.maximum(np.abs(self.lower), np.abs(self.upper))
        over_levels_and_time = tuple(range(magnitudes.ndim - 1))
        rounding = ROUND_OFF * magnitudes.max(axis=over_levels_and_time)  # (outputs,)
        error = np.nan_to_num(self.error)
        # Estimated ends may cross where the true ends are equal, by no more than their error.
        estimate_error = np.where(self._guaranteed, 0.0, error)
        # Each of two levels may be off by its own error and its own rounding.
        between_levels = 2 * rounding + error[1:] + error[:-1]
        # `_require_none` raises if an entry of its array is positive.
        crossing = self.lower - self.upper - rounding - estimate_error
        _require_none("lower bounds lie above upper ones", crossing, self.outputs)
        # What crosses by no more than that is put in order: each end stays within its error.
        if (self.lower > self.upper).any():
            lower, upper = self.lower, self.upper
            object.__setattr__(self, "lower", np.minimum(lower, upper))
            object.__setattr__(self, "upper", np.maximum(lower, upper))
        lower_falls = -np.diff(self.lower, axis=0) - between_levels
        _require_none("lower ends of the α-cuts are not nested", lower_falls, self.outputs)
        upper_rises = np.diff(self.upper, axis=0) - between_levels
        _require_none("upper ends of the α-cuts are not nested", upper_rises, self.outputs)
        attained = self.attained
        proved = self.proved
        # A comparison with NaN is false, so that unknown attained ends pass.
        for excess in (proved.lower - attained.lower, attained.upper - proved.upper):
            what = "attained bounds lie outside the proved ones"
            _require_none(what, excess - rounding, self.outputs)

    @cached_property
    def _guaranteed(self) -> Mask:
        """Which outputs have guaranteed bounds, shape (outputs,)."""
        natures = self.natures or (self.nature,) * len(self.outputs)
        return np.array([nature is Nature.GUARANTEED for nature in natures])

    @cached_property
    def attained(self) -> Ends:
        """Ends that some inputs are known to reach, in the shape of `lower`; NaN where unknown.

        The bounds of an output are attained, estimated or guaranteed. Attained and estimated ends
        are reached to within their `error`, so that they are moved inwards by it here. For
        guaranteed outputs the ends `inner` are reached, if they are known. All ends are unknown if
        the box of the inputs is larger than the set that is meant (`encloses`) and `inner` is None.
        """
        unknown = np.full(self.lower.shape, np.nan)
        inner = self.inner or Ends(unknown, unknown)
        if self.encloses and self.inner is None:
            return inner
        lower = np.where(self._guaranteed, inner.lower, self.lower + self.error)
        upper = np.where(self._guaranteed, inner.upper, self.upper - self.error)
        return Ends(lower, upper)

    @cached_property
    def proved(self) -> Ends:
        """Ends that no value of an output exceeds, by proof, with the shape of `lower`.

        They are the bounds of guaranteed outputs. Of the others they are the field `outer`, or −inf
        and inf if it is not known.
        """
        infinite = np.full(self.lower.shape, np.inf)
        outer = self.outer or Ends(-infinite, infinite)
        # Another method may have proved something of attained and estimated outputs, too.
        lower = np.where(self._guaranteed, self.lower, outer.lower)
        upper = np.where(self._guaranteed, self.upper, outer.upper)
        return Ends(lower, upper)

    @property
    def encloses(self) -> str:
        """Name of the set of inputs that the box of their cuts encloses; empty without one."""
        return enclosed_set(self.inputs.values())

    def without_attained(self) -> Self:
        """Return a copy of the bounds in which no end is known to be reached.

        The box of the inputs' cuts may enclose a smaller set, such as the set of inputs that an
        identification has learned from measurements. The bounds over the box hold for the set, too,
        but it is not known whether a point that reaches them belongs to it. So `lower_at` and
        `upper_at` become NaN, and `inner` None.
        """
        unknown = np.full_like(self.lower_at, np.nan)
        return replace(self, inner=None, lower_at=unknown, upper_at=unknown)

    @property
    def claim(self) -> JointClaim:
        """Claim of the cuts, and which inputs are opinions."""
        return JointClaim.from_inputs(self.inputs, self.nature)

    def number(self, output: str = "y") -> Stepwise | ClaimedNumber:
        """Return one output as a fuzzy number; between two levels the wider α-cut holds.

        Args:
            output: Name of the output.

        Returns:
            A fuzzy number with the α-cuts of the output. If inputs come from measured values, and
            so claim that a quantity lies in their α-cut with P ≥ 1 − α, the number carries the
            claim of the result, which holds from the lowest level on.

        Raises:
            RefusedError: There is no such output, its bounds are over time, or the inputs carry no
                claim and the levels do not run from 0 to 1.
        """
        ends = self.bounds(output)
        # The extremes over time would make a number, but of another quantity than the output.
        cure = "bounds() has the ends at each time"
        require(self.time is None, output, "a range at each time", "one number", cure)
        # The cut of a lower level contains every cut up to the next one, so it is safe in between.
        steps = outer_steps(self.alpha, ends.lower, ends.upper, encloses=self.encloses)
        claim = self.claim.claim
        if claim is not None:
            return ClaimedNumber(steps, claim, float(self.alpha[0]))
        is_complete = self.alpha[0] == 0 and self.alpha[-1] == 1
        allowed = "levels from 0 to 1: alpha=levels(4)"
        require(is_complete, "alpha", value=self.alpha.tolist(), allowed=allowed)
        return steps

    def column(self, output: str = "y") -> int:
        """Return the index of an output on the last axis of `lower` and `upper`."""
        require_choice("output", output, self.outputs)
        return self.outputs.index(output)

    def bounds(self, output: str = "y") -> Ends:
        """Return the ends of one output, two arrays of shape (A,), or (A, T) over time."""
        column = self.column(output)
        return Ends(self.lower[..., column], self.upper[..., column])

    def nature_of(self, output: str = "y") -> Nature:
        """Return the nature of one output's bounds."""
        column = self.column(output)
        return self.natures[column] if self.natures else self.nature

    def __str__(self) -> str:
        """Return the bounds as lines of text.

        The first line says what the bounds promise (attained, estimated or guaranteed), on what
        basis, by which method and at which cost. A line for each level of an output follows, with
        the extremes over all times if there are times. Outputs are shown as far as they fit into 25
        lines, but one at least. The last lines are the notes of the method, and the claim of
        probability that the inputs' measured values allow.
        """
        max_lines = 25  # of levels of outputs; the text shall fit on a screen
        n_shown = max(1, max_lines // len(self.alpha))
        head = f"bounds {self.nature}"
        if self.encloses:
            head += f" {of_enclosing_box(self.encloses)}"
        if self.basis:
            head += f" (given that {' and '.join(self.basis)})"
        if self.time is not None:
            head += f" over {self.time[0]:g} … {self.time[-1]:g} s"
        head += f" by the method {self.method}: {self.evaluations:,} evaluations"
        if self.budget:
            head += f" of at most {self.budget:,}"
        lines = [f"{head}, {self.seconds:.2g} s"]
        for output in self.outputs[:n_shown]:
            lines += self._lines(output)
        n_hidden = len(self.outputs) - n_shown
        if n_hidden > 0:
            lines.append(f"… and {n_hidden} outputs more: bounds(NAME) has them")
        lines += self.notes
        if self.claim.rule:
            lines.append(str(self.claim))
        return "\n".join(lines)

    __repr__ = __str__

    @property
    def named(self) -> tuple[str, ...]:
        """Name of each output with its unit, as "q1 [m]"."""
        if not self.units:
            return self.outputs
        pairs = zip(self.outputs, self.units, strict=True)
        return tuple(f"{name} [{unit}]" if unit else name for name, unit in pairs)

    def _lines(self, output: str) -> Iterator[str]:
        """Yield a line of text for each level of an output, with its extremes over time.

        A line has the name with its unit, the level, both ends, and what the ends are worth:

        - attained: that the true range may be wider, and the error if it is above 0;
        - estimated: the error;
        - guaranteed: the gap to the ends that inputs are known to reach. It is left out if the box
          of the inputs encloses a smaller set (`encloses`), which may not contain these inputs.

        Ends are rounded to six digits, attained ones to the inside of the range, others to the
        outside. The nature is added if it differs from the nature of all outputs together.

        Args:
            output: Name of one of the outputs.
        """
        column = self.column(output)
        nature = self.nature_of(output)
        extremes = self.extremes_over_time(column)
        for alpha, lower, upper, error in zip(self.alpha, *extremes, strict=True):
            # Six digits are rounded to the side on which the statement stays true: a range that
            # inputs reach may be shown narrower, and one that holds everything wider.
            low = rounded(lower, "lower", nature, 6)
            high = rounded(upper, "upper", nature, 6)
            if low > high:  # attained ends of nearly one value were rounded inwards
                low = lower
                high = upper
            line = f"{self.named[column]}, α = {_digits(alpha)}: {_digits(low)} … {_digits(high)}"
            if nature is Nature.ATTAINED:
                line += " or wider"
                if error > 0:  # of the values, as of a time step
                    line += f", error {_digits(error)}"
            elif nature is Nature.ESTIMATED:
                line += f", error {_digits(error)}"
            elif not self.encloses:
                line += f", gap to attained {_digits(error)}"
            yield line if nature == self.nature else f"{line}, {nature}"

    def extremes_over_time(self, column: int) -> Extremes:
        """Return the smallest lower end, the largest upper end and the largest error over time.

        They have the shape (levels,) each. Without times they are the ends and errors themselves.
        The largest error is NaN, which means unknown, if one of the errors is.

        Args:
            column: Index of the output on the last axis of `lower`.
        """
        # The arrays have the axes (levels, times, outputs) or (levels, outputs).
        over_time = tuple(range(1, self.lower.ndim - 1))
        return Extremes(
            lower=self.lower[..., column].min(axis=over_time),
            upper=self.upper[..., column].max(axis=over_time),
            error=self.error[..., column].max(axis=over_time),
        )

    def plot(self, axes: Axes | None = None, output: str = "", **line: object) -> Axes:
        """Draw an output: its membership function, or over time the band of each α-cut.

        Args:
            axes: Axes of Matplotlib on which is drawn; new ones if not given.
            output: Name of the output; the first one if it is empty.
            line: Keywords of `Axes.plot`, or over time of `Axes.fill_between`.

        Returns:
            The axes. Neither labels nor a legend are drawn.

        Raises:
            RefusedError: There is no such output; or it has no times, the levels do not run from 0
                to 1, and the inputs carry no claim of probability.
            MissingLibraryError: New axes are to be made, and Matplotlib is not installed.
        """
        output = output or self.outputs[0]
        if self.time is None:
            return self.number(output).plot(axes, **line)
        if axes is None:
            axes = new_axes()
        # Bands of all levels lie on one another, so that the core becomes the darkest.
        opacity = 0.8 / len(self.alpha)
        style: dict[str, Any] = {"color": "tab:blue", "alpha": opacity, "lw": 0} | line
        ends = self.bounds(output)
        for level in range(len(self.alpha)):
            axes.fill_between(self.time, ends.lower[level], ends.upper[level], **style)
        return axes

    def to_dataset(self) -> xarray.Dataset:
        """Return the bounds as an xarray dataset.

        Its variables are:

        - `lower`, `upper` and `error` over (alpha, time, output), or (alpha, output) without times;
        - the inputs that reach the ends, `lower_at` and `upper_at`, over a further axis parameter;
        - `nature` (attained, estimated or guaranteed) and `label` (as "q1 [m]") of each output.

        The attributes are method, evaluations, seconds and basis, and `encloses`, the name of the
        set that the box of the inputs encloses, if there is one.

        Raises:
            MissingLibraryError: xarray is not installed.
        """
        with extra_named():
            import xarray

        time = {} if self.time is None else {"time": self.time}
        axes = {"alpha": self.alpha, **time, "output": list(self.outputs)}
        # The order of the axes is that of the arrays: levels, times, outputs, and inputs last.
        # xarray names the axes of a variable by a tuple of these keys.
        coordinates = {**axes, "parameter": list(self.inputs)}
        natures = [str(self.nature_of(output)) for output in self.outputs]
        variables = {
            "lower": (tuple(axes), self.lower),
            "upper": (tuple(axes), self.upper),
            "error": (tuple(axes), self.error),
            "lower_at": (tuple(coordinates), self.lower_at),
            "upper_at": (tuple(coordinates), self.upper_at),
            "nature": (("output",), np.array(natures)),
            "label": (("output",), np.array(self.named)),
        }
        facts: dict[str, str | float] = {
            "method": self.method,
            "evaluations": self.evaluations,
            "seconds": self.seconds,
            "basis": "; ".join(self.basis),
        }
        if self.encloses:
            facts["encloses"] = self.encloses
        return xarray.Dataset(variables, coordinates, facts)


def of_enclosing_box(encloses: str) -> str:
    """Return the words "of the box around …" for the name of the set that a box encloses."""
    return f"of the box around {encloses}"


def _digits(value: float) -> str:
    """Return a number with six significant digits; empty where it is NaN."""
    # Adding 0 turns −0, which a rounded bound may be, into 0.
    return "" if np.isnan(value) else f"{value + 0.0:.6g}"


def _require_none(what: str, excess: Array, outputs: tuple[str, ...]) -> None:
    """Raise a `FailedError` that says `what` is wrong if an excess (…, outputs) is positive."""
    if (excess > 0).any():
        # Outputs are the last axis, which runs fastest in the flat index that argmax returns.
        output = outputs[int(np.nanargmax(excess) % len(outputs))]
        raise FailedError(f"{what}: of {output}, by up to {np.nanmax(excess):.3g}")


def _require_shape(name: str, found: tuple[int, ...], shape: tuple[int, ...]) -> None:
    """Raise RefusedError if the shape `found` of the array `name` is not the expected `shape`."""
    require(found == shape, f"shape of {name}", value=found, allowed=str(shape))
