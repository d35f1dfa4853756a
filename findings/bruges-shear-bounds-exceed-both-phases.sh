#!/usr/bin/env bash
# bruges 0.5.4: Hashin-Shtrikman bounds of the shear modulus that lie above both phases.
# Guess: both moduli are right; with 10 and 5 GPa in equal parts the shear modulus lies between 5 and 10.
# Seen: the bulk modulus is right, the shear bounds are 13.78 and 14.03 GPa (right: 7.04 and 7.13), and 3.44 for 1.84
#   GPa with quartz and water-like clay: the expression of the bulk modulus is returned with another constant.
# Why it matters here: the package is what one finds first to check a two-phase bound in Python; tests here use the
#   formula itself.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check bruges==0.5.4 numpy==2.4.6 scipy==1.17.1 matplotlib==3.10.7 setuptools==80.9.0 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import numpy as np, bruges
def hashin_shtrikman(f, K, G, k):  # bounds by the comparison medium k (Hashin, Shtrikman 1963)
    zeta = G[k] / 6 * (9 * K[k] + 8 * G[k]) / (K[k] + 2 * G[k])
    return 1 / (f / (K + 4 / 3 * G[k])).sum() - 4 / 3 * G[k], 1 / (f / (G + zeta)).sum() - zeta
f, K, G = np.array([0.5, 0.5]), np.array([10.0, 20.0]), np.array([10.0, 5.0])
right = np.array([hashin_shtrikman(f, K, G, k) for k in (G.argmin(), G.argmax())])
bulk = bruges.rockphysics.hashin_shtrikman(f, K, G, modulus="bulk")
shear = bruges.rockphysics.hashin_shtrikman(f, K, G, modulus="shear")
print(bulk, shear, right)
assert np.allclose(bulk, right[:, 0])
assert min(shear) > G.max() and np.allclose(shear, (13.7755, 14.0323), atol=1e-3)
PROGRAM
