"""Progress of a computation: a bar on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from alphacut.fuzzy.progress_bar import showing
from alphacut.io.files import rank, say

Tick = Callable[[float], None]
EVERY = 20.0
"""Seconds from one line to the next where there is no terminal."""


@contextmanager
def progress(title: str, *, quiet: bool = False) -> Iterator[Tick | None]:
    """A bar on standard error, or lines, for a task that reports the fraction done, 0 … 1.

    Yields:
        The function to report to; None where nothing is to be shown.
    """
    lines = None if quiet or sys.stderr.isatty() else _lines(title)
    with showing(False if quiet or rank() else lines) as tick:
        yield tick


def _lines(title: str) -> Tick:
    """A function that says the share done and, at the present pace, left, every `EVERY` seconds."""
    begun = last = time.monotonic()
    before = 0.0

    def tick(done: float) -> None:
        nonlocal last, before
        now = time.monotonic()
        if now - last < EVERY or not max(before, 0.005) < done < 1:
            return
        left = f", about {(1 - done) * (now - last) / (done - before):.0f} s left"
        last, before = now, done
        say(f"{title}: {done:.0%} done after {now - begun:.0f} s" + left * (done > 0.05))

    return tick
