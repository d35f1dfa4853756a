"""Workers and the script that asks for them: what they cannot import is told in one line, at once."""

import subprocess
import sys
from pathlib import Path

import pytest

from alphacut.fuzzy import Triangular
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


def test_a_script_without_the_guard_ends_at_once_and_names_it(tmp_path):
    (tmp_path / "script.py").write_text(BARE)
    done = run("script.py", folder=tmp_path)
    assert done.returncode == 1
    assert done.stderr.count("Traceback") == 1
    last = done.stderr.splitlines()[-1]
    assert last.startswith("RuntimeError: the worker processes ended before their first sample")
    assert 'under `if __name__ == "__main__":`, or take workers=1' in last


def test_a_script_with_the_guard_runs(tmp_path):
    (tmp_path / "script.py").write_text(GUARDED)
    assert run("script.py", folder=tmp_path).stdout == "8.0\n"


def test_another_process_that_imports_the_script_is_told_of_the_guard(tmp_path):
    (tmp_path / "script.py").write_text(BARE)
    starter = (
        "from multiprocessing import process, spawn; process.current_process()._inheriting = True;"
        " spawn.import_main_path('script.py')"
    )
    done = run("-c", starter, folder=tmp_path)
    assert done.returncode == 1
    assert done.stderr.startswith(
        "a process that imports the main script would start workers in turn: put the calls in that"
        " script"
    )


def test_a_script_from_standard_input_is_refused():
    done = run("-", text=GUARDED)
    assert done.stderr.splitlines()[-1].startswith(
        "ValueError: the main script is <stdin>, which worker processes cannot import; save it"
    )


def test_a_function_that_was_typed_in_is_refused():
    done = run("-c", GUARDED)
    assert (
        "it was typed in, not read from a file): define it in a file"
        in done.stderr.splitlines()[-1]
    )


@pytest.mark.parametrize("workers", ["2", 1.5, None])
def test_workers_are_a_whole_number(workers):
    with pytest.raises(
        ValueError, match=r"number of workers is .*; it must be a whole number, 1 or more"
    ):
        propagate(max, {"x": Triangular(0, 1, 2)}, workers=workers)
