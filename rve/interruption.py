"""Ctrl-C, SIGTERM and SIGHUP end a program in order, and wait for the end of what they garble."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

ONCE = 1.0
"""Seconds within which signals count as one."""
_STOPS = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]


@contextmanager
def stoppable() -> Iterator[list[int]]:
    """Let SIGTERM and SIGHUP interrupt the block as Ctrl-C does; gives the number that came.

    Not again within `ONCE`: `timeout` and batch systems send one to a process and one to its group.
    What was ignored before, as under nohup, stays ignored.
    """
    main, came = threading.current_thread() is threading.main_thread(), list[int]()
    heard = [-ONCE]
    kept = {one: signal.getsignal(one) for one in _STOPS if main}
    kept = {one: how for one, how in kept.items() if how not in (None, signal.SIG_IGN)}

    def stop(number: int, frame: FrameType | None) -> None:
        came.append(number)
        pressed, now = signal.getsignal(signal.SIGINT), time.monotonic()
        if now - heard[0] >= ONCE:
            heard[0] = now
            (pressed if callable(pressed) else signal.default_int_handler)(number, frame)

    for one in kept:
        signal.signal(one, stop)
    try:
        yield came
    finally:
        for one, how in kept.items():
            signal.signal(one, how)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Hold Ctrl-C, and what stops as it does, back to the end of the block.

    PETSc loses what Python raises below it; basix and DOLFINx, while they are imported, abort, and
    MPI takes signals for itself.
    """
    before, held = signal.getsignal(signal.SIGINT), list[int]()
    others = {one: signal.getsignal(one) for one in _STOPS}
    main = threading.current_thread() is threading.main_thread()
    if not main or before in (None, signal.SIG_DFL):
        yield
        return
    signal.signal(signal.SIGINT, lambda number, _: held.append(number))
    try:
        yield
    finally:
        for one, how in {signal.SIGINT: before, **others}.items():
            if how is not None:
                signal.signal(one, how)
        if held and (callable(before) or held[-1] != signal.SIGINT):  # else ignored
            (before if callable(before) else signal.default_int_handler)(held[-1], None)
