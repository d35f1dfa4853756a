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
_FORETOLD = 0.05  # share of the work from which the time left is told; less foretells nothing


def subprogress(progress: Progress | None, first: float, last: float) -> Progress:
    """Return a function that reports the progress of a part of a task, from `first` to `last`."""
    if progress is None:
        return lambda done: None
    return lambda done: progress(first + (last - first) * done)


@contextmanager
def progress_reporter(progress: Progress | bool | None) -> Iterator[Progress | None]:
    """Context with a function that reports the completed fraction, 0 to 1.

    Args:
        progress: The caller's function. None or True: a bar on a terminal, or a line every ten
            seconds where standard error is no terminal. False: nothing, and the value is None.
    """
    if callable(progress) or progress is False:
        yield progress if callable(progress) else None
        return
    bar = _Bar() if sys.stderr.isatty() else _Lines()
    try:
        yield bar
    finally:
        bar.close()


class _Bar:
    """Progress bar on a terminal; it appears after a second and is removed in the end."""

    def __init__(self) -> None:
        self.begun, self.moved = monotonic(), 0.0

    def __call__(self, share: float) -> None:
        now = monotonic()
        if now - self.begun >= _BAR_DELAY and now - self.moved >= _BAR_PERIOD:
            self.moved, full = now, round(_WIDTH * share)
            bar = "█" * full + "░" * (_WIDTH - full)
            _write(f"\r\x1b[K{bar} {share:4.0%} {now - self.begun:.0f} s")

    def close(self) -> None:
        if self.moved:
            _write("\r\x1b[K")


class _Lines:
    """Progress as a line every ten seconds, with the time left, for a file or a pipe."""

    def __init__(self) -> None:
        self.begun = self.written = monotonic()

    def __call__(self, share: float) -> None:
        now = monotonic()
        if now - self.written >= _LINE_PERIOD:
            self.written, elapsed = now, now - self.begun
            left = f", some {elapsed / share - elapsed:.0f} s left" if share >= _FORETOLD else ""
            _write(f"{share:4.0%} after {elapsed:.0f} s{left}\n")

    def close(self) -> None:
        """Lines stay."""


def _write(text: str) -> None:
    sys.stderr.write(text)
    sys.stderr.flush()
