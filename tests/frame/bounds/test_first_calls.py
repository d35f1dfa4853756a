"""No thread of a proof is the first one to call a kernel with a type of tuple or Boolean."""

import ast
from pathlib import Path
from threading import current_thread, main_thread

import pytest
from numba._dispatcher import compute_fingerprint

import alphacut.base.kernels
from alphacut.frame import DualProof, Proof, envelope
from alphacut.fuzzy import Interval
from tests.frame.bounds.test_branch_and_bound import soil_spring

ROOMS = Path(alphacut.base.kernels.__file__).parents[1]


class Calls:
    """Types of arguments that kernels were called with, and those that a thread brought first."""

    def __init__(self):
        self.known, self.first_in_threads = set(), []

    def take(self, kernel, arguments):
        """Note types that Numba looks up by a fingerprint: not those of numbers and of arrays."""
        for argument in arguments:
            if not isinstance(argument, tuple | bool):
                continue
            fingerprint = compute_fingerprint(argument)
            if fingerprint not in self.known and current_thread() is not main_thread():
                self.first_in_threads.append((kernel.__qualname__, type(argument)))
            self.known.add(fingerprint)


@pytest.fixture
def calls(monkeypatch):
    """The calls of kernels in this test."""
    noted, call = Calls(), alphacut.base.kernels._Kernel.__call__

    def noting(kernel, *arguments):
        noted.take(kernel, arguments)
        return call(kernel, *arguments)

    monkeypatch.setattr(alphacut.base.kernels._Kernel, "__call__", noting)
    return noted


@pytest.mark.parametrize(
    "method", [DualProof(peaks=1e-3, workers=2), Proof(tolerance=1e-3, workers=2)], ids=repr
)
def test_threads_of_proofs_bring_no_new_type_of_argument(calls, method):
    """Debian's Numba ends the process where two threads bring the same new type at once."""
    motion = {"duration": 2.0, "step": 0.1, "alpha": (0,), "relative": True}
    fuzzy = {"s": Interval(0.5, 2.0)}
    found = envelope(soil_spring(), fuzzy, method=method, progress=False, **motion)
    assert found.facts["parts"] > 1
    assert len(calls.known) >= 3
    assert calls.first_in_threads == []


def test_all_pools_of_threads_in_the_rooms_call_kernels_before():
    makers = {
        file.relative_to(ROOMS).as_posix()
        for room in ("base", "frame", "fuzzy", "rve", "stochastic")
        for file in (ROOMS / room).rglob("*.py")
        if "ThreadPoolExecutor" in (text := file.read_text("utf-8"))
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.ImportFrom | ast.Import)
        if "ThreadPoolExecutor" in {alias.name for alias in node.names}
    }
    assert makers == {"base/threads.py"}
