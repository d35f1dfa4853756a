"""Ctrl-C, SIGTERM and SIGHUP end a command in order."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from alphacut.rve.interruption import STOP_SIGNALS

SAME_SIGNAL_SECONDS = 1.0
"""Signals within this time count as one: batch systems signal a process and then its group."""


@contextmanager
def stoppable() -> Iterator[list[int]]:
    """Lets SIGTERM and SIGHUP interrupt the block as Ctrl-C does; yields the numbers received.

    What was ignored before, as under nohup, stays ignored.
    """
    is_main = threading.current_thread() is threading.main_thread()
    received, last_time = list[int](), [-SAME_SIGNAL_SECONDS]
    handlers = {number: signal.getsignal(number) for number in STOP_SIGNALS if is_main}
    handlers = {
        k: handler for k, handler in handlers.items() if handler not in (None, signal.SIG_IGN)
    }

    def stop(number: int, frame: FrameType | None) -> None:
        received.append(number)
        interrupt, now = signal.getsignal(signal.SIGINT), time.monotonic()
        if now - last_time[0] >= SAME_SIGNAL_SECONDS:
            last_time[0] = now
            (interrupt if callable(interrupt) else signal.default_int_handler)(number, frame)

    for number in handlers:
        signal.signal(number, stop)
    try:
        yield received
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
