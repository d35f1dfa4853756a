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
    """Let a second signal end the process while the first waits for the end of compiled code.

    The C library calls Python's handler for the first signal, and the system's default after it.
    What `signal.getsignal` returns stays. Nothing is changed if the C library has no `sysv_signal`.

    Args:
        number: Number of a signal, for which Python has a handler.
    """
    library = ctypes.CDLL(None)
    if hasattr(library, "sysv_signal"):
        library.sysv_signal.restype = ctypes.c_void_p
        library.sysv_signal.argtypes = (ctypes.c_int, ctypes.c_void_p)
        # The only way to learn the address of Python's handler is to replace it. A signal between
        # these two calls is lost.
        handler = library.sysv_signal(number, int(signal.SIG_IGN))  # returns the one before
        library.sysv_signal(number, handler)


@contextmanager
def uninterrupted(*, second_ends: bool = False) -> Iterator[None]:
    """Delay Ctrl-C to the end of a block, and restore the signal handlers there.

    PETSc loses exceptions that Python raises below it, an interrupted import of basix or DOLFINx
    aborts, and MPI replaces handlers. At the end of the block the last Ctrl-C that came meanwhile
    is passed to the handler from before, which by default raises KeyboardInterrupt; it is dropped
    if Ctrl-C was ignored before. Nothing is changed outside the main thread, or where Ctrl-C has
    the system's default handler or one that Python does not know.

    Args:
        second_ends: Whether a second Ctrl-C, SIGTERM or SIGHUP in the block ends the process at
            once.
    """
    handler_before = signal.getsignal(signal.SIGINT)
    stop_handlers = {number: signal.getsignal(number) for number in STOP_SIGNALS}
    in_main_thread = threading.current_thread() is threading.main_thread()
    # Python sets handlers in the main thread alone. Without a handler of Python, Ctrl-C ends the
    # process by itself, which cannot be delayed from here.
    if not in_main_thread or handler_before in (None, signal.SIG_DFL):
        yield
        return
    # A signal handler may only take notes: code below Python does not see its exceptions.
    received: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: received.append(number))
    if second_ends:
        for number in (signal.SIGINT, *STOP_SIGNALS):
            end_on_second(number)
    try:
        yield
    finally:
        # MPI, PETSc and DOLFINx may have replaced any of them.
        for number, handler in {signal.SIGINT: handler_before, **stop_handlers}.items():
            if handler is not None:
                signal.signal(number, handler)
        # The last signal is passed on, unless it was Ctrl-C and ignored before.
        is_ignored = not callable(handler_before) and received[-1:] == [signal.SIGINT]
        if received and not is_ignored:
            interrupt = handler_before if callable(handler_before) else signal.default_int_handler
            interrupt(received[-1], None)
