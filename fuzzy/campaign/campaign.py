"""Campaign: the samples of a plan, run by workers and kept in a store."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, field
from time import sleep

import numpy as np

from alphacut.fuzzy.campaign.call import Call, Failure, Outcome, Sample, named_point
from alphacut.fuzzy.campaign.dispatch import Task, completed
from alphacut.fuzzy.campaign.sample_store import Shelf
from alphacut.fuzzy.campaign.spot_check import RANDOM, SpotCheck, require_same
from alphacut.fuzzy.campaign.workers import require, submitted
from alphacut.fuzzy.counted import counted
from alphacut.fuzzy.knowledge.known import Known
from alphacut.fuzzy.samples.model import Layout, Values
from alphacut.fuzzy.sets.numbers import Array

Progress = Callable[[float], None]
_SHOWN = 5  # causes that a message quotes
_STEP, _NEARLY = 0.002, 0.99  # of what is left to this share each sample of a search does a part
_LONG = 300  # letters of an error that a message quotes
_POLL = 0.1  # seconds between two looks at what another campaign is running


class CampaignError(RuntimeError):
    """Some samples failed; the others were run.

    Args:
        failures: Inputs of each failed sample, by name, with its error.
        total: Samples of the campaign.
    """

    def __init__(self, failures: list[tuple[dict[str, float], str]], total: int) -> None:
        self.failures = failures
        self.total = total
        causes = _causes(failures)
        shown = "; ".join(causes[:_SHOWN])
        more = f"; and {len(causes) - _SHOWN} causes more" if len(causes) > _SHOWN else ""
        super().__init__(
            f"{len(failures)} of {counted(total, 'sample')} failed, the others are done:"
            f" {shown}{more}"
        )


def _causes(failures: list[tuple[dict[str, float], str]]) -> list[str]:
    """Causes of failures with their points, each told once."""
    places: dict[str, list[str]] = {}
    for point, error in failures:
        place = ", ".join(f"{name} = {value:.6g}" for name, value in point.items())
        places.setdefault(error, []).append(place)
    told = []
    for error, points in places.items():
        few, first = points if len(points) <= 2 else points[:1], error.strip().partition("\n")[0]
        line = first if first == error and len(first) <= _LONG else f"{first[:_LONG]} …"
        told += [f"at {point}: {line}" for point in few]
        told[-1] += f" (the same at {len(points) - 1} more)" if len(points) > 2 else ""
    return told


@dataclass
class Campaign:
    """Evaluates points of a model through workers: the `Model` that plans get.

    Args:
        call: The function with the way it is called.
        executor: Any `concurrent.futures` executor; None runs in this process.
        progress: Called with the share done, 0 … 1.
        known: What the caller knows about the model.
        shelf: Where samples are kept; None keeps none.
        runs: Samples run so far.
        reused: Samples taken from the store so far.
        calls: Calls of the function so far.
        stepwise: Whether the plan itself reports the share done, since it asks for its samples
            batch by batch.
        layout: Names and shapes of the outputs, as the first sample had them.
        spot_check: Runs some of the stored samples again; None runs none.
    """

    call: Call
    executor: Executor | None = None
    progress: Progress | None = None
    known: Known = field(default_factory=Known)
    shelf: Shelf | None = None
    runs: int = 0
    reused: int = 0
    calls: int = 0
    stepwise: bool = False
    layout: Layout = ()
    spot_check: SpotCheck | None = None
    _first: tuple[Array, Sample] | None = field(default=None, repr=False)
    _before: float = field(default=0.0, repr=False)
    _told: float = field(default=0.0, repr=False)

    def __call__(self, points: Array) -> Values:
        """Outputs at the points, shape (n, inputs), in their order.

        Raises:
            CampaignError: Samples failed; raised after all others have run.
            TooLargeError: The samples do not fit into memory.
            StoreError: The store cannot be written.
        """
        batch = _Batch(self, points)
        batch.run()
        if batch.failures:
            failed = [
                (named_point(self.call.names, points[row]), batch.failures[row])
                for row in sorted(batch.failures)
            ]
            raise CampaignError(failed, len(points))
        return Values(self.layout, batch.array)

    def randomness(self) -> str:
        """What the first sample gives when run again, if it differs: words, else nothing.

        One run more, which `calls` does not count, where it is within the spot check's share.
        """
        check = self.spot_check
        if self._first is None or check is None or self.runs * check.share < 1:
            return ""
        point, before = self._first
        fresh = submitted(self.executor, self.call, point[None]).result()[0]
        try:
            require_same(before, fresh, self.call.names, point, "one call gave", RANDOM)
        except ValueError as error:
            return str(error)
        return ""

    def report(self, share: float, *, last: bool = False) -> None:
        """Report the completed fraction, which never falls; `last` fills the rest."""
        if last:
            self.stepwise, self._before = False, share
        if self.progress and share > self._told:
            self._told = share
            self.progress(share)

    def report_batch(self, share: float) -> None:
        """Tell the share done of the batch under way."""
        if self.stepwise:  # how many samples are still to come, nobody knows
            self.report(self._told + _STEP * (_NEARLY - self._told))
        else:
            self.report(self._before + (1 - self._before) * share)


class _Batch:
    """One batch of points on its way through the workers and the store."""

    def __init__(self, campaign: Campaign, points: Array) -> None:
        require(len(points), points.shape[1] + 1)
        self.campaign, self.points = campaign, points
        self.array: Array = np.empty((len(points), 0))
        self.failures: dict[int, str] = {}
        self._open = np.ones(len(points), bool)
        self._left = len(points)

    def run(self) -> None:
        """Take what is stored, run the rest, wait for what other campaigns run."""
        self._check()
        while self._left:
            before = self._left
            for rows, outcomes in completed(
                self.campaign.call, self._tasks(), self.campaign.executor
            ):
                self._record(rows, outcomes)
            if self.campaign.shelf:
                self.campaign.shelf.write()
            if self._left == before:
                sleep(_POLL)

    def _tasks(self) -> Iterator[Task]:
        """Calls to be made, without samples that are stored or run elsewhere."""
        for group in self.campaign.call.tasks(self.points):
            if rows := self._mine([row for row in group if self._open[row]]):
                yield rows, self.points[rows]

    def _mine(self, rows: list[int]) -> list[int]:
        """The rows that this campaign is to run; those that are stored are taken."""
        shelf = self.campaign.shelf
        if shelf is None or not rows:
            return rows
        keys = {shelf.key(self.points[row]): row for row in rows}
        mine, stored = shelf.claim(list(keys))
        for key, sample in stored.items():
            self._take(keys[key], self._aligned(sample))
            self.campaign.reused += 1
        if stored:
            self._tell()
        return [row for key, row in keys.items() if key in mine]

    def _check(self) -> None:
        """Run some of the samples again that were stored before this campaign."""
        shelf, check = self.campaign.shelf, self.campaign.spot_check
        if shelf is None or check is None:
            return
        keys = {shelf.key(self.points[row]): row for row in range(len(self.points))}
        old = shelf.old(keys)
        rows = [keys[key] for key in old]
        before, found = check.runs, list(old)
        check.look(
            self.campaign.call,
            self.points[rows],
            np.array(list(old.values())),
            lambda row: shelf.stored([found[row]])[found[row]],
        )
        self.campaign.calls += check.runs - before

    def _record(self, rows: list[int], outcomes: list[Outcome]) -> None:
        self.campaign.calls += 1
        self.campaign.runs += len(rows)
        shelf = self.campaign.shelf
        for row, outcome in zip(rows, map(self._aligned, outcomes), strict=True):
            if shelf:
                shelf.gather(shelf.key(self.points[row]), outcome)
            if self.campaign._first is None and isinstance(outcome, Sample):
                self.campaign._first = self.points[row].copy(), outcome
            self._take(row, outcome)
        if shelf:
            shelf.write()
        self._tell()

    def _aligned(self, outcome: Outcome) -> Outcome:
        """The outcome with outputs in the first sample's order; a failure where they differ."""
        if isinstance(outcome, Sample):
            if not self.campaign.layout:
                self.campaign.layout = outcome.layout
                self.campaign.known.check_outputs(Values(outcome.layout, outcome.row[None]).columns)
            return _in_order(outcome, self.campaign.layout)
        return outcome

    def _take(self, row: int, outcome: Outcome) -> None:
        if isinstance(outcome, Failure):
            self.failures[row] = outcome.error
        else:
            if not self.array.shape[1]:
                require(len(self.points), self.points.shape[1] + len(outcome.row))
                self.array = np.empty((len(self.points), len(outcome.row)))
            self.array[row] = outcome.row
        self._open[row] = False
        self._left -= 1

    def _tell(self) -> None:
        self.campaign.report_batch(1 - self._left / len(self.points))


def _in_order(sample: Sample, layout: Layout) -> Outcome:
    """The sample with its outputs in the order of a layout."""
    if sample.layout == layout:
        return sample
    if sorted(sample.layout) != sorted(layout):
        got = f"a sample has the outputs {_named(sample.layout)} where others have {_named(layout)}"
        return Failure(
            f"ValueError: {got}; all must have the same names and shapes", sample.seconds
        )
    values = Values(sample.layout, sample.row[None])
    return sample._replace(
        layout=layout, row=np.concatenate([values.output(name).ravel() for name, _ in layout])
    )


def _named(layout: Layout) -> str:
    return ", ".join(f"{name} {list(shape)}" if shape else name for name, shape in layout)
