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
    """Lets SIGTERM and SIGHUP interrupt the block as Ctrl-C does; ignored ones stay so (nohup).

    Yields:
        The list of the signal numbers received, which grows while the block runs.
    """
    received, last_time = list[int](), -SAME_SIGNAL_SECONDS
    is_main = threading.current_thread() is threading.main_thread()  # others may set no handlers
    handlers = {number: signal.getsignal(number) for number in STOP_SIGNALS if is_main}
    previous = {k: x for k, x in handlers.items() if x not in (None, signal.SIG_IGN)}

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal last_time
        received.append(number)
        interrupt, now = signal.getsignal(signal.SIGINT), time.monotonic()
        if now - last_time >= SAME_SIGNAL_SECONDS:
            last_time = now
            (interrupt if callable(interrupt) else signal.default_int_handler)(number, frame)

    for number in previous:
        signal.signal(number, stop)
    try:
        yield received
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
