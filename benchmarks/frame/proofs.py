"""Seconds of guaranteed envelopes, against version 0.1.0's where it had them.

Run `python -m benchmarks.frame.proofs --help`.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.frame import Accelerogram, Envelope, StoreyFrame, envelope
from alphacut.frame.questions.peaks import peaks
from alphacut.frame.questions.probability import probabilities
from alphacut.fuzzy import FuzzyNumber, Triangular
from benchmarks.frame.envelopes import FRAME, INPUTS
from benchmarks.rows import write

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "benchmarks" / "results"
OLD = "1cc7adc"
"""Commit of version 0.1.0."""
PAPER: dict[str, Any] = {"duration": 30.0, "alpha": (0, 0.25, 0.5, 0.75, 1)}
GAP = 1e-6
OLD_PROGRAM = """
import json, sys, time
from benchmarks.frame_envelopes import FRAME, INPUTS
from frame import envelope
step, workers = float(sys.argv[1]), int(sys.argv[2])
begun = time.perf_counter()
found = envelope(FRAME, INPUTS, duration=30, step=step, alpha=(0, 0.25, 0.5, 0.75, 1),
                 method="modal", certify=1e-6, workers=workers)
row = {"seconds": time.perf_counter() - begun, "nature": found.nature}
ends = found.lower[:, ::10].tolist(), found.upper[:, ::10].tolist()
print(json.dumps(row | {"lower": ends[0], "upper": ends[1]}))
"""


def paper(step: float, workers: int) -> Envelope:
    """The paper's frame, E and m fuzzy, 30 s, three outputs, five levels, gap 1e-6 m."""
    return envelope(FRAME, INPUTS, step=step, method="modal", certify=GAP, workers=workers, **PAPER)


def old_paper(step: float, workers: int) -> dict[str, Any]:
    """The same by version 0.1.0, checked out into a temporary folder."""
    with tempfile.TemporaryDirectory() as folder:
        archive = subprocess.run(
            ["git", "-C", str(ROOT), "archive", OLD], check=True, capture_output=True
        ).stdout
        subprocess.run(["tar", "x", "-C", folder], input=archive, check=True)
        command = [sys.executable, "-c", OLD_PROGRAM, str(step), str(workers)]
        path = {"PYTHONPATH": folder}
        done = subprocess.run(
            ["env", *(f"{k}={v}" for k, v in path.items()), *command],
            check=True,
            capture_output=True,
            text=True,
            cwd=folder,
        )
    row: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return row


def damped(step: float, workers: int) -> Envelope:
    """The paper's frame with 3 % of critical damping in place of dampers, all four inputs fuzzy."""
    frame = replace(FRAME, dampers=(), damping_ratio=0.03)
    return envelope(frame, INPUTS, step=step, tolerance=1e-3, relative=True, **PAPER)


def shaken() -> tuple[StoreyFrame, dict[str, FuzzyNumber]]:
    """Eight storeys under a record, six outputs, three inputs fuzzy."""
    rng = np.random.default_rng(3)
    record = Accelerogram(0.02, 1.5 * rng.standard_normal(600) * np.exp(-np.arange(600) / 300))
    frame = StoreyFrame(
        (2e4,) * 8,
        (3.0,) * 8,
        30e9,
        4e-5,
        (2e4,) * 8,
        "storey",
        ground=record,
        outputs=("q1", "q4", "q8", "drift1", "drift8", "base_shear"),
    )
    inputs = {
        "E": Triangular(28e9, 30e9, 32e9),
        "m1": Triangular(1.9e4, 2e4, 2.1e4),
        "m8": Triangular(1.9e4, 2e4, 2.1e4),
    }
    return frame, inputs


def building(step: float, workers: int) -> Envelope:
    """The eight storeys, with the fuzzy probability that the top exceeds its modal peak."""
    frame, inputs = shaken()
    found = envelope(frame, inputs, duration=12, step=step, tolerance=1e-3, relative=True)
    limit = float(peaks(found).upper[-1, 2])
    top = replace(frame, outputs=("q8",))
    random = {"m8": lambda rng, count: rng.normal(2e4, 2e2, count)}
    fuzzy = {name: number for name, number in inputs.items() if name != "m8"}
    times = {"duration": 12.0, "step": step, "rng": np.random.default_rng(0)}
    probabilities(top, fuzzy, random, {"q8": limit}, **times)
    return found


CASES: dict[str, tuple[Callable[[float, int], Envelope], float]] = {
    "paper, gap 1e-6 m": (paper, 0.01),
    "3 % damping, gap 1e-3 of the peaks": (damped, 0.01),
    "8 storeys under a record, 6 outputs, probability": (building, 0.02),
}


def measured(coarser: float, workers: int, *, old: bool) -> Iterator[dict[str, Any]]:
    """One row per case; that of the paper's frame against version 0.1.0."""
    for name, (case, step) in CASES.items():
        begun = time.perf_counter()
        found = case(coarser * step, workers)
        row: dict[str, Any] = {"case": name, "seconds": time.perf_counter() - begun}
        row |= {"nature": found.nature, "gap": float(found.facts["gap"])}
        row |= {"kernel": found.facts["kernel"], "boxes": found.facts["boxes"]}
        row |= {"seconds_0.1.0": np.nan, "ratio": np.nan, "apart": np.nan}
        if old and case is paper:
            before = old_paper(coarser * step, workers)
            sides = ((found.lower, before["lower"]), (found.upper, before["upper"]))
            apart = max(float(np.abs(new[:, ::10] - np.array(was)).max()) for new, was in sides)
            row |= {"seconds_0.1.0": before["seconds"], "apart": apart}
            row |= {"ratio": before["seconds"] / row["seconds"]}
        yield row


def main() -> None:
    """Measures, prints, writes; exit status 1 where bounds are not guaranteed or too wide."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--coarser", type=float, default=1.0, help="factor on the steps (1)")
    parser.add_argument("--workers", type=int, default=2, help="threads, or processes of 0.1.0 (2)")
    parser.add_argument("--no-old", action="store_true", help="leave version 0.1.0 out")
    options = parser.parse_args()
    rows = []
    for row in measured(options.coarser, options.workers, old=not options.no_old):
        rows.append(row)
        print(", ".join(f"{key} {value}" for key, value in row.items()), flush=True)
    RESULTS.mkdir(exist_ok=True)
    write(rows, RESULTS / "frame_proofs.csv")
    wide = [row["case"] for row in rows if row["apart"] > 1.1 * GAP]
    raise SystemExit(bool(wide) or any(row["nature"] != "guaranteed" for row in rows))


if __name__ == "__main__":
    main()
