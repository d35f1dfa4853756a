"""Result of every plan: bounds on each α-level, where they are reached, their nature."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from alphacut.fuzzy.counted import counted
from alphacut.fuzzy.drawing import draw_bands, draw_membership, new_axes
from alphacut.fuzzy.knowledge.joint import JointClaim
from alphacut.fuzzy.knowledge.known import Signs, contradictions
from alphacut.fuzzy.samples.model import Model, Values
from alphacut.fuzzy.samples.nature import Nature, condition
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.claimed import Claimed
from alphacut.fuzzy.sets.numbers import Array, Mask, Rows
from alphacut.fuzzy.sets.stepwise import Stepwise, outer_steps
from alphacut.fuzzy.surrogates.response_surface import ResponseSurface
from alphacut.fuzzy.tables import html_table, write_csv

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes


_ITEM = re.compile(r"\[\d+\]$")  # an entry of an array
_ROWS = 25  # that are printed, a level each


def _crisp(domain: Domain) -> Mask:
    """Levels whose cut is one point, shape (levels,)."""
    lower, upper = domain.boxes
    return np.asarray((lower == upper).all(axis=1))


def _shown(value: float) -> str:
    """A bound with six digits; 0 where it is less than a normal number."""
    return f"{0.0 if abs(value) < np.finfo(float).tiny else value:.6g}"


@dataclass(frozen=True, eq=False, repr=False)
class FuzzyResult:
    """Fuzzy outputs by their α-cuts.

    Args:
        domain: Inputs and levels.
        outputs: Name of each output column.
        lower: Lower ends, in the function's own units, shape (levels, outputs).
        upper: Upper ends, in the same units, shape (levels, outputs).
        lower_at: Inputs that reach the lower ends, in their own units, shape (levels, outputs,
            inputs).
        upper_at: Inputs that reach the upper ends, likewise, shape (levels, outputs, inputs).
        base: What the bounds are worth where they are not proved.
        plan: Name of the plan.
        runs: Samples of the model that the bounds took.
        verification_runs: Samples spent on verifying the plan's assumption, counted apart.
        error: Estimated error of the bounds, in their units, shape (levels, outputs); NaN where
            nothing estimates it, 0 where there is none: of crisp cuts, and of proved bounds that
            are attained.
        proved: Where the true range is proved to lie inside the bounds, shape (levels, outputs).
        enforced: Where nesting had to be enforced, shape (levels, outputs).
        given: Facts that the proof rests on and nobody proved, one sentence each.
        unsearched: Outputs that the plan did not search: inner bounds, without an error.
        notes: What the plan found on its way, one sentence each.
        points: Samples of the model, shape (n, inputs).
        values: Outputs at `points`.
        calls: Calls of the model, each for the samples that share a set-up.
        reused: Of all `samples`, those taken from a store instead of being run.
        seconds: Wall time of the whole propagation, in s.
    """

    domain: Domain
    outputs: tuple[str, ...]
    lower: Array
    upper: Array
    lower_at: Array
    upper_at: Array
    base: Nature
    plan: str
    runs: int
    verification_runs: int = 0
    error: Array = field(default_factory=lambda: np.zeros(0))
    proved: Mask = field(default_factory=lambda: np.zeros(0, bool))
    enforced: Mask = field(default_factory=lambda: np.zeros(0, bool))
    given: tuple[str, ...] = ()
    unsearched: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    points: Array = field(default_factory=lambda: np.zeros((0, 0)))
    values: Values = field(default_factory=lambda: Values((), np.zeros((0, 0))))
    calls: int = 0
    reused: int = 0
    seconds: float = 0.0

    @classmethod
    def attained(
        cls,
        domain: Domain,
        points: Array,
        values: Values,
        *,
        lowest: NDArray[np.intp],
        highest: NDArray[np.intp],
        enforced: Mask,
        plan: str,
    ) -> FuzzyResult:
        """Inner bounds taken from samples.

        Args:
            domain: Inputs and levels.
            points: Samples, shape (n, inputs).
            values: Outputs at the samples.
            lowest: Row of the sample that reaches each lower end, shape (levels, outputs).
            highest: Row of the sample that reaches each upper end, shape (levels, outputs).
            enforced: Where nesting had to be enforced, shape (levels, outputs).
            plan: Name of the plan.
        """
        columns = np.arange(values.array.shape[1])
        return cls(
            domain=domain,
            outputs=values.columns,
            lower=values.array[lowest, columns],
            upper=values.array[highest, columns],
            lower_at=points[lowest],
            upper_at=points[highest],
            base=Nature.INNER,
            plan=plan,
            runs=len(points),
            error=np.where(_crisp(domain)[:, None], 0.0, np.full(lowest.shape, np.nan)),
            proved=np.zeros(lowest.shape, bool),
            enforced=enforced,
            points=points,
            values=values,
        )

    def proving(
        self, holds: Callable[[FuzzyResult], Mask], given: tuple[str, ...] = ()
    ) -> FuzzyResult:
        """The same bounds, proved where `holds`, shape (levels, outputs), and samples agree."""
        proved = holds(self)
        sound = proved & ~self.enforced.any(axis=0)
        refuted = [
            self.outputs[column] for column in np.flatnonzero((proved & self.enforced).any(axis=0))
        ]
        notes = tuple(
            f"the samples contradict what is stated of output {name}: its bounds are inner only"
            for name in refuted
        )
        return replace(
            self,
            proved=self.proved | sound,
            error=np.where(sound, 0.0, self.error),
            given=given,
            notes=(*self.notes, *notes),
        )

    def searched(self, columns: Sequence[int] | Rows, named: Sequence[str]) -> FuzzyResult:
        """The same, all but the searched columns without an error; `named` by the caller."""
        aside = ~np.isin(np.arange(len(self.outputs)), columns)
        if not aside.any():
            return self
        names = tuple(self.outputs[k] for k in np.flatnonzero(aside))
        why = f"outputs = {tuple(named)}" if named else "of derivatives only those named are"
        told = ", ".join([*names[:4], *(["…"] if len(names) > 4 else [])])
        note = f"{told} {'was' if len(names) == 1 else 'were'} not searched: {why}"
        exact = self.proved | _crisp(self.domain)[:, None]
        error = np.where(aside, np.where(exact, 0.0, np.nan), self.error)
        return replace(self, error=error, unsearched=names, notes=(*self.notes, note))

    def confronted(self, signs: Signs) -> FuzzyResult:
        """The same bounds, proved where samples do not contradict signs (outputs, inputs)."""
        relevant = np.where(self.proved.any(axis=0).reshape(-1, 1), signs, 0)
        found = contradictions(self.points, self.values.array, relevant)
        notes = tuple(
            f"{against.told(self.outputs[i], self.inputs)}; its bounds are inner only"
            for i, against in found.items()
        )
        kept = self.proved & ~np.isin(np.arange(len(self.outputs)), list(found))
        error = np.where(self.proved & ~kept & (self.error == 0), np.nan, self.error)
        more = (*self.notes, *notes)
        return replace(self, proved=kept, error=error, notes=more) if found else self

    def __str__(self) -> str:
        """Bounds of the first outputs, a line for each level, with nature and cost."""
        given = condition(self._rests_on)
        runs = f"{self.runs} runs"
        if self.verification_runs:
            how = "looked for what they missed" if "auto" in self.plan else "tested monotonicity"
            runs += f" and {self.verification_runs} more that {how}"
        runs += "; their error is not estimated" if np.isnan(self.error).any() else ""
        lines = [f"{self.nature} bounds{given} by the plan {self.plan}, {runs}"]
        for column, name in enumerate(self.outputs[: self._printed]):
            ends = self.lower[:, column], self.upper[:, column], self.error[:, column]
            lines += [
                f"{name}, α = {alpha:g}: {_shown(low)} … {_shown(high)}"
                + (f", error {error:.2g}" if error > 0 else "")
                for alpha, low, high, error in zip(self.domain.alpha, *ends, strict=True)
            ]
        hidden = len(self.outputs) - self._printed
        what = f"… and {counted(hidden, 'output')} more: bounds(NAME) has them"
        more = [what] if hidden > 0 else []
        said = [self.claim.brief] if self.claim.brief else []
        return "\n".join([*lines, *more, *self.notes, *said])

    __repr__ = __str__

    @property
    def _printed(self) -> int:
        return max(1, _ROWS // len(self.alpha))

    def _repr_html_(self) -> str:
        """The text of the result with its cuts as a table, for notebooks."""
        head, *said = str(self).split("\n")
        notes = [line for line in said if ", α = " not in line]
        shown = range(min(len(self.outputs), self._printed))
        rows = [
            (
                self.outputs[k],
                f"{alpha:g}",
                *(_shown(ends[a, k]) for ends in (self.lower, self.upper)),
                "not estimated" if np.isnan(self.error[a, k]) else f"{self.error[a, k]:.2g}",
            )
            for k in shown
            for a, alpha in enumerate(self.domain.alpha)
        ]
        header = ("output", "α", "lower", "upper", "error")
        return html_table(header, rows, below="\n".join([head, *notes]))

    def plot(self, output: str | None = None, axes: Axes | None = None) -> Axes:
        """Draw one output's cuts as a membership function, with the levels that were computed.

        Between levels the ends go straight, as those of the inputs do. Where an input's do not (a
        number from data has steps), the wider of two cuts is drawn up to the next level: cuts there
        lie inside it.

        Args:
            output: Name of the output; `y` of an array y[0], y[1], …: bands over the index. The
                first one if not given, and the title says so where there are several.
            axes: Where to draw; a new figure if not given.

        Returns:
            The axes drawn on.

        Raises:
            ValueError: There is no such output.
        """
        if output is None:
            output = _ITEM.sub("", self.outputs[0])
            axes = self.plot(output, axes)
            if {_ITEM.sub("", name) for name in self.outputs} != {output}:
                axes.set_title(f"{axes.get_title()}\nfirst output, others by plot(NAME)", size=10)
            return axes
        item = re.compile(rf"{re.escape(str(output))}\[\d+\]")
        row = [k for k, name in enumerate(self.outputs) if item.fullmatch(name)]
        if row and output not in self._columns:
            axes = new_axes(axes)
            draw_bands(axes, range(len(row)), self.alpha, self.lower[:, row], self.upper[:, row])
            axes.set(xlabel="index", ylabel=output, title=f"{self.nature} bounds")
            return axes
        lower, upper = self.bounds(output)
        axes = new_axes(axes)
        draw_membership(axes, self.alpha, lower, upper, steps=not self.domain.linear)
        for level, *ends in zip(self.alpha, lower, upper, strict=True):
            axes.plot(ends, (level, level), color="grey", marker="|", linewidth=0.8)
        axes.set(xlabel=output, title=f"{self.nature} bounds{self._between}")
        return axes

    @property
    def samples(self) -> int:
        """All samples of the model: those of the bounds and those that verified them."""
        return self.runs + self.verification_runs

    @property
    def claim(self) -> JointClaim:
        """What the cuts claim, and which inputs are opinions."""
        joint = JointClaim.of(self.domain.inputs)
        checked, bounded = not np.isnan(self.error).any(), bool(self.domain.interactions)
        return joint.resting_on(self.nature, interactions=bounded, checked=checked)

    @property
    def nature(self) -> Nature:
        """Weakest nature of the bounds over all levels and outputs."""
        return Nature.GUARANTEED if self.proved.size and self.proved.all() else self.base

    @property
    def worth(self) -> str:
        """Nature in one sentence, with what a proof rests on."""
        return f"bounds {self.nature}: {self.nature.sentence(self._rests_on)}"

    @property
    def _rests_on(self) -> tuple[str, ...]:
        return self.given if self.proved.any() else ()

    def nature_of(self, output: str = "y") -> tuple[Nature, ...]:
        """Nature of one output's bounds on each level."""
        base = Nature.INNER if output in self.unsearched else self.base
        return tuple(
            Nature.GUARANTEED if proved else base for proved in self.proved[:, self.column(output)]
        )

    @property
    def alpha(self) -> Array:
        """Levels, rising."""
        return np.array(self.domain.alpha)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs, in the order of the last axis of `lower_at` and `upper_at`."""
        return self.domain.names

    def column(self, output: str) -> int:
        """Index of an output.

        Raises:
            ValueError: There is no such output.
        """
        if output not in self._columns:
            there = [*self.outputs[:_ROWS], *(["…"] if len(self.outputs) > _ROWS else [])]
            none = f"there is no output {output!r}; there are {', '.join(there)}"
            if any(name.startswith(f"{output}[") for name in self.outputs):
                none += f"; bounds('{output}[0]') are those of an entry, plot('{output}') draws all"
            raise ValueError(none)
        return self._columns[output]

    @cached_property
    def _columns(self) -> dict[str, int]:
        return {name: column for column, name in enumerate(self.outputs)}

    def bounds(self, output: str = "y") -> tuple[Array, Array]:
        """Lower and upper ends of one output over the levels, two arrays of shape (levels,)."""
        column = self.column(output)
        return self.lower[:, column], self.upper[:, column]

    @property
    def _between(self) -> str:
        """What a picture draws between levels, in words."""
        between = "straight" if self.domain.linear else "at most the steps"
        return f", {between} between levels" if len(self.alpha) > 1 else ""

    def number(self, output: str = "y") -> Stepwise | Claimed:
        """One output as a fuzzy number: between two levels the wider α-cut holds.

        Raises:
            ValueError: The levels do not reach from 0 to 1, and nothing is claimed.
        """
        lower, upper = self.bounds(output)
        if (claim := self.claim.claim) is not None:
            return Claimed(outer_steps(self.alpha, lower, upper), claim, float(self.alpha[0]))
        if self.alpha[0] != 0 or self.alpha[-1] != 1:
            shown = ", ".join(f"{level:g}" for level in self.alpha)
            raise ValueError(
                f"the α-levels of the result are {shown}; a fuzzy number needs some from 0 to 1:"
                " take alpha=levels(4)"
            )
        return outer_steps(self.alpha, lower, upper)

    def surface(self, output: str = "y") -> ResponseSurface:
        """Response surface of one output through the samples of the model (Fig. 2)."""
        return ResponseSurface.fit(self.points, self.values.array[:, [self.column(output)]])

    def to_csv(self, path: str | Path) -> None:
        """Write a CSV file with a row for each output and level.

        Its columns are output, alpha, lower, upper, error (empty where it is not estimated), then
        for each input where the bounds are reached: `NAME at lower`, `NAME at upper`.

        Args:
            path: The file; one that is there is replaced.

        Raises:
            ValueError: It cannot be written there.
        """
        places = [f"{name} at {end}" for end in ("lower", "upper") for name in self.inputs]
        tables = self.lower[..., None], self.upper[..., None], self.error[..., None]
        numbers = np.concatenate([*tables, self.lower_at, self.upper_at], axis=2)
        cells = np.where(np.isnan(numbers), "", numbers.astype(object))
        rows = (
            (name, alpha, *cells[level, column])
            for column, name in enumerate(self.outputs)
            for level, alpha in enumerate(self.domain.alpha)
        )
        write_csv(path, ("output", "alpha", "lower", "upper", "error", *places), rows)

    def to_dataset(self) -> xarray.Dataset:
        """Bounds over (alpha, output), where they are reached over (alpha, output, parameter).

        Their `error` is NaN where it is not estimated.
        """
        import xarray

        names = {"lower": 2, "upper": 2, "error": 2, "lower_at": 3, "upper_at": 3}
        axes = {"alpha": self.alpha, "output": [*self.outputs], "parameter": [*self.inputs]}
        told = ("plan", "worth", "runs", "verification_runs")
        return xarray.Dataset(
            {name: ((*axes,)[:size], getattr(self, name)) for name, size in names.items()},
            axes,
            {**{name: getattr(self, name) for name in told}, "nature": str(self.nature)}
            | {"claim": str(self.claim)},
        )


class Plan(Protocol):
    """A way to search the boxes of the inputs for the extremes of a model."""

    @property
    def stepwise(self) -> bool:
        """True if samples depend on those before, so that the plan reports its progress."""

    def run(self, model: Model, domain: Domain) -> FuzzyResult:
        """Bounds of every output of the model on every level."""
