"""Cost of an envelope over the number of fuzzy inputs, 1 to 30, on a frame of six storeys.

`auto` at a relative 1e-3, six outputs, 501 nodes, α = 0, 0.5, 1: E and masses ±5 %, lengths ±2 %,
dampers ±20 %, initial state ±10 %. What is missing is judged by exact trajectories of other points
and by other starts at some nodes. Also a building of eight storeys under a record with six outputs
and a probability. Run `python -m benchmarks.frame.inputs --help`.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.frame import Accelerogram, StoreyFrame, envelope
from alphacut.frame.questions.probability import probabilities
from alphacut.fuzzy import Triangular
from benchmarks.frame.calibration import Case, around, judged
from benchmarks.rows import write

RESULTS = Path(__file__).parents[1] / "results"
FRAME = StoreyFrame(
    (20e3, 18e3, 16e3, 14e3, 12e3, 10e3),
    (3.5, 3.0, 3.0, 3.0, 3.0, 3.0),
    25e9,
    1e-5,
    (200.0,) * 6,
    "storey",
    (0.01, 0.02, 0.03, 0.04, 0.05, 0.06),
    (0.1,) * 6,
)
SHARES = {"E": 0.05, "m": 0.05, "l": 0.02, "d": 0.2, "q0": 0.1, "v0": 0.1}
COUNTS = (1, 2, 4, 6, 8, 12, 16, 22, 30)
TOLERANCE = 1e-3


def inputs(frame: StoreyFrame, count: int) -> dict[str, Triangular]:
    """The first `count` of E, masses, lengths, dampers, displacements, velocities."""
    named = [(name, share) for g, share in SHARES.items() for name in frame.group(g)]
    return {name: around(frame.parameters[name], share) for name, share in named[:count]}


def measured(count: int, *, samples: int, starts: int) -> dict[str, Any]:
    """Seconds and errors of one envelope."""
    label = f"{count} inputs"
    case = Case(label, FRAME, inputs(FRAME, count), 10.0, 0.02, (0.0, 0.5, 1.0))
    return judged(case, samples=samples, starts=starts, seed=9, method="auto", tolerance=TOLERANCE)


def building() -> dict[str, float]:
    """Seconds of an eight-storey frame under a record: six outputs, then a probability."""
    rng = np.random.default_rng(5)
    swell = np.sin(np.pi * np.arange(800) / 799)
    frame = StoreyFrame(
        (20e3,) * 8,
        (3.0,) * 8,
        25e9,
        2e-5,
        ground=Accelerogram(0.01, rng.normal(size=800) * swell),
        rayleigh=(0.1, 2e-3),
        outputs=("q2", "q4", "q6", "q8", "drift1", "base_shear"),
    )
    fuzzy = {name: around(frame.parameters[name], 0.05) for name in ("E", "m1", "m4", "m8")}
    begun = time.perf_counter()
    found = envelope(
        frame, fuzzy, duration=12.0, step=0.01, alpha=(0, 0.5, 1), relative=True, tolerance=1e-3
    )
    enveloped = time.perf_counter() - begun
    begun = time.perf_counter()
    probabilities(
        replace(frame, outputs=("q8",)),
        {name: number for name, number in fuzzy.items() if name != "E"},
        {"E": lambda source, count: 25e9 * (1 + 0.03 * source.normal(size=count))},
        {"q8": 0.9 * float(np.abs(found.upper[0, :, 3]).max())},
        duration=12.0,
        step=0.01,
        alpha=(0, 0.5, 1),
        rng=np.random.default_rng(0),
    )
    return {"envelope_seconds": enveloped, "probability_seconds": time.perf_counter() - begun}


def draw(rows: list[dict[str, Any]], exponent: float, path: Path) -> None:
    """Seconds over inputs, with the fitted power."""
    import matplotlib.pyplot as plt

    count, seconds = (np.array([row[key] for row in rows]) for key in ("inputs", "seconds"))
    figure, axes = plt.subplots(figsize=(5, 3.4), layout="constrained")
    axes.loglog(count, seconds, "o-", label="auto, relative 1e-3")
    late = count >= 6
    fitted = seconds[late][-1] * (count[late] / count[late][-1]) ** exponent
    axes.loglog(count[late], fitted, "--", color="gray", label=f"d^{exponent:.1f}")
    axes.set(xlabel="fuzzy inputs d", ylabel="processor time, s")
    axes.legend()
    figure.savefig(path, dpi=150)


def main() -> None:
    """Measure, print, write, draw."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--counts", type=int, nargs="+", default=list(COUNTS), help="of inputs")
    parser.add_argument("--samples", type=int, default=2000, help="of each reference (2000)")
    parser.add_argument("--starts", type=int, default=4, help="polished per bound (4)")
    parser.add_argument("--building", action="store_true", help="the eight storeys alone")
    o = parser.parse_args()
    if o.building:
        print(*(f"{name}: {value:.1f}" for name, value in building().items()), sep="\n")
        return
    rows = []
    for count in o.counts:
        row = {"inputs": count, **measured(count, samples=o.samples, starts=o.starts)}
        rows.append(row)
        print(
            f"{count:2d} inputs: {row['wall_seconds']:.1f} s, {row['seconds']:.1f} s of processor,"
            f" {row['method']}, error {row['error']:.1e}, declared {row['declared']:.1e},"
            f" {row['above_declared']} of {row['values']} above it",
            flush=True,
        )
    late = [row for row in rows if row["inputs"] >= 6]
    d, s = (np.log([row[key] for row in late]) for key in ("inputs", "seconds"))
    exponent = float(np.polyfit(d, s, 1)[0]) if len(late) > 1 else float("nan")
    print(f"seconds grow as inputs^{exponent:.2f} from 6 inputs on")
    write(rows, RESULTS / "frame_inputs.csv")
    draw(rows, exponent, RESULTS / "frame_inputs.png")


if __name__ == "__main__":
    main()
