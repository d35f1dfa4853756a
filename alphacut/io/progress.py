"""Progress with the time left: a bar on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from alphacut.io.files import rank, say

Tick = Callable[[float], None]
EVERY = 10.0
"""Seconds from one line to the next where there is no terminal."""


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
        yield lines(title)
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


def lines(title: str) -> Tick:
    """What says the share done and the seconds left, every `EVERY` seconds that it is called."""
    begun = told = time.monotonic()

    def tick(done: float) -> None:
        nonlocal told
        now = time.monotonic()
        if now - told >= EVERY:
            told, spent = now, now - begun
            left = f", some {spent * (1 - done) / done:.0f} s left" if done > 0 else ""
            say(f"{title}: {done:.0%} done after {spent:.0f} s{left}")

    return tick
