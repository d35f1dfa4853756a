"""SIGTERM and SIGHUP end a command as Ctrl-C does: one line, what was finished kept, no orphans."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from alphacut.entry import COMMANDS, main
from alphacut.rve import interruption
from alphacut.rve.interruption import stoppable

ROOT = Path(__file__).parents[3]
PAPER = str(ROOT / "cases" / "paper.toml")
ENDED = {"SIGTERM": 143, "SIGHUP": 129}


@contextmanager
def started(command, **streams):
    """A command in a group of its own, of which nothing is left, whatever happens in the block."""
    with subprocess.Popen(command, stderr=-1, cwd=ROOT, start_new_session=True, **streams) as job:
        try:
            yield job
        finally:
            with suppress(ProcessLookupError):
                os.killpg(job.pid, signal.SIGKILL)


def members(group):
    """Processes of a group that still run, but for those that only wait to be counted."""
    listed = subprocess.run(["ps", "-eo", "pgid=,stat="], capture_output=True, text=True)
    rows = [line.split() for line in listed.stdout.splitlines()]
    return sum(row[0] == str(group) and not row[1].startswith("Z") for row in rows)


@pytest.mark.parametrize(
    ("name", "whole"), [("SIGTERM", False), ("SIGTERM", True), ("SIGHUP", True)]
)
def test_a_campaign_keeps_its_samples_and_ends_its_workers(name, whole, tmp_path):
    store = tmp_path / "s.db"
    words = ["modulus", PAPER, "--method", "prism", "--workers", "2", "--store", str(store)]
    command = [sys.executable, "-m", "alphacut", *words, "--set", "mesh.size=0.1", "--quiet"]
    with started(command) as campaign:
        before = time.monotonic()
        while not (store.exists() and store.stat().st_size > 4000):
            assert campaign.poll() is None
            assert time.monotonic() < before + 100
            time.sleep(0.05)
        for _ in range(2):  # as timeout sends it
            (os.killpg if whole else os.kill)(campaign.pid, getattr(signal, name))
        told = campaign.communicate(timeout=60)[1].decode()
    kept = f"what was finished is kept in {store}, and the same command goes on from there"
    assert campaign.returncode == ENDED[name]
    assert told.startswith(f"alphacut: ended by {name}; {kept}\n")
    # a worker that has just begun may be ended by the signal itself: loky's tracker warns of that
    rest = told.splitlines()[1:]
    assert all("resource_tracker" in line or "warnings.warn" in line for line in rest), told
    while members(campaign.pid):
        assert time.monotonic() < before + 120
        time.sleep(0.05)


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_each_has_its_status_and_is_handled_no_longer_afterwards(name, monkeypatch, capfd):
    number = getattr(signal, name)

    def ended(*_, **__):
        os.kill(os.getpid(), number)
        os.kill(os.getpid(), number)

    monkeypatch.setattr(COMMANDS["check"], "load", ended)
    before = signal.getsignal(number)
    assert main(["check", PAPER]) == ENDED[name]
    assert signal.getsignal(number) == before
    assert capfd.readouterr().err == f"alphacut: ended by {name}; nothing is kept\n"


def test_what_nohup_ignores_stays_ignored(monkeypatch, capfd):
    load = COMMANDS["check"].load

    def hung_up(*words, **others):
        os.kill(os.getpid(), signal.SIGHUP)
        return load(*words, **others)

    monkeypatch.setattr(COMMANDS["check"], "load", hung_up)
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert main(["check", PAPER]) == 0, capfd.readouterr().err
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_signal_that_python_drops_is_heard_when_it_comes_again(monkeypatch):
    monkeypatch.setattr(interruption, "ONCE", 0.2)

    class Dropped:
        def __del__(self):
            os.kill(os.getpid(), signal.SIGTERM)
            signal.getsignal(signal.SIGINT)  # the handler runs here, where nobody catches it

    with stoppable() as came:
        Dropped()
        os.kill(os.getpid(), signal.SIGTERM)
        assert len(came) == 2  # as one
        time.sleep(0.3)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
