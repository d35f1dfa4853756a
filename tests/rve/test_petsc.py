"""Ctrl-C while PETSc works: it waits for the end of the block, and is neither lost nor garbled."""

import os
import signal
import threading

import numpy as np
import pytest

from alphacut.rve.interruption import uninterrupted
from alphacut.rve.petsc import PETSc
from alphacut.rve.solver.krylov import LinearSolver
from alphacut.rve.solver.options import SolverOptions


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


def test_an_inner_block_leaves_it_to_the_outer():
    done = []

    @uninterrupted()
    def outer():
        with uninterrupted():
            interrupt()
            done.append("inner")
        done.append("outer")

    with pytest.raises(KeyboardInterrupt):
        outer()
    assert done == ["inner", "outer"]


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


class Interrupted:
    """A preconditioner during which the user presses Ctrl-C, once."""

    def __init__(self):
        self.calls = 0

    def apply(self, _pc, residual, result):
        self.calls += 1
        if self.calls == 1:
            interrupt()
        result.array[:] = residual.array_r


def test_an_interruption_below_petsc_arrives_after_the_solve():
    matrix = PETSc.Mat().createAIJ((3, 3), nnz=1, comm=PETSc.COMM_SELF)
    for k in range(3):
        matrix[k, k] = k + 1.0
    matrix.assemble()
    load, context = matrix.createVecLeft(), Interrupted()
    load.array[:] = np.ones(3)
    solver = LinearSolver(matrix, SolverOptions("theta"), context)
    with pytest.raises(KeyboardInterrupt):
        solver.solve([load])
    assert context.calls > 1
    assert np.allclose(solver.solve([load]).values[:, 0], [1, 1 / 2, 1 / 3])


class InterruptedSetUp(Interrupted):
    """The same while it is set up."""

    def setUp(self, _pc):
        interrupt()
        self.calls += 1


def test_an_interruption_while_a_solver_is_set_up_arrives_thereafter():
    matrix = PETSc.Mat().createConstantDiagonal(3, 2.0, comm=PETSc.COMM_SELF)
    context = InterruptedSetUp()
    with pytest.raises(KeyboardInterrupt):
        LinearSolver(matrix, SolverOptions("theta"), context)
    assert context.calls == 1
