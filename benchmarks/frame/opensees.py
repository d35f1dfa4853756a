"""A frame of three bays and six storeys from OpenSees: its matrices here, its motion there.

OpenSees builds the frame of elastic beams and columns with masses at its joints and gives mass and
stiffness of each group of members. From these matrices comes an envelope with fuzzy groups, and the
motion under a record, which is compared with OpenSees' own: with the same scheme and step, and the
exact one with Newmark's scheme extrapolated by Richardson. The wheel comes from PyPI into a folder
of its own. The envelope of 72 unknowns is not proved: the bound of the polynomials' error takes
more than the gap; `unproved` says so. Run `python -m benchmarks.frame.opensees --help`.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.frame import Accelerogram, Exact, LinearFlow, MatrixStructure, envelope
from alphacut.frame.calculus.jet import Array
from alphacut.frame.dynamics.integrators import INTEGRATORS
from alphacut.fuzzy import Interval

WHEEL = "openseespylinux==3.8.0.0"
STOREYS, BAYS, HEIGHT, WIDTH = 6, 3, 3.2, 6.0
COLUMN, BEAM = (0.16, 2.1e-3), (0.18, 5.4e-3)  # area in m², second moment in m⁴
JOINT = (50e3, 40e3)  # mass in kg and moment of inertia in kg m² of a joint inside; at a side half
MODULUS = 30e9
RAYLEIGH = (0.3, 2e-3)
STEP, DURATION = 0.02, 8.0


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
    roof[unknowns.index(((STOREYS + 1) * (BAYS + 1), 1))] = 1.0
    first[unknowns.index((2 * (BAYS + 1), 1))] = 1.0
    return MatrixStructure(
        parameters={"columns": 1.0, "beams": 1.0, "mass": 1.0},
        mass=[("mass", M)],
        stiffness=[("columns", columns), ("beams", beams)],
        damping=[("mass", a * M), ("columns", b * columns), ("beams", b * beams)],
        observed={"roof": roof, "drift1": first},
        ground=ground,
        pattern=sway,
    )


def motion(ops: Any, ground: Accelerogram, parts: int) -> Array:
    """Roof and first drift by OpenSees with Newmark's scheme at nodes of the record, (T, 2)."""
    build(ops, 1.0, 1.0)
    a, b = RAYLEIGH
    ops.rayleigh(a, 0.0, b, 0.0)
    samples = [float(x) for x in ground.acceleration]
    ops.timeSeries("Path", 1, "-dt", ground.step, "-values", *samples)
    ops.pattern("UniformExcitation", 1, 1, "-accel", 1)
    ops.constraints("Plain")
    ops.numberer("RCM")
    ops.system("BandGeneral")
    ops.test("NormUnbalance", 1e-12, 2)
    ops.algorithm("Linear")
    ops.integrator("Newmark", 0.5, 0.25)
    ops.analysis("Transient")
    watched = ((STOREYS + 1) * (BAYS + 1), 2 * (BAYS + 1))
    found = [[0.0, 0.0]]
    for _ in range(len(samples) - 1):
        if ops.analyze(parts, ground.step / parts) != 0:
            raise RuntimeError("OpenSees: a step failed")
        found.append([ops.nodeDisp(node, 1) for node in watched])
    return np.array(found)


def compare(seed: int) -> dict[str, float | str | bool]:
    """Largest differences of both programs' motions, as shares of the peaks, and the envelope."""
    ops, ground = opensees(), record(seed)
    system = structure(ops, ground)
    nothing = np.zeros((1, 0))
    exact = LinearFlow(system, (), DURATION, STEP, Exact()).values(nothing)[0]
    peak = np.abs(exact).max(0)
    coarse, fine = (motion(ops, ground, parts) for parts in (20, 40))
    extrapolated = fine + (fine - coarse) / 3
    newmark = LinearFlow(system, (), DURATION, STEP, INTEGRATORS["newmark"]).values(nothing)[0]
    same = motion(ops, ground, 1)
    begun = time.perf_counter()
    found = envelope(
        system,
        {"columns": Interval(0.95, 1.05)},
        duration=2.0,
        step=0.1,
        alpha=(0.0,),
        relative=True,
        tolerance=1e-3,
    )
    seconds = time.perf_counter() - begun
    nodes = exact[: len(found.time) * 5 : 5]
    assert found.error is not None
    low, high = found.lower[0] - found.error[0], found.upper[0] + found.error[0]
    return {
        "seed": seed,
        "unknowns": system.size,
        "exact_against_extrapolated": float((np.abs(exact - extrapolated).max(0) / peak).max()),
        "same_scheme": float((np.abs(newmark - same).max(0) / peak).max()),
        "nature": found.nature,
        "nominal_inside": bool(((nodes >= low) & (nodes <= high)).all()),
        "seconds": seconds,
        "unproved": str(found.facts.get("unproved", "")),
    }


def main() -> int:
    """Compare and print; fails where the motions differ by more than 1e-6 of the peak."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=int(time.time()), help="of the record")
    found = compare(parser.parse_args().seed)
    print(json.dumps(found, indent=2))
    agree = all(float(found[x]) < 1e-6 for x in ("exact_against_extrapolated", "same_scheme"))
    return int(not (agree and found["nominal_inside"]))


if __name__ == "__main__":
    raise SystemExit(main())
