"""Progress with the time left, on a terminal only."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from alphacut.io.files import rank

Tick = Callable[[float], None]


@contextmanager
def progress(title: str, *, quiet: bool = False) -> Iterator[Tick | None]:
    """A bar on standard error for a task that reports the fraction done, 0 … 1.

    Yields:
        The function to report to; None where nothing is to be shown: not on a terminal, not the
        first rank, or told to be quiet.
    """
    if quiet or rank() or not sys.stderr.isatty():
        yield None
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
