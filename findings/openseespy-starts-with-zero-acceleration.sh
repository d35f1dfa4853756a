#!/usr/bin/env bash
# OpenSeesPy (openseespylinux 3.7.1.2): a transient analysis begins with acceleration zero, whatever acts at the
# start.
# Guess: the initial acceleration solves M a = f - K u at the first step, so that Newmark (1/2, 1/4) is of second
#   order.
# Seen: nodeAccel is 0 at the start of a free vibration from u0 and under a constant load, and the displacement's
#   error falls with the step's first power (2.1 to 2.4 times for half the step), not with its second.
# Why it matters here: as a judge of envelopes OpenSees is compared at falling steps: Richardson's extrapolation with
#   second order would be wrong for motions that start displaced.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check openseespylinux==3.7.1.2 numpy==2.4.6 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import numpy as np, openseespylinux.opensees as ops
def error(step):
    ops.wipe(); ops.model("basic", "-ndm", 1, "-ndf", 1)
    ops.node(1, 0.0); ops.node(2, 0.0); ops.fix(1, 1); ops.mass(2, 1.0)
    ops.uniaxialMaterial("Elastic", 1, 100.0); ops.element("zeroLength", 1, 1, 2, "-mat", 1, "-dir", 1)
    ops.setNodeDisp(2, 1, 0.1, "-commit")
    ops.constraints("Plain"); ops.numberer("Plain"); ops.system("FullGeneral"); ops.algorithm("Linear")
    ops.integrator("Newmark", 0.5, 0.25); ops.analysis("Transient")
    assert ops.nodeAccel(2, 1) == 0.0  # and not -k u0 / m = -10
    motion = [0.1]
    for _ in range(round(1 / step)):
        ops.analyze(1, step); motion.append(ops.nodeDisp(2, 1))
    return np.abs(motion - 0.1 * np.cos(10 * step * np.arange(len(motion)))).max()
errors = np.array([error(step) for step in (0.02, 0.01, 0.005, 0.0025)])
print(errors, errors[:-1] / errors[1:])
assert ((1.9 < errors[:-1] / errors[1:]) & (errors[:-1] / errors[1:] < 2.5)).all()
PROGRAM
