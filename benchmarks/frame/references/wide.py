"""Wide supports and many parameters, against dense, polished references.

Run `python -m benchmarks.frame.references.wide --help`.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.frame import Envelope, Exact, LinearFlow, StoreyFrame, envelope
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.fuzzy import FuzzyNumber, Triangular
from benchmarks.frame.envelopes import FRAME, INPUTS
from benchmarks.frame.references.polished_search import TrueEnvelope, true_envelope
from benchmarks.rows import write

RESULTS = Path(__file__).parents[2] / "results"
STEP = 0.01


def wide(share: float) -> dict[str, FuzzyNumber]:
    """E and the three masses, all supports ± `share`."""
    return {
        name: _around(FRAME.parameters[name], share * FRAME.parameters[name]) for name in INPUTS
    }


def sixteen() -> dict[str, FuzzyNumber]:
    """Sixteen parameters: E, masses ±5 %, lengths ±1 %, dampers ±20 %, start ±10 %."""
    modal, shares = (
        FRAME.parameters,
        {"l": (0.01, 0.0), "d": (0.2, 0.0), "q0": (0.1, 0.001), "v0": (0.1, 0.01)},
    )
    more = {
        name: _around(modal[name], max(s * abs(modal[name]), least))
        for g, (s, least) in shares.items()
        for name in FRAME.group(g)
    }
    return {**INPUTS, **more}


def _around(middle: float, half: float) -> FuzzyNumber:
    return Triangular(middle - half, middle, middle + half)


def reference(
    frame: StoreyFrame,
    inputs: Mapping[str, FuzzyNumber],
    *,
    duration: float,
    every: float,
    **effort: Any,
) -> TrueEnvelope:
    """Envelope at α = 0 and the nodes 0, every, 2 every, … of exact trajectories."""
    cuts = boxes(inputs, (0,))
    effort = {
        "samples": 2**13,
        "candidates": min(16, 2 ** len(inputs)),
        "promising": 0.05,
        **effort,
    }
    return true_envelope(
        UnitFlow(LinearFlow(frame, cuts.names, duration, every, Exact()), cuts), **effort
    )


def compared(found: Envelope, truth: TrueEnvelope) -> dict[str, float]:
    """Largest and median error (m), covered share of nodes, and cost."""
    every = (len(found.time) - 1) // (len(truth.flow.time) - 1)
    wrong = truth.errors(found).max(-1)
    assert found.error is not None
    return {
        "error_m": float(wrong.max()),
        "median_error_m": float(np.median(wrong)),
        "median_estimate_m": float(np.median(found.error[0])),
        "covered": float((wrong <= found.error[0, ::every] + 1e-9).mean()),
        "trajectories": found.trajectories,
        "seconds": found.seconds,
    }


CASES: list[tuple[str, float, str, dict[str, Any]]] = [
    *[
        ("four parameters", share, "auto", {"tolerance": t})
        for share, t in ((0.2, 5e-4), (0.5, 1e-2))
    ],
    *[("four parameters", share, "modal", {"tolerance": 1e-4}) for share in (0.2, 0.5)],
    ("four parameters", 0.2, "improved-graph-follower", {"tolerance": 5e-4}),
    ("four parameters", 0.5, "improved-graph-follower", {"tolerance": 5e-3, "budget": 3000}),
    ("sixteen parameters, q3", 0.0, "auto", {"tolerance": 3e-4}),
    ("sixteen parameters, q3", 0.0, "modal", {"tolerance": 1e-4}),
]


def main() -> None:
    """Measures, prints, writes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--duration", type=float, default=30.0, help="length of the simulation, s (30)"
    )
    parser.add_argument(
        "--every", type=float, default=0.2, help="distance of the nodes of the references, s (0.2)"
    )
    options = parser.parse_args()
    RESULTS.mkdir(exist_ok=True)
    rows: list[dict[str, Any]] = []
    truths: dict[tuple[str, float], TrueEnvelope] = {}
    for case, share, method, rest in CASES:
        alone = case.startswith("sixteen")
        frame, inputs = (
            (replace(FRAME, outputs=("q3",)), sixteen()) if alone else (FRAME, wide(share))
        )
        if (case, share) not in truths:
            every = 5 * options.every if alone else options.every
            truths[case, share] = reference(frame, inputs, duration=options.duration, every=every)
        common: dict[str, Any] = {
            "duration": options.duration,
            "step": STEP,
            "alpha": (0,),
            "integrator": "exact",
        }
        found = envelope(frame, inputs, method=method, **rest, **common)
        row = {
            "case": case,
            "half_width": share,
            "method": method,
            **rest,
            **compared(found, truths[case, share]),
        }
        rows.append(row)
        print(
            f"{case:22s} ±{share:4.0%} {method:24s} {row['trajectories']:5d} runs"
            f" {row['seconds']:6.1f} s  error {row['error_m']:.2e} m, estimate (median)"
            f" {row['median_estimate_m']:.2e} m, covers {row['covered']:.1%} of the nodes",
            flush=True,
        )
    write(rows, RESULTS / "frame_wide.csv")


if __name__ == "__main__":
    main()
