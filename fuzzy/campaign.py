"""A campaign: the samples of a plan, grouped into calls, run by workers, gathered in the order of the points."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, field

import numpy as np

from fuzzy.call import Call, Failure, named_point
from fuzzy.known import Known
from fuzzy.model import Layout, Values
from fuzzy.numbers import Array
from fuzzy.workers import completed

Progress = Callable[[float], None]
_SHOWN = 5  # failed samples that a message quotes


class CampaignError(RuntimeError):
    """Some samples failed; the others were run.

    Args:
        failures: Inputs of each failed sample, by name, with its error.
        total: Samples of the campaign.
    """

    def __init__(self, failures: list[tuple[dict[str, float], str]], total: int) -> None:
        self.failures = failures
        self.total = total
        shown = "; ".join(f"at {_point(point)}: {error}" for point, error in failures[:_SHOWN])
        more = f"; and {len(failures) - _SHOWN} more" if len(failures) > _SHOWN else ""
        super().__init__(f"{len(failures)} of {total} samples failed, the others are done: {shown}{more}")


def _point(point: dict[str, float]) -> str:
    return ", ".join(f"{name} = {value:.6g}" for name, value in point.items())


@dataclass
class Campaign:
    """Evaluates points of a model through workers: the `Model` that plans get.

    Args:
        call: The function with the way it is called.
        executor: Any `concurrent.futures` executor; None runs in this process.
        progress: Called with the share done, 0 … 1, of each batch of points.
        known: What the caller knows about the model.
        runs: Samples run so far.
        calls: Calls of the function so far.
    """

    call: Call
    executor: Executor | None = None
    progress: Progress | None = None
    known: Known = field(default_factory=Known)
    runs: int = 0
    calls: int = 0
    _layout: Layout | None = field(default=None, repr=False)

    def __call__(self, points: Array) -> Values:
        """Outputs at the points, shape (n, inputs), in their order.

        Raises:
            CampaignError: Samples failed; raised after all others have run.
        """
        rows: list[Array | None] = [None] * len(points)
        failures: dict[int, str] = {}
        done = 0
        tasks = ((task, points[task]) for task in self.call.tasks(points))
        for task, outcomes in completed(self.call, tasks, self.executor):
            self.calls += 1
            for row, outcome in zip(task, outcomes, strict=True):
                if isinstance(outcome, Failure):
                    failures[row] = outcome.error
                else:
                    self._require_layout(outcome.layout)
                    rows[row] = outcome.row
            done += len(task)
            if self.progress:
                self.progress(done / len(points))
        self.runs += done
        if failures:
            named = [(named_point(self.call.names, points[row]), failures[row]) for row in sorted(failures)]
            raise CampaignError(named, len(points))
        return Values(self._layout or (), np.array(rows))

    def _require_layout(self, layout: Layout) -> None:
        if self._layout is None:
            self._layout = layout
        if layout != self._layout:
            raise ValueError(f"a sample has the outputs {layout} where others have {self._layout}; all must have the same names and shapes")
