#!/usr/bin/env bash
# scikit-fuzzy 0.5.0: [1, 2] / [-1, 1] is [-2, 2].
# Guess: division by an interval that holds zero is refused or unbounded: the quotients are (-inf, -1] and [1, inf).
# Seen: intervals.divval returns the hull of the quotients of the ends, [-2, 2]: it holds 0, which is no quotient, and
#   leaves out 10 = 1 / 0.1.
# Why it matters here: an interval computed so is neither an inner nor an outer bound, and cannot be a reference for
#   `propagate`.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check scikit-fuzzy==0.5.0 numpy==2.4.6 scipy==1.17.1 networkx==3.6.1 packaging==25.0 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import numpy as np
from skfuzzy import intervals
found = intervals.divval(np.array([1.0, 2.0]), np.array([-1.0, 1.0]))
print(found, "without 10 = 1 / 0.1")
assert np.allclose(found, (-2, 2))
assert np.allclose(intervals.divval(np.array([1.0, 2.0]), np.array([2.0, 4.0])), (0.25, 1))
PROGRAM
