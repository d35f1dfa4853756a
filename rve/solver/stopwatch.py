"""Wall time by stage of a solve."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter

STAGES = ("mesh", "assemble", "setup", "solve", "total", "jit")


class Stopwatch:
    """Adds up wall time by stage."""

    def __init__(self) -> None:
        self.seconds = dict.fromkeys(STAGES, 0.0)

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Add the time of the block to `stage`."""
        started = perf_counter()
        try:
            yield
        finally:
            self.seconds[stage] = self.seconds.get(stage, 0.0) + perf_counter() - started

    def shift(self, source: str, target: str, seconds: float) -> None:
        """Book `seconds` under another stage."""
        self.seconds[source] -= seconds
        self.seconds[target] += seconds

    def report(self) -> dict[str, float]:
        """Seconds by stage, just-in-time compilation left out."""
        self.seconds["total"] = sum(self.seconds[s] for s in ("mesh", "assemble", "setup", "solve"))
        report, self.seconds = self.seconds, dict.fromkeys(STAGES, 0.0)
        return report
