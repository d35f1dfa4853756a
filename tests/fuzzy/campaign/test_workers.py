"""Functions that workers run: of a file, of a script without a guard, typed in, of a notebook."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from threading import Lock

import pytest

from alphacut.fuzzy import Triangular
from alphacut.fuzzy.campaign.workers import pool
from tests.fuzzy.general import propagate

ROOT = Path(__file__).parents[3]
SCRIPT = """
from alphacut.fuzzy import Triangular, propagate

def model(x, y):
    return x * y

{guard}
    print(propagate(model, {{"x": Triangular(0, 1, 2), "y": Triangular(1, 2, 4)}}, workers=2).bounds()[1][0])
"""
GUARDED = SCRIPT.format(guard='if __name__ == "__main__":')
BARE = SCRIPT.format(guard="if True:")


def run(*words, text=None, folder=ROOT):
    environment = {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"}
    return subprocess.run(
        [sys.executable, *words],
        input=text,
        capture_output=True,
        text=True,
        timeout=60,
        cwd=folder,
        env=environment,
        check=False,
    )


@pytest.mark.parametrize("text", [GUARDED, BARE], ids=["guarded", "bare"])
def test_a_script_runs_with_a_guard_or_without(text, tmp_path):
    (tmp_path / "script.py").write_text(text)
    assert run("script.py", folder=tmp_path).stdout == "8.0\n"


@pytest.mark.parametrize("words", [("-",), ("-c", BARE)], ids=["standard input", "typed in"])
def test_a_function_without_a_file_runs(words):
    assert run(*words, text=BARE).stdout == "8.0\n"


def test_a_function_inside_a_function_runs():
    offset = 1.0
    inputs = {"x": Triangular(0, 1, 2)}
    result = propagate(lambda x: x + offset, inputs, workers=2)
    assert result.bounds()[1][0] == 3.0


def test_a_function_that_holds_a_lock_is_refused():
    lock = Lock()
    with pytest.raises(ValueError, match=r"cannot be sent to worker processes.*copied, or take"):
        propagate(lambda x: x if lock else 0.0, {"x": Triangular(0, 1, 2)}, workers=2)


@pytest.mark.parametrize("workers", ["2", 1.5, None])
def test_workers_are_a_whole_number(workers):
    with pytest.raises(
        ValueError, match=r"number of workers is .*; it must be a whole number, 1 or more"
    ):
        propagate(max, {"x": Triangular(0, 1, 2)}, workers=workers)


@pytest.mark.parametrize("name", ["SIGINT", "SIGHUP"])
def test_workers_leave_signals_of_the_whole_group_to_their_parent(name):
    number = getattr(signal, name)
    with pool(2) as workers:
        assert workers.submit(lambda: os.kill(os.getpid(), number) or 7).result(60) == 7
