#!/usr/bin/env bash
# Pelicun 3.10.0: the name of a component with a hyphen becomes two levels of an index.
# Guess: a component is called as one likes, 'moment-frame' as well as 'moment_frame', in every table alike.
# Seen: the index of each table is split at hyphens, as headings of demands ('1-PID-1-1') are. 'moment-frame' becomes the pair
#   (moment, frame), under which its own units are not found: KeyError, which names neither the component nor the hyphen.
# Why it matters here: damage states of a frame are written as a table for Pelicun, under a name that the user gives.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check pelicun==3.10.0 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import pandas as pd
from pelicun.assessment import Assessment

def quantities(name):
    table = pd.DataFrame({"Units": ["ea"], "Location": ["1"], "Direction": ["1"], "Theta_0": ["3"], "Family": [None]}, index=[name])
    asset = Assessment({"PrintLog": False, "Verbose": False, "Seed": 1}).asset
    asset.load_cmp_model({"marginals": table})
    asset.generate_cmp_sample(4)
    return asset.save_cmp_sample().iloc[:, 0].tolist()

print("moment_frame", quantities("moment_frame"))
assert quantities("moment_frame") == [3, 3, 3, 3]
try:
    quantities("moment-frame")
except KeyError as error:
    print("moment-frame", repr(error))
    assert "tuple" in str(error) and "moment" not in str(error)
else:
    raise SystemExit("a hyphen is taken now")
PROGRAM
