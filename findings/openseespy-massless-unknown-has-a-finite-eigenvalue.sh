#!/usr/bin/env bash
# OpenSeesPy (openseespylinux 3.7.1.2): a massless unknown is an eigenvalue of 1.797e308, and ARPACK cannot give all
# modes that there are.
# Guess: of three unknowns, one of them massless, eigen(2) gives both frequencies and eigen(3) is refused or infinite.
# Seen: the default solver fails for 2 with an exception that says only 'See stderr output'; -fullGenLapack gives 30,
#   200 and the largest double, a number that is finite.
# Why it matters here: lists of natural frequencies from OpenSees are brought as measured or computed modes: a value
#   above 1e100 is no mode.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check openseespylinux==3.7.1.2 numpy==2.4.6 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import numpy as np, openseespylinux.opensees as ops
def chain():
    ops.wipe(); ops.model("basic", "-ndm", 1, "-ndf", 1)
    ops.node(0, 0.0); ops.fix(0, 1)
    for number, (mass, stiffness) in enumerate(((2.0, 100.0), (0.0, 200.0), (1.0, 300.0)), 1):
        ops.node(number, 0.0)
        if mass:
            ops.mass(number, mass)
        ops.uniaxialMaterial("Elastic", number, stiffness)
        ops.element("zeroLength", number, number - 1, number, "-mat", number, "-dir", 1)
chain()
found = ops.eigen("-fullGenLapack", 3)
print(found)
assert np.allclose(found[:2], (30, 200)) and found[2] == np.finfo(float).max
chain()
try:
    ops.eigen("-genBandArpack", 2)
except Exception as error:
    print(type(error).__name__, error)
    assert "stderr" in str(error)
else:
    raise AssertionError
PROGRAM
