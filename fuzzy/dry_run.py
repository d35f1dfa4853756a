"""Dry run of a campaign: its plan up to the first sample that is not stored."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from alphacut.fuzzy.arguments import fuzzy_inputs, interaction_list, known_facts, require_plan
from alphacut.fuzzy.campaign.call import BATCH, Call, Function, named_point
from alphacut.fuzzy.campaign.sample_store import Shelf, shelf
from alphacut.fuzzy.campaign.store import Identity, Store, Stored
from alphacut.fuzzy.campaign.workers import needed
from alphacut.fuzzy.counted import counted
from alphacut.fuzzy.knowledge.known import Known
from alphacut.fuzzy.plans.automatic import Automatic
from alphacut.fuzzy.plans.transformation import Extended, General, Reduced
from alphacut.fuzzy.samples.model import Values
from alphacut.fuzzy.samples.result import Plan
from alphacut.fuzzy.sets.boxes import Domain, levels
from alphacut.fuzzy.sets.interaction import Interaction
from alphacut.fuzzy.sets.numbers import Array, FuzzyNumber
from alphacut.fuzzy.tables import html_table

Inputs = Mapping[str, FuzzyNumber | float]

_SHOWN = 5
_LISTED = 100_000  # samples that are listed at most where nothing is stored


@dataclass(frozen=True, repr=False)
class Explanation:
    """Samples that a campaign would run, with the reasons.

    Args:
        samples: Samples that the plan asks for first; all of them unless it goes on from their
            values.
        stored: How many of them are stored.
        missing: Inputs of those that would run, by name.
        calls: Calls that they take.
        seconds: Time that they would take one after the other, from the mean of those stored; None
            where nothing tells.
        memory: Bytes that the samples' numbers take.
        reasons: Why they are not there, one sentence each.
        open_end: What else the number of samples depends on; empty where it is known.
    """

    samples: int
    stored: int
    missing: tuple[dict[str, float], ...]
    calls: int
    seconds: float | None
    memory: int
    reasons: tuple[str, ...]
    open_end: str = ""

    def __str__(self) -> str:
        missing = self.samples - self.stored
        samples = f"the first {self.samples}" if self.open_end else counted(self.samples, "sample")
        calls = counted(self.calls, "call")
        head = f"{self.open_end}{samples}: {self.stored} stored, {missing} to run in {calls}"
        time = "" if self.seconds is None else f", about {self.seconds:.3g} s of work"
        first = [
            ", ".join(f"{name} = {value:.6g}" for name, value in point.items())
            for point in self.missing[:_SHOWN]
        ]
        more = [f"… and {missing - _SHOWN} more"] if missing > _SHOWN else []
        head += f"{time}; {self.memory / 1e6:.3g} MB of memory"
        return "\n".join([head, *self.reasons, *(f"  would run {row}" for row in first), *more])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        """The text with the first samples that would run as a table, for notebooks."""
        names = [*self.missing[0]] if self.missing else []
        rows = [[f"{x:.6g}" for x in point.values()] for point in self.missing[:_SHOWN]]
        said = [line for line in str(self).splitlines() if not line.startswith("  would run ")]
        return html_table(names, rows, below="\n".join(said))


class _MissingError(Exception):
    """The first samples that are not stored."""

    def __init__(self, points: Array, missing: Array) -> None:
        super().__init__()
        self.points, self.missing = points, missing


@dataclass
class _Rehearsal:
    """A model that only knows what is stored."""

    samples: Shelf | None
    known: Known
    seen: int = 0
    columns: int = 1
    seconds: float = 0.0

    def __call__(self, points: Array) -> Values:
        keys = [self.samples.key(points[row]) for row in range(len(points))] if self.samples else []
        stored = self.samples.stored(keys) if self.samples else {}
        rows = [stored.get(key) for key in keys] or [None] * len(points)
        found = [row for row in rows if row is not None]
        self.seen += len(found)
        self.seconds += sum(row.seconds for row in found)
        self.columns = len(found[0].row) if found else self.columns
        if len(found) < len(points):
            raise _MissingError(points, points[[row is None for row in rows]])
        return Values(found[0].layout, np.array([row.row for row in found]))

    def report(self, share: float, *, last: bool = False) -> None:
        """Nothing is done, so nothing is told."""


def explain(
    function: Function | Inputs | None = None,
    inputs: Inputs | Plan | None = None,
    plan: Plan | None = None,
    *,
    alpha: Sequence[float] | None = None,
    interactions: Sequence[Interaction] = (),
    shared: Sequence[str] = (),
    vectorised: bool = False,
    workers: int = 1,
    executor: object = None,
    known: Known | None = None,
    store: Store | str | Path | None = None,
    identity: Identity | None = None,
    spot_check: float = 0.05,
    progress: object = None,
) -> Explanation:
    """Preview of `propagate` with the same arguments; nothing is run or written.

    The function is not called and may be left out, so that the inputs come first; `workers`,
    `executor`, `spot_check` and `progress` change nothing.

    Raises:
        ValueError: An argument is wrong.
    """
    if isinstance(function, Mapping):
        inputs, plan = function, cast("Plan | None", inputs) or plan
    plan = plan or Automatic()
    require_plan(plan)
    domain = Domain(
        fuzzy_inputs(cast("Inputs", inputs)),
        levels(4) if alpha is None else alpha,
        interaction_list(interactions),
    )
    facts = known_facts(known, domain.names)
    call = Call(_never, domain.names, tuple(shared), vectorised)
    there = (
        store if isinstance(store, Store) or (store is not None and Path(store).exists()) else None
    )
    if (
        there is None
        and isinstance(plan, Reduced | General | Extended)
        and not plan.stepwise
        and plan.size(domain) > _LISTED
    ):
        return _counted(plan.size(domain), domain, vectorised)
    with shelf(there, identity, domain.names) as samples:
        return _rehearsed(plan, domain, call, _Rehearsal(samples, facts), identity or {})


def _rehearsed(
    plan: Plan, domain: Domain, call: Call, rehearsal: _Rehearsal, identity: Identity
) -> Explanation:
    """The plan followed through the store."""
    missing: Array
    try:
        points, missing = plan.run(rehearsal, domain).points, np.empty((0, len(domain.names)))
    except _MissingError as stop:
        points, missing = stop.points, stop.missing
    reasons: tuple[str, ...] = ("everything is stored: nothing would run",)
    if len(missing):
        reasons = _reasons(rehearsal.samples, identity, domain, missing)
    count = rehearsal.seen + len(missing) if len(missing) else len(points)
    return Explanation(
        samples=count,
        stored=count - len(missing),
        missing=tuple(named_point(domain.names, missing[row]) for row in range(len(missing))),
        calls=len(list(call.tasks(missing))),
        seconds=rehearsal.seconds / rehearsal.seen * len(missing) if rehearsal.seen else None,
        memory=needed(count, len(domain.names) + rehearsal.columns),
        reasons=reasons,
        open_end=_open_end(plan) if plan.stepwise and len(missing) else "",
    )


def _counted(size: int, domain: Domain, vectorised: bool) -> Explanation:
    """Count of samples too many to list; points of two levels count twice."""
    calls = -(-size // BATCH) if vectorised else size
    few = "too many to list; take Signed, Optimisation or Chebyshev if these are too many to run"
    reasons, memory = (_NO_STORE, few), needed(size, len(domain.names) + 1)
    return Explanation(size, 0, (), calls, None, memory, reasons)


def _open_end(plan: Plan) -> str:
    """Remark on a plan that goes on from the values of its samples."""
    most = getattr(plan, "budget", None) or getattr(plan, "limit", None)
    kind = "budget" if hasattr(plan, "budget") else "limit"
    known = f"{kind} {most:,}" if most else "no budget: name one to bound them"
    return f"how many samples {type(plan).__name__} takes depends on the model ({known}); "


_NO_STORE = "there is no store yet: every sample is new"


def _never(**_: float) -> float:
    raise AssertionError("an explanation runs nothing")


def _reasons(
    samples: Shelf | None, identity: Identity, domain: Domain, missing: Array
) -> tuple[str, ...]:
    if samples is None:
        return (_NO_STORE,)
    keys = [samples.key(missing[row]) for row in range(len(missing))]
    failed = samples.failed(keys)
    again = f"{len(failed)} failed before and would be tried again, the first with:"
    reasons = [f"{again} {next(iter(failed.values()))}"] if failed else []
    own = [model for model in samples.models() if model.identity == dict(identity)]
    if own and own[0].samples:
        reasons += _new_values(samples, domain, missing)
    else:
        reasons += _nearest([model for model in samples.models() if model.samples], identity)
    return tuple(reasons)


def _new_values(samples: Shelf, domain: Domain, missing: Array) -> list[str]:
    """Inputs with values that no stored sample of this model has."""
    stored = samples.points()
    found = []
    for column, name in enumerate(domain.names):
        fresh = {float(value) for value in missing[:, column]} - {point[name] for point in stored}
        if fresh:
            values = f"{name} takes {counted(len(fresh), 'value')} that no stored sample has"
            found.append(f"{values}, the first {min(fresh):.6g}")
    return found or ["the inputs take stored values in new combinations"]


def _nearest(models: list[Stored], identity: Identity) -> list[str]:
    """Differences to the nearest model that has samples."""
    if not models:
        return ["the store is empty: every sample is new"]
    differences = [_differences(model.identity, identity) for model in models]
    nearest = min(range(len(models)), key=lambda i: len(differences[i]))
    near = f"the nearest model, with {models[nearest].samples} samples"
    what = f"{near}, differs: {'; '.join(differences[nearest])}"
    return [f"no sample of this model is stored; {what}"]


def _differences(stored: Any, asked: Any, path: str = "") -> list[str]:
    """Differences of two identities, each as `key: stored → asked`."""
    if isinstance(stored, Mapping) and isinstance(asked, Mapping):
        found = []
        for key in sorted({*stored, *asked}):
            below = f"{path}.{key}" if path else str(key)
            found += _differences(stored.get(key), asked.get(key), below)
        return found
    return [] if stored == asked else [f"{path}: {stored} → {asked}"]
