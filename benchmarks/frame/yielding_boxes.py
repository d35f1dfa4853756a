"""Bounds over random boxes of one yielding storey, against exact motions in them.

A box has one to three inputs of random widths from ± .03 to ± 50 %, and often crisp inputs that
differ from the frame's own values. Nothing is added for rounding. No motion at its corners and at
random points may lie outside its bounds by more than 1e-12 of the peak. Of the residual drift it is
the peak of the drift that counts, and of the dissipated energy that of shear times drift.

    ./enter python -m benchmarks.frame.yielding_boxes --count 2000 --save build/boxes.npz
    ./enter python -m benchmarks.frame.yielding_boxes --count 2000 --against build/boxes.npz

The second run, in another checkout, compares widths over the same boxes.
"""

from __future__ import annotations

import argparse
import secrets
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame import Accelerogram, Force, History, StoreyFrame
from alphacut.frame.bounds import interpolated_box
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.yielding import YieldingFlow
from alphacut.fuzzy.sets.boxes import corners

OUTPUTS = ("q1", "v1", "shear1", "ductility1", "residual1", "dissipated1")
DURATION, STEP = 2.0, 0.05
ALLOWED = 1e-12
"""Largest distance of a motion from its bounds, as a fraction of the peak: its own rounding."""
POINTS = 24
"""Random points of each box, beside its corners; each second one lies on a face."""


class Box(NamedTuple):
    """A frame, names of its inputs, and the ends of these in SI units; crisp ones are equal."""

    frame: StoreyFrame
    names: tuple[str, ...]
    low: Array
    high: Array


def random_box(rng: np.random.Generator) -> Box:
    """Draw a storey that yields about once or more, its load, and a box of inputs."""
    mass = 1e3
    frequency = 2 * np.pi / float(rng.uniform(0.3, 1.5))
    drift = float(rng.uniform(0.005, 0.1))
    force = mass * frequency**2 * drift
    hardening = float(rng.choice([0.0, rng.uniform(0.0, 0.2), rng.uniform(0.2, 0.99)]))
    size = frequency**2 * drift * float(rng.uniform(0.3, 2.0))  # of the load, in m/s²
    load = str(rng.choice(["random", "constant", "force"]))
    forces: list[Force] = []
    ground = None
    if load == "force":
        history = History(0.1, rng.normal(size=20))
        forces = [Force(1, float(rng.choice([-1, 1])) * mass * size, history)]
    elif load == "constant":
        ground = Accelerogram(0.5, np.full(5, size * float(rng.uniform(-1, 1))))
    else:
        ground = Accelerogram(0.05, size * rng.normal(size=21).repeat(2))
    velocity = frequency * drift * float(rng.choice([0.0, rng.uniform(-3, 3)]))
    frame = StoreyFrame(
        masses=[mass],
        stiffness=[mass * frequency**2],
        damping_ratio=float(rng.choice([0.0, rng.uniform(0.0, 0.1)])),
        yield_force=[force],
        hardening=[hardening],
        v0=[velocity],
        loads=forces,
        ground=ground,
        # A force moves accelerations at once, which are not bounded then.
        outputs=OUTPUTS if load == "force" else (*OUTPUTS, "a1"),
    )
    choice = ["k1", "fy1", "hardening1", "v1_0"]
    if load != "force":
        choice.append("m1")
    active = list(rng.permutation(choice)[: rng.integers(1, 4)])
    others = [x for x in ("k1", "fy1", "m1", "zeta", "hardening1") if x not in active]
    if load == "force":
        others.append("F1")
    crisp = list(rng.permutation(others)[: rng.integers(0, 3)])
    radius = 10 ** float(rng.uniform(np.log10(3e-4), np.log10(0.5)))
    values = frame.parameters
    low, high = [], []
    for name in active:
        size = abs(values[name]) or {"v1_0": frequency * drift}.get(name, 0.1)
        low.append(values[name] - radius * size)
        high.append(values[name] + radius * size)
    for name in crisp:
        low.append(values[name] * float(rng.uniform(0.7, 1.4)))
        high.append(low[-1])
    names = (*active, *crisp)
    for k, name in enumerate(names):
        if name == "hardening1":
            low[k], high[k] = np.clip([low[k], high[k]], 0.0, 0.99)
    return Box(frame, tuple(map(str, names)), np.array(low), np.array(high))


@dataclass
class Found:
    """What was found of a box.

    Args:
        is_finite: Whether its bounds are finite.
        excess: Largest distance of a motion from the bounds, as a fraction of the peak.
        widths: Mean distance of both bounds at time nodes, and the bound of the peak, as fractions
            of the largest peak met, shape (2, outputs).
    """

    is_finite: bool
    excess: float
    widths: Array


def found_of(box: Box, rng: np.random.Generator) -> Found:
    """Compare the bounds over a box with exact motions at corners and at random points."""
    flow = YieldingFlow(box.frame, box.names, DURATION, STEP)
    active = np.flatnonzero(box.high > box.low)
    unit = rng.random((POINTS, len(box.low)))
    on_face = rng.integers(len(box.low), size=POINTS)
    unit[np.arange(0, POINTS, 2), on_face[::2]] = rng.integers(2, size=POINTS // 2)
    points = np.vstack([corners(box.low, box.high), box.low + unit * (box.high - box.low)])
    points = np.clip(points, box.low, box.high)
    try:
        bounds = interpolated_box.InterpolatedFrame(flow, active).bounds(box.low, box.high)
    except UnprovedError:
        return Found(False, 0.0, np.full((2, len(flow.outputs)), np.inf))
    values, peaks = flow.values_and_peaks(points)
    at = {name: peaks[:, k].max() for k, name in enumerate(flow.outputs)}
    scales = np.array([at[name] for name in flow.outputs])
    scales[flow.outputs.index("residual1")] = at["q1"]
    scales[flow.outputs.index("dissipated1")] = at["q1"] * at["shear1"]
    above = (values - bounds.upper[..., 1]).max(axis=(0, 1))
    below = (-values - bounds.upper[..., 0]).max(axis=(0, 1))
    of_peaks = peaks.max(axis=0) - bounds.peaks.max(axis=1)
    excess = float((np.max([above, below, of_peaks], axis=0) / scales).max())
    node_widths = bounds.upper.sum(axis=-1).mean(axis=0)
    widths = np.array([node_widths, bounds.peaks.max(axis=1)]) / scales
    return Found(bool(np.isfinite(bounds.upper).all()), excess, widths)


def found_in(count: int, seed: int) -> Iterator[Found]:
    """Yield what is found of `count` boxes, without what is added for rounding."""
    interpolated_box.ROUNDING = 0.0
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        yield found_of(random_box(rng), rng)


def main() -> int:
    """Print what was found; return 1 if a motion lies outside, or bounds are much wider."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200, help="number of boxes")
    parser.add_argument("--seed", type=int, help="seed (else a random one)")
    parser.add_argument("--save", type=Path, help="file .npz for seed, distances and widths")
    parser.add_argument("--against", type=Path, help="such a file of another checkout")
    options = parser.parse_args()
    seed = secrets.randbelow(10**9) if options.seed is None else options.seed
    old = None
    if options.against:
        old = np.load(options.against)
        seed = int(old["seed"])
    print(f"{options.count} boxes, --seed {seed}", flush=True)
    found = []
    for number, box in enumerate(found_in(options.count, seed)):
        found.append(box)
        if box.excess > ALLOWED:
            print(f"box {number}: a motion is outside by {box.excess:.3g} of the peak", flush=True)
    excess = np.array([x.excess for x in found])
    finite = np.array([x.is_finite for x in found])
    print(f"outside by more than {ALLOWED:g}: {(excess > ALLOWED).sum()}; most: {excess.max():.3g}")
    print(f"finite bounds: {finite.sum()} ({finite.mean():.1%})")
    wider = 0
    if old is not None:
        count = min(len(old["excess"]), len(found))
        right = old["finite"][:count] & (old["excess"][:count] <= ALLOWED)
        lost = right & ~finite[:count]
        print(f"finite and right there, not finite here: {lost.sum()}")
        ratios = [1.0]
        for number in range(count):
            if right[number] and finite[number]:
                there = old[f"widths{number}"] + ALLOWED
                ratios.append(float(((found[number].widths + ALLOWED) / there).max()))
        print(f"largest ratio of a width to the one there: {max(ratios):.4f}")
        wider = int(lost.sum() + (np.array(ratios) > 1.02).sum())
    if options.save:
        widths = {f"widths{number}": x.widths for number, x in enumerate(found)}
        np.savez(options.save, seed=seed, excess=excess, finite=finite, **widths)
    return int((excess > ALLOWED).any() or wider > 0)


if __name__ == "__main__":
    sys.exit(main())
