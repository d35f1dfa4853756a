"""An exception of a signal's handler leaves a kernel as an exception, and the process lives."""

import copy
import os
import signal

import numpy as np
import pytest

import alphacut.base.kernels
from alphacut.frame import Accelerogram, Proof, StoreyFrame, envelope
from alphacut.fuzzy import Interval

MOTION = {"duration": 1.0, "step": 0.05, "alpha": (0,), "progress": False}


@pytest.fixture(scope="module")
def calls():
    """The last arguments that each kernel got from Python, in proofs of elastic and of yielding."""
    noted = {}
    call = alphacut.base.kernels._Kernel.__call__

    def noting(kernel, *arguments):
        noted[kernel] = copy.deepcopy(arguments)
        return call(kernel, *arguments)

    ground = Accelerogram(0.05, np.random.default_rng(1).normal(size=20))
    frame = StoreyFrame([1.0], stiffness=[40.0], damping_ratio=0.05, ground=ground, outputs=("q1",))
    yielding = StoreyFrame(
        [1.0], stiffness=[40.0], yield_force=[0.3], hardening=[0.1], ground=ground, outputs=("q1",)
    )
    inputs = {"k1": Interval(38.0, 42.0)}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(alphacut.base.kernels._Kernel, "__call__", noting)
        for model, method in ((frame, Proof(tolerance=1e-4)), (yielding, "proof")):
            envelope(model, inputs, method, **MOTION)
    return noted


def interrupted(kernel, arguments):
    """Call a kernel again and again in a child, with 50 alarms; returns the child's exit status."""
    process = os.fork()
    if process == 0:
        kernel(*arguments)
        signal.signal(signal.SIGALRM, signal.default_int_handler)
        for k in range(50):
            try:
                signal.setitimer(signal.ITIMER_REAL, 0.001 + 0.0002 * k)
                while True:
                    kernel(*arguments)
            except KeyboardInterrupt:
                continue
            except SystemError:
                os._exit(1)
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


def test_interrupts_of_each_kernel_are_exceptions(calls):
    names = {kernel.__name__ for kernel in calls}
    assert {"examine", "_march", "march"} <= names
    for kernel, arguments in calls.items():
        assert interrupted(kernel, arguments) == 0, kernel.__name__
