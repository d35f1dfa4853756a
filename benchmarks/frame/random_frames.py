"""True error of `auto` on random frames against its tolerance.

Run `python -m benchmarks.frame.random_frames --help`.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.frame import Accelerogram, Envelope, Exact, LinearFlow, StoreyFrame, envelope
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.methods.auto import ToleranceError
from alphacut.fuzzy import FuzzyNumber, Triangular
from benchmarks.frame.references.polished_search import true_envelope
from benchmarks.rows import write

RESULTS = Path(__file__).parents[1] / "results"
DURATION = 12.0
TIME: dict[str, Any] = {"duration": DURATION, "step": 0.05, "alpha": (0,)}
ORDERS: list[tuple[tuple[str, ...], tuple[float, ...]]] = [
    ((), (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)),
    (("modal",), (1e-2, 1e-3, 1e-4)),
]
RECORD_STEPS = (0.01, 0.017, 1 / 128, 1 / 256, 0.05, 0.3, 0.1 / 3)
GAP = 1e-7
"""Of the certified envelope, in m, a tenth of the sharpest tolerance."""


def random_frame(seed: int) -> tuple[StoreyFrame, dict[str, FuzzyNumber]]:
    """A frame of two to eight storeys with one to four fuzzy parameters, all from `seed`."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 9))
    frame = StoreyFrame(
        rng.uniform(4e3, 3e4, n),
        rng.uniform(2.3, 3.2, n),
        rng.uniform(20e9, 30e9),
        rng.uniform(0.5e-6, 3e-6),
        rng.uniform(20, 500, n),
        str(rng.choice(["ground", "storey"])),
        rng.uniform(-0.1, 0.1, n),
        rng.uniform(-0.5, 0.5, n),
    )
    floors = 1 + rng.permutation(n)
    pool = [
        "E",
        f"m{floors[0]}",
        f"m{floors[1]}",
        f"l{floors[0]}",
        f"d{floors[-1]}",
        f"q{floors[0]}_0",
        f"v{floors[1]}_0",
    ]
    chosen = rng.choice(pool, int(rng.integers(1, 5)), replace=False)
    return frame, {str(name): _around(frame.parameters[name], rng) for name in chosen}


def random_record(rng: np.random.Generator) -> Accelerogram:
    """Noise, a pulse or a sine of an odd step, mostly cut where it is not zero."""
    step = float(rng.choice([*RECORD_STEPS, rng.uniform(0.004, 0.4)]))
    time = np.arange(max(2, int(rng.uniform(0.5, 1.2 * DURATION) / step))) * step
    kind = rng.integers(3)
    if kind == 0:
        return Accelerogram(step, 0.3 * rng.standard_normal(len(time)))
    if kind == 1:
        return Accelerogram(step, np.full(len(time), rng.uniform(-0.3, 0.3)))
    return Accelerogram(step, 0.3 * np.sin(rng.uniform(1, 20) * time + rng.uniform(0, 6)))


def drawn(seed: int) -> tuple[StoreyFrame, dict[str, FuzzyNumber]]:
    """The random frame of a seed; those of odd seeds are shaken."""
    frame, inputs = random_frame(seed)
    rng = np.random.default_rng([seed, 1])
    return (replace(frame, ground=random_record(rng)) if seed % 2 else frame), inputs


def _around(middle: float, rng: np.random.Generator) -> FuzzyNumber:
    """A fuzzy number of 2 to 10 % to either side."""
    left, right = abs(middle) * rng.uniform(0.02, 0.1, 2)
    return Triangular(middle - left, middle, middle + right)


def certified(frame: StoreyFrame, inputs: Mapping[str, FuzzyNumber]) -> Envelope | None:
    """Envelope with bounds within `GAP`; None where modes are not smooth enough."""
    try:
        return envelope(frame, inputs, method="modal", certify=GAP, **TIME)
    except ValueError:
        return None


def true_errors(
    frame: StoreyFrame, inputs: Mapping[str, FuzzyNumber], found: Sequence[Envelope]
) -> list[float]:
    """Largest error of each envelope, in m, by certificate or dense reference."""
    truth = certified(frame, inputs)
    if truth is None:
        cuts = boxes(inputs, (0,))
        flow = UnitFlow(
            LinearFlow(frame, cuts.names, TIME["duration"], 20 * TIME["step"], Exact()), cuts
        )
        polished = true_envelope(flow, samples=2**12, candidates=min(8, 2 ** len(inputs)))
        return [float(polished.errors(envelope).max()) for envelope in found]
    assert truth.inner_lower is not None
    assert truth.inner_upper is not None
    errors = []
    for e in found:
        beyond = (
            truth.lower - e.lower,
            e.lower - truth.inner_lower,
            e.upper - truth.upper,
            truth.inner_upper - e.upper,
        )
        errors.append(float(max(0.0, *(x.max() for x in beyond))))
    return errors


def _made(
    frame: StoreyFrame,
    inputs: Mapping[str, FuzzyNumber],
    exclude: tuple[str, ...],
    tolerance: float,
) -> Envelope | None:
    """The envelope, or None where `auto` says that it cannot keep the tolerance."""
    try:
        return envelope(frame, inputs, method="auto", tolerance=tolerance, exclude=exclude, **TIME)
    except ToleranceError as refusal:
        print(f"refused: {refusal}", flush=True)
        return None


def measured(
    seeds: Sequence[int],
    draw: Callable[[int], tuple[StoreyFrame, dict[str, FuzzyNumber]]] = random_frame,
) -> Iterator[dict[str, Any]]:
    """One row per frame, exclusion and tolerance."""
    for seed in seeds:
        frame, inputs = draw(seed)
        orders = [
            (exclude, tolerance) for exclude, tolerances in ORDERS for tolerance in tolerances
        ]
        made = [_made(frame, inputs, exclude, tolerance) for exclude, tolerance in orders]
        orders = [order for order, one in zip(orders, made, strict=True) if one]
        found = [one for one in made if one]
        for (exclude, tolerance), one, error in zip(
            orders, found, true_errors(frame, inputs, found), strict=True
        ):
            yield {
                "seed": seed,
                "storeys": frame.floors,
                "fuzzy": " ".join(inputs),
                "excluded": " ".join(exclude),
                "tolerance_m": tolerance,
                "error_m": error,
                "estimate_m": float(one.facts["estimated_error"]),
                "method": one.method,
                "trajectories": one.trajectories,
                "seconds": one.seconds,
            }


def main() -> None:
    """Measure, print, write; exit status 1 where an error is above its tolerance."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--first", type=int, default=0, help="first seed (0)")
    parser.add_argument("--frames", type=int, default=20, help="number of frames (20)")
    parser.add_argument("--records", action="store_true", help="shake the frames of odd seeds")
    options = parser.parse_args()
    RESULTS.mkdir(exist_ok=True)
    rows, seeds = [], range(options.first, options.first + options.frames)
    for row in measured(seeds, drawn if options.records else random_frame):
        rows.append(row)
        verdict = "" if row["error_m"] <= row["tolerance_m"] else "  ABOVE THE TOLERANCE"
        print(
            f"{row['seed']:3d} {row['storeys']} storeys, {row['fuzzy']:18s}"
            f" {row['tolerance_m']:.0e} m: error {row['error_m']:.1e} m, estimate"
            f" {row['estimate_m']:.1e} m, {row['method']}, {row['trajectories']} runs,"
            f" {row['seconds']:.1f} s{verdict}",
            flush=True,
        )
    kept = [row for row in rows if row["error_m"] <= row["tolerance_m"]]
    print(f"{len(kept)} of {len(rows)} within the tolerance")
    write(rows, RESULTS / f"frame_random{'_records' if options.records else ''}.csv")
    raise SystemExit(len(kept) < len(rows))


if __name__ == "__main__":
    main()
