"""Planted faults: each must turn named tests red.

    make mutants
    ./enter python -m benchmarks.mutation.mutants --only radius --jobs 2
    ./enter python -m benchmarks.mutation.mutants --left

`mutants.toml` holds the table: a file, a piece of its text, the fault that takes its place, and
the tests that must fail with it. Every fault is planted in a copy of the checkout of its own. A
mutant is caught when one of its tests fails that passes without it; one that is argued instead
(`argued = "…"`) stays green for the reason given. The results go to
`benchmarks/results/mutants.csv`, each with the test that saw it, which is run first the next time;
`--left` plants those that the table does not call caught, and keeps its other rows.
"""

from __future__ import annotations

import argparse
import csv
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from benchmarks.rows import write

ROOT = Path(__file__).resolve().parents[2]
TABLE = Path(__file__).with_name("mutants.toml")
FOLDERS = ("alphacut", "stochastic", "rve", "fuzzy", "frame", "tests", "benchmarks", "cases")
RESULTS = ROOT / "benchmarks/results/mutants.csv"
LEAST_CAUGHT = 0.95
SECONDS = 600  # after which the tests of a mutant are stopped; that counts as red
SLOW = "stopped"  # in place of a test's name
_RED = re.compile(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", re.MULTILINE)


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
    """A copy of what the tests need, links and compiled Python kept."""
    for name in FOLDERS:
        leave_out = shutil.ignore_patterns("results")
        shutil.copytree(ROOT / name, folder / name, symlinks=True, ignore=leave_out)
    for name in ("pyproject.toml", "README.md", "CITATION.cff", "enter", "Makefile"):
        shutil.copy2(ROOT / name, folder / name)
    return folder


def plant(mutant: Mutant, folder: Path) -> None:
    """Put a fault into a copy of the checkout."""
    there = folder / mutant.file
    there.write_text(mutant.applied(there.read_text(encoding="utf-8")), encoding="utf-8")
    for compiled in there.parent.glob(f"__pycache__/{there.stem}.*"):
        compiled.unlink()


def red_tests(folder: Path, tests: Sequence[str], *, stop: bool = True) -> list[str]:
    """Those of the tests that fail in a copy of the checkout, the first only where `stop`.

    Raises:
        RuntimeError: The tests could not be run at all.
    """
    options = ["-q", "-rfE", "--tb=no", "-m", "not slow", "-p", "no:cacheprovider"]
    command = [sys.executable, "-m", "pytest", *options, *(["-x"] if stop else []), *tests]
    wide = {"COLUMNS": "2000", "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            env={**os.environ, **wide},
            capture_output=True,
            text=True,
            timeout=SECONDS if stop else None,
        )
    except subprocess.TimeoutExpired:
        return [SLOW]
    if done.returncode not in (0, 1, 2):  # 2: the fault shows while tests are collected
        raise RuntimeError(f"{' '.join(tests)}: pytest ended with status {done.returncode}")
    return _RED.findall(done.stdout) or list(tests) * bool(done.returncode)


def kept_rows() -> dict[str, dict[str, object]]:
    """Rows of the last table by the names of mutants."""
    if not RESULTS.is_file():
        return {}
    with RESULTS.open(newline="", encoding="utf-8") as file:
        return {row["name"]: {"seen_by": "", **row} for row in csv.DictReader(file)}


def judged(mutant: Mutant, before: Mapping[str, object] | None = None) -> dict[str, object]:
    """Plant one fault and run its tests, first the one that saw it before."""
    started, last = perf_counter(), str((before or {}).get("seen_by", ""))
    first = [last] if last.startswith(mutant.tests) else []
    with tempfile.TemporaryDirectory() as folder:
        plant(mutant, copied(Path(folder)))
        red = first and _quietly(Path(folder), first)
        red = red or red_tests(Path(folder), mutant.tests)
    seconds = round(perf_counter() - started, 1)
    word = "caught" if red else "argued" if mutant.argued else "MISSED"
    print(f"{word:7s} {seconds:6.1f} s  {mutant.name}", flush=True)
    found = {"verdict": word, "seconds": seconds, "seen_by": red[0] if red else ""}
    return {"name": mutant.name, "file": mutant.file, **found}


def _quietly(folder: Path, tests: Sequence[str]) -> list[str]:
    """Red tests; none where the tests are no more."""
    try:
        return red_tests(folder, tests)
    except RuntimeError:
        return []


def red_without_a_fault(
    planted: Sequence[Mutant], rows: Sequence[Mapping[str, object]]
) -> list[str]:
    """Tests said to have seen a fault that fail in a copy without one as well."""
    seen = {str(row["seen_by"]) for row in rows} - {"", SLOW}
    for mutant, row in zip(planted, rows, strict=True):
        seen |= set(mutant.tests) if row["seen_by"] == SLOW else set()
    if not seen:
        return []
    with tempfile.TemporaryDirectory() as folder:
        return red_tests(copied(Path(folder)), sorted(seen), stop=False)


def main(arguments: Sequence[str] | None = None) -> int:
    """Plant every fault in turn; exit 1 where too few are caught."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", default="", help="part of the names of those to plant")
    parser.add_argument("--left", action="store_true", help="those not caught the last time")
    parser.add_argument("--jobs", type=int, default=2, help="at once (default 2)")
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args(arguments)
    if not os.access(options.out.parent, os.W_OK):
        parser.error(f"--out {options.out}: its folder cannot be written; name another")
    every, before = [one for one in mutants() if options.only in one.name], kept_rows()
    for mutant in every:  # all apply, or nothing is begun
        mutant.applied((ROOT / mutant.file).read_text(encoding="utf-8"))
    done = {name for name, row in before.items() if options.left and row["verdict"] == "caught"}
    chosen = [mutant for mutant in every if mutant.name not in done]
    with ThreadPoolExecutor(options.jobs) as pool:
        found = list(pool.map(lambda one: judged(one, before.get(one.name)), chosen))
    if red := red_without_a_fault(chosen, found):
        print(f"red without a fault, make them green first: {', '.join(red)}")
        return 1
    latest = before | {str(row["name"]): row for row in found}
    rows = [latest[mutant.name] for mutant in every]
    if not options.only:
        write(rows, options.out)
    return verdict(rows)


def verdict(rows: Sequence[Mapping[str, object]]) -> int:
    """Print how many are caught; 1 where too few are."""
    caught = sum(row["verdict"] == "caught" for row in rows)
    missed = [row["name"] for row in rows if row["verdict"] == "MISSED"]
    print(f"{caught} of {len(rows)} caught; missed: {', '.join(map(str, missed)) or 'none'}")
    return int(bool(missed) or caught < LEAST_CAUGHT * len(rows))


if __name__ == "__main__":
    sys.exit(main())
