"""Bounds: the result of every method of fuzzy analysis, for numbers and for motions over time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from alphacut.fuzzy.arrays import Array, Mask
from alphacut.fuzzy.knowledge.joint import JointClaim
from alphacut.fuzzy.refused import FailedError, chosen, require
from alphacut.fuzzy.sets.claimed import Claimed
from alphacut.fuzzy.sets.numbers import rising
from alphacut.fuzzy.sets.stepwise import Stepwise, outer_steps

if TYPE_CHECKING:
    import xarray

    from alphacut.fuzzy.campaign.values import Samples
    from alphacut.fuzzy.sets.numbers import FuzzyNumber

ROUND_OFF = 1e-9
"""Share of an output's size by which bounds may miss each other for reasons of rounding."""
_ROWS = 25
"""Levels of all outputs that a text has at most."""


class Nature(StrEnum):
    """Worth of bounds, from the weakest on."""

    ATTAINED = "attained"
    ESTIMATED = "estimated"
    GUARANTEED = "guaranteed"

    @property
    def sentence(self) -> str:
        """Promise of the nature."""
        return {
            "attained": "Some inputs reach these bounds; the true range may be wider.",
            "estimated": "The true bounds lie within the error, as an independent pass tells.",
            "guaranteed": "No value in the α-cut lies outside these bounds; this is proved.",
        }[self]

    @staticmethod
    def weakest(natures: Iterable[Nature]) -> Nature:
        """The weakest of some, one or more."""
        return min(natures, key=list(Nature).index)


def rounded(value: float, side: str, nature: Nature, digits: int = 4) -> float:
    """The lower or upper end of a range: attained ends inwards, others outwards.

    Rounding in the tenth digit counts as none.
    """
    if value == 0 or not math.isfinite(value):
        return value
    up = (side == "upper") != (nature is Nature.ATTAINED)
    scale = 10.0 ** (digits - 1 - math.floor(math.log10(abs(value))))
    slack = 1e-10 * abs(value) * scale
    return (math.ceil(value * scale - slack) if up else math.floor(value * scale + slack)) / scale


class Ends(NamedTuple):
    """Lower and upper ends, two arrays of one shape."""

    lower: Array
    upper: Array


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Bounds:
    """Ranges of the outputs of a function of fuzzy inputs, an α-cut a level, over time if there is.

    `print` shows them, `bounds(name)` gives the ends of an output, `number(name)` a fuzzy number.
    The nature of an output says what its ends are worth:

    - attained: `lower_at` and `upper_at` are inputs that reach them. The true range may be wider.
      Values of a scheme, such as time steps, hold to its `error`.
    - estimated: each true end lies within `error` of the one stated, as far as an independent pass
      can tell. Nothing is proved.
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
        time: Nodes, shape (T,), in s; None where there is no time.
        inner: Attained ends inside guaranteed ones, less the scheme's error; None for none.
        outer: Proved ends outside others; None for none.
        notes: Remarks of the method, one sentence each.
        budget: Evaluations that were allowed; 0 for no limit.
        calls: Calls of the model, each for the samples that share a set-up.
        reused: Evaluations that were taken from a store.
        samples: Points and values that the bounds were taken from; None where none are kept.

    Raises:
        RefusedError: Levels do not rise within [0, 1], shapes differ, an end is not finite or an
            error negative.
        FailedError: Attained bounds leave proved ones, or cuts are not nested: the method is wrong.
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
    calls: int = 0
    reused: int = 0
    samples: Samples | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "alpha", np.array(rising(self.alpha)))
        self._check_shapes()
        self._check_values()
        self._check_proof()

    def _check_shapes(self) -> None:
        middle = () if self.time is None else (len(self.time),)
        shape = (len(self.alpha), *middle, len(self.outputs))
        places = (*shape, len(self.inputs))
        pairs = [pair for pair in (self.inner, self.outer) if pair is not None]
        for name, array, expected in (
            *((name, getattr(self, name), shape) for name in ("lower", "upper", "error")),
            *((name, getattr(self, name), places) for name in ("lower_at", "upper_at")),
            *((f"inner, outer: {end}", getattr(p, end), shape) for p in pairs for end in p._fields),
        ):
            require(array.shape == expected, f"shape of {name}", array.shape, str(expected))
        each = {len(self.natures), len(self.units)} <= {0, len(self.outputs)}
        require(each, "natures and units", (self.natures, self.units), "one an output")

    def _check_values(self) -> None:
        finite = (np.isfinite(self.lower) & np.isfinite(self.upper)).all()
        require(finite, "lower and upper", "not finite", "finite ends")
        plain = ((self.error >= 0) | (np.isnan(self.error) & self._guaranteed)).all()
        require(plain, "error", "negative or NaN", "0 or more, or NaN where guaranteed")

    def _check_proof(self) -> None:
        """Refuse bounds that contradict each other by more than their error and rounding."""
        near = self._near
        estimated = np.where(self._guaranteed, 0.0, np.nan_to_num(self.error))
        wide = near + np.nan_to_num(self.error)
        both = (wide[1:] + wide[:-1])[: len(wide) - 1]
        inner, outer = self.attained, self.proved
        for what, beyond in (
            ("lower bounds lie above upper ones", self.lower - self.upper - near - estimated),
            ("lower ends of the α-cuts are not nested", -np.diff(self.lower, axis=0) - both),
            ("upper ends of the α-cuts are not nested", np.diff(self.upper, axis=0) - both),
            ("attained bounds lie outside the proved ones", outer.lower - inner.lower - near),
            ("attained bounds lie outside the proved ones", inner.upper - outer.upper - near),
        ):
            if (beyond > 0).any():
                worst = self.outputs[int(np.nanargmax(beyond) % len(self.outputs))]
                raise FailedError(f"{what}: of {worst}, by up to {np.nanmax(beyond):.3g}")

    @property
    def _near(self) -> Array:
        """Difference that rounding explains, shape (m,)."""
        axes = tuple(range(self.lower.ndim - 1))
        size = np.maximum(np.abs(self.lower), np.abs(self.upper)).max(axis=axes)
        return np.asarray(ROUND_OFF * size)

    @cached_property
    def _guaranteed(self) -> Mask:
        natures = self.natures or (self.nature,) * len(self.outputs)
        return np.array([nature is Nature.GUARANTEED for nature in natures])

    @cached_property
    def attained(self) -> Ends:
        """Ends that the true range reaches at least; NaN where nothing attained is known.

        Bounds that are not guaranteed are taken less their error.
        """
        blank = np.full(self.lower.shape, np.nan)
        inner = self.inner or Ends(blank, blank)
        lower = np.where(self._guaranteed, inner.lower, self.lower + self.error)
        return Ends(lower, np.where(self._guaranteed, inner.upper, self.upper - self.error))

    @cached_property
    def proved(self) -> Ends:
        """Ends that the true range is proved to lie inside; infinite where nothing is proved."""
        wide = np.full(self.lower.shape, np.inf)
        outer = self.outer or Ends(-wide, wide)
        lower = np.where(self._guaranteed, self.lower, outer.lower)
        return Ends(lower, np.where(self._guaranteed, self.upper, outer.upper))

    @property
    def claim(self) -> JointClaim:
        """Claim of the cuts, and which inputs are opinions."""
        return JointClaim.of(self.inputs).resting_on(self.nature)

    def number(self, output: str = "y") -> Stepwise | Claimed:
        """One output as a fuzzy number: between two levels the wider α-cut holds.

        Raises:
            RefusedError: The levels do not reach from 0 to 1, and nothing is claimed.
        """
        steps = outer_steps(self.alpha, *self.bounds(output))
        if (claim := self.claim.claim) is not None:
            return Claimed(steps, claim, float(self.alpha[0]))
        whole = (self.alpha[0], self.alpha[-1]) == (0, 1)
        require(whole, "alpha", self.alpha.tolist(), "levels from 0 to 1: alpha=levels(4)")
        return steps

    def column(self, output: str = "y") -> int:
        """Index of an output.

        Raises:
            RefusedError: There is no such output.
        """
        chosen("output", output, self.outputs)
        return self.outputs.index(output)

    def bounds(self, output: str = "y") -> Ends:
        """Lower and upper ends of one output, two arrays of shape (A,), or (A, T) over time."""
        column = self.column(output)
        return Ends(self.lower[..., column], self.upper[..., column])

    def nature_of(self, output: str = "y") -> Nature:
        """Nature of one output's bounds."""
        column = self.column(output)
        return self.natures[column] if self.natures else self.nature

    @property
    def minimum(self) -> Array:
        """Least lower end over time, shape (A, m)."""
        return self.lower if self.time is None else self.lower.min(axis=1)

    @property
    def maximum(self) -> Array:
        """Greatest upper end over time, shape (A, m)."""
        return self.upper if self.time is None else self.upper.max(axis=1)

    def select(self, *outputs: str) -> Self:
        """The same of some outputs, in their order."""
        columns = [self.column(name) for name in outputs]
        natures = tuple(map(self.nature_of, outputs))
        return replace(
            self,
            outputs=outputs,
            units=tuple(self.units[k] for k in columns if self.units),
            natures=natures,
            nature=Nature.weakest(natures),
            lower=self.lower[..., columns],
            upper=self.upper[..., columns],
            error=self.error[..., columns],
            lower_at=self.lower_at[..., columns, :],
            upper_at=self.upper_at[..., columns, :],
            inner=_of(self.inner, columns),
            outer=_of(self.outer, columns),
        )

    def __str__(self) -> str:
        """Nature and cost; bounds of the first outputs, a line for each level; notes."""
        count = max(1, _ROWS // len(self.alpha))
        shown = range(len(self.outputs))[:count]
        lines = [line for column in shown for line in self._lines(column)]
        hidden = len(self.outputs) - count
        more = [f"… and {hidden} outputs more: bounds(NAME) has them"] if hidden > 0 else []
        claim = [str(self.claim)] if self.claim.rule else []
        return "\n".join([self._head, *lines, *more, *self.notes, *claim])

    __repr__ = __str__

    @property
    def _head(self) -> str:
        """Nature, what it rests on, and what it cost."""
        rests = f" (given that {' and '.join(self.basis)})" if self.basis else ""
        over = "" if self.time is None else f" over {self.time[0]:g} … {self.time[-1]:g} s"
        most = f" of at most {self.budget:,}" if self.budget else ""
        cost = f"{self.evaluations:,} evaluations{most}, {self.seconds:.2g} s"
        return f"bounds {self.nature}{rests}{over} by the method {self.method}: {cost}"

    @property
    def named(self) -> tuple[str, ...]:
        """Outputs with their units."""
        pairs = zip(self.outputs, self.units or ("",) * len(self.outputs), strict=True)
        return tuple(f"{name} [{unit}]" if unit else name for name, unit in pairs)

    def _lines(self, column: int) -> Iterator[str]:
        """A line for each level of an output, with the extremes over time where there is one."""
        low, high, error = self.minimum[:, column], self.maximum[:, column], self.error[..., column]
        nature = self.nature_of(self.outputs[column])
        differs = f", {nature}" if nature != self.nature else ""
        words = "gap to attained" if nature is Nature.GUARANTEED else "error"
        worst = error if self.time is None else error.max(axis=1)
        for alpha, least, most, miss in zip(self.alpha, low, high, worst, strict=True):
            both = rounded(least, "lower", nature, 6), rounded(most, "upper", nature, 6)
            ends = both if both[0] <= both[1] else (least, most)  # attained, nearly one number
            head = f"{self.named[column]}, α = {_digits(alpha)}: {' … '.join(map(_digits, ends))}"
            yield f"{head}, {words} {_digits(miss)}{differs}"

    def to_dataset(self) -> xarray.Dataset:
        """Bounds over (alpha, time, output), where they are attained over (…, parameter)."""
        import xarray

        middle = {} if self.time is None else {"time": self.time}
        axes = {"alpha": self.alpha, **middle, "output": list(self.outputs)}
        places = {**axes, "parameter": list(self.inputs)}
        tables = {name: (tuple(axes), getattr(self, name)) for name in ("lower", "upper", "error")}
        tables |= {name: (tuple(places), getattr(self, name)) for name in ("lower_at", "upper_at")}
        tables["nature"] = (("output",), np.array([str(self.nature_of(x)) for x in self.outputs]))
        tables["label"] = (("output",), np.array(self.named))
        facts = {"method": self.method, "evaluations": self.evaluations, "seconds": self.seconds}
        return xarray.Dataset(tables, places, {**facts, "basis": "; ".join(self.basis)})


def _digits(value: float) -> str:
    """A number with six digits; empty where it is not known."""
    return "" if np.isnan(value) else f"{value + 0.0:.6g}"


def _of(pair: Ends | None, columns: list[int]) -> Ends | None:
    """The ends of some outputs."""
    return pair and Ends(pair.lower[..., columns], pair.upper[..., columns])
