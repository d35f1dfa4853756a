"""The same bits from one and from three MPI processes as from this one."""

import shutil
import subprocess
import sys
from math import exp, sin

import pytest

from alphacut.fuzzy import Automatic, General, Triangular, propagate


def model(points):
    return [{"y": sin(3 * p["a"]) * exp(p["b"]), "z": [p["a"] / 3, p["b"] ** 2]} for p in points]


def bits():
    inputs = {"a": Triangular(0.0, 0.3, 1.0), "b": Triangular(-1.0, 0.0, 2.0)}
    parts = b""
    for plan in (General(), Automatic()):
        found = propagate(model, inputs, plan, shared=("a",), progress=False)
        tables = found.samples.values.array, found.lower, found.upper, found.lower_at
        parts += b"".join(table.tobytes() for table in tables)
    return parts.hex()


@pytest.mark.skipif(shutil.which("mpirun") is None, reason="there is no mpirun")
@pytest.mark.parametrize("processes", [pytest.param(1, marks=pytest.mark.slow), 3])
def test_any_number_of_mpi_processes(processes):
    command = ["mpirun", "-n", str(processes), sys.executable, "-m", "mpi4py.futures", __file__]
    assert subprocess.run(command, capture_output=True, text=True).stdout.strip() == bits()


if __name__ == "__main__":
    print(bits())
