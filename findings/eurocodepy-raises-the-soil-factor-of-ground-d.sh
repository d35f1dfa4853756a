#!/usr/bin/env bash
# eurocodepy 2027.0.12: the soil factor of EN 1998-1 for type 2 and ground D depends on the acceleration.
# Guess: Table 3.3 of EN 1998-1:2004 has S = 1.8 for ground D, whatever a_g.
# Seen: get_spec_params of "EU", "CEN_2" gives 1.88 up to a_g = 1 m/s^2, 1.8 from 4 m/s^2 on, and numbers between in
#   between. All other grounds, and type 1, have the factors of the code.
# Why it matters here: spectra are compared with this package, so that its table is read at .5 g.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check numpy==2.4.6 2>/dev/null
environment/bin/pip install --quiet --disable-pip-version-check --no-deps eurocodepy==2027.0.12 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
from eurocodepy.ec8.spectrum import get_spec_params
factors = {zone: get_spec_params("EU", "CEN_2", "ii", "D", zone)[0] for zone in ("_1g", "_2g", "_5g")}
print(factors)
assert factors["_1g"] == 1.88 and 1.8 < factors["_2g"] < 1.88 and factors["_5g"] == 1.8
PROGRAM
