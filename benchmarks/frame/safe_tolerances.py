"""How far may the supports of the building case be scaled, and is the proved box safe?

Runs the stage of `alphacut tolerances` on the case, then draws corners and points of the safe box
and computes their motions by the exact propagator: none may pass the limit. Prints the safe and the
unsafe scale, their gap, the largest motion drawn as a share of the limit, and the time.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from alphacut.case.load import load
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.fuzzy import Crisp
from alphacut.stages.material.modulus import stand_in
from alphacut.stages.vibration.structure import structure
from alphacut.stages.vibration.tolerances import tolerances


def main(arguments: Sequence[str] | None = None) -> None:
    """Compute, check and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("case", type=Path, nargs="?", default=Path("cases/building.toml"))
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("--most", type=float, default=1.5)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--seed", type=int, default=None, help="default: a new one, printed")
    options = parser.parse_args(arguments)
    case = load(options.case, {})
    handed = stand_in(case)
    result = tolerances(case, handed, most=options.most, workers=options.workers)
    found = result.found
    print(
        f"safe {found.safe}, unsafe {found.unsafe}, gap {found.gap:.2%}, {found.nature}, "
        f"{found.boxes} boxes, {found.seconds:.1f} s"
    )
    seed = np.random.SeedSequence(options.seed).entropy
    rng = np.random.default_rng(seed)
    modulus = handed or Crisp(float(found.nominal[found.names.index("E")]))
    frame = structure(case, modulus).frame
    assert frame is not None
    flow = LinearFlow(
        replace(frame, outputs=tuple(result.limits)),
        found.names,
        case.envelope.duration,
        case.envelope.step,
        Exact(),
    )
    limits = np.array(list(result.limits.values()))
    worst, left = 0.0, options.points
    while left > 0:
        unit = rng.uniform(-1, 1, (min(left, 500), len(found.names)))
        unit[::2] = np.sign(unit[::2])
        middle, half = (found.lower + found.upper) / 2, (found.upper - found.lower) / 2
        reached = np.abs(flow.values(middle + half * unit)).max((0, 1))
        worst = max(worst, float((reached / limits).max()))
        left -= len(unit)
    print(f"seed {seed}: {options.points} corners and points reach {worst:.6f}")
    assert worst <= 1


if __name__ == "__main__":
    main()
