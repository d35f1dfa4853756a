"""Progress of a computation: reported to the caller, or as a bar on a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

Progress = Callable[[float], None]
_WAIT = 1.0  # seconds before a bar appears
_EVERY = 0.2  # seconds between its moves
_LINES = 10.0  # seconds between lines where there is no terminal
_WIDTH = 30


def share(progress: Progress | None, first: float, last: float) -> Progress:
    """Progress of a part of a task, from `first` to `last` of the whole."""
    if progress is None:
        return lambda done: None
    return lambda done: progress(first + (last - first) * done)


@contextmanager
def showing(progress: Progress | bool | None) -> Iterator[Progress | None]:
    """Function that the share done goes to.

    Args:
        progress: The caller's function; None (or True) for a bar on a terminal, and a line now and
            then where standard error is none; False for nothing.
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
    """A bar that appears if it is still wanted after a second, and leaves nothing behind."""

    def __init__(self) -> None:
        self.begun, self.moved = monotonic(), 0.0

    def __call__(self, share: float) -> None:
        now = monotonic()
        if now - self.begun >= _WAIT and now - self.moved >= _EVERY:
            self.moved, full = now, round(_WIDTH * share)
            bar = "█" * full + "░" * (_WIDTH - full)
            _on_terminal(f"{bar} {share:4.0%} {now - self.begun:.0f} s")

    def close(self) -> None:
        """Remove the bar."""
        if self.moved:
            _on_terminal("")


class _Lines:
    """A line every ten seconds, with the end that is foreseen, for a file or a pipe."""

    def __init__(self) -> None:
        self.begun = self.written = monotonic()

    def __call__(self, share: float) -> None:
        now = monotonic()
        if now - self.written >= _LINES:
            self.written, spent = now, now - self.begun
            left = f", some {spent / share - spent:.0f} s left" if share > 0 else ""
            sys.stderr.write(f"{share:4.0%} after {spent:.0f} s{left}\n")
            sys.stderr.flush()

    def close(self) -> None:
        """Nothing is left behind."""


def _on_terminal(text: str) -> None:
    sys.stderr.write(f"\r\x1b[K{text}")
    sys.stderr.flush()
