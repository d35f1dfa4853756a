#!/usr/bin/env bash
# Pint 0.25.3: 'kNm' is no moment and 'gal' no acceleration.
# Guess: kNm is refused (no such prefix) or read as kN m; gal, as strong-motion files write it, is 0.01 m/s2.
# Seen: Nm is the metric yarn number (1 km/kg), so 1 kNm is 1e6 m/kg, and gal is a gallon; 'kN m' and 'Gal' are right;
#   '5 %g' is 0.05 gram.
# Why it matters here: moments and records come with these very words, and quantities of a case are read with Pint:
#   write 'kN m' and 'Gal'.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check pint==0.25.3 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import pint
units = pint.UnitRegistry()
for text in ("1 kNm", "1 kN m", "1 gal", "1 Gal", "5 %g"):
    print(text, "=", units(text).to_base_units())
assert units("1 kNm").check("[length]/[mass]") and units("1 kNm").to("m/kg").magnitude == 1e6
assert units("1 kN m").to("J").magnitude == 1000
assert units("1 gal").check("[volume]") and units("1 Gal").to("m/s**2").magnitude == 0.01
assert abs(units("5 %g").to("kg").magnitude - 5e-5) < 1e-18
PROGRAM
