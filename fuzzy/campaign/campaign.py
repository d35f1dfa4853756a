"""Campaign: the samples of a method, run by workers and kept in a store."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import checked_number
from alphacut.fuzzy.campaign.call import (
    Call,
    CampaignError,
    Failure,
    Layout,
    Outcome,
    Sample,
    Samples,
    SpentError,
    Values,
    named_point,
)
from alphacut.fuzzy.campaign.store import Store, point_key
from alphacut.fuzzy.campaign.workers import Task, completed
from alphacut.fuzzy.knowledge.known import Knowledge
from alphacut.fuzzy.sets.boxes import Domain


@dataclass
class Campaign:
    """Samples of a model, evaluated by workers; every plan evaluates its points by one.

    Args:
        call: The function.
        knowledge: What the caller knows about the model.
        budget: Evaluations that are allowed.
        executor: Any `concurrent.futures` executor; None runs in this process.
        progress: Called with the completed fraction, 0 … 1.
        store: Where samples are kept; None keeps none.
        model: Key of the model in the store.

    Attributes:
        layout: Names and shapes of the outputs, as the first sample has them.

    Raises:
        RefusedError: The budget is no positive whole number, or a fact names no input.
    """

    call: Call
    knowledge: Knowledge = field(default_factory=Knowledge)
    budget: int = 10_000
    executor: Executor | None = None
    progress: Callable[[float], None] | None = None
    store: Store | None = None
    model: bytes = b""
    layout: Layout = ()
    _rows: dict[bytes, Array] = field(default_factory=dict)  # outputs by the bytes of the point
    _samples: Samples | None = None
    _reported: float = 0.0  # completed fraction

    def __post_init__(self) -> None:
        self.knowledge.check_inputs(self.call.names)
        checked_number("budget", self.budget, positive=True, whole=True)

    def __len__(self) -> int:
        """Evaluations so far, those from the store among them."""
        return len(self._rows)

    @property
    def remaining(self) -> int:
        """Evaluations that the budget still allows."""
        return self.budget - len(self)

    @property
    def samples(self) -> Samples:
        """All samples so far in the order of their first use, one or more: points and outputs.

        Raises:
            ValueError: Nothing has been evaluated yet, so that the number of inputs is unknown.
        """
        if self._samples is None:
            # A dictionary keeps the order in which its keys were added.
            points = np.frombuffer(b"".join(self._rows)).reshape(len(self), -1)
            values = Values(self.layout, np.array(list(self._rows.values())))
            self._samples = Samples(points, values)
        return self._samples

    def output_names(self, domain: Domain) -> tuple[str, ...]:
        """Evaluate the nominal point of the inputs, and return the names of all outputs.

        An output that is an array has a name for each entry, such as "s[0]". The names are in the
        order of the columns of the samples. The point becomes a sample of the campaign.

        Args:
            domain: Inputs, whose nominal values have the membership 1, in the order of the names
                of the function's inputs.

        Raises:
            SpentError: The budget is used up, and the point is not among the samples.
            CampaignError: The sample failed.
            RefusedError: The knowledge about the model names an output that it does not have.
            FailedError: The store cannot be written, or a worker process died.
        """
        return self(domain.nominal[None]).columns

    def __call__(self, points: Array) -> Values:
        """Return the outputs at some points, and keep them as samples of the campaign.

        Only points that this campaign has not evaluated before cost evaluations of the budget; a
        sample that the store holds from an earlier campaign costs one, too.

        Args:
            points: One or more points, one column for each input, shape (n, inputs). Equal points
                are evaluated once; −0 counts as 0.

        Returns:
            `Values`, whose `array` has a row for each of the points, in their order, and a column
            for each entry of each output, shape (n, columns).

        Raises:
            SpentError: New points exceed the budget; none of them is evaluated.
            CampaignError: Samples failed, or have other outputs than the first one. All other
                points are evaluated before it is raised. They are then in the store, if there is
                one, but not among the samples.
            RefusedError: The knowledge about the model names an output that it does not have.
            FailedError: The store cannot be written, or a worker process died.
        """
        keys = [point.tobytes() for point in points + 0.0]  # -0.0 + 0.0 is 0.0
        # A point that is asked for twice in one call is evaluated once.
        new_keys = [key for key in dict.fromkeys(keys) if key not in self._rows]
        if len(new_keys) > self.remaining:
            what = f"{len(self):,} evaluations are done, the next {len(new_keys):,} would pass"
            raise SpentError(f"{what} the budget of {self.budget:,}", "take a larger budget")
        if new_keys:
            rows = self._run(np.frombuffer(b"".join(new_keys)).reshape(len(new_keys), -1))
            self._rows |= dict(zip(new_keys, rows, strict=True))
            self._samples = None
        return Values(self.layout, np.array([self._rows[key] for key in keys]))

    def _run(self, points: Array) -> list[Array]:
        """Evaluate new points, shape (n, inputs), and return the outputs of each in their order.

        An item has a number for each entry of each output, shape (columns,). The samples of the
        campaign are not changed here; the store gets the successful ones.

        Raises:
            CampaignError: Samples failed; it names their inputs and errors, and is raised after all
                others have been evaluated.
            RefusedError: The knowledge about the model names an output that it does not have.
            FailedError: The store cannot be written, or a worker process died.
        """
        outcomes = _evaluate(self, points)
        logging.getLogger(__name__).debug("%d samples, %d before", len(points), len(self))
        failures = []
        outputs = []
        for row in range(len(points)):
            outcome = outcomes[row]
            if isinstance(outcome, Failure):
                failures.append((named_point(self.call.names, points[row]), outcome.error))
            else:
                outputs.append(outcome.row)
        if failures:
            cure = "mend the function, or narrow its inputs"
            raise CampaignError(failures, len(points), cure)
        return outputs

    def checked(self, outcome: Outcome) -> Outcome:
        """Return an outcome, or a failure in its place if its outputs differ from the first ones.

        The first successful sample decides: its names and shapes become `layout`, which is empty
        before. A later sample with another order, name or shape of outputs becomes a failure.

        Raises:
            RefusedError: The knowledge about the model states a sign for an output that the first
                sample does not have.
        """
        if isinstance(outcome, Failure) or outcome.layout == self.layout:
            return outcome
        if self.layout:
            return Failure(f"outputs are {outcome.layout} where others have {self.layout}")
        self.layout = outcome.layout
        # The names of the outputs are known from the first sample on, and no earlier. Facts are
        # checked then, before a proof rests on a misspelt name that restricts nothing.
        self.knowledge.check_outputs(Values(outcome.layout, outcome.row[None]).columns)
        return outcome

    def report(self, fraction: float) -> None:
        """Report the completed fraction, which never falls."""
        if self.progress and fraction > self._reported:
            self._reported = fraction
            self.progress(fraction)


def _tasks(call: Call, points: Array, *, stored: frozenset[int]) -> Iterator[Task]:
    """Yield the rows that each call evaluates, without the stored ones, and their points."""
    for rows in call.tasks(points):
        missing = [row for row in rows if row not in stored]
        if missing:
            yield missing, points[missing]


def _evaluate(campaign: Campaign, points: Array) -> dict[int, Outcome]:
    """Return the sample or the failure of each new point, from the store of samples or evaluated.

    Samples are written to the store while the others are evaluated, and at the latest when this
    function is left, also by an exception. Failures are not stored.

    Args:
        campaign: Its call (the function of the user) is evaluated by its executor. Its `layout`,
            the names and shapes of all outputs, is set by the first sample if it is still empty.
            Progress is reported during its first evaluation of several points. Its samples are not
            changed.
        points: Points that are not among the samples of the campaign, shape (n, inputs).

    Returns:
        For each row of the points a `Sample` (names, shapes and values of the outputs), or a
        `Failure` with the text of the error. A sample whose outputs have other names or shapes than
        the first sample becomes a failure.

    Raises:
        RefusedError: The campaign's knowledge names an output that the first sample does not have.
        FailedError: The store cannot be written, a worker process died, or the function cannot be
            sent to one.
    """
    outcomes: dict[int, Outcome] = {}
    keys: list[str] = []
    if campaign.store:
        keys = [point_key(campaign.call.names, point) for point in points]
        for row, key in enumerate(keys):
            # A stored sample counts for the budget as if it had been evaluated: so a resumed call
            # takes the same samples as one that ran through.
            sample = campaign.store.get(campaign.model, key)
            if sample:
                outcomes[row] = campaign.checked(sample)
    # The rows that each call evaluates, without those that the store has given.
    tasks = _tasks(campaign.call, points, stored=frozenset(outcomes))
    unwritten: dict[str, Sample] = {}
    last_write = perf_counter()
    write_seconds = 0.0
    try:
        for rows, results in completed(campaign.call, tasks, campaign.executor):
            for row, result in zip(rows, results, strict=True):
                outcome = campaign.checked(result)
                outcomes[row] = outcome
                if campaign.store and isinstance(outcome, Sample):
                    unwritten[keys[row]] = outcome
            # A transaction that took t seconds is not followed by another one within 10 t, nor
            # within 0.05 s, so that writing takes a tenth of the time at most.
            start = perf_counter()
            is_due = start - last_write > max(0.05, 10 * write_seconds)
            if campaign.store and unwritten and is_due:
                campaign.store.put(campaign.model, unwritten)
                unwritten = {}
                last_write = perf_counter()
                write_seconds = last_write - start
            # The first batch of a design is most of the work; later ones are not foreseen.
            if not len(campaign) and len(points) > 1:
                campaign.report(0.99 * len(outcomes) / len(points))
    finally:
        if campaign.store and unwritten:
            campaign.store.put(campaign.model, unwritten)
    return outcomes
