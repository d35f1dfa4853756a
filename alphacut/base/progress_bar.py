"""Progress of a computation, reported to a function of the caller or shown on the terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

Progress = Callable[[float], None]
"""A function that takes the completed fraction of a computation, 0 to 1."""


def subprogress(progress: Progress | None, first: float, last: float) -> Progress:
    """Return a function that reports the progress of a part of a computation.

    Args:
        progress: Function for the whole computation; None reports nothing.
        first: Completed fraction of the whole at the beginning of the part.
        last: Completed fraction at its end.
    """
    if progress is None:
        return lambda done: None
    return lambda done: progress(first + (last - first) * done)


def nth_subprogress(progress: Progress | None, number: int, count: int) -> Progress:
    """Return a function that reports the progress of one of several equal parts, from 0."""
    return subprogress(progress, number / count, (number + 1) / count)


@contextmanager
def progress_reporter(progress: Progress | bool | None) -> Iterator[Progress | None]:
    """Give a context a function to report the completed fraction with.

    Several computations in a row may each report from 0 on; a fraction below the largest one so far
    is not passed on.

    Args:
        progress: Function of the caller. None or True shows a bar on the terminal, or writes a line
            every ten seconds if standard error is not a terminal. False reports nothing; then the
            context has None in place of a function.
    """
    if progress is False:
        yield None
        return
    if callable(progress):
        yield _rising(progress)
        return
    display = _Display()
    try:
        yield _rising(display)
    finally:
        display.close()


def _rising(progress: Progress) -> Progress:
    """Return a function that passes on the fractions that are larger than all before."""
    largest = -1.0

    def report(fraction: float) -> None:
        nonlocal largest
        if fraction > largest:
            largest = fraction
            progress(fraction)

    return report


class _Display:
    """A bar on a terminal, which `close` removes; elsewhere lines with the time that is left."""

    def __init__(self) -> None:
        self.is_terminal = sys.stderr.isatty()
        self.has_bar = False
        self.begun = monotonic()
        self.written = self.begun

    def __call__(self, fraction: float) -> None:
        """Show a completed fraction, if the last display was long enough ago."""
        pause = 10.0  # seconds between lines
        if self.is_terminal:
            pause = 0.2  # seconds between changes of a bar
        now = monotonic()
        elapsed = now - self.begun
        if elapsed < 1.0 or now - self.written < pause:
            return
        self.written = now
        if self.is_terminal:
            self.has_bar = True
            width = 30
            full = round(width * fraction)
            bar = "█" * full + "░" * (width - full)
            _write(f"\r\x1b[K{bar} {fraction:4.0%} {elapsed:.0f} s")
            return
        time_left = ""
        if fraction >= 0.05:  # before that the estimate would be of no use
            time_left = f", some {elapsed / fraction - elapsed:.0f} s left"
        _write(f"{fraction:4.0%} after {elapsed:.0f} s{time_left}\n")

    def close(self) -> None:
        """Remove the bar."""
        if self.has_bar:
            _write("\r\x1b[K")


def _write(text: str) -> None:
    """Write to standard error at once."""
    sys.stderr.write(text)
    sys.stderr.flush()
