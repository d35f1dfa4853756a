"""What ranks share among them, and what all of them raise."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from alphacut.rve.ranks import ALONE

with_mpirun = pytest.mark.skipif(shutil.which("mpirun") is None, reason="no mpirun")
SCRIPT = """
from time import sleep
import numpy as np
from mpi4py import MPI
import alphacut.rve.ranks
from alphacut.rve.ranks import Ranks

ranks, own = Ranks(MPI.COMM_WORLD), []

def square(k):
    own.append(k)
    return k * k

assert ranks.each(square, range(5)) == [0, 1, 4, 9, 16]
assert own == sorted(own), own
assert sum(ranks.all(len(own))) == 5
assert ranks.each(abs, range(-4, 0), costs=[1, 2, 3, 4]) == [4, 3, 2, 1]
taken = ranks.until(lambda k, found: found == 16, lambda k: sleep(0.01) or k * k, range(40))
assert {0, 1, 2, 3, 4} <= set(taken) and len(taken) < 12, taken
assert all(found == k * k for k, found in taken.items()) and len({*map(str, ranks.all(taken))}) == 1
assert sorted(ranks.until(lambda k, found: False, abs, range(7))) == list(range(7))
alphacut.rve.ranks._counter = lambda handle: None  # as on several machines
assert ranks.until(lambda k, found: False, abs, range(7)) == {0: 0, 1: 1, 2: 2}
assert ranks.each(abs, range(-7, 0)) == [7, 6, 5, 4, 3, 2, 1]
assert ranks.first(lambda: MPI.COMM_WORLD.rank) == 0
own.clear()
assert ranks.first(lambda: 7, lambda: own.append(1)) == 7
assert len(own) == (ranks.rank > 0)
table = np.arange(12.0).reshape(3, 4)  # parts of it do not lie side by side in memory
got = ranks.swap([table[:, :k] + 100 * ranks.rank for k in range(ranks.size)])
for k, one in enumerate(got):
    assert np.array_equal(one, table[:, : ranks.rank] + 100 * k), (k, one)
got = ranks.swap([table.T[k:] for k in range(ranks.size)])
assert all(np.array_equal(one, table.T[ranks.rank :]) for one in got)
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


def on_ranks(count: int, script: str) -> subprocess.CompletedProcess[str]:
    pytest.importorskip("mpi4py")
    command = ["mpirun", "-n", str(count), sys.executable, "-c", script]
    folder = Path(__file__).parents[2]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60)


@with_mpirun
def test_ranks_deal_out_work_and_raise_what_one_of_them_raises():
    done = on_ranks(3, SCRIPT)
    assert done.stdout.split() == 3 * ["done"], done.stderr


@with_mpirun
@pytest.mark.parametrize("status", [0, 3])
def test_ranks_end_with_their_status_and_no_word_of_mpirun_about_a_good_one(status):
    done = on_ranks(
        2,
        "from mpi4py import MPI; from alphacut.entry import leave; print('said', end=' ');"
        f" leave({status})",
    )
    assert done.returncode == status
    assert done.stdout.split() == 2 * ["said"]
    assert ("exited" in done.stderr or "exit code" in done.stderr.lower()) == bool(status)


def test_a_process_by_itself_does_everything():
    shares = []
    assert ALONE.each(abs, [-1, 2, -3], shares.append) == [1, 2, 3]
    assert shares == [1 / 3, 2 / 3, 1]
    assert ALONE.until(lambda k, found: k == 1, abs, [-1, 2, -3], shares.append) == {0: 1, 1: 2}
    assert shares[3:] == [1 / 3, 2 / 3]
    with pytest.raises(ValueError, match="of its own"):
        ALONE.first(lambda: int("of its own"))
