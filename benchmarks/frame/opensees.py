"""A frame of three bays and six storeys from OpenSees: its matrices here, its motion there.

OpenSees builds the frame of elastic beams and columns with masses at its joints and gives mass and
stiffness of each group of members. From these matrices comes an envelope with fuzzy groups, and the
motion under a record, which is compared with OpenSees' own: with the same scheme and step, and the
exact one with Newmark's scheme extrapolated by Richardson. So is the motion under two forces, a
gust with a static start and a harmonic one. The wheel comes from PyPI into a folder of its own. The
envelopes are guaranteed, and held against random exact motions: one with fuzzy modulus and masses,
one with fuzzy columns alone, whose box is proved in parts, since modes that nearly meet have no
polynomials over all of it. Of the 72 unknowns half never move, by symmetry.
Run `python -m benchmarks.frame.opensees --help`.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.frame import (
    Accelerogram,
    Exact,
    Force,
    History,
    LinearFlow,
    MatrixStructure,
    envelope,
)
from alphacut.frame.dynamics.integrators import INTEGRATORS
from alphacut.fuzzy import Interval
from alphacut.fuzzy.arrays import Array
from benchmarks.frame.matrix_case import MatrixCase
from benchmarks.frame.references.excited import excited

WHEEL = "openseespylinux==3.8.0.0"
STOREYS, BAYS, HEIGHT, WIDTH = 6, 3, 3.2, 6.0
COLUMN, BEAM = (0.16, 2.1e-3), (0.18, 5.4e-3)  # area in m², second moment in m⁴
JOINT = (50e3, 40e3)  # mass in kg and moment of inertia in kg m² of a joint inside; at a side half
MODULUS = 30e9
RAYLEIGH = (0.3, 2e-3)
STEP, DURATION = 0.02, 8.0
WATCHED = ((STOREYS + 1) * (BAYS + 1), 2 * (BAYS + 1))
"""Nodes of the roof and of the first floor whose sway is compared."""
GUST, HERTZ = History(0.4, 1 + 0.3 * np.sin(np.arange(23.0) ** 2), is_static=True), 1.3
FORCES = (40e3, 20e3)
"""Amplitudes of the gust on the roof and of the sine on the first floor, in N."""
MODAL_RATIOS = (0.02, 0.08)
"""Damping ratios of the first and the last mode; those between rise evenly."""
DIFFERENCES = (
    "exact_against_extrapolated",
    "forces_against_extrapolated",
    "modal_damping_against_extrapolated",
    "same_scheme",
)
"""Differences of both programs that may be 1e-6 of the peak."""
FOLLOWED, COARSE = 2.0, 0.1
"""Length and step of the envelopes' nodes, in s."""
SPREAD, PARTS, TOLERANCE, TRIED = 0.05, 10, 1e-3, 2000
"""Half width of a factor, parts of the box of the columns, wanted error, motions that judge."""


def opensees() -> Any:
    """OpenSees as a module; its wheel is fetched once into the cache."""
    cache = os.environ.get("ALPHACUT_CACHE") or Path.home() / ".cache" / "alphacut"
    folder = Path(cache) / WHEEL.replace("==", "-")
    if not (folder / "openseespylinux").is_dir():
        words = ["--quiet", "--no-deps", "--target", str(folder), WHEEL]
        subprocess.run([sys.executable, "-m", "pip", "install", *words], check=True)
    sys.path.insert(0, str(folder))
    import openseespylinux.opensees as module

    return module


def record(seed: int) -> Accelerogram:
    """Filtered noise that begins and ends at rest, in m/s²."""
    rng = np.random.default_rng(seed)
    count = round(DURATION / STEP) + 1
    rough = np.convolve(rng.normal(size=count), np.hanning(9), "same")
    return Accelerogram(STEP, rough * np.hanning(count))


def build(ops: Any, columns: float, beams: float) -> list[tuple[int, int]]:
    """The frame with factors on the moduli of both groups; nodes and directions of its unknowns."""
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 3)
    lines = BAYS + 1
    for storey in range(STOREYS + 1):
        for line in range(lines):
            ops.node(storey * lines + line + 1, line * WIDTH, storey * HEIGHT)
    for line in range(lines):
        ops.fix(line + 1, 1, 1, 1)
    ops.geomTransf("Linear", 1)
    members = [
        ((s * lines + b + 1, (s + 1) * lines + b + 1), COLUMN, columns)
        for s in range(STOREYS)
        for b in range(lines)
    ]
    members += [
        ((s * lines + b + 1, s * lines + b + 2), BEAM, beams)
        for s in range(1, STOREYS + 1)
        for b in range(BAYS)
    ]
    for tag, (ends, (area, moment), factor) in enumerate(members, start=1):
        ops.element("elasticBeamColumn", tag, *ends, area, factor * MODULUS, moment, 1)
    free = range(lines + 1, (STOREYS + 1) * lines + 1)
    for node in free:
        share = 0.5 if (node - 1) % lines in (0, BAYS) else 1.0
        ops.mass(node, share * JOINT[0], share * JOINT[0], share * JOINT[1])
    return [(node, direction) for node in free for direction in (1, 2, 3)]


def assembled(ops: Any, unknowns: Sequence[tuple[int, int]], mass: float, stiff: float) -> Array:
    """Matrix mass · M + stiff · K of the model in the order of its unknowns."""
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    ops.test("NormUnbalance", 1.0, 1)
    ops.algorithm("Linear")
    ops.integrator("GimmeMCK", mass, 0.0, stiff)
    ops.analysis("Transient")
    ops.analyze(1, 0.0)
    size = ops.systemSize()
    matrix = np.array(ops.printA("-ret")).reshape(size, size)
    order = [ops.nodeDOFs(node)[direction - 1] for node, direction in unknowns]
    return matrix[np.ix_(order, order)]


def structure(ops: Any, ground: Accelerogram | None) -> MatrixStructure:
    """The frame's matrices with a factor on each group of members and on all masses."""
    parts = []
    for factors in ((1.0, 1.0), (2.0, 1.0)):
        unknowns = build(ops, *factors)
        parts.append(assembled(ops, unknowns, 0.0, 1.0))
    build(ops, 1.0, 1.0)
    M = assembled(ops, unknowns, 1.0, 0.0)
    columns = parts[1] - parts[0]
    beams, (a, b) = parts[0] - columns, RAYLEIGH
    M, columns, beams = ((x + x.T) / 2 for x in (M, columns, beams))
    sway = np.array([float(direction == 1) for _, direction in unknowns])
    roof, first = np.zeros(len(sway)), np.zeros(len(sway))
    roof[unknowns.index((WATCHED[0], 1))] = 1.0
    first[unknowns.index((WATCHED[1], 1))] = 1.0
    return MatrixStructure(
        parameters={"columns": 1.0, "beams": 1.0, "mass": 1.0},
        mass=[("mass", M)],
        stiffness=[("columns", columns), ("beams", beams)],
        damping=[("mass", a * M), ("columns", b * columns), ("beams", b * beams)],
        observed={"roof": roof, "drift1": first},
        ground=ground,
        pattern=sway,
    )


def write_case(ops: Any, path: Path) -> None:
    """Writes the frame as a case with a folder of its matrices."""
    unknowns = [f"{node}.{'xyr'[direction - 1]}" for node, direction in build(ops, 1.0, 1.0)]
    quantities = {"columns": "1 ± 5 %", "beams": "1 ± 5 %", "mass": "1 ± 5 %"}
    title = "Frame of three bays and six storeys from OpenSees"
    frame = structure(ops, None)
    sections = """[envelope]
fuzzy = ["columns", "mass"]
alpha = [0, 1]
duration = "8 s"
step = "0.02 s"
"""
    record = 'accelerogram = "building.record.csv"    # a file of yours\n'
    MatrixCase(title, frame, unknowns, quantities, "x", sections).write(path)
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("direction =", f"{record}direction ="), encoding="utf-8")


def solve_with(ops: Any, integrator: Sequence[str | float], analysis: str) -> None:
    """Set up OpenSees' linear solver."""
    ops.constraints("Plain")
    ops.numberer("RCM")
    ops.system("BandGeneral")
    ops.test("NormUnbalance", 1e-12, 2)
    ops.algorithm("Linear")
    ops.integrator(*integrator)
    ops.analysis(analysis)


def shake(ops: Any, ground: Accelerogram) -> None:
    """Move the ground of OpenSees' frame by the record."""
    samples = [float(x) for x in ground.acceleration]
    ops.timeSeries("Path", 1, "-dt", ground.step, "-values", *samples)
    ops.pattern("UniformExcitation", 1, 1, "-accel", 1)


def push(ops: Any) -> None:
    """Hold OpenSees' frame at rest under the gust's first value, then add both forces."""
    roof, first = WATCHED
    ops.timeSeries("Constant", 1)
    ops.pattern("Plain", 1, 1)
    ops.load(roof, float(FORCES[0] * GUST.samples[0]), 0.0, 0.0)
    solve_with(ops, ("LoadControl", 1.0), "Static")
    ops.analyze(1)
    ops.loadConst("-time", 0.0)
    ops.wipeAnalysis()
    changes = [float(x) for x in GUST.samples - GUST.samples[0]]
    ops.timeSeries("Path", 2, "-dt", GUST.step, "-values", *changes)
    ops.pattern("Plain", 2, 2)
    ops.load(roof, FORCES[0], 0.0, 0.0)
    ops.timeSeries("Trig", 3, 0.0, 2 * DURATION, 1 / HERTZ)
    ops.pattern("Plain", 3, 3)
    ops.load(first, FORCES[1], 0.0, 0.0)


def motion(ops: Any, load: Callable[[], None], parts: int, ratios: Sequence[float] = ()) -> Array:
    """Roof and first drift by OpenSees with Newmark's scheme at nodes of the record, (T, 2).

    Args:
        ops: OpenSees.
        load: Puts the loads on the frame.
        parts: Time steps in each step of the record.
        ratios: Damping ratios of all modes; Rayleigh's damping unless given.
    """
    build(ops, 1.0, 1.0)
    a, b = RAYLEIGH
    if ratios:
        ops.eigen("-fullGenLapack", len(ratios))
        ops.modalDamping(*ratios)
    else:
        ops.rayleigh(a, 0.0, b, 0.0)
    load()
    solve_with(ops, ("Newmark", 0.5, 0.25), "Transient")
    if ratios:  # whose damping matrix is full
        ops.system("FullGeneral")
    found = [[ops.nodeDisp(node, 1) for node in WATCHED]]
    for _ in range(round(DURATION / STEP)):
        if ops.analyze(parts, STEP / parts) != 0:
            raise RuntimeError("OpenSees: a step failed")
        found.append([ops.nodeDisp(node, 1) for node in WATCHED])
    return np.array(found)


def largest_difference(ops: Any, system: MatrixStructure, load: Callable[[], None]) -> float:
    """Largest difference of exact motions and OpenSees' extrapolated ones, as share of the peak."""
    exact = LinearFlow(system, (), DURATION, STEP, Exact()).values(np.zeros((1, 0)))[0]
    ratios = [float(ratio) for ratio in system.ratios]
    coarse, fine = (motion(ops, load, parts, ratios) for parts in (20, 40))
    extrapolated = fine + (fine - coarse) / 3
    return float((np.abs(exact - extrapolated).max(0) / np.abs(exact).max(0)).max())


def compare(seed: int) -> dict[str, float | str | bool]:
    """Largest differences of both programs' motions, as shares of the peaks, and the envelope."""
    ops, ground = opensees(), record(seed)
    system = structure(ops, ground)
    pushed = replace(
        system,
        ground=None,
        loads=(
            Force(system.observed["roof"], FORCES[0], GUST),
            Force(system.observed["drift1"], FORCES[1], History.harmonic(HERTZ)),
        ),
    )

    ratios = np.linspace(*MODAL_RATIOS, system.size).tolist()
    modal = replace(system, damping=(), ratios=ratios)

    def shaken() -> None:
        shake(ops, ground)

    midpoint = LinearFlow(system, (), DURATION, STEP, INTEGRATORS["midpoint"])
    ours = midpoint.values(np.zeros((1, 0)))[0]
    difference = np.abs(ours - motion(ops, shaken, 1)).max(0) / np.abs(ours).max(0)
    told: dict[str, float | str | bool] = {
        "seed": seed,
        "unknowns": system.size,
        "moving": excited(system).size,
        "exact_against_extrapolated": largest_difference(ops, system, shaken),
        "forces_against_extrapolated": largest_difference(ops, pushed, lambda: push(ops)),
        "modal_damping_against_extrapolated": largest_difference(ops, modal, shaken),
        "same_scheme": float(difference.max()),
    }
    told |= judged("modulus and masses", of_modulus(system), ("modulus", "mass"), 1, seed)
    return told | judged("columns", system, ("columns",), PARTS, seed)


def of_modulus(system: MatrixStructure) -> MatrixStructure:
    """The same frame with one factor on all members."""
    M: Array = system.mass[0][1]
    K: Array = np.sum([array for _, array in system.stiffness], axis=0)
    a, b = RAYLEIGH
    return replace(
        system,
        parameters={"modulus": 1.0, "mass": 1.0},
        stiffness=[("modulus", K)],
        damping=[("mass", a * M), ("modulus", b * K)],
    )


def judged(
    label: str, system: MatrixStructure, names: Sequence[str], parts: int, seed: int
) -> dict[str, float | str | bool]:
    """A guaranteed envelope in parts of the first input, and random exact motions of all of it."""
    begun, found = time.perf_counter(), []
    cuts = [float(x) for x in np.linspace(1 - SPREAD, 1 + SPREAD, parts + 1)]
    for low, high in pairwise(cuts):
        inputs = {name: Interval(1 - SPREAD, 1 + SPREAD) for name in names}
        inputs[names[0]] = Interval(low, high)
        motion = {"duration": FOLLOWED, "step": COARSE, "alpha": (0.0,), "relative": True}
        found.append(envelope(excited(system), inputs, tolerance=TOLERANCE, **motion))  # type: ignore[arg-type]
    seconds = time.perf_counter() - begun
    lower = np.min([one.lower[0] for one in found], axis=0)
    upper = np.max([one.upper[0] for one in found], axis=0)
    rng = np.random.default_rng(seed)
    points = 1 + SPREAD * rng.uniform(-1, 1, (TRIED, len(names)))
    ends = rng.random(points.shape) < 0.3
    points[ends] = np.where(rng.random(points.shape) < 0.5, 1 - SPREAD, 1 + SPREAD)[ends]
    flow = LinearFlow(system, tuple(names), FOLLOWED, COARSE, Exact())
    motions = np.concatenate([flow.values(part) for part in np.array_split(points, TRIED // 50)])
    beyond = np.maximum(motions.max(0) - upper, lower - motions.min(0))
    peak = np.abs(motions).max((0, 1))
    reached = np.minimum(upper - motions.max(0), motions.min(0) - lower) / peak
    bounds = ", ".join(
        f"{name} {1e3 * lower[:, k].min():.4f} … {1e3 * upper[:, k].max():.4f} mm"
        for k, name in enumerate(system.outputs)
    )
    return {
        f"{label}: nature": ", ".join(sorted({one.nature for one in found})),
        f"{label}: bounds": bounds,
        f"{label}: unproved": "; ".join({str(x.facts.get("unproved", "")) for x in found} - {""}),
        f"{label}: motions outside": int((beyond > 0).sum()),
        f"{label}: wider than {TRIED} motions, share of peak": float(np.median(reached)),
        f"{label}: seconds": seconds,
    }


def main() -> int:
    """Compare and print; fails where the motions differ by more than 1e-6 of the peak."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=int(time.time()), help="of the record")
    parser.add_argument("--write", metavar="CASE.toml", help="write the frame as a case, no more")
    given = parser.parse_args()
    if given.write:
        write_case(opensees(), Path(given.write))
        return 0
    found = compare(given.seed)
    print(json.dumps(found, indent=2))
    agree = all(float(found[x]) < 1e-6 for x in DIFFERENCES)
    natures = [value for key, value in found.items() if key.endswith(": nature")]
    outside = sum(int(value) for key, value in found.items() if key.endswith(": motions outside"))
    return int(not (agree and set(natures) == {"guaranteed"} and not outside))


if __name__ == "__main__":
    raise SystemExit(main())
