"""Progress of a computation, reported to a function of the caller or shown on the terminal."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

from alphacut.base.kernels import before_compiling

REPEAT = 1.0
"""Seconds between two looks at whether something was shown."""
Progress = Callable[[float], None]
"""A function that takes the completed fraction of a computation, 0 to 1."""


class EnoughError(Exception):
    """What a progress function raises to end a search that can answer with what it knows.

    The proof of a yielding storey can while it bisects; others let it pass.
    """


class Foretold(float):
    """A completed fraction, with the time in s that is left of the stage it belongs to.

    Attributes:
        seconds_left: The time, or None where it cannot be foretold.
    """

    seconds_left: float | None = None

    def __new__(cls, fraction: float, seconds_left: float | None) -> Foretold:
        """Return the fraction with its time."""
        told = super().__new__(cls, fraction)
        told.seconds_left = seconds_left
        return told


def foretelling(progress: Progress) -> Progress:
    """Return a function that takes the completed fraction of a stage, and adds the time left of it.

    A time is told from a fifth of the way on, of a stage that went on evenly so far: the first half
    of what is completed took 35 % to 65 % of the time since now. Of a fraction that is `Foretold`
    already nothing is added.

    Args:
        progress: Takes fractions with times.
    """
    begun = monotonic()
    course = [(0.0, 0.0)]  # completed fractions and the s after which they were reported

    def report(done: float) -> None:
        if isinstance(done, Foretold):
            progress(done)
            return
        elapsed = monotonic() - begun
        if done > course[-1][0]:
            course.append((done, elapsed))
        # Reports before and after half of it was done: of a coarse course they are far apart.
        before = max(seconds for fraction, seconds in course if fraction <= done / 2)
        after = min(seconds for fraction, seconds in course if fraction >= done / 2)
        is_even = done >= 0.2 and 0.35 * elapsed <= before <= after <= 0.65 * elapsed
        progress(Foretold(done, elapsed / done - elapsed if is_even else None))

    return report


def is_enough(progress: Progress, done: float) -> bool:
    """Report a completed fraction, and return whether the search should end; see `EnoughError`."""
    try:
        progress(done)
    except EnoughError:
        return True
    return False


def searching(progress: Progress | None) -> Progress:
    """Return a function that takes the completed fraction of a search, which foretells no time.

    The work of a proof by sub-boxes, and whether another method follows, shows at its end alone.
    """
    if progress is None:
        return lambda done: None
    return lambda done: progress(Foretold(done, None))


def subprogress(progress: Progress | None, first: float, last: float) -> Progress:
    """Return a function that takes the completed fraction of a part, and reports it for the whole.

    Args:
        progress: Function that takes the completed fraction of the whole computation, 0 to 1; with
            None nothing is reported.
        first: Completed fraction of the whole at the beginning of the part.
        last: Completed fraction at its end.
    """
    if progress is None:
        return lambda done: None

    def report(done: float) -> None:
        fraction = first + (last - first) * done
        if isinstance(done, Foretold):
            fraction = Foretold(fraction, done.seconds_left)
        progress(fraction)

    return report


def nth_subprogress(progress: Progress | None, number: int, count: int) -> Progress:
    """Return a function that reports the progress of one of several equal parts, from 0."""
    return subprogress(progress, number / count, (number + 1) / count)


@contextmanager
def progress_reporter(progress: Progress | bool | None) -> Iterator[Progress | None]:
    """Yield a function with which the block reports the completed fraction, 0 to 1.

    Several computations in a row may each report from 0 on; a fraction that is not above the
    largest one so far is not passed on. A bar is removed when the block ends, also by an exception.

    Args:
        progress: Function of the caller that takes the completed fraction. None or True shows a bar
            on the terminal, or writes a line every eight seconds if standard error is not a
            terminal, also while the block reports nothing.
            False reports nothing; then None is yielded in place of a function.
    """
    has_stream = sys.stderr is not None  # it may have been closed before Python began
    if progress is False or not (callable(progress) or has_stream):
        yield None
        return
    if callable(progress):
        yield _rising(progress)
        return
    display = _Display()
    before_compiling.append(display.show_compiling)
    try:
        yield foretelling(_rising(display))
    finally:
        before_compiling.remove(display.show_compiling)
        display.close()


def _rising(progress: Progress) -> Progress:
    """Return a function that passes a fraction on to `progress` if it is larger than all before."""
    largest = -1.0

    def report(fraction: float) -> None:
        nonlocal largest
        if fraction > largest:
            largest = fraction
            progress(fraction)

    return report


class _Display:
    """A bar on a terminal, which `close` removes; elsewhere lines with the time that is left.

    A thread shows the last fraction again, with the time that has passed, while nothing is
    reported: who waits sees that the computation goes on.

    Attributes:
        is_terminal: Whether standard error is a terminal.
        has_bar: Whether a bar stands there.
        begun: Time at which this was made, in s of a clock that never goes back.
        written: Time of the last display.
        fraction: Completed fraction, 0 to 1.
        end_of_stage: Time at which the present stage is foretold to end.
        told_until: Time until which that is said, unless a further fraction comes: two thirds of
            the way to the end, for a stage that stands still is not about to end.
        turn: Held by the thread that shows.
        ended: Set by `close`.
    """

    def __init__(self) -> None:
        self.is_terminal = sys.stderr.isatty()
        self.has_bar = False
        self.begun = monotonic()
        self.written = self.begun
        self.fraction = 0.0
        self.end_of_stage = self.told_until = self.begun
        self.turn = threading.Lock()
        self.ended = threading.Event()
        threading.Thread(target=self._repeat, daemon=True).start()

    def _repeat(self) -> None:
        """Show the last fraction again where nothing was shown for long, until the end."""
        while not self.ended.wait(REPEAT):
            self(self.fraction)

    def __call__(self, fraction: float) -> None:
        """Show a completed fraction, 0 to 1, unless something was shown just before.

        The time that is left stands behind it, where it is foretold.
        """
        time_left = ""
        if isinstance(fraction, Foretold) and fraction.seconds_left is not None:
            now = monotonic()
            if fraction is not self.fraction:
                self.end_of_stage = now + fraction.seconds_left
                self.told_until = now + 2 * fraction.seconds_left / 3
            if now <= self.told_until:
                seconds = max(self.end_of_stage - now, 1.0)
                time_left = f"some {seconds:.0f} s left of this stage"
        self.fraction = fraction
        self._show(time_left)

    def show_compiling(self) -> None:
        """Say that a kernel is being compiled, unless something was shown just before."""
        self._show("compiling, once")

    def _show(self, note: str) -> None:
        """Show the completed fraction on standard error, unless one was shown just before.

        On a terminal (`is_terminal`) a bar is drawn over the last one, at most five times a second.
        Elsewhere a line is written, at most every eight seconds. Nothing is shown during the first
        second, nor while another thread shows something. The time of the display is kept in
        `written`, and that there is a bar in `has_bar`.

        Args:
            note: What stands behind the time.
        """
        pause = 8.0  # seconds between lines
        if self.is_terminal:
            pause = 0.2  # seconds between changes of a bar
        now = monotonic()
        elapsed = now - self.begun
        if elapsed < 1.0 or now - self.written < pause or not self.turn.acquire(blocking=False):
            return
        try:
            self.written = now
            self._write_line(f"{self.fraction:4.0%} after {elapsed:.0f} s", note)
        finally:
            self.turn.release()

    def _write_line(self, fraction: str, note: str) -> None:
        """Write the completed fraction with its time, and a note, as a bar or a line."""
        line = f"{fraction}, {note}" if note else fraction
        if not self.is_terminal:
            _write(f"{line}\n")
            return
        self.has_bar = True
        full = round(30 * self.fraction)
        _write(f"\r\x1b[K{'█' * full:░<30} {line}")

    def close(self) -> None:
        """Remove the bar, and end its thread."""
        self.ended.set()
        if self.has_bar:
            _write("\r\x1b[K")


def _write(text: str) -> None:
    """Write to standard error at once."""
    sys.stderr.write(text)
    sys.stderr.flush()
