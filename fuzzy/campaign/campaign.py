"""Campaign: the samples of a method, run by workers and kept in a store."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.campaign.call import Call, Failure, Outcome, Sample, named_point
from alphacut.fuzzy.campaign.store import Store, point_key
from alphacut.fuzzy.campaign.workers import Task, completed
from alphacut.fuzzy.knowledge.known import Known
from alphacut.fuzzy.refused import FailedError, real
from alphacut.fuzzy.samples.model import Layout, SpentError, Values

_SHOWN = 3  # failed samples that a message quotes
_LONG = 300  # letters of an error that a message quotes
_PAUSE = 0.05  # seconds between two transactions at least
_SHARE = 10  # a transaction that took t is not followed by another within 10 t
_GATHERED = 1000  # samples of a transaction at most


class CampaignError(FailedError):
    """Some samples failed; the others were run.

    Args:
        failures: Inputs of each failed sample, by name, with its error.
        total: Samples of the batch.
    """

    def __init__(self, failures: list[tuple[dict[str, float], str]], total: int) -> None:
        self.failures, self.total = failures, total
        lines = [f"at {_place(point)}: {_brief(error)}" for point, error in failures[:_SHOWN]]
        more = f"; and {len(failures) - _SHOWN} more" if len(failures) > _SHOWN else ""
        what = f"{len(failures)} of {total} samples failed, the others are done: "
        super().__init__(what + "; ".join(lines) + more, 'on_failure="skip" leaves them out')


def _place(point: dict[str, float]) -> str:
    return ", ".join(f"{name} = {value:.6g}" for name, value in point.items())


def _brief(error: str) -> str:
    first = error.strip().partition("\n")[0]
    return first if len(first) <= _LONG else f"{first[:_LONG]} …"


@dataclass
class Campaign:
    """Evaluates points of a model through workers: the `Model` that methods get.

    Args:
        call: The function with the way it is called.
        known: What the caller knows about the model.
        budget: Evaluations that are allowed.
        executor: Any `concurrent.futures` executor; None runs in this process.
        progress: Called with the share done, 0 … 1.
        store: Where samples are kept; None keeps none.
        model: Key of the model in the store.
        skip: Whether samples that fail are left out (NaN) instead of ending the campaign.

    Attributes:
        evaluations: Of the model so far, those from the store among them.
        reused: Those taken from the store.
        calls: Calls of the function.
        failed: Samples left out.
        layout: Names and shapes of the outputs, as the first sample had them.

    Raises:
        RefusedError: The budget is no positive whole number, or a fact names no input.
    """

    call: Call
    known: Known = field(default_factory=Known)
    budget: int = 10_000
    executor: Executor | None = None
    progress: Callable[[float], None] | None = None
    store: Store | None = None
    model: bytes = b""
    skip: bool = False
    evaluations: int = 0
    reused: int = 0
    calls: int = 0
    failed: int = 0
    layout: Layout = ()
    _share: float = 0.0

    def __post_init__(self) -> None:
        self.known.check_inputs(self.call.names)
        real("budget", self.budget, positive=True, whole=True)

    @property
    def left(self) -> int:
        """Evaluations that the budget still allows."""
        return self.budget - self.evaluations

    def __call__(self, points: Array) -> Values:
        """Outputs at the points, shape (n, inputs), in their order; NaN where one was skipped.

        Raises:
            SpentError: They would pass the budget; none is run.
            CampaignError: Samples failed; raised after all others have run.
        """
        if len(points) > self.left:
            what = f"{self.evaluations:,} evaluations are done, the next {len(points):,} would pass"
            raise SpentError(f"{what} the budget of {self.budget:,}", "take a larger budget")
        self.evaluations += len(points)
        batch = _Batch(self, points)
        batch.run()
        failures = {
            row: one.error for row, one in batch.outcomes.items() if isinstance(one, Failure)
        }
        if failures and (not self.skip or len(failures) == len(points) == self.evaluations):
            names = self.call.names
            pairs = [(named_point(names, points[row]), failures[row]) for row in sorted(failures)]
            raise CampaignError(pairs, len(points))
        self.failed += len(failures)
        return self._values(batch.outcomes)

    def _values(self, outcomes: dict[int, Outcome]) -> Values:
        """Outputs of all rows, in the order of the first sample's outputs."""
        width = Values(self.layout, np.zeros((0, 0))).columns
        array = np.full((len(outcomes), len(width)), np.nan)
        for row, outcome in outcomes.items():
            if isinstance(outcome, Sample):
                array[row] = outcome.row
        return Values(self.layout, array)

    def in_order(self, outcome: Outcome) -> Outcome:
        """The outcome with its outputs in the order of the first sample's."""
        if isinstance(outcome, Failure) or outcome.layout == self.layout:
            return outcome
        if not self.layout:
            self.layout = outcome.layout
            self.known.check_outputs(Values(outcome.layout, outcome.row[None]).columns)
            return outcome
        if sorted(outcome.layout) != sorted(self.layout):
            return Failure(f"outputs are {outcome.layout} where others have {self.layout}")
        values = Values(outcome.layout, outcome.row[None])
        row = np.concatenate([values.output(name).ravel() for name, _ in self.layout])
        return Sample(self.layout, row)

    def report(self, share: float) -> None:
        """Report the completed fraction, which never falls."""
        if self.progress and share > self._share:
            self._share = share
            self.progress(share)


class _Batch:
    """One batch of points on its way through the workers and the store."""

    def __init__(self, campaign: Campaign, points: Array) -> None:
        self.campaign, self.points = campaign, points
        self.outcomes: dict[int, Outcome] = {}
        self._gathered: dict[str, Sample] = {}
        self._written, self._cost = perf_counter(), 0.0

    def run(self) -> None:
        """Take what is stored, run the rest, and keep it whatever happens."""
        campaign, first = (
            self.campaign,
            self.campaign.left == self.campaign.budget - len(self.points),
        )
        self._take_stored()
        try:
            for rows, outcomes in completed(campaign.call, self._tasks(), campaign.executor):
                campaign.calls += 1
                for row, outcome in zip(rows, outcomes, strict=True):
                    self._record(row, outcome)
                self._write()
                if first and len(self.points) > 1:  # of later ones nobody knows how many come
                    campaign.report(0.99 * len(self.outcomes) / len(self.points))
        finally:
            self._write(now=True)

    def _take_stored(self) -> None:
        campaign = self.campaign
        for row in range(len(self.points) if campaign.store else 0):
            assert campaign.store is not None
            key = point_key(campaign.call.names, self.points[row])
            sample = campaign.store.get(campaign.model, key)
            if sample is not None:
                self.outcomes[row] = campaign.in_order(sample)
                campaign.reused += 1

    def _tasks(self) -> Iterator[Task]:
        """Calls to be made, without samples that are stored."""
        for group in self.campaign.call.tasks(self.points):
            if rows := [row for row in group if row not in self.outcomes]:
                yield rows, self.points[rows]

    def _record(self, row: int, outcome: Outcome) -> None:
        outcome = self.outcomes[row] = self.campaign.in_order(outcome)
        if self.campaign.store and isinstance(outcome, Sample):
            self._gathered[point_key(self.campaign.call.names, self.points[row])] = outcome

    def _write(self, *, now: bool = False) -> None:
        """Write what is gathered: now, or when the last write is long enough ago to cost little."""
        start = perf_counter()
        due = start - self._written > max(_PAUSE, _SHARE * self._cost)
        if self._gathered and (now or due or len(self._gathered) >= _GATHERED):
            assert self.campaign.store is not None
            self.campaign.store.put(self.campaign.model, self._gathered)
            self._gathered = {}
            self._written = perf_counter()
            self._cost = self._written - start
