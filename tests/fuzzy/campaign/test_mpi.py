"""The same bits from 1, 2, 3 MPI processes as from 1, 2, 5 workers."""

import shutil
import subprocess
import sys

import pytest

SCRIPT = """
import sys
from math import exp, sin

from alphacut.fuzzy import Automatic, General, Triangular, propagate

def model(points):
    return [{"y": sin(3 * p["a"]) * exp(p["b"]), "z": [p["a"] / 3, p["b"] ** 2]} for p in points]

if __name__ == "__main__":
    inputs = {"a": Triangular(0.0, 0.3, 1.0), "b": Triangular(-1.0, 0.0, 2.0)}
    workers, out = int(sys.argv[1]), sys.argv[2]
    parts = []
    for plan in (General(), Automatic()):
        found = propagate(model, inputs, plan, shared=("a",), workers=workers, store=sys.argv[3], identity={"run": out})
        parts += [found.samples.values.array.tobytes(), found.lower.tobytes(), found.upper.tobytes(), found.lower_at.tobytes()]
    with open(out, "wb") as file:
        file.write(b"".join(parts))
"""


def bits(folder, name, command):
    """What the script writes when it is run by a command."""
    script, out = folder / "script.py", folder / name
    script.write_text(SCRIPT)
    workers = "2" if "mpirun" in command else name
    done = subprocess.run(
        [*command, str(script), workers, str(out), str(folder / "s.db")], capture_output=True
    )
    assert done.returncode == 0, done.stderr.decode()
    return out.read_bytes()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("bits")


@pytest.fixture(scope="module")
def reference(folder):
    return bits(folder, "1", [sys.executable])


@pytest.mark.skipif(shutil.which("mpirun") is None, reason="there is no mpirun")
@pytest.mark.parametrize("processes", [1, 3])
def test_any_number_of_mpi_processes(folder, reference, processes):
    command = ["mpirun", "-n", str(processes), sys.executable, "-m", "mpi4py.futures"]
    assert bits(folder, f"mpi{processes}", command) == reference
