"""Contributions to the width: the share lost when an input is fixed (Figs. 34, 35)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from alphacut.fuzzy.arguments import fuzzy_inputs
from alphacut.fuzzy.progress_bar import Progress, told
from alphacut.fuzzy.samples.nature import Nature
from alphacut.fuzzy.samples.result import FuzzyResult
from alphacut.fuzzy.sets.numbers import Array, Crisp, FuzzyNumber
from alphacut.fuzzy.tables import html_table

Bounds = Callable[[Mapping[str, FuzzyNumber]], tuple[Array, Array] | FuzzyResult]

_ROUND_OFF = 1e-9  # least share of a width that is negative in earnest


@dataclass(frozen=True, eq=False, repr=False)
class Shares:
    """Effect of each input, or group of inputs, on the width of a fuzzy result.

    Args:
        names: Inputs or groups.
        width: Width with all inputs fuzzy, shape (…).
        lost: Width lost when one is fixed, shape (names, …). What is lost to all need not add up to
            the width: effects overlap.
        outputs: Names of the outputs along the last axis of `width`; empty where there is none.
        basis: What the bounds are worth, in words; empty where the propagation gave two arrays.
    """

    names: tuple[str, ...]
    width: Array
    lost: Array
    outputs: tuple[str, ...] = ()
    basis: str = ""

    @property
    def share(self) -> Array:
        """Width lost over width, shape (names, …); 0 where there is no width."""
        share: Array = np.divide(
            self.lost, self.width, out=np.zeros_like(self.lost), where=self.width > 0
        )
        return share

    def __str__(self) -> str:
        """A line for each output and input or group, the least and the greatest share."""
        lines = [f"  {', '.join(names)}: {words}" for *names, words in self._told()]
        return "\n".join([f"{self._head}:", *lines, *self._said])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        """The shares as a table, for notebooks."""
        head = ("output",) if len(self.outputs) > 1 else ()
        rows, below = self._told(), "\n".join([self._head, *self._said])
        return html_table((*head, "input", "share of the width lost"), rows, below=below)

    @property
    def _head(self) -> str:
        """What a share is, and what its range runs over."""
        over = "the levels and times" if self.width.ndim > 2 else "the levels"
        fixed = "share of the width lost where the input is fixed at the middle of its cut at α = 1"
        return f"{fixed}; smallest … largest over {over}"

    @property
    def _said(self) -> list[str]:
        """What the bounds are worth, and what negative shares say of them."""
        return [*filter(None, (self.basis, widened(float(self.share.min(initial=0.0)))))]

    def _told(self) -> list[tuple[str, ...]]:
        """Output where there are several, input, and its shares over all but outputs."""
        share = 100 * self.share
        if len(self.outputs) < 2:
            return [(name, _range(share[i])) for i, name in enumerate(self.names)]
        return [
            (output, name, _range(share[i, ..., k]))
            for k, output in enumerate(self.outputs)
            for i, name in enumerate(self.names)
        ]


def _range(share: Array) -> str:
    """The least and the greatest share in per cent, over levels and times."""
    low, high = share.min(initial=np.inf), share.max(initial=-np.inf)
    return f"{low:.3g} %" if low == high else f"{low:.3g} … {high:.3g} %"


def widened(share: float) -> str:
    """What the least share of a width lost says of the bounds where it is negative."""
    if share > -_ROUND_OFF:
        return ""
    return (
        f"a negative share, {100 * share:.3g} %: a narrower input cannot widen the true answer, so"
        " the bounds are wrong by that much at least; BranchAndBound(function) proves some"
    )


@dataclass
class Basis:
    """What the bounds of several propagations are worth."""

    plan: str = ""
    natures: set[Nature] = field(default_factory=set)
    unknown: bool = False

    def add(self, found: FuzzyResult, output: str | None = None) -> None:
        """Take one more result, or one output of it."""
        own = [found.column(output)] if output is not None else range(len(found.outputs))
        self.plan = self.plan or found.plan
        self.natures.update(*(found.nature_of(found.outputs[k]) for k in own))
        self.unknown |= bool(np.isnan(found.error[:, own]).any())

    def __str__(self) -> str:
        """The weakest nature, the first plan, and whether an error is missing."""
        order = (Nature.ESTIMATED, Nature.INNER, Nature.GUARANTEED)
        weakest = next((one for one in order if one in self.natures), None)
        error = ", whose error is not estimated" if self.unknown else ""
        return f"by {weakest} bounds of the plan {self.plan}{error}" if weakest else ""


ASKED = (
    "the first argument is a propagation, from the inputs by name to lower and upper ends, two"
    " arrays, such as lambda inputs: propagate(function, inputs).bounds()"
)


def width_shares(
    bounds: Bounds,
    inputs: Mapping[str, FuzzyNumber | float],
    *,
    groups: Mapping[str, Sequence[str]] | None = None,
    progress: Progress | bool | None = None,
) -> Shares:
    """Run a propagation with all inputs fuzzy and again with each fixed.

    Args:
        bounds: The propagation: from fuzzy inputs to lower and upper ends, two arrays of any one
            shape (levels, times, outputs), or to a result, as `lambda inputs:
            propagate(function, inputs)`, whose outputs are told by name.
        inputs: The fuzzy inputs.
        groups: Names of inputs that are fixed together, by the name of their group; each input by
            itself if not given.
        progress: As for `propagate`, after each propagation.

    Raises:
        ValueError: A group names no input, or a propagation gives no two arrays.
    """
    inputs = fuzzy_inputs(inputs)
    groups = groups or {name: (name,) for name in inputs}
    chosen = {name: tuple(members) for name, members in groups.items()}
    unknown = sorted({member for members in chosen.values() for member in members} - set(inputs))
    if unknown:
        raise ValueError(
            f"the groups name {', '.join(unknown)}; the fuzzy inputs are {', '.join(inputs)}"
        )

    outputs: list[tuple[str, ...]] = []
    basis = Basis()

    def width(fuzzy: Mapping[str, FuzzyNumber]) -> Array:
        try:
            found = bounds(fuzzy)
        except TypeError as error:
            raise ValueError(f"{ASKED}, and it raised TypeError: {error}") from error
        if isinstance(found, FuzzyResult):
            outputs.append(tuple(found.outputs))
            basis.add(found)
            found = found.lower, found.upper
        if not isinstance(found, Sequence | np.ndarray) or len(found) != 2:
            raise ValueError(f"{ASKED}, and it returned {repr(found).partition(chr(10))[0][:80]}")
        difference: Array = np.asarray(found[1], float) - np.asarray(found[0], float)
        if len(outputs) == 0 and difference.ndim > 1:
            outputs.append(tuple(f"output {k}" for k in range(difference.shape[-1])))
        return difference

    fixed = ({x: Crisp(inputs[x].modal) for x in members} for members in ((), *chosen.values()))
    sets = [{**inputs, **crisp} for crisp in fixed]
    widths = []
    with told(progress) as tell:
        for kept in sets:
            widths.append(width(kept))
            if tell:
                tell(len(widths) / len(sets))
    whole, *narrower = widths
    lost, named = np.array([whole - one for one in narrower]), outputs[0] if outputs else ()
    return Shares(tuple(chosen), whole, lost, named, str(basis))
