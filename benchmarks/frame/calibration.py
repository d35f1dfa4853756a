"""Declared errors and guarantees of envelopes on random systems, against motions tried.

Frames of two to six storeys, one to nine fuzzy inputs, half of them on a record: the proof (up to
six inputs), the search and the follower. General systems: pendulums, Duffing oscillators, double
wells. Judges are exact motions at random points and corners. The seed is drawn anew unless
given. Run `python -m benchmarks.frame.calibration --help`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Any

import numpy as np

from alphacut import frame
from alphacut.frame import Accelerogram, Envelope, LagrangianSystem, StoreyFrame, envelope
from alphacut.frame.calculus.low_discrepancy import corners
from alphacut.fuzzy import FuzzyNumber, Interval
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import FailedError
from alphacut.fuzzy.result import Nature
from benchmarks.frame.envelopes import RESULTS
from benchmarks.rows import write

ROUNDING = 1e-9
"""Share of a peak by which exact motions themselves are rounded."""
Inputs = dict[str, FuzzyNumber]


def random_frame(rng: np.random.Generator) -> tuple[StoreyFrame, Inputs]:
    """A frame with fuzzy inputs."""
    n, shaken = int(rng.integers(2, 7)), bool(rng.integers(2))
    record = 2 * rng.standard_normal(300) * np.hanning(300)
    system = StoreyFrame(
        rng.uniform(5e3, 3e4, n).tolist(),
        stiffness=rng.uniform(2e6, 2e7, n).tolist(),
        damping_ratio=float(rng.choice([0.0, 0.02, 0.05])),
        ground=Accelerogram(0.017, record) if shaken else None,
        q0=[] if shaken else rng.uniform(-0.05, 0.05, n).tolist(),
        outputs=(f"q{n}", "drift1", "base_shear"),
    )
    names = rng.permutation([*system.group("k"), *system.group("m"), "zeta"])
    share = float(rng.choice([0.02, 0.05, 0.1]))
    chosen = [str(x) for x in names[: int(rng.integers(1, 10))]]
    values = {name: system.parameters[name] for name in chosen}
    return system, {
        name: Interval((1 - share) * x, (1 + share) * x) for name, x in values.items() if x
    }


def general(rng: np.random.Generator) -> tuple[LagrangianSystem, Inputs]:
    """A pendulum, a Duffing oscillator or a double well."""
    kind, share = rng.integers(3), float(rng.choice([0.02, 0.05, 0.1]))
    if kind == 0:
        system, names = frame.pendulum(phi0=float(rng.uniform(0.5, 2.5))), ["l", "d", "phi_0"]
    else:
        sign = 1.0 if kind == 1 else -1.0
        system = LagrangianSystem(
            1,
            {"k": 1.0, "b": float(rng.uniform(0.5, 2)), "x": float(rng.uniform(0.5, 2))},
            lambda q, v, p: v[0] ** 2 / 2 - sign * p["k"] * q[0] ** 2 / 2 - p["b"] * q[0] ** 4 / 4,
            lambda p: ([p["x"]], [0 * p["x"]]),
            {"q": lambda q, v, p: q[0]},
        )
        names = ["k", "b", "x"]
    values = {name: system.parameters[name] for name in names}
    return system, {name: Interval((1 - share) * x, (1 + share) * x) for name, x in values.items()}


def tried(flow: Any, inputs: Inputs, rng: np.random.Generator) -> tuple[Array, Array]:
    """Least and greatest values of motions at random points and corners, (T, m) each."""
    low, high = np.array([number.cut(0) for number in inputs.values()]).T
    points = np.vstack([rng.uniform(low, high, (2000, len(low))), corners(low, high)])
    parts = [flow.values(chunk) for chunk in np.array_split(points, -(-len(points) // 256))]
    return np.min([x.min(0) for x in parts], 0), np.max([x.max(0) for x in parts], 0)


def judged(found: Envelope, low: Array, high: Array) -> dict[str, Any]:
    """How far motions leave the bounds, beside what these declare."""
    peak = np.maximum(np.abs(low), np.abs(high)).max(0)
    beyond = np.maximum(high - found.upper[0], found.lower[0] - low)
    allowed = 0 * beyond if found.nature is Nature.GUARANTEED else found.error[0]
    return {
        "nature": str(found.nature),
        "violated": int((beyond > allowed + ROUNDING * peak).sum()),
        "values": beyond.size,
        "beyond": float((beyond / peak).max()),
        "declared": float((found.error[0] / peak).max()),
    }


def rows(rng: np.random.Generator, frames: int, systems: int) -> Iterator[dict[str, Any]]:
    """A row for each system and method."""
    for number in range(frames + systems):
        linear = number < frames
        system, inputs = (random_frame if linear else general)(rng)
        motion: dict[str, Any] = {"duration": 6.0, "step": 0.03, "alpha": (0,), "relative": True}
        names = tuple(inputs)
        flow: Any = frame.LagrangianFlow(system, names, 6.0, 0.03) if not linear else None  # type: ignore[arg-type]
        if linear:
            flow = frame.LinearFlow(system, names, 6.0, 0.03, frame.Exact())  # type: ignore[arg-type]
        low, high = tried(flow, inputs, rng)
        methods: list[Any] = [frame.ImprovedFollower(1e-3)]
        if linear:
            methods += [frame.Proof(tolerance=1e-2), frame.Search(1e-3)]
        for method in methods:
            row = {"system": number, "inputs": len(inputs), "method": method.name}
            try:
                found = envelope(system, inputs, method=method, progress=False, **motion)
                yield row | judged(found, low, high)
            except FailedError as error:
                yield row | {"nature": "none", "violated": 0, "values": 0, "why": str(error)[:80]}


def main() -> None:
    """Measures, prints, writes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--systems", type=int, default=40)
    parser.add_argument("--seed", type=int, default=None)
    options = parser.parse_args()
    seed = np.random.SeedSequence(options.seed).entropy
    print("seed", seed)
    done = []
    for row in rows(np.random.default_rng(seed), options.frames, options.systems):
        done.append(row)
        print(*(f"{key} {value}" for key, value in row.items()), flush=True)
    for nature in ("guaranteed", "estimated", "attained"):
        own = [row for row in done if row["nature"] == nature]
        bad, values = (sum(row[key] for row in own) for key in ("violated", "values"))
        print(f"{nature}: {bad} of {values} values of {len(own)} envelopes passed")
    write(done, RESULTS / "frame_calibration.csv")


if __name__ == "__main__":
    main()
