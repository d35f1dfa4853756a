"""What ranks share among them, and what all of them raise."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from alphacut.rve.ranks import ALONE

SCRIPT = """
from mpi4py import MPI
from alphacut.rve.ranks import Ranks

ranks, own = Ranks(MPI.COMM_WORLD), []

def square(k):
    own.append(k)
    return k * k

assert ranks.each(square, range(5)) == [0, 1, 4, 9, 16]
assert own == list(range(5))[MPI.COMM_WORLD.rank :: 3], own
assert sum(ranks.all(len(own))) == 5
assert ranks.first(lambda: MPI.COMM_WORLD.rank) == 0
failures = 0
lacking = lambda: ranks.first(lambda: bytearray(2**62))
for work in (lacking, lambda: ranks.first(lambda: 1 / 0), lambda: ranks.each(lambda k: 1 / (k - 1), range(3))):
    try:
        work()
    except (ZeroDivisionError, MemoryError):
        failures += 1
assert failures == 3, failures
print("done", flush=True)
"""


@pytest.mark.skipif(shutil.which("mpirun") is None, reason="no mpirun")
def test_ranks_deal_out_work_and_raise_what_one_of_them_raises():
    pytest.importorskip("mpi4py")
    command = ["mpirun", "-n", "3", sys.executable, "-c", SCRIPT]
    done = subprocess.run(
        command, cwd=Path(__file__).parents[2], capture_output=True, text=True, timeout=60
    )
    assert done.stdout.split() == 3 * ["done"], done.stderr


def test_a_process_by_itself_does_everything():
    shares = []
    assert ALONE.each(abs, [-1, 2, -3], shares.append) == [1, 2, 3]
    assert shares == [1 / 3, 2 / 3, 1]
    with pytest.raises(ValueError, match="of its own"):
        ALONE.first(lambda: int("of its own"))
