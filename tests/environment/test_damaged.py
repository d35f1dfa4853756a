"""Damaged files of every format neither end a process nor take much memory or time."""

import mmap
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from alphacut.fuzzy import RefusedError
from tests.environment import damaged
from tests.environment.damaged import HEAD, Format, outcome_of


@pytest.mark.slow
def test_damaged_files_of_every_format_are_read_or_refused(rng):
    """A few of each; `python -m tests.environment.damaged` damages a hundred of each."""
    pytest.importorskip("tifffile")
    command = [sys.executable, "-m", "tests.environment.damaged", "--count", "3"]
    command += ["--seed", str(rng.integers(1 << 31))]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.startswith(HEAD)
    assert len(run.stdout.splitlines()) > 50


def refuse(_):
    raise RefusedError("file", "damaged", "sound files")


@pytest.mark.parametrize(
    ("read", "failure"),
    [
        (refuse, ""),
        (lambda path: path.read_bytes(), ""),
        (lambda _: os.kill(os.getpid(), signal.SIGKILL), "signal 9"),
        (lambda _: os.kill(os.getpid(), signal.SIGALRM), "more than 20 s"),
        (lambda _: [][1], "exit status 4"),
        (lambda _: bytes(1 << 40), " MB"),
    ],
)
def test_each_end_of_a_process_is_told(tmp_path, rng, read, failure):
    """Readers that fail in each way, in the processes of their own alone."""

    def read_damaged(path):
        return None if os.getpid() == parent else read(path)

    parent = os.getpid()
    write = damaged.bytes_to("file.txt", lambda: b"1 2 3")

    outcome = outcome_of(Format("made up", write, read_damaged), 3, rng, Path(tmp_path, "a"))
    assert len(outcome.failures) == (3 if failure else 0)
    assert all(failure in words for words in outcome.failures)


def test_a_process_that_takes_much_memory_is_told(tmp_path, rng, monkeypatch):
    """What it takes itself, beside the memory that its parent holds."""

    def take(size):
        if os.getpid() == parent or not size:
            return
        # a mapping of its own is new memory, where malloc may hand out what the parent has freed
        with mmap.mmap(-1, size) as memory:
            for page in range(0, size, mmap.PAGESIZE):
                memory[page] = 1

    parent = os.getpid()
    monkeypatch.setattr(damaged, "MOST_MEGABYTES", 50.0)
    write = damaged.bytes_to("file.txt", lambda: b"1 2 3")
    held = b"x" * 100_000_000
    for size, n_failures in ((0, 0), (100_000_000, 2)):
        form = Format("made up", write, lambda _, size=size: take(size))
        outcome = outcome_of(form, 2, rng, Path(tmp_path, str(size)))
        assert len(outcome.failures) == n_failures, outcome
        assert all(" MB" in words for words in outcome.failures)
    assert len(held) == 100_000_000
