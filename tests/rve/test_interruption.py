"""Ctrl-C and SIGTERM wait for the end of imports of DOLFINx and of PETSc's work; then, one line."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from alphacut.rve import Ellipse

ROOT = Path(__file__).parents[2]
PROGRAM = """
import os, signal, sys
from alphacut.entry import main

class Pressed:
    def find_spec(self, name, path, target=None):
        if name == "{at}" and self in sys.meta_path:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.{signal})

sys.meta_path.insert(0, Pressed())
status = main(["cell", "cases/paper.toml", "--method", "{method}"])
print(status, "{last}" in sys.modules)
"""


ENDS = {"SIGINT": (130, "interrupted"), "SIGTERM": (143, "ended by SIGTERM")}


@pytest.mark.parametrize(
    ("at", "method", "last", "signal"),
    [
        ("basix._basixcpp", "prism", "basix.quadrature", "SIGINT"),
        ("dolfinx.cpp", "slices", "dolfinx.fem", "SIGINT"),
        ("petsc4py.lib", "prism", "petsc4py.PETSc", "SIGTERM"),
    ],
)
def test_it_ends_with_the_usual_status_once_the_import_is_done(
    at, method, last, signal, tmp_path, monkeypatch
):
    status, how = ENDS[signal]
    if at == "dolfinx.cpp":  # which is imported where FFCx's integral was not made before
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    program = PROGRAM.format(at=at, method=method, last=last, signal=signal)
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, cwd=ROOT, check=False
    )
    assert (done.returncode, done.stdout) == (0, f"{status} True\n")
    assert (
        done.stderr
        == f"alphacut: {how}; a run continues from the stages and samples that it has finished\n"
    )


COMPILED = """
import numpy as np
from alphacut.entry import interrupt_on_stop_signals
from alphacut.rve.interruption import uninterrupted
with interrupt_on_stop_signals(), uninterrupted(second_ends=True):
    print("begun", flush=True)
    np.linalg.svd(np.random.default_rng(0).random((3500, 3500)))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_second_signal_ends_compiled_code_that_the_first_waits_for(number):
    started = subprocess.Popen(
        [sys.executable, "-c", COMPILED], stdout=subprocess.PIPE, text=True, cwd=ROOT
    )
    assert started.stdout.readline() == "begun\n"
    time.sleep(0.3)
    started.send_signal(number)
    with pytest.raises(subprocess.TimeoutExpired):
        started.wait(0.5)
    started.send_signal(number)
    assert started.wait(10) == -number


@pytest.mark.parametrize(("number", "ends"), [("SIGINT", "True"), ("SIGTERM", "False")])
def test_where_ctrl_c_is_ignored_the_others_still_wait_for_the_end(number, ends):
    program = f"""
import os, signal
from alphacut.rve.interruption import uninterrupted
from alphacut.entry import interrupt_on_stop_signals
signal.signal(signal.SIGINT, signal.SIG_IGN)
try:
    with interrupt_on_stop_signals(), uninterrupted():
        os.kill(os.getpid(), signal.{number})
        print("through", end=" ")
except KeyboardInterrupt:
    print(False)
else:
    print(True)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=ROOT)
    assert done.stdout == f"through {ends}\n", done.stderr


def interrupt():
    os.kill(os.getpid(), signal.SIGINT)


@pytest.fixture
def handler():
    """Python's own handler, which a test must leave as it found it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    after = signal.signal(signal.SIGINT, before)
    assert after is signal.default_int_handler


def test_an_interruption_amid_meshing_arrives_after_it(handler):
    square = pytest.importorskip("alphacut.rve.mesh.square")
    asked = []

    def size(x, y):
        asked.append((x, y))
        if len(asked) == 50:
            interrupt()
        return 0.3

    with pytest.raises(KeyboardInterrupt):
        square.gmsh_triangles(0.3, 0.5, Ellipse(1.0), size)
    assert len(asked) > 50
