"""Interruptions wait for the end of blocks that they would garble: PETSc, imports of DOLFINx."""

from __future__ import annotations

import ctypes
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

STOP_SIGNALS = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
"""Signals that end a program as Ctrl-C does, where the system has them."""


def end_on_second(number: int) -> None:
    """Lets a second signal end the process while the first waits for the end of compiled code.

    The C library's one-shot handler, where it has one, is that of Python for the first signal and
    the system's default after it.
    """
    library = ctypes.CDLL(None)
    if hasattr(library, "sysv_signal"):
        library.sysv_signal.restype = ctypes.c_void_p
        library.sysv_signal.argtypes = (ctypes.c_int, ctypes.c_void_p)
        handler = library.sysv_signal(number, int(signal.SIG_IGN))  # returns the one before
        library.sysv_signal(number, handler)


@contextmanager
def uninterrupted(*, second_ends: bool = False) -> Iterator[None]:
    """Context that delays Ctrl-C to its end, and restores the signal handlers there.

    With `second_ends` a second Ctrl-C, SIGTERM or SIGHUP ends the process at once.

    PETSc loses exceptions that Python raises below it; basix and DOLFINx abort while they are
    imported, and MPI replaces handlers. Does nothing outside the main thread.
    """
    handler_before, received = signal.getsignal(signal.SIGINT), list[int]()
    stop_handlers = {number: signal.getsignal(number) for number in STOP_SIGNALS}
    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or handler_before in (None, signal.SIG_DFL):
        yield
        return
    signal.signal(signal.SIGINT, lambda number, _: received.append(number))
    for number in [signal.SIGINT, *STOP_SIGNALS] if second_ends else []:
        end_on_second(number)
    try:
        yield
    finally:
        for number, handler in {signal.SIGINT: handler_before, **stop_handlers}.items():
            if handler is not None:
                signal.signal(number, handler)
        is_ignored = not callable(handler_before) and received[-1:] == [signal.SIGINT]
        if received and not is_ignored:
            interrupt = handler_before if callable(handler_before) else signal.default_int_handler
            interrupt(received[-1], None)
