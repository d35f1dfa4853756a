"""What hiding Numba from DOLFINx saves at the start: ``python -m benchmarks.start_up``.

`rve/fenicsx.py` hides Numba while DOLFINx is imported. Both ways are measured in turn, as processor
time of a new process.
"""

from __future__ import annotations

import resource
import subprocess
import sys
from statistics import median

TURNS = 7
PROGRAMS = {
    "DOLFINx without Numba": "import sys; sys.modules['numba'] = None; import dolfinx.fem.petsc",
    "DOLFINx with Numba": "import dolfinx.fem.petsc",
}


def processor_seconds(program: str) -> float:
    """Return the processor time of a new process that runs a program, in s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-W", "ignore", "-c", program]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def main() -> None:
    """Print the median of `TURNS` runs of each program."""
    seconds: dict[str, list[float]] = {name: [] for name in PROGRAMS}
    for _ in range(TURNS):
        for name, program in PROGRAMS.items():
            seconds[name].append(processor_seconds(program))
    for name, values in seconds.items():
        print(f"{name}: {median(values):.2f} s")


if __name__ == "__main__":
    main()
