"""The dual bound over the number of fuzzy inputs, and beside the branch and bound of few.

A frame of six storeys under the building's record. Seven inputs are the stiffnesses and the damping
ratio; thirteen have the masses too; of nineteen and thirty the stiffnesses are those of columns,
with second moments, lengths and numbers of their own, and thirty have the modulus and four floors'
initial displacements besides. Narrow supports, so that all cases have the same modes.

Run `python -m benchmarks.frame.many_inputs --help`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.base.errors import FailedError
from alphacut.frame import Envelope, StoreyFrame, envelope
from alphacut.frame.methods.dual import DualProof
from alphacut.frame.methods.proof import Proof
from alphacut.frame.records.history import Accelerogram
from alphacut.fuzzy import FuzzyNumber, Triangular
from benchmarks.rows import write
from benchmarks.synthetic_record import SyntheticRecord

STOREYS = 6
OUTPUTS = ("q6", "drift1", "drift6", "base_shear")
RESULTS = Path(__file__).parents[1] / "results"
COUNTS = (7, 13, 19, 26, 30)
FEW = (2, 3, 4, 5, 6)
GAPS = (1e-2, 1e-3, 1e-6)
"""Gaps asked of both proofs, as shares of each output's peak."""


def record() -> Accelerogram:
    """The synthetic record of the shipped building, every second sample."""
    made = SyntheticRecord(duration=12.0, step=0.02)
    return Accelerogram(made.step, np.asarray(made.acceleration()))


def near(value: float, share: float) -> Triangular:
    """A triangle about a value."""
    return Triangular(value * (1 - share), value, value * (1 + share))


def case(count: int, width: float) -> tuple[StoreyFrame, dict[str, FuzzyNumber]]:
    """The frame and its inputs, `count` of them."""
    columns, moved = count > 13, count == COUNTS[-1]
    own: dict[str, Any] = {"stiffness": (120e6,) * STOREYS}
    if columns:
        own = {"modulus": 30e9, "second_moment": (5e-3,) * STOREYS, "lengths": (3.0,) * STOREYS}
    frame = StoreyFrame(
        masses=(60e3,) * STOREYS,
        q0=(1e-3 * moved,) * STOREYS,
        damping_ratio=0.03,
        ground=record(),
        outputs=OUTPUTS,
        **own,
    )
    kinds = ("I", "m", "l", "c") if columns else ("k", "m")
    names = [f"{kind}{z + 1}" for kind in kinds for z in range(STOREYS)]
    names = [*names, "E", *(f"q{z + 1}_0" for z in range(4))][: count - 1]
    share = {"I": width / 2, "l": width / 9, "c": width / 4, "E": width / 8}
    inputs: dict[str, FuzzyNumber] = {
        name: near(frame.parameters[name], share.get(name[0], width)) for name in names
    }
    return frame, inputs | {"zeta": Triangular(0.02, 0.03, 0.04)}


def bounded(
    frame: StoreyFrame, inputs: Mapping[str, FuzzyNumber], method: DualProof | Proof, step: float
) -> tuple[dict[str, Any], Envelope | None]:
    """Seconds, gaps and the single modes of one envelope at α = 0, and the envelope."""
    begun, spent = time.perf_counter(), time.process_time()
    row: dict[str, Any] = {"inputs": len(inputs), "method": method.name}
    motion: dict[str, Any] = {"duration": 12.0, "step": step, "alpha": (0,), "relative": True}
    try:
        found = envelope(frame, inputs, method=method, progress=False, **motion)
    except FailedError as error:
        row |= {"seconds": time.perf_counter() - begun, "reason": str(error)}
        return row, None
    assert found.inner is not None
    peaks = np.maximum(found.upper, -found.lower).max(1)
    inner = np.maximum(found.inner.upper, -found.inner.lower).max(1)
    row |= {
        "gap": float(((peaks - inner) / peaks).max()),
        "gap at all nodes": float((found.error.max(1) / peaks).max()),
        "seconds": time.perf_counter() - begun,
        "processor seconds": time.process_time() - spent,
        "single modes": found.facts.get("single_modes", ""),
    }
    return row, found


def growth(step: float, width: float) -> Iterator[dict[str, Any]]:
    """Rows of the dual bound over the whole box, one a number of inputs."""
    bounded(*case(7, width), DualProof(slabs=1, steps=1), 0.5)  # compiles
    for count in COUNTS:
        yield bounded(*case(count, width), DualProof(peaks=0.1), step)[0]


def few(step: float, width: float, counts: Sequence[int]) -> Iterator[dict[str, Any]]:
    """Rows of both proofs with two to six inputs, stiffnesses, at gaps that are shares of peaks."""
    frame, numbers = case(7, width)
    for method in (DualProof(0.1, slabs=1), Proof(gap=0.1)):
        bounded(frame, dict(list(numbers.items())[:2]), method, 0.5)  # compiles
    for count in counts:
        inputs = dict(list(numbers.items())[:count])
        for gap in GAPS:
            (dual, first), (proof, second) = (
                bounded(frame, inputs, x, step) for x in (DualProof(gap, peaks=gap), Proof(gap=gap))
            )
            if first is not None and second is not None:
                dual["cover each other"] = covered(first, second) and covered(second, first)
            yield {"gap asked": gap} | dual
            yield {"gap asked": gap} | proof


def covered(outer: Envelope, inner: Envelope) -> bool:
    """Whether the proved bounds of one hold what the other attains, up to rounding."""
    assert inner.inner is not None
    slack = 1e-9 * np.abs(outer.upper).max((0, 1))
    above = (outer.upper >= inner.inner.upper - slack).all()
    return bool(above and (outer.lower <= inner.inner.lower + slack).all())


def main() -> None:
    """Write many_inputs.csv, or few_inputs.csv."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--step", type=float, default=0.05, help="between nodes, in s")
    parser.add_argument("--width", type=float, default=0.04, help="half supports, as shares")
    parser.add_argument("--few", type=int, nargs="*", help="both proofs of 2 to 6 inputs, or these")
    given = parser.parse_args()
    both, rows = given.few is not None, []
    motion = given.step, given.width
    for row in few(*motion, given.few or FEW) if both else growth(*motion):
        rows.append(row)
        print({k: f"{x:.3g}" if isinstance(x, float) else x for k, x in row.items()}, flush=True)
    write(rows, RESULTS / ("few_inputs.csv" if both else "many_inputs.csv"))


if __name__ == "__main__":
    main()
