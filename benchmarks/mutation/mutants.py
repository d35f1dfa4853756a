"""Planted faults: each must turn named tests red.

    make mutants
    ./enter python -m benchmarks.mutation.mutants --only radius --jobs 2

`mutants.toml` holds the table: a file, a piece of its text, the fault that takes its place, and
the tests that must fail with it. Every fault is planted in a copy of the checkout of its own. A
mutant is caught when one of its tests fails; one that is argued instead (`argued = "…"`) stays
green for the reason given. The results go to `benchmarks/results/mutants.csv`.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from benchmarks.rows import write

ROOT = Path(__file__).resolve().parents[2]
TABLE = Path(__file__).with_name("mutants.toml")
FOLDERS = ("alphacut", "stochastic", "rve", "fuzzy", "frame", "tests", "benchmarks", "cases")
LEAST_CAUGHT = 0.95
SECONDS = 600  # after which the tests of a mutant are stopped; that counts as red


@dataclass(frozen=True)
class Mutant:
    """A fault and the tests that must see it.

    Attributes:
        name: Package and fault in words, unique.
        file: File of the fault, from the top of the checkout.
        find: Text that occurs once in the file.
        replace: Text in its place.
        tests: Arguments of pytest, at least one.
        argued: Reason why the fault need not be seen; empty for most.
    """

    name: str
    file: str
    find: str
    replace: str
    tests: tuple[str, ...]
    argued: str = ""

    def applied(self, text: str) -> str:
        """The file's text with the fault.

        Raises:
            ValueError: The piece of text occurs not once, or nothing would change.
        """
        times = text.count(self.find)
        if times != 1 or self.find == self.replace:
            raise ValueError(
                f"{self.name}: {self.find!r} occurs {times} times in {self.file}; it must occur"
                " once and change: mend mutants.toml"
            )
        return text.replace(self.find, self.replace)


def mutants() -> list[Mutant]:
    """The table."""
    rows = tomllib.loads(TABLE.read_text(encoding="utf-8"))["mutant"]
    return [Mutant(**{**row, "tests": tuple(row["tests"])}) for row in rows]


def copied(folder: Path) -> Path:
    """A copy of what the tests need, links kept."""
    for name in FOLDERS:
        leave_out = shutil.ignore_patterns("__pycache__", "results")
        shutil.copytree(ROOT / name, folder / name, symlinks=True, ignore=leave_out)
    for name in ("pyproject.toml", "README.md", "CITATION.cff", "enter", "Makefile"):
        shutil.copy2(ROOT / name, folder / name)
    return folder


def is_red(folder: Path, tests: Sequence[str]) -> bool:
    """True if one of the tests fails in a copy of the checkout.

    Raises:
        RuntimeError: The tests could not be run at all.
    """
    options = ["-x", "-q", "-m", "not slow", "-p", "no:cacheprovider"]
    command = [sys.executable, "-m", "pytest", *options, *tests]
    there = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(
            command, cwd=folder, env=there, capture_output=True, text=True, timeout=SECONDS
        )
    except subprocess.TimeoutExpired:
        return True
    if done.returncode not in (0, 1, 2):  # 2: the fault shows while tests are collected
        raise RuntimeError(f"{' '.join(tests)}: pytest ended with status {done.returncode}")
    return done.returncode != 0


def judged(mutant: Mutant) -> dict[str, object]:
    """Plant one fault and run its tests."""
    started = perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        there = copied(Path(folder)) / mutant.file
        there.write_text(mutant.applied(there.read_text(encoding="utf-8")), encoding="utf-8")
        caught = is_red(Path(folder), mutant.tests)
    seconds = round(perf_counter() - started, 1)
    verdict = "caught" if caught else "argued" if mutant.argued else "MISSED"
    print(f"{verdict:7s} {seconds:6.1f} s  {mutant.name}", flush=True)
    return {"name": mutant.name, "file": mutant.file, "verdict": verdict, "seconds": seconds}


def tests_are_green(chosen: Sequence[Mutant]) -> bool:
    """True if all tests pass in a copy without a fault: red must come from the fault."""
    with tempfile.TemporaryDirectory() as folder:
        return not is_red(copied(Path(folder)), sorted({t for m in chosen for t in m.tests}))


def main(arguments: Sequence[str] | None = None) -> int:
    """Plant every fault in turn; exit 1 where too few are caught."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", default="", help="part of the names of those to plant")
    parser.add_argument("--jobs", type=int, default=2, help="at once (default 2)")
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks/results/mutants.csv")
    options = parser.parse_args(arguments)
    chosen = [mutant for mutant in mutants() if options.only in mutant.name]
    if not tests_are_green(chosen):
        print("the tests fail without a fault: make them green first")
        return 1
    with ThreadPoolExecutor(options.jobs) as pool:
        rows = list(pool.map(judged, chosen))
    if not options.only:
        write(rows, options.out)
    caught = sum(row["verdict"] == "caught" for row in rows)
    missed = [row["name"] for row in rows if row["verdict"] == "MISSED"]
    print(f"{caught} of {len(rows)} caught; missed: {', '.join(map(str, missed)) or 'none'}")
    return int(bool(missed) or caught < LEAST_CAUGHT * len(rows))


if __name__ == "__main__":
    sys.exit(main())
