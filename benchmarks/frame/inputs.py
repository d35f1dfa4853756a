"""Seconds of envelopes of a six-storey frame with one to thirty fuzzy inputs, and of proofs.

Run `python -m benchmarks.frame.inputs --help`.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from alphacut.frame import Auto, Proof, StoreyFrame, envelope
from alphacut.fuzzy import Interval
from benchmarks.frame.envelopes import FRAME, INPUTS, RESULTS
from benchmarks.rows import write

SIX = StoreyFrame(
    (20e3,) * 6,
    (3.0,) * 6,
    25e9,
    1e-4,
    (200.0,) * 6,
    damping_ratio=0.03,
    q0=tuple(0.01 * np.arange(1, 7)),
    outputs=("q6", "drift1"),
)


def main() -> None:
    """Measures, prints, writes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--counts", type=int, nargs="+", default=[1, 2, 4, 6, 8, 12, 20, 30])
    parser.add_argument("--share", type=float, default=0.05, help="half width of every input")
    options = parser.parse_args()
    names = [x for g in ("m", "l", "q0", "c", "d") for x in SIX.group(g)]
    rows = []
    for count in options.counts:
        values = {name: SIX.parameters[name] for name in names[:count]}
        ends = {name: (x - options.share * x, x + options.share * x) for name, x in values.items()}
        inputs = {name: Interval(low, high) for name, (low, high) in ends.items()}
        begun = time.perf_counter()
        motion = {"duration": 6, "step": 0.01, "alpha": (0, 0.5, 1), "relative": True}
        found = envelope(SIX, inputs, method=Auto(1e-3), **motion)
        error = float((found.error.max((0, 1)) / np.abs(found.upper).max((0, 1))).max())
        row = {"inputs": count, "nature": str(found.nature), "error": error}
        rows.append(row | {"seconds": time.perf_counter() - begun, "why": found.notes[0][:60]})
        print(*rows[-1].values(), flush=True)
    for _ in range(2):  # the first compiles
        begun = time.perf_counter()
        motion = {"duration": 30, "step": 0.01, "relative": False}
        found = envelope(FRAME, INPUTS, method=Proof(1e-6), **motion)
        print("the paper's frame, five levels, gap 1 µm:", time.perf_counter() - begun, "s")
    write(rows, RESULTS / "frame_inputs.csv")


if __name__ == "__main__":
    main()
