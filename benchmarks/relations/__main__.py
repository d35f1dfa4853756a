"""Looks for contradictions: ``python -m benchmarks.relations --seed 7 --count 200``.

Random frames, functions, cells, images and packings are said otherwise, one relation at a time and
in pairs; every case of `cases` is said otherwise, and run in random ways.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from alphacut.base.errors import FailedError, RefusedError
from benchmarks.relations import cases, frames, functions, materials
from benchmarks.relations.relation import Chance, Kind

KINDS: dict[str, Kind] = {
    "frames": frames.KIND,
    "functions": functions.KIND,
    "cells": materials.CELLS,
    "images": materials.IMAGES,
    "packings": materials.PACKINGS,
}
PAIRS = 3
"""Pairs of relations that are checked of each random problem."""


def of_random(kind: str, seed: int, count: int) -> Iterator[tuple[str, list[str]]]:
    """Relations of so many random problems of a kind with the contradictions found."""
    for number in range(count):
        chance = np.random.default_rng([seed, number])
        problem = KINDS[kind].drawn(chance)
        try:
            for name, lines in KINDS[kind].checked(problem, chance, pairs=PAIRS):
                yield f"{kind} {seed}-{number}, {name}", lines
        except (FailedError, RefusedError) as error:
            print(f"  {kind} {seed}-{number} has no result: {str(error)[:120]}")


def of_cases(names: list[str], chance: Chance, rows: int) -> Iterator[tuple[str, list[str]]]:
    """Ways to run cases with the differences found, and relations with the contradictions."""
    for name in names:
        path = Path(name) if name.endswith(".toml") else cases.ROOT / "cases" / f"{name}.toml"
        case = cases.problem(path)
        for way, lines in cases.ways_checked(case, cases.random_ways(chance, rows), chance):
            yield f"{name} with {way}", lines
        if cases.load(path, case["changes"]).content.envelope is not None:
            for relation, lines in cases.ENVELOPES.checked(case, chance, pairs=2):
                yield f"{name}, {relation}", lines


def options() -> argparse.Namespace:
    """The options of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, prog="python -m benchmarks.relations")
    shipped = sorted(path.stem for path in (cases.ROOT / "cases").glob("*.toml"))
    parser.add_argument("--seed", type=int, help="of everything left to chance; free if left out")
    parser.add_argument("--count", type=int, default=200, help="random problems of a kind")
    parser.add_argument("--kinds", nargs="*", default=[*KINDS], choices=[*KINDS], help="of them")
    parser.add_argument("--cases", nargs="*", default=shipped, help="names or files")
    parser.add_argument("--rows", type=int, default=24, help="random ways in which a case is run")
    return parser.parse_args()


def main() -> int:
    """Prints each contradiction and the number of relations checked; 1 if there is one."""
    given = options()
    seed = given.seed if given.seed is not None else int(np.random.SeedSequence().entropy % 2**32)
    print(f"seed {seed}", flush=True)
    parts = {kind: of_random(kind, seed, given.count) for kind in given.kinds}
    parts["cases"] = of_cases(given.cases, np.random.default_rng(seed), given.rows)
    broken = 0
    for part, results in parts.items():
        count = wrong = 0
        for name, lines in results:
            count, wrong = count + 1, wrong + bool(lines)
            for line in lines[:4]:
                print(f"  {name}: {line}", flush=True)
        print(f"{part}: {count} relations, {wrong} contradicted", flush=True)
        broken += wrong
    return int(broken > 0)


if __name__ == "__main__":
    sys.exit(main())
