"""Which input to measure next: how much narrower the answer is if one is known better.

For each input the answer is computed again at one level with its cut halved, about the modal value
and at both ends, and with the input exact: where a better measurement will find it, nobody knows
beforehand, so the least gain over those places stands beside the gain at the modal value.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from alphacut.fuzzy.arguments import fuzzy_inputs, require_callable
from alphacut.fuzzy.campaign.store import Identity, Store
from alphacut.fuzzy.campaign.workers import pool, require_executor, require_workers
from alphacut.fuzzy.counted import counted
from alphacut.fuzzy.knowledge.joint import joined_once
from alphacut.fuzzy.knowledge.known import Known
from alphacut.fuzzy.plans.transformation import Reduced
from alphacut.fuzzy.progress_bar import Progress, part, told
from alphacut.fuzzy.propagation import on_interrupt, propagate
from alphacut.fuzzy.samples.result import FuzzyResult, Plan
from alphacut.fuzzy.sets.numbers import Crisp, Cut, FuzzyNumber, Interval
from alphacut.fuzzy.tables import html_table
from alphacut.fuzzy.width_contributions import Basis, widened

_ANSWERS = 6  # for each input: its cut halved and exact, in three places
Answer = Callable[[Mapping[str, FuzzyNumber]], tuple[float, float]]
"""From inputs to the width of the answer and its error."""
INNER = 0.02
"""Share of a width that counts as its error where the bounds are attained ones without estimate."""
ROUND_OFF = 1e-12
"""The least share that does."""


@dataclass(frozen=True)
class Gain:
    """What better knowledge of one input takes off the answer's width.

    Args:
        name: The input.
        half: Width lost where its cut is half as wide about the modal value.
        half_least: The least of that over cuts at the modal value and at both ends.
        exact: Width lost where it is the modal value.
        exact_least: The least of that over the modal value and both ends.
    """

    name: str
    half: float
    half_least: float
    exact: float
    exact_least: float

    def shares(self, unit: float) -> list[str]:
        """All four times a unit, with three digits; what is round-off is 0."""
        found = (unit * x for x in (self.half, self.half_least, self.exact, self.exact_least))
        return [f"{0.0 if abs(x) < 1e-8 else x:.3g}" for x in found]


@dataclass(frozen=True, repr=False)
class Advice:
    """Gains of all inputs, the largest first.

    Args:
        gains: One for each fuzzy input.
        width: Width of the answer now.
        error: Error of a difference of any two widths: the sum of the two largest errors.
        alpha: The level.
        note: Why no input can be named; empty where one can.
        basis: What the bounds are worth, in words; empty where nobody told.
    """

    gains: tuple[Gain, ...]
    width: float
    error: float
    alpha: float
    note: str
    basis: str = ""

    def __str__(self) -> str:
        """A line for each input, then what cannot be said."""
        return self.told(f"width {self.width:.6g}")

    def told(self, width: str) -> str:
        """The same with the width in other words, such as with its unit."""
        unit = 100 / self.width if self.width > 0 else 0.0
        lines = [
            f"{width} at α = {self.alpha:g}, less by, known twice as well (at"
            " least) and exactly (at least):"
        ]
        lines += [
            "  {}: {} % ({} %), {} % ({} %)".format(x.name, *x.shares(unit)) for x in self.gains
        ]
        return "\n".join([*lines, *self._said])

    @property
    def _said(self) -> list[str]:
        """What cannot be said, and what the level ranks."""
        bounds = "This ranks the supports (α = 0). Where a support is a bound that you stated, more"
        bounds += " measurements do not change it; alpha=0.5 ranks what measurements can change."
        every = [y for x in self.gains for y in (x.half, x.half_least, x.exact, x.exact_least)]
        less = widened(min(every, default=0.0) / self.width if self.width > 0 else 0.0)
        return [
            *filter(None, (self.note, self.basis, less)),
            *([bounds] if self.alpha == 0 else []),
        ]

    __repr__ = __str__

    def _repr_html_(self) -> str:
        """Gains in per cent of the width as a table, for notebooks."""
        unit = 100 / self.width if self.width > 0 else 0.0
        rows = [(x.name, *x.shares(unit)) for x in self.gains]
        head = ("input", "known twice as well, %", "at least, %", "exactly, %", "at least, %")
        now = f"less width by; now {self.width:.6g} at α = {self.alpha:g}"
        below = "\n".join([now, *self._said])
        return html_table(head, rows, below=below)


def advice(answer: Answer, inputs: Mapping[str, FuzzyNumber], *, alpha: float = 0.0) -> Advice:
    """Gains by computing the answer again, six times for each input.

    Args:
        answer: The width of the answer and its error, for inputs of which some are intervals or
            crisp.
        inputs: The fuzzy inputs; claims must be joined already.
        alpha: The level.
    """
    cuts = {name: number.cut(alpha) for name, number in inputs.items()}
    whole: dict[str, FuzzyNumber] = {name: _between(*cut) for name, cut in cuts.items()}
    width, error = answer(whole)
    errors, gains, own = [error], [], {}
    for name, number in inputs.items():
        low, high = cuts[name]
        if low == high:
            continue
        lost = []
        for at in (min(max(number.modal, low), high), low, high):
            for share in (0.5, 0.0):
                narrow = _between(at + share * (low - at), at + share * (high - at))
                less, error = answer({**whole, name: narrow})
                errors.append(error)
                lost.append(width - less)
        own[name] = errors[-_ANSWERS]
        gains.append(Gain(name, lost[0], min(lost[0::2]), lost[1], min(lost[1::2])))
    gains.sort(key=lambda x: -x.half)
    note = _note(gains, width, errors[0], own)
    return Advice(tuple(gains), width, sum(sorted(errors)[-2:]), alpha, note)


def measure_next(
    function: Callable[..., object],
    inputs: Mapping[str, FuzzyNumber | float],
    plan: Plan | None = None,
    *,
    output: str | None = None,
    alpha: float = 0.0,
    known: Known | None = None,
    vectorised: bool = False,
    workers: int = 1,
    executor: Executor | None = None,
    store: Store | str | Path | None = None,
    identity: Identity | None = None,
    progress: Progress | bool | None = None,
) -> Advice:
    """How much narrower an output is if each input were known twice as well, and exactly.

    Args:
        function: As for `propagate`.
        inputs: Fuzzy inputs; claims are joined as `propagate` does.
        plan: As for `propagate`.
        output: The output; the only one if not given.
        alpha: The level at which widths are compared.
        known: Facts about the function, as for `propagate`.
        vectorised: Whether the function takes arrays.
        workers: As for `propagate`.
        executor: As for `propagate`.
        store: As for `propagate`; all answers share it.
        identity: As for `propagate`.
        progress: As for `propagate`, of all answers together.

    Raises:
        ValueError: An argument is wrong, or there are several outputs and none is named.
        KeyboardInterrupt: Interrupted; its message says what the store keeps.
    """
    numbers, alpha = joined_once(fuzzy_inputs(inputs)), one_level(alpha)
    moving = [name for name, number in numbers.items() if number.cut(alpha).width > 0]
    basis, answers, done = Basis(), 1 + _ANSWERS * len(moving), itertools.count()
    require_workers(workers)
    require_executor(executor, workers)
    require_callable(function, list(numbers), by_name=True, sent=workers > 1)
    with (
        told(progress) as tell,
        nullcontext(executor) if executor else pool(workers) as running,
        on_interrupt(lambda: _kept(store, identity)),
    ):
        modal = {name: Crisp(number.modal) for name, number in numbers.items()}
        how = {"vectorised": vectorised, "executor": running, "store": store, "identity": identity}
        one = propagate(function, modal, Reduced(), alpha=[1.0], progress=False, **how)  # type: ignore[arg-type]
        _width(one, output)  # which refuses a wrong output after one sample

        def answer(changed: Mapping[str, FuzzyNumber]) -> tuple[float, float]:
            found = propagate(
                function,
                changed,
                plan,
                alpha=[1.0],
                known=known,
                **how,  # type: ignore[arg-type]
                progress=part(tell, next(done), answers),
            )
            basis.add(found, output)
            return _width(found, output)

        found = advice(answer, numbers, alpha=alpha)
        assumed = f"; to tell gains apart, {100 * INNER:g} % of each width is assumed as its error"
        return replace(found, basis=f"{basis}{assumed if basis.unknown else ''}")


def _kept(store: Store | str | Path | None, identity: Identity | None) -> str:
    """How many samples of all answers are kept, and how to go on."""
    if store is None:
        return "none of the samples is kept: `measure_next` keeps them in a store="
    with nullcontext(store) if isinstance(store, Store) else Store(store) as opened:
        models = [one for one in opened.models() if one.identity == dict(identity or {})]
        kept = counted(sum(one.samples for one in models), "sample")
        return f"{opened.path} keeps {kept} of all answers: the same call goes on from them"


def one_level(alpha: object) -> float:
    """The level at which widths are compared, refused if it is no number from 0 to 1."""
    level = alpha if isinstance(alpha, int | float | np.number) else np.nan
    if not 0 <= level <= 1:
        what = "widths are compared at one level, a number from 0 to 1, such as alpha=0.5"
        raise ValueError(f"alpha is {alpha!r}: {what}")
    return float(level)


def _width(found: FuzzyResult, output: str | None) -> tuple[float, float]:
    if output is None and len(found.outputs) > 1:
        raise ValueError(f"there are the outputs {', '.join(found.outputs)}; name one: output=")
    column = 0 if output is None else found.column(output)
    width = float(found.upper[0, column] - found.lower[0, column])
    error = float(found.error[0, column])
    return width, INNER * width if np.isnan(error) else max(2 * error, ROUND_OFF * width)


def _between(low: float, high: float) -> FuzzyNumber:
    return Interval(*Cut(low, high)) if high > low else Crisp(low)


def _note(gains: list[Gain], width: float, whole: float, own: Mapping[str, float]) -> str:
    """Why no input can be named as the one to measure next.

    Args:
        gains: The gains, the largest first.
        width: Width of the answer.
        whole: Its error.
        own: Error of the width with each input's cut halved about its modal value.
    """
    if not gains:
        return "no input is fuzzy at this level: there is nothing to measure"
    first = gains[0]
    error = whole + own[first.name]
    if not np.isfinite([width, whole, *own.values()]).all():
        return "the width is not finite: nothing can be said"
    unit = 100 / width if width > 0 else 0.0
    if first.half <= error:
        least = f"the error of a difference, {unit * error:.3g} % of the width"
        other = (
            "the plan's error is too large to tell, take plan=Optimisation() or BranchAndBound()"
        )
        cure = other if error > width else "try measuring two of them"
        return f"no input can be named: no gain is above {least}; {cure}"
    apart = {x.name: own[first.name] + own[x.name] for x in gains[1:]}
    tied = [x.name for x in gains[1:] if first.half - x.half <= apart[x.name]]
    return (
        f"{first.name} cannot be told from {', '.join(tied)}: their gains differ by less than"
        f" the error, {unit * max(apart[name] for name in tied):.3g} % of the width"
        if tied
        else ""
    )
