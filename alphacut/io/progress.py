"""Progress with the time left: a bar on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from alphacut.io.files import rank, say

Tick = Callable[[float], None]
EVERY = 10.0
"""Seconds from one line to the next where there is no terminal."""

LATE = 0.95  # done: twice a time left that is told then is held to
UNKNOWN = "the last part takes longer than foreseen, and its end is not known"


@contextmanager
def progress(title: str, *, quiet: bool = False) -> Iterator[Tick | None]:
    """A bar on standard error for a task that reports the fraction done, 0 … 1.

    Where standard error is no terminal, a line every `EVERY` seconds takes its place.

    Yields:
        The function to report to; None where nothing is to be shown: not the first rank, or told
        to be quiet.
    """
    if quiet or rank():
        yield None
        return
    if not sys.stderr.isatty():
        yield Lines(title)
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(
        *columns,
        TextColumn("spent"),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        transient=True,
    ) as bar:
        task = bar.add_task(title, total=1.0)
        yield lambda done: bar.update(task, completed=done)


class Lines:
    """Says the share done and the seconds left every `EVERY` seconds, and what is being done."""

    def __init__(self, title: str) -> None:
        self.title = self.doing = title
        self.begun = self.told = self.since = time.monotonic()
        self.promised = math.inf

    def stage(self, what: str) -> None:
        """What is being done from now on; what follows in parentheses is said once."""
        self.doing, self.since = f"{self.title}, {what}", time.monotonic()
        self.promised = math.inf

    def __call__(self, done: float) -> None:
        """Say it, if the last line is old enough."""
        now = time.monotonic()
        if now - self.told < EVERY:
            return
        self.told = now
        say(f"{self.doing}: {self._reached(done, now)}")
        self.doing = self.doing.partition(" (")[0]

    def _reached(self, done: float, now: float) -> str:
        spent = now - self.begun
        if done < 0.005:
            return f"begun, {spent:.0f} s so far"
        left = (now - self.since) * (1 - done) / done
        if now > self.promised:
            return f"{done:.0%} done after {spent:.0f} s; {UNKNOWN}"
        self.promised = min(self.promised, now + 2 * left) if done >= LATE else math.inf
        return f"{done:.0%} done after {spent:.0f} s, some {left:.0f} s left"
