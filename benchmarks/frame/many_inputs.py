"""The dual bound over the number of fuzzy inputs, and beside the branch and bound of few.

A frame of six storeys under the building's record. Seven inputs are the stiffnesses and the damping
ratio; thirteen have the masses too; of nineteen and thirty the stiffnesses are those of columns,
with second moments and lengths, numbers and ratios of all modes of their own. Narrow supports, so
that all cases have the same modes. Run `python -m benchmarks.frame.many_inputs --help`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from alphacut.frame import StoreyFrame, envelope
from alphacut.frame.dual.proof import DualProof
from alphacut.frame.methods.proof import Proof
from alphacut.frame.structures.linear import Accelerogram
from alphacut.fuzzy import FuzzyNumber, Triangular
from alphacut.fuzzy.refused import FailedError
from benchmarks.rows import write
from benchmarks.synthetic_record import SyntheticRecord

STOREYS = 6
OUTPUTS = ("q6", "drift1", "drift6", "base_shear")
RESULTS = Path(__file__).parents[1] / "results"
COUNTS = (7, 13, 19, 30)
GAPS = (1e-2, 1e-3)


def record() -> Accelerogram:
    """The synthetic record of the shipped building, every second sample."""
    made = SyntheticRecord(duration=12.0, step=0.02)
    return Accelerogram(made.step, np.asarray(made.acceleration()))


def near(value: float, share: float) -> Triangular:
    """A triangle about a value."""
    return Triangular(value * (1 - share), value, value * (1 + share))


def case(count: int, width: float) -> tuple[StoreyFrame, dict[str, FuzzyNumber]]:
    """The frame and its inputs, `count` of them."""
    columns = count > 13
    own: dict[str, Any] = {"stiffness": (120e6,) * STOREYS}
    if columns:
        own = {"modulus": 30e9, "second_moment": (5e-3,) * STOREYS, "lengths": (3.0,) * STOREYS}
    ratios = STOREYS if count == COUNTS[-1] else 1
    frame = StoreyFrame(
        masses=(60e3,) * STOREYS,
        damping_ratio=(0.03,) * ratios,
        ground=record(),
        outputs=OUTPUTS,
        **own,
    )
    kinds = ("I", "m", "l", "c") if columns else ("k", "m")
    names = [f"{kind}{z + 1}" for kind in kinds for z in range(STOREYS)][: count - ratios]
    share = {"I": width / 2, "l": width / 9, "c": width / 4}
    inputs: dict[str, FuzzyNumber] = {
        name: near(frame.parameters[name], share.get(name[0], width)) for name in names
    }
    return frame, inputs | {name: Triangular(0.02, 0.03, 0.04) for name in frame.ratios}


def measured(
    frame: StoreyFrame, inputs: Mapping[str, FuzzyNumber], method: DualProof | Proof, step: float
) -> dict[str, Any]:
    """Seconds, the gap of peaks and the single modes of one envelope at α = 0."""
    begun, spent = time.perf_counter(), time.process_time()
    row: dict[str, Any] = {"inputs": len(inputs), "method": method.name}
    try:
        found = envelope(
            frame, inputs, duration=12.0, step=step, alpha=(0,), method=method, progress=False
        )
    except FailedError as error:
        return row | {"reason": str(error)}
    assert found.inner is not None
    peaks = np.maximum(found.upper, -found.lower).max(1)
    inner = np.maximum(found.inner.upper, -found.inner.lower).max(1)
    return row | {
        "gap": float(((peaks - inner) / peaks).max()),
        "seconds": time.perf_counter() - begun,
        "processor seconds": time.process_time() - spent,
        "single modes": found.facts.get("single_modes", ""),
    }


def growth(step: float, width: float) -> Iterator[dict[str, Any]]:
    """Rows of the dual bound, one a number of inputs."""
    measured(*case(7, width), DualProof(slabs=1, steps=1), 0.5)  # compiles
    for count in COUNTS:
        yield measured(*case(count, width), DualProof(), step)


def few(step: float, width: float) -> Iterator[dict[str, Any]]:
    """Rows of both proofs with two to six inputs, at gaps that are shares of the peak."""
    for count in (2, 4, 6):
        frame, inputs = case(7, width)
        inputs = dict(list(inputs.items())[:count])
        for gap in GAPS:
            peak = 0.06  # of q6, in m
            ways = (DualProof(gap=gap, slabs=200), Proof(gap=gap * peak))
            for way in ways:
                yield measured(frame, inputs, way, step) | {"gap asked": gap}


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Time over the number of inputs."""
    figure, axes = plt.subplots(figsize=(5, 3.5), layout="constrained")
    done = [row for row in rows if "gap" in row]
    axes.plot([row["inputs"] for row in done], [row["processor seconds"] for row in done], "o-")
    axes.set(xlabel="fuzzy inputs", ylabel="processor time in s", ylim=(0, None))
    figure.savefig(path)


def main() -> None:
    """Write many_inputs.csv and its chart, and few_inputs.csv."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--step", type=float, default=0.05, help="between nodes, in s")
    parser.add_argument("--width", type=float, default=0.04, help="half supports, as shares")
    parser.add_argument("--few", action="store_true", help="both proofs with two to six inputs")
    given = parser.parse_args()
    rows = list((few if given.few else growth)(given.step, given.width))
    for row in rows:
        print({key: f"{x:.3g}" if isinstance(x, float) else x for key, x in row.items()})
    write(rows, RESULTS / ("few_inputs.csv" if given.few else "many_inputs.csv"))
    if not given.few:
        draw(rows, RESULTS / "many_inputs.png")


if __name__ == "__main__":
    main()
