"""Progress of a computation: reported to the caller, or as a bar on a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

Progress = Callable[[float], None]
_BAR_DELAY = 1.0  # seconds before a bar appears
_BAR_PERIOD = 0.2  # seconds between its updates
_LINE_PERIOD = 10.0  # seconds between lines where there is no terminal
_WIDTH = 30  # letters of the bar
_FORETOLD = 0.05  # fraction of the work from which on the time left is told


def subprogress(progress: Progress | None, first: float, last: float) -> Progress:
    """Return a function that reports the progress of a part of a task, from `first` to `last`."""
    if progress is None:
        return lambda done: None
    return lambda done: progress(first + (last - first) * done)


@contextmanager
def progress_reporter(progress: Progress | bool | None) -> Iterator[Progress | None]:
    """Context with a function that reports the completed fraction, 0 to 1, and never a smaller one.

    Several computations in a row may each report from 0 on; what is below the largest fraction so
    far is not passed on.

    Args:
        progress: The caller's function. None or True: a bar on a terminal, or a line every ten
            seconds where standard error is no terminal. False: nothing, and the value is None.
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
    """A bar on a terminal, removed in the end; elsewhere a line now and then with the time left."""

    def __init__(self) -> None:
        self.is_terminal, self.has_bar = sys.stderr.isatty(), False
        self.begun = self.written = monotonic()

    def __call__(self, fraction: float) -> None:
        now = monotonic()
        elapsed, pause = now - self.begun, _BAR_PERIOD if self.is_terminal else _LINE_PERIOD
        if elapsed < _BAR_DELAY or now - self.written < pause:
            return
        self.written, self.has_bar = now, self.is_terminal
        if self.is_terminal:
            full = round(_WIDTH * fraction)
            bar = "█" * full + "░" * (_WIDTH - full)
            _write(f"\r\x1b[K{bar} {fraction:4.0%} {elapsed:.0f} s")
            return
        left = f", some {elapsed / fraction - elapsed:.0f} s left" if fraction >= _FORETOLD else ""
        _write(f"{fraction:4.0%} after {elapsed:.0f} s{left}\n")

    def close(self) -> None:
        if self.has_bar:
            _write("\r\x1b[K")


def _write(text: str) -> None:
    sys.stderr.write(text)
    sys.stderr.flush()
