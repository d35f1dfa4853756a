"""Ctrl-C while PETSc works: it waits for the end of the block, and is neither lost nor garbled."""

import os
import signal
import threading

import pytest

from alphacut.rve.interruption import uninterrupted


def interrupt():
    os.kill(os.getpid(), signal.SIGINT)


@pytest.fixture(autouse=True)
def handler():
    """Python's own handler, which a test must leave as it found it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    after = signal.signal(signal.SIGINT, before)
    assert after is signal.default_int_handler


def test_an_interruption_waits_for_the_end_of_the_block():
    done = []

    @uninterrupted()
    def block():
        interrupt()
        done.append("block")

    with pytest.raises(KeyboardInterrupt):
        block()
    assert done == ["block"]


def test_an_interruption_goes_before_the_error_of_its_block():
    @uninterrupted()
    def block():
        interrupt()
        raise RuntimeError("stopped early")

    with pytest.raises(KeyboardInterrupt):
        block()


def test_other_threads_leave_the_handler_alone():
    seen = []

    def work():
        with uninterrupted():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [signal.default_int_handler]


def test_who_ignores_interruptions_goes_on_ignoring_them():
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with uninterrupted():
            interrupt()
    finally:
        assert signal.signal(signal.SIGINT, signal.default_int_handler) == signal.SIG_IGN
