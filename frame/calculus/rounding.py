"""The unit roundoff u, by which rounding is bounded (Higham 2002, section 2.2)."""

from __future__ import annotations

import numpy as np

# The largest relative error of one rounded operation: half the distance of 1 and the next number.
UNIT_ROUNDOFF = float(np.finfo(float).eps) / 2
