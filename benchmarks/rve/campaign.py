"""Samples of the product-space cell: this version beside version 0.1.0, and each solved alone.

    ./enter python -m benchmarks.rve.campaign

Version 0.1.0 (commit 1cc7adc) is checked out into a temporary folder; both run the 225 samples of
the paper's case with two processes, in turn. Then, in this version: the bits with one process and
with two, and E of every sample solved by itself. Last, `rve solve` as a process of its own. Exit
status 1 if bits differ or an E is off by more than 1e-10.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tarfile
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np

from alphacut.case.load import load
from alphacut.fuzzy.result import Bounds
from alphacut.stages.material.campaign import Campaign, campaign
from alphacut.stages.material.cell import parts
from alphacut.stages.material.cell_models import cell_model
from alphacut.stages.material.modulus import compute
from benchmarks.rows import write

OLD = "1cc7adc"
ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "benchmarks" / "results" / "cell_campaign.csv"
E_OFF = 1e-10


def check_out(commit: str, folder: Path) -> None:
    """Put the files of a commit into a folder."""
    archive = subprocess.run(
        ["git", "archive", commit], cwd=ROOT, capture_output=True, check=True
    ).stdout
    with tarfile.open(fileobj=BytesIO(archive)) as files:
        files.extractall(folder, filter="data")


def command(folder: Path, *words: str) -> tuple[float, float, dict[str, Any]]:
    """Seconds of wall and of processors, and JSON answer of a command in a version's folder."""
    started, before = perf_counter(), _processors()
    done = subprocess.run(
        [sys.executable, "-m", *words, "--json", "-"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    return perf_counter() - started, _processors() - before, json.loads(done.stdout)


def _processors() -> float:
    """Seconds of processors that ended children took."""
    spent = getrusage(RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def modulus(folder: Path, workers: int) -> tuple[float, float, dict[str, Any]]:
    """The paper's fuzzy modulus with a number of processes."""
    return command(folder, "fuzzy", "modulus", "cases/paper.toml", "--workers", str(workers))


def alone(wanted: Campaign, found: Bounds) -> float:
    """Largest relative difference in E from samples that are solved one by one, to round-off."""
    from alphacut.rve.prism.model import PrismModel

    model, task, worst = PrismModel(petsc={"ksp_rtol": "1e-11"}), wanted.task, 0.0
    groups: dict[bytes, list[int]] = {}
    columns = [k for k, name in enumerate(found.inputs) if name != "inclusion_modulus"]
    for row, point in enumerate(found.points):
        groups.setdefault(point[columns].tobytes(), []).append(row)
    for rows in groups.values():
        points = [dict(zip(found.inputs, found.points[row], strict=True)) for row in rows]
        cells = [parts({**task.crisp, **point}, task.family) for point in points]
        results = model.solve(cells[0][0], cells[0][1], [cell[2] for cell in cells])
        exact = np.array([result.modulus for result in results])
        worst = max(worst, float(abs(found.values.output("E")[rows] / exact - 1).max()))
    return worst


def timed(repeat: int) -> dict[str, float]:
    """Least seconds of each version for the samples, and of one solve, process included."""
    seconds: dict[str, list[float]] = {"0.1.0": [], "this": []}
    with TemporaryDirectory() as place:
        old = Path(place)
        check_out(OLD, old)
        for _ in range(repeat):
            for name, folder in (("0.1.0", old), ("this", ROOT)):
                wall, _, answer = modulus(folder, 2)
                seconds[name].append(wall)
                print(f"{name}: {wall:.1f} s, {answer['solves']} linear systems", flush=True)
        solves = [command(folder, "rve", "solve", "cases/paper.toml") for folder in (old, ROOT)]
    before, now = min(seconds["0.1.0"]), min(seconds["this"])
    print(f"ratio of the quickest: {before / now:.2f}")
    for name, (took, spent, _) in zip(("version 0.1.0", "this version"), solves, strict=True):
        print(f"rve solve of {name}, process included: {took:.2f} s, processors {spent:.2f} s")
    return {
        "seconds_0.1.0": before,
        "seconds": now,
        "ratio": before / now,
        "solve_seconds_0.1.0": solves[0][0],
        "solve_processors_0.1.0": solves[0][1],
        "solve_seconds": solves[1][0],
        "solve_processors": solves[1][1],
    }


def compared() -> tuple[bool, float]:
    """Whether 1 and 2 processes give the same bits, and by how much E is off one alone."""
    wanted = campaign(load(ROOT / "cases" / "paper.toml"))
    cell_model(wanted.task.choice)
    first, second = (compute(wanted, workers=workers).result for workers in (1, 2))
    same = first.points.tobytes() == second.points.tobytes() and all(
        first.values.output(name).tobytes() == second.values.output(name).tobytes()
        for name, _ in first.values.layout
    )
    return same, alone(wanted, first)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, keep."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeat", type=int, default=2, help="runs of each version (2)")
    parser.add_argument("--times", action="store_true", help="times only, no bits and no E alone")
    options = parser.parse_args(arguments)
    row = {name: round(value, 2) for name, value in timed(options.repeat).items()}
    if options.times:
        write([row], RESULTS)
        return 0
    same, off = compared()
    print(f"the same bits with 1 and 2 processes: {same}; E off by {off:.1e} at the most")
    write([{**row, "same_bits": same, "E_off": f"{off:.1e}"}], RESULTS)
    return int(not same or off > E_OFF)


if __name__ == "__main__":
    sys.exit(main())
