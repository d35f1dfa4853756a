"""What a person waits for, in two checkouts: medians of runs in turn, and their ratios.

    python3 benchmarks/speed.py OLD NEW                   all works, three times each
    python3 benchmarks/speed.py OLD NEW --only sample     one of them; may be repeated
    python3 benchmarks/speed.py OLD NEW --runs 5

OLD and NEW are folders of checkouts, of which each runs in its own `./enter`; this file needs
Python alone. Each work runs once before those that count, which compiles kernels and forms.
Processor time is that of all processes of a work, memory that of the largest one. On a machine
that is not quiet only processor time and memory can be compared.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

RUN = ("python", "-m", "alphacut", "run")
CHECK = ("python", "-m", "alphacut", "check")
SOLVE = ("python", "-m", "rve", "solve", "cases/paper.toml", "--quiet", "--json=-")
CAMPAIGN = (*RUN, "cases/paper.toml", "--set=stages=['modulus']", "--workers=2")
SUITES = "SUITES"
"""Stands in a command for the folder of `write_suites`."""
STOREYS = """
title = "Six storeys, each with its own tolerance"
stages = ["envelope"]
[frame]
stiffness = [STIFFNESS]
masses = [MASSES]
damping_ratio = "[2, 3, 4] %"
outputs = ["q6", "drift1", "drift6"]
[records]
files = ["44/*.AT2"]
[envelope]
fuzzy = ["k", "m", "zeta"]
alpha = [0, 0.5, 1]
duration = "12 s"
step = "0.02 s"
[decision]
limits = ["drift1 <= 30 mm", "drift6 <= 10 mm"]
""".replace("STIFFNESS", ", ".join(6 * ['"120 MN/m ± 8 %"'])).replace(
    "MASSES", ", ".join(6 * ['"60 t ± 5 %"'])
)
"""Thirteen inputs under 44 records, as in docs/howto/storey-tolerances.md."""
FOUR_DRIFTS = "--set=frame.outputs=['drift1', 'drift2', 'drift3', 'drift4']"
WORKS = {  # name: command in a checkout; one that runs a case gets a new folder of results
    "campaign": CAMPAIGN,  # of the paper, 225 samples
    "paper": (*RUN, "cases/paper.toml", "--workers=2"),
    "sample": SOLVE,
    "sample-option": (*SOLVE, "-rve_ksp_rtol", "1e-8"),  # which repeats the default
    "building": (*RUN, "cases/building.toml", "--workers=2"),
    "records-44": (*RUN, f"{SUITES}/storeys.toml", "--workers=2"),
    "records-12": (  # of 60 s
        *RUN,
        f"{SUITES}/suite.toml",
        FOUR_DRIFTS,
        "--workers=2",
    ),
    **{
        f"check-{case}": (*CHECK, f"cases/{case}.toml")
        for case in ("building", "suite", "composite")
    },
    "help": ("python", "-m", "alphacut", "--help"),
    "version": ("python", "-m", "alphacut", "--version"),
    "refusal": (*CHECK, "cases/building.toml", "--set", "frame.masses=3"),
    "no-file": (*CHECK, "cases/none.toml"),
    **{f"product-{size}": (*SOLVE, f"--set=mesh.size={size}") for size in (0.15, 0.08, 0.04)},
}
REFUSED = (WORKS["refusal"], WORKS["no-file"])
"""Commands that end with the exit status 2."""
LARGEST = {"campaign": 0.5, "paper": 0.5, "sample": 0.45, "sample-option": 0.45, "building": 0.4}
LARGEST |= {"records-44": 0.45, "records-12": 0.45}
LARGEST |= {name: 0.5 for name in WORKS if name not in LARGEST}
"""Ratio of processor times that each work is to stay below."""


def write_suites(checkout: Path, folder: Path) -> None:
    """Write both suites: records by the generator of a checkout, and a case of each."""
    for count, seconds in ((44, 12), (12, 60)):
        words = ("--suite", str(folder / str(count)), str(count), str(seconds))
        command = ("./enter", "python", "-m", "benchmarks.synthetic_record", *words)
        subprocess.run(command, cwd=checkout, check=True)
    (folder / "storeys.toml").write_text(STOREYS, encoding="utf-8")
    suite = (checkout / "cases/suite.toml").read_text("utf-8").replace("suite/*.AT2", "12/*.AT2")
    (folder / "suite.toml").write_text(suite, encoding="utf-8")


def measured(checkout: Path, command: tuple[str, ...]) -> dict[str, float]:
    """Seconds of processor and of the clock, MB of memory, and seconds that a solve itself states.

    Raises:
        SystemExit: If the command fails, with what it wrote.
    """
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile("w+") as told:
        results = (f"--out={folder}/results", "--no-figures") if "run" in command else ()
        begun = time.monotonic()
        process = subprocess.Popen(
            ["./enter", *command, *results],
            cwd=checkout,
            stdout=subprocess.PIPE,
            stderr=told,
            text=True,
        )
        assert process.stdout is not None
        output = process.stdout.read()
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        seconds = time.monotonic() - begun
        if process.returncode != (2 if command in REFUSED else 0):
            told.seek(0)
            sys.exit(f"{' '.join(command)} in {checkout} ends with {status}:\n{told.read()}")
    numbers = {
        "processor s": used.ru_utime + used.ru_stime,
        "clock s": seconds,
        "memory MB": used.ru_maxrss / 1024,
    }
    if "--json=-" in command:  # what a cell costs once all is imported
        stated = json.loads(output)["seconds"]
        numbers["solve s"] = stated["total"] if isinstance(stated, dict) else stated
    return numbers


def rows_of(name: str, old: list[dict[str, float]], new: list[dict[str, float]]) -> list[str]:
    """Lines of the table of one work: medians of both checkouts and their ratio."""
    rows = []
    for quantity in new[0]:
        before, after = (statistics.median(run[quantity] for run in runs) for runs in (old, new))
        bound = f"{LARGEST[name]:.2f}" if quantity == "processor s" else ""
        rows.append(
            f"| {name} | {quantity} | {before:.2f} | {after:.2f} | {after / before:.2f} | {bound} |"
        )
    return rows


def main(argv: list[str] | None = None) -> int:
    """Print the table, a work at a time."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("old", type=Path, help="folder of the earlier checkout")
    parser.add_argument("new", type=Path, help="folder of the later one")
    parser.add_argument("--only", action="append", choices=WORKS, metavar="NAME", help="a work")
    parser.add_argument("--runs", type=int, default=3, help="of each work in each checkout")
    asked = parser.parse_args(argv)
    print("| work | quantity | old | new | ratio | at most |\n|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as suites:
        write_suites(asked.new, Path(suites))
        for name in asked.only or WORKS:
            command = tuple(word.replace(SUITES, suites) for word in WORKS[name])
            old, new = [], []
            for _ in range(1 + asked.runs):
                old.append(measured(asked.old, command))
                new.append(measured(asked.new, command))
            print(*rows_of(name, old[1:], new[1:]), sep="\n", flush=True)  # the first compiles
    return 0


if __name__ == "__main__":
    sys.exit(main())
