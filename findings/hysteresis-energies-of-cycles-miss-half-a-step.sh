#!/usr/bin/env bash
# hysteresis 2.0.5: the energies of a loop's cycles do not add up to that of the loop, and the last slope of a curve is
#   divided by its first step.
# Guess: `CycleAreas` of an elastic, perfectly plastic loop add to its `NetArea`; a straight line of slope 2 has slope 2
#   at each of its points, whatever their spacing.
# Seen: `NetArea` is right; each cycle lacks half of its last step, at 4 steps a quarter of a cycle 10 of 11.5. (A
#   cycle has no area before its own setArea(), although that of the hysteresis is asked when it is made.) The line's
#   last slope is 40 where its first step is 0.1 and its last 2; after a reversal it has the wrong sign.
# Why it matters here: dissipated energy by cycle and stiffness after yielding are what one takes from the motion of a
#   storey that yields; `dissipated` here is that of the whole motion, which is what the balance of energy checks.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check hysteresis==2.0.5 numpy==2.4.6 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import numpy as np
from hysteresis import Hysteresis, SimpleCurve

for steps in (4, 40, 400):
    drift = np.interp(np.arange(4 * steps + 1), [0, steps, 3 * steps, 4 * steps], [0, 4, -4, 0])
    force = np.zeros(len(drift))
    for k in range(1, len(drift)):
        force[k] = np.clip(force[k - 1] + drift[k] - drift[k - 1], -1, 1)
    energy = ((force[1:] + force[:-1]) / 2 * np.diff(drift)).sum()
    loop = Hysteresis(np.column_stack([drift, force]))
    for cycle in loop.cycles:
        cycle.setArea()
    loop.setNetArea()
    loop.setCycleNetAreas()
    print(f"{steps} steps a quarter: loop {loop.NetArea:.4f}, sum of its cycles {loop.CycleAreas.sum():.4f}, right {energy:.4f}")
    assert np.isclose(loop.NetArea, energy)
    missing = sum((c.xy[-1, 0] - c.xy[-2, 0]) * (c.xy[-1, 1] + c.xy[-2, 1]) / 4 for c in loop.cycles)
    assert np.isclose(energy - loop.CycleAreas.sum(), missing) and missing > 0
there = np.array([0, 0.1, 0.2, 1, 2, 4])
for name, x in (("a line of slope 2", there), ("the same, there and back", np.append(there, 0))):
    line = SimpleCurve(np.column_stack([x, 2 * x]))
    line.setSlope()
    print(f"{name}: slopes {line.slope.round(6).tolist()}")
    assert np.isclose(line.slope[-1], 2 * (x[-1] - x[-2]) / (x[1] - x[0]))
PROGRAM
