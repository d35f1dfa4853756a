"""The finite elements of today beside those of an earlier commit, in one run.

    python3 -m benchmarks.rve.against 999231a2

Checks the commit out into a temporary folder, runs both in turn, each in its own environment, and
prints E, iterations, seconds and their ratio: the process of one sample, meshes of three sizes, and
the maps of the paper's transformation method with nine moduli each.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
SAMPLE = """
import json, sys
from time import perf_counter
from alphacut.rve.cell import Phase
from alphacut.rve.prism.model import PrismModel
from alphacut.stochastic import HermiteMap

size, maps, repeat = float(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
moduli = [75e9 + 1.25e9 * k for k in range(9)] if maps > 1 else [80e9]
span = (75e9, 85e9) if maps > 1 else None
model = PrismModel(size, estimate=False, moduli=span)
best = 1e300
for _ in range(repeat):
    started = perf_counter()
    for k in range(maps):
        radius = HermiteMap(0.1337, 0.1 + 1e-3 * k, 0.8663, 0.1692)
        results = model.solve(radius, Phase(20e9), [Phase(e) for e in moduli])
    best = min(best, perf_counter() - started)
one = results[0]
print(json.dumps({"E": one.modulus / 1e9, "iterations": one.iterations, "seconds": best}))
"""
CASES = (  # name, mesh size, maps, repetitions in a process
    ("process of one sample, h .15", 0.15, 1, 1),
    ("h .15, second call", 0.15, 1, 3),
    ("h .08, second call", 0.08, 1, 2),
    ("h .04, second call", 0.04, 1, 2),
    ("6 maps with 9 moduli each", 0.15, 6, 2),
)


@contextmanager
def checked_out(commit: str) -> Iterator[Path]:
    """A folder with the tree of a commit."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        git = ["git", "-C", str(ROOT), "worktree"]
        subprocess.run([*git, "add", "--detach", "-f", str(tree), commit], check=True)
        try:
            yield tree
        finally:
            subprocess.run([*git, "remove", "--force", str(tree)], check=True)


def measured(tree: Path, size: float, maps: int, repeat: int) -> dict[str, Any]:
    """What a process of its own measures, and how long it takes."""
    command = [str(tree / "enter"), "python", "-c", SAMPLE, str(size), str(maps), str(repeat)]
    before = os.times()
    run = subprocess.run(command, cwd=tree, capture_output=True, text=True, check=False)
    after = os.times()
    if run.returncode:
        raise SystemExit(run.stderr)
    numbers: dict[str, Any] = json.loads(run.stdout.splitlines()[-1])
    return {**numbers, "process": after.elapsed - before.elapsed}


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; exit 1 where E differs by more than 1e-8 GPa."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("commit", help="the earlier commit")
    parser.add_argument("--only", type=int, nargs="*", default=range(len(CASES)))
    options = parser.parse_args(arguments)
    apart = 0.0
    print(f"{'case':30} {'E, GPa':>14} {'iterations':>12} {'seconds':>8} {'earlier':>8} ratio")
    with checked_out(options.commit) as tree:
        for name, size, maps, repeat in (CASES[k] for k in options.only):
            for folder in (tree, ROOT):  # compiles and fills caches
                measured(folder, size, min(maps, 1), 1)
            earlier, now = (measured(folder, size, maps, repeat) for folder in (tree, ROOT))
            key = "process" if "process" in name else "seconds"
            apart = max(apart, abs(now["E"] - earlier["E"]))
            counts = ",".join(map(str, now["iterations"]))
            ratio = now[key] / earlier[key]
            print(
                f"{name:30} {now['E']:14.9f} {counts:>12} {now[key]:8.2f} {earlier[key]:8.2f}"
                f" {ratio:5.2f}",
                flush=True,
            )
    return int(apart > 1e-8)


if __name__ == "__main__":
    sys.exit(main())
